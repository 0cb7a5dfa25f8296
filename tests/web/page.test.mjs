// SPDX-License-Identifier: Apache-2.0
// page.test.mjs: the page in a real Chromium, over the simulated session of support/mock_server.mjs.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { at_most, drawn, late_pages, launch, open, picture, press_stop, scene_signature, status, until, until_pixels_change, until_text, violations, words } from "./support/browser.mjs";
import { patience } from "./support/machine.mjs";
import { start_mock_server } from "./support/mock_server.mjs";
import { changed_pixels } from "./support/png.mjs";

const kLimit = { timeout: patience(90000) };
const kReplay = { file: "/tmp/runs/a_recording_with_a_long_name_of_its_own.mcap", positionS: 12, lengthS: 63, speedRatio: 1, isPaused: false, beginNs: 1000000000n };
const kLong = "left_lobe_of_the_liver_with_a_stiff_metastasis_near_the_falciform_ligament";
const kPicture = { scale: 1 }; // for tests that compare pictures
const kSmall = { width: 480, height: 360 }; // several pages share a processor that draws them all
let browser;
before(async () => { browser = await launch(); });
after(async () => {
  await discard();
  await browser.close();
});

// Consecutive tests with the same options share the server and its pages: loading and first drawing
// cost seconds.
let server;
let pages = [];
let shared; // their options

/**
 * A test on `count` pages, with the world and the controls as after loading. A failed test discards them.
 * @param options.world  of start_mock_server
 * @param options.page   of open
 */
function page_test(name, { world = {}, page = {}, count = 1 }, body) {
  test(name, kLimit, async () => {
    try {
      await prepare(JSON.stringify({ world, page }), count);
      await body(...pages);
    } catch (error) {
      await discard();
      throw error;
    }
  });
}

async function prepare(options, count) {
  if (options !== shared) {
    await discard();
    server = await start_mock_server(JSON.parse(options).world);
    shared = options;
  }
  server.reset();
  while (pages.length < count) pages.push(await open(browser, server.url, JSON.parse(options).page));
  for (const page of pages) await reset_page(page);
  server.reset(); // a page may have released the hand only now
}

async function discard() {
  shared = undefined;
  pages = [];
  for (const context of browser.contexts()) await context.close();
  await server?.close();
  server = undefined;
}

/** The controls as after loading. */
async function reset_page(page) {
  await page.mouse.up();
  await page.mouse.move(0, 0);
  await until(page, (t) => t.is_connected && !t.hand.is_held && !t.hand.is_mine && !t.hand.is_others && Object.values(t.nodes).every(({ is_alive }) => is_alive), "a free hand and three nodes");
  await page.evaluate(() => {
    for (const choice of ["#reset-view", "#colours [data-value=material]", "#windows [data-value='10']"]) document.querySelector(choice).click();
    const details = document.getElementById("details");
    if (details.getAttribute("aria-expanded") === "true") details.click();
  });
}
const tones = (page) => page.locator("#banners p").evaluateAll((lines) => lines.map(({ dataset }) => dataset.tone));
// Where the tool is, in pixels of the window.
async function tool_on_screen(page) {
  const box = await page.locator("#canvas").boundingBox();
  const { tool_px } = await status(page);
  return { x: box.x + tool_px.x, y: box.y + tool_px.y };
}
// The tool waits above the tissue, so that a test knows where it is.
async function rest_tool_at(page, z) {
  server.world.is_still = true;
  server.world.tool = { x: 0.01, y: -0.01, z };
  await until(page, (t) => Math.abs(t.tool_m.z - z) < 1e-6, "the resting tool");
  if (z < 0.003) return;
  // the words over the picture rest, too
  await until_text(page, "state-title", /^Free$/);
  await until_text(page, "force-applied", /^0\.00$/);
}

// first: on a new page the curves still grow
page_test("the plots move, can be held and show another window", { page: kPicture }, async (page) => {
  const first = await until(page, (t) => t.now_s > 1.5 && t.plots.force[0].points > 20, "curves");
  const before = await picture(page, "#plot-force .plot");
  const later = await until(page, (t) => t.now_s > first.now_s + 1, "another second");
  assert.ok(later.plots.energy[0].points > first.plots.energy[0].points);
  assert.ok(later.plots.lateness_total > first.plots.lateness_total);
  await until_changed(page, before, "#plot-force .plot");

  await page.getByRole("button", { name: "Pause" }).click();
  const held = await until(page, (t) => t.is_paused, "a pause");
  await drawn(page);
  const held_picture = await picture(page, "#plot-force .plot");
  await until(page, (t) => t.now_s > held.now_s + 0.5, "data that still arrives");
  assert.equal(changed_pixels(held_picture, await picture(page, "#plot-force .plot")), 0);

  await page.getByRole("radio", { name: "2 s", exact: true }).click();
  await until(page, (t) => t.window_s === 2, "the shorter window");
  await until_changed(page, held_picture, "#plot-force .plot");
  await page.getByRole("button", { name: "Resume" }).click();
  await until(page, (t) => !t.is_paused && t.plot_draws > held.plot_draws + 3, "plots that move again");
});
async function until_changed(page, before, selector) {
  for (let i = 0; i < 100; ++i) {
    if (changed_pixels(before, await picture(page, selector)) > 100) return;
  }
  assert.fail(`${selector} stayed as it was`);
}

page_test("pixels change when the tissue deforms, and only then", { page: kPicture }, async (page) => {
  await rest_tool_at(page, 0.004); // 1 mm above the surface
  await until(page, (t) => t.scene.tissues[0].displacement_m === 0, "tissue at rest");
  await drawn(page);
  const at_rest = await picture(page);
  const still = await picture(page);
  assert.equal(changed_pixels(at_rest, still), 0);

  // elsewhere than at the tool, which stands still: what changes is the tissue
  server.world.dent = { x: -0.02, y: -0.02, z: -0.008 };
  await until(page, (t) => t.scene.tissues[0].displacement_m > 0.01, "11 mm of dent");
  const changed = await until_pixels_change(page, at_rest, 1500, "the dent");
  assert.ok(changed < 0.5 * at_rest.width * at_rest.height, "the camera stands still");

  server.world.dent = null;
  await until(page, (t) => t.scene.tissues[0].displacement_m === 0, "tissue at rest");
  await drawn(page);
  assert.equal(changed_pixels(at_rest, await picture(page)), 0);
});

page_test("tissue with a motion of its own is drawn where it is", { page: kPicture }, async (page) => {
  await rest_tool_at(page, 0.03);
  await until(page, (t) => t.scene.tissues[0].displacement_m === 0, "tissue at rest");
  await drawn(page);
  const at_rest = await picture(page);

  server.world.offset = { x: 0, y: 0, z: 0.008 };
  await until(page, (t) => t.scene.tissues[0].offset_m.z === 0.008, "the motion");
  await until_pixels_change(page, at_rest, 1500, "the tissue further up");
  assert.equal((await status(page)).scene.tissues[0].displacement_m, 0, "it does not give way");

  server.world.offset = null;
  await until(page, (t) => t.scene.tissues[0].offset_m.z === 0, "the tissue where it was");
  await drawn(page);
  assert.equal(changed_pixels(at_rest, await picture(page)), 0);
});

let without_shaft;
page_test("a tool without a shaft is drawn as its tip", { page: kPicture }, async (page) => {
  await rest_tool_at(page, 0.02);
  without_shaft = await picture(page);
});

page_test("the shaft is drawn, and turns with the tool", { world: { shaft_m: 0.03 }, page: kPicture }, async (page) => {
  await rest_tool_at(page, 0.02);
  await until_pixels_change(page, without_shaft, 300, "the shaft");
  await drawn(page);
  const upright = await picture(page);
  server.world.orientation = [Math.SQRT1_2, 0, Math.SQRT1_2, 0]; // its z lies along x
  await until_pixels_change(page, upright, 300, "the shaft turned");
});

page_test("the page requests nothing from any host but the server, and the console is silent", {}, async (page) => {
  await until(page, (t) => t.plot_draws > 5 && t.mesh_frames > 5, "a running page");

  assert.ok(page.requests.length >= 3);
  for (const url of page.requests) assert.equal(new URL(url).host, new URL(server.url).host);
  assert.deepEqual(page.problems, []);
  assert.equal((await status(page)).unreadable, 0);
});

page_test("a scene that is sent again is not built again", {}, async (page) => {
  const { scene_builds } = await status(page);
  server.send_scene(); // as physics_node does when another viewer subscribes
  let sent = (await status(page)).mesh_frames;
  await until(page, (t) => t.mesh_frames > sent + 2, "mesh frames sent after the scene");
  assert.equal((await status(page)).scene_builds, scene_builds);

  server.world.revision += 1n;
  server.send_scene();
  await until(page, (t) => t.scene_builds === scene_builds + 1 && t.scene.revision === 2, "the new revision");
  sent = (await status(page)).mesh_frames;
  await until(page, (t) => t.mesh_frames > sent + 2, "its mesh frames");
});

page_test("displacement colours the dent by its depth", {}, async (page) => {
  await rest_tool_at(page, -0.004);
  await until(page, (t) => t.scene.tissues[0].displacement_m > 0.006, "7 mm of dent");

  await page.getByRole("radio", { name: "Displacement" }).click();

  // depth 3 − (−4) = 7 mm, on a scale that ends at 1, 2, 5 or 10 mm
  await until(page, (t) => t.mode === "displacement" && t.scale.high === 0.01, "a scale of 10 mm");
  await until_text(page, "ramp-high", /^10$/);
  await page.getByRole("radio", { name: "Stiffness" }).click();
  await until(page, (t) => t.scale.low === 250 && t.scale.high === 1500, "the scale of both tissues");

  // offered once an elastic body reports it; 0.7 at the deepest place
  assert.equal(await page.getByRole("radio", { name: "Strain" }).count(), 0);
  server.world.has_strain = true;
  await page.getByRole("radio", { name: "Strain" }).click();
  await until(page, (t) => t.mode === "strain" && t.scale.high === 1, "a scale of 100 %");
  await until_text(page, "ramp-high", /^100$/);
});

page_test("a drag on the tool moves the hand, the wheel in depth, and the force is displayed", {}, async (page) => {
  await rest_tool_at(page, 0.02);
  const from = await tool_on_screen(page);
  await page.mouse.move(from.x, from.y);
  await until_text(page, "force-applied", /^0\.00$/);

  await page.mouse.down();
  await page.mouse.move(from.x, from.y + 60, { steps: 5 });
  await page.mouse.move(from.x, from.y + 130, { steps: 5 });

  await until(page, (t) => t.applied_newton > 0.5, "a force on the hand");
  await until(page, (t) => ["contact", "clamped", "exhausted"].includes(t.state.id), "the contact in words");
  const held = await until(page, (t) => t.hand.is_mine, "the hand");
  assert.ok(held.target_m.z < 0);
  await until_text(page, "touch-words", /^You hold the hand/);
  await until_text(page, "force-applied", /^(0\.[3-9]|[1-9])/);

  // away from the viewer, who looks from −y
  const y_before = (await status(page)).target_m.y;
  await page.mouse.wheel(0, -600);
  await until(page, (t) => t.target_m.y > y_before + 0.005, "a target further away");

  const count = server.world.targets.length;
  await until(page, () => server.world.targets.length >= count + 2, "targets of a hand that is held still");
  await page.mouse.up();
  await until(page, (t) => !t.hand.is_held, "the release");
  await until(page, () => server.world.targets.at(-1).is_released, "the release at the server");
  for (let i = 1; i < server.world.targets.length; ++i) {
    assert.ok(server.world.targets[i].z < 0.1 && Number.isFinite(server.world.targets[i].x));
  }
});

page_test("at most sixty targets a second leave the page", {}, async (page) => {
  await rest_tool_at(page, 0.02);
  const { x, y } = await tool_on_screen(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  // more events than a test from outside can send: 250 a second
  await page.evaluate(async ([x, y]) => {
    const canvas = document.getElementById("canvas");
    for (let i = 0; i < 120; ++i) {
      canvas.dispatchEvent(new PointerEvent("pointermove", { pointerId: 1, clientX: x + (i % 40), clientY: y + (i % 30) }));
      await new Promise((resolve) => setTimeout(resolve, 4));
    }
  }, [x, y]);
  await page.mouse.up();
  await until(page, (t) => !t.hand.is_held && server.world.targets.at(-1)?.is_released, "the release");

  const targets = server.world.targets.filter((one) => !one.is_released);
  const span_s = 1e-3 * (targets.at(-1).at_ms - targets[0].at_ms);
  assert.ok(targets.length >= 3);
  // two more: the first is sent at once, and arrivals jitter
  assert.ok(targets.length <= 60 * span_s + 3, `${targets.length} in ${span_s} s`);
});

page_test("targets stay within the reach of the scene", {}, async (page) => {
  const { sent } = (await status(page)).hand;
  await rest_tool_at(page, 0.02);
  const { x, y } = await tool_on_screen(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(990, 60, { steps: 4 });
  await page.mouse.wheel(0, -20000);
  await until(page, (t) => t.hand.sent > sent + 3 && server.world.targets.length > 3, "targets");
  await page.mouse.up();
  await until(page, () => server.world.targets.at(-1).is_released, "the last one");

  for (const { x, y, z } of server.world.targets) assert.ok(Math.hypot(x, y, z) <= 0.09 * (1 + 1e-9));
});

page_test("the right mouse button, or G in turn, closes the jaws, and the page says what they do", {}, async (page) => {
  await rest_tool_at(page, 0.02);
  const { x, y } = await tool_on_screen(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x, y + 130, { steps: 5 });
  await until(page, () => server.world.targets.length > 0 && server.world.targets.at(-1).buttons === 0, "open jaws");
  await page.mouse.down({ button: "right" });
  await until(page, () => server.world.targets.at(-1).buttons === 1, "closed jaws");
  server.world.grip = 1;
  await until(page, (t) => ["holds", "clamped", "exhausted"].includes(t.state.id), "what they hold in words");
  await page.mouse.up({ button: "right" });
  await until(page, () => server.world.targets.at(-1).buttons === 0, "jaws that open with the button");
  server.world.grip = 0;
  await page.locator("#canvas").focus();
  await page.keyboard.press("g");
  await until(page, () => server.world.targets.at(-1).buttons === 1, "jaws that G closes");
  await page.keyboard.press("g");
  await until(page, () => server.world.targets.at(-1).buttons === 0, "and opens");
  await page.keyboard.press("g");
  await page.mouse.up();
  await until(page, () => server.world.targets.at(-1).is_released && server.world.targets.at(-1).buttons === 0, "the release of all");
});

page_test("the keyboard leads the hand too: T, arrows, Escape", {}, async (page) => {
  await rest_tool_at(page, 0.02);
  await page.locator("#canvas").focus();
  await page.keyboard.press("t");
  await page.keyboard.press("ArrowDown");
  await until(page, (t) => t.hand.is_held, "the hand");
  const first = (await status(page)).target_m;
  for (let i = 0; i < 7; ++i) await page.keyboard.press("ArrowDown");
  const lower = await until(page, (t) => t.target_m.z < first.z - 0.0065, "a target 7 mm lower");
  const { x, y, z } = lower.target_m;
  assert.ok(Math.hypot(x - first.x, y - first.y) < 1e-6 && z > first.z - 0.0075, `straight down, ${JSON.stringify([first, lower.target_m])}`);
  await until(page, () => server.world.targets.length > 0, "a target at the server");

  await page.keyboard.press("Escape");
  await until(page, (t) => !t.hand.is_held, "the release");
  await page.keyboard.press("t");
  const before = await status(page);
  await page.keyboard.press("ArrowLeft"); // now it turns the view
  await until(page, (t) => Math.abs(t.tool_px.x - before.tool_px.x) > 1, "another view");
  assert.equal((await status(page)).hand.sent, before.hand.sent);
});

for (const [name, state, task] of [["device", "no_device", "the motors"], ["mofc", "no_mofc", "the clamp"], ["physics", "no_physics", "the tissue"]]) {
  page_test(`a killed ${name}_node is reported within 2 s`, {}, async (page) => {
    await until(page, (t) => t.nodes[name].is_alive, "a living node");

    await at_most("the report of a killed node, ms", 2000, async () => {
      server.world.alive[name] = false;
      const killed_ms = performance.now();
      await until(page, (t) => t.state.id === state && !t.nodes[name].is_alive, "the state in words");
      await until_text(page, "banners", new RegExp(`${name}_node \\(${task}\\) is gone: last heard \\d`));
      const reported_ms = performance.now() - killed_ms;

      server.world.alive[name] = true;
      await until(page, (t) => t.nodes[name].is_alive && t.state.id !== state, "its return");
      await until_text(page, "banners", /^$/);
      return reported_ms;
    });
  });
}

page_test("a stalled server is reported as gone, though its connection stays open", {}, async (page) => {
  await at_most("the report of a stalled server, ms", 2500, async () => {
    server.world.is_silent = true;
    const silent_ms = performance.now();
    await until(page, (t) => t.state.id === "disconnected", "the loss");
    const reported_ms = performance.now() - silent_ms;

    server.world.is_silent = false;
    await until(page, (t) => t.state.id !== "disconnected" && t.nodes.device.is_alive, "the return");
    return reported_ms;
  });
});

page_test("a lost connection is reported and made again", {}, async (page) => {
  const port = Number(new URL(server.url).port);
  await at_most("the report of a lost connection, ms", 2000, async () => {
    await server.close();
    const closed_ms = performance.now();
    await until(page, (t) => t.state.id === "disconnected", "the loss");
    const reported_ms = performance.now() - closed_ms;
    await until_text(page, "banners", /Connection to the viewer’s server lost/);

    server = await start_mock_server({ port });
    await until(page, (t) => t.is_connected && t.state.id !== "disconnected" && t.scene, "the connection");
    await until_text(page, "banners", /^$/);
    return reported_ms;
  });
});

page_test("a session that has ended is no lost connection, until another begins", {}, async (page) => {
  const port = Number(new URL(server.url).port);
  server.write_log("viewer_node", 'event=verdict grade=good text=""');
  await until(page, (t) => t.events.some(({ text }) => text === "verdict: good"), "the verdict");
  await server.close();
  await until(page, (t) => t.state.id === "ended", "the end");
  await until_text(page, "banners", /^The session has ended\.\s*verdict on the run: good\.$/);
  assert.deepEqual(await tones(page), ["calm", "calm"]);
  assert.deepEqual(await violations(page), []);

  server = await start_mock_server({ port });
  await until(page, (t) => t.is_connected && t.state.id !== "ended" && t.scene, "the connection");
  await until_text(page, "banners", /^$/);
});

page_test("the end of a task tells who has closed the details nothing of what rendered the force", {}, async (page) => {
  const port = Number(new URL(server.url).port);
  server.world.task = { ...kTask, phase: 2, findings: ["Found 1 of 2."], figures: [] };
  await page.locator("body.is-plain").waitFor();
  server.write_log("viewer_node", 'event=verdict grade=mixed text="the device\'s peak force or slew limit cut the force in 82 % of the contact"');
  await until(page, (t) => t.events.some(({ text }) => text === "verdict: mixed"), "the verdict");
  await server.close();
  await until(page, (t) => t.state.id === "ended", "the end");
  await until_text(page, "banners", /^The session has ended\.$/);
  await until_text(page, "announcement", /^The session has ended\.$/);
  assert.doesNotMatch(await page.evaluate(() => document.body.innerText), /verdict|peak force|82 %/);
  await page.getByRole("button", { name: "Details" }).click();
  await until_text(page, "banners", /^The session has ended\.\s*verdict on the run: mixed\. the device's peak force/);

  server = await start_mock_server({ port });
  await until(page, (t) => t.is_connected && t.state.id !== "ended" && t.scene, "the connection");
  await page.getByRole("button", { name: "Details" }).waitFor({ state: "hidden" });
});

page_test("every control has a name, and Tab reaches it", {}, async (page) => {
  const unnamed = await page.evaluate(() => [...document.querySelectorAll("button, canvas[tabindex]")]
    .filter((element) => !(element.getAttribute("aria-label") || element.innerText || element.title)).length);
  assert.equal(unnamed, 0);

  const missing = new Set(["windows", "pause", "theme", "canvas", "colours", "inside", "reach", "to-tool", "reset-view", "touch-toggle", "marker", "record"]);
  for (let i = 0; i < 60 && missing.size > 0; ++i) {
    await page.keyboard.press("Tab");
    missing.delete(await page.evaluate(() => document.activeElement?.id || document.activeElement?.parentElement?.id));
  }
  assert.deepEqual([...missing], []);
});

for (const [width, height] of [[390, 844], [360, 640], [844, 390], [768, 1024], [1440, 900]]) {
  page_test(`nothing overflows at ${width} × ${height}`, {}, async (page) => {
    const { frames } = await status(page);
    await page.setViewportSize({ width, height });
    await until(page, (t) => t.frames > frames + 2, "pictures of that size");
    const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    assert.ok(overflow <= 0, `${overflow} px too wide`);
    const scene = await page.locator("#scene").boundingBox();
    assert.ok(scene.width > 300 && scene.height > 250);
    // what lies over the picture does not overlap
    const boxes = [];
    await page.locator(".touch").waitFor();  // it comes with the scene
    for (const selector of [".state", ".view-tools", ".keys", ".touch"]) boxes.push({ selector, ...(await page.locator(selector).boundingBox()) });
    for (const a of boxes) for (const b of boxes) {
      if (a.selector >= b.selector) continue;
      const apart = a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y || b.y + b.height <= a.y;
      assert.ok(apart, `${a.selector} overlaps ${b.selector}`);
    }
  });
}

page_test("the events of the session are shown, also to a page that joins late", { page: kSmall }, async (first) => {
  server.write_log("viewer_node", "event=node_restarted node=mofc_node", 3);
  server.write_log("device_node", 'event=device_fault reason="the position jumped" count=1', 4);
  server.write_log("mofc_node", "event=clamped_began", 3);
  server.write_log("mofc_node", "event=clamped_ended ticks=12");
  server.write_log("mofc_node", "event=interaction_stale_began", 3);
  const texts = ["mofc_node: restarted", "fault: the position jumped", "clamp reduces the force", "clamp no longer reduces the force", "physics silent: the force fades"];
  const has_all = (t) => texts.every((text) => t.events.some((event) => event.text === text));
  await until(first, has_all, "the events");

  const late = await open(browser, server.url, kSmall);
  const shown = await until(late, has_all, "the history");
  assert.deepEqual(shown.events, (await until(first, has_all, "the events")).events);
  await late.locator("#timeline .events li", { hasText: "the position jumped" }).waitFor();
  await late.locator('#timeline .marks i[data-tone="alarm"][title*="the position jumped"]').waitFor({ state: "attached" });
  // one mark from the beginning of the clamping to its end
  const clamps = late.locator('#timeline .marks i[title*="clamp"]');
  assert.equal(await clamps.count(), 1);
  await late.context().close();
});

page_test("depth, speed, local stiffness, and the loop of force and depth", {}, async (page) => {
  // the tool presses to 8 mm; the mock's tissue takes more force inward than outward
  const loop = await until(page, (t) => t.plots.loop.points > 100 && t.plots.loop.depth_mm > 7, "a press in the loop");
  assert.ok(loop.plots.loop.depth_mm < 8.5 && loop.plots.loop.force_newton > 1.5);
  await until(page, (t) => t.contact.speed_m_per_s > 0.01, "a moving tool");

  await rest_tool_at(page, -0.004);
  await until(page, (t) => Math.abs(t.contact.depth_m - 0.007) < 1e-9 && t.contact.stiffness_newton_per_m === 250 && t.contact.speed_m_per_s < 1e-3, "7 mm in 250 N/m, at rest");
  await until_shown(page, "#plot-contact .legend", /depth\s*7\.00 mm\s*speed\s*0 mm\/s\s*local stiffness\s*250 N\/m/);
  await rest_tool_at(page, 0.02);
  await until_shown(page, "#plot-contact .legend", /depth\s*0\.00 mm[^]*local stiffness\s*–/);
});
async function until_shown(page, selector, pattern) {
  let text = "";
  for (const end = performance.now() + patience(10000); performance.now() < end;) {
    text = await page.locator(selector).innerText();
    if (pattern.test(text)) return;
    await page.waitForTimeout(20);
  }
  assert.fail(`${selector} says “${text}”, not ${pattern}`);
}

page_test("a tissue’s stiffness and damping are changed live, and the scene shows what physics applied", { world: { has_control: true } }, async (page) => {
  const field = (name) => page.getByRole("spinbutton", { name });
  await field("Stiffness, N/m, of block").fill("400");
  await field("Stiffness, N/m, of block").press("Enter");
  await until(page, (t) => t.scene.tissues[0].stiffness_newton_per_m === 400, "the stiffness that physics tells");
  assert.deepEqual(server.world.changes, [{ tissue: 0, stiffness: 400, damping: 1 }]);
  await until(page, (t) => t.events.some(({ text }) => text === "block: 400 N/m, 1 N·s/m"), "the change among the events");

  // what physics would refuse is not sent
  await field("Damping, N·s/m, of inclusion").fill("-3");
  await field("Damping, N·s/m, of inclusion").press("Enter");
  await until_shown(page, "#control", /0 … 10000/);
  assert.equal(server.world.changes.length, 1);

  server.world.refuses_changes = true;
  await field("Damping, N·s/m, of inclusion").fill("30");
  await field("Damping, N·s/m, of inclusion").press("Enter");
  await until_shown(page, "#control", /refused/);
  assert.equal(server.world.changes.length, 2);

  server.world.refuses_changes = false;
  await page.locator("#control").getByRole("button", { name: "Reset" }).click();
  await until(page, (t) => t.scene.tissues[0].stiffness_newton_per_m === 250, "the session’s stiffness");
});

page_test("a device that waits for a person is acknowledged as it is shown, and only while it waits", { world: { has_control: true } }, async (page) => {
  const button = page.getByRole("button", { name: "Acknowledge" });
  assert.equal(await button.count(), 0, "a device that is enabled waits for nothing");

  server.world.device = { phase: 3, deviceFaults: 0n, lastFault: 0 };
  await until_shown(page, "#acknowledge", /handle is free/);
  await button.click();
  await until(page, () => server.world.acknowledgements.length === 1, "the acknowledgement");
  server.world.device = { phase: 6, deviceFaults: 0n, lastFault: 0 };
  await button.waitFor({ state: "detached" });

  server.world.device = { phase: 5, deviceFaults: 2n, lastFault: 10 };
  await until_shown(page, "#acknowledge", /readings stood still/);
  await button.click();
  await until(page, () => server.world.acknowledgements.length === 2, "the acknowledgement of the fault");
  assert.deepEqual(server.world.acknowledgements, [
    { is_of_device: true, phase: 3, deviceFaults: 0n },
    { is_of_device: true, phase: 5, deviceFaults: 2n },
  ]);

  server.world.replay = { ...kReplay }; // of a recording
  await button.waitFor({ state: "detached" });
  server.world.replay = undefined;
  await button.waitFor();
  server.world.alive.device = false; // what it waits for now is not known
  await button.waitFor({ state: "detached" });
  server.world.alive.device = true;
});

page_test("a slider held down sends a few changes a second, and silence is no refusal", { world: { has_control: true } }, async (page) => {
  const slider = page.getByRole("slider", { name: "Stiffness of block" });
  await slider.focus();
  const begin_ms = performance.now();
  for (let i = 0; i < 40; ++i) await page.keyboard.down("ArrowRight"); // as a held key repeats
  await page.keyboard.up("ArrowRight");
  const wanted = Number(await page.getByRole("spinbutton", { name: "Stiffness, N/m, of block" }).inputValue());
  assert.ok(wanted > 500, `${wanted} N/m after 40 steps of 0.01 decades`);
  await until(page, (t) => t.scene.tissues[0].stiffness_newton_per_m === wanted, "the last value");
  const most = 2 + (performance.now() - begin_ms) / 200;
  assert.ok(server.world.changes.length <= most, `${server.world.changes.length} changes, at most ${most}`);

  server.world.ignores_changes = true;
  await page.keyboard.press("ArrowRight");
  await until_shown(page, "#control", /no answer yet/);
  assert.doesNotMatch(await page.locator("#control").innerText(), /refused/);
  server.world.ignores_changes = false;
  await page.keyboard.press("ArrowRight");
  await until(page, (t) => t.scene.tissues[0].stiffness_newton_per_m > wanted, "the value after the silence");
  assert.doesNotMatch(await page.locator("#control").innerText(), /no answer/);
});

page_test("elastic bodies and their parts have a stiffness", {}, async (page) => {
  server.world.is_elastic = true;
  server.change_scene();
  await until(page, (t) => t.scene.tissues[0].stiffness_newton_per_m === 0, "the elastic scene");
  await until_shown(page, "#tissues", /block\s*250 N\/m\s*inclusion\s*1.500 N\/m/);
  await page.locator("#colours [data-value=stiffness]").click();
  await until(page, (t) => t.scale.low === 250 && t.scale.high === 1500, "the scale of both");
  server.world.is_elastic = false;
  server.change_scene();
  await until(page, (t) => t.scene.tissues[0].stiffness_newton_per_m === 250, "the scene as before");
});

const reddish = ({ pixels, channels }) => {
  let count = 0;
  for (let i = 0; i < pixels.length; i += channels) if (pixels[i] > 130 && pixels[i] > 1.6 * pixels[i + 1] && pixels[i] > 1.6 * pixels[i + 2]) count += 1;
  return count;
};
page_test("markers and events are lines in the plots, where they happened", { page: { scale: 1 } }, async (page) => {
  await page.click("#windows [data-value='60']"); // no line leaves it while a slow machine draws
  await until(page, (t) => t.now_s > 1, "some ticks");
  const before = reddish(await picture(page, "#plot-energy .plot"));
  const begin_s = (await status(page)).now_s;
  server.write_log("device_node", 'event=device_fault reason="the position jumped" count=1', 4);
  const heard = await until(page, (t) => t.events.some(({ text }) => text.includes("the position jumped")), "the fault");
  await until(page, (t) => t.now_s > heard.now_s + 0.8, "a moment, so that the lines are apart");
  await page.keyboard.press("m");
  const shown = await until(page, (t) => ["marker", "alarm"].every((one) => t.instants.some(({ tone }) => tone === one)), "marker and fault in the plots");
  const fault = shown.instants.find(({ tone }) => tone === "alarm");
  assert.equal(fault.text, "fault: the position jumped");
  const happened_s = shown.plots.end_s + fault.at_s;
  assert.ok(happened_s > begin_s - 1 && happened_s < heard.now_s + 1, `${happened_s} s, not from ${begin_s} s to ${heard.now_s} s`);
  // it moves with the curve
  const later = await until(page, (t) => t.plots.end_s > shown.plots.end_s + 1, "another second");
  const moved = later.instants.find(({ tone }) => tone === "alarm");
  assert.ok(moved.at_s < fault.at_s - 0.9 && Math.abs(later.plots.end_s + moved.at_s - happened_s) < 1e-6);
  // a picture may be taken while the curve is drawn anew
  let red = 0;
  for (let i = 0; i < 100 && red <= 20; ++i) red = reddish(await picture(page, "#plot-energy .plot")) - before;
  assert.ok(red > 20, `${red} red pixels more`);
});

page_test("card and legend show the same force, and withdraw it when its node dies", { page: { ...kSmall, max_hz: 60 } }, async (page) => {
  const differences = await page.evaluate(() => new Promise((resolve) => {
    const found = [];
    const text = (selector) => document.querySelector(selector).textContent;
    const look = (left) => {
      const card = text("#force-applied"), legend = document.querySelectorAll("#plot-force dd")[1].textContent;
      if (Math.abs(Number(card) - parseFloat(legend)) > 0.011) found.push(`${card} and ${legend}`);
      if (left > 0) requestAnimationFrame(() => look(left - 1));
      else resolve(found);
    };
    look(90);
  }));
  assert.deepEqual(differences, []);

  await at_most("silence until the force is withdrawn, ms", 200, async () => {
    const withdrawn = page.evaluate(() => new Promise((resolve) => {
      const look = () => {
        const legend = document.querySelectorAll("#plot-force dd")[1].textContent;
        if (document.querySelector("#force-applied").textContent === "–" && legend === "–") resolve(1000 * window.__test.nodes.device.silence_s);
        else requestAnimationFrame(look);
      };
      look();
    }));
    server.world.alive.device = false;
    const silence_ms = await withdrawn;
    server.world.alive.device = true;
    await until(page, (t) => t.nodes.device.is_alive, "its return");
    return silence_ms;
  });
});

page_test("without viewer.control no tissue can be changed and no device acknowledged; markers and recordings are asked for", {}, async (page) => {
  await page.locator("#control").waitFor({ state: "hidden" });
  server.world.device = { phase: 5, deviceFaults: 1n, lastFault: 3 };
  await until(page, (t) => t.device_phase === 5, "a device that waits");
  assert.equal(await page.getByRole("button", { name: "Acknowledge" }).count(), 0);
  await page.getByRole("button", { name: "Marker" }).click();
  await until(page, (t) => t.events.some(({ text }) => text === "marker 1"), "the marker");
  await page.keyboard.press("m");
  await until(page, () => server.world.requests.length === 2, "the marker of the key");
  await until_text(page, "banners", /Marked: marker 1/);
  // which is no fault, and does not look like one
  assert.deepEqual(await tones(page), ["calm"]);
  assert.deepEqual(await violations(page), []);
  await page.getByRole("textbox", { name: /Text of the next marker/ }).fill("first cut");
  await page.keyboard.press("Enter");
  await until(page, (t) => t.events.some(({ text }) => text === "first cut"), "the marker with a text");

  await page.getByRole("button", { name: "Record" }).click();
  await until(page, (t) => t.recorder.isRecording, "a recording");
  await page.locator("#record", { hasText: /^Stop recording 0:00$/ }).click();
  await until(page, (t) => !t.recorder.isRecording, "its end");
  server.world.recorder = { ...server.world.recorder, problem: "disk full" };
  await until_text(page, "banners", /recording failed: disk full/);
  assert.equal((await tones(page))[0], "alarm");
  assert.deepEqual(server.world.requests.map(({ marker, isRecording }) => marker ?? isRecording), ["", "", "first cut", true, false]);
});

page_test("a replay has a badge, time, speed and scrubber, and offers no touch", {}, async (page) => {
  server.world.replay = { ...kReplay };
  server.world.markers = [{ atNs: 22000000000n, text: "first cut", origin: "page" }];
  await until(page, (t) => t.replay?.positionS === 12, "the replay");
  await until_shown(page, "#replay", /Replay[^]*0:12 \/ 1:03/);
  for (const hidden of ["#touch", "#record", "#marker", "#control"]) await page.locator(hidden).waitFor({ state: "hidden" });
  assert.equal(await page.locator("#replay .name").innerText(), "a_recording_with_a_long_name_of_its_own.mcap");
  assert.equal(await page.locator("#replay .name").getAttribute("title"), kReplay.file);
  assert.equal(await page.getByRole("button", { name: "Marker at 0:21: first cut" }).getAttribute("title"), "0:21 first cut");

  const { x, y } = await tool_on_screen(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x, y + 60, { steps: 3 });
  await page.mouse.up();
  await until_text(page, "announcement", /^$/); // “You hold the hand.” to no one
  assert.equal(server.world.targets.length, 0);

  await page.getByRole("button", { name: "Marker at 0:21: first cut" }).focus();
  await page.keyboard.press("Enter");
  await until(page, (t) => t.replay.positionS === 21, "the marker's place");
  await page.getByRole("slider", { name: "Position in the recording" }).fill("40");
  await until(page, (t) => t.replay.positionS === 40, "the place sought");
  await page.getByRole("combobox", { name: "Speed" }).selectOption("0.25");
  await until(page, (t) => t.replay.speedRatio === 0.25, "the speed");
  await page.getByRole("button", { name: "Pause the replay" }).click();
  await until(page, (t) => t.replay.isPaused, "a pause");
  // nothing is reported as gone while it stands still
  const at = performance.now();
  await until(page, () => performance.now() - at > 1600, "a while");
  await until(page, (t) => Object.values(t.nodes).every(({ is_alive }) => is_alive), "nodes that are not gone");
  await until_text(page, "banners", /^$/);
  await page.getByRole("button", { name: "Play", exact: true }).click();
  await until(page, (t) => !t.replay.isPaused, "motion");
  // nor where it has ended, for a page that comes then, too
  Object.assign(server.world.replay, { positionS: kReplay.lengthS, isPaused: false });
  server.world.alive = { device: false, mofc: false, physics: false };
  server.world.gone = ["device", "mofc", "physics"];
  await until(page, (t) => t.replay.positionS === kReplay.lengthS, "the end");
  const late = await open(browser, server.url, { ...kSmall, wait: false });
  await until(late, (t) => t.is_connected && t.replay, "the replay");
  const end = performance.now();
  for (const one of [page, late]) {
    await one.evaluate(() => {
      window.banners_of_end = [];
      new MutationObserver(() => window.banners_of_end.push(document.getElementById("banners").textContent))
        .observe(document.getElementById("banners"), { childList: true, characterData: true, subtree: true });
    });
  }
  await until(page, () => performance.now() - end > 3000, "a while");
  for (const one of [page, late]) {
    assert.equal(await words(one, "banners"), "");
    assert.deepEqual(await one.evaluate(() => window.banners_of_end), []);
  }
  await late.context().close();
  Object.assign(server.world, { alive: { device: true, mofc: true, physics: true }, gone: [], replay: undefined });
  await page.locator("#replay").waitFor({ state: "hidden" });
});

const kTask = { phase: 0, briefing: "Find the lump.\nPress firmly.", kind: 1, elapsedS: 0, timeS: 60, marks: 0, findings: [], figures: [] };

page_test("a task is done with the mouse: briefing, start, marks, stop, score in plain words", {}, async (page) => {
  await page.locator("#task").waitFor({ state: "hidden" });
  server.world.task = { ...kTask };
  await until_shown(page, "#task", /Your task[^]*Find the lump\.\nPress firmly\.[^]*You have 1:00/);
  await page.locator("#marker").waitFor({ state: "hidden" }); // a find has its own button
  await page.locator("#task-find").waitFor({ state: "hidden" });
  await page.getByRole("button", { name: "Start" }).click();
  await page.locator("#task .map-key", { hasText: /^search here\s*$/ }).waitFor();
  server.world.task.elapsedS = 12;
  await until_shown(page, "#task", /0:48 left · 0 finds marked/);
  await page.getByRole("button", { name: "Mark a find (M)" }).click();
  await until_shown(page, "#task", /1 find marked/);
  await press_stop(page);
  await until_shown(page, "#task", /Score[^]*Found 1 of 2\.[^]*You pressed too lightly[^]*81\.0 %/);
  assert.equal(await page.locator("#task button:visible").count(), 0);
  // on the organ: what was searched
  await until(page, (t) => t.task_map?.places === 2500 && t.task_map.searched === 1250, "the map");
  await page.locator("#task .map-key", { hasText: /pressed\s*not pressed\s*lesion, found\s*lesion, not found/ }).waitFor();
  // and the force over the whole task, with its limit, the mark, and a gap where telemetry is missing
  await page.getByRole("img", { name: "Force over the task, 0 to 2.5 N in 0:30: at most 2.50 N." }).waitFor();
  await page.locator("#task .trace", { hasText: "dashed: the limit of 2.0 N; upright: your marks" }).waitFor();
  const traced = await page.locator("#task .trace path").getAttribute("d");
  assert.equal(traced.match(/M/g).length, 2);
  assert.equal(traced.match(/[ML]/g).length, 290);
  server.world.task = undefined;
  await page.locator("#task").waitFor({ state: "hidden" });
  await until(page, (t) => t.task_map === null, "no map without a task that has ended");
});

page_test("what a task says itself is no banner; a marker in a task without marks is", {}, async (page) => {
  await until_text(page, "banners", /^$/);
  server.world.task = { ...kTask };
  await page.evaluate(() => {
    window.seen_banners = [];
    new MutationObserver(() => window.seen_banners.push(document.getElementById("banners").textContent))
      .observe(document.getElementById("banners"), { childList: true, characterData: true, subtree: true });
  });
  await page.getByRole("button", { name: "Start" }).click();
  await page.getByRole("button", { name: "Mark a find (M)" }).click();
  const said = page.locator("#task [role=status]");
  await said.filter({ hasText: /^Mark 1 set\.$/ }).waitFor({ state: "attached" });
  await press_stop(page);
  await until_shown(page, "#task", /Score/);
  assert.equal(server.world.markers.length, 3);
  server.world.task = { ...kTask, kind: 0, phase: 1 };
  await page.getByRole("button", { name: "Marker" }).click();
  await until_text(page, "banners", /^Marked: marker 1$/);
  assert.deepEqual(await tones(page), ["calm"]);
  assert.deepEqual(await page.evaluate(() => window.seen_banners), ["Marked: marker 1"]);
  server.world.task = undefined;
});

page_test("one press of Stop ends no task: it asks once more, for some seconds, and nothing else begins with Stop", {}, async (page) => {
  server.world.recorder = { ...server.world.recorder, isPossible: true, isRecording: true, lengthS: 3 };
  server.world.task = { ...kTask, phase: 1 };
  const stop = page.getByRole("button", { name: "Stop", exact: true });
  await stop.waitFor();
  await page.getByRole("button", { name: "Stop recording 0:03" }).waitFor();
  const said = page.locator("#task [role=status]");
  await stop.dblclick(); // as one press
  await said.filter({ hasText: "Press Stop again within 6 seconds to end the task." }).waitFor({ state: "attached" });
  await page.getByRole("button", { name: "Stop: press again" }).waitFor();
  assert.deepEqual(await violations(page), []);
  await said.filter({ hasText: "Not confirmed: the task goes on." }).waitFor({ state: "attached" });
  await stop.waitFor();
  assert.equal(server.world.task.phase, 1);
  // a key that is held down is one press
  await stop.focus();
  await page.keyboard.down("Enter");
  await page.locator("#task-stop[data-asks=ready]").waitFor();
  await page.keyboard.down("Enter");
  await page.keyboard.down("Enter");
  assert.equal(server.world.task.phase, 1);
  await page.keyboard.up("Enter");
  await page.keyboard.press("Enter");
  await until_shown(page, "#task", /Score/);
  server.world.task = undefined;
});

const kByPerson = { ...kTask, phase: 1, isStartedByPerson: true };
const kWatcher = { width: 390, height: 844, touch: true };
page_test("who only watches the task of a person marks and stops nothing until he takes part", {}, async (page) => {
  server.world.task = { ...kTask, isStartedByPerson: true };
  const watcher = await open(browser, server.url, kWatcher);
  await page.getByRole("button", { name: "Start" }).click();
  await page.locator("#task-find").waitFor();
  await page.locator("#task-stop").waitFor();
  assert.equal(await page.locator("#task-join").isVisible(), false);
  const join = watcher.getByRole("button", { name: "Take part" });
  await join.waitFor();
  const buttons = () => watcher.locator("#task button:visible").allInnerTexts();
  assert.deepEqual(await buttons(), ["Take part"]);
  await watcher.keyboard.press("m");
  await page.keyboard.press("m");
  await until_shown(watcher, "#task", /1 find marked/);
  assert.equal(server.world.task.marks, 1);
  assert.ok((await join.boundingBox()).height >= 44);
  assert.deepEqual(await violations(watcher), []);
  // a reload changes nothing for either
  await watcher.reload();
  await join.waitFor();
  await page.reload();
  await page.locator("#task-stop").waitFor();
  await join.focus();
  await watcher.keyboard.press("Enter");
  await watcher.locator("#task-find:focus").waitFor();
  assert.deepEqual(await buttons(), ["Mark a find (M)", "Stop"]);
  await watcher.reload();
  await press_stop(watcher);
  await until_shown(page, "#task", /Score/);
  await watcher.context().close();

  // a task that began by itself is everybody's
  server.world.task = { ...kTask, phase: 1 };
  const other = await open(browser, server.url, kSmall);
  await other.locator("#task-stop").waitFor();
  assert.equal(await other.locator("#task-join").isVisible(), false);
  await other.context().close();
  server.world.task = undefined;
});

page_test("who leads the hand takes part in the task", {}, async (page) => {
  server.world.task = { ...kByPerson };
  await page.evaluate(() => sessionStorage.clear());
  await page.reload();
  await page.getByRole("button", { name: "Take part" }).waitFor();
  await rest_tool_at(page, 0.02);
  await page.locator("#canvas").focus();
  await page.keyboard.press("t");
  await page.keyboard.press("ArrowDown");
  await page.locator("#task-stop").waitFor();
  assert.equal(await page.locator("#task-join").isVisible(), false);
  await page.keyboard.press("Escape");
  server.world.task = undefined;
});

page_test("what was searched is seen on the organ", { page: kPicture }, async (page) => {
  await rest_tool_at(page, 0.02);
  server.world.task = { ...kTask, phase: 1 };
  await page.locator("#task-stop").waitFor();
  const before = await picture(page);
  await press_stop(page);
  await until(page, (t) => t.task_map?.searched > 0, "the map");
  await page.locator("#task-title", { hasText: "Score" }).waitFor();
  await drawn(page);
  const colour_of = (png, [r, g, b]) => {
    let count = 0;
    for (let i = 0; i < png.pixels.length; i += png.channels) {
      if (Math.abs(png.pixels[i] - r) + Math.abs(png.pixels[i + 1] - g) + Math.abs(png.pixels[i + 2] - b) < 12) count += 1;
    }
    return count;
  };
  const after = await picture(page);
  for (const colour of [[0xd9, 0x5f, 0x02], [0x3a, 0x86, 0xc8]]) assert.ok(colour_of(after, colour) > colour_of(before, colour) + 300, `${colour}: ${colour_of(after, colour)}`);
  server.world.task = undefined;
});

page_test("a task is done with the keyboard alone, and said to a screen reader", {}, async (page) => {
  server.world.task = { ...kTask };
  const start = page.getByRole("button", { name: "Start" });
  await start.waitFor();
  const region = page.getByRole("region", { name: "Your task" });
  assert.equal(await region.count(), 1);
  await start.focus();
  await page.keyboard.press("Enter");
  const said = page.locator("#task [role=status]");
  await said.filter({ hasText: "The task has started." }).waitFor({ state: "attached" });
  // the button that was used has gone: the keyboard is where one goes on
  await page.locator("#task-find:focus").waitFor();
  // and from there arrows lead the hand
  await until(page, (t) => t.hand.is_allowed, "a hand");
  const { sent } = (await status(page)).hand;
  await page.keyboard.press("ArrowRight");
  await until(page, (t) => t.hand.is_held && t.hand.sent > sent, "a hand that moves");
  await page.keyboard.press("Escape");
  await until(page, (t) => !t.hand.is_held, "a hand that is released");
  await page.keyboard.press("m");
  await said.filter({ hasText: "Mark 1 set." }).waitFor({ state: "attached" });
  await page.getByRole("button", { name: "Stop" }).focus();
  await press_stop(page, async (stop) => {
    await stop.waitFor();
    await page.keyboard.press(" ");
  });
  await said.filter({ hasText: "The task has ended. Found 1 of 2." }).waitFor({ state: "attached" });
  await page.locator("#task-title:focus").waitFor();
  await page.keyboard.press("m"); // nothing is marked after the end
  assert.equal(server.world.task.marks, 1);
  server.world.task = undefined;
});

const until_closed = (page) => page.locator("body.is-plain").waitFor();
const all_text = (page) => page.evaluate(() => document.body.innerText);
const kExperts = /mofc|guard|fallback|requested|bound|ledger|transparency|lateness|credit|clamp|Events|Since the start/i;
// a slow machine may lose a node for a moment, which is told by name
async function until_plain(page) {
  for (const end = performance.now() + kLimit.timeout / 3; kExperts.test(await all_text(page)) && performance.now() < end;) await page.waitForTimeout(20);
  assert.doesNotMatch(await all_text(page), kExperts);
}

page_test("with a task what experts read waits behind Details: by mouse and keyboard, remembered", {}, async (page) => {
  await until_shown(page, "#session", /^mock\s*mofc guard$/);
  const details = page.getByRole("button", { name: "Details" });
  assert.equal(await details.count(), 0); // without a task all is shown
  assert.match(await all_text(page), /ledger/i);
  server.world.task = { ...kTask };
  await until_closed(page);
  await until_plain(page);
  assert.doesNotMatch(await page.locator("#session").getAttribute("title"), /mofc|guard/);
  assert.equal(await details.getAttribute("aria-expanded"), "false");
  assert.equal(await page.locator("#plots").isVisible(), false);

  await details.focus();
  await page.keyboard.press("Enter");
  await page.locator("#plots").waitFor();
  await until_shown(page, "#session", /^mock\s*mofc guard$/);
  assert.equal(await details.getAttribute("aria-expanded"), "true");
  const { plots, now_s } = await status(page);
  await until(page, (t) => t.now_s > now_s + 1 && t.plots.lateness_total > plots.lateness_total, "plots that go on");
  assert.deepEqual(await violations(page), []);
  await page.reload();
  await page.locator("#plots").waitFor();
  await until_shown(page, "#session", /^mock\s*mofc guard$/);

  await details.click();
  await until_closed(page);
  await page.reload();
  await until_closed(page);
  await until(page, (t) => t.scene && t.device_ticks > 0, "the scene");
  await until_plain(page);
  server.world.task = undefined;
  await page.locator("#plots").waitFor(); // as without a task from the beginning
  await until_shown(page, "#session", /^mock\s*mofc guard$/);
});

page_test("the torque of a wrist is told and drawn, and nothing of it without one", {}, async (page) => {
  await rest_tool_at(page, -0.004);
  await until(page, (t) => t.applied_newton > 0.3, "a force");
  for (const id of ["torque", "plot-torque"]) assert.equal(await page.locator(`#${id}`).isVisible(), false);
  server.world.wrist_arm_m = 0.1;
  await page.locator("#plot-torque").waitFor();
  await until_text(page, "torque", /^0\.\d\d\d N·m torque$/);
  const { applied_newton, applied_newton_m } = await until(page, (t) => t.plots.torque[0].newest > 0 && t.plots.torque[1].points > 5, "curves of torque");
  assert.ok(Math.abs(applied_newton_m - 0.1 * applied_newton) < 1e-9);
  assert.match(await page.locator("#plot-torque dd").first().innerText(), /^0\.\d\d\d N·m$/);
  await page.locator("#plot-force").getByRole("radio", { name: "x" }).click(); // the force is along z, and turns about x
  await until(page, (t) => t.plots.force[1].newest === 0 && t.plots.torque[1].newest > 0, "components");
  await page.locator("#plot-force").getByRole("radio", { name: "z" }).click();
  await until(page, (t) => t.plots.force[1].newest > 0 && t.plots.torque[1].newest === 0, "others");
  assert.deepEqual(await violations(page), []);
  server.world.wrist_arm_m = 0;
  await page.locator("#torque").waitFor({ state: "hidden" });
  await page.locator("#plot-force").getByRole("radio", { name: "|F|" }).click();
});

page_test("what experts read goes with the first word of a task, however seldom pictures are drawn", { page: { max_hz: 2 } }, async (page) => {
  await rest_tool_at(page, -0.004);
  await until_text(page, "state", /clamp/i);
  server.world.task = { ...kTask };
  await until_closed(page);
  assert.doesNotMatch(await words(page, "state"), kExperts);
  server.world.task = undefined;
});

page_test("with details closed a clamped force is a contact; faults, no force and lost nodes are told", {}, async (page) => {
  server.world.task = { ...kTask, phase: 1 };
  await until_closed(page);
  await rest_tool_at(page, -0.004);
  await until(page, (t) => t.state.id === "clamped" || t.state.id === "exhausted", "a clamped force");
  await until_text(page, "state-title", /^Contact$/);
  await until_plain(page);
  server.world.alive.physics = false;
  await until_text(page, "state-title", /^No force$/);
  await until_text(page, "banners", /physics_node \(the tissue\) is gone/);
  server.world.alive.physics = true;
  await until_text(page, "banners", /^$/);
  server.world.alive.mofc = false;
  await until_text(page, "state-title", /^No force$/);
  server.world.alive.mofc = true;
  server.world.device = { phase: 5, deviceFaults: 1n, lastFault: 3 };
  await until_text(page, "state-title", /^Contact$/);
  server.world.task = undefined;
});

page_test("a running task on a phone: the organ has 45 % of the height, and what one needs is above the fold", { page: { width: 390, height: 844, touch: true } }, async (page) => {
  const within = async (selector) => {
    const { x, y, width, height } = await page.locator(selector).boundingBox();
    assert.ok(x >= 0 && y >= 0 && x + width <= 390 && y + height <= 844, `${selector}: ${x}, ${y}, ${width} × ${height}`);
    return { x, y, width, height };
  };
  for (const kind of [1, 2, 3]) {
    const goal = kind === 3 ? { targetM: { x: 0, y: 0, z: 0.02 }, toleranceM: 0.004, holdS: 5, heldS: 0, isHolding: false, isAtTarget: false } : undefined;
    server.world.task = { ...kTask, kind, goal, phase: 1, briefing: "Press firmly, place by place. ".repeat(12) };
    await page.locator("#task-stop").waitFor();
    await until_closed(page);
    await page.locator("#task-find").waitFor({ state: kind === 3 ? "hidden" : "visible" });
    await until(page, (t) => t.hand.is_allowed, "the hand");
    await drawn(page);
    assert.equal(await page.evaluate(() => scrollY), 0);
    const organ = await within("#canvas");
    assert.ok(organ.height >= 0.45 * 844, `the organ has ${organ.height} px`);
    for (const one of kind === 3 ? ["#task .progress", "#task-stop", "#touch-toggle"] : ["#task .progress", "#task-find", "#task-stop", "#touch-toggle"]) await within(one);
    // no card lies on the organ
    for (const card of ["#state", "#touch"]) {
      const box = await page.locator(card).boundingBox();
      assert.ok(box.y + box.height <= organ.y + 0.5 || box.y >= organ.y + organ.height - 0.5, `${card} covers the organ`);
    }
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
    assert.deepEqual(await violations(page), []);
    // the briefing can be read again
    assert.equal(await page.locator("#task .briefing p").isVisible(), false);
    await page.locator("#task summary").click();
    await page.locator("#task .briefing p").waitFor();
    for (const one of ["#task .progress", "#task-stop"]) await within(one);
    server.world.task = undefined;
    await page.locator("#task").waitFor({ state: "hidden" });
  }
});

page_test("a task fits a phone, and its buttons a finger", { page: { width: 390, height: 844, touch: true } }, async (page) => {
  for (const phase of [0, 1, 2]) {
    server.world.task = { ...kTask, phase, briefing: "Press firmly, place by place. ".repeat(12), findings: [`${kLong}: missed.`], figures: [{ label: "force over " + kLong, value: "0.73 N median, 0.80 N at 95 %, 0.82 N at most" }] };
    await until_shown(page, "#task", phase === 0 ? /Start/ : phase === 1 ? /Stop/ : /Score/);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `phase ${phase} overflows`);
    for (const button of await page.locator("#task button:visible").all()) {
      const { width, height } = await button.boundingBox();
      assert.ok(width >= 44 && height >= 44, `${await button.innerText()}: ${width} × ${height}`);
    }
  }
  server.world.task = undefined;
});

page_test("recordings are listed and downloaded, by the keyboard too", {}, async (page) => {
  const summary = page.locator("#recordings summary");
  await summary.focus();
  await page.keyboard.press("Enter");
  await until_shown(page, "#recordings", /None yet/);
  // a new one is listed once it has ended
  server.world.recordings = [{ name: "mock-20261128-010203.mcap", bytes: 1234567, modified_s: 1.7e9 }];
  server.world.recorder = { isPossible: true, isRecording: false, file: "mock-20261128-010203.mcap", lengthS: 3, problem: "" };
  await until_shown(page, "#recordings", /mock-20261128-010203\.mcap 1\.23 MB/);
  const download = page.waitForEvent("download");
  await page.locator("#recordings a").focus();
  await page.keyboard.press("Enter");
  assert.equal((await download).suggestedFilename(), "mock-20261128-010203.mcap");
  server.world.recordings = [];
  server.world.recorder = { isPossible: true, isRecording: false, file: "", lengthS: 0, problem: "" };
});

page_test("with a needle the button says that the resistance is lost", {}, async (page) => {
  server.world.task = { ...kTask, kind: 2, briefing: "Push the needle down.", phase: 1 };
  await page.getByRole("button", { name: "The resistance is lost (M)" }).click();
  await until_shown(page, "#task", /loss of resistance marked/);
  await page.locator("#task [role=status]", { hasText: "Loss of resistance marked." }).waitFor({ state: "attached" });
  await page.locator("#marker").waitFor({ state: "hidden" });
  server.world.task = undefined;
});

page_test("with traction the page shows the target and says how far it is", {}, async (page) => {
  const goal = { targetM: { x: 0, y: 0, z: 0.02 }, toleranceM: 0.004, holdS: 5, heldS: 0, isHolding: false, isAtTarget: false };
  server.world.task = { ...kTask, kind: 3, briefing: "Lift the tissue.", phase: 1, goal };
  await until_shown(page, "#task", /take hold of the tissue · held for 0\.0 of 5 s/);
  await page.locator("#task-find").waitFor({ state: "hidden" });
  await page.locator("#task-stop").waitFor();
  await drawn(page);
  const ball = await picture(page);
  const said = page.locator("#task [role=status]");
  server.world.task = { ...server.world.task, goal: { ...goal, isHolding: true } };
  await said.filter({ hasText: "The tissue is held." }).waitFor({ state: "attached" });
  server.world.task = { ...server.world.task, goal: { ...goal, isHolding: true, isAtTarget: true, heldS: 1.2 } };
  await said.filter({ hasText: "At the target: hold it." }).waitFor({ state: "attached" });
  await until_shown(page, "#task", /at the target: hold it · held for 1\.2 of 5 s/);
  server.world.task = { ...server.world.task, goal: { ...goal, isHolding: true, isAtTarget: true, heldS: 5 } };
  await said.filter({ hasText: "Held for long enough." }).waitFor({ state: "attached" });
  await until_shown(page, "#task", /held for 5\.0 of 5 s: done/);
  server.world.task = undefined;
  await page.locator("#task").waitFor({ state: "hidden" });
  await drawn(page);
  const without = await picture(page);
  let changed = 0;
  for (let i = 0; i < ball.pixels.length; i += ball.channels) if (Math.abs(ball.pixels[i] - without.pixels[i]) > 30) changed += 1;
  assert.ok(changed > 30, `the ball is drawn: ${changed} pixels`);
});

page_test("in a replay a task offers nothing to press", {}, async (page) => {
  server.world.replay = { ...kReplay };
  server.world.task = { ...kTask, phase: 1 };
  await until(page, (t) => t.replay, "the replay");
  await until_shown(page, "#task", /left/);
  await page.locator("#task-find").waitFor({ state: "hidden" });
  assert.equal(await page.locator("#task button:visible").count(), 0);
  server.world.replay = undefined;
  server.world.task = undefined;
});

page_test("See inside shows the tool within tissue, and the view turns about the tool", { page: kPicture }, async (page) => {
  await rest_tool_at(page, -0.03); // in the block
  server.world.dent = { x: 1, y: 1, z: 1 }; // whose top stays flat
  await until(page, (t) => t.scene.tissues[0].displacement_m === 0, "a flat top");
  await drawn(page);
  const seen = await picture(page);
  await page.getByRole("button", { name: "See inside" }).click();
  await until_pixels_change(page, seen, 300, "opaque tissue");
  await page.getByRole("button", { name: "See inside" }).click();

  await page.getByRole("button", { name: "Tool", exact: true }).click();
  const { width, height } = await page.locator("#canvas").boundingBox();
  const near = (t) => Math.hypot(t.tool_px.x - width / 2, t.tool_px.y - height / 2) < 3;
  await until(page, near, "the tool in the middle");
  await page.locator("#canvas").focus();
  for (let i = 0; i < 3; ++i) await page.keyboard.press("ArrowLeft");
  await until(page, near, "the tool still in the middle");
});

page_test("Reach draws the box that the tool reaches", { page: kPicture }, async (page) => {
  await rest_tool_at(page, 0.01);
  server.world.dent = { x: 1, y: 1, z: 1 };
  await until(page, (t) => t.scene.tissues[0].displacement_m === 0, "a flat top");
  await drawn(page);
  const without = await picture(page);
  await page.getByRole("button", { name: "Reach" }).click();
  await until_pixels_change(page, without, 300, "the box");
  await page.getByRole("button", { name: "Reach" }).click();
  await page.getByRole("button", { name: "Reach", pressed: false }).waitFor();
});

page_test("without physics no words deny the force that is still requested", {}, async (page) => {
  await rest_tool_at(page, -0.004);
  await until(page, (t) => t.requested_newton > 1, "a force");
  server.world.alive.physics = false;
  await until(page, (t) => t.state.id === "no_physics", "the loss of physics");
  const shown = await until(page, (t) => t.state.id === "no_physics" && t.requested_newton < 0.005, "the end of the request");
  assert.match(shown.state.detail, /no force is requested/);
  await until_text(page, "force-requested", /^0\.00$/);
  server.world.alive.mofc = false; // nothing is known of its request
  await until_text(page, "force-requested", /^–$/);
});

for (const dark of [false, true]) {
  page_test(`all text has a contrast of 4.5 at least, ${dark ? "dark" : "light"}`, { world: { has_control: true }, page: { dark } }, async (page) => {
    server.write_log("device_node", 'event=device_fault reason="the position jumped" count=1', 4);
    server.write_log("mofc_node", "event=clamped_began", 3);
    server.world.replay = { ...kReplay };
    server.world.recorder = { ...server.world.recorder, problem: "disk full" };
    server.world.task = { ...kTask, phase: 2, findings: ["Found 1 of 2."], figures: [{ label: "time", value: "30.0 s" }] };
    await until(page, (t) => t.replay && t.events.length > 1, "all there is to read");
    await page.getByRole("button", { name: "Details" }).click();
    const poor = [];
    for (const alive of [true, false]) {
      server.world.alive.physics = alive;
      await until(page, (t) => t.nodes.physics.is_alive === alive, "the node");
      await drawn(page);
      const found = await page.evaluate(contrasts);
      assert.ok(found.length > 60, `${found.length} texts`);
      poor.push(...found.filter(({ contrast }) => !(contrast >= 4.5)));
      server.world.replay = undefined; // with the hand’s panel and the buttons
      server.world.task = { ...kTask, phase: 1 };
      await page.locator("#replay").waitFor({ state: "hidden" });
    }
    await page.getByRole("button", { name: "Details" }).click();
    await until_closed(page);
    await drawn(page);
    poor.push(...(await page.evaluate(contrasts)).filter(({ contrast }) => !(contrast >= 4.5)));
    assert.deepEqual(poor, []);
    server.world.task = undefined;
  });
}
// Of each visible text: its contrast by WCAG 2.2 against the worst of what may lie behind it.
function contrasts() {
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const rgba = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = ([r, g, b, a], under) => [r, g, b].map((c, i) => a * c + (1 - a) * under[i]);
  const luminance = (colour) => {
    const [r, g, b] = colour.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const contrast = (a, b) => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const root = getComputedStyle(document.documentElement);
  const named = (name) => rgba(root.getPropertyValue(name).trim()).slice(0, 3);
  const tissue = ["#d8968a", "#7d3f4a"].map((colour) => rgba(colour).slice(0, 3));
  const scene = [named("--scene"), named("--grid"), ...tissue];
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const element = node.parentElement;
    const { width, height } = element.getBoundingClientRect();
    if (!node.textContent.trim() || width < 2 || height < 2 || !element.checkVisibility()) continue;
    // layers above the nearest opaque one
    let behind = null;
    const layers = [];
    for (let at = element; at && !behind; at = at.parentElement) {
      const colour = rgba(getComputedStyle(at).backgroundColor);
      if (colour[3] === 1) behind = at.id === "scene" ? scene : [colour.slice(0, 3)];
      else if (colour[3] > 0) layers.unshift(colour);
    }
    const style = getComputedStyle(element);
    const ink = rgba(element instanceof SVGElement ? style.fill : style.color);
    const worst = Math.min(...behind.map((under) => {
      const background = layers.reduce((below, layer) => over(layer, below), under);
      return contrast(over(ink, background), background);
    }));
    found.push({ text: node.textContent.trim().slice(0, 30), place: `${element.tagName}.${element.className?.baseVal ?? element.className} in #${element.closest("[id]")?.id}`, contrast: Math.round(100 * worst) / 100 });
  }
  // drawn into canvases
  found.push({ text: "axes", place: "plots", contrast: contrast(named("--faint"), named("--sheet")) });
  return found;
}

page_test("long names are cut, with the whole name as a tooltip; a phone shows the tissues", { world: { names: [kLong, "cyst"], has_control: true }, page: { width: 390, height: 844, touch: true } }, async (page) => {
  const name = page.locator("#tissues .name").first();
  await name.waitFor();
  assert.equal(await name.getAttribute("title"), kLong);
  const is_cut = await name.evaluate((element) => element.scrollWidth > element.clientWidth && getComputedStyle(element).textOverflow === "ellipsis");
  assert.ok(is_cut);
  assert.equal(await page.locator("#control .name").first().getAttribute("title"), kLong);
  const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  assert.ok(overflow <= 0, `${overflow} px too wide`);
});

page_test("late pages see the same scene within a second", { page: kSmall }, async (first) => {
  await rest_tool_at(first, -0.006);
  const reference = await until(first, (t) => t.scene.tissues[0].displacement_m > 0.008, "a dent");
  const signature = await scene_signature(first);

  await late_pages(browser, server.url, kSmall, async (page) => {
    const begin = performance.now();
    const now = await until(page, (t) => t.scene?.tissues[0].displacement_m > 0.008, "scene and dent");
    const took_ms = performance.now() - begin;
    assert.equal(await scene_signature(page), signature);
    assert.equal(now.scene.revision, reference.scene.revision);
    assert.deepEqual(now.scene.tissues.map((t) => t.displacement_m.toFixed(5)), reference.scene.tissues.map((t) => t.displacement_m.toFixed(5)));
    return took_ms;
  });
});

page_test("one page holds the hand; another says so and moves nothing", { page: kSmall, count: 2 }, async (first, second) => {
  await rest_tool_at(first, 0.02);
  const from = await tool_on_screen(first);
  await first.mouse.move(from.x, from.y);
  await first.mouse.down();
  await until(second, (t) => t.hand.is_others, "the other holder");
  await until_text(second, "touch-words", /Another page holds the hand/);

  const there = await tool_on_screen(second);
  await second.mouse.move(there.x, there.y);
  await second.mouse.down();
  await second.mouse.move(there.x, there.y + 50);
  await second.mouse.up();
  const { hand } = await status(second);
  assert.equal(hand.sent, 0);
  assert.ok(server.world.targets.every(({ client }) => client === 1));
  await first.mouse.up();
  await until(second, (t) => !t.hand.is_others, "a free hand");
});

page_test("two pages that grab at once: the later one lets go", { page: kSmall, count: 2 }, async (first, second) => {
  await rest_tool_at(first, 0.02);
  const from = await tool_on_screen(first);
  for (const page of [first, second]) {
    await page.mouse.move(from.x, from.y);
    await page.mouse.down();
  }
  await until(second, (t) => t.hand.is_others && !t.hand.is_held, "the second page to let go");
  const before = (await status(second)).hand.sent;
  await second.mouse.move(from.x + 40, from.y);
  await second.waitForTimeout(200);
  assert.equal((await status(second)).hand.sent, before);
  await until(first, (t) => t.hand.is_mine, "the hand held by the first page");
});

page_test("a finger drags the tool on a phone", { page: { width: 390, height: 844, scale: 1, touch: true } }, async (page) => {
  await rest_tool_at(page, 0.02);
  const { x, y } = await tool_on_screen(page);
  const devtools = await page.context().newCDPSession(page);
  const finger = (type, at) => devtools.send("Input.dispatchTouchEvent", { type, touchPoints: at ? [at] : [] });
  await finger("touchStart", { x: x + 12, y: y + 12 });
  await finger("touchMove", { x: x + 12, y: y + 60 });
  await until(page, (t) => t.hand.is_held && t.target_m.z < 0.01, "a target below the tool");
  await finger("touchEnd");
  await until(page, (t) => !t.hand.is_held, "the release");
});

page_test("without permission the page offers no touch and sends nothing", { world: { has_pointer: false } }, async (page) => {
  await rest_tool_at(page, 0.02);
  await page.locator("#touch").waitFor({ state: "hidden" });

  const { x, y } = await tool_on_screen(page);
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x, y + 80, { steps: 4 });
  await page.mouse.up();
  await until(page, (t) => t.frames > 3, "pictures");
  assert.equal((await status(page)).hand.sent, 0);
  assert.equal(server.world.targets.length, 0);
});

page_test("dark and light, by preference and by choice", { page: { dark: true } }, async (page) => {
  const until_bar = (is_wanted, what) => until(page, () => true, what).then(async () => {
    for (let i = 0; i < 100; ++i) if (is_wanted((await picture(page, ".bar")).pixels[0])) return;
    assert.fail(what);
  });
  await until_bar((brightness) => brightness < 60, "a dark page");

  await page.getByRole("button", { name: "Light or dark" }).click();
  await until_bar((brightness) => brightness > 200, "a light page");
});

page_test("without WebGL the figures still run, and the page says so", { page: { has_webgl: false, wait: false } }, async (page) => {
  await until(page, (t) => t.plots.force[0].points > 20, "curves");
  await until_text(page, "no-webgl", /no WebGL/);
  assert.match(page.problems.join(), /^THREE\S+ THREE\S+ Error creating WebGL context\.$/);
});

page_test("the licences of bundled code can be read", { page: { wait: false } }, async (page) => {
  const licences = page.locator(".licences pre");
  assert.equal(await licences.isVisible(), false);
  await page.locator(".licences summary").click();
  await licences.waitFor({ state: "visible" });
  for (const text of [/three\.js authors/, /Leon Sorokin/, /Buf Technologies/, /Google Inc/]) assert.match(await licences.textContent(), text);
});

page_test("20 000 deforming vertices are taken at a small part of their period of 33 ms", { world: { vertices: 20000 }, page: { ...kSmall, max_hz: 60 } }, async (page) => {
  await until(page, (t) => t.mesh_frames > 5, "mesh frames");
  await at_most("20 000 vertices are taken, s", 0.010, async () => { // a third of the period
    const begin = await status(page);
    const sent = server.world.mesh_frames;
    const costs_s = [];
    // how many come through is a matter of the machine's drawing, by its processors where it has no other
    const end = await until(page, (t) => {
      costs_s.push(t.mesh_cost_s);
      return t.mesh_frames >= begin.mesh_frames + 50;
    }, "50 mesh frames");
    const sent_since = server.world.mesh_frames - sent;
    costs_s.sort((a, b) => a - b);
    const median_s = costs_s[costs_s.length >> 1];
    console.log(`20 000 vertices: ${end.mesh_frames - begin.mesh_frames} of ${sent_since} frames and ${end.frames - begin.frames} pictures ` +
      `in ${(end.now_s - begin.now_s).toFixed(1)} s, ${(1e3 * median_s).toFixed(2)} ms each (median; take, normals, colours), ` +
      `picture ${(1e3 * end.frame_cost_s).toFixed(1)} ms`);
    assert.ok(end.scene.tissues[0].vertices >= 20000);
    return median_s;
  });
});

// ---- several devices

const kTwo = { world: { sides: ["left", "right"] } };

page_test("of several sides only the one on display is subscribed to; the others are drawn, with their names", kTwo, async (page) => {
  await rest_tool_at(page, 0.01);
  assert.deepEqual(server.subscribed().filter((topic) => /left|right/.test(topic)), ["/left/device", "/left/mofc", "/left/physics"]);
  const first = await until(page, (t) => t.sides.right?.tool_m.x > 0.02, "the tool of the other side");
  assert.ok(Math.abs(first.tool_m.x - 0.01) < 1e-6);
  const right = page.locator(".tool-label", { hasText: "right" });
  await right.waitFor();
  const is_beside = async (label, at) => {
    const canvas = await page.locator("#canvas").boundingBox();
    const { x, y } = await label.boundingBox();
    return Math.hypot(x - canvas.x - 12 - at.x, y - canvas.y + 8 - at.y) < 4;
  };
  assert.ok(await is_beside(page.locator(".tool-label", { hasText: "left" }), (await status(page)).tool_px));

  await page.getByRole("radio", { name: "right" }).click();

  await until(page, (t) => t.shown_side === "right" && Math.abs(t.tool_m.x - 0.025) < 1e-6 && t.plots.force[1].points > 0, "the other side's figures");
  assert.deepEqual(server.subscribed().filter((topic) => /left|right/.test(topic)), ["/right/device", "/right/mofc", "/right/physics"]);
  await drawn(page);
  assert.ok(await is_beside(right, (await status(page)).tool_px));
  await page.getByRole("radio", { name: "left" }).click();
  await until(page, (t) => Math.abs(t.tool_m.x - 0.01) < 1e-6, "the first side again");
});

page_test("what is wrong with a hidden side is told, and its device is acknowledged", { world: { sides: ["left", "right"], has_control: true } }, async (page) => {
  server.world.faults = { right: 3 };
  await until_text(page, "banners", /right: fault, the motors are off until reset: the position jumped\./);
  await until_text(page, "announcement", /right: fault/);
  await page.locator("#acknowledge", { hasText: "right: Fault: the position jumped." }).waitFor();
  await page.getByRole("button", { name: "Acknowledge" }).click();
  await until(page, () => server.world.acknowledgements.length === 1, "the acknowledgement");
  assert.deepEqual(server.world.acknowledgements[0], { is_of_device: true, phase: 5, deviceFaults: 1n });
  server.world.faults = {};
  server.world.gone = ["right.mofc"];
  await until_text(page, "banners", /^right: mofc_node \(the clamp\) is gone: last heard 7\.0 s ago\.$/);
  server.world.gone = [];
  await until_text(page, "banners", /^$/);
});

page_test("Touch leads the hand of the side on display", kTwo, async (page) => {
  await rest_tool_at(page, 0.02);
  const drag = async () => {
    const { x, y } = await tool_on_screen(page);
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 10, y + 10, { steps: 3 });
    await until(page, (t) => t.hand.is_mine && t.hand.is_held, "the hand");
    await page.mouse.up();
    await until(page, (t) => !t.hand.is_held && !t.hand.is_mine, "the release");
  };
  await drag();
  assert.deepEqual([...new Set(server.world.targets.map(({ topic }) => topic))], ["/left/hand_target"]);
  await page.getByRole("radio", { name: "right" }).click();
  await until(page, (t) => t.shown_side === "right" && Number.isFinite(t.tool_m?.x) && t.device_ticks > 0, "the other side");
  await drag();
  assert.equal(server.world.targets.at(-1).topic, "/right/hand_target");
  assert.equal(server.world.targets.at(-1).is_released, true);
  await page.getByRole("radio", { name: "left" }).click();
  await until(page, (t) => t.shown_side === "left", "the first side again");
});

const kMany = Array.from({ length: 64 }, (_, i) => `station_${i + 1}`);
page_test("64 sides: one is chosen from a list, and the same of several is said once", { world: { sides: kMany }, page: { ...kSmall, max_hz: 30 } }, async (page) => {
  const list = page.getByRole("combobox", { name: "Side on display" });
  assert.equal(await list.locator("option").count(), 64);
  assert.equal(await page.getByRole("radio", { name: /station/ }).count(), 0);
  server.world.gone = kMany.slice(1, 41).map((side) => `${side}.device`);
  await until_text(page, "banners", /^station_2, station_3, station_4 and 37 more: device_node \(the motors\) is gone: last heard 7\.0 s ago\.$/);
  server.world.gone = [];
  await list.selectOption("station_64");
  await until(page, (t) => t.shown_side === "station_64" && Number.isFinite(t.tool_m?.x) && t.tool_m.x > 0.9, "the last side");

  const one = await start_mock_server();
  const alone = await open(browser, one.url, { ...kSmall, max_hz: 30 });
  try {
    await at_most("64 sides: processor time of the page, beside that of one with one device", 2, async () => {
      const share = await share_of(page), share_alone = await share_of(alone);
      const pages_mb = await renderers_mb();
      console.log(`64 sides: ${(100 * share).toFixed(0)} % of a processor (one device: ${(100 * share_alone).toFixed(0)} %), ${pages_mb.join(", ")} MB (of each process of a page)`);
      assert.ok(Math.max(...pages_mb) < 300);
      return share / share_alone;
    });
  } finally {
    await alone.context().close();
    await one.close();
  }
});
/** Processor time of a page's thread, of the time. */
async function share_of(page) {
  const devtools = await page.context().newCDPSession(page);
  await devtools.send("Performance.enable", { timeDomain: "threadTicks" });
  const thread_s = async () => (await devtools.send("Performance.getMetrics")).metrics.find(({ name }) => name === "ThreadTime").value;
  const begin_s = await thread_s(), begin_ms = performance.now();
  await page.waitForTimeout(3000);
  const share = (1e3 * (await thread_s() - begin_s)) / (performance.now() - begin_ms);
  await devtools.detach();
  return share;
}
/** Memory of its own of every process that the browser has for pages. */
async function renderers_mb() {
  const { processInfo } = await (await browser.newBrowserCDPSession()).send("SystemInfo.getProcessInfo");
  return processInfo.filter(({ type }) => type === "renderer").map(({ id }) =>
    Math.round(Number(/RssAnon:\s+(\d+) kB/.exec(readFileSync(`/proc/${id}/status`, "utf8"))[1]) / 1e3));
}

// ---- everybody

for (const [status_code, words] of [[401, /The address lacks the token/], [503, /accepts no further page/]]) {
  page_test(`a refused connection says why: ${status_code}`, { page: kSmall }, async (page) => {
    server.world.refusal = status_code;
    server.cut();
    await until_text(page, "banners", words);
    server.world.refusal = 0;
    await until(page, (t) => t.is_connected, "the connection");
    await until_text(page, "banners", /^$/);
  });
}

page_test("a page whose server is gone says so", { page: kSmall }, async (page) => {
  const port = Number(new URL(server.url).port);
  await server.close();
  await until_text(page, "banners", /Nothing answers at 127\.0\.0\.1/);
  server = await start_mock_server({ port });
  await until(page, (t) => t.is_connected && t.scene, "the connection");
});

test("where storage is blocked the page works", kLimit, async () => {
  await discard();
  server = await start_mock_server();
  const page = await open(browser, server.url, { ...kSmall, wait: false });
  await page.addInitScript(() => {
    for (const storage of ["localStorage", "sessionStorage"]) {
      Object.defineProperty(window, storage, { get() { throw new DOMException("blocked", "SecurityError"); } });
    }
  });
  await page.reload();
  await until(page, (t) => t.scene && t.device_ticks > 0, "scene and ticks");
  await page.locator("#theme").click();
  assert.equal(await page.locator("html").getAttribute("data-theme"), "dark");
  server.world.task = { ...kByPerson };
  await page.getByRole("button", { name: "Take part" }).click();
  await page.locator("#task-stop:visible").waitFor();
  server.world.task = undefined;
  assert.deepEqual(page.problems, []);
});

page_test("events are listed by kind", { page: kSmall }, async (page) => {
  server.write_log("device_node", 'event=device_fault reason="the position jumped" count=1', 4);
  server.write_log("mofc_node", "event=clamped_began", 3);
  const list = page.locator("#timeline .events li");
  await list.nth(1).waitFor();
  await page.getByRole("combobox", { name: "Events that are listed" }).selectOption("faults");
  await list.nth(1).waitFor({ state: "detached" });
  assert.match(await list.innerText(), /the position jumped/);
  await page.getByRole("combobox", { name: "Events that are listed" }).selectOption("");
  await list.nth(1).waitFor();
});

const kPhone = { width: 390, height: 844, scale: 1, touch: true };
page_test("on a phone every target has a finger's size, the view can be reset, and help is a tap away", { page: kPhone }, async (page) => {
  for (const target of await page.locator("button:visible, select:visible, input:visible, summary:visible").all()) {
    const { width, height } = await target.boundingBox();
    assert.ok(width >= 44 && height >= 44, `${await target.evaluate((e) => e.outerHTML.slice(0, 90))}: ${width} × ${height}`);
  }
  await page.locator("#canvas").focus();
  const before = (await status(page)).fixed_px;
  const away_px = (t) => Math.hypot(t.fixed_px.x - before.x, t.fixed_px.y - before.y);
  for (let i = 0; i < 4; ++i) await page.keyboard.press("ArrowDown");
  await until(page, (t) => away_px(t) > 5, "another view");
  await page.locator("#reset-view").tap();
  await until(page, (t) => away_px(t) < 2, "the view of before");
  const help = await page.locator("#title-energy").getAttribute("title");
  await page.locator("#title-energy").tap();
  await page.locator(".hint", { hasText: help }).waitFor();
  await page.locator("#title-energy").tap({ position: { x: 2, y: 2 } });
  await page.locator("#session").tap();
});

page_test("a finger that does not take the tool scrolls the page over the picture", { page: kPhone }, async (page) => {
  await rest_tool_at(page, 0.02);
  const devtools = await page.context().newCDPSession(page);
  const box = await page.locator("#canvas").boundingBox();
  const { x, y } = await tool_on_screen(page);
  const swipe = async ({ x, y }) => {
    const finger = (type, at) => devtools.send("Input.dispatchTouchEvent", { type, touchPoints: at ? [at] : [] });
    await finger("touchStart", { x, y });
    for (let up = 20; up <= 200; up += 20) await finger("touchMove", { x, y: y - up });
    await finger("touchEnd");
    await drawn(page);
  };
  await swipe({ x, y });
  await until(page, (t) => server.world.targets.length > 0 && !t.hand.is_held, "targets of the hand, and its release");
  assert.equal(await page.evaluate(() => scrollY), 0);
  await swipe({ x: box.x + 0.75 * box.width, y: box.y + 0.7 * box.height });
  await page.waitForFunction(() => scrollY > 100);
});

const kAxeStates = {
  "a session": () => {},
  "a replay": () => {
    server.world.replay = { ...kReplay };
    server.world.markers = [{ atNs: 22000000000n, text: "first cut", origin: "page" }];
  },
  "a task that is running": () => { server.world.task = { ...kTask, phase: 1 }; },
  "a task that is running, with its details": async (page) => {
    server.world.task = { ...kTask, phase: 1 };
    await page.getByRole("button", { name: "Details" }).click();
  },
  "a task that is running, with a banner": () => {
    server.world.task = { ...kTask, phase: 1 };
    server.world.recorder = { ...server.world.recorder, problem: "disk full" };
  },
  "a task that has ended, with a banner": () => {
    server.world.task = { ...kTask, phase: 2, findings: ["Found 1 of 2."], figures: [{ label: "time", value: "30.0 s" }] };
    server.world.recorder = { ...server.world.recorder, problem: "disk full" };
  },
  "a fault": () => { server.world.device = { phase: 5, deviceFaults: 1n, lastFault: 3 }; },
};
for (const [name, begin] of Object.entries(kAxeStates)) {
  for (const dark of [false, true]) {
    page_test(`axe-core has no objection to ${name}, ${dark ? "dark" : "light"}`, { world: { has_control: true }, page: { dark } }, async (page) => {
      await begin(page);
      if (name === "a replay") await until(page, (t) => t.replay, "the replay");
      if (name === "a fault") await page.locator("#acknowledge button").waitFor();
      if (server.world.task) await page.locator(server.world.task.phase === 1 ? "#task-stop" : "#task .findings li").waitFor();
      if (server.world.recorder.problem) await until_text(page, "banners", /disk full/);
      assert.deepEqual(await violations(page), []);
      server.world.task = undefined;
    });
  }
}

page_test("with the user's own colours what is chosen can be seen", { page: { scale: 1 } }, async (page) => {
  await page.emulateMedia({ forcedColors: "active" });
  const outline = (selector) => page.locator(selector).first().evaluate((element) => getComputedStyle(element).outlineStyle);
  assert.equal(await outline('#windows [aria-checked="true"]'), "solid");
  assert.equal(await outline('#windows [aria-checked="false"]'), "none");
  const dot = await page.locator("#nodes li").first().evaluate((element) => getComputedStyle(element, "::before").backgroundColor);
  assert.equal(dot, await page.evaluate(() => {
    const probe = document.body.appendChild(document.createElement("i"));
    probe.style.cssText = "background: var(--calm); forced-color-adjust: none";
    return getComputedStyle(probe).backgroundColor;
  }));
  await page.emulateMedia({ forcedColors: null });
});

page_test("without a GPU pictures pause, but not while somebody turns the view", { page: { ...kSmall, max_hz: 60 } }, async (page) => {
  await until(page, (t) => t.frames > 3, "pictures");
  const seen = await page.evaluate(async () => {
    const requested_ms = [], paused_ms = [];
    const { requestAnimationFrame: request, setTimeout: wait } = window;
    window.requestAnimationFrame = (draw) => { requested_ms.push(performance.now()); return request(draw); };
    window.setTimeout = (call, delay_ms, ...rest) => { paused_ms.push(performance.now()); return wait(call, delay_ms, ...rest); };
    const later = (ms) => new Promise((resolve) => wait(resolve, ms));
    await later(600); // it was framed anew
    const begun = requested_ms.length, begin_ms = performance.now();
    await later(2000);
    const calm_s = 1e-3 * (performance.now() - begin_ms), calm = requested_ms.length - begun;
    document.getElementById("canvas").dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
    const turned_ms = performance.now();
    const before = requested_ms.length;
    while (requested_ms.length < before + 2) await later(5); // the pause that had begun is over
    const from_ms = performance.now();
    await later(1000);
    Object.assign(window, { requestAnimationFrame: request, setTimeout: wait });
    return { calm_hz: calm / calm_s, pauses: paused_ms.filter((ms) => ms > from_ms && ms < turned_ms + 450).length, after: paused_ms.at(-1) - turned_ms };
  });
  assert.ok(seen.calm_hz > 0 && seen.calm_hz < 21, `${seen.calm_hz} pictures per second`);
  assert.equal(seen.pauses, 0, "pauses while the view is turned");
  assert.ok(seen.after > 450, "pauses again after that");
});

page_test("100 000 deforming vertices are shown", { world: { vertices: 100000 }, page: { ...kSmall, scale: 0.5, max_hz: 60 } }, async (page) => {
  await until(page, (t) => t.mesh_frames > 5, "mesh frames");
  const begin = await status(page);
  const end = await until(page, (t) => t.mesh_frames >= begin.mesh_frames + 20 && t.frames >= begin.frames + 20 && t.now_s > begin.now_s + 2, "20 pictures");
  const period_s = (end.now_s - begin.now_s) / Math.min(end.frames - begin.frames, end.mesh_frames - begin.mesh_frames);
  console.log(`100 000 vertices: ${(1 / period_s).toFixed(1)} pictures/s, ${(1e3 * end.mesh_cost_s).toFixed(1)} ms to take a frame, picture ${(1e3 * end.frame_cost_s).toFixed(0)} ms`);
  assert.ok(end.scene.tissues[0].vertices >= 100000);
});
