// SPDX-License-Identifier: Apache-2.0
// tool_view.ts: the tool in the 3-D view: tip, shaft, the forces at it.
import {
  BufferAttribute, BufferGeometry, CapsuleGeometry, ConeGeometry, CylinderGeometry, Group, Line, LineBasicMaterial,
  Mesh, MeshStandardMaterial, Quaternion as Turn, SphereGeometry, Vector3 as V3,
} from "three";
import type { Quaternion, Vector3 } from "../wire";

const kUp = new V3(0, 1, 0); // of three's cylinders and cones
const kLeastForce_newton = 0.01; // smaller forces have no arrow
export const kDrawnTip_m = 0.0015; // of a point-shaped tool
const kGlass = 0.3; // opacity of the shaft, so that arrows along it stay visible

/** Size of the tool's tip and shaft. */
export interface ToolSize {
  tipRadiusM: number;
  shaftLengthM: number; // 0: none
  shaftRadiusM: number;
}

export interface Theme {
  background: string;
  grid: string;
  ink: string;
  tool: string;
  requested: string;
  applied: string;
  target: string;
  searched: string;
  missed: string;
  area: string;
}

// The tip, the forces at it, and the line down to the tissue.
export class Tool {
  readonly group = new Group();
  readonly ball = new Mesh(
    new SphereGeometry(1, 40, 28), new MeshStandardMaterial({ roughness: 0.32, metalness: 0.1, fog: false }));
  readonly shaft = new Mesh(new BufferGeometry(), new MeshStandardMaterial({
    roughness: 0.32, metalness: 0.1, transparent: true, opacity: kGlass, depthWrite: false, fog: false,
  }));
  readonly plumb = line(new LineBasicMaterial({ transparent: true, opacity: 0.35, fog: false }));
  // where requested and rendered force agree, the wide arrow hides the slim one
  private readonly requested = new Arrow(0.5);
  private readonly applied = new Arrow(1);
  private readonly turned = new Turn(); // scratch

  constructor() {
    this.ball.castShadow = true;
    this.ball.visible = this.shaft.visible = this.plumb.visible = false;
    this.group.add(this.ball, this.shaft, this.requested.group, this.applied.group, this.plumb);
  }

  set_size({ tipRadiusM, shaftLengthM, shaftRadiusM }: ToolSize, scene_radius_m: number): void {
    this.ball.scale.setScalar(Math.max(tipRadiusM, kDrawnTip_m));
    this.requested.thickness_m = this.applied.thickness_m = Math.max(0.35 * tipRadiusM, 0.006 * scene_radius_m);
    this.shaft.geometry.dispose();
    this.shaft.geometry = shaftLengthM > 0 // three's stand along y, about their middle
      ? new CapsuleGeometry(shaftRadiusM, shaftLengthM, 12, 28).translate(0, 0.5 * shaftLengthM, 0).rotateX(0.5 * Math.PI)
      : new BufferGeometry();
    this.shaft.visible = this.ball.visible && shaftLengthM > 0;
  }

  set_theme(theme: Theme): void {
    this.ball.material.color.set(theme.tool);
    this.shaft.material.color.set(theme.tool);
    this.requested.colour(theme.requested);
    this.applied.colour(theme.applied);
    this.plumb.material.color.set(theme.ink);
  }

  /** False if nothing has changed. */
  place(at: V3, { x, y, z, w }: Quaternion, requested: Vector3, applied: Vector3, metres_per_newton: number): boolean {
    const turned = this.turned.set(x, y, z, w);
    if (this.ball.visible && this.ball.position.equals(at) && this.shaft.quaternion.equals(turned) &&
      this.applied.equals(applied) && this.requested.equals(requested)) return false;
    this.ball.visible = true;
    this.shaft.visible = this.shaft.geometry.hasAttribute("position");
    this.ball.position.copy(at);
    this.shaft.position.copy(at);
    this.shaft.quaternion.copy(turned);
    this.requested.point(at, requested, metres_per_newton);
    this.applied.point(at, applied, metres_per_newton);
    return true;
  }
}

// A force at the tool: shaft and head, of one thickness whatever its length.
class Arrow {
  readonly group = new Group();
  thickness_m = 0.001;
  private readonly material: MeshStandardMaterial;
  private readonly shaft: Mesh;
  private readonly head: Mesh;
  private readonly force = new V3();
  private readonly direction = new V3();

  constructor(private readonly width: number) {
    this.material = new MeshStandardMaterial({ roughness: 0.6, fog: false });
    this.shaft = new Mesh(new CylinderGeometry(1, 1, 1, 20).translate(0, 0.5, 0), this.material);
    this.head = new Mesh(new ConeGeometry(1, 1, 24).translate(0, 0.5, 0), this.material);
    this.group.add(this.shaft, this.head);
    this.group.visible = false;
  }

  colour(colour: string): void {
    this.material.color.set(colour);
    this.material.emissive.set(colour);
    this.material.emissiveIntensity = 0.4;
  }

  equals(force: Vector3): boolean {
    return this.force.x === force.x && this.force.y === force.y && this.force.z === force.z;
  }

  point(at: V3, force: Vector3, metres_per_newton: number): void {
    this.force.set(force.x, force.y, force.z);
    const newton = this.force.length();
    this.group.visible = newton > kLeastForce_newton;
    if (!this.group.visible) return;
    const radius = this.width * this.thickness_m;
    const length = newton * metres_per_newton;
    const head = Math.min(4.2 * radius, 0.6 * length);
    this.group.position.copy(at);
    this.group.quaternion.setFromUnitVectors(kUp, this.direction.copy(this.force).divideScalar(newton));
    this.shaft.scale.set(radius, length - head, radius);
    this.head.position.y = length - head;
    this.head.scale.set(1.9 * radius, head, 1.9 * radius);
  }
}

export function line<M extends LineBasicMaterial>(material: M): Line<BufferGeometry, M> {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(6), 3));
  geometry.setAttribute("lineDistance", new BufferAttribute(new Float32Array(2), 1));
  const made = new Line(geometry, material);
  made.frustumCulled = false;
  return made;
}

export function set_line(line: Line, from: V3, to: V3): void {
  const { position, lineDistance } = line.geometry.attributes;
  position.setXYZ(0, from.x, from.y, from.z);
  position.setXYZ(1, to.x, to.y, to.z);
  lineDistance.setX(1, from.distanceTo(to));
  position.needsUpdate = lineDistance.needsUpdate = true;
}
