/** Poses as seven numbers in a row: x, y, z, and the quaternion x, y, z, w. */

/**
 * Writes the point (x, y, z), turned by the quaternion of `pose`, into `out`.
 * @param {Numbers} pose
 * @param {number} at index at which the pose begins
 * @param {number} x
 * @param {number} y
 * @param {number} z
 * @param {Float64Array} out
 */
function turn(pose, at, x, y, z, out) {
  const qx = pose[at + 3], qy = pose[at + 4], qz = pose[at + 5], qw = pose[at + 6];
  const tx = 2 * (qy * z - qz * y), ty = 2 * (qz * x - qx * z), tz = 2 * (qx * y - qy * x);
  out[0] = x + qw * tx + qy * tz - qz * ty;
  out[1] = y + qw * ty + qz * tx - qx * tz;
  out[2] = z + qw * tz + qx * ty - qy * tx;
}

const turned = new Float64Array(3);

/**
 * Composes poses: writes pose `b`, given in the frame of pose `a`, in the parent frame of `a`.
 * @param {Numbers} a
 * @param {number} ai
 * @param {Numbers} b
 * @param {number} bi
 * @param {Float64Array} out
 * @param {number} oi
 */
function compose(a, ai, b, bi, out, oi) {
  turn(a, ai, b[bi], b[bi + 1], b[bi + 2], turned);
  const ax = a[ai + 3], ay = a[ai + 4], az = a[ai + 5], aw = a[ai + 6];
  const bx = b[bi + 3], by = b[bi + 4], bz = b[bi + 5], bw = b[bi + 6];
  const px = a[ai] + turned[0], py = a[ai + 1] + turned[1], pz = a[ai + 2] + turned[2];
  out[oi] = px;
  out[oi + 1] = py;
  out[oi + 2] = pz;
  out[oi + 3] = aw * bx + ax * bw + ay * bz - az * by;
  out[oi + 4] = aw * by - ax * bz + ay * bw + az * bx;
  out[oi + 5] = aw * bz + ax * by - ay * bx + az * bw;
  out[oi + 6] = aw * bw - ax * bx - ay * by - az * bz;
}

/**
 * Interpolates between two rows of seven columns: positions linearly, rotations along the shorter arc.
 * @param {Float64Array[]} columns
 * @param {number} row
 * @param {number} share 0: this row, 1: the next
 * @param {Float64Array} out
 * @param {number} at
 */
function between(columns, row, share, out, at) {
  const next = share > 0 ? row + 1 : row;
  let dot = 0;
  for (let i = 3; i < 7; i++) dot += columns[i][row] * columns[i][next];
  const sign = dot < 0 ? -1 : 1;
  let length = 0;
  for (let i = 0; i < 7; i++) {
    const value = columns[i][row] * (1 - share) + (i < 3 ? 1 : sign) * columns[i][next] * share;
    out[at + i] = value;
    if (i > 2) length += value * value;
  }
  const scale = length > 0 ? 1 / Math.sqrt(length) : 1;
  for (let i = 3; i < 7; i++) out[at + i] *= scale;
}
