// SPDX-License-Identifier: Apache-2.0
// test.mjs: bundles the unit tests of tests/web/unit for Node and runs them.
import { build } from "esbuild";
import { spawnSync } from "node:child_process";
import { mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const tests = fileURLToPath(new URL("../../tests/web/unit/", import.meta.url));
const out = mkdtempSync(join(tmpdir(), "palpate-web-"));
try {
  await build({
    entryPoints: readdirSync(tests).filter((file) => file.endsWith(".test.ts")).map((file) => join(tests, file)),
    bundle: true, platform: "node", format: "esm", target: "node18", outdir: out, outExtension: { ".js": ".mjs" },
    nodePaths: [fileURLToPath(new URL("node_modules", import.meta.url))], logLevel: "warning",
  });
  process.exitCode = spawnSync(process.execPath, ["--test", ...readdirSync(out).map((file) => join(out, file))], {
    stdio: "inherit", env: { ...process.env, PALPATE_WEB_SOURCE: fileURLToPath(new URL("src", import.meta.url)) },
  }).status ?? 1;
} finally {
  rmSync(out, { recursive: true });
}
