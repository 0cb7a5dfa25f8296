// SPDX-License-Identifier: Apache-2.0
// physics.test.mjs: support/physics_node.mjs, which knows nothing but docs/wire.md and the protos, as the
// physics of a launch. $PALPATE_BIN names the folder of the programs.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { test } from "node:test";
import { patience } from "../support/machine.mjs";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const kLimit = { timeout: patience(60000), skip: existsSync(join(bin, "palpate")) ? false : `no programs in ${bin}: set PALPATE_BIN` };

// Two springs in series, hand and tissue 400 N/m each, 5 mm apart: 1 N, and 0.05 N of stiction.
const kSession = `name: "node"
device { monitor: off rate_hz: 200 lease_us: 12500 simulated { position_resolution_m: 0 } profile { position_resolution_m: 0 } }
hand { stiffness_newton_per_m: 400 damping_newton_s_per_m: 10 hold { position_m { z: -0.005 } } }
mofc { controller: none stale_after_ms: 200 }
physics { rate_hz: 1000 command: [${["node", join(root, "tests/web/support/physics_node.mjs"), join(root, "proto")].map((word) => JSON.stringify(word)).join()}] }
`;

test("a physics in Node.js renders its tissue, is restarted when killed, and ends with the launch", kLimit, async () => {
  const folder = mkdtempSync(join(tmpdir(), "palpate-physics-"));
  try {
    writeFileSync(join(folder, "node.txtpb"), kSession);
    const launch = spawn(join(bin, "palpate"), ["launch", join(folder, "node.txtpb"), "--no-realtime", "--no-viewer",
      "--seconds", "6", "--json", join(folder, "run.json"), "--csv", join(folder, "run.csv")],
    { env: { ...process.env, PALPATE_RUN_DIR: join(folder, "run") }, stdio: ["ignore", "ignore", "pipe"] });
    let log = "";
    let is_killed = false;
    launch.stderr.on("data", (data) => {
      log += data;
      const pid = /event=node_started node=physics pid=(\d+)/.exec(log)?.[1];
      if (is_killed || !pid || !log.includes("event=peer_up link=interaction")) return;
      is_killed = true;
      process.kill(Number(pid), "SIGKILL");
    });
    assert.deepEqual(await once(launch, "exit"), [0, null], log);

    const run = JSON.parse(readFileSync(join(folder, "run.json"), "utf8"));
    assert.equal(run.restarts.physics, 1, log);
    assert.ok(run.in_contact_ticks > 200, `${run.in_contact_ticks} ticks in contact`);
    const [head, ...rows] = readFileSync(join(folder, "run.csv"), "utf8").trim().split("\n").map((row) => row.split(","));
    const resting = rows.slice(-100).map((row) => Number(row[head.indexOf("fs_z")])).sort((a, b) => a - b)[50];
    assert.ok(Math.abs(resting - 1) < 0.05, `${resting} N at rest`);
    assert.match(log, /event=node_stopped node=physics how="exit status 0"/);
    assert.doesNotMatch(log, /rejected/);
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
});

test("a physics in Node.js conforms", kLimit, async () => {
  const conform = spawn(join(bin, "palpate"), ["conform", "physics", "--", "node", join(root, "tests/web/support/physics_node.mjs"),
    join(root, "proto")], { stdio: ["ignore", "pipe", "pipe"] });
  let found = "";
  conform.stdout.on("data", (data) => { found += data; });
  conform.stderr.on("data", (data) => { found += data; });
  assert.deepEqual(await once(conform, "exit"), [0, null], found);
});
