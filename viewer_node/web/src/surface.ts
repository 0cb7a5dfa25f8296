// SPDX-License-Identifier: Apache-2.0
// surface.ts: one tissue's surface: rest shape, current shape, normals, colour data. Plain
// arrays, filled in place: a mesh frame of 20 000 vertices allocates nothing. No three.js.
import type { MeshFrame, TissueSteps, TissueSurface, Vector3 } from "./wire";

export type ColourMode = "material" | "stiffness" | "displacement" | "strain";

/** Edges with a larger angle between their faces are drawn sharp. */
const kCrease_cos = Math.cos((40 * Math.PI) / 180);

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

  /** Applies a frame; false, and nothing changes, if its range does not fit. */
  take(frame: MeshFrame): boolean {
    const bytes = frame.verticesM;
    const first = 12 * frame.firstVertex;
    if (bytes.length % 12 !== 0 || first + bytes.length > 12 * this.vertex_count) return false;
    if (frame.vertexStrain.length !== 0 && 3 * frame.vertexStrain.length !== bytes.length) return false;
    this.offset_m = frame.displacementWorldM ?? { x: 0, y: 0, z: 0 };
    if (bytes.length === 0) return true;
    // the payload is not aligned: copy the bytes, then view them as floats
    new Uint8Array(this.position.buffer).set(bytes, first);
    this.copy(this.position, 3);
    this.measure_displacement(frame.firstVertex, frame.firstVertex + bytes.length / 12);
    this.compute_normals();
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
    this.position.set(this.rest);
    let at = 0, next = 0;
    runs.forEach((length, run) => {
      if (run % 2 === 0) at += 3 * length;
      else for (const end = at + 3 * length; at < end; ++at) this.position[at] += step_m * moved[next++];
    });
    this.copy(this.position, 3);
    this.measure_displacement(0, this.vertex_count);
    this.compute_normals();
    return true;
  }

  private measure_displacement(first: number, end: number): void {
    const { rest, position, displacement_m } = this;
    for (let i = first; i < end; ++i) {
      const x = position[3 * i] - rest[3 * i];
      const y = position[3 * i + 1] - rest[3 * i + 1];
      const z = position[3 * i + 2] - rest[3 * i + 2];
      displacement_m[i] = Math.sqrt(x * x + y * y + z * z);
    }
    this.copy(displacement_m, 1);
    this.max_displacement_m = 0;
    for (const moved_m of displacement_m) {
      if (moved_m > this.max_displacement_m) this.max_displacement_m = moved_m;
    }
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
function floats_of(bytes: Uint8Array): Float32Array {
  return new Float32Array(aligned(bytes));
}
