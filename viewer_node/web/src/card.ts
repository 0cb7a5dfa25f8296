// SPDX-License-Identifier: Apache-2.0
// card.ts: the frame of a plot: title, legend, figures; and small helpers for the DOM.
import type { NodeName, Telemetry } from "./telemetry";

export interface Palette {
  ink: string;
  faint: string;
  line: string;
  of: (name: string) => string;
}

/** Data and time window on display. */
export interface View {
  telemetry: Telemetry;
  end_s: number; // device's clock
  physics_end_s: number; // physics' clock
  window_s: number;
  /** Nodes whose newest values still hold. */
  is_fresh: Record<NodeName, boolean>;
}

export class Card {
  readonly element: HTMLElement;
  readonly body: HTMLElement;
  readonly values: HTMLElement[] = [];

  constructor(parent: HTMLElement, id: string, title: string, unit: string, help: string, series: { label: string; colour: string; dash?: boolean }[], extra?: HTMLElement) {
    this.element = make("section", "card");
    this.element.id = `plot-${id}`;
    const head = make("header", "card-head");
    const heading = make("h2", "", title);
    heading.id = `title-${id}`;
    heading.title = help;
    if (unit) heading.append(make("span", "unit", unit));
    this.element.setAttribute("aria-labelledby", heading.id);
    head.append(heading);
    if (extra) head.append(extra);
    const legend = make("dl", "legend");
    for (const { label, colour, dash } of series) {
      const item = make("div", "key");
      const term = make("dt", "", label);
      const swatch = make("i", dash ? "swatch dashed" : "swatch");
      swatch.style.color = `var(${colour})`;
      term.prepend(swatch);
      const value = make("dd", "", "–");
      this.values.push(value);
      item.append(term, value);
      legend.append(item);
    }
    this.body = make("div", "plot");
    this.body.setAttribute("role", "img");
    this.body.setAttribute("aria-label", `${title}. ${help}`);
    this.element.append(head, legend, this.body);
    parent.append(this.element);
  }
}

export function fixed(value: number): string {
  return String(Number(value.toPrecision(4))).replace("-", "\u2212");
}

/** An element with a class and text. */
export function make<K extends keyof HTMLElementTagNameMap>(tag: K, class_name = "", text = ""): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (class_name) element.className = class_name;
  if (text) element.textContent = text;
  return element;
}
/** Sets text only if it differs, to avoid layout. */
export function write(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}
