// SPDX-License-Identifier: Apache-2.0
// mock_server.mjs: viewer_node's web server as the page sees it, over a simulated session: a tool that
// presses into a block with a ball in it, 1 kHz, one bound on the force. A test can kill nodes, stop
// the tissue and read what the page sent.
//
//   node support/mock_server.mjs [PORT]    shows the page without any node
import { execFileSync } from "node:child_process";
import { createServer } from "node:http";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { WebSocketServer } from "ws";
import { create, createFileRegistry, fromBinary, toBinary } from "../../../viewer_node/web/node_modules/@bufbuild/protobuf/dist/esm/index.js";
import { FileDescriptorSetSchema } from "../../../viewer_node/web/node_modules/@bufbuild/protobuf/dist/esm/wkt/index.js";

const root = fileURLToPath(new URL("../../..", import.meta.url));
export const kContentSecurityPolicy =
  "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

const kTopics = {
  "/scene_state": "palpate.v1.SceneState", "/mesh": "palpate.v1.MeshFrame", "/device": "palpate.v1.DeviceTelemetry",
  "/mofc": "palpate.v1.MofcTelemetry", "/physics": "palpate.v1.PhysicsTelemetry", "/health": "palpate.v1.Health", "/log": "foxglove.Log", "/task_map": "palpate.v1.TaskMap",
};
const kSessions = { device: 11n, mofc: 22n, physics: 33n };
const kTip_m = 0.003;
const kBeside_m = 0.015;
const kStiffness = [250, 1500];
const kBound_newton = 1.1;
const kHolderTimeout_ms = 2000;
const kPointer = { centerM: { x: 0, y: 0, z: 0 }, reachM: 0.09, speedMPerS: 0.25, holderTimeoutNs: BigInt(kHolderTimeout_ms) * 1000000n };

/** The descriptor set of the .proto files, as protoc makes it. */
let descriptors;
function descriptor_set() {
  return descriptors ??= compile_descriptors();
}
function compile_descriptors() {
  const folder = mkdtempSync(join(tmpdir(), "palpate-"));
  try {
    const files = [...["scene", "telemetry", "viewer"].map((name) => `palpate/v1/${name}.proto`), "foxglove/foxglove_subset.proto"];
    execFileSync("protoc", ["-I", join(root, "proto"), "--include_imports", `--descriptor_set_out=${folder}/set`, ...files]);
    return readFileSync(`${folder}/set`);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

/** A box whose top has `cells` × `cells` squares; faces do not share vertices, so its edges are sharp. */
function box(cells, size, center) {
  const vertices = [];
  const triangles = [];
  const face = (n, origin, u, v) => {
    const first = vertices.length / 3;
    for (let j = 0; j <= n; ++j) for (let i = 0; i <= n; ++i) for (let a = 0; a < 3; ++a) vertices.push(origin[a] + (u[a] * i + v[a] * j) / n);
    for (let j = 0; j < n; ++j) for (let i = 0; i < n; ++i) {
      const at = first + j * (n + 1) + i;
      triangles.push(at, at + 1, at + n + 2, at, at + n + 2, at + n + 1);
    }
  };
  const [x, y, z] = size;
  const low = center.map((c, a) => c - size[a] / 2);
  const high = center.map((c, a) => c + size[a] / 2);
  face(cells, [low[0], low[1], high[2]], [x, 0, 0], [0, y, 0]);
  face(8, [low[0], high[1], low[2]], [x, 0, 0], [0, -y, 0]);
  face(8, low, [x, 0, 0], [0, 0, z]);
  face(8, [high[0], high[1], low[2]], [-x, 0, 0], [0, 0, z]);
  face(8, [low[0], high[1], low[2]], [0, -y, 0], [0, 0, z]);
  face(8, [high[0], low[1], low[2]], [0, y, 0], [0, 0, z]);
  return { vertices: Float32Array.from(vertices), triangles: Uint32Array.from(triangles), top: (cells + 1) ** 2 };
}

function sphere(rings, radius, center) {
  const vertices = [];
  const triangles = [];
  const columns = 2 * rings;
  for (let j = 0; j <= rings; ++j) for (let i = 0; i <= columns; ++i) {
    const polar = (Math.PI * j) / rings, azimuth = (2 * Math.PI * i) / columns;
    vertices.push(center[0] + radius * Math.sin(polar) * Math.cos(azimuth), center[1] + radius * Math.sin(polar) * Math.sin(azimuth), center[2] + radius * Math.cos(polar));
  }
  for (let j = 0; j < rings; ++j) for (let i = 0; i < columns; ++i) {
    const at = j * (columns + 1) + i;
    triangles.push(at, at + columns + 1, at + 1, at + 1, at + columns + 1, at + columns + 2);
  }
  return { vertices: Float32Array.from(vertices), triangles: Uint32Array.from(triangles) };
}

const bytes_of = (array) => new Uint8Array(array.buffer, array.byteOffset, array.byteLength);

/**
 * @param options.port      0: any
 * @param options.vertices  of the block's top, about
 * @param options.has_pointer  whether a page may move the hand
 * @param options.has_control  whether a page may change the tissues and acknowledge the device
 * @param options.names        of the tissues
 * @param options.shaft_m      length of the tool's shaft; 0: only a tip
 * @param options.sides        of the session: names; the tool of each further one is 15 mm to the right of the one before
 */
export async function start_mock_server({ port = 0, vertices = 2600, has_pointer = true, has_control = false, names = ["block", "inclusion"], shaft_m = 0, sides = [], page = join(root, "viewer_node/web/dist") } = {}) {
  const set = descriptor_set();
  const registry = createFileRegistry(fromBinary(FileDescriptorSetSchema, set));
  const schema = (name) => registry.getMessage(name);
  const encode = (name, fields) => toBinary(schema(name), create(schema(name), fields));

  const block = box(Math.max(4, Math.round(Math.sqrt(vertices)) - 1), [0.12, 0.12, 0.04], [0, 0, -0.02]);
  const ball = sphere(20, 0.008, [0, 0, -0.009]);
  const moved = block.vertices.slice();
  const begin_ms = performance.now();
  const initial = () => ({
    alive: { device: true, mofc: true, physics: true },
    is_silent: false, // the server is stuck; its connections stay open
    is_still: false, // the tool rests where it is
    dent: null, // where the tissue is deformed, if not at the tool
    offset: null, // of the block as a whole
    is_elastic: false, // both tissues are elastic: without k, with a stiffness per vertex
    ignores_changes: false, // no answer to them
    has_strain: false, // the block is an elastic body
    wrist_arm_m: 0, // a device with a wrist gives the torque of its force at this arm; 0: it has none
    orientation: null, // w, x, y, z of the tool, if it is turned
    targets: [], // every HandTarget received
    grip: 0, // GripState
    changes: [], // every TissueChange received
    device: { phase: 4, deviceFaults: 0n, lastFault: 0 }, // of its counters
    acknowledgements: [], // every Acknowledgement received
    refuses_changes: false,
    requests: [], // every RunRequest received
    recorder: { isPossible: true, isRecording: false, file: "", lengthS: 0, problem: "" },
    recordings: [], // that may be downloaded
    markers: [],
    replay: undefined, // as in palpate.v1.Health
    task: undefined, // likewise; a page that starts, marks and stops changes it
    stiffness: [...kStiffness], damping: [1, 60], // of the tissues
    holder: 0,
    tool: { x: -0.012, y: 0, z: 0.015 },
    refused: 0,
    gone: [], // "left.device": nodes of sides that are gone
    faults: {}, // by side: its last fault, while it lasts
    holders: {}, // by side
    refusal: 0, // HTTP status for whoever wants to connect; 0: nobody is refused
  });
  const world = { ...initial(), revision: 1n, mesh_frames: 0 };
  let target = null; // D = W here
  let held_ms = -Infinity;
  let next_client = 1;
  const sequences = { device: 0n, mofc: 0n, physics: 0n };
  let tick = 0n;
  let applied_newton = 0;
  let requested_newton = 0;
  const topic_of = (side, name) => (side ? `/${side}/${name}` : `/${name}`);
  const all_topics = sides.length === 0 ? kTopics : Object.fromEntries(Object.entries(kTopics).flatMap(([topic, schema]) =>
    (["/device", "/mofc", "/physics"].includes(topic) ? sides.map((side) => [topic_of(side, topic.slice(1)), schema]) : [[topic, schema]])));
  let last_z = 1;
  let energy = 0;
  let transparency_integral_ns = 0;
  let transparency_time_ns = 0n;
  let clamped_ticks = 0n;
  let contact_ticks = 0n;

  const header = (node) => ({
    protocolMajor: 1, sessionId: kSessions[node], sequence: sequences[node]++,
    sampledAtNs: BigInt(Math.round(1e6 * performance.now())),
  });

  function material(index, vertices) {
    if (!world.is_elastic) return { stiffnessNewtonPerM: world.stiffness[index], dampingNewtonSPerM: world.damping[index] };
    return { vertexStiffnessNewtonPerM: bytes_of(new Float32Array(vertices.length / 3).fill(world.stiffness[index])) };
  }

  function scene_state() {
    return encode("palpate.v1.SceneState", {
      header: { protocolMajor: 1, sessionId: kSessions.physics, sequence: 0n, sampledAtNs: 0n },
      revision: world.revision, sessionName: "mock", sessionText: 'name: "mock"', controller: "mofc guard",
      deviceRateHz: 1000, physicsRateHz: 1000, peakForceNewton: 3.3, tipRadiusM: kTip_m, shaftLengthM: shaft_m, shaftRadiusM: 0.002,
      workspaceScaleRatio: 1,
      tissues: [
        { name: names[0], shape: 3, verticesM: bytes_of(block.vertices), triangles: bytes_of(block.triangles), ...material(0, block.vertices) },
        { name: names[1], shape: 2, verticesM: bytes_of(ball.vertices), triangles: bytes_of(ball.triangles), ...material(1, ball.vertices) },
      ],
      acceptsChanges: has_control,
      reach: { centerM: { x: 0, y: 0, z: 0.02 }, halfExtentM: { x: 0.08, y: 0.06, z: 0.035 } },
      ...(has_pointer ? { pointer: kPointer } : {}),
    });
  }

  function mesh_frame() {
    const { x, y, z } = world.dent ?? world.tool;
    const depth = Math.max(0, kTip_m - z);
    const width = 0.011;
    const v = moved;
    for (let i = 0; i < block.top; ++i) {
      const dx = block.vertices[3 * i] - x, dy = block.vertices[3 * i + 1] - y;
      v[3 * i + 2] = block.vertices[3 * i + 2] - depth * Math.exp(-(dx * dx + dy * dy) / (width * width));
    }
    return encode("palpate.v1.MeshFrame", {
      header: { protocolMajor: 1, sessionId: kSessions.physics, sequence: 0n, sampledAtNs: 0n },
      sceneRevision: world.revision, tissue: 0, firstVertex: 0, verticesM: bytes_of(v.subarray(0, 3 * block.top)), deviceSequence: tick,
      // of an elastic body: a tenth per millimetre of the dent
      ...(world.has_strain ? { vertexStrain: bytes_of(Float32Array.from({ length: block.top }, (_, i) => 100 * (block.vertices[3 * i + 2] - v[3 * i + 2]))) } : {}),
      ...(world.offset ? { displacementWorldM: world.offset } : {}),
    });
  }

  function force_at({ x, y, z }) {
    const depth = Math.max(0, kTip_m - z);
    const over_ball = Math.exp(-(x * x + y * y) / 0.008 ** 2);
    return depth * world.stiffness[0] + Math.max(0, depth - 0.001) * world.stiffness[1] * over_ball;
  }

  const counters = (fields = {}) => ({ accepted: tick, skipped: 0n, duplicates: 0n, outOfOrder: 0n, rejected: 0n, ahead: 0n, sessions: 1n, ...fields });
  const loop = () => ({ ticks: tick, skippedTicks: 0n, worstLatenessNs: 412000n });

  // 20 ticks, as the nodes would send them
  function step() {
    const rows = 20;
    const device = { seq: [], at: [], late: [], reply: [], hand: [], tool: [], force: [], guard: [], flags: [], energy: [] };
    const physics = { seq: [], at: [], tool: [], force: [], contacts: [], depth: [], stiffness: [] };
    const mofc = { session: [], seq: [], at: [], asked: [], commanded: [], bound: [], ledger: [], age: [], state: [], flags: [] };
    for (let i = 0; i < rows; ++i) {
      const t = Number(tick) * 1e-3;
      if (target) {
        const limit = 0.25e-3; // m per tick
        for (const a of ["x", "y", "z"]) {
          const goal = a === "z" ? Math.max(target.z, target.z * 0.35) : target[a];
          world.tool[a] += Math.max(-limit, Math.min(limit, goal - world.tool[a]));
        }
      } else if (!world.is_still) {
        world.tool = { x: 0.014 * Math.sin(0.5 * t - 0.9), y: 0.004 * Math.sin(0.3 * t), z: 0.0045 + 0.0095 * Math.cos(4.2 * t) };
      }
      const asked = force_at(world.tool);
      const bound = kBound_newton + 0.25 * Math.sin(0.9 * t);
      const applied = world.alive.mofc && world.alive.physics ? Math.min(asked, bound) : 0;
      const is_clamped = asked > bound;
      energy = 0.9999 * energy + 1e-6 * applied;
      if (asked > 0.05) {
        transparency_integral_ns += applied / asked;
        transparency_time_ns += 1n;
      }
      if (is_clamped) clamped_ticks += 1n;
      if (asked > 0) contact_ticks += 1n;
      const at = BigInt(Math.round(1e6 * begin_ms)) + tick * 1000000n;
      const vector = (z) => [0, 0, z];
      const tool = [world.tool.x, world.tool.y, world.tool.z];
      const wobble = Math.abs(Math.sin(12.9898 * Number(tick)) * 43758.5453) % 1;
      device.seq.push(tick); device.at.push(at);
      device.late.push(BigInt(Math.round(8000 / (1.003 - wobble)))); device.reply.push(BigInt(Math.round(55000 + 12000 / (1.01 - wobble))));
      const depth = Math.max(0, kTip_m - world.tool.z);
      // a little more force inward than outward
      const damped = depth > 0 ? asked * (world.tool.z < last_z ? 1.1 : 0.9) : 0;
      last_z = world.tool.z;
      physics.seq.push(tick); physics.at.push(at); physics.tool.push(...tool); physics.force.push(...vector(damped));
      physics.contacts.push(depth > 0 ? 1 : 0); physics.depth.push(depth); physics.stiffness.push(depth > 0 ? world.stiffness[0] : 0);
      device.hand.push(...tool); device.tool.push(...tool); device.force.push(...vector(applied));
      device.guard.push(world.alive.mofc ? 1 : 0); device.flags.push(world.alive.mofc ? 1 : 0); device.energy.push(0.8 * energy);
      mofc.session.push(kSessions.device); mofc.seq.push(tick); mofc.at.push(at);
      mofc.asked.push(...vector(world.alive.physics ? asked : 0)); mofc.commanded.push(...vector(applied)); mofc.bound.push(bound, bound, bound);
      mofc.ledger.push(energy + 2e-4); mofc.age.push(BigInt(Math.round(1.4e6 + 6e5 * wobble)));
      mofc.state.push(world.alive.physics ? (asked > 0 ? 2 : 1) : 0); mofc.flags.push((is_clamped ? 1 : 0) | (asked > 0 ? 2 : 0) | (world.grip << 3));
      tick += 1n;
    }
    if (performance.now() - held_ms > kHolderTimeout_ms) world.holder = 0;
    const { device: with_device, mofc: with_mofc, physics: with_physics } = world.alive;
    const headers = {
      device: with_device ? header("device") : null, mofc: with_device && with_mofc ? header("mofc") : null, physics: with_physics ? header("physics") : null,
    };
    const is_to_be_sent = (name, side) => headers[name] && !world.gone.includes(`${side}.${name}`) && is_subscribed(topic_of(side, name));
    const torques = (forces) => (world.wrist_arm_m === 0 ? [] : forces.map((_, i) => (i % 3 === 0 ? world.wrist_arm_m * forces[i + 2] : 0)));
    for (const [index, side] of (sides.length > 0 ? sides : [""]).entries()) {
      const shifted = (places) => (index === 0 ? places : places.map((x, i) => (i % 3 === 0 ? x + kBeside_m * index : x)));
      if (is_to_be_sent("device", side)) send_all(topic_of(side, "device"), encode("palpate.v1.DeviceTelemetry", {
        header: headers.device,
        counters: { loop: loop(), forceCommand: counters(), answeredTicks: tick, maxForceNewton: 1.35, minimumTrueEnergyJoule: 0, ...world.device },
        sequence: device.seq, sampledAtNs: device.at, switchedAtNs: device.at, latenessNs: device.late, replyTimeNs: device.reply,
        measuredHandPositionM: device.hand, measuredToolPositionWorldM: shifted(device.tool), forceOnHandNewton: device.force, guard: device.guard, flags: device.flags,
        measuredToolOrientationWorld: world.orientation ? Array(rows).fill(world.orientation).flat() : [],
        wristTorqueOnHandNewtonM: torques(device.force),
        trueToolPositionWorldM: device.tool, trueToolVelocityWorldMPerS: device.tool, trueEnergyJoule: device.energy, minimumTrueEnergyJoule: device.energy,
      }));
      if (is_to_be_sent("mofc", side)) send_all(topic_of(side, "mofc"), encode("palpate.v1.MofcTelemetry", {
        header: headers.mofc,
        counters: {
          deviceState: counters(), interaction: counters(), ticks: tick, contactTicks: contact_ticks, clampedTicks: clamped_ticks,
          transparencyIntegralNs: transparency_integral_ns, transparencyTimeNs: transparency_time_ns,
        },
        deviceSessionId: mofc.session, deviceSequence: mofc.seq, deviceSampledAtNs: mofc.at, requestedForceOnHandNewton: mofc.asked,
        requestedWristTorqueNewtonM: torques(mofc.asked), commandedForceOnHandNewton: mofc.commanded, fMaxNewton: mofc.bound, ledgerEnergyJoule: mofc.ledger, forceAgeNs: mofc.age, state: mofc.state, flags: mofc.flags,
      }));
      if (is_to_be_sent("physics", side)) send_all(topic_of(side, "physics"), encode("palpate.v1.PhysicsTelemetry", {
        header: headers.physics, counters: { loop: loop(), toolMotion: counters({ skipped: 12n }), worstComputeTimeNs: 90000n },
        sequence: physics.seq, steppedAtNs: physics.at, deviceSequence: physics.seq, toolPositionWorldM: physics.tool, forceOnToolNewton: physics.force,
        storedEnergyJoule: physics.depth, contactCount: physics.contacts, computeTimeNs: physics.at, penetrationM: physics.depth, stiffnessNewtonPerM: physics.stiffness,
      }));
    }
    applied_newton = device.force.at(-1);
    requested_newton = mofc.asked.at(-1);
  }

  // as the server keeps them
  const log = [];
  function write_log(name, message, level = 2) {
    const now_ms = Date.now();
    log.push(encode("foxglove.Log", { timestamp: { seconds: BigInt(Math.floor(1e-3 * now_ms)), nanos: 1e6 * (now_ms % 1000) + log.length }, level, message, name }));
    send_all("/log", log.at(-1));
  }

  const heard_ms = { device: performance.now(), mofc: performance.now(), physics: performance.now() };
  const silence_s = (name) => 1e-3 * (performance.now() - heard_ms[name]);
  function health() {
    const state_of = (name, index) => ({
      name, deviceSessionId: kSessions.device, phase: world.faults[name] ? 5 : 4, deviceFaults: world.faults[name] ? 1n : 0n,
      lastFault: world.faults[name] ?? 0, guard: world.faults[name] ? 5 : 1,
      toolPositionWorldM: { ...world.tool, x: world.tool.x + kBeside_m * index }, toolOrientationWorld: { w: 1, x: 0, y: 0, z: 0 },
      forceOnHandNewton: { x: 0, y: 0, z: applied_newton }, requestedForceOnHandNewton: { x: 0, y: 0, z: requested_newton },
      handHolder: BigInt(world.holders[name] ?? 0), ...(has_pointer ? { pointer: kPointer } : {}), workspaceScaleRatio: 1,
    });
    const nodes = (sides.length > 0 ? sides.map((side) => `${side}.`) : [""]).flatMap((prefix) => Object.keys(heard_ms).map((name) => {
      const gone_s = world.gone.includes(prefix + name) ? 7 : silence_s(name);
      return { name: prefix + name, isHeard: gone_s < 1, silenceS: gone_s, sessions: 1n };
    }));
    for (const name of Object.keys(heard_ms)) if (world.alive[name]) heard_ms[name] = performance.now();
    return encode("palpate.v1.Health", {
      nodes, sides: sides.map(state_of),
      clients: sockets.clients.size, handHolder: BigInt(world.holder), version: "mock",
      recorder: world.recorder, markers: world.markers, ...(world.replay ? { replay: world.replay } : {}),
      ...(world.task ? { task: world.task } : {}),
    });
  }

  // ---- HTTP and WebSocket
  const types = { "/": ["index.html", "text/html; charset=utf-8"], "/app.js": ["app.js", "text/javascript"], "/app.css": ["app.css", "text/css"] };
  const http = createServer((request, response) => {
    const { pathname } = new URL(request.url, "http://x");
    if (pathname === "/verdict") {
      response.writeHead(world.refusal === 401 ? 401 : 200).end();
      return;
    }
    if (pathname === "/recordings") {
      response.writeHead(200, { "Content-Type": "application/json" }).end(JSON.stringify(world.recordings));
      return;
    }
    if (world.recordings.some(({ name }) => pathname === `/recordings/${name}`)) {
      response.writeHead(200, { "Content-Type": "application/octet-stream" }).end("mcap");
      return;
    }
    const entry = types[pathname];
    if (!entry) {
      response.writeHead(404).end();
      return;
    }
    response.writeHead(200, { "Content-Type": entry[1], "Content-Security-Policy": kContentSecurityPolicy, "X-Content-Type-Options": "nosniff" });
    response.end(readFileSync(join(page, entry[0])));
  });
  const sockets = new WebSocketServer({ server: http, verifyClient: (_, answer) => answer(world.refusal === 0, world.refusal), handleProtocols: (offered) => ["foxglove.websocket.v1", "foxglove.sdk.v1"].find((name) => offered.has(name)) ?? false });

  function send(socket, topic, payload) {
    if (world.is_silent) return;
    const subscription = socket.subscriptions.get(topic);
    if (subscription === undefined || socket.bufferedAmount > 4e6) return;
    const frame = Buffer.alloc(13 + payload.length);
    frame[0] = 1;
    frame.writeUInt32LE(subscription, 1);
    frame.writeBigUInt64LE(BigInt(Date.now()) * 1000000n, 5);
    frame.set(payload, 13);
    socket.send(frame);
  }
  const is_subscribed = (topic) => [...sockets.clients].some(({ subscriptions }) => subscriptions?.has(topic));
  function send_all(topic, payload) {
    for (const socket of sockets.clients) send(socket, topic, payload);
  }

  function take_change({ tissue, stiffnessNewtonPerM, dampingNewtonSPerM }) {
    world.changes.push({ tissue, stiffness: stiffnessNewtonPerM, damping: dampingNewtonSPerM });
    if (world.ignores_changes) return;
    if (world.refuses_changes) {
      write_log("physics_node", "event=tissue_change_refused count=1", 3);
      return;
    }
    world.stiffness[tissue] = stiffnessNewtonPerM;
    world.damping[tissue] = dampingNewtonSPerM;
    world.revision += 1n;
    write_log("physics_node", `event=tissue_changed tissue="${names[tissue]}" stiffness_newton_per_m=${stiffnessNewtonPerM} damping_newton_s_per_m=${dampingNewtonSPerM}`);
    send_all("/scene_state", scene_state());
  }

  /** As the evaluator does; the score is made up. */
  function change_task(kind) {
    const { task } = world;
    if (kind === 1 && task.phase === 0) {
      Object.assign(task, { phase: 1, marks: 0 });
      send_all("/task_map", area_map());
    }
    else if (kind === 0 && task.phase === 1) task.marks += 1;
    else if (kind === 2 && task.phase === 1) {
      Object.assign(task, {
        phase: 2,
        findings: ["Found 1 of 2.", "lump: found after 12.0 s, marked 3 mm from its centre.", "cyst: missed. You pressed too lightly: at most 0.8 N over it, and it can be felt from 2.0 N on."],
        figures: [{ label: "time", value: "30.0 s, stopped (limit 60 s)" }, { label: "coverage", value: "81.0 % of 25.0 cm² with 0.50 N or more" }],
      });
      send_all("/task_map", task_map());
    }
    send_all("/health", health());
  }

  /** The block's top, 5 cm wide: it is to be searched … */
  function area_map() {
    return encode("palpate.v1.TaskMap", { placesM: bytes_of(Float32Array.from(places_of_top().flat())) });
  }

  function places_of_top() {
    return Array.from({ length: 2500 }, (_, i) => [-0.025 + 1e-3 * (i % 50), -0.025 + 1e-3 * Math.floor(i / 50), 0]);
  }

  /** … and its left half was. */
  function task_map() {
    const places = places_of_top();
    return encode("palpate.v1.TaskMap", { placesM: bytes_of(Float32Array.from(places.flat())), isSearched: Uint8Array.from(places, ([x]) => (x < 0 ? 1 : 0)),
      lesions: [
        { name: "lump", centerM: { x: 0.01, y: 0, z: -0.01 }, radiusM: 0.006, isFound: true },
        { name: "cyst", centerM: { x: -0.01, y: 0, z: -0.01 }, radiusM: 0.004, isFound: false },
      ],
      slotS: 0.1, mostNewton: Array.from({ length: 300 }, (_, i) => (i < 20 || i > 29 ? 1.25 * (1 + Math.sin(0.1 * i)) : NaN)),
      marksS: [12], limitNewton: 2 });
  }

  function take_request({ marker, markerKind, seekS, isPaused, speedRatio, isRecording }) {
    world.requests.push({ marker, seekS, isPaused, speedRatio, isRecording });
    if (marker !== undefined && world.task) change_task(markerKind);
    if (isRecording !== undefined) world.recorder = { ...world.recorder, isRecording, file: "mock.mcap", lengthS: 0 };
    if (marker !== undefined) {
      const text = marker || ["marker 1", "task started", "task stopped"][markerKind ?? 0];
      write_log("run", `event=marker origin=page text="${text}"`);
      world.markers = [...world.markers, { atNs: BigInt(Date.now()) * 1000000n, text, origin: "page" }];
    }
    if (!world.replay) return;
    if (seekS !== undefined) world.replay.positionS = seekS;
    if (isPaused !== undefined) world.replay.isPaused = isPaused;
    if (speedRatio !== undefined) world.replay.speedRatio = speedRatio;
    send_all("/health", health());
  }

  sockets.on("connection", (socket) => {
    const topics = Object.keys(all_topics);
    socket.subscriptions = new Map();
    socket.client_id = next_client++;
    socket.published = new Map();
    socket.send(JSON.stringify({
      op: "serverInfo", name: "mock", capabilities: ["clientPublish"], supportedEncodings: ["protobuf"],
      sessionId: String(begin_ms), metadata: { client_id: String(socket.client_id), session: "mock", client_topics: [...(has_pointer ? (sides.length > 0 ? sides.map((side) => `/${side}/hand_target`) : ["/hand_target"]) : []), ...(has_control ? ["/tissue_change", "/acknowledgement"] : []), "/run_request"].join(" ") },
    }));
    socket.send(JSON.stringify({
      op: "advertise",
      channels: topics.map((topic, i) => ({ id: i + 1, topic, encoding: "protobuf", schemaName: all_topics[topic], schemaEncoding: "protobuf", schema: set.toString("base64") })),
    }));
    socket.on("message", (data, is_binary) => {
      if (!is_binary) {
        const message = JSON.parse(data.toString());
        if (message.op === "subscribe") {
          for (const { id, channelId } of message.subscriptions) {
            const topic = topics[channelId - 1];
            socket.subscriptions.set(topic, id);
            if (topic === "/scene_state" && world.alive.physics) send(socket, topic, scene_state());
            if (topic === "/log") for (const line of log) send(socket, topic, line);
            if (topic === "/mesh" && world.alive.physics) send(socket, topic, mesh_frame());
          }
        } else if (message.op === "advertise") {
          for (const channel of message.channels) socket.published.set(channel.id, { schema: channel.schemaName, topic: channel.topic });
        } else if (message.op === "unsubscribe") {
          for (const [topic, id] of socket.subscriptions) if (message.subscriptionIds.includes(id)) socket.subscriptions.delete(topic);
        }
        return;
      }
      const { schema: published, topic } = socket.published.get(data.readUInt32LE(1)) ?? {};
      if (data[0] === 1 && published === "palpate.v1.TissueChange") {
        take_change(fromBinary(schema(published), data.subarray(5)));
        return;
      }
      if (data[0] === 1 && published === "palpate.v1.Acknowledgement") {
        const { deviceSessionId, phase, deviceFaults } = fromBinary(schema(published), data.subarray(5));
        world.acknowledgements.push({ is_of_device: deviceSessionId === kSessions.device, phase, deviceFaults });
        return;
      }
      if (data[0] === 1 && published === "palpate.v1.RunRequest") {
        take_request(fromBinary(schema(published), data.subarray(5)));
        return;
      }
      if (data[0] !== 1 || published !== "palpate.v1.HandTarget") throw new Error("not a HandTarget");
      const message = fromBinary(schema("palpate.v1.HandTarget"), data.subarray(5));
      if (world.holder !== 0 && world.holder !== socket.client_id) {
        world.refused += 1;
        return;
      }
      world.holder = message.isReleased ? 0 : socket.client_id;
      world.holders = { [topic.split("/")[1]]: world.holder };
      held_ms = performance.now();
      target = message.handPositionM;
      world.targets.push({ client: socket.client_id, topic, ...target, is_released: message.isReleased, buttons: message.buttons ?? 0, at_ms: held_ms });
    });
    socket.on("close", () => {
      if (world.holder === socket.client_id) world.holder = 0;
    });
  });

  await new Promise((resolve) => http.listen(port, "127.0.0.1", resolve));
  const timers = [
    setInterval(() => {
      // as many batches as are due, whatever the timer does
      while (Number(tick) < performance.now() - begin_ms) {
        if (world.replay?.isPaused) tick += 20n;
        else step();
      }
    }, 20),
    setInterval(() => {
      if (!world.alive.physics) return;
      world.mesh_frames += 1;
      send_all("/mesh", mesh_frame());
    }, 33),
    setInterval(() => send_all("/health", health()), 200),
  ];
  return {
    world,
    url: `http://127.0.0.1:${http.address().port}/`,
    write_log,
    /** Topics to which any page subscribes. */
    subscribed: () => Object.keys(all_topics).filter(is_subscribed),
    change_scene: () => {
      world.revision += 1n;
      send_all("/scene_state", scene_state());
    },
    send_scene: () => send_all("/scene_state", scene_state()),
    /** The world as at the start; pages, clock and revision stay. */
    reset: () => {
      Object.assign(world, initial());
      target = null;
    },
    cut: () => { for (const socket of sockets.clients) socket.terminate(); },
    close: () => new Promise((resolve) => {
      timers.forEach(clearInterval);
      for (const socket of sockets.clients) socket.terminate();
      http.close(resolve);
      http.closeAllConnections?.();
    }),
  };
}

if (process.argv[1] && import.meta.url === pathToFileURL(process.argv[1]).href) {
  const server = await start_mock_server({ port: Number(process.argv[2] ?? 8765), vertices: Number(process.argv[3] ?? 2600) });
  console.log(server.url);
}
