// SPDX-License-Identifier: Apache-2.0
// mujoco_flex.mjs — the hanging bar, the pressed slab and the twisted bar of tissue_bench in MuJoCo's
// flex (WebAssembly, one thread), as a Markdown table.
//
//   npm ci --ignore-scripts
//   node mujoco_flex.mjs                                all, in ten minutes
//   node mujoco_flex.mjs hang twist                     some of the problems
//   node mujoco_flex.mjs --release 3.14.0               one release
//   node mujoco_flex.mjs --cells 3x8                    another mesh: cells across x along (or deep)
//   node mujoco_flex.mjs --step-ms 1                    this step
//   node mujoco_flex.mjs hang --gravity-ratio 0.001     small strain; the sag is divided by the ratio
//   node mujoco_flex.mjs --solref "0.02 1"              contact
//   node mujoco_flex.mjs --flex-damping 0.001           damping of the flex in proportion to its stiffness [s]
//
// Each mesh runs with E and ν as they are, and once more with those of half of λ: with a uniform strain
// the flex of both releases has the stress of μ and 2 λ, which this then makes μ and λ.
import { writeSync } from "node:fs";
import { parseArgs } from "node:util";
import { models, press_m, slab, sphere_radius_m, twist_rad } from "./problems.mjs";

// Of tissue_bench (docs/tissue.md), in mm, N and N·m.
const references = { hang: 44.01, press: 263.23, twist: 121.55 };
const meshes = { hang: [[3, 8], [6, 16]], press: [[10, 4], [20, 8]], twist: [[3, 8], [6, 16]] };

// As in comparison.cpp.
const sample_s = 0.02;
const longest_s = 4;
const still_samples = 10;
const still_ratio = 5e-4;
const still_m_per_s = 1e-3;
const above_m = 5e-3;
const press_m_per_s = 0.4;
const turn_rad_per_s = twist_rad / 1.2;

// Faster than anything here moves: the run is lost.
const runaway_m_per_s = 20;
// The search for the largest stable step: the ratio of neighbouring steps, and how long a trial runs after the motion.
const step_ratio = 1.25;
const least_step_s = 0.05e-3;
const largest_step_s = 20e-3;
const trial_s = 0.4;
const trial_cpu_s = 60;

const { values: options, positionals } = parseArgs({
  options: {
    release: { type: "string" },
    cells: { type: "string" },
    "gravity-ratio": { type: "string", default: "1" },
    solref: { type: "string" },
    integrator: { type: "string" },
    solver: { type: "string" },
    "step-ms": { type: "string" },
    "flex-damping": { type: "string" },
    "seconds-of-cpu": { type: "string", default: "120" },
  },
  allowPositionals: true,
});

// implicitfast is what MuJoCo 3.3 recommends for new models; its steps for the flex are short. 3.13 added
// `discrete`, which integrates them implicitly. The solver CG is that of MuJoCo's own models of flexes.
// Contact is hard enough to keep the sphere out, and damped enough to come to rest.
const releases = {
  "3.3.8": {
    async open() {
      const { default: load } = await import("mujoco-js");
      const mujoco = await load({ print: () => {}, printErr: () => {} });
      return { mujoco, load(xml) {
        mujoco.FS.writeFile("/model.xml", xml);
        return mujoco.MjModel.loadFromXML("/model.xml");
      } };
    },
    integrator: "implicitfast",
    solref: "0.002 1",
    press_damping_s: 5e-4,
    steps_s: {},  // the largest stable ones
    most_nodes: 1000,  // to load 1,575 takes 18 s, with every trial of a step
  },
  "3.14.0": {
    async open() {
      const { default: load } = await import("@mujoco/mujoco");
      const mujoco = await load({ print: () => {}, printErr: () => {} });
      return { mujoco, load: (xml) => mujoco.MjModel.from_xml_string(xml) };
    },
    integrator: "discrete",
    solref: "0.02 1",
    press_damping_s: 0,
    steps_s: { hang: 20e-3, press: 10e-3, twist: 20e-3 },
    most_nodes: Infinity,
  },
};

class Unstable extends Error {}
class TooSlow extends Error {}

const cpu_s = () => {
  const { user, system } = process.cpuUsage();
  return 1e-6 * (user + system);
};

/** One body that is stepped and looked at. */
class Run {
  constructor(engine, problem, cells, settings, step_s, limit_cpu_s) {
    const built = models[problem](cells, settings);
    this.mujoco = engine.mujoco;
    this.problem = problem;
    this.built = built;
    this.step_s = step_s;
    this.limit_cpu_s = limit_cpu_s;
    this.steps_cpu_s = [];
    this.model = engine.load(built.xml);
    if (!this.model) throw new Error("MuJoCo does not load the model");
    this.model.opt.timestep = step_s;
    this.data = new this.mujoco.MjData(this.model);
    // The joints of the free nodes follow each other; the plate's, where there is one, comes first.
    this.first = problem === "twist" ? 1 : 0;
    this.way = 0;
    this.begun_s = cpu_s();
  }

  delete() {
    this.data.delete();
    this.model.delete();
  }

  /** To `way`: depth of the sphere or angle of the plate. */
  place(way) {
    this.way = way;
    if (this.problem === "press") {
      this.data.mocap_pos.set([0.5 * slab.side_m, 0.5 * slab.side_m, slab.height_m + sphere_radius_m - way]);
    }
    if (this.problem === "twist") {
      this.data.qpos[0] = way;
      this.data.qvel[0] = 0;
    }
  }

  step() {
    this.place(this.way);
    const from_s = cpu_s();
    this.mujoco.mj_step(this.model, this.data);
    const to_s = cpu_s();
    this.steps_cpu_s.push(to_s - from_s);
    if (!(this.fastest_m_per_s() < runaway_m_per_s)) {
      throw new Unstable(`${(1e3 * this.data.time).toFixed(0)} ms`);
    }
    if (to_s - this.begun_s > this.limit_cpu_s) throw new TooSlow(`${this.data.time.toFixed(3)} s of simulated time`);
  }

  /** NaN where a velocity is. MuJoCo resets data after a NaN, which the time tells. */
  fastest_m_per_s() {
    if (this.steps_cpu_s.length > 1 && this.data.time < 1.5 * this.step_s) return NaN;
    let fastest = 0;
    const qvel = this.data.qvel;
    for (let i = this.first; i < qvel.length; ++i) {
      const speed = Math.abs(qvel[i]);
      if (!(speed <= fastest)) fastest = speed;
    }
    return fastest;
  }

  /** Evenly, from where it is to `whole`. */
  move(from, whole, speed) {
    const steps = Math.ceil((whole - from) / speed / this.step_s - 1e-9);
    for (let i = 1; i <= steps; ++i) {
      this.place(from + ((whole - from) * i) / steps);
      this.step();
    }
  }

  load() {
    if (this.problem === "press") this.move(-above_m, press_m, press_m_per_s);
    if (this.problem === "twist") this.move(0, twist_rad, turn_rad_per_s);
  }

  sample() {
    for (let i = Math.round(sample_s / this.step_s); i > 0; --i) this.step();
  }

  /** mm, N or N·m. */
  value() {
    const { data, built } = this;
    if (this.problem === "hang") {
      const qpos = data.qpos;
      let sag_m = 0;
      built.free.forEach((node, i) => {
        if (built.mesh.nodes_m[node][2] < 1e-9) sag_m = Math.max(sag_m, -qpos[3 * i + 2]);
      });
      return (1e3 * sag_m) / Number(options["gravity-ratio"]);
    }
    if (this.problem === "press") {
      const force = data.qfrc_constraint;
      let sum = 0;
      for (let i = 2; i < force.length; i += 3) sum -= force[i];
      return sum;
    }
    // What the bar pulls the plate back with.
    return -data.qfrc_passive[0];
  }

  /** Until the value and the body stay where they are. */
  settle() {
    const values = [this.value()];
    let still = 0;
    while (still < still_samples && sample_s * values.length < longest_s) {
      this.sample();
      values.push(this.value());
      const change = Math.abs(values.at(-1) - values.at(-2));
      const rests = change < still_ratio * Math.abs(values.at(-1)) && this.fastest_m_per_s() < still_m_per_s;
      still = rests ? still + 1 : 0;
    }
    if (still === still_samples) return { value: values.at(-1), spread: 0 };
    const last = values.slice(-Math.round(1 / sample_s));
    const mean = last.reduce((a, b) => a + b) / last.length;
    return { value: mean, spread: (Math.max(...last) - Math.min(...last)) / Math.abs(mean) };
  }

  /** How deep the sphere's contacts are inside the tissue at most [m]. */
  deepest_m() {
    let deepest = 0;
    const contacts = this.data.contact;
    for (let i = 0; i < this.data.ncon; ++i) {
      const contact = contacts.get(i);
      deepest = Math.max(deepest, -contact.dist);
      contact.delete?.();
    }
    return deepest;
  }
}

/** Whether the body survives loading and `trial_s` more. */
function is_stable(engine, problem, cells, settings, step_s) {
  const run = new Run(engine, problem, cells, settings, step_s, trial_cpu_s);
  try {
    run.load();
    for (let t = 0; t < trial_s; t += sample_s) run.sample();
    return true;
  } catch (error) {
    if (!(error instanceof Unstable)) throw error;
    return false;
  } finally {
    run.delete();
  }
}

/** The largest of a row of steps of equal ratios with which the body is stable, and the next one; 0: none. */
function largest_stable_s(engine, problem, cells, settings) {
  const steps = [];
  for (let step = largest_step_s; step > least_step_s; step /= step_ratio) steps.push(step);
  let stable = steps.length;  // steps[stable] would be
  let unstable = -1;
  while (stable - unstable > 1) {
    const middle = (stable + unstable) >> 1;
    if (is_stable(engine, problem, cells, settings, steps[middle])) stable = middle;
    else unstable = middle;
  }
  return { step_s: steps[stable] ?? 0, next_s: steps[unstable] };
}

const print = (line) => writeSync(1, `${line}\n`);
const notes = [];

/** One row; `step_s` 0: of the largest stable step. Returns the step. */
function measure(engine, name, problem, cells, settings, step_s) {
  const { mesh } = models[problem](cells, settings);
  const program = `MuJoCo ${name} flex (WebAssembly)${settings.lambda_ratio === 1 ? "" : ", half of λ"}`;
  const what = `${problem}, ${program}, ${mesh.elements.length} linear`;
  let next_s;
  let run;
  try {
    if (step_s === 0) ({ step_s, next_s } = largest_stable_s(engine, problem, cells, settings));
    if (step_s === 0) throw new Error(`unstable with steps of ${1e3 * least_step_s} ms and more`);
    run = new Run(engine, problem, cells, settings, step_s, Number(options["seconds-of-cpu"]));
    run.load();
    const { value, spread } = run.settle();
    const mean_s = run.steps_cpu_s.reduce((a, b) => a + b) / run.steps_cpu_s.length;
    const p99_s = [...run.steps_cpu_s].sort((a, b) => a - b)[Math.floor(0.99 * (run.steps_cpu_s.length - 1))];
    const error = 100 * (value / references[problem] - 1);
    const size = `${mesh.nodes_m.length} nodes, ${mesh.elements.length.toLocaleString("en")} linear`;
    print(`| ${problem} | ${program} | ${size} | ` +
          `${(1e3 * step_s).toPrecision(3)} | ${value.toFixed(2)} | ${error >= 0 ? "+" : ""}${error.toFixed(1)} | ` +
          `${(1e6 * mean_s).toFixed(0)} | ${(1e6 * p99_s).toFixed(0)} | ${(mean_s / step_s).toFixed(2)} |`);
    if (next_s) notes.push(`${what}: unstable with ${(1e3 * next_s).toPrecision(3)} ms`);
    const speed = (1e3 * run.fastest_m_per_s()).toFixed(3);
    notes.push(spread === 0
      ? `${what}: at rest after ${run.data.time.toFixed(2)} s, fastest node ${speed} mm/s`
      : `${what}: not at rest; mean of the last second, in which it varies by ${(100 * spread).toPrecision(2)} %`);
    if (problem === "press") {
      notes.push(`${what}: ${run.data.ncon} contacts, up to ${(1e3 * run.deepest_m()).toFixed(2)} mm deep`);
    }
  } catch (error) {
    if (error instanceof Unstable) notes.push(`${what}, steps of ${(1e3 * step_s).toPrecision(3)} ms: unstable at ${error.message}`);
    else if (error instanceof TooSlow) notes.push(`${what}: given up for its CPU time at ${error.message}`);
    else notes.push(`${what}: ${error.message ?? error}`);
  } finally {
    run?.delete();
  }
  return step_s;
}

/** λ and μ of a small uniform strain [Pa], from the stress: the sum of force times place over the volume. */
function lame_pa(engine, settings) {
  const strain = 1e-6;
  const { xml, mesh } = models.block([2, 2], settings);
  const model = engine.load(xml);
  const data = new engine.mujoco.MjData(model);
  const stress_pa = (gradient, row, column) => {
    mesh.nodes_m.forEach((x, node) => {
      for (let a = 0; a < 3; ++a) data.qpos[3 * node + a] = x.reduce((sum, at, b) => sum + strain * gradient[a][b] * at, 0);
    });
    engine.mujoco.mj_forward(model, data);
    const force = data.qfrc_passive;
    const sum = mesh.nodes_m.reduce((total, x, node) => total - force[3 * node + row] * x[column], 0);
    return sum / (slab.side_m * slab.side_m * slab.height_m * strain);
  };
  const lambda = stress_pa([[1, 0, 0], [0, 0, 0], [0, 0, 0]], 1, 1);
  const mu = stress_pa([[0, 0.5, 0], [0.5, 0, 0], [0, 0, 0]], 0, 1);
  data.delete();
  model.delete();
  return { lambda, mu };
}

const problems = positionals.length > 0 ? positionals : Object.keys(meshes);
print("| problem | program | mesh | step ms | mm, N, N·m | error % | CPU a step µs | p99 µs | CPU/simulated |");
print("|---|---|---|---|---|---|---|---|---|");
for (const [name, release] of Object.entries(releases)) {
  if (options.release && options.release !== name) continue;
  const engine = await release.open();
  const settings_of = (problem, lambda_ratio) => ({
    integrator: options.integrator ?? release.integrator,
    solver: options.solver ?? "CG",
    iterations: 100,
    tolerance: 1e-8,
    solref: options.solref ?? release.solref,
    solimp: "0.99 0.9999 0.0001",
    lambda_ratio,
    gravity_ratio: Number(options["gravity-ratio"]),
    flex_damping_s: Number(options["flex-damping"] ?? (problem === "press" ? release.press_damping_s : 0)),
  });
  for (const problem of problems) {
    const sizes = options.cells ? [options.cells.split("x").map(Number)] : meshes[problem];
    for (const cells of sizes) {
      if (!options.cells && (cells[0] + 1) ** 2 * (cells[1] + 1) > release.most_nodes) continue;
      let step_s = options["step-ms"] ? 1e-3 * Number(options["step-ms"]) : (release.steps_s[problem] ?? 0);
      for (const lambda_ratio of [1, 0.5]) {
        step_s = measure(engine, name, problem, cells, settings_of(problem, lambda_ratio), step_s);
      }
    }
  }
  const { lambda, mu } = lame_pa(engine, settings_of("block", 1));
  notes.push(`${name}: a uniform strain of E and ν of λ 50000 Pa, μ 10000 Pa has the stress of λ ${lambda.toFixed(0)} Pa, μ ${mu.toFixed(0)} Pa`);
}
print("");
for (const note of notes) print(`- ${note}`);
