// SPDX-License-Identifier: Apache-2.0
// The last verdict of a run, shown when its server has gone.
import assert from "node:assert/strict";
import test from "node:test";
import { lost_lines } from "../../../viewer_node/web/src/panels";
import { plain_words, state_words, verdict_of } from "../../../viewer_node/web/src/state";
import { Telemetry } from "../../../viewer_node/web/src/telemetry";

test("the verdict of a run is told by side", () => {
  assert.equal(verdict_of("event=marker text=\"x\""), null);
  assert.deepEqual(verdict_of('event=verdict grade=good text=""'), { side: "", words: "verdict on the run: good.", is_good: true });
  assert.deepEqual(verdict_of('event=verdict side=left grade=bad text="device fault: device gone; no contact"'),
    { side: "left", words: "left: verdict on the run: bad. device fault: device gone; no contact.", is_good: false });
});

test("a session that has ended is not a lost connection", () => {
  const good = { side: "", words: "verdict on the run: good.", is_good: true };
  const bad = { side: "", words: "verdict on the run: bad. device fault.", is_good: false };
  assert.deepEqual(lost_lines(0.9, [good, bad], "", false),
    [{ text: "The session has ended.", tone: "calm" }, { text: good.words, tone: "calm" }, { text: bad.words, tone: "alarm" }]);
  const [lost] = lost_lines(0.9, [], "", false);
  assert.match(lost.text, /lost 0\.9 s ago/);
  assert.equal(lost.tone, "alarm");
  assert.equal(state_words(new Telemetry(), false, 1, true).id, "ended");
  assert.equal(state_words(new Telemetry(), false, 1).id, "disconnected");
  assert.equal(state_words(new Telemetry(), true, 1, true).id, "waiting"); // another has begun
});

test("who does not see the details is told of the end alone: a verdict would tell how the force was rendered", () => {
  const bad = { side: "", words: "verdict on the run: mixed. The device's peak force or slew limit cut the force in 82 % of the contact.", is_good: false };
  assert.deepEqual(lost_lines(0.9, [bad], "", true), [{ text: "The session has ended.", tone: "calm" }]);
  assert.match(lost_lines(0.9, [], "No token.", true)[0].text, /lost 0\.9 s ago.*No token\./);
  const { title, detail } = plain_words(state_words(new Telemetry(), false, 1, true), new Telemetry());
  assert.equal(title, "Session ended");
  assert.doesNotMatch(detail, /verdict/i);
});
