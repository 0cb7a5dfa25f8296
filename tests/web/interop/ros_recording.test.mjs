// SPDX-License-Identifier: Apache-2.0
// ros_recording.test.mjs: a recording exported for ROS 2, read by its message definitions with the
// parser and the CDR reader of another project. $PALPATE_BIN names the folder of the programs.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { after, before, test } from "node:test";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader } from "@mcap/core";
import { patience } from "../support/machine.mjs";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const kLimit = { timeout: patience(60000), skip: existsSync(join(bin, "palpate")) ? false : `no programs in ${bin}: set PALPATE_BIN` };

let folder;
before(() => { folder = mkdtempSync(join(tmpdir(), "palpate-ros-")); });
after(() => rmSync(folder, { recursive: true, force: true }));

/** Messages by topic. */
async function open(file) {
  const data = readFileSync(file);
  const reader = await McapIndexedReader.Initialize({
    readable: { size: async () => BigInt(data.length), read: async (at, size) => new Uint8Array(data.subarray(Number(at), Number(at + size))) },
  });
  const readers = new Map();
  const topics = new Map();
  for (const channel of reader.channelsById.values()) {
    const schema = reader.schemasById.get(channel.schemaId);
    assert.equal(channel.messageEncoding, "cdr");
    assert.equal(schema.encoding, "ros2msg");
    readers.set(channel.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
    topics.set(channel.topic, { type: schema.name, messages: [] });
  }
  for await (const { channelId, logTime, data: bytes } of reader.readMessages({ validateCrcs: true })) {
    const message = readers.get(channelId).readMessage(bytes);
    const { sec, nsec, nanosec = nsec } = message.header.stamp;
    assert.equal(BigInt(sec) * 1_000_000_000n + BigInt(nanosec), logTime);
    topics.get(reader.channelsById.get(channelId).topic).messages.push(message);
  }
  return topics;
}

function exported(session, ...more) {
  const file = (name) => join(folder, name);
  execFileSync(join(bin, "palpate"), ["loopback", join(root, "deploy/sessions", session), ...more, "--seconds", "2", "--no-ideal", "--overwrite", "--record", file("run.mcap")]);
  execFileSync(join(bin, "palpate"), ["export", file("run.mcap"), "--overwrite", "--ros", file("ros.mcap")]);
  return open(file("ros.mcap"));
}

test("pose and both forces of every tick, as the table of the same run has them", kLimit, async () => {
  const topics = await exported("default.txtpb");
  assert.deepEqual([...topics].map(([topic, { type }]) => [topic, type]).sort(), [
    ["/measured_cf", "geometry_msgs/msg/WrenchStamped"],
    ["/measured_cp", "geometry_msgs/msg/PoseStamped"],
    ["/servo_cf", "geometry_msgs/msg/WrenchStamped"],
  ]);
  const table = execFileSync(join(bin, "palpate"), ["export", join(folder, "run.mcap"), "--csv", "-"], { encoding: "utf8" }).trim().split("\n").map((row) => row.split(","));
  const column = (name) => table[0].indexOf(name);
  const rows = table.slice(1);
  const poses = topics.get("/measured_cp").messages;
  assert.equal(poses.length, 2000);
  assert.equal(rows.length, 2000);
  for (let i = 0; i < rows.length; ++i) {
    const { frame_id } = poses[i].header;
    assert.equal(frame_id, "world");
    const { x, y, z } = poses[i].pose.position;
    assert.deepEqual([x, y, z], ["xm_m", "ym_m", "zm_m"].map((name) => Number(rows[i][column(name)])));
    assert.equal(poses[i].pose.orientation.w, 1);
  }
  const applied = topics.get("/measured_cf").messages;
  assert.equal(applied.length, 2000);
  const norms = applied.map(({ wrench: { force } }) => Math.hypot(force.x, force.y, force.z));
  assert.ok(Math.max(...norms) > 1, "a press is in the run");
  const commanded = topics.get("/servo_cf").messages;
  assert.ok(commanded.length > 1990);
  assert.equal(commanded[0].header.frame_id, "device_base");
});

test("a side has topics and frames of its own", kLimit, async () => {
  const topics = await exported("two_hands.txtpb", "--side", "right");
  assert.deepEqual([...topics.keys()].sort(), ["/right/measured_cf", "/right/measured_cp", "/right/servo_cf"]);
  const [first] = topics.get("/right/measured_cf").messages;
  assert.equal(first.header.frame_id, "right_device_base");
  assert.equal(topics.get("/right/measured_cp").messages.length, 2000);
});
