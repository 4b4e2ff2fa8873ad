/** Normals of a mesh: smooth on round surfaces, sharp at edges. */

import { BufferGeometry, Float32BufferAttribute } from "three";

/** The cosine of the largest angle between faces that look like one round surface: 38 deg. */
const CREASE = 0.79;

/** Returns the geometry of a mesh, in which each triangle has three points of its own. */
export function smooth({ points, scale, triangles }: MeshData): BufferGeometry {
  const corners = new Float32Array(3 * triangles.length);
  triangles.forEach((point, i) => {
    for (let axis = 0; axis < 3; axis++) corners[3 * i + axis] = points[3 * point + axis] * scale;
  });
  const normals = crossed(corners);
  const lengths = Array.from({ length: triangles.length / 3 }, (_, face) => Math.hypot(...normals.subarray(3 * face, 3 * face + 3)) || 1);
  const faces: number[][] = Array.from({ length: points.length / 3 }, () => []);
  triangles.forEach((point, i) => faces[point].push(Math.floor(i / 3)));
  const smoothed = new Float32Array(corners.length);
  triangles.forEach((point, i) => {
    const own = Math.floor(i / 3);
    for (const face of faces[point]) {
      let together = 0;
      for (let axis = 0; axis < 3; axis++) together += normals[3 * own + axis] * normals[3 * face + axis];
      if (together < CREASE * lengths[own] * lengths[face]) continue;
      // Larger faces count for more, as the normals have the length of their area.
      for (let axis = 0; axis < 3; axis++) smoothed[3 * i + axis] += normals[3 * face + axis];
    }
  });
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(corners, 3));
  geometry.setAttribute("normal", new Float32BufferAttribute(smoothed, 3));
  geometry.normalizeNormals();
  return geometry;
}

/** Returns the normal of each triangle, twice as long as its area. */
function crossed(corners: Float32Array): Float32Array {
  const normals = new Float32Array(corners.length / 3);
  for (let i = 0; i < corners.length; i += 9) {
    const [ax, ay, az, bx, by, bz, cx, cy, cz] = corners.subarray(i, i + 9);
    const ux = bx - ax, uy = by - ay, uz = bz - az, vx = cx - ax, vy = cy - ay, vz = cz - az;
    normals.set([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], i / 3);
  }
  return normals;
}
