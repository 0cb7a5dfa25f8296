// SPDX-License-Identifier: Apache-2.0
// nodes.mjs: the real programs of a session that is shipped, on loopback ports. $PALPATE_BIN names their folder.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { once } from "node:events";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { patience } from "./machine.mjs";

export const root = fileURLToPath(new URL("../../..", import.meta.url));
export const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const kNodes = ["device", "mofc", "physics", "viewer"];
/** Of a test with these programs. */
export const kLimit = {
  timeout: patience(120000),
  skip: existsSync(join(bin, "viewer_node")) ? false : `no programs in ${bin}: set PALPATE_BIN`,
};

async function free_port() {
  const server = createServer().listen(0, "127.0.0.1");
  await once(server, "listening");
  const { port } = server.address();
  server.close();
  await once(server, "close");
  return port;
}

/** The programs of a session, each its own process; what they say is shown when a test fails. */
export class Nodes {
  static async start(settings = [], session = "default", sides = [""]) {
    const nodes = await Nodes.none(settings, session);
    for (const name of kNodes) {
      for (const side of ["device", "mofc"].includes(name) ? sides : [""]) nodes.run(name, side);
    }
    await nodes.serves();
    return nodes;
  }

  /** A lockstep run of the session, recorded and replayed for one viewer. */
  static async replay(session, seconds) {
    const nodes = await Nodes.none([], session);
    const file = join(nodes.folder, `${session}.mcap`);
    await once(nodes.spawn("palpate", ["loopback", nodes.session, "-q", "--seconds", String(seconds), "--set", "hand.pointer={}", "--record", file], "loopback"), "exit");
    nodes.spawn("palpate", ["replay", file, "--no-viewer"], "replay");
    nodes.run("viewer");
    await nodes.serves();
    return nodes;
  }

  /** `palpate launch` of the session: it starts the nodes, restarts those that die, and records. */
  static async launch(settings, session) {
    const nodes = await Nodes.none(settings, session);
    nodes.recording = join(nodes.folder, "run.mcap");
    nodes.summary = join(nodes.folder, "run.json");
    nodes.spawn("palpate", ["launch", nodes.session, ...nodes.overrides(), "--record", nodes.recording, "--json", nodes.summary], "launch");
    await nodes.serves();
    return nodes;
  }

  static async none(settings, session) {
    const nodes = new Nodes();
    nodes.folder = mkdtempSync(join(tmpdir(), "palpate-web-"));
    nodes.port = await free_port();
    nodes.url = `http://127.0.0.1:${nodes.port}/`;
    nodes.settings = [`viewer.web.port=${nodes.port}`, "hand.pointer={}", ...settings];
    nodes.session = join(root, `deploy/sessions/${session}.txtpb`);
    nodes.processes = {};
    nodes.output = "";
    return nodes;
  }

  overrides(more = []) {
    return [...this.settings, ...more].flatMap((one) => ["--set", one]);
  }

  run(name, side = "", settings = [], key = side + name) {
    this.spawn(`${name}_node`, ["--session", this.session, ...(side ? ["--side", side] : []), ...this.overrides(settings)], key);
  }

  spawn(program, args, key) {
    const child = spawn(join(bin, program), args,
      { env: { ...process.env, PALPATE_RUN_DIR: this.folder }, stdio: ["ignore", "pipe", "pipe"], cwd: this.folder });
    for (const stream of [child.stdout, child.stderr]) stream.on("data", (text) => { this.output += text; });
    this.processes[key] = child;
    return child;
  }

  kill(name) {
    return this.end(name, "SIGKILL");
  }

  async end(name, signal = "SIGTERM") {
    const child = this.processes[name];
    child.kill(signal);
    if (child.exitCode === null && child.signalCode === null) await once(child, "exit");
  }

  /** Of a child of `palpate launch`: the one that was started last. */
  pid_of(name) {
    return Number([...this.output.matchAll(new RegExp(`event=node_started node=${name} pid=(\\d+)`, "g"))].at(-1)[1]);
  }

  /** @return what a command of palpate says on standard output, and its exit status */
  async says(...args) {
    const child = this.spawn("palpate", args, "command");
    let text = "";
    child.stdout.on("data", (part) => { text += part; });
    const [status] = await once(child, "close");
    return { text, status };
  }

  async serves() {
    const end = performance.now() + patience(15000);
    for (;;) {
      try {
        if ((await fetch(`${this.url}healthz`)).ok) return;
      } catch { /* not yet */ }
      assert.ok(performance.now() < end, `nobody serves ${this.url}:\n${this.output}`);
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
  }

  async stop() {
    await Promise.all(Object.keys(this.processes).map((name) => this.end(name)));
    rmSync(this.folder, { recursive: true });
  }
}
