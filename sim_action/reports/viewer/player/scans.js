/** The scans of lidars: the returns of the latest scan at a time, in the world. */

const NO_RETURN = -1;

/** The scans of one lidar. @implements {ScanTrack} */
class Scans {
  /** @param {ScanData} data @param {number} number of the sensor, for its colour */
  constructor(data, number) {
    const { rays } = data;
    this.data = data;
    /** The number of its colour of lines; the first one is that of the path. */
    this.line = number + 1;
    this.count = 1 + data.time.deltas.length;
    this.times = decoded(data.time, this.count);
    /** The ranges in steps, scan after scan. */
    this.steps = Int32Array.from(data.ranges);
    for (let i = rays; i < this.steps.length; i++) this.steps[i] += this.steps[i - rays];
    this.cosines = Float64Array.from({ length: rays }, (_, i) => Math.cos(data.first_angle + i * data.increment));
    this.sines = Float64Array.from({ length: rays }, (_, i) => Math.sin(data.first_angle + i * data.increment));
    this.row = -1;
    this.origin = [0, 0, 0];
    this.points = new Float32Array(3 * rays);
    this.returns = 0;
    this.pose = new Float64Array(7);
  }

  /** Moves on to the latest scan at a time. @param {number} time s @param {Motion} motion */
  seek(time, motion) {
    let low = 0, high = this.count - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle] <= time + 1e-6) low = middle;
      else high = middle - 1;
    }
    const row = this.times[low] <= time + 1e-6 ? low : -1;
    if (row === this.row) return;
    this.row = row;
    this.returns = 0;
    if (row < 0) return;
    // The robot has moved on since the scan.
    compose(motion.at(this.times[row]).links, 7 * this.data.link, this.data.pose, 0, this.pose, 0);
    this.origin = [this.pose[0], this.pose[1], this.pose[2]];
    const first = row * this.data.rays;
    for (let ray = 0; ray < this.data.rays; ray++) {
      const step = this.steps[first + ray];
      if (step < 0) continue;
      const range = step * this.data.scale;
      turn(this.pose, 0, range * this.cosines[ray], range * this.sines[ray], 0, turned);
      const at = 3 * this.returns++;
      for (let axis = 0; axis < 3; axis++) this.points[at + axis] = this.pose[axis] + turned[axis];
    }
  }

  /** @param {Colours} colours */
  colour({ lines }) {
    return lines[this.line % lines.length];
  }

  /** What the scan says, in words. */
  words() {
    const { sensor, rays, scale, first_angle, increment, every_scan, every_ray } = this.data;
    const name = `${sensor} (lidar)`;
    if (this.row < 0) return `${name}: no scan yet`;
    let nearest = -1, near = 0;
    const first = this.row * rays;
    for (let ray = 0; ray < rays; ray++) {
      const step = this.steps[first + ray];
      if (step >= 0 && (nearest < 0 || step < this.steps[first + nearest])) nearest = ray;
      if (step < NO_RETURN) near++;
    }
    // Rounding makes neighbours equal: the middle one is meant.
    let last = nearest;
    while (last + 1 < rays && this.steps[first + last + 1] === this.steps[first + nearest]) last++;
    const found = nearest < 0
      ? "no return"
      : `nearest ${(this.steps[first + nearest] * scale).toFixed(2)} m, ${direction(first_angle + (nearest + last) / 2 * increment)}`;
    const close = near ? `; ${near} ${near === 1 ? "ray" : "rays"} too near to measure` : "";
    const left = [every_scan > 1 ? `every ${ordinal(every_scan)} scan` : "", every_ray > 1 ? `every ${ordinal(every_ray)} ray` : ""];
    const kept = left.filter(Boolean).join(", ");
    return `${name}: ${found}${close}${kept ? ` (${kept} is shown)` : ""}`;
  }
}

/** @param {number} angle rad, counter-clockwise from straight ahead of a sensor */
function direction(angle) {
  const degrees = Math.abs(angle) > Math.PI ? Math.atan2(Math.sin(angle), Math.cos(angle)) * DEGREES : angle * DEGREES;
  const size = Math.abs(degrees);
  if (size < 0.5) return "straight ahead";
  if (size > 179.5) return "behind";
  return `${size.toFixed(0)} deg to the ${degrees > 0 ? "left" : "right"}`;
}

/** @param {number} number @returns {string} for example "3rd" */
function ordinal(number) {
  const ending = number % 100 > 10 && number % 100 < 14 ? "th" : (["th", "st", "nd", "rd"][number % 10] ?? "th");
  return `${number}${ending}`;
}
