// SPDX-License-Identifier: Apache-2.0
// task.test.mjs: a whole task on the page, over the real programs: a person searches a block for its lump, by mouse,
// keys and fingers alone. Of what the page draws, the pictures of the documents are taken here, too.
import assert from "node:assert/strict";
import { readFileSync, statSync } from "node:fs";
import { join } from "node:path";
import { after, afterEach, before, test } from "node:test";
import { kSkipScreenshots, launch, open, press_stop, screenshot, status, until, until_text, violations } from "./support/browser.mjs";
import { ByFinger, ByKeys, ByMouse } from "./support/leading.mjs";
import { patience, QuietMachine } from "./support/machine.mjs";
import { kLimit, Nodes } from "./support/nodes.mjs";

const kSession = "tasks/lump_search";
const kByPerson = ["task.start=by_person", "hand={ pointer { center_m { z: 0.02 } } hold { position_m { z: 0.03 } } }"];
const kPress_newton = 0.9; // palpable from 0.42 N on; 2.5 N are too much
const kPhone = { width: 390, height: 844, touch: true };
const kWhole = { ...kLimit, timeout: patience(180000) };

let browser;
let nodes; // of the running test
before(async () => { browser = await launch(); });
after(async () => { await browser.close(); });
afterEach(async () => {
  for (const context of browser.contexts()) await context.close();
  await nodes?.stop();
  nodes = undefined;
});

/** Where the lump is, which the page does not tell. */
function place_of_lump() {
  const [, x, y] = /part \{\s*where \{ sphere \{ center_m \{ x: (\S+) y: (\S+) /.exec(readFileSync(nodes.session, "utf8"));
  return { x: Number(x), y: Number(y) };
}
const region = (page) => page.locator("#task");
const said = (page, text) => page.locator("#task [role=status]", { hasText: text }).waitFor({ state: "attached" });
/** Sentences and figures, as they stand there. */
const shown_score = (page) => page.evaluate(() => {
  const texts = (selector) => [...document.querySelectorAll(`#task ${selector}`)].map((one) => one.textContent);
  const values = texts(".figures dd");
  return { findings: texts(".findings li"), figures: texts(".figures dt").map((label, i) => ({ label, value: values[i] })) };
});
/** Asks again and again until the answer is true, and returns it. */
async function until_true(ask, what) {
  const end = performance.now() + patience(15000);
  for (;;) {
    const answer = await ask();
    if (answer) return answer;
    assert.ok(performance.now() < end, `waited in vain for ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}
/** What viewer_node says at /task, once this is so. */
const served_task = (is_so, what) => until_true(async () => {
  const { task } = await (await fetch(`${nodes.url}task`)).json();
  return is_so(task) && task;
}, `${what} at /task`);
const ended_task = () => served_task(({ score }) => score, "score");

async function middle_of(page, selector) {
  const { x, y, width, height } = await page.locator(selector).boundingBox();
  return [x + width / 2, y + height / 2];
}
/** Scores of one run: the same, but for those that miss telemetry, which say so. */
function assert_same_scores(scores) {
  const whole = Object.entries(scores).filter(([, { missing_ticks }]) => missing_ticks === 0);
  for (const [name, score] of whole) assert.deepEqual(score, whole[0][1], `${name} is not as ${whole[0][0]}`);
  for (const [name, { missing_ticks, missing_ratio }] of Object.entries(scores)) {
    if (missing_ticks === 0) continue;
    assert.ok(missing_ratio > 0);
    console.log(`not compared: the score of ${name}: ${missing_ticks} ticks are missing`);
  }
}
/** The page, /task, the summary of the launch and the recording tell of one find. Ends the launch. */
async function assert_found(page) {
  await region(page).getByRole("heading", { name: "Score" }).waitFor();
  const { score, findings, figures } = await ended_task();
  const shown = await shown_score(page);
  assert.deepEqual(shown.findings, findings);
  assert.deepEqual(Object.fromEntries(shown.figures.map(({ label, value }) => [label, value])), figures);
  const missing = /^([\d.]+) % of the measurements are missing/.exec(findings[0]);
  assert.equal(missing !== null, score.missing_ratio > 1e-4);
  if (missing) assert.ok(Math.abs(missing[1] - 100 * score.missing_ratio) <= 0.0501 && missing[1] > 0, findings[0]);
  assert.equal(score.targets[0].outcome, "found");
  assert.deepEqual(score.marks.map(({ origin, outcome }) => ({ origin, outcome })), [{ origin: "page", outcome: "find" }]);
  assert.ok(score.targets[0].force.most_n >= kPress_newton);
  assert.match(shown.findings.join("\n"), /Found 1 of 1\./);
  // what was searched, and the lump
  await until(page, (t) => t.task_map?.searched > 0 && t.task_map.searched < t.task_map.places && t.task_map.lesions === 1, "the map");
  await until(page, (t) => t.scene.tissues.length === 2, "the lump");
  await page.locator("#task .map-key", { hasText: /pressed\s*not pressed\s*lesion, found/ }).waitFor();
  await page.getByRole("img", { name: /^Force over the task, / }).waitFor();
  assert.deepEqual(page.problems, []);

  await nodes.end("launch");
  const summary = JSON.parse(readFileSync(nodes.summary, "utf8")).task;
  const recorded = await recorded_score(nodes.recording, 0);
  assert_same_scores({ "the page": score, "the summary": summary, "the recording": recorded });
  return { shown, score };
}
async function recorded_score(file, exit_status) {
  const { text, status } = await nodes.says("score", file, "--json", "-", "-q");
  assert.equal(status, exit_status, text);
  return Object.values(JSON.parse(text).runs)[0];
}

test("a whole search by mouse alone: page, /task, summary, recording and replay have the same score", kWhole, async () => {
  nodes = await Nodes.launch(kByPerson, kSession);
  const page = await open(browser, nodes.url);
  await region(page).getByText("There may be a lump in the block.").waitFor();
  await page.locator("#task-start").click();
  await page.locator("#task-find").waitFor();
  const find = await middle_of(page, "#task-find");
  const hand = new ByMouse(page);
  await hand.begin();
  await hand.press(place_of_lump(), kPress_newton);
  await hand.release(); // the mark is where the tip has touched last, at most 3 s before
  await page.mouse.click(...find);
  await region(page).filter({ hasText: "1 find marked" }).waitFor();
  await press_stop(page);
  const live = await assert_found(page);
  await page.context().close();

  nodes.spawn("palpate", ["replay", nodes.recording, "--no-viewer"], "replay");
  nodes.run("viewer");
  await nodes.serves();
  const replayed = await open(browser, nodes.url, { wait: false });
  await region(replayed).getByRole("heading", { name: "Score" }).waitFor();
  const { score } = await ended_task();
  assert_same_scores({ "the page": live.score, "the replay": score });
  if (live.score.missing_ticks + score.missing_ticks === 0) assert.deepEqual(await shown_score(replayed), live.shown);
});

/** Ids of what Tab reaches, from the beginning of the page. */
async function tab_stops(page) {
  const stops = new Set();
  await page.evaluate(() => document.activeElement.blur());
  for (let i = 0; i < 80; ++i) {
    await page.keyboard.press("Tab");
    const stop = await page.evaluate(() => (document.activeElement === document.body ? "" : document.activeElement.dataset.stop));
    if (stop === undefined || stops.has(stop)) break;
    if (stop) stops.add(stop);
  }
  return stops;
}
/** All that can be used is reached by Tab; of a group of radio buttons one, from which arrows lead on. */
async function assert_reachable(page, phase) {
  const all = await page.evaluate(() => [...document.querySelectorAll("button, a[href], input, select, summary, [tabindex]")]
    .filter((one) => one.checkVisibility({ visibilityProperty: true }) && !one.disabled && one.tabIndex >= 0)
    .map((one, i) => (one.dataset.stop = one.id || `${i} ${one.textContent.slice(0, 20)}`)));
  const unnamed_radio = await page.evaluate(() => [...document.querySelectorAll("[role=radiogroup]")]
    .filter((one) => one.checkVisibility() && one.querySelectorAll("[tabindex='0']").length !== 1).length);
  assert.equal(unnamed_radio, 0);
  const reached = await tab_stops(page);
  assert.deepEqual(all.filter((one) => !reached.has(one)), [], `not reached by Tab: ${phase}`);
}
async function tab_to(page, id) {
  for (let i = 0; i < 80; ++i) {
    if (await page.evaluate((id) => document.activeElement.id === id, id)) return;
    await page.keyboard.press("Tab");
  }
  assert.fail(`Tab does not reach #${id}`);
}

test("a whole search by keys alone: everything is reached, and the focus is never lost", kWhole, async () => {
  nodes = await Nodes.launch(kByPerson, kSession);
  const page = await open(browser, nodes.url);
  await region(page).getByText("There may be a lump in the block.").waitFor();
  await assert_reachable(page, "before the start");
  await tab_to(page, "task-start");
  await page.evaluate(() => {
    window.lost_focus = 0;
    const look = () => {
      if (document.activeElement === document.body || !document.activeElement.checkVisibility()) window.lost_focus += 1;
      requestAnimationFrame(look);
    };
    look();
  });
  await page.keyboard.press("Enter");
  await said(page, "The task has started.");
  await page.locator("#task-find:focus").waitFor();
  const hand = new ByKeys(page);
  await hand.begin();
  await hand.press(place_of_lump(), kPress_newton);
  await page.keyboard.press("m");
  await said(page, "Mark 1 set.");
  await hand.release();
  await until(page, (t) => !t.hand.is_mine, "a hand that is let go");
  await page.locator("#task-find:focus").waitFor();
  await tab_to(page, "task-stop");
  await press_stop(page, async (stop) => {
    await stop.waitFor();
    await page.keyboard.press("Enter");
  });
  await said(page, "The task has ended. ");
  await page.locator("#task-title:focus").waitFor();
  assert.equal(await page.evaluate(() => window.lost_focus), 0, "pictures without a focus");
  await assert_reachable(page, "after the end");
  await assert_found(page);
});

test("a whole search with fingers at 390 × 844: nothing is too wide, and all is large enough for a finger", kWhole, async () => {
  nodes = await Nodes.launch(kByPerson, kSession);
  const page = await open(browser, nodes.url, kPhone);
  const fits = async (phase) => {
    const { too_wide, small } = await page.evaluate(() => {
      const shown = (selector) => [...document.querySelectorAll(selector)].filter((one) => one.checkVisibility() && one.clientWidth > 1); // 1: heard only
      return {
        too_wide: shown("html, #task, #task :not(svg *)").filter((one) => one.scrollWidth > one.clientWidth + 1).map((one) => `${one.tagName} ${one.className}`),
        small: shown("button, a[href], input, select, summary").map((one) => ({ box: one.getBoundingClientRect(), name: one.id || one.textContent }))
          .filter(({ box }) => box.width < 44 || box.height < 44).map(({ box, name }) => `${name}: ${box.width} × ${box.height}`),
      };
    });
    assert.deepEqual(too_wide, [], phase);
    assert.deepEqual(small, [], phase);
    assert.deepEqual(await violations(page), [], phase);
  };
  const start = page.locator("#task-start");
  await start.waitFor();
  await fits("before the start");
  await start.tap();
  await page.locator("#task-find").waitFor();
  await fits("while it runs");
  const find = await middle_of(page, "#task-find");
  const hand = new ByFinger(page);
  await hand.begin();
  await hand.press(place_of_lump(), kPress_newton);
  await hand.release();
  await page.touchscreen.tap(...find);
  await region(page).filter({ hasText: "1 find marked" }).waitFor();
  assert.equal(await page.evaluate(() => scrollY), 0, "the fingers have moved the hand, not the page");
  await press_stop(page, (stop) => stop.tap());
  await region(page).getByRole("heading", { name: "Score" }).waitFor();
  await fits("after the end");
  // each sentence and figure is within the width, and can be scrolled to
  for (const line of await page.locator("#task .findings li, #task .figures div").all()) {
    await line.scrollIntoViewIfNeeded();
    const { x, y, width, height } = await line.boundingBox();
    assert.ok(x >= 0 && x + width <= 390 && y >= 0 && y + height <= 844, `${await line.innerText()}: ${x}, ${y}, ${width} × ${height}`);
  }
  await assert_found(page);
});

test("two pages on one task show the same phase, time left, marks and score", kWhole, async () => {
  nodes = await Nodes.start(kByPerson, kSession);
  const pages = [await open(browser, nodes.url, { width: 800, height: 600 }), await open(browser, nodes.url, { width: 480, height: 700 })];
  const [first, second] = pages;
  const both = (check) => Promise.all(pages.map(check));
  const left_s = async (page) => {
    const [, minutes, seconds] = /(\d+):(\d\d) left/.exec(await page.locator("#task .progress").textContent()) ?? [];
    return 60 * minutes + Number(seconds);
  };
  const phases = await both((page) => region(page).getAttribute("data-phase"));
  assert.deepEqual(phases, ["waiting", "waiting"]);
  await first.locator("#task-start").click();
  await both((page) => page.locator("#task[data-phase=running]").waitFor());
  await second.getByRole("button", { name: "Take part" }).click(); // the first has started it
  for (const marks of [1, 2, 3]) {
    await pages[marks % 2].locator("#task-find").click();
    await both((page) => region(page).filter({ hasText: marks === 1 ? "1 find marked" : `${marks} finds marked` }).waitFor());
    await until_true(async () => {
      const [one, other] = await both(left_s);
      return Math.abs(one - other) <= 1;
    }, "pages that agree on the time left");
  }
  await press_stop(second);
  await both((page) => region(page).getByRole("heading", { name: "Score" }).waitFor());
  const scores = await both(shown_score);
  const findings = scores[0].findings.join("\n");
  assert.match(findings, /Found 0 of 1\./);
  // on a busy machine telemetry before a mark can be missing, which is said
  const marks = [/(\d) marks? (?:was|were) set without touching the tissue\./, /(\d) marks? (?:is|are) not judged/]
    .map((words) => Number(words.exec(findings)?.[1] ?? 0));
  assert.equal(marks[0] + marks[1], 3, findings);
  assert.deepEqual(scores[1], scores[0]);
  const maps = await both((page) => until(page, (t) => t.task_map?.lesions === 1, "the map"));
  assert.deepEqual(maps[1].task_map, maps[0].task_map);
  const late = await open(browser, nodes.url, { width: 480, height: 700 });
  await region(late).getByRole("heading", { name: "Score" }).waitFor();
  assert.deepEqual(await shown_score(late), scores[0]);
});

const kColours = {
  light: { colorScheme: "light", forcedColors: "none" }, dark: { colorScheme: "dark", forcedColors: "none" },
  forced: { colorScheme: "dark", forcedColors: "active" },
};
// where the user's own colours are forced axe-core reads those of the page
const kRules = { forced: { "color-contrast": { enabled: false } } };
test("axe-core has no objection to a task before the start, while it runs and after its end, in any colours", kWhole, async () => {
  nodes = await Nodes.start(kByPerson, kSession);
  const page = await open(browser, nodes.url, { width: 900, height: 700 });
  const assert_accessible = async (phase) => {
    for (const [colours, media] of Object.entries(kColours)) {
      await page.emulateMedia({ ...media, reducedMotion: "reduce" });
      assert.deepEqual(await violations(page, kRules[colours]), [], `${phase}, ${colours}`);
    }
  };
  await page.locator("#task .map-key", { hasText: "search here" }).waitFor();
  await assert_accessible("before the start");
  await page.locator("#task-start").click();
  await page.locator("#task-find").click();
  await region(page).filter({ hasText: "1 find marked" }).waitFor();
  await assert_accessible("while it runs");
  await press_stop(page);
  await region(page).getByRole("heading", { name: "Score" }).waitFor();
  await page.locator("#task .map-key", { hasText: /not pressed\s*lesion, not found/ }).waitFor();
  await page.getByRole("img", { name: /^Force over the task, / }).waitFor();
  await assert_accessible("after the end");
  const late = await open(browser, nodes.url, kPhone);
  await region(late).getByRole("heading", { name: "Score" }).waitFor();
  await late.locator("#task[tabindex='0']").waitFor(); // it scrolls, so keys reach it
  assert.deepEqual(await violations(late), [], "on a phone that came after the end");
});

test("a viewer_node and a recorder that are killed during a task lose no more than half a second of it", kWhole, async () => {
  nodes = await Nodes.launch(kByPerson, kSession);
  const second = join(nodes.folder, "second.mcap");
  nodes.spawn("viewer_node", ["--session", nodes.session, ...nodes.overrides(), "--no-web", "--quiet", "--record", second], "recorder");
  const page = await open(browser, nodes.url);
  const size = () => statSync(second, { throwIfNoEntry: false })?.size ?? 0;
  const file_grows = () => {
    const before = size();
    return until_true(() => size() > before, "a recording that grows");
  };
  await file_grows();
  await page.locator("#task-start").click();
  await page.locator("#task-find").waitFor();
  const hand = new ByMouse(page);
  await hand.begin();
  await hand.press(place_of_lump(), kPress_newton);
  await page.keyboard.press("m");
  await region(page).filter({ hasText: "1 find marked" }).waitFor();
  await hand.release();
  await file_grows();

  // the recorder
  const machine = new QuietMachine();
  const { elapsed_s } = await served_task(({ phase }) => phase === "running", "running task");
  await nodes.kill("recorder");
  const cut = await recorded_score(second, 1);
  assert.ok(cut.is_cut);
  const disturbance = machine.disturbance();
  if (disturbance) console.log(`not checked: the end of a recorder: the machine was not quiet: ${disturbance}`);
  else assert.ok(cut.time_s > elapsed_s - 0.5, `${cut.time_s} s of ${elapsed_s} s`);
  assert.equal(cut.missing_ticks, 0);

  // the viewer
  const watched = new QuietMachine();
  const killed = nodes.pid_of("viewer");
  process.kill(killed, "SIGKILL");
  await until_true(() => nodes.pid_of("viewer") !== killed, "another viewer_node");
  await until_text(page, "banners", /^Connection to the viewer’s server lost|^$/);
  await region(page).filter({ hasText: "1 find marked" }).waitFor();
  await until(page, (t) => t.is_connected && t.state.id === "free", "the page, connected again");
  const restart_disturbance = watched.disturbance();
  await press_stop(page);
  await region(page).getByRole("heading", { name: "Score" }).waitFor();
  const { score, findings } = await ended_task();
  assert.ok(score.missing_ticks > 0);
  assert.match(findings[0], /^\d+\.\d+ % of the measurements are missing: the score covers the rest\.$/);
  assert.equal(score.targets[0].outcome, "found", "what the viewer_node before has seen");
  const lost_s = score.missing_ratio * score.time_s;
  if (restart_disturbance) console.log(`not checked: ${lost_s} s were lost: the machine was not quiet: ${restart_disturbance}`);
  else assert.ok(lost_s <= 0.5, `${lost_s} s lost`);

  await nodes.end("launch");
  const recorded = await recorded_score(nodes.recording, 0);
  assert.equal(recorded.time_s, score.time_s);
  assert.deepEqual(recorded.marks, score.marks);
  assert.deepEqual(recorded.targets.map(({ outcome }) => outcome), ["found"]);
});

const kSkip = kLimit.skip || kSkipScreenshots;
test("screenshots of a task", { ...kWhole, skip: kSkip }, async () => {
  nodes = await Nodes.start(kByPerson, kSession);
  const page = await open(browser, nodes.url, { scale: 1, width: 1024, height: 680, max_hz: 5 });
  await page.locator("#task .map-key", { hasText: "search here" }).waitFor();
  await page.waitForTimeout(400);
  await screenshot(page, "task_briefing");
  await page.locator("#task-start").click();
  await page.locator("#task-find").waitFor();
  const find = await middle_of(page, "#task-find");
  const hand = new ByMouse(page);
  await hand.begin();
  await hand.press(place_of_lump(), kPress_newton);
  await hand.release();
  await page.mouse.click(...find);
  await region(page).filter({ hasText: "1 find marked" }).waitFor();
  const phone = await open(browser, nodes.url, { scale: 1, dark: true, max_hz: 5, ...kPhone });
  await hand.begin();
  await hand.press({ x: -0.008, y: -0.004 }, kPress_newton);
  for (const [one, name] of [[page, "task_running"], [phone, "task_phone"]]) {
    await one.locator("#task[data-phase=running]").waitFor();
    await until(one, (t) => t.applied_newton >= kPress_newton, "the press");
    await one.waitForTimeout(400);
    await screenshot(one, name);
  }
  await hand.release();
});
