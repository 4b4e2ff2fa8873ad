/** Quantities for people: angles in degrees, four digits. */

const DEGREES = 180 / Math.PI;

/**
 * @param {string} unit
 * @returns {{factor: number, name: string}}
 */
function shownUnit(unit) {
  // What is counted needs no word, and no plural.
  if (unit === "contacts") return { factor: 1, name: "" };
  return /^rad/.test(unit) ? { factor: DEGREES, name: unit.replace("rad", "deg") } : { factor: 1, name: unit };
}

/**
 * @param {number} value as it is to be shown
 * @param {string} unit
 */
function told(value, unit) {
  return Number.isNaN(value) ? "–" : `${shortNumber(value)} ${unit}`.trimEnd();
}

/** @param {number} value */
function shortNumber(value) {
  const size = Math.abs(value);
  if (size > 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(1).replace("e+", "e");
  return String(Number(value.toPrecision(size < 1 ? 3 : 4)));
}

/** @param {number} time s */
function clockTime(time) {
  return `${time.toFixed(2)} s`;
}
