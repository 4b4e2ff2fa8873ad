/** Outlines of solids, seen from above. */

const RING = Array.from({ length: 20 }, (_, i) => [Math.cos((i * Math.PI) / 10), Math.sin((i * Math.PI) / 10)]);

/**
 * @param {Shape} shape
 * @param {Record<string, MeshData>} meshes
 * @returns {Float64Array} x, y, z of points in the frame of the owner; their hull approximates the shape
 */
function hullPoints(shape, meshes) {
  const points = localPoints(shape, meshes);
  const out = new Float64Array(points.length * 3);
  points.forEach(([x, y, z], i) => {
    turn(shape.pose, 0, x, y, z, turned);
    for (let axis = 0; axis < 3; axis++) out[3 * i + axis] = shape.pose[axis] + turned[axis];
  });
  return out;
}

/**
 * @param {Shape} shape
 * @param {Record<string, MeshData>} meshes
 * @returns {number[][]}
 */
function localPoints(shape, meshes) {
  switch (shape.kind) {
    case "box": {
      const [x, y, z] = shape.size.map((size) => size / 2);
      return [-x, x].flatMap((a) => [-y, y].flatMap((b) => [-z, z].map((c) => [a, b, c])));
    }
    case "cylinder":
      return [-0.5, 0.5].flatMap((end) => RING.map(([x, y]) => [x * shape.radius, y * shape.radius, end * shape.length]));
    case "ellipsoid":
      return ballPoints().map((point) => point.map((value, axis) => value * shape.half[axis]));
    case "capsule":
      return [-0.5, 0.5].flatMap((end) =>
        ballPoints().map(([x, y, z]) => [x * shape.radius, y * shape.radius, z * shape.radius + end * shape.length]));
    case "mesh":
      return meshPoints(meshes[shape.mesh]);
  }
}

/** @returns {number[][]} */
function ballPoints() {
  return [-0.9, -0.6, -0.3, 0, 0.3, 0.6, 0.9].flatMap((z) => {
    const radius = Math.sqrt(1 - z * z);
    return RING.map(([x, y]) => [x * radius, y * radius, z]);
  });
}

/**
 * @param {MeshData} mesh
 * @returns {number[][]} some of its points
 */
function meshPoints(mesh) {
  const count = mesh.points.length / 3;
  const stride = Math.max(1, Math.floor(count / 400));
  const points = [];
  for (let i = 0; i < count; i += stride) points.push([0, 1, 2].map((axis) => mesh.points[3 * i + axis] * mesh.scale));
  return points;
}

/**
 * @param {Float64Array} points x, y, z each, in the frame of the pose
 * @param {Numbers} pose
 * @param {number} at
 * @returns {number[][]} corners x, y of their hull in the world
 */
function outline(points, pose, at) {
  const placed = [];
  for (let i = 0; i < points.length; i += 3) {
    turn(pose, at, points[i], points[i + 1], points[i + 2], turned);
    placed.push([pose[at] + turned[0], pose[at + 1] + turned[1]]);
  }
  placed.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  return [...halfHull(placed), ...halfHull(placed.reverse())];
}

/**
 * @param {number[][]} ordered
 * @returns {number[][]} one side of the hull, without its last corner
 */
function halfHull(ordered) {
  /** @type {number[][]} */
  const kept = [];
  for (const point of ordered) {
    while (kept.length > 1 && !turnsLeft(kept[kept.length - 2], kept[kept.length - 1], point)) kept.pop();
    kept.push(point);
  }
  return kept.slice(0, -1);
}

/** @param {number[]} a @param {number[]} b @param {number[]} c */
function turnsLeft(a, b, c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 1e-12;
}
