// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import test from "node:test";
import { event_of, kMostEvents, Timeline } from "../../../viewer_node/web/src/events";

const line = (at_s: number, name: string, message: string, level = 2) =>
  ({ timestamp: { seconds: BigInt(Math.floor(at_s)), nanos: Math.round(1e9 * (at_s % 1)) }, level, message, name });

test("a line becomes words with its values", () => {
  const fault = event_of(line(5.5, "device_node", 'event=device_fault reason="the position jumped" count=1 remedy="…"', 4));
  assert.deepEqual(fault, { at_s: 5.5, lane: "faults", tone: "alarm", node: "device_node", name: "device_fault", text: "fault: the position jumped" });
  assert.equal(event_of(line(1, "viewer_node", "event=node_restarted node=mofc_node"))?.text, "mofc_node: restarted");
  assert.equal(event_of(line(1, "run", 'event=marker origin=page text="first cut"'))?.text, "first cut");
  assert.equal(event_of(line(1, "physics_node", "event=peer_up link=tool_motion")), null);
  assert.equal(event_of(line(1, "device_node", "event=device_phase phase=calibrated remedy=…", 3))?.text, "device calibrated");
  assert.equal(event_of(line(1, "device_node", "event=acknowledged_by_page count=1", 3))?.text, "acknowledged by a page");
  // unknown to this page
  const unknown = event_of(line(1, "device_node", "event=novelty x=1", 3));
  assert.deepEqual([unknown?.lane, unknown?.tone, unknown?.text], ["faults", "notice", "novelty x=1"]);
});

test("the history that a server repeats is known already", () => {
  const timeline = new Timeline();
  for (let i = 0; i < 2; ++i) {
    timeline.take(line(2, "mofc_node", "event=clamped_ended ticks=7"));
    timeline.take(line(1, "mofc_node", "event=clamped_began", 3));
  }
  assert.deepEqual(timeline.events.map(({ at_s }) => at_s), [1, 2]);
});

test("an episode lasts from its begin to its end, or still", () => {
  const timeline = new Timeline();
  timeline.take(line(1, "mofc_node", "event=clamped_began", 3));
  timeline.take(line(3, "mofc_node", "event=clamped_ended ticks=7"));
  timeline.take(line(4, "viewer_node", "event=node_silent node=physics_node", 3));
  timeline.take(line(5, "viewer_node", "event=node_silent node=device_node", 3));
  timeline.take(line(6, "viewer_node", "event=node_heard node=physics_node"));
  timeline.take(line(7, "viewer_node", "event=node_restarted node=physics_node", 3));
  assert.deepEqual(timeline.spans().map(({ lane, at_s, to_s }) => [lane, at_s, to_s]),
    [["clamp", 1, 3], ["nodes", 4, 6], ["nodes", 5, null], ["nodes", 7, 7]]);
});

test("the newest events are kept", () => {
  const timeline = new Timeline();
  for (let i = 0; i < kMostEvents + 10; ++i) timeline.take(line(i, "run", `event=marker text="${i}"`));
  assert.equal(timeline.events.length, kMostEvents);
  assert.equal(timeline.events[0].at_s, 10);
});
