// SPDX-License-Identifier: Apache-2.0
// dds_bytes.test.mjs: the bytes that palpate ros publishes, taken off DDS by the other vendor's library,
// read and written again by another project's CDR codec from the public definitions. $PALPATE_BIN names
// the folder of the programs.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { after, test } from "node:test";
import { ros2humble } from "@foxglove/rosmsg-msgs-common";
import { MessageReader, MessageWriter } from "@foxglove/rosmsg2-serialization";
import { patience } from "../support/machine.mjs";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const kPeer = join(bin, "fast_dds_peer");
const kLimit = { timeout: patience(90000), skip: existsSync(kPeer) ? false : `no fast_dds_peer in ${bin}: it needs Fast DDS` };

const definitions = { ...ros2humble, "crtk_msgs/OperatingState": { name: "crtk_msgs/OperatingState", definitions: [
  { type: "std_msgs/Header", name: "header", isComplex: true }, { type: "string", name: "state" },
  { type: "bool", name: "is_homed" }, { type: "bool", name: "is_busy" }] } };

/** A type and all that it is made of; the type first. */
function with_parts(name) {
  const parts = new Map();
  const add = (type) => {
    if (parts.has(type)) return;
    const definition = definitions[type];
    assert.ok(definition, `no public definition of ${type}`);
    parts.set(type, { ...definition, name: type });
    for (const field of definition.definitions) if (field.isComplex) add(field.type);
  };
  add(name);
  return [...parts.values()];
}
const ros_name = (dds_name) => dds_name.replace("::msg::dds_::", "/").replace(/_$/, "");

const folder = mkdtempSync(join(tmpdir(), "palpate-dds-"));
const children = [];
after(() => {
  for (const child of children) if (child.exitCode === null) child.kill("SIGKILL");
  rmSync(folder, { recursive: true, force: true });
});
function start(name, ...words) {
  const child = spawn(join(bin, name), words, { env: { ...process.env, PALPATE_RUN_DIR: join(folder, "run") }, stdio: ["ignore", "pipe", "pipe"] });
  const program = { child, out: "", err: "" };
  child.stdout.on("data", (data) => { program.out += data; });
  child.stderr.on("data", (data) => { program.err += data; });
  children.push(child);
  return program;
}
async function end({ child, err }) {
  child.kill("SIGTERM");
  if (child.exitCode === null) await once(child, "exit");
  assert.equal(child.exitCode, 0, err);
}

test("each message on DDS is, byte for byte, what its public definition says", kLimit, async () => {
  const domain = String(100 + process.pid % 100);
  const session = join(root, "deploy/sessions/default.txtpb");
  const launch = start("palpate", "launch", session, "--no-realtime", "--no-viewer");
  const shown = start("palpate", "ros", "--session", session, "--domain", domain);
  const peer = start("fast_dds_peer", domain, "palpate", "dump");
  const end_at = Date.now() + patience(30000);
  const lines = () => peer.out.split("\n").slice(0, -1);
  const kTopics = ["measured_cp", "measured_cv", "measured_cf", "servo_cf", "measured_js", "operating_state", "ledger_energy_joule", "true_energy_joule", "clamped_ratio", "tissues"].map((name) => `palpate/${name}`).concat("tf", "tf_static");
  while (lines().length < kTopics.length) {
    assert.ok(Date.now() < end_at, `${lines().map((line) => line.split(" ")[0])}\n${shown.err}\n${launch.err}`);
    await new Promise((resolve) => { setTimeout(resolve, 50); });
  }
  assert.deepEqual(lines().map((line) => line.split(" ")[0]).sort(), kTopics.sort());

  for (const line of lines()) {
    const [topic, type, hex] = line.split(" ");
    const bytes = Buffer.from(hex, "hex");
    const parts = with_parts(ros_name(type));
    const message = new MessageReader(parts).readMessage(bytes);
    const again = Buffer.from(new MessageWriter(parts).writeMessage(message));
    // the encapsulation of Fast DDS says how much it padded, in its options
    assert.ok(bytes.length >= again.length && bytes.length - again.length < 4, `${topic}: ${bytes.length} bytes for ${again.length}`);
    assert.deepEqual([bytes[0], bytes[1]], [0, 1], `${topic}: CDR, little endian`);
    assert.ok(bytes.subarray(4, again.length).equals(again.subarray(4)), topic);
    if (message.header) assert.ok(Math.abs(message.header.stamp.sec - Date.now() / 1000) < 100, `${topic}: ${message.header.stamp.sec}`);
    if (topic.endsWith("measured_cp")) assert.equal(message.pose.orientation.w, 1);
    if (topic.endsWith("tissues")) assert.ok(message.points.length % 3 === 0 && message.points.length > 30);
    if (topic.endsWith("measured_js")) assert.deepEqual(message.name, ["x", "y", "z"]);
  }
  for (const program of [peer, shown, launch]) await end(program);
});
