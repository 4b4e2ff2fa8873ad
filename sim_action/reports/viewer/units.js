/** Quantities as text: angles in degrees, four digits. */

const DEGREES = 180 / Math.PI;

/**
 * @param {string} unit
 * @returns {{factor: number, name: string, least: number}} `least`: smaller ranges, in the shown unit, are noise
 */
function shownUnit(unit) {
  // Counts have no unit.
  if (unit === "contacts") return { factor: 1, name: "", least: 1 };
  if (/^rad/.test(unit)) return { factor: DEGREES, name: unit.replace("rad", "deg"), least: 1 };
  return { factor: 1, name: unit, least: unit === "N" ? 1 : 1e-3 };
}

/**
 * @param {number} value in the shown unit
 * @param {string} unit
 */
function told(value, unit) {
  return Number.isNaN(value) ? "–" : `${shortNumber(value)} ${unit}`.trimEnd();
}

/** @param {number} value */
function shortNumber(value) {
  const size = Math.abs(value);
  if (size > 0 && (size < 1e-4 || size >= 1e5)) return value.toExponential(1).replace("e+", "e");
  return String(Number(value.toPrecision(size < 1 ? 3 : 4)));
}

/** @param {number} time s */
function clockTime(time) {
  return `${time.toFixed(2)} s`;
}
