// SPDX-License-Identifier: Apache-2.0
// figures.mjs: what the page costs in a browser that nobody watches. Playwright has Chromium report
// every message of a WebSocket to it, which at 100,000 vertices takes more than the page itself; so
// this one is asked for its counters only.
//
//   tests/web/run --figures
import { spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, readFileSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { WebSocket } from "ws";
import { kFlags } from "./support/browser.mjs";
import { start_mock_server } from "./support/mock_server.mjs";

const kSettle_ms = 6000;
const kMeasured_ms = 8000;
const later = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Processor seconds and memory of their own in MB of a process and what it has started, by kind. */
function usage_of(root) {
  const usage = {};
  const fields_of = new Map();
  for (const pid of readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
    try {
      const stat = readFileSync(`/proc/${pid}/stat`, "utf8");
      fields_of.set(Number(pid), stat.slice(stat.lastIndexOf(")") + 2).split(" "));
    } catch { /* it has ended */ }
  }
  const is_below = (pid) => pid === root || (fields_of.has(pid) && is_below(Number(fields_of.get(pid)[1])));
  for (const [pid, fields] of fields_of) {
    if (!is_below(pid)) continue;
    try {
      const kind = /--type=(\S+?)[\0 ]/.exec(readFileSync(`/proc/${pid}/cmdline`, "utf8"))?.[1] ?? "browser";
      const shared = readFileSync(`/proc/${pid}/smaps_rollup`, "utf8");
      const own_kb = [...shared.matchAll(/^Private_\w+: +(\d+)/gm)].reduce((sum, [, kb]) => sum + Number(kb), 0);
      const sum = (usage[kind] ??= { s: 0, mb: 0 });
      sum.s += (Number(fields[11]) + Number(fields[12])) / 100;
      sum.mb = Math.max(sum.mb, own_kb / 1024);
    } catch { /* it has ended */ }
  }
  return usage;
}

async function page_of(child) {
  let text = "";
  while (!/ws:\/\/([^/]+)\//.test(text)) text += (await once(child.stderr, "data"))[0];
  const [, address] = /ws:\/\/([^/]+)\//.exec(text);
  for (;;) {
    const targets = await (await fetch(`http://${address}/json/list`)).json();
    const page = targets.find(({ type, url }) => type === "page" && url.startsWith("http://127.0.0.1"));
    if (page) return page.webSocketDebuggerUrl;
    await later(100);
  }
}

/** @param world  of the mock server */
async function measure(what, world) {
  const server = await start_mock_server(world);
  const profile = mkdtempSync(join(tmpdir(), "palpate-figures-"));
  const child = spawn(fileURLToPath(new URL("support/chromium", import.meta.url)), [
    "--headless=new", "--remote-debugging-port=0", `--user-data-dir=${profile}`, "--window-size=960,920",
    "--force-device-scale-factor=0.5", ...kFlags, server.url], { stdio: ["ignore", "ignore", "pipe"], detached: true });
  const socket = new WebSocket(await page_of(child));
  await once(socket, "open");
  let id = 0;
  const counters = async () => {
    const expression = "JSON.stringify((({ frames, mesh_frames }) => ({ frames, mesh_frames }))(window.__test))";
    socket.send(JSON.stringify({ id: ++id, method: "Runtime.evaluate", params: { expression, returnByValue: true } }));
    const [message] = await once(socket, "message");
    return JSON.parse(JSON.parse(message).result.result.value);
  };
  await later(kSettle_ms);
  const before = await counters(), used = usage_of(child.pid), begin_ms = performance.now();
  await later(kMeasured_ms);
  const after = await counters(), now = usage_of(child.pid), s = 1e-3 * (performance.now() - begin_ms);
  const share = (kind) => `${(100 * (now[kind].s - used[kind].s) / s).toFixed(0)} %`;
  console.log(`${what.padEnd(32)}${((after.frames - before.frames) / s).toFixed(1).padStart(11)}${((after.mesh_frames - before.mesh_frames) / s).toFixed(1).padStart(10)}`
    + `${share("renderer").padStart(10)}${share("gpu-process").padStart(10)}${now.renderer.mb.toFixed(0).padStart(8)}`);
  process.kill(-child.pid, "SIGKILL"); // and what it has started
  await once(child, "exit");
  await later(500);
  rmSync(profile, { recursive: true, force: true, maxRetries: 20, retryDelay: 100 });
  await server.close();
}

console.log("software rendering                 pictures   surfaces      page   drawing    page\n"
  + "                                        1/s        1/s   of a processor        MB");
await measure("one device, 2,600 vertices", {});
await measure("64 devices, 2,600 vertices", { sides: Array.from({ length: 64 }, (_, i) => `station_${i + 1}`) });
await measure("one device, 100,000 vertices", { vertices: 100000 });
process.exit(0);
