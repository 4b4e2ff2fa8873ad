/** The forces of contacts on the robot, as arrows. */

/** The longest arrow is so many times as long as the robot is wide. */
const LONGEST = 1.5;

/** @implements {PushTrack} */
class Pushes {
  /** @param {Replay} replay @param {number} size of the robot in m */
  constructor({ contacts }, size) {
    this.pushes = contacts.map(({ time, until, position, normal, period, forces, places }) => {
      if (!normal || !period || !forces) return { time, until, position, normal: [0, 0, 0], period: 1, newtons: new Float64Array(), from: [] };
      // A column that never changes has no differences.
      const count = 1 + Math.max(...[forces, ...(places ?? [])].map(({ deltas }) => deltas.length));
      const from = (places ?? []).map((column) => decoded(column, count));
      return { time, until, position, normal, period, newtons: decoded(forces, count), from };
    });
    const most = Math.max(0, ...this.pushes.map(({ newtons }) => newtons.reduce((a, b) => Math.max(a, b), 0)));
    /** N per m of an arrow, a round number. */
    this.scale = most > 0 ? niceStep(most / (LONGEST * Math.max(size, 1e-3))) : 1;
    this.unit = size < 0.7 ? 0.1 : 1;
  }

  /** @param {number} contact its number @param {number} time s */
  lasts(contact, time) {
    const { time: start, until } = this.pushes[contact];
    return time >= start - 0.02 && time <= until + 0.02;
  }

  /** Where a contact is while it lasts, in the world; otherwise where it began. @param {number} contact its number @param {number} time s */
  place(contact, time) {
    const { position, from } = this.pushes[contact];
    return from.length && this.lasts(contact, time) ? from.map((values) => values[this.row(contact, time)]) : position;
  }

  /** @param {number} contact @param {number} time */
  row(contact, time) {
    const { time: start, period, newtons } = this.pushes[contact];
    return Math.min(newtons.length - 1, Math.max(0, Math.floor((time - start) / period + 1e-6)));
  }

  /** @param {number} time s @returns {{from: number[], to: number[]}[]} the arrows at that time, in the world */
  at(time) {
    return this.pushes.flatMap(({ normal, newtons }, i) => {
      if (!this.lasts(i, time) || !newtons.length) return [];
      const from = this.place(i, time), length = newtons[this.row(i, time)] / this.scale;
      return length > 0 ? [{ from, to: from.map((value, axis) => value + normal[axis] * length) }] : [];
    });
  }

  /** What the length of an arrow means. */
  get words() {
    return this.pushes.some(({ newtons }) => newtons.length) ? `Arrows of contact forces: ${this.unit} m is ${told(this.scale * this.unit, "N")}` : "";
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
