// SPDX-License-Identifier: Apache-2.0
// foxglove_recording.test.mjs: recordings of `launch` and of `loopback`, exported for Foxglove, in
// the hands of Foxglove's reader and schemas. $PALPATE_BIN names the folder of the programs.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { after, before, test } from "node:test";
import schemas from "@foxglove/schemas/internal.js";
import { McapIndexedReader } from "@mcap/core";
import protobuf from "protobufjs";
import "protobufjs/ext/descriptor.js";
import { patience } from "../support/machine.mjs";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const session = join(root, "deploy/sessions/default.txtpb");
const kLimit = { timeout: patience(60000), skip: existsSync(join(bin, "palpate")) ? false : `no programs in ${bin}: set PALPATE_BIN` };

let folder;
before(() => { folder = mkdtempSync(join(tmpdir(), "palpate-export-")); });
after(() => rmSync(folder, { recursive: true, force: true }));

/** Foxglove's own definition of a message. */
const theirs = (() => {
  const root = new protobuf.Root();
  const enums = Object.values(schemas.foxgloveEnumSchemas);
  for (const schema of Object.values(schemas.foxgloveMessageSchemas)) {
    protobuf.parse(schemas.generateProto(schema, enums.filter((one) => one.parentSchemaName === schema.name)), root, { keepCase: true });
  }
  for (const name of ["timestamp", "duration"]) root.addJSON(protobuf.common.get(`google/protobuf/${name}.proto`).nested);
  return root;
})();

/** Messages by topic, with their times; those of Foxglove by its own schemas, others by the file's. */
async function open(file) {
  const data = readFileSync(file);
  const reader = await McapIndexedReader.Initialize({
    readable: { size: async () => BigInt(data.length), read: async (at, size) => new Uint8Array(data.subarray(Number(at), Number(at + size))) },
  });
  const decoders = new Map();
  const topics = new Map();
  for (const channel of reader.channelsById.values()) {
    const schema = reader.schemasById.get(channel.schemaId);
    assert.equal(schema.encoding, "protobuf");
    const own = protobuf.Root.fromDescriptor(protobuf.descriptor.FileDescriptorSet.decode(schema.data));
    const type = (schema.name.startsWith("foxglove.") ? theirs : own).lookupType(schema.name);
    decoders.set(channel.id, (bytes) => type.toObject(type.decode(bytes), { longs: Number, defaults: true, arrays: true }));
    topics.set(channel.topic, []);
  }
  for await (const { channelId, logTime, data: bytes } of reader.readMessages({ validateCrcs: true })) {
    topics.get(reader.channelsById.get(channelId).topic).push({ at_s: Number(logTime) * 1e-9, ...decoders.get(channelId)(bytes) });
  }
  return topics;
}

const exported = (name) => {
  execFileSync(join(bin, "palpate"), ["export", join(folder, `${name}.mcap`), "--foxglove", join(folder, `${name}.foxglove.mcap`), "--csv", join(folder, `${name}.csv`)]);
  const rows = readFileSync(join(folder, `${name}.csv`), "utf8").trim().split("\n").slice(1).map((row) => row.split(",").map(Number));
  return { file: join(folder, `${name}.foxglove.mcap`), rows };
};

/** The scene in 3-D and the scalars of every tick. */
function check(topics, rows) {
  assert.deepEqual([...topics.keys()].sort(), ["/log", "/scene", "/telemetry", "/tf", "/tissue/points"]);
  const telemetry = topics.get("/telemetry");
  assert.equal(telemetry.length, rows.length, "a message for each tick");
  telemetry.forEach((tick, i) => {
    const [x, y, z] = rows[i].slice(4, 7); // x_m, y_m, z_m of the tool
    const tool = tick.tool_position_world_m;
    assert.deepEqual([tool.x, tool.y, tool.z], [x, y, z]);
    if (i > 0) assert.ok(tick.at_s > telemetry[i - 1].at_s);
  });
  const length_s = telemetry.at(-1).at_s - telemetry[0].at_s;
  const of = (id) => topics.get("/scene").filter(({ entities }) => entities[0].id.startsWith(id));
  const tools = of("tool"), surfaces = of("tissue");
  for (const [topic, messages] of [["/scene", tools], ["/tf", topics.get("/tf")]]) {
    const rate_hz = messages.length / length_s;
    assert.ok(rate_hz > 20 && rate_hz < 32, `${topic}: ${rate_hz} Hz`);
  }
  // the surfaces of the tissues by name, at most twice a second
  assert.ok(surfaces.length > 0 && surfaces.length <= 2 * length_s + 2, `${surfaces.length} in ${length_s} s`);
  for (const { entities: tissues } of surfaces) {
    assert.deepEqual(tissues.map(({ id }) => id), ["tissue block", "tissue inclusion"].slice(0, tissues.length));
    for (const { triangles: [surface] } of tissues) {
      assert.ok(surface.points.length > 100 && surface.indices.length % 3 === 0);
      assert.ok(Math.max(...surface.indices) < surface.points.length);
      assert.ok(surface.color.r > 0 && surface.color.a > 0.5);
    }
  }
  const { entities } = tools.at(-1);
  assert.equal(entities[0].frame_id, "world");
  assert.ok(entities.some(({ spheres }) => spheres.length > 0), "the tip of the tool");
  assert.equal(topics.get("/tf").at(-1).transforms[0].parent_frame_id, "world");
  const points = topics.get("/tissue/points").at(-1);
  assert.equal(points.frame_id, "world");
  assert.ok(points.data.length / points.point_stride > 1000, "the vertices of the tissue");
}

test("a recording of loopback has the scene and every tick", kLimit, async () => {
  execFileSync(join(bin, "palpate"), ["loopback", session, "--seconds", "3", "--no-ideal", "--record", join(folder, "loopback.mcap")]);
  const { file, rows } = exported("loopback");
  assert.equal(rows.length, 3000);
  check(await open(file), rows);
});

test("a recording of launch has the scene and every tick that was recorded", kLimit, async () => {
  const run = { env: { ...process.env, PALPATE_RUN_DIR: join(folder, "run") } };
  execFileSync(join(bin, "palpate"), ["launch", session, "--seconds", "4", "--no-viewer", "--no-realtime", "--record", join(folder, "launch.mcap")], { ...run, stdio: "ignore" });
  const { file, rows } = exported("launch");
  assert.ok(rows.length > 1000, `${rows.length} ticks`);
  const topics = await open(file);
  check(topics, rows);
  const now_s = Date.now() / 1000;
  assert.ok(Math.abs(topics.get("/telemetry").at(-1).at_s - now_s) < 60, "on the wall clock");
});
