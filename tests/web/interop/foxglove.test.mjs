// SPDX-License-Identifier: Apache-2.0
// foxglove.test.mjs: Foxglove's own schemas against proto/foxglove, and Foxglove's own client on every
// channel of the four real programs. $PALPATE_BIN names the folder of the programs.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { after, before, test } from "node:test";
import schemas from "@foxglove/schemas/internal.js";
import ws_protocol from "@foxglove/ws-protocol";
import protobuf from "protobufjs";
import "protobufjs/ext/descriptor.js";
import WebSocket from "ws";
import { patience } from "../support/machine.mjs";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const session = join(root, "deploy/sessions/default.txtpb");
const kLimit = { timeout: patience(60000), skip: existsSync(join(bin, "palpate")) ? false : `no programs in ${bin}: set PALPATE_BIN` };

// ---- schemas

/** All messages below a namespace, by name. */
function messages_of(namespace) {
  return new Map(namespace.nestedArray.filter((entry) => entry instanceof protobuf.Type).map((type) => [type.name, type]));
}

/** Name, number, type and repetition of every field; an enum's values instead of its name. */
function shape_of(type) {
  const fields = type.resolveAll().fieldsArray.map((field) => {
    const resolved = field.resolvedType;
    const kind = resolved instanceof protobuf.Enum ? { ...resolved.values } : resolved ? resolved.fullName : field.type;
    return [field.name, { number: field.id, kind, is_repeated: field.repeated }];
  });
  return new Map(fields);
}

test("every field of the subset is Foxglove's: name, number, type", () => {
  const theirs = new protobuf.Root();
  const enums = Object.values(schemas.foxgloveEnumSchemas);
  for (const schema of Object.values(schemas.foxgloveMessageSchemas)) {
    const text = schemas.generateProto(schema, enums.filter((one) => one.parentSchemaName === schema.name));
    protobuf.parse(text, theirs, { keepCase: true });
  }
  for (const name of ["timestamp", "duration"]) theirs.addJSON(protobuf.common.get(`google/protobuf/${name}.proto`).nested);
  const ours = new protobuf.Root();
  ours.resolvePath = (_, target) => target;
  ours.loadSync(join(root, "proto/foxglove/foxglove_subset.proto"), { keepCase: true });

  const their_messages = messages_of(theirs.lookup("foxglove"));
  const our_messages = messages_of(ours.lookup("foxglove"));
  assert.ok(our_messages.size >= 20, `${our_messages.size} messages`);
  for (const [name, type] of our_messages) {
    assert.ok(their_messages.has(name), `foxglove.${name} does not exist`);
    const their_fields = shape_of(their_messages.get(name));
    for (const [field, shape] of shape_of(type)) assert.deepEqual(shape, their_fields.get(field), `${name}.${field}`);
  }
});

// ---- channels

let folder;
let launch;
let url;
before(async () => {
  if (kLimit.skip) return;
  folder = mkdtempSync(join(tmpdir(), "palpate-foxglove-"));
  launch = spawn(join(bin, "palpate"), ["launch", session, "--no-realtime", "--set", "viewer.web.port=0"],
    { env: { ...process.env, PALPATE_RUN_DIR: folder }, stdio: ["ignore", "ignore", "pipe"] });
  url = await new Promise((resolve, reject) => {
    let text = "";
    launch.stderr.on("data", (data) => {
      text += data;
      const found = /event=web url=http(:\S+)/.exec(text);
      if (found) resolve(`ws${found[1]}`);
    });
    launch.on("exit", () => reject(new Error(text)));
  });
});
after(async () => {
  if (!launch) return;
  if (launch.exitCode === null) {
    launch.kill("SIGTERM");
    await once(launch, "exit");
  }
  rmSync(folder, { recursive: true, force: true });
});

/** Of a few messages of every channel: what must be right in one of them, decoded as Foxglove would. */
const kChecks = {
  "/scene_state": (m) => m.tissues.length === 2 && m.tissues[0].vertices_m.length > 1000,
  "/mesh": (m) => m.vertices_m.length > 0 && m.vertices_m.length % 12 === 0,
  "/device": (m) => m.sequence.length > 0 && m.force_on_hand_newton.length === 3 * m.sequence.length,
  "/mofc": (m) => m.device_sequence.length > 0 && m.commanded_force_on_hand_newton.length === 3 * m.device_sequence.length,
  "/physics": (m) => m.sequence.length > 0 && m.force_on_tool_newton.length === 3 * m.sequence.length,
  "/health": (m) => m.nodes.length === 3 && m.nodes.every((node) => node.is_heard),
  "/telemetry": (m) => Number.isFinite(m.tool_position_world_m.x) && Math.abs(m.timestamp - Date.now() / 1000) < 10,
  "/tissue/points": (m) => m.point_stride === 12 && m.data.length > 12000 && m.data.length % 12 === 0 &&
    m.fields.map(({ name, offset = 0, type }) => `${name}${offset}:${type}`).join() === "x0:FLOAT32,y4:FLOAT32,z8:FLOAT32",
  "/scene": (m) => m.entities.some((entity) => entity.spheres.length > 0) && m.entities.some((entity) => entity.arrows.length > 0),
  "/tf": (m) => m.transforms[0].parent_frame_id === "world" && m.transforms[0].child_frame_id === "tool",
  "/log": (m) => m.level === "WARNING" && m.name === "device_node" && m.message.startsWith("event="),
};

for (const subprotocol of ["foxglove.sdk.v1", "foxglove.websocket.v1"]) {
  test(`Foxglove's client and protobufjs read every channel under ${subprotocol}`, kLimit, async () => {
    const socket = new WebSocket(url, [subprotocol]);
    const client = new ws_protocol.FoxgloveClient({ ws: socket });
    const complaints = [];
    client.on("error", (error) => complaints.push(error.message));
    client.on("status", (status) => complaints.push(status.message));
    const open = new Map(); // by subscription: topic and decoder
    const wanted = new Set(Object.keys(kChecks));
    const last_seen = new Map();
    const all_read = new Promise((resolve) => {
      client.on("message", ({ subscriptionId, timestamp, data }) => {
        const { topic, decode } = open.get(subscriptionId);
        assert.ok(Math.abs(Number(timestamp / 1000000n) - Date.now()) < 10000);
        const message = decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
        last_seen.set(topic, message);
        if (kChecks[topic](message)) wanted.delete(topic);
        if (wanted.size === 0) resolve();
      });
    });
    const greeting = ["serverInfo", "advertise"].map((event) => new Promise((resolve) => client.on(event, resolve)));
    const [info, channels] = await Promise.all(greeting);
    assert.match(info.name, /^viewer_node /);
    assert.equal(socket.protocol, subprotocol);
    assert.deepEqual(channels.map(({ topic }) => topic).sort(), [...wanted].sort());
    for (const { id, topic, encoding, schemaName, schemaEncoding, schema } of channels) {
      assert.equal(encoding, "protobuf");
      assert.equal(schemaEncoding, "protobuf");
      const set = protobuf.descriptor.FileDescriptorSet.decode(Buffer.from(schema, "base64"));
      const type = protobuf.Root.fromDescriptor(set, { keepCase: true }).lookupType(schemaName);
      open.set(client.subscribe(id), { topic, decode: (data) => type.toObject(type.decode(data), { enums: String, longs: Number, arrays: true }) });
    }

    // the log has something to say when the clamp dies; the supervisor starts it again
    await once(socket, "message");
    process.kill(await pid_of("mofc_node"), "SIGKILL");

    const late = setTimeout(() => { throw new Error(`never right: ${[...wanted].map((topic) => `${topic}: ${JSON.stringify(last_seen.get(topic))?.slice(0, 500)}`)}`); }, patience(40000));
    await all_read;
    clearTimeout(late);
    client.close();
    assert.deepEqual(complaints, []);
  });
}

/** The child of palpate launch with that name; one that is being restarted is waited for. */
async function pid_of(name) {
  for (;;) {
    const tasks = readdirSync(`/proc/${launch.pid}/task`);  // any thread may have started it
    const children = tasks.flatMap((task) => readFileSync(`/proc/${launch.pid}/task/${task}/children`, "utf8").trim().split(" "));
    const found = children.find((pid) => existsSync(`/proc/${pid}/comm`) && readFileSync(`/proc/${pid}/comm`, "utf8").trim() === name);
    if (found) return Number(found);
    await new Promise((resolve) => setTimeout(resolve, 10));
  }
}
