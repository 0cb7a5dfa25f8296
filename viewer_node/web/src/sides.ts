// SPDX-License-Identifier: Apache-2.0
// sides.ts: a session with several devices: which of them is on display, and what /health tells of
// the others, to whose telemetry the page does not subscribe.
import { make } from "./card";
import { segments } from "./panels";
import { gone_words } from "./state";
import { kNodes } from "./telemetry";
import { Guard, kFaultReasons, type Health, type SideState } from "./wire";

/** More than these are chosen from a list, and drawn without their forces unless on display. */
const kMostButtons = 4;
const kMostNamed = 3;

export class Sides {
  /** In the order of the session; "" where there is one device. */
  names: string[] = [];
  /** On display. */
  shown = "";
  /** Of /health. */
  states: SideState[] = [];
  private nodes = new Map<string, Health["nodes"][number]>(); // "left.device", …
  private readonly labels: HTMLElement[] = []; // of the tools

  constructor(
    private readonly place: HTMLElement, private readonly picture: HTMLElement, private readonly show: () => void) {}

  get index(): number {
    return Math.max(0, this.names.indexOf(this.shown));
  }
  /** Of the side on display; undefined where there is one device. */
  get state(): SideState | undefined {
    return this.states.find(({ name }) => name === this.shown);
  }
  get are_many(): boolean {
    return this.names.length > kMostButtons;
  }

  take({ sides, nodes }: Health): void {
    this.states = sides;
    this.nodes = new Map(nodes.map((node) => [node.name, node]));
  }

  /** The sides that the server has. */
  set_names(names: string[]): void {
    if (names.join() === this.names.join()) return;
    this.names = names;
    if (!names.includes(this.shown)) this.shown = names[0] ?? "";
    this.place.replaceChildren();
    for (const label of this.labels.splice(0)) label.remove();
    if (names.length < 2) return;
    for (const name of names) {
      const label = make("span", "tool-label", name);
      label.hidden = true;
      this.labels.push(label);
    }
    this.picture.append(...this.labels);
    const choose = (name: string) => {
      this.shown = name;
      this.show();
    };
    if (names.length <= kMostButtons) {
      const list = make("div", "segments");
      list.setAttribute("role", "radiogroup");
      list.setAttribute("aria-label", "Side on display");
      this.place.append(list);
      segments<string>(list, names.map((name) => [name, name]), this.shown, choose);
      return;
    }
    const list = make("select", "button");
    list.setAttribute("aria-label", "Side on display");
    list.append(...names.map((name) => new Option(name, name, false, name === this.shown)));
    list.addEventListener("change", () => choose(list.value));
    this.place.append(list);
  }

  /** The name beside a tool, where it is on the canvas (CSS pixels); null: the tool is not known. */
  label(index: number, at: { x: number; y: number } | null): void {
    const label = this.labels[index];
    if (!label) return;
    label.hidden = at === null;
    if (!at) return;
    const style = `translate(${Math.round(at.x)}px, ${Math.round(at.y)}px)`;
    if (label.style.transform !== style) label.style.transform = style;
    label.classList.toggle("is-shown", this.names[index] === this.shown);
  }

  /**
   * What is wrong with the sides that are not on display: the same of several is said once.
   * @param replay_stands  nodes are silent with it
   */
  problems(replay_stands: boolean): string[] {
    const names_of = new Map<string, string[]>();
    const say = (text: string, name: string) => names_of.set(text, [...(names_of.get(text) ?? []), name]);
    for (const { name, guard, lastFault } of this.states) {
      if (name === this.shown) continue;
      if (guard === Guard.fault) say(`fault, the motors are off until reset: ${kFaultReasons[lastFault] ?? "unknown reason"}.`, name);
      for (const node of replay_stands ? [] : kNodes) {
        const link = this.nodes.get(`${name}.${node}`);
        if (link && !link.isHeard && link.silenceS >= 0) say(gone_words(node, link.silenceS), name);
      }
    }
    return [...names_of].map(([text, names]) => `${names_words(names)}: ${text}`);
  }

  is_heard(name: string): boolean {
    return this.nodes.get(`${name}.device`)?.isHeard ?? false;
  }
}

/** "left, right and 3 more" */
function names_words(names: string[]): string {
  if (names.length <= kMostNamed + 1) return names.join(", ");
  return `${names.slice(0, kMostNamed).join(", ")} and ${names.length - kMostNamed} more`;
}

