// SPDX-License-Identifier: Apache-2.0
// recording.test.mjs: independent readers of what Palpate writes: @mcap/core for recordings, zeromq
// and protobufjs for PlotJuggler's port. $PALPATE_BIN names the folder of the programs.
import assert from "node:assert/strict";
import { execFileSync, spawn, spawnSync } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { after, before, test } from "node:test";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import protobuf from "protobufjs";
import "protobufjs/ext/descriptor.js";
import * as zmq from "zeromq";
import { patience } from "../support/machine.mjs";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const session = join(root, "deploy/sessions/default.txtpb");
const kLimit = { timeout: patience(60000), skip: existsSync(join(bin, "palpate")) ? false : `no programs in ${bin}: set PALPATE_BIN` };
const kSeconds = 3;

let folder;
let bytes; // of a lockstep run of kSeconds at 1 kHz

before(() => {
  folder = mkdtempSync(join(tmpdir(), "palpate-mcap-"));
  if (kLimit.skip) return;
  const file = join(folder, "run.mcap");
  execFileSync(join(bin, "palpate"), ["loopback", session, "--seconds", `${kSeconds}`, "--no-ideal", "--record", file, "--csv", join(folder, "run.csv")]);
  bytes = readFileSync(file);
});
after(() => rmSync(folder, { recursive: true, force: true }));

const readable = (data) => ({
  size: async () => BigInt(data.length),
  read: async (offset, size) => new Uint8Array(data.subarray(Number(offset), Number(offset + size))),
});

/** All records that the stream reader gives of `data`; it throws on a check sum that is wrong. */
function stream(data) {
  const reader = new McapStreamReader({ validateCrcs: true });
  reader.append(data);
  const records = [];
  for (let record; (record = reader.nextRecord());) records.push(record);
  return { records, done: reader.done() };
}

/** Decodes by the schema in the file, as other tools do. */
function decoder(schema) {
  assert.equal(schema.encoding, "protobuf");
  const type = protobuf.Root.fromDescriptor(protobuf.descriptor.FileDescriptorSet.decode(schema.data)).lookupType(schema.name);
  return (data) => type.toObject(type.decode(data), { longs: Number });
}

function ticks(messages) {
  return messages.flatMap((message) => message.sequence ?? []);
}

test("the indexed reader finds every tick, the scene and the session", kLimit, async () => {
  const reader = await McapIndexedReader.Initialize({ readable: readable(bytes) });
  const topics = [...reader.channelsById.values()].map((channel) => channel.topic);
  assert.deepEqual(topics.sort(), ["/device", "/ideal", "/markers", "/mesh", "/mofc", "/physics", "/scene_state"]);

  const messages = new Map(topics.map((topic) => [topic, []]));
  let last = 0n;
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    messages.get(channel.topic).push(decoder(reader.schemasById.get(channel.schemaId))(message.data));
    assert.ok(message.logTime >= last);
    last = message.logTime;
  }
  const expected = Array.from({ length: 1000 * kSeconds }, (_, i) => i);
  assert.deepEqual(ticks(messages.get("/device")), expected);
  assert.equal(messages.get("/mofc").flatMap((batch) => batch.device_sequence ?? []).length, expected.length);
  assert.equal(messages.get("/scene_state").length, 1);
  assert.ok(messages.get("/scene_state")[0].tissues.length > 0);
  for (const [topic, list] of messages) {
    const id = [...reader.channelsById.values()].find((channel) => channel.topic === topic).id;
    assert.equal(reader.statistics.channelMessageCounts.get(id), BigInt(list.length), topic);
  }

  // numbers, against the table that the run itself wrote
  const rows = readFileSync(join(folder, "run.csv"), "utf8").trim().split("\n").slice(1).map((row) => row.split(",").map(Number));
  const x_m = messages.get("/device").flatMap((batch) => batch.measured_tool_position_world_m ?? []);
  assert.equal(x_m.length, 3 * rows.length);
  rows.forEach((row, i) => assert.equal(x_m[3 * i], row[4]));

  const metadata = new Map();
  for await (const { name, metadata: strings } of reader.readMetadata()) metadata.set(name, strings);
  assert.match(metadata.get("palpate").get("session"), /tissue/);
  assert.equal(metadata.get("palpate_nodes").get("mofc_node"), metadata.get("palpate").get("version"));
});

test("the indexed reader seeks by time", kLimit, async () => {
  const reader = await McapIndexedReader.Initialize({ readable: readable(bytes) });
  const begin = 1_200_000_000n;
  let count = 0;
  for await (const message of reader.readMessages({ topics: ["/device"], startTime: begin, endTime: begin + 500_000_000n })) {
    assert.ok(message.logTime >= begin && message.logTime <= begin + 500_000_000n);
    ++count;
  }
  assert.ok(count >= 25 && count <= 26, `${count} batches of 20 ms in 0.5 s`);
});

test("the stream reader takes every record with its check sum", kLimit, () => {
  const { records, done } = stream(bytes);
  assert.ok(done);
  const count = (type) => records.filter((record) => record.type === type).length;
  assert.equal(records[0].type, "Header");
  assert.equal(count("DataEnd"), 1);
  assert.equal(count("Footer"), 1);
  assert.notEqual(records.find((record) => record.type === "Footer").summaryCrc, 0);
  assert.notEqual(records.find((record) => record.type === "DataEnd").dataSectionCrc, 0);
  const statistics = records.find((record) => record.type === "Statistics");
  assert.equal(BigInt(count("Message")), statistics.messageCount);
});

test("a damaged byte is noticed", kLimit, () => {
  const damaged = Buffer.from(bytes);
  damaged[damaged.length >> 1] ^= 1;
  assert.throws(() => stream(damaged), /crc/i);
});

test("of a file that is cut off, at most one second is lost", kLimit, () => {
  const all = stream(bytes).records;
  const schemas = new Map(all.filter((record) => record.type === "Schema").map((schema) => [schema.id, schema]));
  const channels = new Map(all.filter((record) => record.type === "Channel").map((channel) => [channel.id, channel]));
  const exported = (file) => {
    const table = join(folder, "export.csv");
    const { status } = spawnSync(join(bin, "palpate"), ["export", file, "--csv", table, "--overwrite"]);
    return { status, rows: readFileSync(table, "utf8").trim().split("\n").slice(1) };
  };
  const whole = exported(join(folder, "run.mcap")).rows;
  for (const share of [0.3, 0.5, 0.8]) {
    const cut = bytes.subarray(0, Math.floor(share * bytes.length));
    const messages = stream(cut).records.filter((record) => record.type === "Message");
    const file = join(folder, "cut.mcap");
    writeFileSync(file, cut);
    const { status, rows } = exported(file);
    assert.equal(status, 1, "it is said to be damaged");
    assert.deepEqual(rows, whole.slice(0, rows.length), "what is recovered is what was recorded");
    const device = messages.filter((message) => channels.get(message.channelId).topic === "/device");
    const decode = decoder(schemas.get(channels.get(device[0].channelId).schemaId));
    const chunks = ticks(device.map((message) => decode(message.data))).length;
    assert.ok(chunks > 0 && Math.min(chunks % 500, 500 - (chunks % 500)) <= 20, `${chunks} ticks: whole chunks of 0.5 s`);
    // besides, what is whole in the chunk that is cut off
    assert.ok(rows.length >= chunks && rows.length <= chunks + 520, `${rows.length} rows, ${chunks} ticks by another reader`);
  }
});

test("PlotJuggler's port gives every tick as plot.proto says", kLimit, async () => {
  const run = { env: { ...process.env, PALPATE_RUN_DIR: join(folder, "run") } };
  const viewer = spawn(join(bin, "viewer_node"), ["--session", session, "--quiet", "--no-web", "--plotjuggler", "tcp://127.0.0.1:*"], { ...run, stdio: ["ignore", "ignore", "pipe"] });
  let replay;
  const socket = new zmq.Subscriber({ receiveTimeout: patience(20000) });
  try {
    const endpoint = await new Promise((resolve, reject) => {
      let text = "";
      viewer.stderr.on("data", (data) => {
        text += data;
        const found = /endpoint=(tcp:\S+)/.exec(text);
        if (found) resolve(found[1]);
      });
      viewer.on("exit", () => reject(new Error(text)));
    });
    socket.connect(endpoint);
    socket.subscribe("");
    replay = spawn(join(bin, "palpate"), ["replay", join(folder, "run.mcap"), "--loop", "--no-viewer"], { ...run, stdio: "ignore" });

    const type = (await protobuf.load(join(root, "proto/palpate/v1/plot.proto"))).lookupType("palpate.v1.Telemetry");
    let last = null;
    for (let i = 0; i < 500; ++i) {
      const parts = await socket.receive();
      assert.equal(parts.length, 2);
      assert.equal(parts[0].toString(), "palpate");
      const tick = type.toObject(type.decode(parts[1]), { longs: Number, defaults: true });
      assert.ok(Math.abs(tick.timestamp - Date.now() / 1000) < 10, `${tick.timestamp}`);
      if (last && tick.deviceSequence > last.deviceSequence) {
        assert.equal(tick.deviceSequence, last.deviceSequence + 1);
        assert.ok(Math.abs(tick.timestamp - last.timestamp - 0.001) < 1e-6);
      }
      assert.ok(Number.isFinite(tick.toolPositionWorldM.x));
      last = tick;
    }
  } finally {
    socket.close();
    for (const child of [viewer, replay]) {
      if (!child || child.exitCode !== null) continue;
      child.kill("SIGTERM");
      await once(child, "exit");
    }
  }
});
