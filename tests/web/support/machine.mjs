// SPDX-License-Identifier: Apache-2.0
// machine.mjs: how fast the machine is on which the tests run, and whether it is quiet. As tests/support/machine/machine.h.
import { readdirSync, readFileSync } from "node:fs";
import { performance } from "node:perf_hooks";

const kReferenceWork_ms = 23; // on the processor that the limits of the tests are from
const kMostSlowness = 1.5;
const kMostOthersRatio = 0.1;
const kMostOthers_ms = 50; // five ticks of the kernel's accounts
const kLongestPause_ms = 100; // of this event loop, which decodes pictures too
const kTick_ms = 10; // USER_HZ of /proc

/** A chain of operations, each of which needs the one before. */
function measure_slowness() {
  const begin_ms = performance.now();
  const used = process.cpuUsage();
  let x = 2463534242;
  for (let i = 0; i < 1e7; ++i) {
    x ^= x << 13;
    x ^= x >>> 17;
    x ^= x << 5;
  }
  const { user, system } = process.cpuUsage(used);
  return { of_processor: 1e-3 * (user + system) / kReferenceWork_ms, of_machine: x && (performance.now() - begin_ms) / kReferenceWork_ms };
}
const slowness = measure_slowness();

/**
 * How long to wait for an event that must happen; only a failing test waits so long.
 * @param ample_ms  more than enough on an idle machine
 */
export const patience = (ample_ms) => Math.ceil(4 * Math.max(1, slowness.of_machine) * ample_ms);

/** Fields of /proc/PID/stat from the state (3) on. */
function stat_of(pid) {
  try {
    const text = readFileSync(`/proc/${pid}/stat`, "utf8");
    return text.slice(text.lastIndexOf(")") + 2).split(" ");
  } catch {
    return undefined; // it has ended
  }
}
/** Processor time of this process and of all that it started, with theirs. */
function own_ms() {
  const processes = new Map();
  for (const pid of readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
    const fields = stat_of(pid);
    if (fields) processes.set(pid, { parent: fields[1], used_ms: kTick_ms * fields.slice(11, 15).reduce((sum, ticks) => sum + Number(ticks), 0) });
  }
  const is_own = (pid) => pid === String(process.pid) || (processes.has(pid) && is_own(processes.get(pid).parent));
  return [...processes].reduce((sum, [pid, { used_ms }]) => sum + (is_own(pid) ? used_ms : 0), 0);
}
/** Of all processors; busy includes what a hypervisor took away. */
function processor_times_ms() {
  const ticks = readFileSync("/proc/stat", "utf8").split("\n")[0].split(/ +/).slice(1, 9).map(Number);
  const all_ms = kTick_ms * ticks.reduce((sum, one) => sum + one, 0);
  return { all_ms, busy_ms: all_ms - kTick_ms * (ticks[3] + ticks[4]) };
}
/** How often the control group of this process was made to wait for its quota. */
function throttled_times() {
  for (const line of readFileSync("/proc/self/cgroup", "utf8").split("\n")) {
    const [, controllers, path] = line.split(":");
    if (controllers !== "" && !controllers?.split(",").includes("cpu")) continue;
    try {
      const stat = readFileSync(`/sys/fs/cgroup${controllers === "" ? "" : "/cpu"}${path}/cpu.stat`, "utf8");
      return Number(/nr_throttled (\d+)/.exec(stat)?.[1] ?? 0);
    } catch { /* no such file: no quota */ }
  }
  return 0;
}

/**
 * Observes the machine from its construction on. A figure of real time is checked only if the machine was quiet all that
 * time: otherwise it says nothing about the page or the programs.
 */
export class QuietMachine {
  #processors = processor_times_ms();
  #own_ms = own_ms();
  #throttled = throttled_times();
  #longest_pause_ms = 0;
  #due_ms = performance.now() + 20;
  #timer = setInterval(() => {
    const now_ms = performance.now();
    this.#longest_pause_ms = Math.max(this.#longest_pause_ms, now_ms - this.#due_ms);
    this.#due_ms = now_ms + 20;
  }, 20).unref();

  /** Ends the observation. @return why a figure may not be checked; "" if it may */
  disturbance() {
    clearInterval(this.#timer);
    const now = processor_times_ms();
    const others_ms = now.busy_ms - this.#processors.busy_ms - (own_ms() - this.#own_ms);
    const others = others_ms / Math.max(10, now.all_ms - this.#processors.all_ms);
    if (slowness.of_processor > kMostSlowness) return `the processor takes ${slowness.of_processor.toFixed(1)} times as long as the reference`;
    if (others_ms > kMostOthers_ms && others > kMostOthersRatio) return `other programs used ${(100 * others).toFixed(0)} % of the processors`;
    if (throttled_times() > this.#throttled) return "a quota withheld processor time";
    if (this.#longest_pause_ms > kLongestPause_ms) return `the test itself was kept waiting for ${this.#longest_pause_ms.toFixed(0)} ms`;
    return "";
  }
}
