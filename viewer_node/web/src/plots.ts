// SPDX-License-Identifier: Apache-2.0
// plots.ts: the plots. Each plot reduces the rings to its resolution and draws them; its legend
// shows the newest value, or the value under the cursor.
import uPlot from "uplot";
import { Card, fixed, write, type Palette, type View } from "./card";
import { Loop } from "./loop";
import { cell_times, cells_of, reduce } from "./ring";
import { time_words } from "./state";
import {
  kRequestedNorm, kRequestedX, kBoundNorm, kBoundX, kForceAge, kForceNorm, kForceX, kLatenessBins, kLedger, kReplyTime,
  kRequestedTorqueNorm, kRequestedTorqueX, kTorqueNorm, kTorqueX, kTransparency, kTrueEnergy, upper_border_s, type Instant,
} from "./telemetry";

/** Curves between samples further apart than this have a gap. */
const kBridge_s = 0.15;
const kPointsPerPixel = 0.5; // cells; each has two points
const kMostCells = 500;
/** Rows before the newest in which a figure is looked for: not every tick has all. */
const kRowsBack = 64;
const kMostLabel = 18; // characters of a marker

type Column = (number | null)[];

export interface SeriesSpec {
  label: string;
  colour: string; // of the style sheet: --name
  dash?: boolean;
  ring: "device" | "mofc" | "batches"; // of the telemetry
  column: number;
  scale: number; // shown value = scale · column
}
interface PlotSpec {
  id: string;
  title: string;
  unit: string;
  help: string;
  series: SeriesSpec[];
  /** Of the shown values: [least, greatest] → the axis. */
  range: (low: number, high: number) => [number, number];
  is_logarithmic?: boolean;
  show: (value: number) => string;
  axis?: (value: number) => string;
}

export class TimePlot {
  private readonly card: Card;
  private plot: uPlot | null = null;
  private data: Column[] = [];
  private spec: PlotSpec;
  private limits: [number, number];
  private view: View | null = null;
  private palette: Palette | null = null;

  constructor(parent: HTMLElement, spec: PlotSpec, extra?: HTMLElement) {
    this.spec = spec;
    this.limits = spec.range(Infinity, -Infinity);
    this.card = new Card(parent, spec.id, spec.title, spec.unit, spec.help, spec.series, extra);
    this.data = [[], ...spec.series.map(() => [])];
  }

  /** Whether there is anything to show. */
  show(is_shown: boolean): void {
    if (is_shown !== this.card.element.hidden) return;
    this.card.element.hidden = !is_shown;
    this.resize();
  }

  /** Shows other columns under the same labels. */
  set_columns(columns: number[], range: PlotSpec["range"]): void {
    this.spec = { ...this.spec, range, series: this.spec.series.map((one, i) => ({ ...one, column: columns[i] })) };
  }

  build(palette: Palette): void {
    const { body } = this.card;
    this.plot?.destroy();
    this.palette = palette;
    const { spec } = this;
    this.plot = new uPlot({
      width: Math.max(body.clientWidth, 100),
      height: Math.max(body.clientHeight, 60),
      padding: [6, 10, 0, 0],
      legend: { show: false },
      cursor: { y: false, points: { size: 5 }, drag: { x: false, y: false, setScale: false } },
      scales: {
        x: { time: false, range: () => [this.window_start, 0] },
        y: { distr: spec.is_logarithmic ? 3 : 1, range: () => this.limits },
      },
      axes: [
        axis(palette, { size: 22, space: 60, values: (_, ticks) => ticks.map((t) => (t === 0 ? "now" : `${fixed(t)} s`)) }),
        axis(palette, {
          size: 36, space: 24,
          values: (_, ticks) => ticks.map((t) => (t === null ? "" : (spec.axis ?? fixed)(t))),
          ...(spec.is_logarithmic ? { filter: decades_only, grid: { filter: decades_only, stroke: palette.line, width: 1 } } : {}),
        }),
      ],
      series: [{}, ...spec.series.map(({ label, colour, dash }) => ({
        label, stroke: palette.of(colour), width: dash ? 1.25 : 1.5, dash: dash ? [4, 4] : undefined,
        points: { show: false }, spanGaps: false,
      }))],
      hooks: { setCursor: [() => this.tell()], drawClear: [(plot) => this.draw_instants(plot)] },
    }, this.data as uPlot.AlignedData, body);
  }

  private window_start = -10;

  draw(view: View): void {
    const { plot, spec, data } = this;
    if (!plot || this.card.element.hidden) return;
    const { telemetry, end_s, window_s } = this.view = view;
    const cells = cells_of(end_s, window_s, Math.min(kMostCells, Math.ceil(kPointsPerPixel * plot.width)));
    this.window_start = -window_s;
    let low = Infinity;
    let high = -Infinity;
    if (Number.isFinite(end_s)) {
      cell_times(cells, end_s, data[0]);
      spec.series.forEach(({ ring, column, scale, dash }, index) => {
        const out = data[index + 1];
        reduce(telemetry[ring], column, cells, out, kBridge_s);
        for (let i = 0; i < out.length; ++i) {
          const value = out[i];
          if (value === null) continue;
          if (spec.is_logarithmic && value <= 0) {
            out[i] = null;
            continue;
          }
          const shown = scale * value;
          out[i] = shown;
          if (dash) continue; // the bound may be large; it does not scale the axis
          if (shown < low) low = shown;
          if (shown > high) high = shown;
        }
      });
    }
    this.limits = spec.range(low, high);
    plot.setData(data as uPlot.AlignedData, true);
  }

  resize(): void {
    const { clientWidth, clientHeight } = this.card.body;
    if (clientWidth > 0 && this.plot && (this.plot.width !== clientWidth || this.plot.height !== clientHeight)) {
      this.plot.setSize({ width: clientWidth, height: clientHeight });
    }
  }

  /** Of the window as drawn; for tests. */
  get end_s(): number {
    return this.view?.end_s ?? NaN;
  }

  /** In the window, by seconds before its end. */
  get instants(): Instant[] {
    const { view } = this;
    if (!view) return [];
    const begin_s = view.end_s - view.window_s;
    return view.telemetry.instants.filter(({ at_s }) => at_s >= begin_s && at_s <= view.end_s)
      .map((one) => ({ ...one, at_s: one.at_s - view.end_s }));
  }

  // Lines behind the curves, with the words of a marker.
  private draw_instants(plot: uPlot): void {
    const { ctx, bbox } = plot;
    if (!this.palette) return;
    ctx.save();
    const width = ctx.lineWidth = Math.max(1, Math.round(devicePixelRatio));
    ctx.font = `${10 * devicePixelRatio}px Inter, system-ui, sans-serif`;
    ctx.textBaseline = "top";
    for (const { at_s, tone, text } of this.instants) {
      const x = Math.round(plot.valToPos(at_s, "x", true)) + (width % 2) / 2; // on whole pixels
      ctx.strokeStyle = ctx.fillStyle = tone === "calm" ? this.palette.faint : this.palette.of(`--${tone === "marker" ? "accent" : tone}`);
      ctx.globalAlpha = tone === "marker" || tone === "alarm" ? 0.9 : 0.5;
      ctx.setLineDash(tone === "marker" ? [] : [3 * devicePixelRatio, 3 * devicePixelRatio]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      if (tone !== "marker") continue;
      const label = text.length > kMostLabel ? `${text.slice(0, kMostLabel - 1)}…` : text;
      const is_right = x + 4 * devicePixelRatio + ctx.measureText(label).width > bbox.left + bbox.width;
      ctx.textAlign = is_right ? "right" : "left";
      ctx.fillText(label, x + (is_right ? -3 : 3) * devicePixelRatio, bbox.top + devicePixelRatio);
    }
    ctx.restore();
  }

  /** Points drawn and their newest value, by series; for tests. */
  get status(): { points: number; newest: number | null }[] {
    return this.data.slice(1).map((column) => ({
      points: column.reduce((n: number, v) => n + (v === null ? 0 : 1), 0), newest: last_of(column),
    }));
  }

  /** The legend: the values under the cursor, or the newest ones while they hold. */
  tell(view = this.view): void {
    if (!view) return;
    this.view = view;
    const at = this.plot?.cursor.idx;
    const is_under_cursor = at != null && (this.plot?.cursor.left ?? -1) >= 0;
    this.card.values.forEach((element, index) => {
      const value = is_under_cursor ? this.data[index + 1][at] ?? null : this.newest(view, index);
      write(element, value === null ? "–" : this.spec.show(value));
    });
  }

  // That of the tick, not of the curve, which has the extremes of each pixel.
  private newest({ telemetry, end_s, is_fresh }: View, index: number): number | null {
    const { ring, column, scale } = this.spec.series[index];
    if (!is_fresh.device || (ring !== "device" && !is_fresh.mofc)) return null;
    const rows = telemetry[ring];
    const newest = rows.first_at(end_s + 1e-9) - 1;
    for (let row = newest; row >= Math.max(0, newest - kRowsBack); --row) {
      if (Number.isFinite(rows.value(column, row))) return scale * rows.value(column, row);
    }
    return null;
  }
}

/** Histogram of the lateness of the ticks in the window. */
export class Histogram {
  private readonly card: Card;
  private plot: uPlot | null = null;
  private readonly counts: number[] = [];
  private readonly data: [number[], (number | null)[]] = [[], []];

  constructor(parent: HTMLElement) {
    this.card = new Card(parent, "lateness", "Tick lateness", "", "How late the device’s ticks begin, in the time window; logarithmic in both directions.", [
      { label: "median", colour: "--applied" }, { label: "99 %", colour: "--applied" }, { label: "worst", colour: "--applied" },
    ]);
    this.card.element.classList.add("plain-keys");
    for (let i = 0; i < kLatenessBins.count; ++i) this.data[0].push(i);
    this.data[1] = this.data[0].map(() => null);
  }

  build(palette: Palette): void {
    const { body } = this.card;
    this.plot?.destroy();
    const bars = uPlot.paths.bars!({ size: [0.82, 60], radius: 0.15 });
    this.plot = new uPlot({
      width: Math.max(body.clientWidth, 100),
      height: Math.max(body.clientHeight, 60),
      padding: [6, 10, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, range: () => [-0.7, kLatenessBins.count - 0.3] },
        y: { distr: 3, range: (_, __, high) => [0.6, Math.max(100, 2 * high)] },
      },
      axes: [
        axis(palette, {
          size: 22, grid: { show: false },
          splits: () => [0, 5, 10, 15, 20, 25],
          values: () => ["1 µs", "10 µs", "100 µs", "1 ms", "10 ms", "100 ms"],
        }),
        axis(palette, { size: 36, space: 24, values: (_, ticks) => ticks.map((t) => (t === null ? "" : thousands(t))), filter: decades_only, grid: { filter: decades_only, stroke: palette.line, width: 1 } }),
      ],
      series: [{}, { stroke: palette.of("--applied"), fill: palette.of("--applied"), width: 0, paths: bars, points: { show: false } }],
    }, this.data as uPlot.AlignedData, body);
  }

  draw({ telemetry, end_s, window_s }: View): void {
    if (!this.plot || !Number.isFinite(end_s)) return;
    telemetry.count_lateness(end_s, window_s, kLatenessBins, this.counts);
    let total = 0;
    this.counts.forEach((count, bin) => {
      this.data[1][bin] = count > 0 ? count : null;
      total += count;
    });
    this.plot.setData(this.data as uPlot.AlignedData, true);
    // upper border of the bin that holds the quantile (nearest rank): an upper bound
    const border = (share: number) => {
      let sum = 0;
      for (let bin = 0; bin < this.counts.length; ++bin) {
        sum += this.counts[bin];
        if (total > 0 && sum >= share * total) return `< ${time_words(upper_border_s(kLatenessBins, bin))}`;
      }
      return "–";
    };
    write(this.card.values[0], border(0.5));
    write(this.card.values[1], border(0.99));
    write(this.card.values[2], border(1));
  }

  resize(): void {
    const { clientWidth, clientHeight } = this.card.body;
    if (clientWidth > 0 && this.plot && (this.plot.width !== clientWidth || this.plot.height !== clientHeight)) {
      this.plot.setSize({ width: clientWidth, height: clientHeight });
    }
  }

  get total(): number {
    return this.counts.reduce((sum, n) => sum + n, 0);
  }
}

export type ForceAxis = "norm" | "x" | "y" | "z";

export class Plots {
  readonly force: TimePlot;
  readonly torque: TimePlot; // of a wrist
  readonly energy: TimePlot;
  readonly transparency: TimePlot;
  readonly timing: TimePlot;
  readonly lateness: Histogram;
  readonly loop: Loop;

  constructor(parent: HTMLElement, force_axis: HTMLElement) {
    const newton = (value: number) => `${value.toFixed(2)} N`;
    this.force = new TimePlot(parent, {
      id: "force", title: "Force on the hand", unit: "N",
      help: "Requested force before the clamp, rendered force on the hand, and the clamp’s bound.",
      series: [
        { label: "requested", colour: "--requested", ring: "mofc", column: kRequestedNorm, scale: 1 },
        { label: "on the hand", colour: "--applied", ring: "device", column: kForceNorm, scale: 1 },
        { label: "bound", colour: "--bound", dash: true, ring: "mofc", column: kBoundNorm, scale: 1 },
      ],
      range: from_zero(0.5), show: newton,
    }, force_axis);
    const newton_m = (value: number) => `${value.toFixed(3)} N·m`;
    this.torque = new TimePlot(parent, {
      id: "torque", title: "Torque on the hand", unit: "N·m",
      help: "Torque of the wrist’s joints: requested before the clamp, and rendered on the hand.",
      series: [
        { label: "requested", colour: "--requested", ring: "mofc", column: kRequestedTorqueNorm, scale: 1 },
        { label: "on the hand", colour: "--applied", ring: "device", column: kTorqueNorm, scale: 1 },
      ],
      range: from_zero(0.02), show: newton_m,
    });
    this.torque.show(false);
    this.loop = new Loop(parent);
    const millijoule = (value: number) => `${Math.abs(value) < 9.95 ? value.toFixed(2) : value.toFixed(1)} mJ`;
    this.energy = new TimePlot(parent, {
      id: "energy", title: "Energy from the hand", unit: "mJ",
      help: "Net energy from the hand: the clamp’s ledger and, for simulated devices, the true energy. Never below zero.",
      series: [
        { label: "ledger", colour: "--ledger", ring: "mofc", column: kLedger, scale: 1e3 },
        { label: "true", colour: "--truth", ring: "device", column: kTrueEnergy, scale: 1e3 },
      ],
      range: around_zero(1), show: millijoule,
    });
    this.transparency = new TimePlot(parent, {
      id: "transparency", title: "Transparency", unit: "%",
      help: "Share of the requested force that is rendered, over the last second; a gap without a requested force.",
      series: [{ label: "last second", colour: "--applied", ring: "batches", column: kTransparency, scale: 100 }],
      range: () => [0, 105], show: (value) => `${value.toFixed(1)} %`,
    });
    this.timing = new TimePlot(parent, {
      id: "timing", title: "Age and reply", unit: "ms",
      help: "Age of the device state that the force answers, and time to the answer within a tick.",
      series: [
        { label: "age", colour: "--requested", ring: "mofc", column: kForceAge, scale: 1e3 },
        { label: "reply", colour: "--applied", ring: "device", column: kReplyTime, scale: 1e3 },
      ],
      is_logarithmic: true,
      range: (low, high) => low > high ? [0.01, 10] : [10 ** Math.floor(Math.log10(Math.max(low, 1e-4))), 10 ** Math.ceil(Math.log10(Math.max(high * 1.05, 1e-3)))],
      show: (value) => time_words(1e-3 * value), axis: (value) => `${Number(value.toPrecision(1))}`,
    });
    this.lateness = new Histogram(parent);
  }

  get timed(): TimePlot[] {
    return [this.force, this.torque, this.energy, this.transparency, this.timing];
  }
  get all(): (TimePlot | Histogram | Loop)[] {
    return [this.force, this.torque, this.loop, this.energy, this.transparency, this.timing, this.lateness];
  }

  set_force_axis(axis: ForceAxis): void {
    if (axis === "norm") {
      this.force.set_columns([kRequestedNorm, kForceNorm, kBoundNorm], from_zero(0.5));
      this.torque.set_columns([kRequestedTorqueNorm, kTorqueNorm], from_zero(0.02));
    } else {
      const offset = "xyz".indexOf(axis);
      this.force.set_columns([kRequestedX + offset, kForceX + offset, kBoundX + offset], around_zero(0.5));
      this.torque.set_columns([kRequestedTorqueX + offset, kTorqueX + offset], around_zero(0.02));
    }
  }
}

function from_zero(least: number): PlotSpec["range"] {
  return (_, high) => [0, Math.max(least, 1.15 * high)];
}
function around_zero(least: number): PlotSpec["range"] {
  return (low, high) => [Math.min(0, 1.15 * low), Math.max(least, 1.15 * high)];
}

function axis(palette: Palette, more: uPlot.Axis): uPlot.Axis {
  return {
    stroke: palette.faint,
    font: "11px Inter, system-ui, sans-serif",
    gap: 4,
    grid: { stroke: palette.line, width: 1 },
    ticks: { show: false },
    ...more,
  };
}

function decades_only(_: uPlot, splits: number[]): (number | null)[] {
  return splits.map((value) => (Math.abs(Math.log10(value) - Math.round(Math.log10(value))) < 1e-6 ? value : null));
}

function thousands(value: number): string {
  return value >= 1e6 ? `${value / 1e6}M` : value >= 1e3 ? `${value / 1e3}k` : String(value);
}
function last_of(column: Column): number | null {
  for (let i = column.length - 1; i >= Math.max(0, column.length - 8); --i) {
    if (column[i] !== null && column[i] !== undefined) return column[i];
  }
  return null;
}
