// SPDX-License-Identifier: Apache-2.0
// The last verdict of a run, shown when its server has gone.
import assert from "node:assert/strict";
import test from "node:test";
import { lost_lines } from "../../../viewer_node/web/src/panels";
import { state_words, verdict_of } from "../../../viewer_node/web/src/state";
import { Telemetry } from "../../../viewer_node/web/src/telemetry";

test("the verdict of a run is told by side", () => {
  assert.equal(verdict_of("event=marker text=\"x\""), null);
  assert.deepEqual(verdict_of('event=verdict grade=good text=""'), { side: "", words: "verdict on the run: good." });
  assert.deepEqual(verdict_of('event=verdict side=left grade=bad text="device fault: device gone; no contact"'),
    { side: "left", words: "left: verdict on the run: bad. device fault: device gone; no contact." });
});

test("a session that has ended is not a lost connection", () => {
  const verdict = "verdict on the run: good.";
  assert.deepEqual(lost_lines(0.9, [verdict]), ["The session has ended.", verdict]);
  assert.match(lost_lines(0.9, [])[0], /lost 0\.9 s ago/);
  assert.equal(state_words(new Telemetry(), false, 1, true).id, "ended");
  assert.equal(state_words(new Telemetry(), false, 1).id, "disconnected");
  assert.equal(state_words(new Telemetry(), true, 1, true).id, "waiting"); // another has begun
});
