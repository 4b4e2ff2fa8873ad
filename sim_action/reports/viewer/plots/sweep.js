/** The runs of a gate, or the variations of a scenario, over their parameters: scatter plot and heat map. */

const MARGINS = { left: 58, leftOfWords: 104, right: 14, top: 12, bottom: 44 };
const NEAR = 22;
/** The word of the address for what the plot shows -> as the menu says it. */
const KINDS = { runs: "each run", margin: "heat map of the mean", share: "heat map of the share passed" };
const SHAPES = {
  passed: "M-4.5,0a4.5,4.5 0 1,0 9,0a4.5,4.5 0 1,0 -9,0z",
  failed: "M0,-6.5L6.5,0L0,6.5L-6.5,0z",
  open: "M-4.5,-4.5h9v9h-9z",
};

class Sweep {
  /**
   * @param {string} name unique in the page
   * @param {SweepData} data
   * @param {(ScenarioEntry | null)[]} entries the article of each run; null: the page has none
   */
  constructor(name, data, entries) {
    this.name = name;
    this.data = data;
    this.entries = entries;
    const parameters = data.parameters.map(sweepAxis), series = data.series.map(sweepAxis);
    this.parameters = parameters;
    this.axes = [...parameters, ...series];
    const margins = this.axes.filter(({ signed }) => signed);
    /** @type {SweepTarget[]} */
    this.targets = [];
    /** @type {SweepTarget | null} */
    this.active = null;
    const strength = (/** @type {SweepAxis} */ axis) => dependence(axis.values, series[0].values);
    const ranked = [...parameters].sort((a, b) => strength(b) - strength(a));
    this.x = this.choice("Across", parameters, ranked[0]);
    this.y = this.choice("Up", this.axes, ranked[1] ?? series[0]);
    this.colour = this.choice("Colour", margins, margins[0]);
    this.kind = make("select", { "aria-label": "Show" }, ...Object.entries(KINDS).map(([value, words]) => make("option", { value }, words)));
    this.kind.addEventListener("change", () => this.changed());
    this.usual = this.words;
    this.drawing = drawnElement("svg", { class: "points", tabindex: 0, role: "listbox", "aria-label": "Runs; the arrow keys move between them, Enter opens one" });
    this.readout = make("p", { class: "readout-of-run" });
    this.legend = make("p", { class: "legend" });
    const labelled = (/** @type {string} */ words, /** @type {Element} */ field) => make("label", {}, `${words} `, field);
    const fields = make("div", { class: "fields" }, labelled("Across", this.x.list), labelled("Up", this.y.list), labelled("Colour", this.colour.list), labelled("Show", this.kind));
    this.element = make("div", {}, make("h3", {}, "Parameters"), fields, this.drawing, this.readout, this.legend);
    this.listen();
  }

  /**
   * @param {string} words
   * @param {SweepAxis[]} axes
   * @param {SweepAxis} first
   */
  choice(words, axes, first) {
    const list = make("select", { "aria-label": words }, ...axes.map((axis, i) => make("option", { value: i, selected: axis === first }, axis.name)));
    list.addEventListener("change", () => this.changed());
    return { list, axes, get axis() { return axes[Number(list.value)]; } };
  }

  /** The choices as words of the address. @returns {Record<string, string>} */
  get words() {
    return { across: this.x.axis.name, up: this.y.axis.name, colour: this.colour.axis.name, show: this.kind.value };
  }

  /** Takes the choices that the address names and keeps the others; then the address names all that are not the usual ones. */
  restore() {
    const { x: across, y: up, colour } = this;
    for (const [key, { list, axes }] of Object.entries({ across, up, colour })) {
      const place = axes.findIndex(({ name }) => name === addressed(key));
      if (place >= 0) list.value = String(place);
    }
    const show = addressed("show") ?? "";
    if (show in KINDS) this.kind.value = show;
    this.changed();
  }

  changed() {
    remember(Object.fromEntries(Object.entries(this.words).map(([key, word]) => [key, word === this.usual[key] ? null : word])));
    this.draw();
  }

  listen() {
    const near = (/** @type {MouseEvent} */ event) => {
      const box = this.drawing.getBoundingClientRect();
      return this.nearest(event.clientX - box.left, event.clientY - box.top);
    };
    this.drawing.addEventListener("pointermove", (event) => event instanceof PointerEvent && this.point(near(event)));
    this.drawing.addEventListener("click", (event) => {
      const target = event instanceof MouseEvent ? near(event) : null;
      // The first touch shows the values; there is no pointer before it that could.
      const touched = event instanceof PointerEvent && event.pointerType === "touch" && target !== this.active;
      this.point(target);
      if (target && !touched) this.open(target);
    });
    this.drawing.addEventListener("focus", () => this.point(this.active ?? this.targets[0]));
    this.drawing.addEventListener("keydown", (event) => {
      if (event instanceof KeyboardEvent && this.press(event.key)) {
        event.preventDefault();
        // The arrow keys move the replay elsewhere in the page.
        event.stopPropagation();
      }
    });
    new ResizeObserver(() => this.draw()).observe(this.drawing);
  }

  /** @param {string} key @returns {boolean} false: it is not a key of the plot */
  press(key) {
    const steps = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: 1, ArrowDown: -1 };
    if (key in steps) {
      const rows = this.kind.value !== "runs", across = key === "ArrowLeft" || key === "ArrowRight";
      // Points in the order of the axis; cells of a heat map row by row, or column by column.
      const [first, second] = across !== rows ? ["x", "y"] : ["y", "x"];
      const sign = (/** @type {string} */ axis) => (axis === "y" ? -1 : 1);
      const of = (/** @type {SweepTarget} */ target, /** @type {string} */ axis) => sign(axis) * (axis === "x" ? target.x : target.y);
      const ordered = [...this.targets].sort((a, b) => of(a, first) - of(b, first) || of(a, second) - of(b, second));
      const place = this.active ? ordered.indexOf(this.active) : -1;
      this.point(ordered[Math.max(0, Math.min(ordered.length - 1, place + steps[/** @type {keyof steps} */ (key)]))]);
    } else if (key === "Home" || key === "End") this.point(key === "Home" ? this.targets[0] : this.targets[this.targets.length - 1]);
    else if ((key === "Enter" || key === " ") && this.active) this.open(this.active);
    else return false;
    return true;
  }

  /** @param {number} x px @param {number} y px */
  nearest(x, y) {
    let found = null, least = Infinity;
    for (const target of this.targets) {
      const distance = Math.hypot(Math.max(0, Math.abs(target.x - x) - target.halfWidth), Math.max(0, Math.abs(target.y - y) - target.halfHeight));
      if (distance < least) [found, least] = [target, distance];
    }
    return least <= NEAR ? found : null;
  }

  /** Marks a target and shows its values. @param {SweepTarget | null | undefined} target */
  point(target) {
    if (!target || target === this.active) return;
    this.active?.node.setAttribute("aria-selected", "false");
    this.active = target;
    target.node.setAttribute("aria-selected", "true");
    this.drawing.setAttribute("aria-activedescendant", target.node.id);
    const entry = this.entries[target.run];
    const end = !entry ? "; the page has no article of this run" : entry.replay ? "" : "; no replay in this report";
    const link = entry ? make("a", { href: linkTo(entry, null) }, target.runs > 1 ? "open the worst run" : "open this run") : "";
    this.readout.replaceChildren(`${target.words}${end} `, link);
  }

  /** @param {SweepTarget} target */
  open(target) {
    const entry = this.entries[target.run];
    if (entry) location.hash = linkTo(entry, null);
  }

  draw() {
    const { width, height } = this.drawing.getBoundingClientRect();
    if (width < 100) return;
    const isMap = this.kind.value !== "runs";
    const [across, up] = [this.x.axis, this.y.axis].map((axis) => (isMap && this.parameters.includes(axis) ? listedAxis(axis) : axis));
    const left_of_plot = this.y.axis.categories.length ? MARGINS.leftOfWords : MARGINS.left;
    const area = { left: left_of_plot, right: width - MARGINS.right, top: MARGINS.top, bottom: height - MARGINS.bottom };
    const x = scaleOf(across, area.left, area.right), y = scaleOf(up, area.bottom, area.top);
    const chosen = this.active?.run;
    this.targets = [];
    this.active = null;
    this.drawing.replaceChildren(this.frame(area, { axis: across, scale: x }, { axis: up, scale: y }));
    if (isMap) this.drawCells(area, { axis: across, scale: x }, { axis: up, scale: y });
    else this.drawRuns(x, y);
    this.showLegend();
    const left = this.data.statuses.length - this.targets.reduce((sum, { runs }) => sum + runs, 0);
    this.readout.textContent = `Point at a ${isMap ? "cell" : "run"} to see its values.${left ? ` ${left} without a value here.` : ""}`;
    this.point(this.targets.find(({ run }) => run === chosen));
  }

  /** @param {Box} area @param {SweepSide} across @param {SweepSide} up */
  frame(area, { axis: across, scale: x }, { axis: up, scale: y }) {
    const group = drawnElement("g", { class: "axes", "aria-hidden": "true" });
    for (const { value, words } of ticksOf(up, y, (area.bottom - area.top) / 50, 15)) {
      group.append(drawnElement("line", { x1: area.left, x2: area.right, y1: y.at(value), y2: y.at(value), class: value === 0 && up.signed ? "zero" : "grid" }));
      group.append(drawnElement("text", { x: area.left - 6, y: y.at(value) + 4, "text-anchor": "end" }, words));
    }
    const longest = Math.max(0, ...across.categories.map((words) => shortWords(words).length));
    for (const { value, words } of ticksOf(across, x, (area.right - area.left) / 80, 7 * longest + 8)) {
      group.append(drawnElement("line", { x1: x.at(value), x2: x.at(value), y1: area.top, y2: area.bottom, class: "grid" }));
      group.append(drawnElement("text", { x: x.at(value), y: area.bottom + 16, "text-anchor": "middle" }, words));
    }
    const middle = (area.top + area.bottom) / 2;
    group.append(drawnElement("text", { x: (area.left + area.right) / 2, y: area.bottom + 36, "text-anchor": "middle", class: "name" }, axisTitle(across)));
    group.append(drawnElement("text", { x: 12, y: middle, transform: `rotate(-90 12 ${middle})`, "text-anchor": "middle", class: "name" }, axisTitle(up)));
    return group;
  }

  /** @param {SweepScale} x @param {SweepScale} y */
  drawRuns(x, y) {
    const range = colourRange(this.colour.axis);
    for (const [run, status] of this.data.statuses.entries()) {
      const at = { x: x.at(this.x.axis.values[run]), y: y.at(this.y.axis.values[run]) };
      if (Number.isNaN(at.x + at.y) || status === "skipped") continue;
      const shape = status === "passed" || status === "warned" ? "passed" : status === "failed" ? "failed" : "open";
      const tone = toneOf(placeIn(this.colour.axis.values[run], range));
      const node = drawnElement("path", { d: SHAPES[shape], transform: `translate(${at.x.toFixed(1)} ${at.y.toFixed(1)})`, class: `run-point ${shape} ${tone}` });
      const axes = [...new Set([this.x.axis, this.y.axis, this.colour.axis])];
      const words = `Run ${run + 1}, ${status.replace("_", " ")}: ${axes.map((axis) => `${axis.name} ${valueWords(axis, run)}`).join(", ")}`;
      this.offer({ ...at, halfWidth: 0, halfHeight: 0, run, runs: 1, words, node });
    }
    // Failures lie on top.
    this.drawing.append(...this.drawing.querySelectorAll(".failed"));
  }

  /** @param {Box} area @param {SweepSide} across @param {SweepSide} up */
  drawCells(area, { axis: across, scale: x }, { axis: up, scale: y }) {
    const [columns, rows] = [across, up].map((axis) => axis.categories.length || binCount(axis.values.length));
    const [width, height] = [(area.right - area.left) / columns, (area.bottom - area.top) / rows];
    /** @type {Map<number, number[]>} */
    const cells = new Map();
    for (const [run, status] of this.data.statuses.entries()) {
      const at = { x: x.at(across.values[run]), y: y.at(up.values[run]) };
      if (Number.isNaN(at.x + at.y) || status === "skipped") continue;
      const column = Math.min(columns - 1, Math.floor((at.x - area.left) / width)), row = Math.min(rows - 1, Math.floor((at.y - area.top) / height));
      const key = row * columns + column;
      cells.set(key, [...(cells.get(key) ?? []), run]);
    }
    for (const [key, runs] of [...cells].sort(([a], [b]) => a - b)) {
      const left = area.left + (key % columns) * width, top = area.top + Math.floor(key / columns) * height;
      const { share, words } = this.cell(runs);
      const node = drawnElement("g", { class: "cell" }, drawnElement("rect", { x: left, y: top, width, height, class: toneOf(share) }));
      const centre = { x: left + width / 2, y: top + height / 2 };
      if (width > 40 && height > 18) node.append(drawnElement("text", { x: centre.x, y: centre.y + 4, "text-anchor": "middle" }, words));
      const worst = runs.reduce((a, b) => (this.badness(b) < this.badness(a) ? b : a));
      const passed = runs.filter((run) => this.passed(run)).length;
      const value = this.kind.value === "margin" ? `${words} (mean of ${this.colour.axis.name})` : words;
      const where = [this.x.axis, this.y.axis].map((axis) => `${axis.name} ${rangeWords(axis, runs)}`).join(", ");
      this.offer({ ...centre, halfWidth: width / 2, halfHeight: height / 2, run: worst, runs: runs.length, words: `${value}: ${passed} of ${runs.length} passed at ${where}`, node });
    }
  }

  /** @param {number[]} runs @returns {{share: number, words: string}} the place between bad (-1) and good (1) */
  cell(runs) {
    if (this.kind.value === "share") {
      const share = runs.filter((run) => this.passed(run)).length / runs.length;
      const claim = this.data.claim ?? 0.5;
      return { share: (share - claim) / (share > claim ? 1 - claim : claim), words: told(Math.round(100 * share), "%") };
    }
    const values = runs.map((run) => this.colour.axis.values[run]).filter((value) => !Number.isNaN(value));
    const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
    return { share: placeIn(mean, colourRange(this.colour.axis)), words: told(Number(mean.toPrecision(2)), this.colour.axis.unit) };
  }

  /** @param {number} run */
  passed(run) {
    return this.data.statuses[run] === "passed" || this.data.statuses[run] === "warned";
  }

  /** Returns a sort key: runs that did not pass come first, then the smallest margin. @param {number} run */
  badness(run) {
    const value = this.axes.find(({ signed }) => signed)?.values[run] ?? 0;
    return (this.passed(run) ? 1e12 : 0) + (Number.isNaN(value) ? 0 : value);
  }

  /** Adds a target of pointer and keys. @param {SweepTarget} target */
  offer(target) {
    target.node.id = `${this.name}-${this.targets.length}`;
    for (const [key, value] of [["role", "option"], ["aria-selected", "false"], ["aria-label", target.words]]) target.node.setAttribute(key, value);
    this.targets.push(target);
    this.drawing.append(target.node);
  }

  showLegend() {
    const swatch = (/** @type {string} */ name, /** @type {string} */ d) =>
      drawnElement("svg", { viewBox: "-8 -8 16 16", "aria-hidden": "true" }, drawnElement("path", { d, class: name }));
    const tones = [...Array(TONES).keys()].map((tone) => swatch(`tone${tone}`, "M-8,-8h16v16h-16z"));
    const share = this.kind.value === "share", { axis } = this.colour, range = colourRange(axis);
    const claim = 100 * (this.data.claim ?? 0.5);
    const [least, most] = extent(axis.values);
    // Single values far from the others have the last colour.
    const [below, above] = [least < range[0] ? " or less" : "", most > range[1] ? " or more" : ""];
    const ends = [`${told(range[0], axis.unit)}${below}`, `${told(range[1], axis.unit)}${above}`];
    const [low, middle, high] = share ? ["0 %", told(claim, "%"), "100 %"] : [ends[0], "0", ends[1]];
    const shapes = this.kind.value !== "runs" ? [] : [["passed", "passed"], ["failed", "failed"], ["open", "without a verdict"]].map(([shape, words]) =>
      make("span", {}, swatch(`run-point ${shape}`, SHAPES[/** @type {keyof SHAPES} */ (shape)]), words));
    const title = share ? "share passed" : axis.name;
    this.legend.replaceChildren(make("span", {}, `${title}: ${low} `, ...tones, ` ${high}, grey: ${middle}`), ...shapes);
  }
}

/** Returns the number of bins of an axis, so that cells have some runs each. @param {number} runs */
function binCount(runs) {
  return Math.max(3, Math.min(12, Math.round(Math.sqrt(runs / 4))));
}

/** @param {SweepAxis} axis @param {number[]} runs */
function rangeWords(axis, runs) {
  const [low, high] = extent(runs.map((run) => axis.values[run]));
  if (axis.categories.length || low === high) return valueWords(axis, runs[0]);
  return `${shortNumber(low)} to ${told(high, axis.unit)}`;
}
