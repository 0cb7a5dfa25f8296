// SPDX-License-Identifier: Apache-2.0
// ring.ts: the newest samples of a few signals, column by column, and their reduction to pixels.
// Memory is allocated once; appending and reducing allocate nothing.

/** The newest `capacity` rows; time strictly increases. */
export class Ring {
  private readonly time: Float64Array;
  private readonly columns: (Float32Array | Float64Array)[];
  private head = 0; // where the next row goes
  private size = 0;

  /** @param Column  Float64Array for running sums, which need more than 24 bits */
  constructor(column_count: number, readonly capacity: number, Column: typeof Float32Array | typeof Float64Array = Float32Array) {
    this.time = new Float64Array(capacity);
    this.columns = Array.from({ length: column_count }, () => new Column(capacity));
  }

  get length(): number {
    return this.size;
  }
  /** NaN while empty. */
  get newest_s(): number {
    return this.size > 0 ? this.time[this.slot(this.size - 1)] : NaN;
  }
  get oldest_s(): number {
    return this.size > 0 ? this.time[this.slot(0)] : NaN;
  }

  clear(): void {
    this.head = 0;
    this.size = 0;
  }

  /** Opens a row, every column NaN. False, and no row, unless it is newer than all before. */
  append(time_s: number): boolean {
    if (this.size > 0 && !(time_s > this.newest_s)) return false;
    this.time[this.head] = time_s;
    for (const column of this.columns) column[this.head] = NaN;
    this.head = (this.head + 1) % this.capacity;
    if (this.size < this.capacity) this.size += 1;
    return true;
  }

  /** Writes into the newest row. */
  set(column: number, value: number): void {
    this.columns[column][this.slot(this.size - 1)] = value;
  }

  /** Row 0 is the oldest. */
  value(column: number, row: number): number {
    return this.columns[column][this.slot(row)];
  }
  time_s(row: number): number {
    return this.time[this.slot(row)];
  }

  /** First row at or after the time; `length` if there is none. */
  first_at(time_s: number): number {
    let low = 0;
    let high = this.size;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time[this.slot(middle)] < time_s) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  private slot(row: number): number {
    const slot = this.head - this.size + row;
    return slot < 0 ? slot + this.capacity : slot;
  }
}

/** Equal cells of time that a plot is drawn in; two points each. */
export interface Cells {
  start_s: number;
  width_s: number;
  count: number;
}

/**
 * Cells that cover the window before `end_s`. Their borders are multiples of the width, so that a
 * sample stays in its cell while the window moves and the curve does not flicker.
 */
export function cells_of(end_s: number, window_s: number, count: number): Cells {
  const width_s = window_s / count;
  const last = Math.floor(end_s / width_s);
  return { start_s: (last - count + 1) * width_s, width_s, count };
}

/** Seconds before `end_s` of the points that `reduce` writes, into out[0 … 2 count). */
export function cell_times(cells: Cells, end_s: number, out: (number | null)[]): void {
  out.length = 2 * cells.count;
  for (let cell = 0; cell < cells.count; ++cell) {
    const begin = cells.start_s + cell * cells.width_s - end_s;
    out[2 * cell] = begin + 0.25 * cells.width_s;
    out[2 * cell + 1] = begin + 0.75 * cells.width_s;
  }
}

/**
 * Smallest and largest finite value of each cell, in order of time; null where a cell
 * has none, so no peak is lost however many samples share a pixel. A cell without samples between two samples
 * at most `bridge_s` apart repeats the last value (a signal slower than the pixels is no gap).
 */
export function reduce(
  ring: Ring, column: number, cells: Cells, out: (number | null)[], bridge_s = 0): void {
  out.length = 2 * cells.count;
  let row = ring.first_at(cells.start_s);
  let last = NaN;
  let last_s = -Infinity;
  for (let cell = 0; cell < cells.count; ++cell) {
    const end_s = cells.start_s + (cell + 1) * cells.width_s;
    let low = Infinity;
    let high = -Infinity;
    let low_row = 0;
    let high_row = 0;
    for (; row < ring.length && ring.time_s(row) < end_s; ++row) {
      const value = ring.value(column, row);
      if (!Number.isFinite(value)) {
        last = NaN;
        continue;
      }
      if (value < low) {
        low = value;
        low_row = row;
      }
      if (value > high) {
        high = value;
        high_row = row;
      }
      last = value;
      last_s = ring.time_s(row);
    }
    if (low <= high) {
      out[2 * cell] = low_row <= high_row ? low : high;
      out[2 * cell + 1] = low_row <= high_row ? high : low;
    } else {
      const is_bridged = Number.isFinite(last) && end_s - last_s <= bridge_s;
      out[2 * cell] = out[2 * cell + 1] = is_bridged ? last : null;
    }
  }
}
