/** The motion of a run: poses of all links and bodies at a time. */
class Motion {
  /** @param {Replay} replay */
  constructor(replay) {
    const { frames, scene } = replay;
    const count = 1 + frames.time.deltas.length;
    const columns = (/** @type {Column[]} */ several) => several.map((column) => decoded(column, count));
    this.replay = replay;
    this.scene = scene;
    this.count = count;
    this.times = decoded(frames.time, count);
    this.base = columns(frames.base);
    this.joints = columns(frames.joints);
    this.commanded = (frames.commanded ?? []).map((column) => column && decoded(column, count));
    this.tracks = frames.tracks.map(columns);
    this.speed = decoded(frames.speed, count);
    this.tilt = decoded(frames.tilt, count);
    this.scans = (replay.scans ?? []).map((scan, i) => new Scans(scan, i));
    this.start = this.times[0];
    this.end = this.times[count - 1];
    /** @type {Moment} */
    this.moment = {
      time: this.start,
      links: new Float64Array(7 * scene.links.length),
      bodies: new Float64Array(7 * scene.bodies.length),
      here: scene.bodies.map(() => true),
    };
    this.local = new Float64Array(7);
    this.pushes = new Pushes(replay, replay.contacts.some(({ forces }) => forces) ? robotSize(this) : 1);
  }

  /**
   * @param {number} time s
   * @returns {number} the last row at or before it
   */
  row(time) {
    let low = 0, high = this.count - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle] <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /**
   * @param {number} time s
   * @returns {Moment} the same object, overwritten by each call
   */
  at(time) {
    const row = this.row(time);
    const last = row === this.count - 1;
    const share = last ? 0 : Math.max(0, (time - this.times[row]) / (this.times[row + 1] - this.times[row]));
    this.moment.time = time;
    this.placeLinks(row, share);
    this.placeBodies(row, share, time);
    return this.moment;
  }

  /** @param {number} row @param {number} share */
  placeLinks(row, share) {
    const { links } = this.moment;
    between(this.base, row, share, links, 0);
    for (let i = 1; i < this.scene.links.length; i++) {
      const link = this.scene.links[i];
      const parent = 7 * (link.parent ?? 0);
      compose(links, parent, link.origin, 0, links, 7 * i);
      if (link.joint) {
        this.moveJoint(link.joint, row, share);
        compose(links, 7 * i, this.local, 0, links, 7 * i);
      }
    }
  }

  /**
   * @param {number} link
   * @returns {Float64Array[]} x, y and z of the origin of a link in m at each moment
   */
  trail(link) {
    const points = [0, 1, 2].map(() => new Float64Array(this.count));
    for (let row = 0; row < this.count; row++) {
      this.placeLinks(row, 0);
      points.forEach((values, axis) => {
        values[row] = this.moment.links[7 * link + axis];
      });
    }
    return points;
  }

  /**
   * @returns {{body: number, place: number[]}[]} the places in m of bodies that move, as far as they come near the way of the robot
   */
  passages() {
    const way = [0, 1, 2].map((axis) => extent(this.base[axis]));
    const reach = 3 * Math.max(0.5, Math.hypot(...way.map(([low, high]) => high - low)));
    const stride = Math.ceil(this.count / 60);
    return this.scene.bodies.flatMap(({ track, appears = -Infinity, disappears = Infinity }, body) => {
      if (track === undefined) return [];
      const columns = this.tracks[track];
      const present = [...this.times.keys()].filter((row) => row % stride === 0 && this.times[row] >= appears && this.times[row] < disappears);
      const places = present.map((row) => columns.slice(0, 3).map((column) => column[row]));
      const moves = [0, 1].some((axis) => ((low, high) => high - low)(...extent(places.map((place) => place[axis]))) > 0.05);
      const isNear = (/** @type {number[]} */ place) => way.every(([low, high], axis) => place[axis] > low - reach && place[axis] < high + reach);
      return moves ? places.filter(isNear).map((place) => ({ body, place })) : [];
    });
  }

  /** @param {JointMotion} joint @param {number} row @param {number} share */
  moveJoint(joint, row, share) {
    const column = this.joints[joint.column];
    const value = share > 0 ? column[row] * (1 - share) + column[row + 1] * share : column[row];
    const moved = joint.multiplier * value + joint.offset;
    const turns = joint.type === "revolute";
    const sine = Math.sin(moved / 2);
    for (let i = 0; i < 3; i++) {
      this.local[i] = turns ? 0 : joint.axis[i] * moved;
      this.local[3 + i] = turns ? joint.axis[i] * sine : 0;
    }
    this.local[6] = turns ? Math.cos(moved / 2) : 1;
  }

  /** @param {number} row @param {number} share @param {number} time */
  placeBodies(row, share, time) {
    const { bodies, here } = this.moment;
    this.scene.bodies.forEach((body, i) => {
      const gone = body.disappears !== undefined && time >= body.disappears;
      here[i] = !gone && (body.appears === undefined || time >= body.appears);
      if (body.track === undefined) bodies.set(body.pose, 7 * i);
      else between(this.tracks[body.track], row, share, bodies, 7 * i);
    });
  }

  /**
   * @param {number} time s
   * @returns {ContactData[]} contacts at that time
   */
  touching(time) {
    return this.replay.contacts.filter((contact) => contact.time - 0.02 <= time && time <= contact.until + 0.02);
  }
}
