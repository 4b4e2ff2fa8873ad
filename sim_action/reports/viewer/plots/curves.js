/** The curves of a run: the signals of each expectation, failures first, then distance, speed and the like. */

/**
 * @param {Motion} motion
 * @param {ExpectationEntry[]} expectations
 * @returns {Curve[]}
 */
function curvesOf(motion, expectations) {
  const asserted = motion.replay.signals.map((signal) => signalCurve(signal, motion, expectations));
  asserted.sort((a, b) => badness(a) - badness(b));
  const named = new Set(asserted.map((curve) => curve.name));
  const always = moves(motion) ? baseCurves(motion) : jointCurves(motion, asserted.length ? 4 : 8);
  const known = (/** @type {string} */ name) => named.has(name) || (name === "distance from start" && named.has("travelled"));
  return [...asserted, ...always.filter((curve) => !known(curve.name))];
}

/**
 * Returns a sort key: the worst status comes first, as on the page; among those that did not pass, undecided ones last.
 * @param {{status: string, cutOff: boolean}} expected
 */
function badness({ status, cutOff }) {
  const rank = ["failed", "inconclusive", "not_exercised", "warned"].indexOf(status);
  return rank < 0 ? 10 : rank + (cutOff ? 5 : 0);
}

/** @param {Motion} motion */
function baseCurves(motion) {
  return [
    freeCurve("distance from start", "m", motion.times, distances(motion)),
    freeCurve("speed", "m/s", motion.times, motion.speed),
    freeCurve("tilt", "rad", motion.times, motion.tilt),
  ];
}

/**
 * Returns the curves of the joints if the base does not move.
 * @param {Motion} motion
 * @param {number} most
 */
function jointCurves(motion, most) {
  return motion.joints.map((_, i) => jointCurve(motion, i)).filter(({ values }) => span(values) > 1e-3).slice(0, most);
}

/**
 * Returns the measured position of a joint, with the commanded one.
 * @param {Motion} motion
 * @param {number} i
 * @returns {Curve}
 */
function jointCurve(motion, i) {
  const { replay, scene, joints, times } = motion;
  const slides = scene.links.some(({ joint }) => joint?.type === "prismatic" && joint.column === i);
  const curve = freeCurve(replay.joint_names[i], slides ? "m" : "rad", times, joints[i]);
  const { factor } = shownUnit(slides ? "m" : "rad");
  return { ...curve, commanded: motion.commanded[i]?.map((value) => value * factor) ?? null };
}

/** @param {Motion} motion */
function moves(motion) {
  return motion.base.some((column) => span(column) > 1e-3);
}

/** @param {Float64Array} values */
function span(values) {
  const [low, high] = extent(values);
  return high - low;
}

/**
 * @param {SignalData} signal
 * @param {Motion} motion
 * @param {ExpectationEntry[]} expectations
 * @returns {Curve}
 */
function signalCurve(signal, motion, expectations) {
  const expected = expectations[signal.expectation];
  const times = signal.time ? decoded(signal.time, 1 + signal.time.deltas.length) : motion.times;
  const curve = freeCurve(signal.name, signal.unit, times, decoded(signal.values, times.length));
  const { factor } = shownUnit(signal.unit);
  return {
    ...curve,
    title: expected?.name ?? signal.name,
    status: expected?.status ?? "free",
    cutOff: expected?.cutOff ?? false,
    decided: expected?.time ?? null,
    lower: signal.lower === undefined ? null : signal.lower * factor,
    upper: signal.upper === undefined ? null : signal.upper * factor,
    from: signal.start,
    to: signal.end ?? motion.end,
  };
}

/**
 * @param {string} name
 * @param {string} unit
 * @param {Float64Array} times
 * @param {Float64Array} values
 * @returns {Curve}
 */
function freeCurve(name, unit, times, values) {
  const shown = shownUnit(unit);
  return {
    name, title: "", unit: shown.name, least: shown.least, times, values: values.map((value) => value * shown.factor),
    commanded: null, status: "free", cutOff: false, decided: null, lower: null, upper: null, from: times[0], to: times[times.length - 1],
  };
}

/** @param {Motion} motion */
function distances(motion) {
  const [x, y] = motion.base;
  return x.map((value, i) => Math.hypot(value - x[0], y[i] - y[0]));
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
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle - 1;
  }
  if (low === times.length - 1 || time <= times[low]) return values[low];
  const share = (time - times[low]) / (times[low + 1] - times[low]);
  return values[low] + share * (values[low + 1] - values[low]);
}
