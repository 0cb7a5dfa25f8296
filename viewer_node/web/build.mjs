// SPDX-License-Identifier: Apache-2.0
// build.mjs: src/ → dist/index.html, dist/app.js, dist/app.css: all that the page consists of;
// dist/report.js, dist/report.css for `palpate report`; and dist/stations.html, dist/stations.js for
// `palpate stations`.
import { build } from "esbuild";
import { copyFile, mkdir, readFile, rm, writeFile } from "node:fs/promises";
import { gzipSync } from "node:zlib";
import { fileURLToPath } from "node:url";

process.chdir(fileURLToPath(new URL(".", import.meta.url)));
const out = process.argv[2] ?? "dist";

// what the licences of bundled code ask for
const licence_of = async (name) => `${name}\n\n${(await readFile(`node_modules/${name}/LICENSE`, "utf8")).trim()}`;
const varint = await readFile("node_modules/@bufbuild/protobuf/dist/esm/wire/varint.js", "utf8");
const bsd = varint.match(/^(\/\/.*\n)+/)[0].replaceAll(/^\/\/ ?/gm, "").trim();
const licences = [
  await licence_of("three"),
  await licence_of("uplot"),
  "@bufbuild/protobuf\n\nCopyright 2021-2026 Buf Technologies, Inc. Apache License 2.0, https://www.apache.org/licenses/LICENSE-2.0; in it:",
  bsd,
].join("\n\n");

await rm(out, { recursive: true, force: true });
await mkdir(out, { recursive: true });
await build({
  entryPoints: { app: "src/main.ts" },
  bundle: true,
  format: "esm",
  target: "es2022",
  minify: true,
  legalComments: "none",
  footer: { js: "/*! The licences of bundled code are in index.html. */" },
  outdir: out,
  logLevel: "warning",
});
await build({
  entryPoints: { report: "src/report.ts" },
  bundle: true,
  format: "iife",
  target: "es2022",
  minify: true,
  legalComments: "none",
  footer: { js: `/*! Bundled code and its licences:\n\n${await licence_of("uplot")}\n*/` },
  outdir: out,
  logLevel: "warning",
});
await build({ entryPoints: { stations: "src/stations/stations.ts" }, bundle: true, format: "iife", target: "es2022", minify: true, outdir: out, logLevel: "warning" });
await copyFile("src/stations/stations.html", `${out}/stations.html`);
// the page's colours by day and by night
const [day, night] = [...(await readFile("src/style.css", "utf8")).matchAll(/^:root[^{]*(\{[^}]*\})/gm)].map(([, body]) => body);
const colours = `:root${day}@media (prefers-color-scheme: dark){:root${night}}`.replaceAll(/\s+/g, " ");
await writeFile(`${out}/report.css`, `${colours}\n${await readFile(`${out}/report.css`, "utf8")}`);
const escaped = licences.replaceAll("&", "&amp;").replaceAll("<", "&lt;");
const page = await readFile("src/index.html", "utf8");
if (!page.includes("{{licences}}")) throw new Error("src/index.html has no place for {{licences}}");
await writeFile(`${out}/index.html`, page.replace("{{licences}}", () => escaped));

for (const file of ["index.html", "app.css", "app.js", "report.css", "report.js", "stations.html", "stations.js"]) {
  const bytes = await readFile(`${out}/${file}`);
  const kilobytes = (n) => (n / 1000).toFixed(1).padStart(6);
  console.log(`${file.padEnd(13)} ${kilobytes(bytes.length)} kB, ${kilobytes(gzipSync(bytes, { level: 9 }).length)} kB gzip`);
}
