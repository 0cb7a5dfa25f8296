// SPDX-License-Identifier: Apache-2.0
// Colours that say something are told apart by people without one kind of cones. Their sight by the matrices of
// Machado, Oliveira and Fernandes, A Physiologically-based Model for Simulation of Color Vision Deficiency, IEEE TVCG
// 15(6), 2009, severity 1 (in linear light); distances in CIELAB (1976), of which 2.3 is just noticeable.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
import { css_gradient } from "../../../viewer_node/web/src/scene/colours";

const kSights: Record<string, number[][]> = {
  usual: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
  protanopia: [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
  deuteranopia: [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
  tritanopia: [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
};
const kToXyz = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]];
const kWhite = [0.95047, 1, 1.08883];

const times = (matrix: number[][], v: number[]) => matrix.map((row) => row.reduce((sum, one, i) => sum + one * v[i], 0));

function lab_of(hex: string, sight: number[][]): number[] {
  const linear = [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255)
    .map((value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4));
  const seen = times(sight, linear).map((value) => Math.min(Math.max(value, 0), 1));
  const [x, y, z] = times(kToXyz, seen).map((value, i) => value / kWhite[i])
    .map((value) => (value > (6 / 29) ** 3 ? Math.cbrt(value) : value / (3 * (6 / 29) ** 2) + 4 / 29));
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}
const distance = (a: string, b: string, sight: number[][]) =>
  Math.hypot(...lab_of(a, sight).map((value, i) => value - lab_of(b, sight)[i]));

/** The colours of the style sheet by theme. */
function palettes(): Record<string, Record<string, string>> {
  const css = readFileSync(`${process.env.PALPATE_WEB_SOURCE}/style.css`, "utf8");
  const of = (selector: string) => {
    const block = css.slice(css.indexOf(selector)).split("}")[0];
    return Object.fromEntries([...block.matchAll(/--([\w-]+): (#[0-9a-f]{6});/g)].map(([, name, hex]) => [name, hex]));
  };
  const light = of(":root {");
  return { light, dark: { ...light, ...of(':root[data-theme="dark"]') } };
}

// told apart by colour alone, or nearly so
const kPairs: [string, string, number][] = [
  ["requested", "applied", 40], // arrows and curves
  ["ledger", "truth", 30], // curves
  ["searched", "missed", 40], // points on an organ
  ["calm", "alarm", 20], // of a node, of a state; with words and another shape
  ["calm", "notice", 20],
];

for (const [theme, palette] of Object.entries(palettes())) {
  test(`colours that mean something differ for every kind of sight, ${theme}`, () => {
    for (const [one, other, least] of kPairs) {
      assert.ok(palette[one] && palette[other], `${one} and ${other} are in the style sheet`);
      for (const [sight, matrix] of Object.entries(kSights)) {
        const apart = distance(palette[one], palette[other], matrix);
        assert.ok(apart >= least, `${one} and ${other} are ${apart.toFixed(0)} apart for ${sight}, less than ${least}`);
      }
    }
  });
}

test("colour scales get darker from end to end for every kind of sight", () => {
  for (const name of ["stiffness", "displacement", "strain"] as const) {
    const stops = [...css_gradient(name).matchAll(/#[0-9a-f]{6}/g)].map(([hex]) => hex);
    for (const [sight, matrix] of Object.entries(kSights)) {
      const lightness = stops.map((hex) => lab_of(hex, matrix)[0]);
      lightness.slice(1).forEach((value, i) => assert.ok(value < lightness[i] - 4, `${name} for ${sight}: ${lightness.map(Math.round)}`));
    }
  }
});

test("red and green of the same lightness would not do", () => {
  assert.ok(distance("#c04040", "#4e7d28", kSights.usual) > 60);
  assert.ok(distance("#c04040", "#4e7d28", kSights.deuteranopia) < 20);
});
