/** The colours of the style sheet in the light or dark scheme. */

/** The number of colours of lines in the style sheet. */
const LINE_COLOURS = 6;
/** The number of that of the commanded path, from 0. */
const COMMAND_COLOUR = 4;

/** @returns {Colours} */
function coloursOfPage() {
  const style = getComputedStyle(document.documentElement);
  const of = (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ground: of("ground"), raised: of("raised"), line: of("line"), text: of("text"), faint: of("faint"),
    accent: of("accent"), bad: of("bad"), body: of("body"), robot: of("robot"), floor: of("floor"), ghost: of("ghost"),
    lines: Array.from({ length: LINE_COLOURS }, (_, i) => of(`line${i + 1}`)),
    dark: matchMedia("(prefers-color-scheme: dark)").matches,
  };
}

/** Returns the place in a legend of a colour of lines; it follows the scheme. @param {number} number from 0 */
function lineSwatch(number) {
  const swatch = make("span", { class: "swatch" });
  swatch.style.background = `var(--line${1 + (number % LINE_COLOURS)})`;
  return swatch;
}
