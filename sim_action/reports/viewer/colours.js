/** The colours of the style sheet in the light or dark scheme. */

/** @returns {Colours} */
function coloursOfPage() {
  const style = getComputedStyle(document.documentElement);
  const of = (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ground: of("ground"), raised: of("raised"), line: of("line"), text: of("text"), faint: of("faint"),
    accent: of("accent"), bad: of("bad"), body: of("body"), robot: of("robot"), floor: of("floor"), ghost: of("ghost"),
    lines: [1, 2, 3, 4, 5, 6].map((number) => of(`line${number}`)),
    dark: matchMedia("(prefers-color-scheme: dark)").matches,
  };
}
