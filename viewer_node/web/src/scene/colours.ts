// SPDX-License-Identifier: Apache-2.0
// colours.ts: colours of tissues and colour scales; all others are in the style sheet.

/** By index in the scene: outer tissue first. */
const kTissueColours = ["#d8968a", "#7d3f4a", "#e2c58f", "#a86a7c", "#b9a6a0", "#8f5a3c"];
export function tissue_colour(index: number): string {
  return kTissueColours[index % kTissueColours.length];
}

/** From low to high; lightness falls evenly, so the scales are readable without colour. */
const kScales = {
  stiffness: ["#e4e9df", "#a9cdbf", "#62a5ac", "#2f7596", "#24437a", "#1d1c4b"],
  displacement: ["#ece2d6", "#f3c689", "#ea8f5a", "#cc5350", "#8e2a5b", "#471457"],
  strain: ["#e6e4ee", "#c3b9e0", "#a184cf", "#8550b0", "#63287f", "#3a0f4c"],
};
export type ScaleName = keyof typeof kScales;

const kSteps = 256;

/** 256 colours, r,g,b in linear light: as shaders use it. */
export function linear_table(name: ScaleName): Float32Array {
  const stops = kScales[name].map((hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255));
  const table = new Float32Array(3 * kSteps);
  for (let i = 0; i < kSteps; ++i) {
    const at = (i / (kSteps - 1)) * (stops.length - 1);
    const low = Math.min(Math.floor(at), stops.length - 2);
    for (let c = 0; c < 3; ++c) {
      const srgb = stops[low][c] + (at - low) * (stops[low + 1][c] - stops[low][c]);
      table[3 * i + c] = srgb <= 0.04045 ? srgb / 12.92 : ((srgb + 0.055) / 1.055) ** 2.4;
    }
  }
  return table;
}

/** Row of the table for a value; clamped to low … high. */
export function table_row(value: number, low: number, high: number): number {
  if (!(high > low)) return kSteps >> 1;
  const ratio = (value - low) / (high - low);
  return Math.round((kSteps - 1) * Math.min(Math.max(ratio, 0), 1));
}

export function css_gradient(name: ScaleName): string {
  return `linear-gradient(to right, ${kScales[name].join(", ")})`;
}

/** The smallest of 1, 2, 5 × 10ⁿ that is not below the value. */
export function round_up(value: number): number {
  if (!(value > 0)) return 0;
  const decade = 10 ** Math.floor(Math.log10(value));
  for (const step of [1, 2, 5, 10]) {
    if (step * decade >= value * (1 - 1e-9)) return step * decade;
  }
  return 10 * decade;
}
