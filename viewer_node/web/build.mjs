// build.mjs: src/ → dist/index.html, dist/app.js, dist/app.css: all that the page consists of.
import { build } from "esbuild";
import { copyFile, mkdir, readFile, rm } from "node:fs/promises";
import { gzipSync } from "node:zlib";
import { fileURLToPath } from "node:url";

process.chdir(fileURLToPath(new URL(".", import.meta.url)));
const out = process.argv[2] ?? "dist";

await rm(out, { recursive: true, force: true });
await mkdir(out, { recursive: true });
await build({
  entryPoints: { app: "src/main.ts" },
  bundle: true,
  format: "esm",
  target: "es2022",
  minify: true,
  legalComments: "eof",
  outdir: out,
  logLevel: "warning",
});
await copyFile("src/index.html", `${out}/index.html`);

for (const file of ["index.html", "app.css", "app.js"]) {
  const bytes = await readFile(`${out}/${file}`);
  const kilobytes = (n) => (n / 1000).toFixed(1).padStart(6);
  console.log(`${file.padEnd(10)} ${kilobytes(bytes.length)} kB, ${kilobytes(gzipSync(bytes, { level: 9 }).length)} kB gzip`);
}
