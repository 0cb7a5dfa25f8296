// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import test from "node:test";
import { banner_lines } from "../../../viewer_node/web/src/panels";
import { duration_words, forces_of, node_state, state_words, time_words } from "../../../viewer_node/web/src/state";
import {
  bin_of, kRequestedNorm, kBoundNorm, kForceAge, kForceNorm, kLatenessBins, kNodes, kReplyTime, kTissueForce, kTransparency, Telemetry,
} from "../../../viewer_node/web/src/telemetry";
import type { DeviceTelemetry, Health, MofcTelemetry, PhysicsTelemetry, ReplayState } from "../../../viewer_node/web/src/wire";

const kDevice = 11n;
const repeat = <T>(n: number, value: T): T[] => Array.from({ length: n }, () => value);
const link = { accepted: 0n, skipped: 0n, duplicates: 0n, outOfOrder: 0n, rejected: 0n, ahead: 0n, sessions: 1n };

// ticks first … first + rows − 1, one a millisecond
function device(sequence: number, first: number, rows: number, more: Partial<DeviceTelemetry> = {}, session = kDevice): DeviceTelemetry {
  return {
    header: { sessionId: session, sequence: BigInt(sequence), sampledAtNs: 0n },
    counters: {
      loop: { ticks: BigInt(first + rows), skippedTicks: 0n, worstLatenessNs: 0n }, forceCommand: link,
      answeredTicks: 0n, leasedTicks: 0n, fallbackTicks: 0n, limpTicks: 0n, peakLimitedTicks: 0n, faultTicks: 0n,
      lastFault: 0, maxForceNewton: 0, minimumTrueEnergyJoule: NaN, nonFiniteCommands: 0n,
      isMonitorOff: false, monitorReductions: 0n, ledgerExcesses: 0n, hasNoMotorWatchdog: false, acceptsNoMotorWatchdog: false, deadManTicks: 0n,
    },
    recordsLost: 0n,
    sampledAtNs: Array.from({ length: rows }, (_, i) => BigInt(first + i) * 1000000n + 5000000000n),
    latenessNs: repeat(rows, 20000n), replyTimeNs: repeat(rows, 60000n),
    measuredHandPositionM: repeat(3 * rows, 0), measuredToolPositionWorldM: repeat(3 * rows, 0.01), measuredToolOrientationWorld: [],
    forceOnHandNewton: Array.from({ length: 3 * rows }, (_, i) => [3, 0, 4][i % 3]), // |F| = 5
    guard: repeat(rows, 1), flags: repeat(rows, 1), trueEnergyJoule: repeat(rows, NaN),
    ...more,
  };
}
function mofc(sequence: number, first: number, rows: number, more: Partial<MofcTelemetry> = {}): MofcTelemetry {
  return {
    header: { sessionId: 22n, sequence: BigInt(sequence), sampledAtNs: 0n },
    counters: {
      deviceState: link, interaction: link, ticks: BigInt(first + rows), clampedTicks: 0n, staleTicks: 0n,
      latePhysicsTicks: 0n, ledgerResets: 0n, motionsDropped: 0n, transparencyIntegralNs: 0, transparencyTimeNs: 0n, tooFastTicks: 0n,
    },
    recordsLost: 0n,
    deviceSessionId: repeat(rows, kDevice),
    deviceSampledAtNs: Array.from({ length: rows }, (_, i) => BigInt(first + i) * 1000000n + 5000000000n),
    requestedForceOnHandNewton: Array.from({ length: 3 * rows }, (_, i) => [0, 0, 10][i % 3]),
    commandedForceOnHandNewton: repeat(3 * rows, 0), fMaxNewton: repeat(3 * rows, 6),
    ledgerEnergyJoule: repeat(rows, 0.001), forceAgeNs: repeat(rows, 2000000n), state: repeat(rows, 2), flags: repeat(rows, 2),
    ...more,
  };
}
function physics(sequence: number, more: Partial<PhysicsTelemetry> = {}): PhysicsTelemetry {
  return {
    header: { sessionId: 33n, sequence: BigInt(sequence), sampledAtNs: 0n },
    counters: { loop: { ticks: 0n, skippedTicks: 0n, worstLatenessNs: 0n }, toolMotion: link, worstComputeTimeNs: 0n },
    recordsLost: 0n, steppedAtNs: [], toolPositionWorldM: [], forceOnToolNewton: [], contactCount: [], penetrationM: [], stiffnessNewtonPerM: [],
    ...more,
  };
}
function running(now_s = 1): Telemetry {
  const telemetry = new Telemetry();
  telemetry.take_device(device(0, 0, 20), now_s);
  telemetry.take_mofc(mofc(0, 0, 20), now_s);
  telemetry.take_physics(physics(0), now_s);
  return telemetry;
}

test("both nodes’ ticks share the device’s clock", () => {
  const telemetry = new Telemetry();
  telemetry.take_device(device(0, 100, 20), 1);
  telemetry.take_mofc(mofc(0, 100, 20), 1);

  assert.equal(telemetry.device.length, 20);
  assert.equal(telemetry.device.time_s(0), 0);
  assert.ok(Math.abs(telemetry.mofc.time_s(19) - 0.019) < 1e-12);
  assert.equal(telemetry.device.value(kForceNorm, 19), 5);
  assert.equal(telemetry.mofc.value(kRequestedNorm, 19), 10);
  assert.equal(telemetry.mofc.value(kBoundNorm, 19), 6); // one bound for all axes
});

test("the tool is turned as its newest tick says, and upright where none does", () => {
  const telemetry = new Telemetry();
  telemetry.take_device(device(0, 0, 2, { measuredToolOrientationWorld: [1, 0, 0, 0, 0.6, 0.8, 0, 0] }), 1);
  assert.deepEqual(telemetry.tool_orientation, { w: 0.6, x: 0.8, y: 0, z: 0 });

  telemetry.take_device(device(1, 2, 2), 1);
  assert.deepEqual(telemetry.tool_orientation, { w: 1, x: 0, y: 0, z: 0 });
  assert.throws(() => telemetry.take_device(device(2, 4, 2, { measuredToolOrientationWorld: [1, 0, 0, 0] }), 1), /differ in length/);
});

test("bounds of the axes bound the force by their norm", () => {
  const telemetry = running();
  telemetry.take_mofc(mofc(1, 20, 1, { fMaxNewton: [2, 3, 6] }), 1);

  assert.equal(telemetry.mofc.value(kBoundNorm, 20), 7);
});

test("batches that never came are counted, and a restart is no loss", () => {
  const telemetry = running();
  telemetry.take_device(device(4, 80, 20), 1.1); // 1, 2, 3 are missing
  assert.equal(telemetry.nodes.device.batches_lost, 3);

  telemetry.take_device(device(0, 0, 20, {}, 12n), 1.2);
  assert.equal(telemetry.nodes.device.batches_lost, 3);
  assert.equal(telemetry.nodes.device.restarts, 1);
  assert.equal(telemetry.device.length, 20); // another clock: the old ticks are gone
});

test("ticks of another device session are left out", () => {
  const telemetry = running();
  telemetry.take_mofc(mofc(1, 20, 5, { deviceSessionId: repeat(5, 99n) }), 1);

  assert.equal(telemetry.mofc.length, 20);
});

test("a batch with columns of different length is refused whole", () => {
  const telemetry = running();

  assert.throws(() => telemetry.take_device(device(1, 20, 20, { guard: [1] }), 1), /columns/);
  assert.equal(telemetry.device.length, 20);
});

test("reply time and age are unknown where there was no answer", () => {
  const telemetry = running();
  telemetry.take_device(device(1, 20, 1, { flags: [0] }), 1);
  telemetry.take_mofc(mofc(1, 20, 1, { forceAgeNs: [0n] }), 1);

  assert.ok(Number.isNaN(telemetry.device.value(kReplyTime, 20)));
  assert.ok(Number.isNaN(telemetry.mofc.value(kForceAge, 20)));
});

test("transparency runs over the last second", () => {
  const telemetry = new Telemetry();
  telemetry.take_device(device(0, 0, 1), 1);
  const at = (sequence: number, tick: number, sum: number, samples: bigint) => {
    const batch = mofc(sequence, tick, 1);
    batch.counters.transparencyIntegralNs = sum;
    batch.counters.transparencyTimeNs = samples;
    telemetry.take_mofc(batch, 1);
  };
  at(0, 0, 100, 100n); // all of the force so far
  at(1, 500, 150, 200n); // 50 of 100 since
  at(2, 1400, 160, 300n); // of the last second only 10 of 100
  at(3, 1420, 160, 300n); // nothing requested: still within the second

  assert.equal(telemetry.batches.value(kTransparency, 1), 0.5);
  assert.ok(Math.abs(telemetry.batches.value(kTransparency, 2) - 0.1) < 1e-6);
  assert.ok(Math.abs(telemetry.transparency - 160 / 300) < 1e-12);
});

test("transparency of the last second is exact after months of contact", () => {
  const telemetry = new Telemetry();
  telemetry.take_device(device(0, 0, 1), 1);
  const months = 5e9; // ticks at 1 kHz, far beyond 24 bits
  const at = (sequence: number, tick: number, sum: number, samples: bigint) => {
    const batch = mofc(sequence, tick, 1);
    batch.counters.transparencyIntegralNs = sum;
    batch.counters.transparencyTimeNs = samples;
    telemetry.take_mofc(batch, 1);
  };
  at(0, 0, months, BigInt(months));
  at(1, 500, months + 25, BigInt(months) + 100n);

  assert.equal(telemetry.batches.value(kTransparency, 1), 0.25);
});

test("a node is gone after its silence, and said so in words", () => {
  const telemetry = running(1);

  assert.equal(state_words(telemetry, true, 1.5).id, "contact");
  telemetry.take_device(device(1, 20, 20), 3);
  telemetry.take_mofc(mofc(1, 20, 20), 3);
  assert.equal(state_words(telemetry, true, 3).id, "no_physics"); // physics: silent for 2 s
  assert.equal(state_words(telemetry, true, 6).id, "no_device");
  assert.equal(state_words(telemetry, false, 3).id, "disconnected");
});

test("a node that died before the page came is known from the server", () => {
  const telemetry = new Telemetry();
  const node = { sessions: 1n, batchesLost: 0n, recordsLost: 0n };
  telemetry.take_health({
    nodes: [{ ...node, name: "physics", isHeard: false, silenceS: 30 }, { ...node, name: "mofc", isHeard: false, silenceS: -1 }],
  } as unknown as Health, 100);

  assert.equal(telemetry.nodes.physics.silence_s(100), 30);
  assert.ok(Number.isNaN(telemetry.nodes.mofc.heard_s)); // never heard by anybody
});

test("of several devices each knows its own nodes", () => {
  const node = { isHeard: true, sessions: 1n, batchesLost: 0n, recordsLost: 0n };
  const health = { nodes: [{ ...node, name: "left.mofc", silenceS: 1 }, { ...node, name: "right.mofc", silenceS: 5 }] } as unknown as Health;
  const [left, right] = [new Telemetry(), new Telemetry()];
  left.take_health(health, 100, "left");
  right.take_health(health, 100, "right");

  assert.equal(left.nodes.mofc.silence_s(100), 1);
  assert.equal(right.nodes.mofc.silence_s(100), 5);
});

test("each state has its words", () => {
  const state = (device_more: Partial<DeviceTelemetry>, mofc_more: Partial<MofcTelemetry>) => {
    const telemetry = running();
    telemetry.take_device(device(1, 20, 1, device_more), 1);
    telemetry.take_mofc(mofc(1, 20, 1, mofc_more), 1);
    return state_words(telemetry, true, 1).id;
  };

  assert.equal(state({}, {}), "contact");
  assert.equal(state({}, { flags: [3] }), "clamped");
  assert.equal(state({}, { state: [1], flags: [0] }), "free");
  assert.equal(state({}, { state: [0] }), "no_physics");
  assert.equal(state({}, { state: [3] }), "stale");
  assert.equal(state({}, { state: [4] }), "clutched");
  assert.equal(state({ guard: [0] }, {}), "limp");
  assert.equal(state({ guard: [3] }, {}), "fallback");
  assert.equal(state({ guard: [5] }, {}), "fault");
});

test("lateness falls into bins of a fifth of a decade from 1 µs to 100 ms", () => {
  assert.equal(bin_of(kLatenessBins, -1e-6), 0);
  assert.equal(bin_of(kLatenessBins, 1e-6), 0);
  assert.equal(bin_of(kLatenessBins, 1.1e-6), 1);
  assert.equal(bin_of(kLatenessBins, 0.99e-3), 15);
  assert.equal(bin_of(kLatenessBins, 5), 25);

  const telemetry = running();
  const counts: number[] = [];
  telemetry.count_lateness(0.019, 10, kLatenessBins, counts);
  assert.equal(counts[bin_of(kLatenessBins, 20e-6)], 20);
});

test("durations read easily", () => {
  assert.equal(duration_words(0.44), "0.4 s");
  assert.equal(duration_words(12.4), "12 s");
  assert.equal(duration_words(200), "3 min");
  assert.equal(time_words(62e-6), "62 µs");
  assert.equal(time_words(1.25e-3), "1.3 ms");
  assert.equal(time_words(NaN), "–");
});

test("the rate of a node is its own count over its own clock, whenever its batches arrive", () => {
  const telemetry = new Telemetry();
  const at = (sequence: number, own_s: number, ticks: number, heard_s: number) => telemetry.take_physics(physics(sequence, {
    header: { sessionId: 33n, sequence: BigInt(sequence), sampledAtNs: BigInt(Math.round(1e9 * own_s)) },
    counters: { loop: { ticks: BigInt(ticks), skippedTicks: 0n, worstLatenessNs: 0n }, toolMotion: link, worstComputeTimeNs: 0n },
  }), heard_s);
  at(0, 50, 7000, 1);
  assert.ok(Number.isNaN(telemetry.nodes.physics.rate_hz));
  at(1, 52, 8000, 9); // 6 s late: over the time of arrival it would be 125 Hz
  assert.equal(telemetry.nodes.physics.rate_hz, 500);
});

test("depth, stiffness and the loop come from physics, and are unknown if it does not tell", () => {
  const telemetry = running();
  assert.ok(Number.isNaN(telemetry.depth_m));
  const two = { steppedAtNs: [1000000n, 2000000n], toolPositionWorldM: repeat(6, 0), contactCount: [1, 1] };
  telemetry.take_physics(physics(1, { ...two, forceOnToolNewton: [0, 0, 1, 3, 0, 4], penetrationM: [0.001, 0.002], stiffnessNewtonPerM: [500, 800] }), 1);
  assert.equal(telemetry.depth_m, 0.002);
  assert.equal(telemetry.stiffness_newton_per_m, 800);
  assert.equal(telemetry.physics.length, 2);
  assert.equal(telemetry.physics.value(kTissueForce, 1), 5);

  telemetry.take_physics(physics(2, { ...two, forceOnToolNewton: repeat(6, 0) }), 1); // as from the Python package
  assert.ok(Number.isNaN(telemetry.depth_m));
  assert.throws(() => telemetry.take_physics(physics(3, { ...two, forceOnToolNewton: repeat(6, 0), penetrationM: [1], stiffnessNewtonPerM: [1, 2] }), 1), /differ in length/);
});

// 0.1 mm a tick of 1 ms: 100 mm/s
test("the speed is that over 50 ms", () => {
  const telemetry = new Telemetry();
  for (let batch = 0; batch < 6; ++batch) {
    const place = Array.from({ length: 60 }, (_, i) => (i % 3 === 0 ? 1e-4 * (20 * batch + Math.floor(i / 3)) : 0));
    telemetry.take_device(device(batch, 20 * batch, 20, { measuredToolPositionWorldM: place }), 1);
  }
  assert.ok(Math.abs(telemetry.speed_m_per_s - 0.1) < 1e-9, `${telemetry.speed_m_per_s}`);
});

test("a clamp that leaves less than half of the force for half a second says what to do", () => {
  const telemetry = running(); // 10 N requested
  const clamped = (batch: number, bound: number) => {
    telemetry.take_device(device(batch, 20 * batch, 20), 1);
    telemetry.take_mofc(mofc(batch, 20 * batch, 20, { fMaxNewton: repeat(60, bound), flags: repeat(20, 3) }), 1);
  };
  for (let batch = 1; batch < 20; ++batch) clamped(batch, 4);
  assert.equal(state_words(telemetry, true, 1).id, "clamped");
  for (let batch = 20; batch < 30; ++batch) clamped(batch, 4);
  assert.equal(state_words(telemetry, true, 1).id, "exhausted");
  assert.match(state_words(telemetry, true, 1).detail, /lift off and press again/);
  clamped(30, 6);
  assert.equal(state_words(telemetry, true, 1).id, "clamped");
});

test("no words contradict the force beside them", () => {
  const telemetry = running();
  telemetry.take_mofc(mofc(1, 20, 20, { state: repeat(20, 0), requestedForceOnHandNewton: repeat(60, 2) }), 1);
  assert.doesNotMatch(state_words(telemetry, true, 1).detail, /no force/);
  assert.match(state_words(telemetry, true, 1).detail, /fades/);
  telemetry.take_mofc(mofc(2, 40, 20, { state: repeat(20, 0), requestedForceOnHandNewton: repeat(60, 0) }), 1);
  assert.match(state_words(telemetry, true, 1).detail, /no force is requested/);
  // of a node that is gone no force is known
  telemetry.take_device(device(2, 40, 20), 9);
  assert.equal(forces_of(telemetry, true, 9).requested, null);
  assert.ok(forces_of(telemetry, true, 9).applied);
  assert.equal(forces_of(telemetry, false, 9).applied, null);
});

test("the nodes of a paused replay are not gone", () => {
  const telemetry = running();
  const health = (isPaused: boolean) => ({
    nodes: [], clients: 1, messagesDropped: 0n, framesRejected: 0n, handHolder: 0n, version: "", markers: [],
    replay: { file: "run.mcap", positionS: 1, lengthS: 9, speedRatio: 1, isPaused, beginNs: 0n },
  });
  for (let now_s = 1; now_s < 20; now_s += 0.2) telemetry.take_health(health(true), now_s);
  assert.ok(telemetry.nodes.device.is_alive(20));
  telemetry.take_health(health(false), 30);
  assert.ok(!telemetry.nodes.device.is_alive(30));
});

test("nor are they for a page that is opened while it stands still", () => {
  const telemetry = new Telemetry();
  const health = {
    nodes: ["device", "mofc", "physics"].map((name) => ({ name, isHeard: true, silenceS: 5, sessionId: 1n, restarts: 0 })),
    clients: 1, messagesDropped: 0n, framesRejected: 0n, handHolder: 0n, version: "", markers: [],
    replay: { file: "run.mcap", positionS: 9, lengthS: 9, speedRatio: 1, isPaused: true, beginNs: 0n },
  } as unknown as Health;
  for (let now_s = 1; now_s < 9; now_s += 0.2) telemetry.take_health(health, now_s);
  assert.ok(telemetry.nodes.device.is_alive(9));
});

test("a force is withdrawn within 0.1 s of a node's end, not between batches of a slow audience", () => {
  const telemetry = running(1);
  for (let batch = 1; batch < 50; ++batch) {
    telemetry.take_device(device(batch, 20 * batch, 20), 1 + 0.02 * batch);
    telemetry.take_mofc(mofc(batch, 20 * batch, 20), 1 + 0.02 * batch);
  }
  assert.ok(forces_of(telemetry, true, 2.07).applied);
  assert.equal(forces_of(telemetry, true, 2.09).applied, null);
  assert.equal(forces_of(telemetry, true, 2.09).requested, null);

  const thinned = running(1);
  for (let batch = 1; batch < 80; ++batch) thinned.take_device(device(batch, 100 * batch, 100), 1 + 0.1 * batch);
  assert.ok(forces_of(thinned, true, 9.1).applied);
  assert.equal(forces_of(thinned, true, 9.5).applied, null);
});

test("the dot of a node is amber below 95 % of its rate", () => {
  const telemetry = running();
  const { physics: node } = telemetry.nodes;
  node.rate_hz = 940;
  assert.equal(node_state(node, 1000, true, 1), "slow");
  node.rate_hz = 960;
  assert.equal(node_state(node, 1000, true, 1), "alive");
  assert.equal(node_state(node, NaN, true, 1), "alive");
  assert.equal(node_state(node, 1000, true, 9), "gone");
  assert.equal(node_state(node, 1000, false, 1), "unknown");
});

test("an event is shown at the tick that was sampled when it happened", () => {
  const telemetry = new Telemetry();
  const near = (one: number, other: number) => assert.ok(Math.abs(one - other) < 1e-6, `${one}, not ${other}`);
  telemetry.mark(1000.005, "notice", "before the first tick");
  // the newest tick, 0.019 s after the first one, is sent 3 ms later; the next batch is delayed
  telemetry.take_device(device(0, 0, 20), 1, 1000.022);
  telemetry.take_device(device(1, 20, 20), 1, 1000.052);
  telemetry.mark(1000.033, "marker", "marker 1");
  assert.deepEqual(telemetry.instants.map(({ text }) => text), ["before the first tick", "marker 1"]);
  near(telemetry.instants[0].at_s, 1000.005 - 1000.003);
  assert.ok(Math.abs(telemetry.instants[1].at_s - (1000.033 - 1000.003)) < 0.0015);

  // the server's clock is set back by an hour
  telemetry.take_device(device(2, 40, 20), 1, 1000.062 - 3600);
  telemetry.mark(1000.062 - 3600, "alarm", "fault");
  near(telemetry.instants[2].at_s, telemetry.now_s);

  // another start of the device has another clock
  telemetry.take_device(device(0, 0, 20, {}, 12n), 2, 1000.3);
  assert.deepEqual(telemetry.instants, []);
});

test("a page that has just begun calls no node gone, and a replay that has ended none ever", () => {
  const health = (silenceS: number, replay?: Partial<ReplayState>) =>
    ({ nodes: kNodes.map((name) => ({ name, silenceS })), sides: [], markers: [], ...(replay ? { replay } : {}) }) as unknown as Health;
  const gone = (telemetry: Telemetry, now_s: number) => banner_lines(telemetry, "", now_s).length;
  const live = new Telemetry();
  live.take_health(health(5), 10); // the session of before, as the server heard it last
  assert.equal(gone(live, 10.1), 0);
  assert.equal(gone(live, 11.3), 3, "they have not come");

  const replay = { positionS: 63, lengthS: 63, isPaused: false, speedRatio: 1 };
  const ended = new Telemetry();
  for (let now_s = 0; now_s < 5; now_s += 0.2) {
    ended.take_health(health(30 + now_s, replay), now_s);
    assert.equal(gone(ended, now_s), 0, `${now_s}`);
  }
  // in one that goes on a silent node is gone
  for (let now_s = 5; now_s < 7; now_s += 0.2) ended.take_health(health(30 + now_s, { ...replay, positionS: now_s }), now_s);
  assert.equal(gone(ended, 7), 3);
});
