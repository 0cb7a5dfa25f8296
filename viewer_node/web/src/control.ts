// SPDX-License-Identifier: Apache-2.0
// control.ts: stiffness and damping of the tissues, changed while the session runs, and ablated tissue
// restored. The page only proposes; physics_node checks, and the scene shows what it applied.
import { make, write } from "./card";
import type { SessionEvent } from "./events";
import type { SceneState } from "./wire";

const kMostStiffness_newton_per_m = 1e6; // common/core/tissue.h
const kMostDamping_newton_s_per_m = 1e4;
const kSliderDecades = 1; // to each side of the session's stiffness
const kAnswer_ms = 3000;
const kLeastPeriod_ms = 200; // physics_node sends its scene as often; a held key repeats thirty times a second

export interface TissueChange {
  tissue: number;
  stiffnessNewtonPerM: number;
  dampingNewtonSPerM: number;
  restores?: boolean;
}

interface Row {
  stiffness: HTMLInputElement;
  damping: HTMLInputElement;
  slider: HTMLInputElement;
  note: HTMLElement;
  sent: TissueChange | null;
  due: ReturnType<typeof setTimeout> | undefined; // of a change that waits
  sent_ms: number;
}

export class TissueControl {
  can_publish = false;
  private readonly card = make("section", "card wide");
  private readonly body = make("div", "tissue-rows");
  private rows = new Map<number, Row>(); // by tissue
  private names = "";
  private initial = new Map<number, TissueChange>();
  private restored: HTMLElement[] = []; // what became of the last request

  constructor(parent: HTMLElement, private readonly publish: (change: TissueChange) => boolean) {
    this.card.id = "control";
    this.card.setAttribute("aria-label", "Material of the tissues");
    const head = make("header", "card-head");
    const reset = make("button", "button", "Reset");
    reset.type = "button";
    reset.title = "The values of the session file";
    reset.addEventListener("click", () => this.initial.forEach((change) => this.send(change)));
    head.append(make("h2", "", "Material"), reset);
    this.card.append(head, this.body);
    this.card.hidden = true;
    parent.append(this.card);
  }

  set_scene(scene: SceneState): void {
    this.card.hidden = !(this.can_publish && scene.acceptsChanges);
    if (this.card.hidden) return;
    const names = JSON.stringify([scene.sessionName, ...scene.tissues.map(({ name }) => name)]);
    if (names !== this.names) this.build(scene);
    this.names = names;
    for (const [tissue, row] of this.rows) {
      const { stiffnessNewtonPerM, dampingNewtonSPerM } = scene.tissues[tissue];
      this.show(row, { tissue, stiffnessNewtonPerM, dampingNewtonSPerM });
      const { sent } = row;
      if (sent?.stiffnessNewtonPerM === stiffnessNewtonPerM && sent.dampingNewtonSPerM === dampingNewtonSPerM) {
        row.sent = null;
        write(row.note, "");
      }
    }
  }

  /** physics_node says that it refused a change. */
  take({ name }: SessionEvent): void {
    if (name === "tissue_restored") this.restored.forEach((note) => write(note, ""));
    if (name !== "tissue_change_refused") return;
    for (const row of this.rows.values()) {
      if (!row.sent) continue;
      row.sent = null;
      write(row.note, "refused: see Events");
    }
  }

  private build(scene: SceneState): void {
    for (const row of this.rows.values()) clearTimeout(row.due);
    this.rows = new Map();
    this.initial = new Map();
    this.restored = [];
    this.body.replaceChildren();
    scene.tissues.forEach(({ name, stiffnessNewtonPerM, dampingNewtonSPerM, isRestorable }, tissue) => {
      if (isRestorable) this.build_restore(name, tissue);
      if (stiffnessNewtonPerM + dampingNewtonSPerM === 0) return; // no material
      this.initial.set(tissue, { tissue, stiffnessNewtonPerM, dampingNewtonSPerM });
      const input = (type: string, label: string, most: number) => {
        const made = make("input");
        made.type = type;
        made.setAttribute("aria-label", `${label} of ${name}`);
        if (type === "number") Object.assign(made, { min: "0", max: String(most), step: "any", required: true });
        made.addEventListener("change", () => this.changed(tissue, made.type === "range"));
        return made;
      };
      const row: Row = {
        stiffness: input("number", "Stiffness, N/m,", kMostStiffness_newton_per_m),
        damping: input("number", "Damping, N·s/m,", kMostDamping_newton_s_per_m),
        slider: input("range", "Stiffness", 0),
        note: make("small"), sent: null, due: undefined, sent_ms: -Infinity,
      };
      const middle = Math.log10(Math.max(stiffnessNewtonPerM, 1e-3));
      Object.assign(row.slider, { min: String(middle - kSliderDecades), max: String(middle + kSliderDecades), step: "0.01" });
      row.slider.addEventListener("input", () => { row.stiffness.value = figure(10 ** row.slider.valueAsNumber); });
      row.note.setAttribute("role", "status");
      const label = make("span", "name", name);
      label.title = name;
      const line = make("div", "tissue-row");
      const unit = (field: HTMLElement, text: string) => {
        const pair = make("label");
        pair.append(field, make("span", "", text));
        return pair;
      };
      line.append(label, row.slider, unit(row.stiffness, "N/m"), unit(row.damping, "N·s/m"), row.note);
      this.rows.set(tissue, row);
      this.body.append(line);
    });
  }

  private build_restore(name: string, tissue: number): void {
    const button = make("button", "button", "Restore");
    button.type = "button";
    button.title = "The whole body, as at the start of the session";
    button.setAttribute("aria-label", `Restore ${name}`);
    const note = make("small");
    note.setAttribute("role", "status");
    button.addEventListener("click", () => {
      const is_sent = this.publish({ tissue, stiffnessNewtonPerM: 0, dampingNewtonSPerM: 0, restores: true });
      write(note, is_sent ? "sent" : "not connected");
    });
    const label = make("span", "name", name);
    label.title = name;
    const line = make("div", "tissue-row");
    line.append(label, button, note);
    this.restored.push(note);
    this.body.append(line);
  }

  private show(row: Row, { stiffnessNewtonPerM, dampingNewtonSPerM }: TissueChange): void {
    const active = document.activeElement;
    if (active !== row.stiffness && active !== row.slider) row.stiffness.value = figure(stiffnessNewtonPerM);
    if (active !== row.damping) row.damping.value = figure(dampingNewtonSPerM);
    if (active !== row.slider) row.slider.value = String(Math.log10(Math.max(stiffnessNewtonPerM, 1e-3)));
  }

  private changed(tissue: number, by_slider: boolean): void {
    const row = this.rows.get(tissue)!;
    if (by_slider) row.stiffness.value = figure(10 ** row.slider.valueAsNumber);
    const bad = [row.stiffness, row.damping].find((field) => !field.checkValidity());
    if (bad) {
      write(row.note, `0 … ${bad.max}`);
      return;
    }
    this.send({ tissue, stiffnessNewtonPerM: row.stiffness.valueAsNumber, dampingNewtonSPerM: row.damping.valueAsNumber });
  }

  /** At once, or when the last one is old enough; the newest counts. */
  private send(change: TissueChange): void {
    const row = this.rows.get(change.tissue)!;
    row.sent = null; // an earlier one no longer matters
    clearTimeout(row.due);
    const wait_ms = row.sent_ms + kLeastPeriod_ms - performance.now();
    if (wait_ms > 0) {
      row.due = setTimeout(() => this.send(change), wait_ms);
      return;
    }
    row.sent = change;
    row.sent_ms = performance.now();
    write(row.note, this.publish(change) ? "sent" : "not connected");
    row.due = setTimeout(() => {
      if (row.sent === change) write(row.note, "no answer yet");
    }, kAnswer_ms);
  }
}

function figure(value: number): string {
  return String(Number(value.toPrecision(4)));
}
