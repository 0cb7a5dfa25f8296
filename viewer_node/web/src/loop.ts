// SPDX-License-Identifier: Apache-2.0
// loop.ts: the contact in figures, and the force of the tissue over the depth: what the loop
// encloses is lost in the tissue (hysteresis).
import { Card, fixed, make, write, type Palette, type View } from "./card";
import { kDepth, kTissueForce } from "./telemetry";

const kMostPoints = 4000;
const kLeft_px = 38, kBottom_px = 20, kTop_px = 6, kRight_px = 10;

export class Loop {
  /** In contact, drawn last; for tests. */
  points = 0;
  /** Of the points: what the axes end at. */
  most = { depth_mm: 0, force_newton: 0 };
  private readonly card: Card;
  private readonly canvas = make("canvas");
  private palette: Palette | null = null;

  constructor(parent: HTMLElement) {
    this.card = new Card(parent, "contact", "Contact", "", "Force of the tissue over the depth of the tool in it, in the time window. The area in the loop is the energy lost in the tissue.", [
      { label: "depth", colour: "--requested" }, { label: "speed", colour: "--requested" }, { label: "local stiffness", colour: "--requested" },
    ]);
    this.card.element.classList.add("plain-keys");
    this.card.body.append(this.canvas);
  }

  build(palette: Palette): void {
    this.palette = palette;
    this.resize();
  }

  resize(): void {
    const { clientWidth: width, clientHeight: height } = this.card.body;
    this.canvas.width = Math.round(width * devicePixelRatio);
    this.canvas.height = Math.round(height * devicePixelRatio);
  }

  /** The figures beside the loop. */
  tell({ telemetry: { depth_m, speed_m_per_s, stiffness_newton_per_m }, is_fresh }: View): void {
    const figure = (value: number, scale: number, unit: string, digits: number) =>
      is_fresh.physics && Number.isFinite(value) ? `${(scale * value).toFixed(digits)} ${unit}` : "–";
    const [depth, speed, stiffness] = this.card.values;
    write(depth, figure(depth_m, 1e3, "mm", 2));
    write(speed, figure(speed_m_per_s, 1e3, "mm/s", 0));
    write(stiffness, depth_m > 0 ? figure(stiffness_newton_per_m, 1, "N/m", 0) : "–");
  }

  draw({ telemetry, physics_end_s, window_s }: View): void {
    const context = this.canvas.getContext("2d");
    if (!context || !this.palette || this.canvas.width === 0) return;
    const { palette, canvas } = this;
    const ring = telemetry.physics;
    const until = ring.first_at(physics_end_s + 1e-9);
    const first = ring.first_at(physics_end_s - window_s);
    const step = Math.max(1, Math.ceil((until - first) / kMostPoints));
    this.points = 0;
    this.most = { depth_mm: 0, force_newton: 0 };
    for (let row = first; row < until; row += step) {
      const depth_mm = 1e3 * ring.value(kDepth, row);
      if (!(depth_mm > 0)) continue;
      this.points += 1;
      this.most.depth_mm = Math.max(this.most.depth_mm, depth_mm);
      this.most.force_newton = Math.max(this.most.force_newton, ring.value(kTissueForce, row));
    }
    const scale = devicePixelRatio;
    context.setTransform(scale, 0, 0, scale, 0, 0);
    const width = canvas.width / scale, height = canvas.height / scale;
    context.clearRect(0, 0, width, height);
    const range = { x: Math.max(1, 1.05 * this.most.depth_mm), y: Math.max(0.2, 1.1 * this.most.force_newton) };
    const x_of = (depth_mm: number) => kLeft_px + (depth_mm / range.x) * (width - kLeft_px - kRight_px);
    const y_of = (force_newton: number) => height - kBottom_px - (force_newton / range.y) * (height - kBottom_px - kTop_px);

    context.font = "11px Inter, system-ui, sans-serif";
    context.fillStyle = palette.faint;
    context.strokeStyle = palette.line;
    context.lineWidth = 1;
    context.textAlign = "center";
    const line = (from: [number, number], to: [number, number]) => {
      context.beginPath();
      context.moveTo(...from);
      context.lineTo(...to);
      context.stroke();
    };
    for (const at of ticks(range.x, 5)) {
      line([x_of(at), kTop_px], [x_of(at), height - kBottom_px]);
      context.fillText(`${fixed(at)} mm`, Math.min(x_of(at), width - 18), height - 5);
    }
    context.textAlign = "right";
    for (const at of ticks(range.y, 3)) {
      line([kLeft_px, y_of(at)], [width - kRight_px, y_of(at)]);
      context.fillText(`${fixed(at)} N`, kLeft_px - 4, y_of(at) + 4);
    }

    context.strokeStyle = palette.of("--requested");
    context.lineWidth = 1.5;
    context.beginPath();
    let is_drawing = false;
    for (let row = first; row < until; row += step) {
      const depth_mm = 1e3 * ring.value(kDepth, row);
      const y = y_of(ring.value(kTissueForce, row));
      if (!(depth_mm > 0)) is_drawing = false;
      else if (is_drawing) context.lineTo(x_of(depth_mm), y);
      else context.moveTo(x_of(depth_mm), y);
      is_drawing = depth_mm > 0;
    }
    context.stroke();
  }
}

/** About `count` round numbers from 0 to the end. */
function ticks(end: number, count: number): number[] {
  const rough = end / count;
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = decade * ([1, 2, 5].find((one) => one * decade >= rough) ?? 10);
  return Array.from({ length: Math.floor(end / step) + 1 }, (_, i) => i * step);
}
