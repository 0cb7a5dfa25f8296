// SPDX-License-Identifier: Apache-2.0
// browser.mjs: Debian's Chromium without a display or a GPU; waits for events with a deadline.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";
import { patience, QuietMachine } from "./machine.mjs";
import { changed_pixels, decode_png } from "./png.mjs";

// WebGL on the processor, but not what the page is composed of, for which that is slower; the rest
// keeps the browser from talking to anybody
export const kFlags = [
  "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
  "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
  "--disable-gpu-compositing",
];

const kPatience_ms = patience(30000);

export function launch() {
  return chromium.launch({ executablePath: fileURLToPath(new URL("chromium", import.meta.url)), args: kFlags, timeout: kPatience_ms });
}

/**
 * A page of that server which has the scene; `problems` collects the console's errors and warnings.
 * Drawing on the processor takes most of a test's time:
 * @param scale   pixels of the canvas per CSS pixel
 * @param max_hz  pictures per second
 */
export async function open(browser, url, {
  width = 1000, height = 700, dark = false, scale = 0.5, touch = false, max_hz = 15, has_webgl = true, wait = true,
} = {}) {
  const context = await browser.newContext({
    viewport: { width, height }, colorScheme: dark ? "dark" : "light", deviceScaleFactor: scale, hasTouch: touch,
  });
  context.setDefaultTimeout(kPatience_ms);
  const page = await context.newPage();
  if (max_hz < 60) await page.addInitScript(draw_at_most, max_hz);
  if (!has_webgl) await page.addInitScript(take_webgl_away);
  page.problems = [];
  page.requests = [];
  page.on("console", (message) => {
    if (["error", "warning"].includes(message.type()) && !is_about_graphics(message.text())) page.problems.push(message.text());
  });
  page.on("pageerror", (error) => page.problems.push(error.message));
  page.on("request", (request) => page.requests.push(request.url()));
  await page.goto(url);
  if (wait) await until(page, (t) => t.scene && t.device_ticks > 0 && t.frames > 0, "the scene and the first ticks");
  return page;
}

function draw_at_most(max_hz) {
  const request = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (draw) => setTimeout(() => request(draw), 1000 / max_hz - 1000 / 60);
}
function take_webgl_away() {
  const get = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return String(kind).startsWith("webgl") ? null : get.call(this, kind, ...rest);
  };
}

// of the graphics driver on a machine without one
function is_about_graphics(text) {
  return /GPU stall|GL Driver Message|swiftshader|WebGL.*performance/i.test(text);
}

/**
 * Ends a task: Stop asks once more, for 6 s, which a slow machine may not meet at once.
 * @param press  by mouse, finger or key
 */
export async function press_stop(page, press = (stop) => stop.click()) {
  const stop = page.locator("#task-stop");
  const ready = page.locator("#task-stop[data-asks=ready]");
  for (const end = performance.now() + kPatience_ms; performance.now() < end;) {
    await press(stop);
    if (!(await comes(ready.waitFor({ timeout: 6000 })))) continue;
    await press(stop);
    if (await comes(stop.waitFor({ state: "hidden", timeout: 5000 }))) return;
  }
  assert.fail("the task does not end with Stop");
}
const comes = (wait) => wait.then(() => true, () => false);

export const status = (page) => page.evaluate(() => window.__test);

/** Equal for pages that show the same scene. */
export const scene_signature = (page) => page.evaluate(() => window.__scene_signature);

/** Waits until the page's status fulfils the predicate; fails with what it waited for. */
export async function until(page, predicate, what) {
  const begin = performance.now();
  for (;;) {
    const now = await status(page);
    if (predicate(now)) return now;
    if (performance.now() - begin > kPatience_ms) {
      assert.fail(`waited ${kPatience_ms} ms for ${what}; the page's state: ${JSON.stringify(now, (_, value) => (typeof value === "bigint" ? String(value) : value))}`);
    }
    await page.waitForTimeout(20);
  }
}

/**
 * Repeats a measurement of real time until one is at most `limit`, at most five times. Too large ones count only where the
 * machine was quiet.
 * @param what     for the message
 * @param measure  given the number of measurements before, returns a figure
 * @param least    measurements in any case
 */
export async function at_most(what, limit, measure, least = 1) {
  const figures = [];
  let disturbance = "";
  while (figures.length < least || (Math.min(...figures) > limit && !disturbance && figures.length < 5)) {
    const machine = new QuietMachine();
    figures.push(await measure(figures.length));
    disturbance ||= machine.disturbance();
  }
  if (Math.min(...figures) <= limit) return;
  if (!disturbance) assert.fail(`${what}: ${figures}, limit ${limit}`);
  console.log(`not checked: ${what} (${figures}, limit ${limit}): the machine was not quiet: ${disturbance}`);
}

/** Late pages, one after the other, at least one of which sees the scene within a second, checked as in at_most. The check of a page returns the time it took. */
export function late_pages(browser, url, options, check) {
  return at_most("a late page sees the scene within a second", 1000, async () => {
    const page = await open(browser, url, { wait: false, ...options });
    await until(page, (t) => t.is_connected, "a connection");
    const took_ms = await check(page);
    await page.context().close();
    return took_ms;
  }, 2);
}

/** Text of an element. */
export const words = (page, id) => page.locator(`#${id}`).innerText();

export async function until_text(page, id, pattern) {
  const begin = performance.now();
  while (!pattern.test(await words(page, id))) {
    if (performance.now() - begin > kPatience_ms) assert.fail(`#${id} says “${await words(page, id)}”, not ${pattern}`);
    await page.waitForTimeout(20);
  }
}

/** Returns when what the page knows now is drawn. */
export const drawn = (page) =>
  page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));

/** The canvas alone, as the compositor shows it. */
export async function picture(page, selector = "#canvas") {
  return decode_png(await page.locator(selector).screenshot({ animations: "disabled" }));
}

/** Takes pictures until one differs in at least so many pixels from the first. */
export async function until_pixels_change(page, before, least, what) {
  const begin = performance.now();
  let changed = 0;
  while (performance.now() - begin < kPatience_ms) {
    changed = changed_pixels(before, await picture(page));
    if (changed >= least) return changed;
  }
  return assert.fail(`${what}: only ${changed} pixels of at least ${least} changed within ${kPatience_ms} ms`);
}

/** Holds the page in an instant of contact with at least this displacement and this force on the hand; polls within the page. */
export function hold_when(page, depth_m, newton) {
  return page.evaluate(([depth_m, newton]) => new Promise((resolve) => {
    const look = () => {
      const t = window.__test;
      const is_contact = ['contact', 'clamped', 'exhausted'].includes(t.state.id);
      if (!is_contact || t.scene.tissues[0].displacement_m < depth_m || t.applied_newton < newton) return void setTimeout(look, 4);
      document.getElementById("pause").click();
      resolve();
    };
    look();
  }), [depth_m, newton]);
}

/** Whether this run writes the pictures of the documents: tests/web/run --screenshots. */
export const kSkipScreenshots = process.env.PALPATE_SCREENSHOTS ? false : "written by tests/web/run --screenshots only";
const kMostBytes = 150000;

export async function screenshot(page, name) {
  const folder = process.env.PALPATE_SCREENSHOTS;
  mkdirSync(folder, { recursive: true });
  const png = await page.screenshot();
  assert.ok(png.length <= kMostBytes, `${name}.png has ${png.length} bytes, more than ${kMostBytes}`);
  writeFileSync(join(folder, `${name}.png`), png);
}

const kAxe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
/**
 * Violations of WCAG 2.2 A and AA and of axe-core's best practices.
 * @param rules  of axe-core, where its own choice does not fit
 */
export async function violations(page, rules = {}) {
  await page.evaluate(kAxe); // no script tag, which the page's policy forbids
  const { violations: found } = await page.evaluate((rules) => window.axe.run(document, { resultTypes: ["violations"], rules }), rules);
  return found.map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.map(({ target }) => target).join(", ")}`);
}
