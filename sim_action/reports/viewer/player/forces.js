/** The forces of contacts on the robot, as arrows. */

/** The longest arrow is so many times as long as the robot is wide. */
const LONGEST = 1.5;

/** @implements {PushTrack} */
class Pushes {
  /** @param {Replay} replay @param {number} size of the robot in m */
  constructor({ contacts }, size) {
    this.pushes = contacts.flatMap(({ time, until, position, normal, period, forces }) => {
      if (!normal || !period || !forces) return [];
      return [{ time, until, position, normal, period, newtons: decoded(forces, 1 + forces.deltas.length) }];
    });
    const most = Math.max(0, ...this.pushes.map(({ newtons }) => newtons.reduce((a, b) => Math.max(a, b), 0)));
    /** N per m of an arrow, a round number. */
    this.scale = most > 0 ? niceStep(most / (LONGEST * Math.max(size, 1e-3))) : 1;
    this.unit = size < 0.7 ? 0.1 : 1;
  }

  /** @param {number} time s @returns {{from: number[], to: number[]}[]} the arrows at that time, in the world */
  at(time) {
    return this.pushes.flatMap(({ time: start, until, position, normal, period, newtons }) => {
      if (time < start - 0.02 || time > until + 0.02) return [];
      const place = Math.min(newtons.length - 1, Math.max(0, Math.floor((time - start) / period + 1e-6)));
      const length = newtons[place] / this.scale;
      return length > 0 ? [{ from: position, to: position.map((value, axis) => value + normal[axis] * length) }] : [];
    });
  }

  /** What the length of an arrow means. */
  get words() {
    return this.pushes.length ? `Arrows of contact forces: ${this.unit} m is ${told(this.scale * this.unit, "N")}` : "";
  }
}

/** @param {Motion} motion @returns {number} the radius of the robot about its base in m */
function robotSize(motion) {
  const { links } = motion.at(motion.start);
  let most = 0;
  motion.scene.links.forEach(({ shapes }, i) => {
    for (const shape of shapes) {
      for (const [x, y] of outline(hullPoints(shape, motion.scene.meshes), links, 7 * i)) {
        most = Math.max(most, Math.hypot(x - links[0], y - links[1]));
      }
    }
  });
  return most;
}
