// SPDX-License-Identifier: Apache-2.0
// telemetry.ts: the state of the running nodes: every tick of the last minute, the newest figures,
// which nodes are alive. No DOM; callers pass the time.
import { Ring } from "./ring";
import {
  columns_agree, Guard, kDeviceAnswered, Grip, kGripShift, kMofcClamped, kMofcInContact, Mofc,
  type DeviceTelemetry, type Header, type Health, type MofcTelemetry, type PhysicsTelemetry, type Quaternion,
  type Vector3,
} from "./wire";

/** A minute at 4 kHz. */
const kRingCapacity = 1 << 18;
/** A minute at 1 kHz. */
const kPhysicsCapacity = 1 << 16;
/** A minute of batches, 50 a second. */
const kBatchCapacity = 4096;
/** Nodes send a batch every 20 ms, with or without ticks. */
export const kGoneAfter_s = 1.2;
/** Values of a node are withdrawn after that silence, or after a few of its usual gaps between batches. */
export const kStaleAfter_s = 0.1;
const kStaleGaps = 4;
/** Slower replays may send a batch less than every second. */
const kSlowReplay = 0.1;
const kTransparencyWindow_s = 1;
const kRateWindow_s = 2;
/** The speed of the tool is that over this time: finer, the encoder's steps would show. */
const kSpeedWindow_s = 0.05;
/** The clamp renders less than half of the force for so long: the credit is exhausted. */
const kExhausted_s = 0.5;
/** A tick's clamp or fallback is displayed for this long, so that it can be read. */
const kWordsHold_s = 0.25;

export const kNodes = ["device", "mofc", "physics"] as const;
export type NodeName = (typeof kNodes)[number];

// columns of the device's ring: force and torque on the hand, rendered
export const kForceX = 0, kForceNorm = 3, kTrueEnergy = 4, kLateness = 5, kReplyTime = 6, kTorqueX = 7, kTorqueNorm = 10;
const kDeviceColumns = 11;
// of mofc's: requested force, before the clamp; its bound; requested torque
export const kRequestedX = 0, kRequestedNorm = 3, kBoundX = 4, kBoundNorm = 7, kLedger = 8, kForceAge = 9,
  kRequestedTorqueX = 10, kRequestedTorqueNorm = 13;
const kMofcColumns = 14;
// of the batches: running sums, and their ratio over the last second
const kTransparencyIntegral = 0, kTransparencyTime = 1;
export const kTransparency = 2;
const kBatchColumns = 3;
// of physics': the deepest contact, and the force of the tissue
export const kDepth = 0, kTissueForce = 1;
const kPhysicsColumns = 2;

/** An event in the plots. */
export interface Instant {
  at_s: number; // device's clock
  tone: "calm" | "notice" | "alarm" | "marker";
  text: string;
}
const kMostInstants = 512;
/** The delay of a message varies; the clocks agree to this, per batch. */
const kClockDrift_s = 0.001;
const kClockJump_s = 0.5;

/** One node, as received through the server. */
export class NodeLink {
  /** Page's clock; NaN before the first. */
  heard_s = NaN;
  restarts = 0;
  /** Between the node and this page: gaps in the sequence. */
  batches_lost = 0;
  /** Within the node. */
  records_lost = 0;
  /** Of its loop, by its own count and clock. */
  rate_hz = NaN;
  private known_s = NaN; // since then this page knows of it
  private gap_s = 0; // between batches, smoothed
  private session = 0n;
  private sequence = 0n;
  private rate_ticks = 0n;
  private rate_ns = 0n;

  /** True if the node was restarted. */
  note(header: Header, records_lost: bigint, ticks: bigint, now_s: number): boolean {
    const is_restart = this.session !== 0n && header.sessionId !== this.session;
    if (is_restart) this.restarts += 1;
    if (this.session === header.sessionId && header.sequence > this.sequence + 1n) {
      this.batches_lost += Number(header.sequence - this.sequence - 1n);
    }
    const is_new = header.sessionId !== this.session;
    const elapsed_s = 1e-9 * Number(header.sampledAtNs - this.rate_ns);
    if (is_new || elapsed_s >= kRateWindow_s) {
      this.rate_hz = is_new ? NaN : Number(ticks - this.rate_ticks) / elapsed_s;
      this.rate_ticks = ticks;
      this.rate_ns = header.sampledAtNs;
    }
    this.session = header.sessionId;
    this.sequence = header.sequence;
    this.records_lost = Number(records_lost);
    const gap_s = now_s - this.heard_s;
    if (gap_s < kGoneAfter_s) this.gap_s += 0.1 * (gap_s - this.gap_s);
    this.know(now_s, now_s);
    return is_restart;
  }

  /** It was heard at this time. */
  know(heard_s: number, now_s: number): void {
    if (Number.isNaN(this.heard_s)) this.known_s = now_s;
    this.heard_s = heard_s;
  }
  silence_s(now_s: number): number {
    return now_s - this.heard_s;
  }
  /** Its newest values still hold. */
  is_fresh(now_s: number): boolean {
    return now_s - this.heard_s < Math.max(kStaleAfter_s, kStaleGaps * this.gap_s);
  }
  is_alive(now_s: number): boolean {
    return now_s - this.heard_s < kGoneAfter_s;
  }
  /** It has fallen silent. A page that has only just begun has not waited for it yet. */
  is_gone(now_s: number): boolean {
    return !Number.isNaN(this.heard_s) && !this.is_alive(now_s) && now_s - this.known_s >= kGoneAfter_s;
  }
}

export class Telemetry {
  readonly nodes: Record<NodeName, NodeLink> = {
    device: new NodeLink(), mofc: new NodeLink(), physics: new NodeLink(),
  };
  readonly device = new Ring(kDeviceColumns, kRingCapacity);
  readonly mofc = new Ring(kMofcColumns, kRingCapacity);
  readonly batches = new Ring(kBatchColumns, kBatchCapacity, Float64Array);
  /** By the clock of physics_node. */
  readonly physics = new Ring(kPhysicsColumns, kPhysicsCapacity);

  device_batch: DeviceTelemetry | null = null; // newest
  mofc_batch: MofcTelemetry | null = null;
  physics_batch: PhysicsTelemetry | null = null;
  health: Health | null = null;
  replay_stands = false; // its nodes are silent

  // newest tick of each
  readonly hand_m: Vector3 = { x: NaN, y: NaN, z: NaN }; // D, measured
  readonly tool_m: Vector3 = { x: NaN, y: NaN, z: NaN }; // W, measured, of the same tick
  readonly tool_orientation: Quaternion = { w: 1, x: 0, y: 0, z: 0 }; // W from T, likewise
  readonly applied_newton: Vector3 = { x: 0, y: 0, z: 0 }; // on the hand
  readonly requested_newton: Vector3 = { x: 0, y: 0, z: 0 };
  /** On the hand, per joint of the wrist; null: the device has none. */
  applied_newton_m: Vector3 | null = null;
  /** Of the tool, W; NaN while unknown. */
  speed_m_per_s = NaN;
  /** Of the deepest contact; 0 without one, NaN if physics does not tell. */
  depth_m = NaN;
  stiffness_newton_per_m = NaN;
  guard: Guard = Guard.limp;
  mofc_state: Mofc = Mofc.no_physics;
  is_in_contact = false;
  grip: Grip = Grip.none;
  // device's clock
  private clamped_s = -Infinity;
  private fallback_s = -Infinity;
  private rendered_s = -Infinity; // at least half of the requested force
  private places: { at_s: number; tool_m: Vector3 }[] = []; // of the tool, oldest first

  private physics_session = 0n;
  private physics_base_ns = 0n;
  /** Oldest first. */
  readonly instants: Instant[] = [];
  private early: { wall_s: number; tone: Instant["tone"]; text: string }[] = []; // before the first tick
  private wall_less_device_s = NaN; // server's clock less the device's, with the least delay seen

  private device_session = 0n;
  private base_ns = 0n; // of the device's clock: where the page's seconds begin

  /** Newest tick, in seconds since the first one seen; NaN before. */
  get now_s(): number {
    return Math.max(this.device.newest_s, this.mofc.length > 0 ? this.mofc.newest_s : -Infinity);
  }
  get is_clamped(): boolean {
    return this.now_s - this.clamped_s < kWordsHold_s;
  }
  /** The clamp has rendered less than half of the requested force for a while. */
  get is_exhausted(): boolean {
    return this.is_clamped && this.now_s - this.rendered_s > kExhausted_s;
  }
  get is_fallback(): boolean {
    return this.now_s - this.fallback_s < kWordsHold_s;
  }
  /** Of the session so far, 0 … 1; NaN before the first requested force. */
  get transparency(): number {
    const counters = this.mofc_batch?.counters;
    return counters ? counters.transparencyIntegralNs / Number(counters.transparencyTimeNs) : NaN;
  }

  /** @param wall_s  when the server sent it, by its clock; NaN: not known */
  take_device(batch: DeviceTelemetry, now_s: number, wall_s = NaN): void {
    const rows = batch.sampledAtNs.length;
    require_columns(columns_agree(rows,
      [batch.latenessNs, batch.replyTimeNs, batch.guard, batch.flags, batch.trueEnergyJoule],
      [batch.measuredHandPositionM, batch.measuredToolPositionWorldM, batch.forceOnHandNewton]));
    const orientations = batch.measuredToolOrientationWorld;
    require_columns(orientations.length === 0 || orientations.length === 4 * rows);
    const torques = batch.wristTorqueOnHandNewtonM ?? [];
    require_columns(torques.length === 0 || torques.length === 3 * rows);
    this.nodes.device.note(batch.header, batch.recordsLost, batch.counters.loop.ticks, now_s);
    this.device_batch = batch;
    if (batch.header.sessionId !== this.device_session) {
      if (rows === 0) return;
      this.begin_device_session(batch.header.sessionId, batch.sampledAtNs[0]);
    }
    const ring = this.device;
    for (let i = 0; i < rows; ++i) {
      const t_s = this.seconds(batch.sampledAtNs[i]);
      if (!ring.append(t_s)) continue;
      put_vector(ring, kForceX, batch.forceOnHandNewton, i);
      if (torques.length > 0) put_vector(ring, kTorqueX, torques, i);
      ring.set(kTrueEnergy, batch.trueEnergyJoule[i]);
      ring.set(kLateness, 1e-9 * Number(batch.latenessNs[i]));
      if (batch.flags[i] & kDeviceAnswered) ring.set(kReplyTime, 1e-9 * Number(batch.replyTimeNs[i]));
      this.guard = batch.guard[i];
      if (this.guard === Guard.fallback || this.guard === Guard.fading) this.fallback_s = t_s;
    }
    if (rows === 0) return;
    this.compare_clocks(wall_s);
    copy_vector(batch.measuredHandPositionM, rows - 1, this.hand_m);
    copy_vector(batch.measuredToolPositionWorldM, rows - 1, this.tool_m);
    copy_vector(batch.forceOnHandNewton, rows - 1, this.applied_newton);
    this.applied_newton_m = torques.length > 0 ? copy_vector(torques, rows - 1, { x: 0, y: 0, z: 0 }) : null;
    this.measure_speed(ring.newest_s);
    const [w, x, y, z] = orientations.length > 0 ? orientations.slice(-4) : [1, 0, 0, 0];
    Object.assign(this.tool_orientation, { w, x, y, z });
  }

  take_mofc(batch: MofcTelemetry, now_s: number): void {
    const rows = batch.deviceSampledAtNs.length;
    require_columns(columns_agree(rows,
      [batch.deviceSessionId, batch.ledgerEnergyJoule, batch.forceAgeNs, batch.state, batch.flags],
      [batch.requestedForceOnHandNewton, batch.commandedForceOnHandNewton, batch.fMaxNewton]));
    const torques = batch.requestedWristTorqueNewtonM ?? [];
    require_columns(torques.length === 0 || torques.length === 3 * rows);
    if (this.nodes.mofc.note(batch.header, batch.recordsLost, batch.counters.ticks, now_s)) {
      this.batches.clear();
    }
    this.mofc_batch = batch;
    const ring = this.mofc;
    let last = -1;
    for (let i = 0; i < rows; ++i) {
      if (batch.deviceSessionId[i] !== this.device_session) continue;
      const t_s = this.seconds(batch.deviceSampledAtNs[i]);
      if (!ring.append(t_s)) continue;
      last = i;
      put_vector(ring, kRequestedX, batch.requestedForceOnHandNewton, i);
      if (torques.length > 0) put_vector(ring, kRequestedTorqueX, torques, i);
      put_bound(ring, batch.fMaxNewton, i);
      if (!(ring.value(kBoundNorm, ring.length - 1) < 0.5 * ring.value(kRequestedNorm, ring.length - 1))) this.rendered_s = t_s;
      ring.set(kLedger, batch.ledgerEnergyJoule[i]);
      const age_s = 1e-9 * Number(batch.forceAgeNs[i]);
      if (age_s > 0) ring.set(kForceAge, age_s);
      if (batch.flags[i] & kMofcClamped) this.clamped_s = t_s;
    }
    if (last < 0) return;
    this.mofc_state = batch.state[last];
    this.grip = (batch.flags[last] >> kGripShift) & 7;
    this.is_in_contact = (batch.flags[last] & kMofcInContact) !== 0;
    copy_vector(batch.requestedForceOnHandNewton, last, this.requested_newton);
    this.keep_transparency(batch);
  }

  take_physics(batch: PhysicsTelemetry, now_s: number): void {
    require_columns(columns_agree(batch.steppedAtNs.length, [batch.contactCount], [batch.toolPositionWorldM]));
    const rows = batch.steppedAtNs.length;
    const { penetrationM: depth, stiffnessNewtonPerM: stiffness } = batch;
    const is_told = depth.length > 0 && stiffness.length > 0;
    require_columns(!is_told || columns_agree(rows, [depth, stiffness], [batch.forceOnToolNewton]));
    this.nodes.physics.note(batch.header, batch.recordsLost, batch.counters.loop.ticks, now_s);
    this.physics_batch = batch;
    if (rows === 0) return;
    if (batch.header.sessionId !== this.physics_session) {
      this.physics_session = batch.header.sessionId;
      this.physics_base_ns = batch.steppedAtNs[0];
      this.physics.clear();
    }
    this.depth_m = is_told ? depth[rows - 1] : NaN;
    this.stiffness_newton_per_m = is_told ? stiffness[rows - 1] : NaN;
    for (let i = 0; is_told && i < rows; ++i) {
      if (!this.physics.append(1e-9 * Number(batch.steppedAtNs[i] - this.physics_base_ns))) continue;
      this.physics.set(kDepth, depth[i]);
      this.physics.set(kTissueForce, Math.hypot(...batch.forceOnToolNewton.slice(3 * i, 3 * i + 3)));
    }
  }

  /** The node's newest values still hold; those of a replay hold while it stands still. */
  is_fresh(name: NodeName, now_s: number): boolean {
    return this.health?.replay ? this.nodes[name].is_alive(now_s) : this.nodes[name].is_fresh(now_s);
  }

  /** Includes what the server received before this page connected. @param side  "" where there is one device */
  take_health(health: Health, now_s: number, side = ""): void {
    const before = this.health?.replay;
    this.health = health;
    const prefix = side ? `${side}.` : "";
    // a replay that stands still, creeps or has ended sends no batches; its nodes are not gone, nor for a page that comes then
    const { replay } = health;
    const stands = replay !== undefined && (replay.isPaused || replay.speedRatio < kSlowReplay || replay.positionS === (before?.positionS ?? replay.positionS));
    this.replay_stands = stands;
    if (stands) {
      for (const name of kNodes) if (this.nodes[name].is_alive(now_s)) this.nodes[name].heard_s = now_s;
    }
    for (const { name, silenceS } of health.nodes) {
      const node = name.startsWith(prefix) ? this.nodes[name.slice(prefix.length) as NodeName] : undefined;
      if (node && Number.isNaN(node.heard_s) && silenceS >= 0) node.know(stands ? now_s : now_s - silenceS, now_s);
    }
  }

  /** Lateness of ticks in the window before `end_s`, counted into bins of equal ratio. */
  count_lateness(end_s: number, window_s: number, bins: LatenessBins, out: number[]): void {
    out.length = bins.count;
    out.fill(0);
    const ring = this.device;
    const until = ring.first_at(end_s + 1e-9);
    for (let row = ring.first_at(end_s - window_s); row < until; ++row) {
      out[bin_of(bins, ring.value(kLateness, row))] += 1;
    }
  }

  /** Shows an event of this time by the server's clock in the plots. */
  mark(wall_s: number, tone: Instant["tone"], text: string): void {
    if (!Number.isFinite(this.wall_less_device_s)) {
      this.early = [...this.early.slice(1 - kMostInstants), { wall_s, tone, text }];
      return;
    }
    this.instants.push({ at_s: wall_s - this.wall_less_device_s, tone, text });
    if (this.instants.length > kMostInstants) this.instants.shift();
  }

  private compare_clocks(wall_s: number): void {
    if (!Number.isFinite(wall_s)) return;
    const offset_s = wall_s - this.device.newest_s;
    const expected_s = this.wall_less_device_s + kClockDrift_s;
    this.wall_less_device_s = Math.abs(offset_s - expected_s) < kClockJump_s ? Math.min(offset_s, expected_s) : offset_s;
    const { early } = this;
    this.early = [];
    for (const { wall_s: at_s, tone, text } of early) this.mark(at_s, tone, text);
  }

  private measure_speed(now_s: number): void {
    const { places, tool_m } = this;
    places.push({ at_s: now_s, tool_m: { ...tool_m } });
    while (places.length > 2 && now_s - places[1].at_s >= kSpeedWindow_s) places.shift();
    const elapsed_s = now_s - places[0].at_s;
    const from = places[0].tool_m;
    this.speed_m_per_s = elapsed_s > 0
      ? norm({ x: tool_m.x - from.x, y: tool_m.y - from.y, z: tool_m.z - from.z }) / elapsed_s : NaN;
  }

  private begin_device_session(session: bigint, first_ns: bigint): void {
    this.device_session = session;
    this.base_ns = first_ns;
    this.device.clear();
    this.mofc.clear();
    this.batches.clear();
    this.clamped_s = this.fallback_s = this.rendered_s = -Infinity;
    this.places = [];
    this.instants.length = 0;
    this.wall_less_device_s = NaN;
  }

  private seconds(device_ns: bigint): number {
    return 1e-9 * Number(device_ns - this.base_ns);
  }

  private keep_transparency(batch: MofcTelemetry): void {
    const ring = this.batches;
    if (!ring.append(this.mofc.newest_s)) return;
    const sum = batch.counters.transparencyIntegralNs;
    const samples = Number(batch.counters.transparencyTimeNs);
    ring.set(kTransparencyIntegral, sum);
    ring.set(kTransparencyTime, samples);
    const before = ring.first_at(ring.newest_s - kTransparencyWindow_s);
    const new_samples = samples - ring.value(kTransparencyTime, before);
    if (new_samples > 0) {
      ring.set(kTransparency, (sum - ring.value(kTransparencyIntegral, before)) / new_samples);
    }
  }
}

export interface LatenessBins {
  first_s: number; // upper border of bin 0
  per_decade: number;
  count: number;
}
/** 1 µs … 100 ms, five bins a decade; values beyond fall into the outermost bins. */
export const kLatenessBins: LatenessBins = { first_s: 1e-6, per_decade: 5, count: 26 };

export function bin_of(bins: LatenessBins, lateness_s: number): number {
  if (!(lateness_s > bins.first_s)) return 0;
  const bin = Math.ceil(bins.per_decade * Math.log10(lateness_s / bins.first_s));
  return Math.min(bin, bins.count - 1);
}
export function upper_border_s(bins: LatenessBins, bin: number): number {
  return bins.first_s * 10 ** (bin / bins.per_decade);
}

export function norm(v: Vector3): number {
  return Math.hypot(v.x, v.y, v.z);
}

function require_columns(do_agree: boolean): void {
  if (!do_agree) throw new Error("telemetry columns differ in length");
}

function copy_vector(column: number[], row: number, out: Vector3): Vector3 {
  out.x = column[3 * row];
  out.y = column[3 * row + 1];
  out.z = column[3 * row + 2];
  return out;
}

function put_vector(ring: Ring, first_column: number, column: number[], row: number): void {
  const x = column[3 * row], y = column[3 * row + 1], z = column[3 * row + 2];
  ring.set(first_column, x);
  ring.set(first_column + 1, y);
  ring.set(first_column + 2, z);
  ring.set(first_column + 3, Math.sqrt(x * x + y * y + z * z));
}

// One bound for all axes bounds the norm; bounds of their own bound it by their norm.
function put_bound(ring: Ring, column: number[], row: number): void {
  put_vector(ring, kBoundX, column, row);
  const x = column[3 * row];
  if (x === column[3 * row + 1] && x === column[3 * row + 2]) ring.set(kBoundNorm, x);
}
