// SPDX-License-Identifier: Apache-2.0
// leading.mjs: leads the hand on the page by mouse, keys or fingers, and by nothing else. Like a person, it sees
// where each motion takes the target of the hand, whatever the view.
import assert from "node:assert/strict";
import { status, until } from "./browser.mjs";
import { patience } from "./machine.mjs";

const kMost = 40; // motions towards one place
const kAbove_m = 0.012; // of the tip's centre
const kDeepest_m = -0.016; // of the target: the hand's spring then presses with about 2 N
const kLess = [0, 0, 0];
const distance = (a, b) => Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z);
const between = (a, b) => [b.x - a.x, b.y - a.y, b.z - a.z];

function determinant([a, b, c]) {
  return a[0] * (b[1] * c[2] - b[2] * c[1]) - b[0] * (a[1] * c[2] - a[2] * c[1]) + c[0] * (a[1] * b[2] - a[2] * b[1]);
}
/** How much of each of three vectors together makes the fourth. */
function shares(vectors, sum) {
  const whole = determinant(vectors);
  return vectors.map((_, i) => determinant(vectors.map((one, j) => (i === j ? sum : one))) / whole);
}

class Leading {
  within_m = 0.0005;
  #per_unit = null; // metres of the target by each motion

  constructor(page) {
    this.page = page;
  }

  /** Takes the hand. */
  async begin() {
    await this.take();
    await until(this.page, (t) => t.hand.is_mine && t.hand.is_held, "a held hand");
  }

  async #moved(axis, amount) {
    const before = (await status(this.page)).target_m;
    await this.move(axis, amount);
    const now = await until(this.page, (t) => distance(t.target_m, before) > 1e-6, "a target that moves");
    return between(before, now.target_m);
  }

  async #learn() {
    this.#per_unit = [];
    for (let axis = 0; axis < 3; ++axis) {
      this.#per_unit.push((await this.#moved(axis, this.first)).map((m) => m / this.first));
    }
  }

  /** Leads the target of the hand there, in the world. */
  async to(place) {
    for (let i = 0; i < kMost; ++i) {
      if (i % 8 === 0 && (i > 0 || !this.#per_unit)) await this.#learn();
      const { target_m, hand } = await status(this.page);
      if (hand.is_held && distance(target_m, place) < this.within_m) return;
      const amounts = shares(this.#per_unit, between(target_m, place)).map(Math.round);
      if (`${amounts}` === `${kLess}`) return; // as near as its steps allow
      for (let axis = 0; axis < 3; ++axis) if (amounts[axis] !== 0) await this.#moved(axis, amounts[axis]);
    }
    assert.fail(`the target of the hand is not led to ${JSON.stringify(place)}: ${JSON.stringify((await status(this.page)).target_m)}`);
  }

  /**
   * Goes above that place and presses on it. Where physics_node has no processor the force fades and the energy credit is
   * exhausted: as the page says, lifts off then and presses again.
   * @param newton  at least, on the hand
   */
  async press({ x, y }, newton) {
    for (const end = performance.now() + patience(30000); performance.now() < end;) {
      await this.to({ x, y, z: kAbove_m });
      await until(this.page, (t) => distance(t.tool_m, t.target_m) < 0.002, "the tip above the place");
      for (let z = kAbove_m; z > kDeepest_m; z -= 0.001) {
        const { now_s } = await status(this.page);
        await this.to({ x, y, z });
        const felt = await until(this.page, (t) => t.now_s > now_s + 0.1, "a tenth of a second");
        if (felt.applied_newton >= newton) return;
      }
    }
    assert.fail(`no force of ${newton} N: ${JSON.stringify((await status(this.page)).state)}`);
  }
}

/** A drag with the left button, and the wheel. */
export class ByMouse extends Leading {
  first = 10; // pixels
  async take() {
    const { x, y, width, height } = await this.page.locator("#canvas").boundingBox();
    this.at = { x: x + width / 2, y: y + height / 3 };
    await this.page.mouse.move(this.at.x, this.at.y);
    await this.page.mouse.down();
  }
  async move(axis, px) {
    if (axis === 2) return this.page.mouse.wheel(0, 10 * px);
    this.at[axis === 0 ? "x" : "y"] += px;
    return this.page.mouse.move(this.at.x, this.at.y);
  }
  release() {
    return this.page.mouse.up();
  }
}

const kKeys = [["ArrowLeft", "ArrowRight"], ["ArrowUp", "ArrowDown"], ["PageUp", "PageDown"]];
/** Arrow keys, Page Up and Page Down. */
export class ByKeys extends Leading {
  first = 1; // presses
  within_m = 0.001;
  take() {
    return this.page.keyboard.press("ArrowRight");
  }
  async move(axis, presses) {
    for (let i = 0; i < Math.abs(presses); ++i) await this.page.keyboard.press(kKeys[axis][presses > 0 ? 1 : 0]);
  }
  release() {
    return this.page.keyboard.press("Escape");
  }
}

/** One finger on the picture, and a second one in depth. */
export class ByFinger extends Leading {
  first = 10; // pixels
  #fingers = [];
  async take() {
    this.devtools ??= await this.page.context().newCDPSession(this.page);
    const { x, y, width, height } = await this.page.locator("#canvas").boundingBox();
    for (const share of [0.5, 0.75]) { // both stay down: the protocol lifts all or none
      this.#fingers.push({ x: x + share * width, y: y + share * height, id: this.#fingers.length });
      await this.#touch("touchStart");
    }
  }
  move(axis, px) {
    if (axis < 2) this.#fingers[0][axis === 0 ? "x" : "y"] += px;
    else this.#fingers[1].y += px;
    return this.#touch("touchMove");
  }
  async release() {
    this.#fingers = [];
    await this.#touch("touchEnd");
  }
  #touch(type) {
    return this.devtools.send("Input.dispatchTouchEvent", { type, touchPoints: this.#fingers });
  }
}
