// SPDX-License-Identifier: Apache-2.0
// scene_view.ts: the 3-D view: tissue, tool, forces. Draws only when something has changed.
import {
  BufferAttribute, BufferGeometry, Box3, Box3Helper, Color, DirectionalLight, DynamicDrawUsage, Fog, FrontSide, GridHelper, Group,
  HemisphereLight, InstancedMesh, Line, LineBasicMaterial, LineDashedMaterial, Matrix4, Mesh, MeshBasicMaterial, MeshStandardMaterial, PCFShadowMap,
  PerspectiveCamera, Points, PointsMaterial, Scene, SphereGeometry, Vector3 as V3, WebGLRenderer,
  type Material, type WebGLProgramParametersWithUniforms,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { linear_table, round_up, table_row, tissue_colour } from "./colours";
import type { ColourMode, Surface } from "./surface";
import { kDrawnTip_m, line, set_line, Tool, type Theme, type ToolSize } from "./tool_view";
import type { Lesion, Quaternion, Vector3 } from "../wire";

const kGridPitch_m = 0.01;
const kNearTool = 1.2; // distance of the view that turns about the tool, in radii of the scene
const kScaleMemory_ms = 8000;
const kDrawPeriod_ms = 30; // mesh frames come every 33 ms; shorter, to absorb the display's frame period
const kPlumb_m = 0.0025; // a vertex so near to the plumb line is below the tool
const kSoftwareTriangles = 40000; // of a tissue, drawn on the processor
const kClear = 0.66; // opacity of outer tissue in front of inner tissue and of the tool

const kBall = new SphereGeometry(1, 16, 12);

interface Drawn {
  surface: Surface;
  object: Mesh | Points;
  geometry: BufferGeometry;
  colour: Float32Array;
  material: MeshStandardMaterial | PointsMaterial;
  is_inside: boolean; // of other tissue
}

export class SceneView {
  /** Frames drawn, and the cost of the newest one on this thread. */
  frame_count = 0;
  frame_cost_s = 0;
  /** Length of an arrow of 1 N. */
  arrow_m_per_newton = 0.01;
  /** Limits of the colour scale: metres, N/m or strain; 0 without a scale. */
  scale_low = 0;
  scale_high = 0;
  on_camera: () => void = () => {};

  private readonly renderer: WebGLRenderer | null; // null: this browser has no WebGL
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(32, 1, 0.001, 20);
  private readonly controls: OrbitControls;
  private readonly tissue = new Group();
  private drawn: Drawn[] = [];
  private mode: ColourMode = "material";
  private sees_inside = true;

  private readonly tools = [new Tool()]; // of each side
  /** Index of the side on display, whose tool can be led. */
  shown_side = 0;
  private others = tips(0, new MeshStandardMaterial({ roughness: 0.32, metalness: 0.1, fog: false }));
  private readonly target: Mesh<SphereGeometry, MeshBasicMaterial>;
  private readonly tether: Line<BufferGeometry, LineDashedMaterial>;
  private readonly goal = new Mesh(kBall, goal_material()); // of a traction
  private goal_key = "";
  private readonly map = new Points(new BufferGeometry(), map_material()); // what was searched
  private readonly lesions = new Group(); // after a search
  private readonly reach = new Box3Helper(new Box3()); // what the tool reaches
  private readonly lamp = new DirectionalLight(0xfff6ec, 2.7);
  private grid: GridHelper | null = null;
  private grid_colour = "#888";
  private theme: Theme | null = null;

  private readonly tables = {
    stiffness: linear_table("stiffness"), displacement: linear_table("displacement"), strain: linear_table("strain"),
  };
  private readonly bounds = new Box3();
  private readonly centre = new V3();
  private radius_m = 0.1;
  private tool_size: ToolSize = { tipRadiusM: 0, shaftLengthM: 0, shaftRadiusM: 0 };
  private is_changed = true;
  private is_urgent = true; // draw at once: the user moves the view or the hand
  private drawn_ms = -Infinity;
  private is_framed = false;
  private recent_largest = 0; // displacement or strain
  private recent_ms = 0;
  // scratch
  private readonly a = new V3();
  private readonly b = new V3();
  private readonly placed = new Matrix4();

  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = renderer_of(canvas);
    canvas.addEventListener("webglcontextrestored", () => { this.is_changed = true; });
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    canvas.style.touchAction = canvas.style.cursor = ""; // the style sheet says them
    this.controls.maxPolarAngle = 0.97 * Math.PI;
    this.controls.addEventListener("change", () => this.camera_changed());

    this.scene.add(new HemisphereLight(0xffffff, 0xa89a92, 1.25), this.lamp, this.lamp.target);
    this.lamp.castShadow = true;
    this.lamp.shadow.mapSize.set(1024, 1024);
    this.lamp.shadow.radius = 3;
    this.lamp.shadow.bias = -0.0005;

    this.target = new Mesh(new SphereGeometry(1, 24, 16), new MeshBasicMaterial({ transparent: true, opacity: 0.55, fog: false }));
    this.tether = line(new LineDashedMaterial({ dashSize: 0.002, gapSize: 0.0015, transparent: true, opacity: 0.8, fog: false }));
    this.target.visible = this.tether.visible = this.reach.visible = this.goal.visible = this.map.visible = false;
    Object.assign(this.reach.material as LineBasicMaterial, { transparent: true, opacity: 0.7, fog: false });
    this.scene.add(this.tissue, this.tools[0].group, this.target, this.tether, this.reach, this.others, this.goal, this.map, this.lesions);
  }

  get has_gpu(): boolean {
    return this.renderer?.shadowMap.enabled ?? false;
  }

  /** Replaces the scene; keeps the camera if the user has moved it. */
  set_surfaces(surfaces: Surface[], tool_size: ToolSize, peak_force_newton: number): void {
    for (const { object, geometry, material } of this.drawn) {
      this.tissue.remove(object);
      geometry.dispose();
      material.dispose();
    }
    this.drawn = surfaces.map((surface, index) => draw(surface, index, this.has_gpu ? Infinity : kSoftwareTriangles));
    this.bounds.makeEmpty();
    const boxes = this.drawn.map(({ geometry }) => geometry.boundingBox!);
    this.drawn.forEach((one, index) => {
      one.is_inside = boxes.some((box, other) => other !== index && box.containsBox(boxes[index]));
      this.bounds.union(boxes[index]);
      this.tissue.add(one.object);
    });
    if (this.bounds.isEmpty()) this.bounds.set(new V3(-0.05, -0.05, -0.05), new V3(0.05, 0.05, 0.05));
    this.bounds.getCenter(this.centre);
    this.radius_m = Math.max(0.5 * this.bounds.getSize(this.a).length(), 0.005);
    this.arrow_m_per_newton = round_up((0.28 * this.radius_m) / Math.max(peak_force_newton, 0.1));
    this.target.scale.setScalar(0.45 * Math.max(tool_size.tipRadiusM, kDrawnTip_m));
    this.tool_size = tool_size;
    for (const tool of this.tools) tool.set_size(tool_size, this.radius_m);
    this.place_surroundings();
    this.see_inside(this.sees_inside);
    this.colour(this.mode);
    if (!this.is_framed) this.frame();
    this.is_changed = true;
  }

  get can_draw(): boolean {
    return this.renderer !== null;
  }

  /** The surface has moved; its arrays have changed too unless `has_vertices` is false. */
  update(index: number, has_vertices = true): void {
    const one = this.drawn[index];
    this.is_changed = true;
    const { x, y, z } = one.surface.offset_m;
    one.object.position.set(x, y, z);
    if (!has_vertices) return;
    one.geometry.attributes.position.needsUpdate = true;
    if (!one.surface.is_points) one.geometry.attributes.normal.needsUpdate = true;
    if (this.mode === "displacement" || this.mode === "strain") {
      if (this.moving_scale(this.mode) !== this.scale_high) this.colour(this.mode);
      else this.colour_one(one, index);
    }
  }

  colour(mode: ColourMode): void {
    if (mode !== this.mode) this.recent_largest = 0;
    this.mode = mode;
    this.scale_low = this.scale_high = 0;
    if (mode === "displacement" || mode === "strain") {
      this.scale_high = this.moving_scale(mode);
    } else if (mode === "stiffness") {
      this.scale_low = Infinity;
      for (const { surface } of this.drawn) {
        for (const k of surface.stiffness) {
          if (k < this.scale_low) this.scale_low = k;
          if (k > this.scale_high) this.scale_high = k;
        }
      }
      if (!Number.isFinite(this.scale_low)) this.scale_low = 0;
    }
    this.drawn.forEach((one, index) => this.colour_one(one, index));
    this.is_changed = true;
  }

  see_inside(does: boolean): void {
    this.sees_inside = does;
    for (const { material, is_inside } of this.drawn) {
      const is_clear = does && !is_inside;
      material.transparent = is_clear;
      material.opacity = is_clear ? kClear : 1;
      material.depthWrite = !is_clear;
      material.needsUpdate = true;
    }
    this.is_changed = true;
  }

  /** @param index  of the side, from 0; a new one adds a tool */
  set_tool(position: Vector3, orientation: Quaternion, requested: Vector3, applied: Vector3, index = 0): void {
    if (!Number.isFinite(position.x)) return;
    while (this.tools.length <= index) {
      const made = new Tool();
      made.set_size(this.tool_size, this.radius_m);
      if (this.theme) made.set_theme(this.theme);
      this.scene.add(made.group);
      this.tools.push(made);
    }
    const tool = this.tools[index];
    const p = this.a.set(position.x, position.y, position.z);
    if (!tool.place(p, orientation, requested, applied, this.arrow_m_per_newton)) return;
    // a line down to the highest surface below shows the height
    const below_m = Math.max(-Infinity, ...this.drawn.map(({ surface }) => surface.height_below(p, kPlumb_m)));
    tool.plumb.visible = Number.isFinite(below_m);
    if (tool.plumb.visible) set_line(tool.plumb, p, this.b.set(p.x, p.y, below_m));
    if (index === this.shown_side && this.target.visible) set_line(this.tether, p, this.target.position);
    this.is_changed = true;
  }

  /** Tools beside those of set_tool(), as their tips alone: one drawing for all. */
  set_others(places: Vector3[]): void {
    if (places.length > this.others.count) {
      this.scene.remove(this.others);
      this.others.dispose();
      this.others = tips(places.length, this.others.material as MeshStandardMaterial);
      this.scene.add(this.others);
    }
    this.others.count = places.length;
    const radius_m = Math.max(this.tool_size.tipRadiusM, kDrawnTip_m);
    places.forEach(({ x, y, z }, i) => this.others.setMatrixAt(i, this.placed.makeScale(radius_m, radius_m, radius_m).setPosition(x, y, z)));
    this.others.instanceMatrix.needsUpdate = true;
    this.is_changed = true;
  }

  /** Target of the hand (W); null hides it. */
  set_target(position: Vector3 | null): void {
    if (!position && !this.target.visible) return;
    this.target.visible = this.tether.visible = position !== null;
    if (position) {
      this.target.position.set(position.x, position.y, position.z);
      set_line(this.tether, this.shown_tool.ball.position, this.target.position);
    }
    this.is_changed = this.is_urgent = true;
  }

  /** The box that the tool reaches (W); null hides it. */
  show_reach(box: { centerM: Vector3; halfExtentM: Vector3 } | null): void {
    this.reach.visible = box !== null;
    if (box) {
      const { centerM: c, halfExtentM: h } = box;
      this.reach.box.min.set(c.x - h.x, c.y - h.y, c.z - h.z);
      this.reach.box.max.set(c.x + h.x, c.y + h.y, c.z + h.z);
    }
    this.is_changed = true;
  }

  /** The ball to which held tissue is to be brought; null hides it. */
  set_goal(goal: { targetM: Vector3; toleranceM: number; isAtTarget: boolean } | null): void {
    const key = goal ? [goal.targetM.x, goal.targetM.y, goal.targetM.z, goal.toleranceM, goal.isAtTarget].join() : "";
    if (key === this.goal_key) return;
    this.goal_key = key;
    this.goal.visible = goal !== null;
    if (goal) {
      this.goal.position.set(goal.targetM.x, goal.targetM.y, goal.targetM.z);
      this.goal.scale.setScalar(goal.toleranceM);
      this.goal.material.wireframe = !goal.isAtTarget; // filled: told apart without colour
      this.goal.material.opacity = goal.isAtTarget ? 0.45 : 0.9;
    }
    this.is_changed = true;
  }

  /** What of the surface is to be searched or, with is_searched, was, as points on it, and the lesions as balls; null
      hides them. */
  set_map(map: { places: Float32Array; is_searched: Uint8Array; lesions: Lesion[] } | null): void {
    const { theme } = this;
    if (!theme) return; // it comes first
    this.map.visible = map !== null && map.places.length > 0;
    for (const ball of this.lesions.children as Mesh<SphereGeometry, MeshBasicMaterial>[]) ball.material.dispose();
    this.lesions.clear();
    for (const { centerM, radiusM, isFound } of map?.lesions ?? []) {
      const ball = new Mesh(kBall, goal_material()); // in tissue: seen through it
      ball.material.wireframe = !isFound; // filled: told apart without colour
      ball.material.opacity = isFound ? 0.6 : 0.9;
      ball.material.color.set(isFound ? theme.searched : theme.missed);
      ball.position.set(centerM.x, centerM.y, centerM.z);
      ball.scale.setScalar(radiusM);
      this.lesions.add(ball);
    }
    if (map && this.map.visible) {
      const colours = new Float32Array(map.places.length);
      const is_area = map.is_searched.length === 0;
      const [missed, searched] = [theme.missed, theme.searched].map((name) => new Color(name)), area = new Color(theme.area);
      for (let i = 0; 3 * i < colours.length; i++) (is_area ? area : map.is_searched[i] ? searched : missed).toArray(colours, 3 * i);
      this.map.geometry.dispose();
      this.map.geometry = new BufferGeometry();
      this.map.geometry.setAttribute("position", new BufferAttribute(map.places, 3));
      this.map.geometry.setAttribute("color", new BufferAttribute(colours, 3));
      this.map.material.size = (is_area ? 0.008 : 0.018) * this.radius_m; // under the tip it must be seen what gives way
    }
    this.is_changed = true;
  }

  set_theme(theme: Theme): void {
    this.scene.background = new Color(theme.background);
    this.scene.fog = new Fog(theme.background, 1, 2);
    this.grid_colour = theme.grid;
    this.theme = theme;
    for (const tool of this.tools) tool.set_theme(theme);
    (this.others.material as MeshStandardMaterial).color.set(theme.tool);
    this.target.material.color.set(theme.target);
    this.goal.material.color.set(theme.target);
    this.tether.material.color.set(theme.target);
    (this.reach.material as LineBasicMaterial).color.set(theme.target);
    this.place_surroundings();
    this.is_changed = true;
  }

  set orbits(does: boolean) {
    this.controls.enabled = does;
  }

  /** Shows the whole scene from the front, slightly from above. */
  frame(): void {
    const half_angle = Math.atan(Math.tan((0.5 * this.camera.fov * Math.PI) / 180) * Math.min(1, this.camera.aspect));
    const distance_m = (0.97 * this.radius_m) / Math.sin(half_angle);
    this.controls.target.copy(this.centre);
    this.controls.target.z = this.bounds.max.z - 0.1 * this.radius_m; // the tool is above
    this.camera.position.set(0.3, -0.86, 0.44).normalize().multiplyScalar(distance_m).add(this.controls.target);
    this.controls.minDistance = 0.2 * this.radius_m;
    this.controls.maxDistance = 12 * this.radius_m;
    this.controls.update();
    this.is_framed = this.drawn.length > 0;
    this.camera_changed();
  }

  /** From now on the view turns about the place where the tool is now, which comes nearer. */
  orbit_tool(): void {
    const { ball } = this.shown_tool;
    if (!ball.visible) return;
    const offset = this.a.copy(this.camera.position).sub(this.controls.target);
    offset.setLength(Math.min(offset.length(), kNearTool * this.radius_m));
    this.controls.target.copy(ball.position);
    this.camera.position.copy(ball.position).add(offset);
    this.controls.update();
    this.camera_changed();
  }

  /** Rotates the view about its centre. */
  orbit(azimuth_rad: number, polar_rad: number, zoom: number): void {
    const offset = this.a.copy(this.camera.position).sub(this.controls.target);
    const distance = offset.length() * zoom;
    const polar = Math.min(Math.max(Math.acos(offset.z / offset.length()) + polar_rad, 0.02), 0.97 * Math.PI);
    const azimuth = Math.atan2(offset.y, offset.x) + azimuth_rad;
    offset.set(Math.sin(polar) * Math.cos(azimuth), Math.sin(polar) * Math.sin(azimuth), Math.cos(polar));
    this.camera.position.copy(offset.multiplyScalar(distance)).add(this.controls.target);
    this.controls.update();
    this.camera_changed();
  }

  resize(width: number, height: number): void {
    if (width < 1 || height < 1) return;
    this.renderer?.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer?.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.camera_changed();
  }

  /** Draws if anything has changed: at once for the camera, thirty times a second for the tissue. */
  draw(): boolean {
    const begin = performance.now();
    if (!this.is_changed || !this.renderer) return false;
    if (!this.is_urgent && begin - this.drawn_ms < kDrawPeriod_ms) return false;
    this.is_changed = this.is_urgent = false;
    this.drawn_ms = begin;
    this.renderer.render(this.scene, this.camera);
    this.frame_cost_s = 1e-3 * (performance.now() - begin);
    this.frame_count += 1;
    return true;
  }

  /** Place on the canvas in CSS pixels, from its upper left. */
  project(position: Vector3): { x: number; y: number } {
    this.camera.updateMatrixWorld();
    const p = this.a.set(position.x, position.y, position.z).project(this.camera);
    return { x: (0.5 + 0.5 * p.x) * this.canvas.clientWidth, y: (0.5 - 0.5 * p.y) * this.canvas.clientHeight };
  }

  /** Metres per CSS pixel at that point. */
  metres_per_pixel(position: Vector3): number {
    const forward = this.b.set(0, 0, -1).transformDirection(this.camera.matrixWorld);
    const depth_m = this.a.set(position.x, position.y, position.z).sub(this.camera.position).dot(forward);
    return (2 * Math.max(depth_m, 0.001) * Math.tan((0.5 * this.camera.fov * Math.PI) / 180)) / this.canvas.clientHeight;
  }

  /** A point moved in the plane of the picture (pixels) and away from the viewer (metres). */
  moved(from: Vector3, right_px: number, down_px: number, away_m: number, out: Vector3): void {
    const scale = this.metres_per_pixel(from);
    const e = this.camera.matrixWorld.elements; // columns: right, up, backwards
    out.x = from.x + scale * (e[0] * right_px - e[4] * down_px) - e[8] * away_m;
    out.y = from.y + scale * (e[1] * right_px - e[5] * down_px) - e[9] * away_m;
    out.z = from.z + scale * (e[2] * right_px - e[6] * down_px) - e[10] * away_m;
  }

  /** A point moved to the right as seen, straight down, and away from the viewer on the level, in metres. */
  moved_level(from: Vector3, right_m: number, down_m: number, away_m: number, out: Vector3): void {
    const e = this.camera.matrixWorld.elements; // the picture's horizontal is level
    const level = Math.hypot(e[0], e[1]);
    const [x, y] = [e[0] / level, e[1] / level];
    out.x = from.x + x * right_m - y * away_m;
    out.y = from.y + y * right_m + x * away_m;
    out.z = from.z - down_m;
  }

  /** Radius of the drawn tip in CSS pixels. */
  get tool_radius_px(): number {
    const { ball } = this.shown_tool;
    return ball.scale.x / this.metres_per_pixel(ball.position);
  }

  get pixels_per_metre(): number {
    return 1 / this.metres_per_pixel(this.controls.target);
  }

  /** Directions of W's axes on the screen: x right, y down, and depth towards the viewer. */
  axes(): [number, number, number][] {
    const e = this.camera.matrixWorldInverse.elements;
    return [0, 4, 8].map((at) => [e[at], -e[at + 1], e[at + 2]]);
  }

  private get shown_tool(): Tool {
    return this.tools[this.shown_side] ?? this.tools[0];
  }

  private camera_changed(): void {
    this.camera.updateMatrixWorld();
    const distance_m = this.camera.position.distanceTo(this.controls.target);
    const fog = this.scene.fog as Fog | null;
    if (fog) {
      fog.near = distance_m;
      fog.far = distance_m + 2.6 * this.radius_m;
    }
    this.is_changed = this.is_urgent = true;
    this.on_camera();
  }

  // Grows at once and shrinks slowly; never finer than 1 mm, so that rest looks like rest.
  private moving_scale(mode: "displacement" | "strain"): number {
    const now_ms = performance.now();
    this.recent_largest *= Math.exp((this.recent_ms - now_ms) / kScaleMemory_ms);
    this.recent_ms = now_ms;
    for (const { surface } of this.drawn) {
      this.recent_largest = Math.max(this.recent_largest, mode === "strain" ? surface.max_strain : surface.max_displacement_m);
    }
    return round_up(Math.max(mode === "strain" ? 0.01 : 1e-3, this.recent_largest));
  }

  private colour_one(one: Drawn, index: number): void {
    const { surface, colour, geometry } = one;
    if (this.mode === "material" || (this.mode === "strain" && !surface.strain)) {
      const { r, g, b } = new Color(tissue_colour(index));
      for (let i = 0; i < colour.length; i += 3) {
        colour[i] = r;
        colour[i + 1] = g;
        colour[i + 2] = b;
      }
    } else {
      const is_stiffness = this.mode === "stiffness";
      const table = this.tables[this.mode];
      const values = is_stiffness ? surface.stiffness : this.mode === "strain" ? surface.strain! : surface.displacement_m;
      // stiffness of tissues spans decades
      const low = is_stiffness ? Math.log(Math.max(this.scale_low, 1e-3)) : 0;
      const high = is_stiffness ? Math.log(Math.max(this.scale_high, 1e-3)) : this.scale_high;
      for (let i = 0; i < values.length; ++i) {
        const row = 3 * table_row(is_stiffness ? Math.log(Math.max(values[i], 1e-3)) : values[i], low, high);
        colour[3 * i] = table[row];
        colour[3 * i + 1] = table[row + 1];
        colour[3 * i + 2] = table[row + 2];
      }
    }
    geometry.attributes.color.needsUpdate = true;
  }

  private place_surroundings(): void {
    const floor_m = this.bounds.isEmpty() ? 0 : this.bounds.min.z - 0.02 * this.radius_m;
    if (this.grid) {
      this.scene.remove(this.grid);
      this.grid.dispose();
    }
    const half_cells = Math.min(Math.ceil((4 * this.radius_m) / kGridPitch_m), 200);
    this.grid = new GridHelper(2 * half_cells * kGridPitch_m, 2 * half_cells, this.grid_colour, this.grid_colour);
    this.grid.rotateX(Math.PI / 2);
    this.grid.position.set(kGridPitch_m * Math.round(this.centre.x / kGridPitch_m), kGridPitch_m * Math.round(this.centre.y / kGridPitch_m), floor_m);
    this.scene.add(this.grid);

    this.lamp.position.set(-0.75, -0.4, 0.8).multiplyScalar(3 * this.radius_m).add(this.centre);
    this.lamp.target.position.copy(this.centre);
    const shadow = this.lamp.shadow.camera;
    shadow.left = shadow.bottom = -1.3 * this.radius_m;
    shadow.right = shadow.top = 1.3 * this.radius_m;
    shadow.near = 0.2 * this.radius_m;
    shadow.far = 6 * this.radius_m;
    shadow.updateProjectionMatrix();
  }
}

/** Without a GPU, smooth edges and shadows would cost most of the processor time of a picture. */
function has_gpu(): boolean {
  const probe = document.createElement("canvas").getContext("webgl2", { failIfMajorPerformanceCaveat: true });
  if (!probe) return false;
  const info = probe.getExtension("WEBGL_debug_renderer_info");
  const name = String(probe.getParameter(info?.UNMASKED_RENDERER_WEBGL ?? probe.RENDERER));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return !/swiftshader|llvmpipe|software|basic render/i.test(name);
}

function renderer_of(canvas: HTMLCanvasElement): WebGLRenderer | null {
  try {
    const is_fine = has_gpu();
    const renderer = new WebGLRenderer({ canvas, antialias: is_fine, powerPreference: "high-performance" });
    renderer.shadowMap.enabled = is_fine;
    renderer.shadowMap.type = PCFShadowMap;
    return renderer;
  } catch (error) {
    console.info("no WebGL:", error);
    return null;
  }
}

function draw(surface: Surface, index: number, most_triangles: number): Drawn {
  const geometry = new BufferGeometry();
  const colour = new Float32Array(surface.rest.length);
  const moving = (array: Float32Array) => new BufferAttribute(array, 3).setUsage(DynamicDrawUsage);
  geometry.setAttribute("position", moving(surface.position));
  geometry.setAttribute("color", moving(colour));
  geometry.computeBoundingBox();
  let object: Mesh | Points;
  let material: MeshStandardMaterial | PointsMaterial;
  if (surface.is_points) {
    material = new PointsMaterial({ size: 0.0016, vertexColors: true, fog: false });
    object = new Points(geometry, material);
  } else {
    geometry.setAttribute("normal", moving(surface.normal));
    geometry.setAttribute("rest", new BufferAttribute(surface.rest, 3));
    geometry.setIndex(new BufferAttribute(surface.coarse_triangles(most_triangles), 1));
    material = new MeshStandardMaterial({ vertexColors: true, roughness: 0.62, side: FrontSide, fog: false });
    material.onBeforeCompile = draw_grid_on_tissue;
    object = new Mesh(geometry, material);
    object.receiveShadow = true;
  }
  object.frustumCulled = false; // its bounds are those at rest
  object.name = surface.name || `tissue${index}`;
  return { surface, object, geometry, colour, material: material as MeshStandardMaterial & Material, is_inside: false };
}

// Fine lines every 10 mm of the tissue at rest: they move with it, so that the deformation is visible.
function draw_grid_on_tissue(shader: WebGLProgramParametersWithUniforms): void {
  shader.vertexShader = shader.vertexShader
    .replace("#include <common>", "#include <common>\nattribute vec3 rest;\nvarying vec3 vRest;")
    .replace("#include <begin_vertex>", "#include <begin_vertex>\nvRest = rest;");
  shader.fragmentShader = shader.fragmentShader
    .replace("#include <common>", "#include <common>\nvarying vec3 vRest;")
    .replace("#include <color_fragment>", `#include <color_fragment>
      {
        vec3 cell = vRest / ${kGridPitch_m.toFixed(4)};
        vec3 slope = fwidth(cell);
        // an axis along which the surface does not run draws no line
        vec3 runs = smoothstep(0.1, 0.4, slope / max(max(slope.x, slope.y), max(slope.z, 1e-9)));
        vec3 away = abs(fract(cell - 0.5) - 0.5) / max(slope, 1e-6);
        vec3 near = (1.0 - smoothstep(0.4, 1.3, away)) * runs * (1.0 - smoothstep(0.15, 0.5, slope));
        diffuseColor.rgb *= 1.0 - 0.2 * max(near.x, max(near.y, near.z));
      }`);
}

function tips(count: number, material: MeshStandardMaterial): InstancedMesh {
  const made = new InstancedMesh(new SphereGeometry(1, 12, 8), material, count);
  made.frustumCulled = false;
  return made;
}

/** Seen through the tissue. */
function goal_material(): MeshBasicMaterial {
  return new MeshBasicMaterial({ wireframe: true, transparent: true, depthTest: false, depthWrite: false });
}

/** Points that lie on surfaces are drawn before them, but not before the tool that touches them. */
function map_material(): PointsMaterial {
  const made = new PointsMaterial({ vertexColors: true, fog: false });
  made.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader.replace("#include <fog_vertex>", `
      vec4 nearer = projectionMatrix * (mvPosition + vec4(0.0, 0.0, size, 0.0));
      gl_Position.z = gl_Position.w * nearer.z / nearer.w;
      #include <fog_vertex>`);
  };
  return made;
}
