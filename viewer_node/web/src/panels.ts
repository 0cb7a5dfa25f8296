// SPDX-License-Identifier: Apache-2.0
// panels.ts: texts and numbers beside the 3-D view and the plots.
import { make, write } from "./card";
import { css_gradient, tissue_colour } from "./scene/colours";
import type { HandStatus } from "./hand";
import type { SceneView } from "./scene/scene_view";
import { count_words, duration_words, fault_words, forces_of, gone_words, kNodeTasks, node_state, plain_words, state_words, time_words, type Verdict } from "./state";
import { kNodes, norm, type NodeName, type Telemetry } from "./telemetry";
import type { ColourMode, Surface } from "./scene/surface";
import { Guard, type SceneState } from "./wire";

export function by_id<E extends Element = HTMLElement>(id: string): E {
  return document.getElementById(id) as unknown as E;
}

/** A radio group of buttons; arrow keys move the choice. */
export function segments<T extends string | number>(
  element: HTMLElement, choices: [T, string][], chosen: T, choose: (value: T) => void): void {
  const buttons = choices.map(([value, label]) => {
    const button = make("button", "", label);
    button.type = "button";
    button.setAttribute("role", "radio");
    button.dataset.value = String(value);
    button.addEventListener("click", () => select(value));
    element.append(button);
    return button;
  });
  const select = (value: T, does_tell = true) => {
    choices.forEach(([other], i) => {
      buttons[i].setAttribute("aria-checked", String(other === value));
      buttons[i].tabIndex = other === value ? 0 : -1;
    });
    if (does_tell) choose(value);
  };
  element.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    const shown = buttons.filter((button) => !button.hidden);
    const at = shown.indexOf(document.activeElement as HTMLButtonElement);
    if (!step || at < 0) return;
    event.preventDefault();
    event.stopPropagation();
    const next = shown[(at + step + shown.length) % shown.length];
    next.focus();
    next.click();
  });
  select(chosen, false);
}

/** State of each node. */
export class NodeChips {
  private readonly chips: Record<NodeName, { item: HTMLElement; detail: HTMLElement }>;

  constructor(list: HTMLElement) {
    const chip = (name: NodeName) => {
      const item = make("li", "", name);
      const detail = make("small");
      item.append(detail);
      item.title = `${name}_node: ${kNodeTasks[name]}`;
      list.append(item);
      return { item, detail };
    };
    this.chips = { device: chip("device"), mofc: chip("mofc"), physics: chip("physics") };
  }

  /** @param scene  has the rates of the session; null: not known */
  write(telemetry: Telemetry, scene: SceneState | null, is_connected: boolean, now_s: number): void {
    const tick_hz = scene?.deviceRateHz ?? NaN;
    const nominal_hz = { device: tick_hz, mofc: tick_hz, physics: scene?.physicsRateHz ?? NaN };
    for (const name of kNodes) {
      const node = telemetry.nodes[name];
      const { item, detail } = this.chips[name];
      const state = node_state(node, nominal_hz[name], is_connected, now_s);
      if (item.dataset.state !== state) item.dataset.state = state;
      const is_slow = state === "slow";
      item.title = `${name}_node: ${kNodeTasks[name]}${is_slow ? `; slower than its ${count_words(nominal_hz[name])} Hz` : ""}`;
      write(detail, state === "alive" || is_slow ? (Number.isFinite(node.rate_hz) ? `${count_words(Math.round(node.rate_hz))} Hz` : "")
        : state === "gone" ? `gone for ${duration_words(node.silence_s(now_s))}` : "no telemetry");
    }
  }
}

/** A line above the picture. "calm": news that is no fault. */
export interface Banner {
  text: string;
  tone: "calm" | "alarm";
}
const alarm_of = (text: string): Banner => ({ text, tone: "alarm" });

/**
 * @param silence_s  NaN: it was never connected
 * @param verdicts   the last words of the server; empty: it has said none
 * @param refusal    why the last attempt failed; may be empty
 * @param is_plain   without the verdicts, which tell how the force was rendered
 */
export function lost_lines(silence_s: number, verdicts: Verdict[], refusal: string, is_plain: boolean): Banner[] {
  if (verdicts.length > 0) {
    const told = is_plain ? [] : verdicts;
    return [{ text: "The session has ended.", tone: "calm" }, ...told.map(({ words, is_good }): Banner => ({ text: words, tone: is_good ? "calm" : "alarm" }))];
  }
  const lost = Number.isNaN(silence_s) ? "No connection to the viewer’s server. Trying again."
    : `Connection to the viewer’s server lost ${duration_words(silence_s)} ago. Reconnecting.`;
  return [alarm_of(refusal ? `${lost} ${refusal}` : lost)];
}

/** Failures of the side on display. @param side  its name; "": there is one device */
export function banner_lines(telemetry: Telemetry, side: string, now_s: number): Banner[] {
  const lines = kNodes
    .filter((name) => telemetry.nodes[name].is_gone(now_s))
    .map((name) => gone_words(name, telemetry.nodes[name].silence_s(now_s)));
  const recorder = telemetry.health?.recorder;
  if (recorder?.problem) lines.push(`The recording failed: ${recorder.problem}`);
  return lines.map((line) => alarm_of(side ? `${side}: ${line}` : line));
}

/** For screen readers: rare and important changes. */
export function announcement(
  telemetry: Telemetry, is_connected: boolean, has_ended: boolean, hand: HandStatus, problems_of_others: string[], now_s: number): string {
  if (!is_connected) return has_ended ? "The session has ended." : "Connection lost.";
  if (telemetry.guard === Guard.fault) return `Fault: ${fault_words(telemetry)}. The motors are off until reset.`;
  const gone = kNodes.filter((name) => telemetry.nodes[name].is_gone(now_s));
  if (gone.length > 0) return `${gone.map((name) => `${name}_node`).join(" and ")} gone.`;
  // without the seconds, which would be read again and again
  if (problems_of_others.length > 0) return problems_of_others.map((one) => one.replace(/: last heard .*/, ".")).join(" ");
  return hand.is_mine ? "You hold the hand." : hand.is_others ? "Another page holds the hand." : "";
}

export function write_banners(element: HTMLElement, lines: Banner[]): void {
  element.hidden = lines.length === 0;
  while (element.childElementCount > lines.length) element.lastElementChild!.remove();
  while (element.childElementCount < lines.length) element.append(make("p"));
  lines.forEach(({ text, tone }, i) => {
    const line = element.children[i] as HTMLElement;
    write(line, text);
    line.dataset.tone = tone;
  });
}

/** @param is_plain  without what renders the force */
export function write_state(telemetry: Telemetry, is_connected: boolean, has_ended: boolean, is_plain: boolean, now_s: number): void {
  const full = state_words(telemetry, is_connected, now_s, has_ended);
  const words = is_plain ? plain_words(full, telemetry) : full;
  by_id("state").dataset.tone = words.tone;
  write(by_id("state-title"), words.title);
  write(by_id("state-detail"), words.detail);
  const { requested, applied } = forces_of(telemetry, is_connected, now_s);
  write(by_id("force-applied"), applied ? norm(applied).toFixed(2) : "–");
  write(by_id("force-requested"), requested ? norm(requested).toFixed(2) : "–");
  const newton_m = telemetry.applied_newton_m; // null: no wrist
  by_id("torque").hidden = newton_m === null;
  write(by_id("torque-applied"), newton_m && applied ? norm(newton_m).toFixed(3) : "–");
}

const kViewKeys = "Arrow keys rotate it, plus and minus zoom, Home shows everything."; // as in index.html
const kHandKeys = "Arrow keys move it up, down and sideways, Page Up and Down away and back, Escape lets go.";

export function write_hand({ is_allowed, is_mine, is_others, is_held }: HandStatus, is_touching: boolean): void {
  const panel = by_id("touch");
  panel.hidden = !is_allowed;
  const keys = is_allowed && is_touching ? kHandKeys : kViewKeys;
  const canvas = by_id("canvas");
  if (!canvas.getAttribute("aria-label")!.endsWith(keys)) canvas.setAttribute("aria-label", `Three-dimensional view. ${keys}`);
  if (!is_allowed) return;
  panel.classList.toggle("is-mine", is_mine);
  write(by_id("touch-words"),
    is_others ? "Another page holds the hand."
      : is_held ? "You hold the hand. Wheel or Shift: deeper."
        : is_mine ? "You hold the hand."
          : is_touching ? `Drag anywhere to move the hand. ${kHandKeys}`
            : "Drag the tool to touch the tissue.");
  by_id("touch-toggle").setAttribute("aria-pressed", String(is_touching));
}

export function write_tissues(surfaces: Surface[], mode: ColourMode): void {
  const list = by_id("tissues");
  list.replaceChildren(...surfaces.map((surface, index) => {
    const item = make("li");
    const swatch = make("i");
    swatch.style.background = tissue_colour(index);
    const name = make("span", "name", surface.name);
    name.title = surface.name;
    item.append(swatch, name);
    const stiffness = surface.shown_stiffness_newton_per_m;
    if (stiffness > 0) {
      const text = make("small", "", `${count_words(Number(stiffness.toPrecision(3)))} N/m`);
      if (surface.stiffness_newton_per_m === 0) text.title = "of an elastic body: slope of the force on the tip, 1 mm deep";
      item.append(text);
    }
    return item;
  }));
  list.hidden = mode !== "material";
}

const kRamps = {
  stiffness: { title: "Local stiffness, N/m", per_unit: 1 },
  displacement: { title: "Displacement, mm", per_unit: 1e3 },
  strain: { title: "Equivalent strain, %", per_unit: 100 },
};

export function write_scale(view: SceneView, mode: ColourMode): void {
  const ramp = by_id("ramp");
  ramp.hidden = mode === "material";
  if (mode === "material") return;
  const { title, per_unit } = kRamps[mode];
  write(by_id("ramp-title"), title);
  const gradient = css_gradient(mode);
  const bar = ramp.querySelector("i")!;
  if (bar.dataset.mode !== mode) {
    bar.style.background = gradient;
    bar.dataset.mode = mode;
  }
  const figure = (value: number) => Number((per_unit * value).toPrecision(3)).toString();
  write(by_id("ramp-low"), figure(view.scale_low));
  write(by_id("ramp-high"), figure(view.scale_high));
}

/** Ruler and axes: the scale and orientation of the view. */
export class Measure {
  private readonly axes: { line: SVGLineElement; text: SVGTextElement }[];

  constructor(triad: SVGSVGElement) {
    this.axes = (["#c9504f", "#4f9a55", "#4a78c4"] as const).map((colour, i) => {
      const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
      const text = document.createElementNS("http://www.w3.org/2000/svg", "text");
      line.setAttribute("stroke", colour);
      text.textContent = "xyz"[i];
      triad.append(line, text);
      return { line, text };
    });
  }

  write(view: SceneView): void {
    view.axes().forEach(([x, y], i) => {
      const { line, text } = this.axes[i];
      line.setAttribute("x2", (15 * x).toFixed(1));
      line.setAttribute("y2", (15 * y).toFixed(1));
      text.setAttribute("x", (21.5 * x).toFixed(1));
      text.setAttribute("y", (21.5 * y).toFixed(1));
    });
    // the longest of 1, 2, 5 × 10ⁿ mm that fits into 110 px
    let millimetre = 1e-3;
    for (const step of [1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000]) {
      if (1e-3 * step * view.pixels_per_metre <= 110) millimetre = step;
    }
    by_id("ruler").style.width = `${(1e-3 * millimetre * view.pixels_per_metre).toFixed(1)}px`;
    write(by_id("ruler-words"), `${millimetre} mm`);
    write(by_id("arrow-scale"), `1 N = ${Number((1e3 * view.arrow_m_per_newton).toPrecision(2))} mm`);
  }
}

/** Counters since the start. */
export class Counters {
  private readonly values = new Map<string, HTMLElement>();
  private readonly elastic: HTMLElement; // its figures, shown where there is elastic tissue

  constructor(parent: HTMLElement) {
    const card = make("section", "card counters");
    card.setAttribute("aria-label", "Counters since the start");
    const head = make("header", "card-head");
    head.append(make("h2", "", "Since the start"));
    const groups = make("div", "groups");
    const group = (title: string, rows: [string, string, string][]) => {
      const section = make("div");
      const list = make("dl");
      for (const [id, label, help] of rows) {
        const row = make("div");
        row.title = help;
        const value = make("dd", "", "–");
        this.values.set(id, value);
        row.append(make("dt", "", label), value);
        list.append(row);
      }
      section.append(make("h3", "", title), list);
      groups.append(section);
      return section;
    };
    group("Ticks", [
      ["answered", "in time", "answered within the tick, of all scheduled ticks"],
      ["leased", "leased", "ticks with the previous command, within its lease"],
      ["fallback", "fallback", "ticks with at most the device’s own friction"],
      ["limp", "limp", "ticks without force"],
      ["skipped", "skipped", "scheduled ticks missed because of overruns"],
      ["lateness", "worst lateness", "largest delay of a tick’s start"],
    ]);
    group("Force", [
      ["transparency", "transparency", "rendered against requested force, over the session so far"],
      ["clamped", "clamped", "ticks in which the clamp reduced the force"],
      ["monitor", "monitor", "the device’s own check of the energy: commands that it reduced"],
      ["watchdog", "motor watchdog", "whether the motors end a force by themselves; without it the guarantee is not available while the process is stopped"],
      ["dead_man", "button released", "ticks without force because the dead-man button was not held"],
      ["peak", "peak-limited", "ticks reduced by the device’s own limit"],
      ["max_force", "largest", "largest force on the hand"],
      ["min_energy", "least energy", "minimum of the true energy, simulated devices only; never below −1 µJ"],
      ["stale", "physics silent", "ticks with outdated physics"],
    ]);
    group("Messages lost", [
      ["hop1", "device → clamp", "hop 1"],
      ["hop4", "clamp → device", "hop 4"],
      ["hop2", "clamp → physics", "hop 2: only the newest counts; skipped messages are normal when physics is slower"],
      ["hop3", "physics → clamp", "hop 3: only the newest counts"],
      ["refused", "refused", "malformed messages and answers to a state that was never sent, all hops"],
      ["telemetry", "telemetry", "batches and ticks that did not reach this page"],
    ]);
    this.elastic = group("Elastic tissue", [
      ["solves", "full solutions", "of the whole body, and those that took longer than their period"],
      ["failed", "failed", "solutions with the tip on the wrong side of the surface, undone; repaired: contact went on"],
      ["appeared", "appeared inside", "times a tool appeared inside the tissue"],
      ["elastic_error", "error", "of the force between two full solutions, as last measured"],
      ["bound", "stated bound", "of that error, at the last step in contact; unknown until an error was measured near the place"],
      ["exceeded", "above the bound", "measured errors above the bound stated for their place"],
      ["unbounded", "without a bound", "share of the steps in contact in which nothing bounds the error"],
    ]);
    this.elastic.hidden = true;
    card.append(head, groups);
    parent.append(card);
  }

  write(telemetry: Telemetry): void {
    const device = telemetry.device_batch?.counters;
    const mofc = telemetry.mofc_batch?.counters;
    const physics = telemetry.physics_batch?.counters;
    const { health } = telemetry;
    if (device) {
      const scheduled = Number(device.loop.ticks + device.loop.skippedTicks);
      this.set("answered", scheduled > 0 ? percent(Number(device.answeredTicks) / scheduled) : "–");
      this.set("leased", count_words(device.leasedTicks));
      this.set("fallback", count_words(device.fallbackTicks));
      this.set("limp", count_words(device.limpTicks));
      this.set("skipped", count_words(device.loop.skippedTicks));
      this.set("lateness", time_words(1e-9 * Number(device.loop.worstLatenessNs)));
      const ledger = device.ledgerExcesses > 0n ? `, ledger too high: ${count_words(device.ledgerExcesses)}` : "";
      this.set("monitor", device.isMonitorOff ? `off${ledger}` : `${count_words(device.monitorReductions)} reduced${ledger}`,
        device.isMonitorOff || device.monitorReductions > 0n || device.ledgerExcesses > 0n);
      this.set("watchdog", !device.hasNoMotorWatchdog ? "yes" : device.acceptsNoMotorWatchdog ? "none, accepted" : "none, at most f_co", device.hasNoMotorWatchdog);
      this.set("dead_man", count_words(device.deadManTicks));
      this.set("peak", count_words(device.peakLimitedTicks));
      this.set("max_force", `${device.maxForceNewton.toFixed(2)} N`);
      const least_uj = 1e6 * device.minimumTrueEnergyJoule;
      this.set("min_energy", Number.isFinite(least_uj) ? `${least_uj.toFixed(1).replace(/^-?0\.0$/, "0")} µJ` : "unknown", least_uj < -1);
      this.set("hop4", count_words(device.forceCommand.skipped), device.forceCommand.skipped > 0n);
    }
    if (mofc) {
      this.set("transparency", Number.isFinite(telemetry.transparency) ? percent(telemetry.transparency) : "–");
      this.set("clamped", count_words(mofc.clampedTicks));
      this.set("stale", count_words(mofc.staleTicks));
      this.set("hop1", count_words(mofc.deviceState.skipped), mofc.deviceState.skipped > 0n);
      this.set("hop3", count_words(mofc.interaction.skipped));
    }
    if (physics) {
      this.set("hop2", count_words(physics.toolMotion.skipped));
      this.elastic.hidden = physics.elasticSolves === 0n;
      this.set("solves", `${count_words(physics.elasticSolves)}, ${count_words(physics.elasticSolvesLate)} late`);
      this.set("failed", `${count_words(physics.elasticSolvesFailed)}, ${count_words(physics.elasticSolvesRepaired)} repaired`,
        physics.elasticSolvesFailed > 0n);
      this.set("appeared", count_words(physics.elasticTipsAppeared));
      this.set("elastic_error", newton_words(physics.elasticErrorNewton));
      this.set("bound", newton_words(physics.elasticBoundNewton));
      this.set("exceeded", `${count_words(physics.elasticBoundViolations)} of ${count_words(physics.elasticBoundsChecked)}`,
        10n * physics.elasticBoundViolations >= physics.elasticBoundsChecked && physics.elasticBoundsChecked > 0n);
      this.set("unbounded", physics.elasticContactSteps === 0n ? "–"
        : percent(Number(physics.elasticUnknownBoundSteps) / Number(physics.elasticContactSteps)));
    }
    const links = [device?.forceCommand, mofc?.deviceState, mofc?.interaction, physics?.toolMotion];
    const refused = links.reduce((sum, link) => sum + (link ? link.rejected + link.ahead : 0n), health?.framesRejected ?? 0n);
    this.set("refused", count_words(refused), refused > 0n);
    const lost = telemetry_lost(telemetry);
    this.set("telemetry", count_words(lost), lost > 0);
  }

  private set(id: string, text: string, is_bad = false): void {
    const element = this.values.get(id)!;
    write(element, text);
    element.classList.toggle("bad", is_bad);
  }
}

export function telemetry_lost(telemetry: Telemetry): number {
  return kNodes.reduce((sum, name) => sum + telemetry.nodes[name].batches_lost + telemetry.nodes[name].records_lost, 0);
}

/** @param is_plain  without the name of the controller */
export function write_session(scene: SceneState, is_plain: boolean): void {
  const name = make("b", "", scene.sessionName);
  by_id("session").replaceChildren(name, is_plain ? "" : scene.controller);
  by_id("session").title = is_plain ? scene.sessionName : `${scene.sessionName}, ${scene.controller}`;
  document.title = `${scene.sessionName} – Palpate`;
}

function newton_words(newton: number | undefined): string {
  return newton === undefined ? "unknown" : `${newton.toPrecision(2)} N`;
}

function percent(ratio: number): string {
  return `${(100 * ratio).toFixed(ratio >= 0.99995 ? 0 : 2)} %`;
}
