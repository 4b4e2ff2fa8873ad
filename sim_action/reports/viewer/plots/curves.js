/** The curves of a run: what can be plotted, by stable keys, and how each is computed. */

const AXES = ["x", "y", "z"];

/** The titles of the groups of signals, in the order in which they are offered; other groups are named as they are. */
const GROUPS = { expectations: "Expectations", base: "Base", joints: "Joints", contacts: "Contacts", links: "Links", bodies: "Objects" };

/** The word for a signal that is drawn with what was commanded. */
const BOTH = "measured and commanded";

/** Everything of a run that can be plotted; a curve is computed when it is needed. */
class Catalogue {
  /**
   * @param {Motion} motion
   * @param {ExpectationEntry[]} expectations
   */
  constructor(motion, expectations) {
    this.motion = motion;
    this.expectations = expectations;
    /** @type {Map<string, Signal>} */
    this.signals = new Map();
    /** @type {Map<string, Curve>} */
    this.curves = new Map();
    /** @type {Map<number, Float64Array[]>} */
    this.trails = new Map();
    /** @type {Catalogue[]} */
    this.repetitions = [];
    this.addExpectations();
    this.addBase();
    this.addJoints();
    this.addChannels();
    this.addLinks();
    this.addBodies();
  }

  /**
   * @param {string} group
   * @param {string} name
   * @param {string} unit SI
   * @param {() => Partial<Curve> & {values: Float64Array}} read
   * @param {{about?: string, kind?: string}} [more]
   */
  add(group, name, unit, read, { about = "", kind = "" } = {}) {
    let key = `${group}.${name}`;
    while (this.signals.has(key)) key += "'";
    this.signals.set(key, { key, group, name, unit, about, kind, read });
  }

  /** @param {string} key @returns {Curve | null} the same object for each call */
  curve(key) {
    const signal = this.signals.get(key);
    if (!signal) return null;
    const known = this.curves.get(key);
    if (known) return known;
    const { motion } = this;
    const { factor, name: unit, least } = shownUnit(signal.unit);
    const read = signal.read();
    const shown = (/** @type {Float64Array} */ values) => (factor === 1 ? values : values.map((value) => value * factor));
    /** @type {Curve} */
    const curve = {
      key, name: signal.name, title: "", si: signal.unit, factor, unit, least, times: motion.times, aimed: false, status: "free", cutOff: false,
      band: null, decided: null, lower: null, upper: null, from: motion.start, to: motion.end, ...read,
      values: shown(read.values), commanded: read.commanded ? shown(read.commanded) : null,
    };
    curve.band = this.bandOf(curve);
    this.curves.set(key, curve);
    return curve;
  }

  /** Has each curve know the range of its values in repetitions of the run, too. @param {Motion[]} motions */
  setRepetitions(motions) {
    this.repetitions = motions.map((motion) => new Catalogue(motion, this.expectations));
    for (const curve of this.curves.values()) curve.band = this.bandOf(curve);
  }

  /** @param {Curve} curve @returns {Curve["band"]} */
  bandOf(curve) {
    const others = this.repetitions.flatMap((other) => other.curve(curve.key) ?? []);
    if (!others.length) return null;
    const turn = curve.key === "base.yaw" ? 2 * Math.PI * curve.factor : 0;
    // Headings at the start that are equal may differ by whole turns.
    const turns = others.map(({ values }) => (turn ? turn * Math.round((curve.values[0] - values[0]) / turn) : 0));
    const low = curve.values.slice(), high = curve.values.slice();
    curve.times.forEach((time, row) => {
      others.forEach((other, i) => {
        const value = valueAt(other, time) + turns[i];
        if (value < low[row]) low[row] = value;
        if (value > high[row]) high[row] = value;
      });
    });
    return { runs: 1 + others.length, low, high };
  }

  addExpectations() {
    for (const signal of this.motion.replay.signals) {
      const expected = this.expectations[signal.expectation];
      const title = expected?.name ?? signal.name;
      const { factor } = shownUnit(signal.unit);
      const limit = (/** @type {number | undefined} */ value) => (value === undefined ? null : value * factor);
      this.add("expectations", `${signal.expectation + 1}. ${signal.name}`, signal.unit, () => {
        const times = signal.time ? decoded(signal.time, 1 + signal.time.deltas.length) : this.motion.times;
        return {
          name: signal.name, title, times, values: decoded(signal.values, times.length),
          status: expected?.status ?? "free", cutOff: expected?.cutOff ?? false, decided: expected?.time ?? null,
          lower: limit(signal.lower), upper: limit(signal.upper), from: signal.start, to: signal.end ?? this.motion.end,
        };
      }, { about: title });
    }
  }

  addBase() {
    const { motion } = this;
    this.add("base", "distance from start", "m", () => ({ values: distances(motion) }));
    this.add("base", "speed", "m/s", () => ({ values: motion.speed }));
    this.add("base", "tilt", "rad", () => ({ values: motion.tilt }));
    this.add("base", "yaw", "rad", () => ({ values: yaws(motion) }));
    AXES.forEach((axis, i) => this.add("base", axis, "m", () => ({ values: motion.base[i] })));
  }

  addJoints() {
    const { replay, scene, joints, commanded } = this.motion;
    replay.joint_names.forEach((name, i) => {
      const slides = scene.links.some(({ joint }) => joint?.type === "prismatic" && joint.column === i);
      this.add("joints", name, slides ? "m" : "rad", () => ({ values: joints[i], commanded: commanded[i] ?? null }), { kind: commanded[i] ? BOTH : "" });
    });
  }

  /** Adds the stored channels; a commanded one belongs to the measured one of its name. */
  addChannels() {
    const channels = this.motion.replay.channels ?? [];
    const called = (/** @type {ChannelData} */ { group, name }) => JSON.stringify([group, name]);
    const measured = new Set(channels.filter((channel) => !channel.commanded).map(called));
    const commanded = new Map(channels.filter((channel) => channel.commanded).map((channel) => [called(channel), channel]));
    const read = (/** @type {ChannelData} */ { time, values }) => {
      const plain = time && plainColumn(time);
      const times = plain ? decoded(plain, 1 + plain.deltas.length) : this.motion.times;
      return { times, values: decoded(plainColumn(values), times.length) };
    };
    for (const channel of channels) {
      if (channel.commanded && measured.has(called(channel))) continue;
      const aim = commanded.get(called(channel));
      this.add(channel.group, channel.name, channel.unit, () => {
        const found = read(channel);
        // Nothing was measured: the commanded values alone.
        if (!aim || aim === channel) return { ...found, aimed: aim === channel };
        return { ...found, commanded: onto(found.times, read(aim)) };
      }, { kind: aim === channel ? "commanded" : aim ? BOTH : "" });
    }
  }

  addLinks() {
    const { motion } = this;
    const trail = (/** @type {number} */ link) => {
      const known = this.trails.get(link) ?? motion.trail(link);
      this.trails.set(link, known);
      return known;
    };
    motion.scene.links.forEach(({ name }, link) => {
      if (link > 0) AXES.forEach((axis, i) => this.add("links", `${name} ${axis}`, "m", () => ({ values: trail(link)[i] })));
    });
  }

  addBodies() {
    const { scene, tracks } = this.motion;
    for (const { name, track } of scene.bodies) {
      if (track !== undefined) AXES.forEach((axis, i) => this.add("bodies", `${name} ${axis}`, "m", () => ({ values: tracks[track][i] })));
    }
  }

  /** Returns the keys of the first plots: the signals of each expectation, failures first, then distance, speed and the like. */
  first() {
    const curves = [...this.signals.keys()].filter((key) => key.startsWith("expectations.")).map((key) => /** @type {Curve} */ (this.curve(key)));
    curves.sort((a, b) => badness(a) - badness(b));
    const named = new Set(curves.map((curve) => curve.name));
    const known = (/** @type {string} */ name) => named.has(name) || (name === "distance from start" && named.has("travelled"));
    const always = this.moves() ? ["base.distance from start", "base.speed", "base.tilt"] : this.movingJoints(curves.length ? 4 : 8);
    return [...curves.map((curve) => curve.key), ...always.filter((key) => !known(this.signals.get(key)?.name ?? ""))];
  }

  moves() {
    return this.motion.base.some((column) => span(column) > 1e-3);
  }

  /** @param {number} most */
  movingJoints(most) {
    const keys = [...this.signals.keys()].filter((key) => key.startsWith("joints."));
    return keys.slice(0, this.motion.joints.length).filter((_, i) => span(this.motion.joints[i]) > 1e-3).slice(0, most);
  }
}

/**
 * Returns a sort key: the worst status comes first, as on the page; among those that did not pass, undecided ones last.
 * @param {{status: string, cutOff: boolean}} expected
 */
function badness({ status, cutOff }) {
  const rank = ["failed", "inconclusive", "not_exercised", "warned"].indexOf(status);
  return rank < 0 ? 10 : rank + (cutOff ? 5 : 0);
}

/** @param {Float64Array} values */
function span(values) {
  const [low, high] = extent(values);
  return high - low;
}

/** @param {Motion} motion */
function distances(motion) {
  const [x, y] = motion.base;
  return x.map((value, i) => Math.hypot(value - x[0], y[i] - y[0]));
}

/** Returns the heading of the base in rad without jumps. @param {Motion} motion */
function yaws(motion) {
  const [, , , x, y, z, w] = motion.base;
  const found = w.map((_, i) => Math.atan2(2 * (w[i] * z[i] + x[i] * y[i]), 1 - 2 * (y[i] * y[i] + z[i] * z[i])));
  for (let i = 1; i < found.length; i++) found[i] -= 2 * Math.PI * Math.round((found[i] - found[i - 1]) / (2 * Math.PI));
  return found;
}

/**
 * Returns values that hold until the next one, at other times.
 * @param {Float64Array} times
 * @param {{times: Float64Array, values: Float64Array}} held
 */
function onto(times, held) {
  if (held.times === times) return held.values;
  let row = -1;
  return times.map((time) => {
    while (row + 1 < held.times.length && held.times[row + 1] <= time + 1e-9) row += 1;
    return row < 0 ? NaN : held.values[row];
  });
}

/** @param {Float64Array} times @param {number} time @returns {number} the last row at or before a time, at least 0 */
function rowAt(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle - 1;
  }
  return low;
}

/**
 * @param {Curve} curve
 * @param {number} time s
 * @param {Float64Array} [values] those of the curve if left out
 * @returns {number} the value of the curve, NaN where it has none
 */
function valueAt(curve, time, values = curve.values) {
  const { times } = curve;
  if (!times.length || time < times[0] - 0.05 || time > times[times.length - 1] + 0.05) return NaN;
  const low = rowAt(times, time);
  if (low === times.length - 1 || time <= times[low]) return values[low];
  const part = (time - times[low]) / (times[low + 1] - times[low]);
  return values[low] + part * (values[low + 1] - values[low]);
}
