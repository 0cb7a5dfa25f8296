// SPDX-License-Identifier: Apache-2.0
// rosbridge.test.mjs: palpate ros --rosbridge, beside roslib, the client that others use, at a server that
// knows the public definitions of the messages. $PALPATE_BIN names the folder of the programs.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { afterEach, beforeEach, test } from "node:test";
import { Ros, Topic } from "roslib";
import { patience, QuietMachine } from "../support/machine.mjs";
import { RosbridgeServer } from "../support/rosbridge_server.mjs";

const root = fileURLToPath(new URL("../../..", import.meta.url));
const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const kLimit = { timeout: patience(90000), skip: existsSync(join(bin, "palpate_ros")) ? false : `no palpate_ros in ${bin}: it needs Cyclone DDS` };

let folder;
let server;
let ros;
const programs = [];
beforeEach(async () => {
  folder = mkdtempSync(join(tmpdir(), "palpate-rosbridge-"));
  server = await RosbridgeServer.listen();
});
afterEach(async () => {
  for (const { child } of programs.splice(0)) if (child.exitCode === null) child.kill("SIGKILL");
  ros?.close();
  await server.close();
  rmSync(folder, { recursive: true, force: true });
});

function start(name, ...words) {
  const child = spawn(join(bin, name), words, { env: { ...process.env, PALPATE_RUN_DIR: join(folder, "run") }, stdio: ["ignore", "ignore", "pipe"] });
  const program = { child, log: "" };
  child.stderr.on("data", (data) => { program.log += data; });
  programs.push(program);
  return program;
}
async function until(is_so, what) {
  const end = Date.now() + patience(20000);
  while (!is_so()) {
    assert.ok(Date.now() < end, `${typeof what === "function" ? what() : what}\n${programs.map(({ log }) => log).join("\n")}`);
    await new Promise((resolve) => { setTimeout(resolve, 10); });
  }
}
async function stopped(program) {
  if (program.child.exitCode === null) {
    program.child.kill("SIGTERM");
    await once(program.child, "exit");
  }
  assert.equal(program.child.exitCode, 0, program.log);
}
async function connect() {
  ros = new Ros({ url: `ws://127.0.0.1:${server.port}` });
  ros.on("error", () => {});
  await new Promise((resolve) => { ros.on("connection", resolve); });
}
const topic = (name, messageType) => new Topic({ ros, name, messageType });
/** The messages of a topic, as they come. */
function heard(name, type) {
  const messages = [];
  topic(name, type).subscribe((message) => messages.push(message));
  return messages;
}

test("a session is heard by roslib, also after the server was started anew", kLimit, async () => {
  const session = join(root, "deploy/sessions/default.txtpb");
  const launch = start("palpate", "launch", session, "--no-realtime", "--no-viewer");
  const shown = start("palpate", "ros", "--session", session, "--rosbridge", `127.0.0.1:${server.port}`);
  for (let round = 0; round < 2; ++round) {
    await connect();
    const poses = heard("/palpate/measured_cp", "geometry_msgs/msg/PoseStamped");
    const forces = heard("/palpate/measured_cf", "geometry_msgs/msg/WrenchStamped");
    const velocities = heard("/palpate/measured_cv", "geometry_msgs/msg/TwistStamped");
    const joints = heard("/palpate/measured_js", "sensor_msgs/msg/JointState");
    const states = heard("/palpate/operating_state", "crtk_msgs/msg/OperatingState");
    const tissues = heard("/palpate/tissues", "visualization_msgs/msg/Marker");
    const frames = heard("/tf_static", "tf2_msgs/msg/TFMessage");
    const energies = heard("/palpate/true_energy_joule", "std_msgs/msg/Float64");
    await until(() => poses.length > 20 && velocities.length > 20 && joints.length > 20 && energies.length > 20 && states.some(({ state }) => state === "ENABLED") &&
      tissues.length > 0 && frames.length > 0 && forces.some(({ wrench: { force } }) => Math.hypot(force.x, force.y, force.z) > 0.05),
    () => `round ${round}: ${[poses, velocities, joints, energies, states, tissues, frames, forces].map(({ length }) => length)}`);
    const pose = poses.at(-1);
    assert.equal(pose.header.frame_id, "world");
    assert.ok(Math.abs(pose.header.stamp.sec - Date.now() / 1000) < 60, `stamp ${pose.header.stamp.sec}`);
    assert.equal(pose.pose.orientation.w, 1);
    assert.ok(Math.abs(pose.pose.position.z) < 0.1);
    assert.deepEqual(joints.at(-1).name, ["x", "y", "z"]);
    assert.equal(joints.at(-1).position.length, 3);
    assert.ok(tissues[0].points.length % 3 === 0 && tissues[0].type === 11, `${tissues[0].points.length} corners`);
    assert.equal(frames[0].transforms[0].child_frame_id, "device_base");
    assert.deepEqual(server.faults, []);
    if (round > 0) break;
    const { port } = server;
    ros.close();
    await server.close();
    server = await RosbridgeServer.listen(port);
  }
  assert.match(shown.log, /event=rosbridge what="the connection to 127\.0\.0\.1:\d+ ended/);
  await stopped(shown);
  await stopped(launch);
});

/** A hand that presses every 0.7 s, 10 mm deep if nothing pushes back. */
const pressing = (rate_hz) => `name: "rosbridge"
device { rate_hz: 1000 simulated {} }
hand { sinusoid { center_m { z: 0 } amplitude_m { z: 0.01 } frequency_hz { z: 1.4 } phase_rad { z: 1.57 } } }
mofc { controller: mofc mode: guard }
scene { tool { tip_radius_m: 0.003 } }
physics { rate_hz: ${rate_hz} command: ["palpate_ros", "physics", "--rosbridge", "127.0.0.1:${server.port}"] }
`;

/** Answers each pose with the force of a half-space of 250 N/m below z = 0; at(number) may change it. */
async function half_space(change = (wrench) => wrench) {
  await connect();
  const answers = topic("/palpate/measured_cf", "geometry_msgs/msg/WrenchStamped");
  answers.advertise();
  let count = 0;
  topic("/palpate/servo_cp", "geometry_msgs/msg/PoseStamped").subscribe(({ header, pose }) => {
    const depth_m = 0.003 - pose.position.z;
    const wrench = { header, wrench: { force: { x: 0, y: 0, z: depth_m > 0 ? 250 * depth_m : 0 }, torque: { x: 0, y: 0, z: 0 } } };
    const changed = change(wrench, ++count);
    if (changed?.is_of_a_node) server.tell("/palpate/measured_cf", changed.message);
    else if (changed) answers.publish(changed);
  });
}

async function run(...more) {
  return run_at(250, ...more);
}
async function run_at(rate_hz, ...more) {
  writeFileSync(join(folder, "rosbridge.txtpb"), pressing(rate_hz));
  return start("palpate", "launch", join(folder, "rosbridge.txtpb"), "--no-realtime", "--no-viewer", "--json", join(folder, "run.json"), ...more);
}
const result = () => JSON.parse(readFileSync(join(folder, "run.json"), "utf8"));

test("a half-space of roslib is felt, and gives no energy", kLimit, async () => {
  const launch = await run("--seconds", "5");
  await half_space();
  await once(launch.child, "exit");
  assert.equal(launch.child.exitCode, 0, launch.log);
  assert.ok(result().max_force_n > 0.3, `${result().max_force_n} N\n${launch.log}`);
  assert.ok(result().min_true_energy_j >= -1e-6, `${result().min_true_energy_j} J`);
  assert.match(launch.log, /event=ros rosbridge=127\.0\.0\.1:\d+ out=palpate\/servo_cp in=palpate\/measured_cf/);
  assert.match(launch.log, /event=force_source topic=palpate\/measured_cf/);
  assert.deepEqual(server.faults, []);
});

test("what a slow server cannot pass on in time is left out, and the force stays", kLimit, async () => {
  const machine = new QuietMachine();
  server.work_ms = 2;  // a pose and its answer are 4
  const launch = await run_at(1000, "--seconds", "8");
  await half_space();
  await once(launch.child, "exit");
  assert.equal(launch.child.exitCode, 0, launch.log);
  assert.match(launch.log, /event=rosbridge what="127\.0\.0\.1:\d+ is behind: messages are left out/);
  const [, left_out, forces, refused] = /event=ros_physics .*poses_left_out=(\d+) forces=(\d+) refused=(\d+)/.exec(launch.log).map(Number);
  assert.ok(left_out > 0, launch.log);
  assert.ok(result().min_true_energy_j >= -1e-6, `${result().min_true_energy_j} J`);
  const disturbance = machine.disturbance();
  if (disturbance) {
    console.log(`not checked: ${forces} forces taken, ${refused} refused: the machine was not quiet: ${disturbance}`);
    return;
  }
  assert.ok(forces > 4 * refused, `${forces} forces taken, ${refused} refused\n${launch.log}`);
  assert.ok(result().max_force_n > 0.1, `${result().max_force_n} N\n${launch.log}`);
});

test("a message of another clock does not keep out who names poses", kLimit, async () => {
  const launch = await run("--seconds", "5");
  let is_told = false;
  await half_space((wrench) => {
    if (is_told) return wrench;
    is_told = true;
    return { ...wrench, header: { ...wrench.header, stamp: { sec: wrench.header.stamp.sec + 1000, nanosec: 0 } } };
  });
  await once(launch.child, "exit");
  assert.equal(launch.child.exitCode, 0, launch.log);
  const [, forces, refused] = /event=ros_physics .*forces=(\d+) refused=(\d+)/.exec(launch.log).map(Number);
  assert.ok(forces > 4 * refused, `${forces} forces taken, ${refused} refused\n${launch.log}`);
});

const wrongs = [
  ["null for a number", (wrench) => ({ is_of_a_node: true, message: { ...wrench, wrench: { force: { x: 0, y: 0, z: NaN } } } }), /NaN or infinite/],
  ["1,000 N", (wrench) => ({ ...wrench, wrench: { ...wrench.wrench, force: { x: 0, y: 0, z: 1000 } } }), /newton/],
  ["the last message again", (wrench, first) => ({ ...wrench, header: first.header }), /stamp/],
  ["no header", ({ wrench }) => ({ is_of_a_node: true, message: { wrench } }), /wrench_refused/],
  ["nonsense", () => ({ is_of_a_node: true, message: { header: 3, wrench: [[[]]] } }), /wrench_refused/],
];
for (const [name, wrong, line] of wrongs) {
  test(`${name}: refused, named, and no force is left`, kLimit, async () => {
    const launch = await run("--csv", join(folder, "run.csv"));
    let last;
    let is_wrong = false;
    await half_space((wrench) => {
      if (is_wrong) return wrong(wrench, last);
      last = wrench;
      return wrench;
    });
    await until(() => launch.log.includes("event=force_source "), "a force counts");
    is_wrong = true;
    await until(() => launch.log.includes("event=force_source_silent"), "the source counts as silent");
    assert.match(launch.log, line);
    await new Promise((resolve) => { setTimeout(resolve, 1500); });
    await stopped(launch);
    assert.ok(result().min_true_energy_j >= -1e-6, `${result().min_true_energy_j} J`);
    const [head, ...rows] = readFileSync(join(folder, "run.csv"), "utf8").trim().split("\n").map((row) => row.split(","));
    // two presses after the last force that counted
    const late = rows.slice(-1000).map((row) => Math.abs(Number(row[head.indexOf("fs_z")])));
    assert.equal(Math.max(...late), 0);
  });
}

test("what the server complains of is said: a topic that has another type", kLimit, async () => {
  await connect();
  topic("/palpate/measured_cp", "std_msgs/msg/Float64").advertise();
  await until(() => server.types.has("/palpate/measured_cp"), "advertised");
  const session = join(root, "deploy/sessions/default.txtpb");
  const shown = start("palpate", "ros", "--session", session, "--rosbridge", `127.0.0.1:${server.port}`);
  await until(() => shown.log.includes('event=rosbridge what="the server says: /palpate/measured_cp is std_msgs/msg/Float64, not geometry_msgs/msg/PoseStamped"'), "said");
  await stopped(shown);
  // and the server does look at what it passes on
  const states = topic("/palpate/operating_state", "crtk_msgs/msg/OperatingState");
  for (const [message, fault] of [[{ state: 3 }, /state is no string/], [{ is_home: true }, /is_home is not in/], [{ header: { stamp: { secs: 1 } } }, /no time/]]) {
    server.faults.length = 0;
    states.publish(message);
    await until(() => server.faults.some((text) => fault.test(text)), () => `${fault}: ${server.faults}`);
  }
});

test("no server, no address, and a port that speaks no WebSocket are said", kLimit, async () => {
  const session = join(root, "deploy/sessions/default.txtpb");
  const { port } = server;
  await server.close();
  const early = start("palpate", "ros", "--session", session, "--rosbridge", `ws://127.0.0.1:${port}/`);
  await until(() => early.log.includes(`no rosbridge server at 127.0.0.1:${port} (Connection refused)`), "refused");
  server = await RosbridgeServer.listen(port);
  await until(() => early.log.includes("connected to"), "connected");
  await stopped(early);
  for (const [address, reason] of [["wss://h", /tunnel/], ["h:0", /HOST:PORT/], ["h:x", /HOST:PORT/], ["h/path", /HOST:PORT/], ["", /HOST:PORT/], ["::1", /brackets/], ["[::1", /brackets/]]) {
    const wrong = start("palpate", "ros", "--session", session, "--rosbridge", address);
    await once(wrong.child, "exit");
    assert.equal(wrong.child.exitCode, 2, wrong.log);
    assert.match(wrong.log, reason);
  }
  const both = start("palpate", "ros", "--session", session, "--rosbridge", "h", "--domain", "7");
  await once(both.child, "exit");
  assert.equal(both.child.exitCode, 2, both.log);
});
