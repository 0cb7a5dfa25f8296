// SPDX-License-Identifier: Apache-2.0
// problems.mjs — the bodies of tissue_problems.h as MJCF: the same nodes and tetrahedra, one body with
// three slide joints for each free node, whose mass is a quarter of the elements around it.

const mu_pa = 1e4;
const lambda_pa = 5e4;
const density_kg_per_m3 = 100;
const gravity_m_per_s2 = 9.80665;

export const bar = { side_m: 0.6, length_m: 1.6 };
export const slab = { side_m: 1.0, height_m: 0.4 };
export const sphere_radius_m = 0.3;
export const press_m = 0.04;
export const twist_rad = Math.PI / 3;

/** Damping of each node in proportion to its mass [1/s]: it brings a body to rest and leaves the rest as it is. */
export const damping_per_s = 30;

// Corners of a cell, as in physics_node/elastic/mesh.cpp.
const even = [[0, 1, 3, 4], [1, 2, 3, 6], [1, 4, 6, 5], [3, 4, 7, 6], [1, 3, 4, 6]];
const odd = [[0, 1, 2, 5], [0, 2, 3, 7], [0, 5, 7, 4], [2, 5, 6, 7], [0, 2, 7, 5]];

/** A box of equal cells, of five tetrahedra each. */
function box_mesh(sides_m, cells) {
  const nodes_m = [];
  for (let k = 0; k <= cells[2]; ++k)
    for (let j = 0; j <= cells[1]; ++j)
      for (let i = 0; i <= cells[0]; ++i) nodes_m.push([i, j, k].map((n, x) => (sides_m[x] * n) / cells[x]));
  const index = (i, j, k) => (k * (cells[1] + 1) + j) * (cells[0] + 1) + i;
  const elements = [];
  const masses_kg = nodes_m.map(() => 0);
  for (let k = 0; k < cells[2]; ++k)
    for (let j = 0; j < cells[1]; ++j)
      for (let i = 0; i < cells[0]; ++i) {
        const corners = [0, 1].flatMap((up) => [[0, 0], [1, 0], [1, 1], [0, 1]].map(([x, y]) => index(i + x, j + y, k + up)));
        for (const corner of (i + j + k) % 2 === 0 ? even : odd) {
          const t = corner.map((c) => corners[c]);
          const volume = six_volumes(nodes_m, t);
          if (volume < 0) [t[2], t[3]] = [t[3], t[2]];
          for (const node of t) masses_kg[node] += (density_kg_per_m3 * Math.abs(volume)) / 24;
          elements.push(t);
        }
      }
  return { nodes_m, elements, masses_kg };
}

function six_volumes(x, t) {
  const [a, b, c] = [1, 2, 3].map((i) => x[t[i]].map((value, axis) => value - x[t[0]][axis]));
  return (a[1] * b[2] - a[2] * b[1]) * c[0] + (a[2] * b[0] - a[0] * b[2]) * c[1] + (a[0] * b[1] - a[1] * b[0]) * c[2];
}

/** The whole model. `fixed(x)`: nodes that do not move; `turned(x)`: those of the plate, if there is one. */
function mjcf({ mesh, fixed, turned = () => false, gravity = 0, has_sphere = false, settings }) {
  const free = [];
  const bodies = [];
  const plate = [];
  mesh.nodes_m.forEach((x, i) => {
    const at = `<body name="n${i}" pos="${x.join(" ")}"`;
    if (fixed(x)) return bodies.push(`${at}/>`);
    if (turned(x)) return plate.push(`<body name="n${i}" pos="${x[0] - 0.5 * bar.side_m} ${x[1] - 0.5 * bar.side_m} ${x[2]}"/>`);
    free.push(i);
    const joint = (axis) => `<joint type="slide" axis="${axis}" damping="${damping_per_s * mesh.masses_kg[i]}"/>`;
    const inertia = `<inertial pos="0 0 0" mass="${mesh.masses_kg[i]}" diaginertia="1e-6 1e-6 1e-6"/>`;
    return bodies.push(`${at}>${inertia}${joint("1 0 0")}${joint("0 1 0")}${joint("0 0 1")}</body>`);
  });
  // Heavy enough to stay where the script puts it.
  const turntable = plate.length === 0 ? "" : `<body name="plate" pos="${0.5 * bar.side_m} ${0.5 * bar.side_m} 0">
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="turn" axis="0 0 1" armature="1e9"/>${plate.join("")}</body>`;
  const ball = !has_sphere ? "" : `<body name="sphere" mocap="true" pos="${0.5 * slab.side_m} ${0.5 * slab.side_m} 10">
    <geom type="sphere" size="${sphere_radius_m}" condim="1" priority="0" solref="${settings.solref}" solimp="${settings.solimp}"/></body>`;
  const lambda = lambda_pa * settings.lambda_ratio;
  const young_pa = (mu_pa * (3 * lambda + 2 * mu_pa)) / (lambda + mu_pa);
  const poisson_ratio = (0.5 * lambda) / (lambda + mu_pa);
  const xml = `<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 ${-gravity}" timestep="0.001" integrator="${settings.integrator}" solver="${settings.solver}"
    iterations="${settings.iterations}" tolerance="${settings.tolerance}" jacobian="sparse"/>
  <size memory="800M"/>
  <worldbody>${ball}${turntable}${bodies.join("\n")}</worldbody>
  <deformable>
    <flex name="tissue" dim="3" radius="1e-4" body="${mesh.nodes_m.map((_, i) => `n${i}`).join(" ")}"
      element="${mesh.elements.flat().join(" ")}">
      <contact condim="1" selfcollide="none" internal="false" solref="${settings.solref}" solimp="${settings.solimp}"
        ${has_sphere ? "" : 'contype="0" conaffinity="0"'}/>
      <elasticity young="${young_pa}" poisson="${poisson_ratio}" damping="${settings.flex_damping_s}"/>
    </flex>
  </deformable>
</mujoco>`;
  return { xml, free, mesh };
}

const at_top = (top_m) => (x) => x[2] > top_m - 1e-9;
const at_bottom = (x) => x[2] < 1e-9;

export const models = {
  /** Held nowhere. */
  block: ([across, deep], settings) =>
    mjcf({ mesh: box_mesh([slab.side_m, slab.side_m, slab.height_m], [across, across, deep]),
           fixed: () => false, settings }),
  hang: ([across, along], settings) =>
    mjcf({ mesh: box_mesh([bar.side_m, bar.side_m, bar.length_m], [across, across, along]),
           fixed: at_top(bar.length_m), gravity: gravity_m_per_s2 * settings.gravity_ratio, settings }),
  press: ([across, deep], settings) =>
    mjcf({ mesh: box_mesh([slab.side_m, slab.side_m, slab.height_m], [across, across, deep]),
           fixed: at_bottom, has_sphere: true, settings }),
  twist: ([across, along], settings) =>
    mjcf({ mesh: box_mesh([bar.side_m, bar.side_m, bar.length_m], [across, across, along]),
           fixed: at_top(bar.length_m), turned: at_bottom, settings }),
};
