// SPDX-License-Identifier: Apache-2.0
// hand.ts: touch with the pointer. Dragging the tool moves the target of a simulated hand in the
// plane of the picture; the wheel, Shift or a second finger moves it in depth. Arrow keys move it sideways
// and straight up and down, whatever the view, Page Up and Down away and back. The right mouse button,
// or G in turn, presses button 0 of its device, with which a gripper closes. The only
// message from the page to the nodes; the server and the hand limit it again.
import type { SceneView } from "./scene/scene_view";
import { norm } from "./telemetry";
import type { PointerHand, Vector3 } from "./wire";

const kGrabRadius_px = { mouse: 26, pen: 30, touch: 44 };
const kLeastPeriod_s = 1 / 60;
const kTick_ms = 8; // independent of the frame rate, which is low on slow machines
const kKeepAlive_s = 0.1; // while the target rests
const kKeyStep_m = 0.001;
const kKeyHold_s = 1.5; // after the last key the hand is released, unless G keeps its jaws closed
const kWheelStep_m = 0.00002; // per pixel that the wheel reports

const kScrollingLayout = "(max-width: 1000px)"; // as in style.css

const seconds = () => 1e-3 * performance.now();

export interface HandStatus {
  is_allowed: boolean;
  is_mine: boolean;
  is_others: boolean;
  /** Between grabbing and releasing. */
  is_held: boolean;
}

/** The hand that the page may lead: that of the side on display. */
export interface Led {
  pointer: PointerHand | undefined; // undefined: it follows no page
  workspace_scale_ratio: number;
  holder: bigint; // a client; 0: none
  is_replay: boolean;
  hand_m: Vector3; // D
  tool_m: Vector3; // W, of the same tick
}

export class HandControl {
  sent_count = 0;
  is_touching = false; // the toggle: drag anywhere
  client_id = 0n;
  can_publish = false;
  /** W, while held. */
  readonly target: Vector3 = { x: 0, y: 0, z: 0 };

  private pointer: number | null = null;
  private depth_pointer: number | null = null;
  private last = { x: 0, y: 0 };
  private last_depth_y = 0;
  private key_s = -Infinity;
  private is_held_by_keys = false;
  private sent_s = -Infinity;
  private is_moved = false;
  private is_pressed = false; // button 0 of the device
  private timer: ReturnType<typeof setInterval> | undefined;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly view: SceneView,
    private readonly led: () => Led,
    private readonly publish: (fields: { handPositionM: Vector3; isReleased: boolean; buttons: number }) => boolean) {
    // before OrbitControls, which listens on the canvas itself
    const area = canvas.parentElement!;
    area.addEventListener("pointerdown", (event) => this.pointer_down(event), true);
    canvas.addEventListener("pointermove", (event) => this.pointer_moved(event));
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"] as const) {
      canvas.addEventListener(kind, (event) => this.pointer_up(event));
    }
    // a finger that takes the tool does not scroll the page
    canvas.addEventListener("touchstart", (event) => {
      const [finger] = event.touches;
      const at = { clientX: finger.clientX, clientY: finger.clientY, pointerType: "touch" };
      if (this.is_held || (this.is_allowed && (this.is_touching || this.is_over_tool(at)))) event.preventDefault();
    }, { passive: false });
    // where the page scrolls, the wheel zooms only once the picture has been clicked
    const scrolls = matchMedia(kScrollingLayout);
    area.addEventListener("wheel", (event) => {
      if (scrolls.matches && !event.ctrlKey && document.activeElement !== canvas && !this.is_held) event.stopPropagation();
    }, { capture: true });
    area.addEventListener("wheel", (event) => {
      if (!this.is_held || event.target !== canvas) return;
      event.preventDefault();
      event.stopPropagation();
      this.move(0, 0, -kWheelStep_m * event.deltaY * (event.deltaMode === 1 ? 16 : 1));
    }, { capture: true, passive: false });
    canvas.addEventListener("contextmenu", (event) => {
      if (this.is_held) event.preventDefault();
    });
    canvas.addEventListener("blur", () => this.release());
    addEventListener("pagehide", () => this.release());
  }

  get is_held(): boolean {
    return this.pointer !== null || this.is_held_by_keys;
  }

  get status(): HandStatus {
    const { holder } = this.led();
    return {
      is_allowed: this.is_allowed,
      is_mine: holder === 0n ? this.is_held : holder === this.client_id,
      is_others: holder !== 0n && holder !== this.client_id,
      is_held: this.is_held,
    };
  }

  /** What may be led has changed. */
  review(): void {
    if (!this.is_allowed) this.release();
  }

  /** Connection lost: releases the hand without a message. */
  forget(): void {
    this.can_publish = false;
    this.let_go();
  }

  // While held: sends what is due.
  private tick(): void {
    const now_s = seconds();
    if (this.is_held_by_keys && !this.is_pressed && now_s - this.key_s > kKeyHold_s) this.release();
    if (!this.is_held) return;
    if (this.status.is_others) { // another page was faster; the server ignores this one
      this.let_go();
      return;
    }
    const silence_s = now_s - this.sent_s;
    if (silence_s >= kKeepAlive_s || (this.is_moved && silence_s >= kLeastPeriod_s)) this.send(false);
  }

  /** True if the key was for the hand. */
  key(key: string): boolean {
    if (!this.is_allowed) return false;
    const step = kKeyStep_m;
    const steps: Record<string, [number, number, number]> = {
      ArrowLeft: [-step, 0, 0], ArrowRight: [step, 0, 0], ArrowUp: [0, -step, 0], ArrowDown: [0, step, 0],
      PageUp: [0, 0, step], PageDown: [0, 0, -step],
    };
    if (key === "Escape" && this.is_held) {
      this.release();
      return true;
    }
    if (key.toLowerCase() === "g" && this.is_held) {
      this.press(!this.is_pressed);
      this.key_s = seconds();
      return true;
    }
    if (!this.is_touching || !(key in steps)) return false;
    if (this.status.is_others) return true;
    if (!this.is_held) {
      this.is_held_by_keys = true;
      this.begin();
    }
    this.key_s = seconds();
    this.view.moved_level(this.target, ...steps[key], this.target);
    this.show_moved();
    return true;
  }

  release(): void {
    if (!this.is_held) return;
    this.send(true);
    this.let_go();
  }

  private press(is_pressed: boolean): void {
    if (is_pressed === this.is_pressed) return;
    this.is_pressed = is_pressed;
    this.send(false);
  }

  private let_go(): void {
    clearInterval(this.timer);
    this.is_pressed = false;
    this.pointer = this.depth_pointer = null;
    this.is_held_by_keys = false;
    this.view.orbits = true;
    this.view.set_target(null);
    delete this.canvas.dataset.cursor;
  }

  private get is_allowed(): boolean {
    const { pointer, is_replay, tool_m } = this.led();
    return this.can_publish && !is_replay && pointer !== undefined && Number.isFinite(tool_m.x);
  }

  private pointer_down(event: PointerEvent): void {
    if (event.target !== this.canvas || !this.is_allowed || event.button !== 0) return;
    if (this.pointer !== null) {
      this.depth_pointer ??= event.pointerId;
      this.last_depth_y = event.clientY;
      event.stopPropagation();
      return;
    }
    if (this.status.is_others || (!this.is_touching && !this.is_over_tool(event))) return;
    this.view.orbits = false;
    this.is_held_by_keys = false;
    this.pointer = event.pointerId;
    this.last = { x: event.clientX, y: event.clientY };
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.dataset.cursor = "held";
    this.begin();
  }

  private pointer_moved(event: PointerEvent): void {
    if (event.pointerId === this.pointer) {
      if (event.button === 2) this.press((event.buttons & 2) !== 0);
      const right_px = event.clientX - this.last.x;
      const down_px = event.clientY - this.last.y;
      this.last = { x: event.clientX, y: event.clientY };
      if (event.shiftKey) this.move(0, 0, -down_px * this.view.metres_per_pixel(this.target));
      else this.move(right_px, down_px, 0);
    } else if (event.pointerId === this.depth_pointer) {
      this.move(0, 0, (this.last_depth_y - event.clientY) * this.view.metres_per_pixel(this.target));
      this.last_depth_y = event.clientY;
    } else if (this.pointer === null && event.buttons === 0) {
      if (this.is_allowed && (this.is_touching || this.is_over_tool(event))) this.canvas.dataset.cursor = "over";
      else delete this.canvas.dataset.cursor;
    }
  }

  private pointer_up(event: PointerEvent): void {
    if (event.pointerId === this.depth_pointer) this.depth_pointer = null;
    else if (event.pointerId === this.pointer) this.release();
  }

  private is_over_tool(event: Pick<PointerEvent, "clientX" | "clientY" | "pointerType">): boolean {
    const box = this.canvas.getBoundingClientRect();
    const tool = this.view.project(this.led().tool_m);
    const reach = (kGrabRadius_px[event.pointerType as "mouse"] ?? kGrabRadius_px.mouse) + this.view.tool_radius_px;
    return Math.hypot(event.clientX - box.left - tool.x, event.clientY - box.top - tool.y) < reach;
  }

  private begin(): void {
    Object.assign(this.target, this.led().tool_m);
    this.is_moved = true;
    this.view.set_target(this.target);
    this.send(false);
    clearInterval(this.timer);
    this.timer = setInterval(() => this.tick(), kTick_ms);
  }

  private move(right_px: number, down_px: number, away_m: number): void {
    this.view.moved(this.target, right_px, down_px, away_m, this.target);
    this.show_moved();
  }

  private show_moved(): void {
    this.keep_within_reach();
    this.view.set_target(this.target);
    this.is_moved = true;
  }

  // tool = hand · scale + offset; the offset from one tick of telemetry
  private hand_of(tool: Vector3): Vector3 {
    const { hand_m, tool_m, workspace_scale_ratio: scale } = this.led();
    return {
      x: hand_m.x + (tool.x - tool_m.x) / scale,
      y: hand_m.y + (tool.y - tool_m.y) / scale,
      z: hand_m.z + (tool.z - tool_m.z) / scale,
    };
  }

  private keep_within_reach(): void {
    const { pointer, workspace_scale_ratio } = this.led();
    const { centerM, reachM } = pointer!;
    const hand = this.hand_of(this.target);
    const offset = { x: hand.x - centerM.x, y: hand.y - centerM.y, z: hand.z - centerM.z };
    const excess = 1 - reachM / norm(offset);
    if (!(excess > 0)) return;
    const scale = workspace_scale_ratio * excess;
    this.target.x -= scale * offset.x;
    this.target.y -= scale * offset.y;
    this.target.z -= scale * offset.z;
  }

  private send(is_released: boolean): void {
    if (!this.is_allowed) return;
    const buttons = this.is_pressed && !is_released ? 1 : 0;
    if (this.publish({ handPositionM: this.hand_of(this.target), isReleased: is_released, buttons })) this.sent_count += 1;
    this.sent_s = seconds();
    this.is_moved = false;
  }
}
