/** The drawing of plots on a canvas: axes, windows, limits and lines; at most one line up and down in each column of pixels. */

/** The dashes of the lines of one plot in their order; short dashes are commanded values. */
const DASHES = [[], [14, 4], [10, 3, 2, 3], [5, 2], [16, 3, 2, 3, 2, 3]];
const COMMANDED_DASH = [2.5, 2.5];

/** The room for the numbers beside a plot in pixels. */
const LABEL_WIDTH = 37;
/** The shortest line of a limit in pixels. */
const LEAST_LIMIT = 24;
/** The height of the words of a limit in pixels. */
const WORDS_HEIGHT = 11;

/** @param {Chart} chart @param {PlotAxis[]} axes */
function drawAxes(chart, axes) {
  const { context, area, colours, range } = chart;
  context.font = "10.5px system-ui, sans-serif";
  context.fillStyle = colours.faint;
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  axes.forEach((axis, side) => {
    context.textBaseline = "middle";
    context.textAlign = side ? "left" : "right";
    const { low, high } = axis;
    for (const value of roundNumbers(low, high, (high - low) / 4)) {
      const at = Math.round(heightOf(chart, axis, value)) + 0.5;
      if (side === 0) strokeLine(context, area.left, at, area.right, at);
      else strokeLine(context, area.right, at, area.right + 3, at);
      // The unit has the place at the top.
      if (axes.length > 1 && at < area.top + 10) continue;
      // A long number becomes narrower, so that its sign stays in the picture.
      context.fillText(shortNumber(value), side ? area.right + 6 : area.left - 6, at, LABEL_WIDTH);
    }
    if (axes.length > 1) context.fillText(axis.unit, side ? area.right + 6 : area.left - 6, area.top);
  });
  context.textBaseline = "top";
  context.textAlign = "center";
  const pace = (range.to - range.from) / Math.max(2, (area.right - area.left) / 90);
  for (const time of roundNumbers(range.from - 1e-9, range.to + 1e-9, pace)) {
    const words = `${shortNumber(Number(time.toFixed(6)))} s`;
    const at = Math.min(chart.x(time), area.right + 7 - context.measureText(words).width / 2);
    context.fillText(words, at, area.bottom + 5);
  }
}

/** @param {CanvasRenderingContext2D} context @param {number} x0 @param {number} y0 @param {number} x1 @param {number} y1 */
function strokeLine(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

/** @param {Chart} chart @param {PlotAxis} axis @param {number} value @returns {number} its y in pixels */
function heightOf({ area }, { low, high }, value) {
  return area.bottom - ((value - low) / (high - low)) * (area.bottom - area.top);
}

/** Shades the window in which limits apply, unless that is the whole run. @param {Chart} chart @param {Curve} curve @param {Clock} clock */
function drawWindow(chart, curve, clock) {
  if (curve.status === "free" || (curve.from <= clock.start + 1e-6 && curve.to >= clock.end - 1e-6)) return;
  const { context, area, colours, x } = chart;
  const left = Math.max(area.left, x(curve.from)), right = Math.min(area.right, x(curve.to));
  if (right <= left) return;
  context.fillStyle = colours.accent;
  context.globalAlpha = colours.dark ? 0.16 : 0.1;
  context.fillRect(left, area.top, right - left, area.bottom - area.top);
  context.globalAlpha = 1;
}

/**
 * Draws the limits of a curve, each with its words where there is room.
 * @param {Chart} chart
 * @param {Curve} curve
 * @param {PlotAxis} axis
 * @param {Box[]} taken the places of the words of limits; those of this curve are added
 */
function drawLimits(chart, curve, axis, taken) {
  const { context, area, colours, x } = chart;
  context.setLineDash([5, 4]);
  context.lineWidth = 1.25;
  context.strokeStyle = curve.status === "failed" && !curve.cutOff ? colours.bad : colours.faint;
  context.fillStyle = context.strokeStyle;
  context.font = "10.5px system-ui, sans-serif";
  context.textAlign = "left";
  context.textBaseline = "top";
  const lines = [curve.upper, curve.lower].flatMap((limit) => {
    if (limit === null || limit < axis.low || limit > axis.high || x(curve.from) > area.right + 1 || x(curve.to) < area.left - 1) return [];
    // A run that ends as the window begins shows its limit, too.
    const right = Math.max(area.left + LEAST_LIMIT, Math.min(area.right, x(curve.to)));
    const left = Math.min(right - LEAST_LIMIT, Math.max(area.left, x(curve.from)));
    const top = heightOf(chart, axis, limit);
    strokeLine(context, left, top, right, top);
    return [{ limit, left, right, top, bottom: top }];
  });
  for (const { limit, left, top } of lines) {
    const words = `${limit === curve.lower ? "at least" : "at most"} ${told(limit, curve.unit)}`;
    const place = freePlace(area, { left: left + 4, at: top, width: context.measureText(words).width }, taken, lines);
    context.fillText(words, place.left, place.top);
    taken.push(place);
  }
  context.setLineDash([]);
}

/**
 * Returns a place for words above a line, below it, on the other side of a line close by, or behind other words.
 * @param {Chart["area"]} area
 * @param {{left: number, at: number, width: number}} wanted
 * @param {Box[]} taken
 * @param {Box[]} lines that words should not cross
 * @returns {Box}
 */
function freePlace(area, { left, at, width }, taken, lines) {
  const start = Math.max(area.left + 4, Math.min(left, area.right - width - 4));
  const near = [at, ...lines.map(({ top }) => top).filter((top) => top !== at && Math.abs(top - at) < 2 * WORDS_HEIGHT)];
  const tops = near.flatMap((line) => [line - 13, line + 3]).filter((top) => top > area.top - 6 && top + WORDS_HEIGHT < area.bottom + 1);
  const places = [...tops.map((top) => ({ left: start, top })), ...taken.map(({ right, top }) => ({ left: right + 10, top }))]
    .map((place) => ({ ...place, right: place.left + width, bottom: place.top + WORDS_HEIGHT }));
  const inside = places.filter(({ right }) => right <= area.right);
  const isFree = (/** @type {Box} */ one, /** @type {Box[]} */ others) =>
    others.every((other) => other.right < one.left || other.left > one.right || other.bottom < one.top || other.top > one.bottom);
  return inside.find((place) => isFree(place, [...taken, ...lines])) ?? inside.find((place) => isFree(place, taken)) ?? places[0];
}

/**
 * @param {Chart} chart
 * @param {PlotAxis} axis
 * @param {{times: Float64Array, values: Float64Array, colour: string, width: number, dash: number[], faint?: boolean}} line
 */
function drawLine(chart, axis, { times, values, colour, width, dash, faint }) {
  const { context } = chart;
  tracePath(chart, axis, times, values);
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.lineJoin = "round";
  context.globalAlpha = faint ? 0.65 : 1;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
  context.globalAlpha = 1;
}

/** Makes the path of values over the shown time, with gaps. @param {Chart} chart @param {PlotAxis} axis @param {Float64Array} times @param {Float64Array} values */
function tracePath(chart, axis, times, values) {
  const { context, x } = chart;
  const y = (/** @type {number} */ value) => heightOf(chart, axis, value);
  context.beginPath();
  let drawing = false;
  const add = (/** @type {number} */ row) => {
    if (Number.isNaN(values[row])) drawing = false;
    else if (drawing) context.lineTo(x(times[row]), y(values[row]));
    else {
      context.moveTo(x(times[row]), y(values[row]));
      drawing = true;
    }
  };
  shownRows(chart, times, values).forEach(add);
}

/** Fills the range of a curve in several runs. @param {Chart} chart @param {PlotAxis} axis @param {Curve} curve @param {string} colour */
function drawBand(chart, axis, { times, band }, colour) {
  if (!band) return;
  const { context, colours, x } = chart;
  const { low, high } = band;
  const rows = new Set([low, high].flatMap((values) => shownRows(chart, times, values)));
  context.fillStyle = colour;
  context.globalAlpha = colours.dark ? 0.35 : 0.25;
  /** The rows since the last gap. @type {number[]} */
  let part = [];
  const fill = () => {
    context.beginPath();
    for (const row of part) context.lineTo(x(times[row]), heightOf(chart, axis, high[row]));
    for (const row of part.reverse()) context.lineTo(x(times[row]), heightOf(chart, axis, low[row]));
    context.fill();
    part = [];
  };
  for (const row of [...rows].sort((a, b) => a - b)) {
    if (Number.isNaN(low[row])) fill();
    else part.push(row);
  }
  fill();
  context.globalAlpha = 1;
}

/** Returns the rows that a plot draws in the shown time. @param {Chart} chart @param {Float64Array} times @param {Float64Array} values */
function shownRows({ area, range }, times, values) {
  const first = rowAt(times, range.from), last = Math.min(times.length - 1, rowAt(times, range.to) + 1);
  if (last - first >= 3 * (area.right - area.left)) return tellingRows(values, first, last, Math.round(area.right - area.left));
  return Array.from({ length: Math.max(0, last + 1 - first) }, (_, i) => first + i);
}

/**
 * Returns the rows that a narrow plot shows: the first, smallest, largest and last value in each column, and gaps.
 * @param {Float64Array} values
 * @param {number} first
 * @param {number} last
 * @param {number} columns
 * @returns {number[]}
 */
function tellingRows(values, first, last, columns) {
  /** @type {number[]} */
  const rows = [];
  for (let column = 0; column < columns; column++) {
    const start = first + Math.floor(((last + 1 - first) * column) / columns);
    const end = first + Math.floor(((last + 1 - first) * (column + 1)) / columns) - 1;
    let low = -1, high = -1, gap = -1;
    for (let row = start; row <= end; row++) {
      if (Number.isNaN(values[row])) gap = row;
      else {
        if (low < 0 || values[row] < values[low]) low = row;
        if (high < 0 || values[row] > values[high]) high = row;
      }
    }
    rows.push(...[...new Set([start, low, high, gap, end])].filter((row) => row >= start).sort((a, b) => a - b));
  }
  return rows;
}

/** A dot where the expectation was decided. @param {Chart} chart @param {Curve} curve @param {PlotAxis} axis @param {string} colour */
function drawDecision(chart, curve, axis, colour) {
  const { context, area, colours, x } = chart;
  if (curve.decided === null) return;
  const value = valueAt(curve, curve.decided), at = x(curve.decided);
  if (Number.isNaN(value) || at < area.left - 1 || at > area.right + 1) return;
  context.beginPath();
  context.arc(at, heightOf(chart, axis, value), 4, 0, 2 * Math.PI);
  context.fillStyle = curve.status === "failed" && !curve.cutOff ? colours.bad : colour;
  context.fill();
  context.strokeStyle = colours.ground;
  context.lineWidth = 1.5;
  context.stroke();
}

/**
 * Returns the axis of curves of one unit: the range of all shown values, and of limits that are not far away.
 * @param {Curve[]} curves
 * @param {{from: number, to: number}} range the shown time
 * @param {Clock} clock
 * @returns {PlotAxis}
 */
function axisOf(curves, range, clock) {
  const whole = range.from <= clock.start && range.to >= clock.end;
  const least = Math.max(...curves.map((curve) => curve.least));
  let bottom = Infinity, top = -Infinity;
  const include = (/** @type {number} */ low, /** @type {number} */ high) => {
    bottom = Math.min(bottom, low);
    top = Math.max(top, high);
  };
  for (const { times, values, commanded, band } of curves) {
    const first = rowAt(times, range.from), last = rowAt(times, range.to) + 2;
    for (const column of [values, commanded, band?.low, band?.high]) if (column) include(...extent(whole ? column : column.subarray(first, last)));
  }
  const size = top - bottom;
  const limits = curves.flatMap(({ lower, upper }) => [lower, upper]).filter((limit) => limit !== null);
  for (const limit of limits.map(Number)) {
    if (whole || !(size >= 0) || (limit > bottom - 2 * size && limit < top + 2 * size)) include(limit, limit);
  }
  if (!(top >= bottom)) [bottom, top] = [0, 1];
  // Extend the axis to zero if zero is near.
  if (bottom > 0 && bottom < 0.5 * top) bottom = 0;
  // Do not magnify noise.
  const smallest = Math.max(whole ? least : least / 20, 1e-6 * Math.abs(top));
  if (top - bottom < smallest) {
    bottom = Math.min(bottom, Math.max(0, bottom - 1));
    top += smallest;
  }
  const room = 0.08 * (top - bottom);
  return { unit: curves[0].unit, low: bottom === 0 ? 0 : bottom - room, high: top + room };
}
