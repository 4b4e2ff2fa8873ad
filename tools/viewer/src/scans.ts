/** The scans of lidars: a point for each return, and faint rays to them. */

import { BufferGeometry, Float32BufferAttribute, Group, LineBasicMaterial, LineSegments, Points, PointsMaterial } from "three";
import type { Layer } from "./layer";

const POINT_PIXELS = 4;

export class ScanLayer implements Layer {
  readonly group = new Group();
  readonly points: Points;
  readonly rays: LineSegments;
  private row = -1;

  constructor(private readonly track: ScanTrack, colour: string) {
    const most = track.points.length / 3;
    const [points, rays] = [most, 2 * most].map((count) =>
      new BufferGeometry().setAttribute("position", new Float32BufferAttribute(new Float32Array(3 * count), 3)));
    this.points = new Points(points, new PointsMaterial({ color: colour, size: POINT_PIXELS * Math.min(2, devicePixelRatio || 1), sizeAttenuation: false }));
    this.rays = new LineSegments(rays, new LineBasicMaterial({ color: colour, transparent: true, opacity: 0.22, depthWrite: false }));
    // Their bounds change with each scan.
    this.points.frustumCulled = this.rays.frustumCulled = false;
    this.rays.renderOrder = 1;
    this.group.add(this.points, this.rays);
  }

  show(): void {
    const { track } = this;
    if (track.row === this.row) return;
    this.row = track.row;
    const ends = this.points.geometry.getAttribute("position") as Float32BufferAttribute;
    const lines = this.rays.geometry.getAttribute("position") as Float32BufferAttribute;
    ends.array.set(track.points);
    for (let i = 0; i < track.returns; i++) {
      lines.array.set(track.origin, 6 * i);
      for (let axis = 0; axis < 3; axis++) lines.array[6 * i + 3 + axis] = track.points[3 * i + axis];
    }
    ends.needsUpdate = lines.needsUpdate = true;
    this.points.geometry.setDrawRange(0, track.returns);
    this.rays.geometry.setDrawRange(0, 2 * track.returns);
  }
}
