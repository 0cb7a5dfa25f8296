// SPDX-License-Identifier: Apache-2.0
// events.ts: the events of the session, from the lines of /log: restarts, faults, clamps, silences,
// changes, markers. No DOM.
import type { Log } from "./wire";

export type Lane = "nodes" | "faults" | "clamp" | "silence" | "changes";
export const kLanes: readonly Lane[] = ["nodes", "faults", "clamp", "silence", "changes"];
export type EventTone = "calm" | "notice" | "alarm" | "marker";

export interface SessionEvent {
  /** Seconds since 1970, server's clock. */
  at_s: number;
  lane: Lane;
  tone: EventTone;
  node: string;
  /** As in the log. */
  name: string;
  text: string;
  /** Key of an episode that this event begins or ends. */
  begins?: string;
  ends?: string;
}
/** An episode; `to_s` is null while it lasts. */
export interface Span extends SessionEvent {
  to_s: number | null;
}

/** Older ones are dropped; the server keeps as many. */
export const kMostEvents = 512;

// name of the line → lane, tone, words; $key is replaced by the line's value
const kWords: Record<string, [Lane, EventTone, string]> = {
  node_heard: ["nodes", "calm", "$node: telemetry received"],
  node_silent: ["nodes", "alarm", "$node: silent"],
  node_restarted: ["nodes", "notice", "$node: restarted"],
  device_fault: ["faults", "alarm", "fault: $reason"],
  device_fault_reset: ["faults", "calm", "fault reset"],
  device_phase: ["faults", "notice", "device $phase"],
  acknowledged_by_page: ["faults", "notice", "acknowledged by a page"],
  page_acknowledgement_refused: ["faults", "notice", "acknowledgement of a page refused: the device is not as shown"],
  command_not_finite: ["faults", "alarm", "$count commands not finite"],
  monitor_reduced: ["faults", "alarm", "monitor reduced $count commands"],
  hand_faster_than_assumed: ["faults", "notice", "hand faster than assumed, $count readings"],
  switch_late: ["faults", "notice", "$count late switches of the force"],
  encoder_coarser_than_profile: ["faults", "notice", "encoder coarser than its profile"],
  ticks_skipped: ["faults", "notice", "$count ticks skipped"],
  messages_rejected: ["faults", "notice", "$count messages refused on $link"],
  answers_ahead: ["faults", "notice", "$count answers ahead on $link"],
  physics_late: ["faults", "notice", "physics late, $count ticks"],
  motions_dropped: ["faults", "notice", "$count motions dropped"],
  fallback_began: ["silence", "notice", "answers late: fallback"],
  fallback_ended: ["silence", "calm", "answers in time again"],
  interaction_stale_began: ["silence", "notice", "physics silent: the force fades"],
  interaction_stale_ended: ["silence", "calm", "physics heard again"],
  clamped_began: ["clamp", "notice", "clamp reduces the force"],
  clamped_ended: ["clamp", "calm", "clamp no longer reduces the force"],
  ledger_reset: ["clamp", "calm", "energy ledger reset"],
  tissue_held: ["changes", "calm", "the jaws hold tissue"],
  tissue_torn: ["changes", "notice", "tissue torn: the jaws lost it"],
  tissue_punctured: ["changes", "calm", "the needle or blade went into tissue"],
  tissue_slipped_out: ["changes", "notice", "tissue slipped out of the jaws"],
  tissue_ablated: ["changes", "calm", "$count elements ablated"],
  tissue_cut_off: ["changes", "notice", "$count elements cut off from the rest: removed"],
  ablation_refused: ["changes", "notice", "ablation refused: the tissue stays as it is"],
  attachment_torn: ["changes", "calm", "$count points of an attachment torn"],
  tissue_cut: ["changes", "calm", "$count faces of the tissue cut"],
  tissue_restored: ["changes", "calm", "tissue restored"],
  tissue_changed: ["changes", "calm", "$tissue: $stiffness_newton_per_m N/m, $damping_newton_s_per_m N·s/m"],
  tissue_change_refused: ["changes", "notice", "change of a tissue refused"],
  verdict: ["changes", "calm", "verdict: $grade"],
  marker: ["changes", "marker", "$text"],
  scene_sent_anew: ["changes", "calm", "scene changed"],
};
// said better by another event
const kSilent = new Set(["peer_up", "peer_restarted"]);

/** Null for lines that the timeline leaves out. */
export function event_of({ timestamp, level, message, name: node }: Log): SessionEvent | null {
  const at_s = Number(timestamp?.seconds ?? 0n) + 1e-9 * (timestamp?.nanos ?? 0);
  const values: Record<string, string> = {};
  for (const [, key, quoted, plain] of message.matchAll(/(\w+)=(?:"([^"]*)"|(\S+))/g)) values[key] ??= quoted ?? plain;
  const name = values.event ?? "";
  if (kSilent.has(name)) return null;
  const [lane, tone, words] = kWords[name] ?? ["faults", level >= 4 ? "alarm" : level === 3 ? "notice" : "calm", message.replace(/^event=/, "")];
  const text = words.replace(/\$(\w+)/g, (_, key) => values[key] ?? key);
  const event: SessionEvent = { at_s, lane, tone, node, name, text };
  const episode = /^(\w+)_(began|ended)$/.exec(name);
  if (episode) event[episode[2] === "began" ? "begins" : "ends"] = `${node} ${episode[1]}`;
  if (name === "node_silent") event.begins = `silent ${values.node}`;
  if (name === "node_heard") event.ends = `silent ${values.node}`;
  return event;
}

export class Timeline {
  /** Oldest first. */
  events: SessionEvent[] = [];
  /** Grows with every event. */
  count = 0;
  private readonly known = new Set<string>();

  /** The server repeats its history to every new subscriber: known lines are ignored. */
  /** @return the event, if the line is one and new */
  take(line: Log): SessionEvent | null {
    const key = `${line.timestamp?.seconds}.${line.timestamp?.nanos} ${line.name} ${line.message}`;
    if (this.known.has(key)) return null;
    this.known.add(key);
    const event = event_of(line);
    if (!event) return null;
    let place = this.events.length;
    while (place > 0 && this.events[place - 1].at_s > event.at_s) place -= 1;
    this.events.splice(place, 0, event);
    if (this.events.length > kMostEvents) this.events.shift();
    this.count += 1;
    return event;
  }

  /** Instants, and episodes with their end. */
  spans(): Span[] {
    const open = new Map<string, Span>();
    const spans: Span[] = [];
    for (const event of this.events) {
      const begun = event.ends === undefined ? undefined : open.get(event.ends);
      if (begun) {
        begun.to_s = event.at_s;
        open.delete(event.ends!);
        continue;
      }
      const span: Span = { ...event, to_s: event.begins === undefined ? event.at_s : null };
      if (event.begins !== undefined) open.set(event.begins, span);
      spans.push(span);
    }
    return spans;
  }
}
