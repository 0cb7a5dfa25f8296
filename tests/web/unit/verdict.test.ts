// SPDX-License-Identifier: Apache-2.0
// The last verdict of a run, shown when its server has gone.
import assert from "node:assert/strict";
import test from "node:test";
import { verdict_of } from "../../../viewer_node/web/src/state";

test("the verdict of a run is told by side", () => {
  assert.equal(verdict_of("event=marker text=\"x\""), null);
  assert.deepEqual(verdict_of('event=verdict grade=good text=""'), { side: "", words: "verdict on the run: good." });
  assert.deepEqual(verdict_of('event=verdict side=left grade=bad text="device fault: device gone; no contact"'),
    { side: "left", words: "left: verdict on the run: bad. device fault: device gone; no contact." });
});
