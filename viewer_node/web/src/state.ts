// SPDX-License-Identifier: Apache-2.0
// state.ts: the state of the whole system as text.
import { kNodes, norm, type NodeLink, type NodeName, type Telemetry } from "./telemetry";
import { Grip, Guard, kFaultReasons, Mofc, type Vector3 } from "./wire";

export type Tone = "calm" | "active" | "notice" | "alarm" | "absent";
export interface StateWords {
  id: string; // for tests and styles; independent of the wording
  title: string;
  detail: string;
  tone: Tone;
}

/** Smaller forces show as 0.00 N. */
const kShown_newton = 0.005;

export const kNodeTasks = { device: "the motors", mofc: "the clamp", physics: "the tissue" };

/** A node slower than this share of its rate. */
const kSlow = 0.95;
/** Of the dot of a node. @param nominal_hz  of the session; NaN: not known */
export function node_state(node: NodeLink, nominal_hz: number, is_connected: boolean, now_s: number): "unknown" | "alive" | "slow" | "gone" {
  if (!is_connected || Number.isNaN(node.heard_s)) return "unknown";
  if (!node.is_alive(now_s)) return "gone";
  return node.rate_hz < kSlow * nominal_hz ? "slow" : "alive";
}

export function gone_words(node: NodeName, silence_s: number): string {
  return `${node}_node (${kNodeTasks[node]}) is gone: last heard ${duration_words(silence_s)} ago.`;
}
export function fault_words(telemetry: Telemetry): string {
  return kFaultReasons[telemetry.device_batch?.counters.lastFault ?? 0] ?? "unknown reason";
}

export const kNoForce: Vector3 = { x: 0, y: 0, z: 0 };

/** The last word of a viewer's server on a run. */
export interface Verdict {
  side: string;
  words: string;
  is_good: boolean;
}
/** From a line of /log: "left: bad. device fault"; null: another line. */
export function verdict_of(message: string): Verdict | null {
  const [, side = "", grade, text] = /^event=verdict (?:side=(\S+) )?grade=(\w+) text="(.*)"$/.exec(message) ?? [];
  if (grade === undefined) return null;
  return { side, words: `${side ? `${side}: ` : ""}verdict on the run: ${grade}${text ? `. ${text}` : ""}.`, is_good: grade === "good" };
}

/** Requested and rendered force; null where the node that tells it is gone. */
export function forces_of(telemetry: Telemetry, is_connected: boolean, now_s: number): { requested: Vector3 | null; applied: Vector3 | null } {
  const is_known = is_connected && telemetry.is_fresh("device", now_s);
  return {
    requested: is_known && telemetry.is_fresh("mofc", now_s) ? telemetry.requested_newton : null,
    applied: is_known ? telemetry.applied_newton : null,
  };
}

/** @param has_ended  the server has given its verdict on the run, and goes */
export function state_words(telemetry: Telemetry, is_connected: boolean, now_s: number, has_ended = false): StateWords {
  if (!is_connected && has_ended) return words("ended", "Session ended", "Its verdict is above.", "absent");
  if (!is_connected) return words("disconnected", "No connection", "The viewer's server does not answer.", "absent");
  const { device, mofc, physics } = telemetry.nodes;
  if (kNodes.every((name) => Number.isNaN(telemetry.nodes[name].heard_s))) {
    return words("waiting", "Waiting", "No node has sent telemetry yet.", "absent");
  }
  if (!device.is_alive(now_s)) {
    return words("no_device", "No device", "Without device_node there is no hand and no force.", "absent");
  }
  if (telemetry.guard === Guard.fault) {
    return words("fault", "Fault", `Motors are off until reset: ${fault_words(telemetry)}.`, "alarm");
  }
  if (!mofc.is_alive(now_s)) {
    return words("no_mofc", "No clamp", "Without mofc_node the motors are limp.", "alarm");
  }
  if (telemetry.guard === Guard.limp) return words("limp", "Limp", "The motors apply no force.", "notice");
  if (!physics.is_alive(now_s) || telemetry.mofc_state === Mofc.no_physics) {
    return words("no_physics", "No physics", norm(telemetry.requested_newton) > kShown_newton
      ? "No node simulates the tissue: the force fades to zero."
      : "No node simulates the tissue: no force is requested.", "alarm");
  }
  if (telemetry.is_fallback) {
    return words("fallback", "Fallback", "Answers are late: the force stays within the device’s own friction.", "notice");
  }
  switch (telemetry.mofc_state) {
    case Mofc.fading:
      return words("stale", "Physics silent", "The force fades to zero.", "notice");
    case Mofc.clutched:
      return words("clutched", "Clutched", "Hand and tool are uncoupled.", "calm");
    case Mofc.contact:
      if (telemetry.grip === Grip.holds && !telemetry.is_clamped) return words("holds", "Holds tissue", "The jaws hold tissue: its force is rendered.", "active");
      if (telemetry.grip === Grip.slips && !telemetry.is_clamped) return words("slips", "Slips", "The tissue slips in the jaws: the force is more than they hold.", "notice");
      if (telemetry.grip === Grip.pierced && !telemetry.is_clamped) return words("pierced", "In tissue", "The needle or blade moves with the tissue.", "active");
      if (telemetry.grip === Grip.cuts && !telemetry.is_clamped) return words("cuts", "Blade moves", "The blade cuts the tissue, or slides in its cut.", "active");
      if (telemetry.grip === Grip.pierces && !telemetry.is_clamped) return words("pierces", "Needle moves", "The needle goes into the tissue, or out of it.", "active");
      return telemetry.is_clamped
        ? telemetry.is_exhausted
          ? words("exhausted", "Contact, clamped", "The energy credit is exhausted: lift off and press again.", "notice")
          : words("clamped", "Contact, clamped", "The clamp reduces the force.", "notice")
        : words("contact", "Contact", "The force of the tissue is rendered.", "active");
    default:
      if (telemetry.grip === Grip.torn) return words("torn", "Tissue torn", "The jaws lost it: open them, and close them again.", "notice");
      if (telemetry.grip === Grip.slipped) return words("slipped", "Slipped out", "The tissue slipped out of the jaws: open them, and close them again.", "notice");
      if (telemetry.is_clamped && norm(telemetry.requested_newton) > 0) {
        return words("clamped", "Clamped", "The clamp reduces the force.", "notice");
      }
      return words("free", "Free", norm(telemetry.requested_newton) > kShown_newton
        ? "The tool has left the tissue: the force fades to zero." : "The tool touches nothing.", "calm");
  }
}

/** The same for a person who is to notice the tissue, and not what renders its force: only that there is none. */
export function plain_words(full: StateWords, telemetry: Telemetry): StateWords {
  switch (full.id) {
    case "ended": // its verdict is not shown
      return { ...full, detail: "Nothing is measured any more." };
    case "no_mofc":
    case "limp":
      return { ...full, title: "No force", detail: "The motors apply no force." };
    case "no_physics":
    case "stale":
      return { ...full, title: "No force", detail: "The tissue is not simulated: the force fades to zero." };
    case "fallback":
    case "clamped":
    case "exhausted":
      return telemetry.mofc_state === Mofc.contact
        ? words("contact", "Contact", "You touch the tissue.", "active")
        : words("free", "Free", "The tool touches nothing.", "calm");
    case "contact":
      return { ...full, detail: "You touch the tissue." };
    case "free":
      return { ...full, detail: "The tool touches nothing." };
    default:
      return full;
  }
}

function words(id: string, title: string, detail: string, tone: Tone): StateWords {
  return { id, title, detail, tone };
}

/** "0.4 s", "12 s", "3 min". */
export function duration_words(seconds: number): string {
  if (seconds < 9.95) return `${seconds.toFixed(1)} s`;
  if (seconds < 119.5) return `${Math.round(seconds)} s`;
  if (seconds < 119.5 * 60) return `${Math.round(seconds / 60)} min`;
  return `${Math.round(seconds / 3600)} h`;
}

/** Two digits or more, with a readable unit: "62 µs", "1.2 ms". */
export function time_words(seconds: number): string {
  if (!Number.isFinite(seconds)) return "–";
  const [scale, unit] = seconds < 1e-3 ? [1e6, "µs"] : seconds < 1 ? [1e3, "ms"] : [1, "s"];
  const value = scale * seconds;
  return `${value >= 9.95 || value === 0 ? value.toFixed(0) : value.toPrecision(2)} ${unit}`;
}

export function count_words(count: number | bigint): string {
  return Number(count).toLocaleString("en", { useGrouping: true }).replaceAll(",", "\u202f");
}
