// SPDX-License-Identifier: Apache-2.0
// surface.ts: one tissue's surface: rest shape, current shape, normals, colour data. Plain
// arrays, filled in place: a mesh frame of 20 000 vertices allocates nothing. No three.js.
import type { MeshFrame, TissueSteps, TissueSurface, Vector3 } from "../wire";

export type ColourMode = "material" | "stiffness" | "displacement" | "strain";

/** Edges with a larger angle between their faces are drawn sharp. */
const kCrease_cos = Math.cos((40 * Math.PI) / 180);

const kVerticesPerCell = 16;

/**
 * Arrays per vertex hold the vertices of the wire, then copies of those on sharp edges, one for each
 * further face that meets there, so that every face has its own normal.
 */
export class Surface {
  readonly name: string;
  readonly shape: number;
  readonly vertex_count: number; // on the wire
  private readonly copied: Uint32Array; // vertices of the copies
  readonly rest: Float32Array;
  readonly position: Float32Array;
  /** Displacement of the whole tissue, to be added to `position`; W. */
  offset_m: Vector3 = { x: 0, y: 0, z: 0 };
  readonly normal: Float32Array;
  readonly triangles: Uint32Array; // empty: points
  /** Per vertex; all equal where the tissue has one stiffness. */
  readonly stiffness: Float32Array;
  readonly stiffness_newton_per_m: number;
  /** Of the material, or of an elastic body 1 mm deep on the mean; 0: none. */
  readonly shown_stiffness_newton_per_m: number;
  /** Of the current shape. */
  max_displacement_m = 0;
  readonly displacement_m: Float32Array;
  /** Equivalent strain per vertex of an elastic body, ≥ 0; null until a frame has one. */
  strain: Float32Array | null = null;
  private readonly incoming: Float32Array; // places of the vertices of the wire that a message brings
  private readonly about: Adjacency;
  private readonly columns: Columns;

  constructor(tissue: TissueSurface) {
    this.name = tissue.name;
    this.shape = tissue.shape;
    const rest = floats_of(tissue.verticesM);
    this.vertex_count = rest.length / 3;
    if (!Number.isInteger(this.vertex_count)) throw new Error(`${tissue.name}: vertices are not triples`);
    this.triangles = new Uint32Array(aligned(tissue.triangles));
    if (this.triangles.length % 3 !== 0) throw new Error(`${tissue.name}: triangles are not triples`);
    for (const index of this.triangles) {
      if (index >= this.vertex_count) throw new Error(`${tissue.name}: a triangle names vertex ${index} of ${this.vertex_count}`);
    }
    this.copied = split_creases(rest, this.triangles);
    this.rest = new Float32Array(rest.length + 3 * this.copied.length);
    this.rest.set(rest);
    this.copy(this.rest, 3);
    this.position = this.rest.slice();
    this.normal = new Float32Array(this.rest.length);
    this.displacement_m = new Float32Array(this.rest.length / 3);
    this.stiffness_newton_per_m = tissue.stiffnessNewtonPerM;
    const per_vertex = floats_of(tissue.vertexStiffnessNewtonPerM);
    const is_uniform = per_vertex.length !== this.vertex_count || this.vertex_count === 0;
    this.stiffness = new Float32Array(this.rest.length / 3).fill(tissue.stiffnessNewtonPerM);
    if (!is_uniform) this.stiffness.set(per_vertex);
    this.copy(this.stiffness, 1);
    this.shown_stiffness_newton_per_m = tissue.stiffnessNewtonPerM > 0 || is_uniform
      ? tissue.stiffnessNewtonPerM : per_vertex.reduce((sum, k) => sum + k, 0) / per_vertex.length;
    this.incoming = new Float32Array(rest.length);
    this.about = new Adjacency(this.triangles, this.displacement_m.length);
    this.columns = new Columns(rest);
    this.compute_normals();
  }

  /** Of the vertices of the wire, to their copies. */
  private copy(values: Float32Array, width: number): void {
    const { copied, vertex_count } = this;
    for (let i = 0; i < copied.length; ++i) {
      for (let k = 0; k < width; ++k) values[width * (vertex_count + i) + k] = values[width * copied[i] + k];
    }
  }

  get max_strain(): number {
    let largest = 0;
    for (const strain of this.strain ?? []) if (strain > largest) largest = strain;
    return largest;
  }

  get is_points(): boolean {
    return this.triangles.length === 0;
  }

  /** Height (W) of the highest vertex below a point and within `reach_m` of its plumb line; −∞: none. */
  height_below({ x, y, z }: Vector3, reach_m: number): number {
    const { position: p, offset_m: o } = this;
    let best_m = -Infinity;
    this.columns.near(x - o.x, y - o.y, reach_m + this.max_displacement_m, (vertex) => {
      const height_m = p[3 * vertex + 2] + o.z;
      if (height_m > best_m && height_m < z && Math.abs(p[3 * vertex] + o.x - x) < reach_m && Math.abs(p[3 * vertex + 1] + o.y - y) < reach_m) best_m = height_m;
    });
    return best_m;
  }

  /**
   * About so many triangles at most, for a renderer that cannot draw all: of each cube of space, and of each of six
   * directions of the normal there, one vertex stands for the others. At rest.
   */
  coarse_triangles(most: number): Uint32Array {
    const { rest, normal, triangles } = this;
    if (triangles.length <= 3 * most) return triangles;
    // a surface through cubes of this width crosses one of them per width², and has two triangles there
    const cell_m = Math.sqrt((2 * area_of(rest, triangles)) / most) || Infinity;
    const of_cell = new Map<string, number>();
    const stands_for = new Uint32Array(rest.length / 3);
    for (let vertex = 0; vertex < stands_for.length; ++vertex) {
      const at = 3 * vertex;
      const [x, y, z] = [0, 1, 2].map((k) => Math.floor(rest[at + k] / cell_m));
      const cell = `${x},${y},${z},${direction_of(normal, at)}`;
      const there = of_cell.get(cell);
      if (there === undefined) of_cell.set(cell, vertex);
      stands_for[vertex] = there ?? vertex;
    }
    const coarse: number[] = [];
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [stands_for[triangles[t]], stands_for[triangles[t + 1]], stands_for[triangles[t + 2]]];
      if (a !== b && b !== c && c !== a) coarse.push(a, b, c);
    }
    return Uint32Array.from(coarse);
  }

  /** Applies a frame; false, and nothing changes, if its range does not fit. */
  take(frame: MeshFrame): boolean {
    const bytes = frame.verticesM;
    const first = 12 * frame.firstVertex;
    if (bytes.length % 12 !== 0 || first + bytes.length > 12 * this.vertex_count) return false;
    if (frame.vertexStrain.length !== 0 && 3 * frame.vertexStrain.length !== bytes.length) return false;
    this.offset_m = frame.displacementWorldM ?? { x: 0, y: 0, z: 0 };
    if (bytes.length === 0) return true;
    // the payload is not aligned: copy the bytes, then view them as floats
    new Uint8Array(this.incoming.buffer).set(bytes, first);
    this.move(frame.firstVertex, frame.firstVertex + bytes.length / 12);
    if (frame.vertexStrain.length !== 0) {
      this.strain ??= new Float32Array(this.rest.length / 3);
      new Uint8Array(this.strain.buffer).set(frame.vertexStrain, 4 * frame.firstVertex);
      this.copy(this.strain, 1);
    }
    return true;
  }

  /** Applies the complete state of MeshSteps, undefined: at rest; false, and nothing changes, if it does not fit. */
  take_steps(steps: TissueSteps | undefined, step_m: number): boolean {
    const runs = steps?.runs ?? [], moved = steps?.displacementSteps ?? [];
    let count = 0, vertices = 0;
    runs.forEach((length, run) => {
      vertices += length;
      if (run % 2 === 1) count += length;
    });
    if (vertices > this.vertex_count || moved.length !== 3 * count) return false;
    const [x = 0, y = 0, z = 0] = steps?.offsetSteps ?? [];
    this.offset_m = { x: step_m * x, y: step_m * y, z: step_m * z };
    if (count === 0 && this.max_displacement_m === 0) return true;
    const { incoming } = this;
    incoming.set(this.rest.subarray(0, incoming.length));
    let at = 0, next = 0;
    runs.forEach((length, run) => {
      if (run % 2 === 0) at += 3 * length;
      else for (const end = at + 3 * length; at < end; ++at) incoming[at] += step_m * moved[next++];
    });
    this.move(0, this.vertex_count);
    return true;
  }

  /** The vertices first … end of the wire go where `incoming` says. */
  private move(first: number, end: number): void {
    const { incoming, position, rest, displacement_m, copied, vertex_count, about } = this;
    about.begin();
    const place = (vertex: number, from: number) => {
      const to = 3 * vertex;
      const x = incoming[3 * from], y = incoming[3 * from + 1], z = incoming[3 * from + 2];
      if (x === position[to] && y === position[to + 1] && z === position[to + 2]) return;
      position[to] = x;
      position[to + 1] = y;
      position[to + 2] = z;
      const dx = x - rest[to], dy = y - rest[to + 1], dz = z - rest[to + 2];
      displacement_m[vertex] = Math.sqrt(dx * dx + dy * dy + dz * dz);
      about.note(vertex);
    };
    for (let vertex = first; vertex < end; ++vertex) place(vertex, vertex);
    for (let i = 0; i < copied.length; ++i) {
      if (copied[i] >= first && copied[i] < end) place(vertex_count + i, copied[i]);
    }
    this.max_displacement_m = 0;
    for (const moved_m of displacement_m) {
      if (moved_m > this.max_displacement_m) this.max_displacement_m = moved_m;
    }
    if (about.is_cheaper) about.renew_normals(position, this.normal);
    else this.compute_normals();
  }

  // Mean of the triangles' normals, weighted by area.
  private compute_normals(): void {
    const { position: p, normal: n, triangles } = this;
    n.fill(0);
    for (let t = 0; t < triangles.length; t += 3) {
      const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
      const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
      const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
      const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
      n[a] += x; n[a + 1] += y; n[a + 2] += z;
      n[b] += x; n[b + 1] += y; n[b + 2] += z;
      n[c] += x; n[c + 1] += y; n[c + 2] += z;
    }
    for (let i = 0; i < n.length; i += 3) {
      const length = Math.sqrt(n[i] * n[i] + n[i + 1] * n[i + 1] + n[i + 2] * n[i + 2]) || 1;
      n[i] /= length;
      n[i + 1] /= length;
      n[i + 2] /= length;
    }
  }
}

/** Twice the axis along which a normal is longest, plus one if it points backwards. */
function direction_of(normal: Float32Array, at: number): number {
  const size = [0, 1, 2].map((k) => Math.abs(normal[at + k]));
  const axis = size.indexOf(Math.max(...size));
  return 2 * axis + (normal[at + axis] < 0 ? 1 : 0);
}

function area_of(p: Float32Array, triangles: Uint32Array): number {
  let twice = 0;
  for (let t = 0; t < triangles.length; t += 3) {
    const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
    const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
    twice += Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx);
  }
  return twice / 2;
}

/** The vertices of a shape at rest, by square cells of the plane of x and y. */
class Columns {
  private readonly cells = new Map<number, number[]>(); // vertices, by cell
  private readonly cell_m: number;
  private readonly low: [number, number] = [Infinity, Infinity];
  private readonly across: number;

  constructor(rest: Float32Array) {
    const high = [-Infinity, -Infinity];
    for (let i = 0; i < rest.length; i += 3) {
      for (const k of [0, 1]) {
        this.low[k] = Math.min(this.low[k], rest[i + k]);
        high[k] = Math.max(high[k], rest[i + k]);
      }
    }
    const width_m = Math.max(high[0] - this.low[0], high[1] - this.low[1], 1e-6);
    this.across = Math.max(1, Math.ceil(Math.sqrt(rest.length / 3 / kVerticesPerCell)));
    this.cell_m = width_m / this.across;
    for (let i = 0; i < rest.length; i += 3) {
      const cell = this.cell(this.index(rest[i], 0), this.index(rest[i + 1], 1));
      const there = this.cells.get(cell);
      if (there) there.push(i / 3);
      else this.cells.set(cell, [i / 3]);
    }
  }

  /** Calls with each vertex that is at rest within `reach_m` per axis of the place, and with some further ones. */
  near(x: number, y: number, reach_m: number, take: (vertex: number) => void): void {
    const last = [this.index(x + reach_m, 0), this.index(y + reach_m, 1)];
    for (let i = this.index(x - reach_m, 0); i <= last[0]; ++i) {
      for (let j = this.index(y - reach_m, 1); j <= last[1]; ++j) this.cells.get(this.cell(i, j))?.forEach(take);
    }
  }

  private index(at_m: number, axis: 0 | 1): number {
    return Math.min(Math.max(Math.floor((at_m - this.low[axis]) / this.cell_m), 0), this.across);
  }
  private cell(i: number, j: number): number {
    return i * (this.across + 1) + j;
  }
}

/** The triangles at each vertex, to renew the normals near vertices that have moved. */
class Adjacency {
  private readonly first: Uint32Array; // by vertex, in `faces`
  private readonly faces: Uint32Array;
  private readonly dirty: Uint32Array; // vertices whose normal is to be renewed
  private readonly noted: Uint8Array;
  private count = 0;

  constructor(private readonly triangles: Uint32Array, vertices: number) {
    this.first = new Uint32Array(vertices + 1);
    for (const vertex of triangles) this.first[vertex + 1] += 1;
    for (let v = 0; v < vertices; ++v) this.first[v + 1] += this.first[v];
    this.faces = new Uint32Array(triangles.length);
    const next = this.first.slice();
    triangles.forEach((vertex, corner) => { this.faces[next[vertex]++] = Math.floor(corner / 3); });
    this.dirty = new Uint32Array(vertices);
    this.noted = new Uint8Array(vertices);
  }

  begin(): void {
    this.count = 0;
    this.noted.fill(0);
  }

  /** The vertex has moved: the normals of its triangles' corners change. */
  note(vertex: number): void {
    for (let i = this.first[vertex]; i < this.first[vertex + 1]; ++i) {
      const corner = 3 * this.faces[i];
      for (let k = 0; k < 3; ++k) {
        const other = this.triangles[corner + k];
        if (this.noted[other]) continue;
        this.noted[other] = 1;
        this.dirty[this.count++] = other;
      }
    }
  }

  /** Each triangle is at three of those vertices: beyond a fifth, all at once cost less. */
  get is_cheaper(): boolean {
    return 5 * this.count < this.dirty.length;
  }

  renew_normals(p: Float32Array, n: Float32Array): void {
    const { triangles, faces, first, dirty } = this;
    for (let i = 0; i < this.count; ++i) {
      const vertex = dirty[i];
      let x = 0, y = 0, z = 0;
      for (let j = first[vertex]; j < first[vertex + 1]; ++j) {
        const t = 3 * faces[j];
        const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2];
        const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
        const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
        x += uy * vz - uz * vy;
        y += uz * vx - ux * vz;
        z += ux * vy - uy * vx;
      }
      const length = Math.sqrt(x * x + y * y + z * z) || 1;
      n[3 * vertex] = x / length;
      n[3 * vertex + 1] = y / length;
      n[3 * vertex + 2] = z / length;
    }
  }
}

/**
 * Gives the faces beyond a sharp edge vertices of their own: rewrites `triangles`.
 * @return the vertices that were copied; the copies follow the last vertex, in this order
 */
function split_creases(rest: Float32Array, triangles: Uint32Array): Uint32Array {
  const faces = triangles.length / 3, vertices = rest.length / 3;
  const normal = new Float32Array(3 * faces);
  const first = new Uint32Array(vertices + 1); // of a vertex' corners, in `corners`
  for (let f = 0; f < faces; ++f) {
    const [a, b, c] = triangles.subarray(3 * f, 3 * f + 3);
    const u = [0, 1, 2].map((k) => rest[3 * b + k] - rest[3 * a + k]);
    const v = [0, 1, 2].map((k) => rest[3 * c + k] - rest[3 * a + k]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...n);
    if (length > 0) for (let k = 0; k < 3; ++k) normal[3 * f + k] = n[k] / length;
    for (const vertex of [a, b, c]) first[vertex + 1] += 1;
  }
  for (let v = 0; v < vertices; ++v) first[v + 1] += first[v];
  const corners = new Uint32Array(triangles.length);
  const next = first.slice();
  triangles.forEach((vertex, corner) => { corners[next[vertex]++] = corner; });

  const are_smooth = (f: number, g: number) => {
    const cos = normal[3 * f] * normal[3 * g] + normal[3 * f + 1] * normal[3 * g + 1] + normal[3 * f + 2] * normal[3 * g + 2];
    const is_flat = (one: number) => normal[3 * one] === 0 && normal[3 * one + 1] === 0 && normal[3 * one + 2] === 0;
    return cos >= kCrease_cos || is_flat(f) || is_flat(g);
  };
  const copied: number[] = [];
  const face_at = new Map<number, number>(); // by the other end of an edge: index of a corner
  const was = triangles.slice();
  for (let v = 0; v < vertices; ++v) {
    // the faces about a vertex in groups, joined across smooth edges
    const count = first[v + 1] - first[v];
    const group = Array.from({ length: count }, (_, i) => i);
    const root = (i: number): number => (group[i] === i ? i : root(group[i]));
    face_at.clear();
    for (let i = 0; i < count; ++i) {
      const corner = corners[first[v] + i], f = Math.floor(corner / 3);
      for (const step of [1, 2]) {
        const other = was[3 * f + ((corner % 3) + step) % 3];
        const there = face_at.get(other);
        if (there === undefined) face_at.set(other, i);
        else if (are_smooth(f, Math.floor(corners[first[v] + there] / 3))) {
          const [low, high] = [root(i), root(there)].sort((a, b) => a - b);
          group[high] = low;
        }
      }
    }
    const vertex_of = new Map<number, number>();
    for (let i = 0; i < count; ++i) {
      const its = root(i);
      let vertex = vertex_of.get(its);
      if (vertex === undefined) {
        vertex = vertex_of.size === 0 ? v : vertices + copied.push(v) - 1;
        vertex_of.set(its, vertex);
      }
      triangles[corners[first[v] + i]] = vertex;
    }
  }
  return Uint32Array.from(copied);
}

/** FNV-1a over every vertex at rest: two pages with equal values show the same scene. */
export function scene_signature(surfaces: Surface[]): string {
  let hash = 0x811c9dc5;
  for (const { rest, triangles } of surfaces) {
    for (const array of [rest, triangles]) {
      for (const byte of new Uint8Array(array.buffer, array.byteOffset, array.byteLength)) {
        hash = Math.imul(hash ^ byte, 0x01000193);
      }
    }
  }
  return (hash >>> 0).toString(16).padStart(8, "0");
}

function aligned(bytes: Uint8Array): ArrayBuffer {
  return bytes.slice().buffer as ArrayBuffer;
}
export function floats_of(bytes: Uint8Array): Float32Array {
  return new Float32Array(aligned(bytes));
}
