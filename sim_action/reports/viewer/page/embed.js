/**
 * The layout for a frame in another page: the player of one scenario, and its name as a link to the whole report.
 * `report.html#embed&scenario=NAME&t=4.5` asks for it. A page for a notebook has it always.
 */

const embedded = "embed" in document.documentElement.dataset || new URLSearchParams(location.hash.slice(1)).has("embed");

/**
 * Makes the name of a scenario a link to the whole report, which opens at the same moment in a tab of its own.
 * @param {HTMLElement} article
 * @param {(time: number | null) => string} hash
 * @param {() => number | null} time
 */
function linkToWhole(article, hash, time) {
  const name = find(article, "h2");
  // A frame without an address, as in a notebook, has no whole report.
  if (location.protocol === "about:" || name.querySelector("a")) return;
  const whole = location.href.split("#")[0];
  const link = make("a", { href: whole + hash(null), target: "_blank", rel: "noopener" }, name.textContent ?? "");
  const update = () => {
    link.href = whole + hash(time());
  };
  for (const kind of ["pointerdown", "keydown"]) link.addEventListener(kind, update);
  name.replaceChildren(link);
}
