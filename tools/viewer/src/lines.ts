/** The lines over the world: path of the robot, goal regions, contacts. */

import {
  BufferGeometry,
  CircleGeometry,
  DoubleSide,
  Float32BufferAttribute,
  Group,
  Line,
  LineBasicMaterial,
  LineLoop,
  Mesh,
  MeshBasicMaterial,
  Shape as Area,
  ShapeGeometry,
  SphereGeometry,
} from "three";
import type { Layer } from "./layer";

/** The height in m over the ground; lines in the plane of the ground would flicker. */
const OVER_GROUND = 0.004;

/** The sine of the angle from which on a path turns. */
const TURN = 0.2;

/** A ribbon along the path; the part ahead is faint. */
export class Way implements Layer {
  readonly group = new Group();
  private readonly came: Mesh;
  /** The parts of the ribbon that end by each row. */
  private readonly parts: Uint32Array;

  constructor(private readonly run: Run, colour: string, clearance: number, width: number) {
    const rows = tellingRows(run, width);
    this.parts = partsAt(rows, run.count);
    const geometry = ribbon(run, rows, clearance, width);
    const ahead = new Mesh(geometry, new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.28, side: DoubleSide }));
    this.came = new Mesh(geometry.clone(), new MeshBasicMaterial({ color: colour, side: DoubleSide }));
    this.came.position.z = OVER_GROUND / 4;
    this.came.frustumCulled = false;
    this.group.add(ahead, this.came);
  }

  show({ time }: Moment): void {
    this.came.geometry.setDrawRange(0, 6 * this.parts[this.run.row(time)]);
  }
}

/** The ribbon runs under the robot, also on ramps and in the air; `clearance`: m from the base to its lowest point. */
function ribbon(run: Run, rows: number[], clearance: number, width: number): BufferGeometry {
  const [xs, ys, zs] = run.base;
  const points = new Float32Array(6 * rows.length);
  const corners: number[] = [];
  let dx = 1, dy = 0;
  rows.forEach((i, at) => {
    const next = Math.min(i + 1, run.count - 1), before = Math.max(i - 1, 0);
    const length = Math.hypot(xs[next] - xs[before], ys[next] - ys[before]);
    // At standstill the ribbon keeps its direction.
    if (length > 1e-3) [dx, dy] = [(xs[next] - xs[before]) / length, (ys[next] - ys[before]) / length];
    const x = (-dy * width) / 2, y = (dx * width) / 2, z = OVER_GROUND + Math.max(0, zs[i] - clearance);
    points.set([xs[i] + x, ys[i] + y, z, xs[i] - x, ys[i] - y, z], 6 * at);
    if (at > 0) corners.push(2 * at - 2, 2 * at - 1, 2 * at, 2 * at, 2 * at - 1, 2 * at + 1);
  });
  const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
  return geometry.setIndex(corners);
}

/** Returns the rows that a ribbon shows, as a run of minutes has thousands that lie side by side. */
function tellingRows(run: Run, width: number): number[] {
  const [xs, ys, zs] = run.base;
  const rows = [0];
  let last = 0, course = NaN;
  for (let i = 1; i < run.count; i++) {
    const x = xs[i] - xs[i - 1], y = ys[i] - ys[i - 1];
    const isTurn = Math.hypot(x, y) > 1e-3 && Math.abs(Math.sin(Math.atan2(y, x) - course)) > TURN;
    if (!isTurn && Math.hypot(xs[i] - xs[last], ys[i] - ys[last], zs[i] - zs[last]) < width && i < run.count - 1) continue;
    // The row before a turn is its corner.
    if (isTurn && last < i - 1) rows.push(i - 1);
    rows.push(i);
    last = i;
    course = Math.atan2(y, x);
  }
  return rows;
}

function partsAt(rows: number[], count: number): Uint32Array {
  const parts = new Uint32Array(count);
  rows.forEach((row, part) => parts.fill(part, row));
  return parts;
}

/** The path of a link as a line; the part ahead is faint. */
export class Trail implements Layer {
  readonly group = new Group();
  private readonly came: Line;

  constructor(private readonly run: Run, link: number, colour: string) {
    const [xs, ys, zs] = run.trail(link);
    const points = new Float32Array(3 * run.count);
    for (let i = 0; i < run.count; i++) points.set([xs[i], ys[i], zs[i]], 3 * i);
    const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
    const ahead = new Line(geometry, new LineBasicMaterial({ color: colour, transparent: true, opacity: 0.35, depthTest: false }));
    this.came = new Line(geometry.clone(), new LineBasicMaterial({ color: colour, depthTest: false, transparent: true }));
    this.came.frustumCulled = false;
    this.group.renderOrder = 1;
    this.group.add(ahead, this.came);
  }

  show({ time }: Moment): void {
    this.came.geometry.setDrawRange(0, this.run.row(time) + 1);
  }
}

export class Touches implements Layer {
  readonly group = new Group();
  private readonly spheres: Mesh[];

  constructor(private readonly contacts: ContactData[], private readonly track: PushTrack, colour: string, size: number) {
    const ball = new SphereGeometry(size, 16, 12);
    const material = new MeshBasicMaterial({ color: colour, depthTest: false, transparent: true, opacity: 0.9 });
    this.spheres = contacts.map(() => {
      const sphere = new Mesh(ball, material);
      sphere.renderOrder = 2;
      return sphere;
    });
    for (const sphere of this.spheres) this.group.add(sphere);
  }

  show({ time }: Moment): void {
    this.spheres.forEach((sphere, i) => {
      const { time: from, until } = this.contacts[i];
      sphere.visible = from <= time + 0.02;
      sphere.position.set(...(this.track.place(i, time) as [number, number, number]));
      sphere.scale.setScalar(time <= until + 0.02 ? 1 : 0.5);
    });
  }
}

/** A region, path or heading of an expectation; in the frame of a link, there is no ground below it. */
export function mark(data: MarkData, colour: string): Group {
  const group = new Group();
  const line = new LineBasicMaterial({ color: colour });
  if (data.kind === "polyline" || data.kind === "arrow") {
    const lowest = data.link === undefined ? OVER_GROUND : -Infinity;
    group.add(new Line(outline(data.kind === "polyline" ? data.points : arrow(data), lowest), line));
    if (data.tolerance) {
      const faint = new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.14, side: DoubleSide, depthWrite: false });
      const area = data.kind === "polyline" ? band(data.points, data.tolerance) : sector(data, data.tolerance);
      const allowed = new Mesh(area, faint);
      allowed.position.z = data.link === undefined ? OVER_GROUND / 2 : 0;
      group.add(allowed);
    }
    return group;
  }
  const corners = data.kind === "polygon" ? data.points : ring(data);
  if (data.kind === "circle" && (data.z > 0 || data.link !== undefined)) {
    const region = new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.16, depthWrite: false });
    const ball = new Mesh(new SphereGeometry(data.radius, 24, 16), region);
    ball.position.set(data.x, data.y, data.z);
    group.add(ball);
  }
  const area = new Area();
  corners.forEach(([x, y], i) => (i ? area.lineTo(x, y) : area.moveTo(x, y)));
  const fill = new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.08, side: DoubleSide, depthWrite: false });
  const floor = new Mesh(new ShapeGeometry(area), fill);
  floor.position.z = (data.kind === "circle" ? data.z : 0) + OVER_GROUND / 2;
  const height = floor.position.z + OVER_GROUND / 2;
  group.add(floor, new LineLoop(outline(corners.map(([x, y]) => [x, y, height])), line));
  return group;
}

/** A flat ribbon along a path; it is wider at corners, so that its edges keep their distance. */
function band(points: number[][], distance: number): BufferGeometry {
  const sides: number[] = [];
  const corners: number[] = [];
  const unit = (from: number[], to: number[]) => {
    const length = Math.hypot(to[0] - from[0], to[1] - from[1]) || 1;
    return [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
  };
  points.forEach((point, i) => {
    const after = unit(point, points[i + 1] ?? point), before = i ? unit(points[i - 1], point) : after;
    const [ax, ay] = i === points.length - 1 ? before : after;
    const [dx, dy] = [before[0] + ax, before[1] + ay];
    // At most twice as wide: a sharp corner would make a long tip.
    const share = Math.max(0.5, (dx * dx + dy * dy) / 4);
    const [x, y] = [(-dy / 2 / share) * distance, (dx / 2 / share) * distance];
    sides.push(point[0] + x, point[1] + y, point[2], point[0] - x, point[1] - y, point[2]);
    if (i) corners.push(2 * i - 2, 2 * i - 1, 2 * i, 2 * i, 2 * i - 1, 2 * i + 1);
  });
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(sides, 3)).setIndex(corners);
}

/** The headings that are allowed. */
function sector({ x, y, yaw }: ArrowMark, tolerance: number): BufferGeometry {
  return new CircleGeometry(0.3, 24, yaw - tolerance, 2 * tolerance).translate(x, y, 0);
}

function outline(points: number[][], lowest = -Infinity): BufferGeometry {
  const flat = points.flatMap(([x, y, z]) => [x, y, Math.max(z, lowest)]);
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(flat, 3));
}

function ring({ x, y, radius }: CircleMark): [number, number][] {
  return Array.from({ length: 64 }, (_, i) => {
    const angle = (i * Math.PI) / 32;
    return [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
  });
}

function arrow({ x, y, yaw }: ArrowMark): number[][] {
  const at = (length: number, angle: number) => [x + length * Math.cos(yaw + angle), y + length * Math.sin(yaw + angle), 0];
  return [at(0, 0), at(0.3, 0), at(0.23, 0.2), at(0.3, 0), at(0.23, -0.2)];
}
