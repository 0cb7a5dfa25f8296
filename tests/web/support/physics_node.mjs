// SPDX-License-Identifier: Apache-2.0
// physics_node.mjs: a half-space of 400 N/m below z = 0 as the physics of `palpate launch`, written from
// docs/wire.md alone. The first argument is the folder of the protos.
import { randomBytes } from "node:crypto";
import { join } from "node:path";
import protobuf from "protobufjs";
import * as zmq from "zeromq";

const kToolMotion = 3;
const kInteraction = 4;
const kSubscription = 11;
const kStiffness = 400; // N/m

const protos = new protobuf.Root();
protos.resolvePath = (_, file) => join(process.argv[2], file);
await protos.load(["palpate/v1/tool_motion.proto", "palpate/v1/interaction.proto"], { keepCase: true });
const ToolMotion = protos.lookupType("palpate.v1.ToolMotion");
const Interaction = protos.lookupType("palpate.v1.Interaction");

const { sides, rate_hz } = JSON.parse(process.env.PALPATE_PHYSICS);
const motions = new zmq.Pull({ receiveHighWaterMark: 256, maxMessageSize: 16 << 10, linger: 0, ipv6: true });
const interactions = new zmq.Router({ sendHighWaterMark: 4, receiveHighWaterMark: 4, maxMessageSize: 1 << 10,
  mandatory: true, sendTimeout: 0, linger: 0, ipv6: true });
await motions.bind(sides[0].tool_motion);
await interactions.bind(sides[0].interaction);

// --- hop 3: the receivers
const receivers = new Map(); // by peer: name, whether it wants interactions, when it was heard
async function listen() {
  for await (const [peer, ...frames] of interactions) {
    if (frames.length !== 1 || frames[0][0] !== kSubscription) continue;
    const wants = frames[0].subarray(1).includes(kInteraction);
    if (receivers.size < 32) receivers.set(peer.toString("hex"), { peer, wants, heard: performance.now() });
  }
}

const session_id = protobuf.util.LongBits.fromHash(randomBytes(8).toString("latin1")).toLong(true).or(1);
let sequence = 0;
async function answer(motion) {
  const depth = -motion.tool_position_world_m.z;
  const elastic = { z: kStiffness * depth };
  const force = depth > 0 ? elastic : {};
  const energy = 0.5 * kStiffness * depth * depth;
  const message = {
    header: { protocol_major: 1, session_id, sequence: sequence++, sampled_at_ns: Math.round(performance.now() * 1e6) },
    answers: motion.device,
    tool_position_world_m: motion.tool_position_world_m,
    tool_orientation_world: motion.tool_orientation_world,
    force_on_tool_newton: force,
    stored_energy_joule: depth > 0 ? energy : 0,
    contacts: [{ penetration_m: depth, normal_world: { z: 1 }, force_on_tool_newton: force,
      surface_velocity_world_m_per_s: {}, elastic_force_on_tool_newton: elastic,
      d_force_d_position: [0, 0, 0, 0, 0, 0, 0, 0, -kStiffness], stored_energy_joule: energy, trust_radius_m: 1 }],
    contact_count: depth > 0 ? 1 : 0,
  };
  const frame = Buffer.concat([Buffer.of(kInteraction), Interaction.encode(message).finish()]);
  for (const [name, { peer, wants, heard }] of receivers) {
    if (performance.now() - heard > 1000) receivers.delete(name);
    else if (wants) await interactions.send([peer, frame]).catch((error) => error.code === "EHOSTUNREACH" && receivers.delete(name));
  }
}

// --- hop 2: the newest motion counts
let newest;
let heard_at = 0; // ms, the session of the newest
let is_busy = false;
let answered_at = 0;
async function answer_newest() {
  if (is_busy || !newest) return;
  is_busy = true;
  answered_at = performance.now();
  await answer(newest);
  is_busy = false;
}
async function follow() {
  for await (const frames of motions) {
    if (frames.length !== 1 || frames[0].length > 4096 || frames[0][0] !== kToolMotion) continue;
    try {
      const motion = ToolMotion.decode(frames[0].subarray(1));
      if (motion.header?.protocol_major !== 1 || !motion.device || !Number.isFinite(motion.tool_position_world_m?.z)) continue;
      const is_same = newest?.header.session_id.equals(motion.header.session_id);
      if (newest && !is_same && performance.now() - heard_at < 100) continue; // a second mofc_node
      heard_at = performance.now();
      if (is_same && motion.header.sequence.lessThanOrEqual(newest.header.sequence)) continue;
      newest = motion;
      setImmediate(answer_newest);
    } catch { /* malformed */ }
  }
}
// no new motion for one period: the newest is answered again
setInterval(() => performance.now() - answered_at >= 1e3 / rate_hz && answer_newest(), Math.max(1, 1e3 / rate_hz));

for (const signal of ["SIGTERM", "SIGINT"]) process.on(signal, () => process.exit(0));
await Promise.all([listen(), follow()]);
