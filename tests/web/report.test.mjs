// SPDX-License-Identifier: Apache-2.0
// report.test.mjs: the file that `palpate report` writes, in a real browser without a network.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath, pathToFileURL } from "node:url";
import { after, before, test } from "node:test";
import { launch } from "./support/browser.mjs";
import { patience } from "./support/machine.mjs";

const root = fileURLToPath(new URL("../..", import.meta.url));
const bin = process.env.PALPATE_BIN ?? join(root, "build/release/bin");
const session = join(root, "deploy/sessions/default.txtpb");
const kLimit = { timeout: patience(60000), skip: existsSync(join(bin, "palpate")) ? false : `no programs in ${bin}: set PALPATE_BIN` };

let folder;
let browser;
before(async () => {
  if (kLimit.skip) return;
  folder = mkdtempSync(join(tmpdir(), "palpate-report-"));
  const palpate = (...args) => execFileSync(join(bin, "palpate"), args);
  palpate("loopback", session, "--seconds", "3", "--record", join(folder, "a.mcap"));
  palpate("loopback", session, "--seconds", "3", "--no-ideal", "--set", "mofc.controller=none", "--set", "device.monitor=off", "--record", join(folder, "b.mcap"));
  palpate("report", join(folder, "a.mcap"), "-o", join(folder, "one.html"));
  palpate("report", join(folder, "a.mcap"), join(folder, "b.mcap"), "-o", join(folder, "two.html"));
  browser = await launch();
});
after(async () => {
  await browser?.close();
  if (folder) rmSync(folder, { recursive: true, force: true });
});

async function open(name) {
  const page = await (await browser.newContext({ viewport: { width: 1000, height: 700 } })).newPage();
  page.problems = [];
  page.requests = [];
  page.on("console", (message) => { if (["error", "warning"].includes(message.type())) page.problems.push(message.text()); });
  page.on("pageerror", (error) => page.problems.push(error.message));
  page.on("request", (request) => page.requests.push(request.url()));
  await page.goto(pathToFileURL(join(folder, name)).href);
  await page.waitForFunction(() => window.__report?.length > 0);
  return page;
}

test("a report draws its figures from itself, and a zoom of one is one of all", kLimit, async () => {
  const page = await open("one.html");
  const figures = await page.evaluate(() => window.__report);
  assert.equal(figures.length, 9);
  assert.ok(figures.every(({ points }) => points > 100));
  for (const force of figures.slice(1, 5)) assert.deepEqual(force.series, ["requested", "rendered", "ideal"]);
  assert.ok(figures[1].x[1] > 2.9);

  // drag from one third to two thirds of a figure
  const over = page.locator("[data-figure='1'] .u-over");
  await over.scrollIntoViewIfNeeded();
  const box = await over.boundingBox();
  await page.mouse.move(box.x + box.width / 3, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + (2 * box.width) / 3, box.y + box.height / 2, { steps: 5 });
  await page.mouse.up();
  await page.waitForFunction(() => window.__report.slice(0, 8).every(({ x }) => x[0] > 0.8 && x[1] < 2.2));
  await over.dblclick();
  await page.waitForFunction(() => window.__report.slice(0, 8).every(({ x }) => x[0] < 0.1 && x[1] > 2.9));

  // values under the cursor, in all figures over time
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.waitForFunction(() => window.__report.slice(0, 8).every(({ at }) => at > 1000 && at < 2000));
  const values = await page.locator("[data-figure='1'] .u-legend .u-value").allTextContents();
  assert.ok(Math.abs(Number(values[0]) - 1.5) < 0.2, `${values}`);

  assert.deepEqual(page.problems, []);
  assert.ok(page.requests.every((url) => url.startsWith("file:")) && page.requests.length === 1, `${page.requests}`);
});

test("two recordings stand side by side on the same scales", kLimit, async () => {
  const page = await open("two.html");
  const figures = await page.evaluate(() => window.__report);
  assert.equal(figures.length, 18);
  assert.deepEqual([figures[0].run, figures[1].run], [0, 1]);
  assert.deepEqual([figures[2].series, figures[3].series], [["requested", "rendered", "ideal"], ["requested", "rendered"]]); // only one has it
  const boxes = await page.locator("[data-figure='1'] .plot").evaluateAll((cells) => cells.map((cell) => cell.getBoundingClientRect().toJSON()));
  assert.equal(boxes[0].top, boxes[1].top);
  assert.ok(boxes[1].left >= boxes[0].right);
  assert.deepEqual(page.problems, []);
});
