/** The scales of a plot over parameters: axes of numbers and of categories, colours of margins. */

const NAMESPACE = "http://www.w3.org/2000/svg";
const TONES = 9;
/** A heat map has a cell for each value of a parameter with at most so many of them; the values of others share cells. */
const MOST_VALUES = 12;

/**
 * Creates an element of a drawing.
 * @param {string} name
 * @param {Record<string, string | number>} attributes
 * @param {(Node | string)[]} children
 */
function drawnElement(name, attributes, ...children) {
  const element = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  element.append(...children);
  return element;
}

/**
 * Returns a column of the page in the units that are shown; NaN: no value.
 * @param {SweepColumn} column
 * @returns {SweepAxis}
 */
function sweepAxis(column) {
  const { factor, name } = shownUnit(column.unit);
  const values = column.values.map((value) => (value === null ? NaN : value * factor));
  return { name: column.name, unit: name, categories: column.categories ?? [], signed: column.signed ?? false, values };
}

/**
 * Returns the axis of a parameter with equal room for each of its values, if they are few.
 * @param {SweepAxis} axis
 * @returns {SweepAxis}
 */
function listedAxis(axis) {
  const found = [...new Set(axis.values.filter((value) => !Number.isNaN(value)))].sort((a, b) => a - b);
  if (axis.categories.length || found.length > MOST_VALUES) return axis;
  const values = axis.values.map((value) => (Number.isNaN(value) ? NaN : found.indexOf(value)));
  return { ...axis, categories: found.map(shortNumber), values };
}

/** @param {SweepAxis} axis */
function axisTitle(axis) {
  return axis.unit ? `${axis.name} (${axis.unit})` : axis.name;
}

/** @param {SweepAxis} axis @param {number} run */
function valueWords(axis, run) {
  const value = axis.values[run];
  return axis.categories.length ? axis.categories[value] ?? "–" : told(value, axis.unit);
}

/**
 * Returns the scale of an axis on the screen; categories have equal room.
 * @param {SweepAxis} axis
 * @param {number} from px
 * @param {number} to px
 * @returns {SweepScale}
 */
function scaleOf(axis, from, to) {
  let [low, high] = extent(axis.values);
  if (axis.categories.length) [low, high] = [-0.5, axis.categories.length - 0.5];
  else {
    const room = 0.04 * (high - low || Math.abs(high) || 1);
    [low, high] = [low - room, high + room];
  }
  return { low, high, at: (value) => from + ((value - low) / (high - low)) * (to - from) };
}

/**
 * @param {SweepAxis} axis
 * @param {SweepScale} scale
 * @param {number} most number of labels of numbers
 * @param {number} apart the least distance of words in px
 * @returns {{value: number, words: string}[]}
 */
function ticksOf(axis, scale, most, apart) {
  if (axis.categories.length) {
    const every = Math.ceil(apart / Math.abs(scale.at(1) - scale.at(0)));
    return axis.categories.map((words, value) => ({ value, words: shortWords(words) })).filter(({ value }) => value % every === 0);
  }
  const values = roundNumbers(scale.low, scale.high, (scale.high - scale.low) / Math.max(2, most));
  return values.map((value) => ({ value, words: shortNumber(Number(value.toPrecision(12))) }));
}

/** @param {string} words */
function shortWords(words) {
  return words.length > 12 ? `${words.slice(0, 11)}…` : words;
}

/**
 * Returns the margins at which the colours end, below and above zero: those beyond most others look alike.
 * @param {SweepAxis} axis
 * @returns {[number, number]}
 */
function colourRange(axis) {
  const end = (/** @type {number} */ sign) => {
    const sizes = axis.values.map((value) => sign * value).filter((size) => size > 0).sort((a, b) => a - b);
    return sign * (sizes[Math.floor(0.9 * (sizes.length - 1))] ?? 0);
  };
  return [end(-1), end(1)];
}

/**
 * Returns the place of a value between the ends of the colours, from -1 (bad) to 1 (good).
 * @param {number} value
 * @param {[number, number]} range below and above zero
 */
function placeIn(value, [low, high]) {
  if (value === 0) return 0;
  return value < 0 ? -(value / low) : value / high;
}

/**
 * Returns the class of the colour of a share of the range, from -1 (bad) to 1 (good).
 * @param {number} share
 */
function toneOf(share) {
  if (Number.isNaN(share)) return "unknown";
  const middle = (TONES - 1) / 2;
  const steps = Math.round(Math.max(-1, Math.min(1, share)) * middle);
  // The middle is for zero only: a small margin has a side.
  return `tone${middle + (steps || Math.sign(share))}`;
}

/**
 * Returns how strongly two columns depend on each other linearly, from 0 to 1.
 * @param {number[]} a
 * @param {number[]} b
 */
function dependence(a, b) {
  const rows = a.map((value, i) => [value, b[i]]).filter(([x, y]) => !Number.isNaN(x + y));
  const mean = (/** @type {number} */ k) => rows.reduce((sum, row) => sum + row[k], 0) / rows.length;
  const [x0, y0] = [mean(0), mean(1)];
  let xy = 0, xx = 0, yy = 0;
  for (const [x, y] of rows) {
    xy += (x - x0) * (y - y0);
    xx += (x - x0) ** 2;
    yy += (y - y0) ** 2;
  }
  return xx > 0 && yy > 0 ? Math.abs(xy) / Math.sqrt(xx * yy) : 0;
}
