// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import test from "node:test";
import { cell_times, cells_of, reduce, Ring } from "../../../viewer_node/web/src/ring";

function ring_of(samples: [number, number][], capacity = 16): Ring {
  const ring = new Ring(1, capacity);
  for (const [time_s, value] of samples) {
    if (ring.append(time_s)) ring.set(0, value);
  }
  return ring;
}

test("a full ring forgets its oldest rows", () => {
  const ring = ring_of([[1, 10], [2, 20], [3, 30], [4, 40], [5, 50]], 3);

  assert.equal(ring.length, 3);
  assert.deepEqual([0, 1, 2].map((row) => ring.value(0, row)), [30, 40, 50]);
  assert.equal(ring.oldest_s, 3);
  assert.equal(ring.newest_s, 5);
});

test("rows that are not newer are refused", () => {
  const ring = ring_of([[1, 10], [1, 11], [0.5, 12], [2, 20]]);

  assert.equal(ring.length, 2);
  assert.equal(ring.value(0, 0), 10);
  assert.equal(ring.append(NaN), false);
});

test("a column that is not written reads NaN, also where an older row was", () => {
  const ring = ring_of([[1, 10], [2, 20]], 2);
  ring.append(3);

  assert.ok(Number.isNaN(ring.value(0, 1)));
});

test("first_at finds the first row at or after a time, across the seam", () => {
  const ring = ring_of([[1, 1], [2, 2], [3, 3], [4, 4], [5, 5]], 3); // holds 3, 4, 5

  assert.equal(ring.first_at(0), 0);
  assert.equal(ring.first_at(4), 1);
  assert.equal(ring.first_at(4.5), 2);
  assert.equal(ring.first_at(9), 3);
});

test("cells end with the one that holds the present and begin on multiples of their width", () => {
  // 10 cells of 0.1 s before t = 7.23: the last one is 7.2 … 7.3, the first begins at 6.3
  const cells = cells_of(7.23, 1, 10);

  assert.ok(Math.abs(cells.start_s - 6.3) < 1e-9);
  const times: (number | null)[] = [];
  cell_times(cells, 7.23, times);
  assert.equal(times.length, 20);
  assert.ok(Math.abs(times[0]! - (6.325 - 7.23)) < 1e-9);
});

test("no peak is lost when many samples share a cell", () => {
  const ring = new Ring(1, 2000);
  for (let i = 0; i < 1000; ++i) {
    ring.append(1e-3 * i);
    ring.set(0, i === 437 ? 9 : i === 438 ? -4 : 1);
  }
  const out: (number | null)[] = [];
  reduce(ring, 0, { start_s: 0, width_s: 0.1, count: 10 }, out);

  assert.deepEqual(out.slice(8, 10), [9, -4]); // in the order in which they came
  assert.deepEqual(out.slice(0, 2), [1, 1]);
});

test("a gap is null, unless it is shorter than the bridge", () => {
  const ring = ring_of([[0.05, 1], [0.25, 2], [0.95, 3]]);
  const cells = { start_s: 0, width_s: 0.1, count: 10 };
  const out: (number | null)[] = [];

  reduce(ring, 0, cells, out, 0.2);

  // cell 1 ends 0.15 s after the sample of cell 0; cell 3 ends 0.15 s after that of cell 2; cell 4 0.25 s
  assert.deepEqual(out.filter((_, i) => i % 2 === 0), [1, 1, 2, 2, null, null, null, null, null, 3]);
});

test("an unknown value ends the curve at once", () => {
  const ring = ring_of([[0.05, 1], [0.15, NaN], [0.35, 2]]);
  const out: (number | null)[] = [];

  reduce(ring, 0, { start_s: 0, width_s: 0.1, count: 4 }, out, 10);

  assert.deepEqual(out.filter((_, i) => i % 2 === 0), [1, null, null, 2]);
});

test("an infinite bound draws nothing", () => {
  const ring = ring_of([[0.05, Infinity]]);
  const out: (number | null)[] = [];

  reduce(ring, 0, { start_s: 0, width_s: 0.1, count: 1 }, out);

  assert.deepEqual(out, [null, null]);
});
