// SPDX-License-Identifier: Apache-2.0
import assert from "node:assert/strict";
import test from "node:test";
import { round_up, table_row } from "../../../viewer_node/web/src/scene/colours";
import { scene_signature, Surface } from "../../../viewer_node/web/src/scene/surface";
import type { MeshFrame, TissueSurface } from "../../../viewer_node/web/src/wire";

const bytes_of = (array: Float32Array | Uint32Array) => new Uint8Array(array.buffer);

// at an odd offset, as in a WebSocket frame
function misaligned(array: Float32Array | Uint32Array): Uint8Array {
  const whole = new Uint8Array(array.byteLength + 13);
  whole.set(bytes_of(array), 13);
  return whole.subarray(13);
}

// two triangles: the unit square in z = 0, counter-clockwise seen from above
function square(more: Partial<TissueSurface> = {}): TissueSurface {
  return {
    name: "square", shape: 3,
    verticesM: misaligned(Float32Array.of(0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0)),
    triangles: misaligned(Uint32Array.of(0, 1, 2, 0, 2, 3)),
    vertexStiffnessNewtonPerM: new Uint8Array(), stiffnessNewtonPerM: 250, dampingNewtonSPerM: 1, ...more,
  };
}
function frame(firstVertex: number, vertices: number[]): MeshFrame {
  return {
    header: { sessionId: 1n, sequence: 0n, sampledAtNs: 0n }, sceneRevision: 1n, tissue: 0, firstVertex,
    verticesM: misaligned(Float32Array.from(vertices)), vertexStrain: new Uint8Array(), deviceSequence: 0n,
  };
}

test("a surface at rest: normals point outwards, nothing is displaced", () => {
  const surface = new Surface(square());

  assert.equal(surface.vertex_count, 4);
  assert.deepEqual([...surface.normal.slice(0, 3)], [0, 0, 1]);
  assert.deepEqual([...surface.displacement_m], [0, 0, 0, 0]);
  assert.deepEqual([...surface.stiffness], [250, 250, 250, 250]);
});

test("a frame moves its range of vertices and no other", () => {
  const surface = new Surface(square());

  assert.ok(surface.take(frame(1, [1, 0, -0.3, 1, 1, -0.4])));

  assert.deepEqual([...surface.position.slice(0, 3)], [0, 0, 0]);
  assert.ok(Math.abs(surface.displacement_m[1] - 0.3) < 1e-7);
  assert.ok(Math.abs(surface.max_displacement_m - 0.4) < 1e-7);
  assert.ok(surface.normal[0] > 0); // it slopes down towards +x
});

test("a frame without vertices moves the tissue as a whole, with its dent", () => {
  const surface = new Surface(square());
  assert.ok(surface.take(frame(2, [1, 1, -0.4])));
  const dented = [...surface.position];

  assert.ok(surface.take({ ...frame(0, []), displacementWorldM: { x: 0, y: 0, z: 0.25 } }));

  assert.deepEqual(surface.offset_m, { x: 0, y: 0, z: 0.25 });
  assert.deepEqual([...surface.position], dented);
  assert.ok(Math.abs(surface.max_displacement_m - 0.4) < 1e-7); // how far it gave way, not where it is

  assert.ok(surface.take(frame(2, [1, 1, 0]))); // says of no displacement: it is where the scene has it
  assert.deepEqual(surface.offset_m, { x: 0, y: 0, z: 0 });
});

test("a frame beyond the surface is refused and changes nothing", () => {
  const surface = new Surface(square());

  assert.equal(surface.take({ ...frame(3, [0, 0, 9, 0, 0, 9]), displacementWorldM: { x: 1, y: 0, z: 0 } }), false);
  assert.deepEqual(surface.offset_m, { x: 0, y: 0, z: 0 });
  assert.deepEqual([...surface.position], [...surface.rest]);
});

test("the strain of an elastic body is that of its frames", () => {
  const surface = new Surface(square());
  assert.equal(surface.strain, null);
  assert.equal(surface.max_strain, 0);

  const strained = { ...frame(1, [1, 0, -0.3, 1, 1, -0.4]), vertexStrain: misaligned(Float32Array.of(0.125, 0.5)) };
  assert.ok(surface.take(strained));
  assert.deepEqual([...surface.strain!], [0, 0.125, 0.5, 0]);
  assert.equal(surface.max_strain, 0.5);
  assert.ok(surface.take(frame(0, [0, 0, 0]))); // without: as before
  assert.equal(surface.max_strain, 0.5);

  // one value for two vertices
  assert.equal(surface.take({ ...strained, vertexStrain: misaligned(Float32Array.of(0.25)) }), false);
  assert.equal(surface.max_strain, 0.5);
});

test("broken arrays are refused with the tissue’s name", () => {
  assert.throws(() => new Surface(square({ triangles: bytes_of(Uint32Array.of(0, 1, 4)) })), /square: a triangle names vertex 4 of 4/);
  assert.throws(() => new Surface(square({ verticesM: bytes_of(Float32Array.of(0, 1)) })), /not triples/);
  assert.throws(() => new Surface(square({ verticesM: new Uint8Array(7) })));
});

test("a surface without triangles is points", () => {
  assert.ok(new Surface(square({ triangles: new Uint8Array() })).is_points);
});

test("the signature is that of the geometry", () => {
  const signature = scene_signature([new Surface(square())]);

  assert.equal(scene_signature([new Surface(square({ name: "other" }))]), signature);
  const moved = square({ verticesM: bytes_of(Float32Array.of(0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 1e-6)) });
  assert.notEqual(scene_signature([new Surface(moved)]), signature);
});

test("scales end on 1, 2 or 5 times a power of ten", () => {
  assert.equal(round_up(0.0031), 0.005);
  assert.equal(round_up(0.001), 0.001);
  assert.equal(round_up(7), 10);
  assert.equal(table_row(0.5, 0, 1), 128);
  assert.equal(table_row(9, 0, 1), 255);
  assert.equal(table_row(3, 3, 3), 128); // one stiffness everywhere
});

test("mesh steps are the complete state: what they do not name is at rest", () => {
  const surface = new Surface(square());
  const steps = { tissue: 0, runs: [1, 2], displacementSteps: [0, 0, -6000, 2, 0, -8000], offsetSteps: [0, 0, 5000] };

  assert.ok(surface.take_steps(steps, 0.00005));
  assert.ok(Math.abs(surface.position[3 + 2] + 0.3) < 1e-6);
  assert.ok(Math.abs(surface.position[6] - 1.0001) < 1e-6);
  assert.ok(Math.abs(surface.max_displacement_m - 0.4) < 1e-6);
  assert.equal(surface.offset_m.z, 0.25);

  assert.equal(surface.take_steps({ ...steps, runs: [1, 4] }, 0.00005), false); // beyond the surface
  assert.equal(surface.take_steps({ ...steps, runs: [1, 1] }, 0.00005), false); // fewer than it gives
  assert.equal(surface.offset_m.z, 0.25);

  assert.ok(surface.take_steps(undefined, 0.00005));
  assert.deepEqual([...surface.position], [...surface.rest]);
  assert.equal(surface.max_displacement_m, 0);
});

// a closed cube whose faces share their 8 vertices
function cube(): TissueSurface {
  const vertices = Array.from({ length: 8 }, (_, i) => [i & 1, (i >> 1) & 1, i >> 2]).flat();
  const quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
  const triangles = quads.flatMap(([a, b, c, d]) => [a, b, c, a, c, d]);
  return square({ verticesM: bytes_of(Float32Array.from(vertices)), triangles: bytes_of(Uint32Array.from(triangles)) });
}

// a bumpy sheet of n × n squares, 1 mm wide
function sheet(n: number): TissueSurface {
  const vertices: number[] = [], triangles: number[] = [];
  for (let i = 0; i <= n; ++i) {
    for (let j = 0; j <= n; ++j) vertices.push(1e-3 * i, 1e-3 * j, 2e-4 * Math.sin(0.7 * i) * Math.cos(0.4 * j));
  }
  for (let i = 0; i < n; ++i) {
    for (let j = 0; j < n; ++j) {
      const a = i * (n + 1) + j;
      triangles.push(a, a + n + 1, a + 1, a + 1, a + n + 1, a + n + 2);
    }
  }
  return square({ verticesM: bytes_of(Float32Array.from(vertices)), triangles: bytes_of(Uint32Array.from(triangles)) });
}

for (const [vertices, words] of [[30, "few"], [1500, "most"]] as const) {
  test(`after ${words} vertices have moved, every normal is that of the new shape`, () => {
    const surface = new Surface(sheet(40));
    for (const depth_m of [3e-3, 1e-3, 0]) { // down, and up again
      const first = 100;
      const moved = [...surface.rest.slice(3 * first, 3 * (first + vertices))].map((x, i) => (i % 3 === 2 ? x - depth_m * Math.abs(Math.sin(i)) : x));
      assert.ok(surface.take(frame(first, moved)));

      const normals = new Float32Array(surface.normal.length);
      const at = (v: number) => [...surface.position.slice(3 * v, 3 * v + 3)];
      for (let t = 0; t < surface.triangles.length; t += 3) {
        const corners = [...surface.triangles.slice(t, t + 3)];
        const [a, b, c] = corners.map(at);
        const [u, v] = [b, c].map((end) => end.map((x, k) => x - a[k]));
        const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        for (const corner of corners) n.forEach((x, k) => { normals[3 * corner + k] += x; });
      }
      for (let v = 0; v < normals.length; v += 3) {
        const length = Math.hypot(...normals.slice(v, v + 3));
        for (let k = 0; k < 3; ++k) assert.ok(Math.abs(surface.normal[v + k] - normals[v + k] / length) < 1e-3, `vertex ${v / 3}`);
      }
    }
  });
}

test("the highest vertex below the tool, of the shape as it is", () => {
  const surface = new Surface(sheet(40));
  const below = (x: number, y: number, z: number) => {
    let best = -Infinity;
    for (let i = 0; i < surface.position.length; i += 3) {
      const [px, py, pz] = [surface.position[i] + surface.offset_m.x, surface.position[i + 1], surface.position[i + 2]];
      if (pz < z && pz > best && Math.abs(px - x) < 2.5e-3 && Math.abs(py - y) < 2.5e-3) best = pz;
    }
    return best;
  };
  // a fold: some vertices lie far from their place at rest
  const folded = [...surface.rest.slice(300, 600)].map((x, i) => (i % 3 === 0 ? x + 9e-3 : i % 3 === 2 ? x + 4e-3 : x));
  assert.ok(surface.take({ ...frame(100, folded), displacementWorldM: { x: 5e-3, y: 0, z: 0 } }));
  for (const x of [-0.01, 0, 0.005, 0.013, 0.02, 0.046]) {
    for (const z of [-1, 1e-3, 0.1]) assert.equal(surface.height_below({ x, y: 0.02, z }, 2.5e-3), below(x, 0.02, z));
  }
});

test("edges above 40° are sharp: each face of a cube has its own normal", () => {
  const surface = new Surface(cube());
  assert.equal(surface.vertex_count, 8);
  for (let t = 0; t < surface.triangles.length; t += 3) {
    const normals = [...surface.triangles.slice(t, t + 3)].map((v) => [...surface.normal.slice(3 * v, 3 * v + 3)]);
    assert.deepEqual(normals[1], normals[0]);
    assert.deepEqual(normals[2], normals[0]);
    assert.equal(normals[0].filter((x) => Math.abs(x) === 1).length, 1);
  }

  // a corner moves on all faces, and so do its colours
  assert.ok(surface.take({ ...frame(7, [1.5, 1, 1]), vertexStrain: bytes_of(Float32Array.of(0.25)) }));
  const moved = [...surface.displacement_m].filter((x) => x === 0.5).length;
  assert.equal(moved, 3);
  assert.equal([...surface.strain!].filter((x) => x === 0.25).length, 3);
  assert.equal(surface.position.filter((x) => x === 1.5).length, 3);
  assert.equal(surface.take(frame(8, [0, 0, 0])), false); // the wire has 8 vertices
});

for (const [degrees, copies] of [[30, 0], [50, 2]]) {
  test(`a bend of ${degrees}° has ${copies} vertices more`, () => {
    const angle = (degrees * Math.PI) / 180;
    // two squares with a common edge from (0, 0, 0) to (0, 1, 0)
    const vertices = [-1, 0, 0, -1, 1, 0, 0, 0, 0, 0, 1, 0, Math.cos(angle), 0, -Math.sin(angle), Math.cos(angle), 1, -Math.sin(angle)];
    const surface = new Surface(square({
      verticesM: bytes_of(Float32Array.from(vertices)), triangles: bytes_of(Uint32Array.of(0, 2, 1, 1, 2, 3, 2, 4, 3, 3, 4, 5)),
    }));
    assert.equal(surface.rest.length / 3 - surface.vertex_count, copies);
  });
}

test("an elastic body has the stiffness of its vertices, though its material has no k", () => {
  const surface = new Surface(square({ stiffnessNewtonPerM: 0, vertexStiffnessNewtonPerM: misaligned(Float32Array.of(90, 90, 90, 130)) }));
  assert.deepEqual([...surface.stiffness], [90, 90, 90, 130]);
  assert.equal(surface.stiffness_newton_per_m, 0);
  assert.equal(surface.shown_stiffness_newton_per_m, 100);
});

test("drawn on the processor, a fine surface has fewer triangles of the same vertices", () => {
  // a cylinder of radius 1 and height 1 with a lid, whose rim is sharp
  const around = 240, up = 60, vertices: number[] = [], triangles: number[] = [];
  const ring = (radius: number, z: number) => {
    for (let i = 0; i < around; ++i) vertices.push(radius * Math.cos((2 * Math.PI * i) / around), radius * Math.sin((2 * Math.PI * i) / around), z);
  };
  for (let j = 0; j <= up; ++j) ring(1, j / up);
  for (let j = 1; j < up; ++j) ring(1 - j / up, 1);
  for (let j = 0; j + 1 < vertices.length / 3 / around; ++j) {
    for (let i = 0; i < around; ++i) {
      const a = around * j + i, b = around * j + ((i + 1) % around);
      triangles.push(a, b, b + around, a, b + around, a + around);
    }
  }
  const surface = new Surface(square({ verticesM: misaligned(Float32Array.from(vertices)), triangles: misaligned(Uint32Array.from(triangles)) }));
  const area = (indices: Uint32Array) => {
    let sum = 0;
    for (let t = 0; t < indices.length; t += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => surface.rest.subarray(3 * indices[t + k], 3 * indices[t + k] + 3));
      const u = b.map((x, k) => x - a[k]), v = c.map((x, k) => x - a[k]);
      const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      for (const k of [0, 1, 2]) {
        const corner = 3 * indices[t + k];
        const along = n.reduce((dot, x, i) => dot + x * surface.normal[corner + i], 0) / Math.hypot(...n);
        assert.ok(along > 0.5, `a face and the normal of its corner are ${along} apart`);
      }
      sum += Math.hypot(...n) / 2;
    }
    return sum;
  };
  assert.equal(surface.coarse_triangles(triangles.length / 3), surface.triangles, "all, where there are no more");

  const coarse = surface.coarse_triangles(4000);
  assert.ok(coarse.length / 3 > 2000 && coarse.length / 3 < 8000, `${coarse.length / 3} triangles`);
  const whole = area(surface.triangles);
  assert.ok(Math.abs(area(coarse) / whole - 1) < 0.05, `${area(coarse)} of ${whole}`);
});
