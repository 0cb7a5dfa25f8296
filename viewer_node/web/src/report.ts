// SPDX-License-Identifier: Apache-2.0
// report.ts: the figures of `palpate report`, drawn from the data in the file itself: zoom by
// dragging, values under the cursor, the same time in all figures of a run, events as lines.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import "./report.css";

interface Figure {
  title: string;
  x: string;
  y: string;
  is_time: boolean; // x: seconds since the first tick; else durations, logarithmic
  range: [number, number] | null;
  series: { name: string; colour: string }[];
  data: (number | null)[][]; // x, then a column for each series
}
interface Event { t_s: number; level: string; text: string }
interface Run { name: string; figures: Figure[]; events: Event[] }

const { runs } = JSON.parse(document.getElementById("data")!.textContent!) as { runs: Run[] };
const kHeight_px = 240;
const time_plots: uPlot[] = [];
const plots: { title: string; run: number; plot: uPlot }[] = [];

function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** One range for the same figure of all runs, so that they can be compared. */
function range_of(figures: Figure[]): [number, number] {
  const fixed = figures[0].range;
  if (fixed) return fixed;
  let low = Infinity;
  let high = -Infinity;
  for (const { data } of figures) {
    for (const column of data.slice(1)) {
      for (const value of column) {
        if (value === null) continue;
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
  }
  if (!(low <= high)) return [0, 1];
  const margin = low < high ? 0.05 * (high - low) : 0.5;
  return [low - margin, high + margin];
}

/** Events in the plot's area, at most one line a pixel. */
function draw_events(plot: uPlot, events: Event[]): void {
  const { ctx } = plot;
  const { left, top, width, height } = plot.bbox;
  ctx.save();
  ctx.globalAlpha = 0.6;
  for (const event of events) {
    const x = Math.round(plot.valToPos(event.t_s, "x", true));
    if (x < left || x > left + width) continue;
    ctx.fillStyle = colour(event.level === "marker" ? "accent" : event.level === "info" ? "absent" : "alarm");
    ctx.fillRect(x, top, devicePixelRatio, height);
  }
  ctx.restore();
}

/** A zoom of one figure over time is one of all. */
let is_following = false;
function follow(from: uPlot): void {
  if (is_following) return;
  is_following = true;
  const { min, max } = from.scales.x;
  for (const plot of time_plots) {
    if (plot !== from && min !== undefined && max !== undefined) plot.setScale("x", { min, max });
  }
  is_following = false;
}

function draw(cell: HTMLElement, figure: Figure, range: [number, number], events: Event[]): uPlot {
  const axis = (label: string): uPlot.Axis => ({
    label, labelSize: 18, stroke: () => colour("ink"),
    grid: { stroke: () => colour("grid"), width: 1 }, ticks: { stroke: () => colour("grid"), width: 1 },
  });
  const show = (_: uPlot, value: number | null) => (value === null ? "–" : value.toPrecision(5));
  const options: uPlot.Options = {
    width: cell.clientWidth,
    height: kHeight_px,
    cursor: figure.is_time ? { sync: { key: "time" }, drag: { x: true, y: false } } : { drag: { x: true, y: false } },
    scales: {
      x: figure.is_time ? { time: false } : { time: false, distr: 3, log: 10 },
      y: { range: () => range },
    },
    axes: [axis(figure.x), axis(figure.y)],
    series: [
      { label: figure.x, value: show },
      ...figure.series.map((series): uPlot.Series => ({
        label: series.name, stroke: () => colour(series.colour), width: 1.3, value: show, spanGaps: false,
        points: { show: false },
      })),
    ],
    hooks: figure.is_time
      ? { setScale: [(plot, scale) => { if (scale === "x") follow(plot); }], draw: [(plot) => draw_events(plot, events)] }
      : {},
  };
  return new uPlot(options, figure.data as uPlot.AlignedData, cell);
}

for (const section of document.querySelectorAll<HTMLElement>("[data-figure]")) {
  const index = Number(section.dataset.figure);
  const range = range_of(runs.map((run) => run.figures[index]));
  section.querySelectorAll<HTMLElement>(".plot").forEach((cell, run) => {
    const figure = runs[run].figures[index];
    const plot = draw(cell, figure, range, runs[run].events);
    if (figure.is_time) time_plots.push(plot);
    plots.push({ title: figure.title, run, plot });
  });
}

addEventListener("resize", () => {
  for (const { plot } of plots) plot.setSize({ width: plot.root.parentElement!.clientWidth, height: kHeight_px });
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const { plot } of plots) plot.redraw();
});

// ---- for tests: what is shown
Object.defineProperty(window, "__report", {
  get: () => plots.map(({ title, run, plot }) => ({
    title, run, x: [plot.scales.x.min, plot.scales.x.max], at: plot.cursor.idx ?? null,
    points: plot.data[0].length, series: plot.series.slice(1).map(({ label }) => label),
  })),
});
