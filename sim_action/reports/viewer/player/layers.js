/** The menu of layers: what is drawn over the robot and its world. */

/** @type {[string, string, (replay: Replay) => boolean][]} name, label, and whether a replay has it */
const LAYERS = [
  ["points", "Lidar points", ({ scans }) => Boolean(scans?.length)],
  ["rays", "Lidar rays", ({ scans }) => Boolean(scans?.length)],
  ["forces", "Contact forces", ({ contacts }) => contacts.some(({ forces }) => forces)],
  ["contacts", "Contact marks", ({ contacts }) => contacts.length > 0],
  ["pictures", "Pictures", ({ cameras }) => Boolean(cameras?.length)],
  ["command", "Commanded path", ({ commanded_path }) => Boolean(commanded_path?.length)],
  ["expectations", "Expectations", ({ marks }) => marks.some(({ expectation }) => expectation !== undefined)],
];

/** The chosen layers; it fires "change". */
class Layers extends EventTarget {
  /** @param {Replay} replay @param {ExpectationEntry[]} expectations */
  constructor(replay, expectations) {
    super();
    this.offered = LAYERS.filter(([, , has]) => has(replay)).map(([name]) => name);
    const usual = new Set(this.offered.filter((name) => name !== "rays" || raysMatter(replay, expectations)));
    const word = addressed("layers");
    /** @type {Set<string>} */
    this.shown = word === null ? usual : new Set(word.split(",").filter((name) => this.offered.includes(name)));
    const boxes = LAYERS.filter(([name]) => this.offered.includes(name)).map(([name, label]) => {
      const box = make("input", { type: "checkbox", checked: this.shown.has(name) });
      box.addEventListener("change", () => this.choose(name, box.checked));
      return make("label", {}, box, ` ${label}`);
    });
    const summary = make("summary", { title: "Choose what is drawn (l)" }, "Layers");
    this.element = make("details", { class: "layers", hidden: !boxes.length }, summary, make("div", {}, ...boxes));
    this.element.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !this.element.open) return;
      event.stopPropagation();
      this.element.open = false;
      summary.focus();
    });
  }

  /** @param {string} name @param {boolean} isShown */
  choose(name, isShown) {
    if (isShown) this.shown.add(name);
    else this.shown.delete(name);
    remember({ layers: [...this.shown].join(",") });
    this.dispatchEvent(new Event("change"));
  }

  /** Opens or closes the menu, and moves the focus into it. */
  toggle() {
    this.element.open = !this.element.open;
    if (this.element.open) find(this.element, "input").focus();
  }
}

/**
 * Returns true if a failed expectation names a lidar: then its rays say more than its points.
 * @param {Replay} replay
 * @param {ExpectationEntry[]} expectations
 */
function raysMatter({ scans }, expectations) {
  const failed = expectations.filter(({ status, cutOff }) => status === "failed" && !cutOff);
  return failed.some(({ name }) => (scans ?? []).some(({ sensor }) => name.includes(sensor)));
}
