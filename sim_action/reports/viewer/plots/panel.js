/** The plots of a run: which signals they show, and the time that they show; the address names both. */
class PlotPanel {
  /**
   * @param {Motion} motion
   * @param {ScenarioEntry} entry
   * @param {Clock} clock
   */
  constructor(motion, entry, clock) {
    this.entry = entry;
    this.clock = clock;
    this.catalogue = new Catalogue(motion, entry.expectations);
    this.range = { from: clock.start, to: clock.start + clock.length };
    /** @type {Catalogue | null} */
    this.ghost = null;
    this.ghostName = "";
    /** @type {Plot[]} */
    this.plots = [];
    /** The plot to which chosen signals are added; null: a new one. @type {Plot | null} */
    this.target = null;
    this.chooser = new Chooser(this.catalogue, (key) => this.target?.keys.includes(key) ?? false, (key) => this.toggle(key));
    this.whole = this.tool("Whole run", "Show the whole run (0)", () => this.zoom(this.all));
    this.whole.hidden = true;
    const add = this.tool("Add a plot", "Choose signals for a new plot (p)", () => this.choose(null));
    const csv = this.tool("CSV", "Save the values of all plots in the shown time as CSV", () => this.saveCsv(this.plots));
    this.tools = make("div", { class: "choice" }, this.whole, add, csv);
    this.list = make("div", { class: "list" });
    this.element = make("div", { class: "plots" }, this.tools, this.list, this.chooser.element);
    this.first = this.catalogue.first().map((key) => [key]);
    this.restore();
  }

  get all() {
    return { from: this.clock.start, to: this.clock.start + this.clock.length };
  }

  get isZoomed() {
    return this.range.from > this.all.from || this.range.to < this.all.to;
  }

  /** @param {string} words @param {string} title @param {() => void} act */
  tool(words, title, act) {
    const button = make("button", { type: "button", title }, words);
    button.addEventListener("click", act);
    return button;
  }

  /** Shows the signals and the time that the address names. */
  restore() {
    const words = addressed("plots");
    const asked = words === null ? this.first : plotsOf(words);
    const zoom = /^(-?[\d.]+)-([\d.]+)$/.exec(addressed("zoom") ?? "");
    this.setRange(zoom ? { from: Number(zoom[1]), to: Number(zoom[2]) } : this.all);
    this.plots = asked.flatMap((keys) => {
      const curves = keys.flatMap((key) => this.catalogue.curve(key) ?? []);
      return curves.length ? [this.plotOf(curves)] : [];
    });
    this.list.replaceChildren(...this.plots.map((plot) => plot.element));
    this.draw();
  }

  remember() {
    const shown = this.plots.map((plot) => plot.keys);
    const words = plotWord(shown);
    const { from, to } = this.range;
    remember({ plots: words === plotWord(this.first) ? null : words, zoom: this.isZoomed ? `${timeWord(from)}-${timeWord(to)}` : null });
  }

  /** @param {Curve[]} curves */
  plotOf(curves) {
    // One unit too many: the rest is left out.
    const units = [...new Set(curves.map((curve) => curve.unit))].slice(0, 2);
    const plot = new Plot(curves.filter((curve) => units.includes(curve.unit)), this.clock, this.range);
    plot.setGhost(this.ghost, this.ghostName);
    plot.addEventListener("zoomed", (event) => this.zoom(detailOf(event)));
    plot.addEventListener("pointed", (event) => this.plots.forEach((each) => each.point(detailOf(event))));
    plot.addEventListener("choosing", () => this.choose(plot));
    plot.addEventListener("csv", () => this.saveCsv([plot]));
    plot.addEventListener("png", () => this.savePng(plot));
    plot.addEventListener("taken", (event) => this.take(plot, detailOf(event)));
    plot.addEventListener("removed", () => this.remove(plot));
    return plot;
  }

  /** @param {Plot | null} plot null: a new one */
  choose(plot) {
    this.target = plot;
    this.chooser.open();
  }

  /** Adds a signal to the plot for which signals are chosen, or takes it away. @param {string} key */
  toggle(key) {
    const { target } = this;
    if (target?.keys.includes(key)) this.take(target, key);
    else this.add(key);
  }

  /** @param {string} key */
  add(key) {
    const curve = this.catalogue.curve(key);
    if (!curve) return;
    const { target } = this;
    if (target?.takes(curve)) target.show([...target.curves, curve]);
    else {
      // A third unit has a plot of its own.
      const plot = this.plotOf([curve]);
      const at = target ? this.plots.indexOf(target) + 1 : 0;
      this.plots.splice(at, 0, plot);
      if (target) target.element.after(plot.element);
      else this.list.prepend(plot.element);
      this.target = plot;
    }
    this.changed();
  }

  /** @param {Plot} plot @param {string} key */
  take(plot, key) {
    const rest = plot.curves.filter((curve) => curve.key !== key);
    if (!rest.length) {
      this.remove(plot);
      return;
    }
    plot.show(rest);
    this.changed();
  }

  /** @param {Plot} plot */
  remove(plot) {
    this.plots.splice(this.plots.indexOf(plot), 1);
    plot.element.remove();
    if (this.target === plot) this.target = null;
    this.changed();
  }

  changed() {
    for (const plot of this.plots) plot.setGhost(this.ghost, this.ghostName);
    this.draw();
    this.remember();
  }

  /**
   * Draws the same signals of another run as thin lines in all plots.
   * @param {Motion | null} motion null: of none
   * @param {string} [name] of the other run, for the legend
   */
  setGhost(motion, name = "other run") {
    this.ghost = motion && new Catalogue(motion, this.entry.expectations);
    this.ghostName = name;
    for (const plot of this.plots) plot.setGhost(this.ghost, name);
    this.draw();
  }

  /** Draws the range of the values in these and in this run as bands. @param {Motion[]} motions */
  showRepetitions(motions) {
    this.catalogue.setRepetitions(motions);
    for (const plot of this.plots) plot.show(plot.curves);
    this.draw();
  }

  /** Shows another range of time. @param {{from: number, to: number}} range */
  zoom(range) {
    this.setRange(range);
    this.draw();
    this.remember();
  }

  /** Zooms in or out around the time of the clock. @param {number} factor of the shown time */
  zoomBy(factor) {
    const { from, to } = this.range;
    const middle = Math.min(to, Math.max(from, this.clock.time));
    this.zoom({ from: middle - (middle - from) * factor, to: middle + (to - middle) * factor });
  }

  /** @param {{from: number, to: number}} range */
  setRange(range) {
    const { from, to } = this.all;
    // A shorter time than that of a few frames shows nothing.
    const length = Math.min(to - from, Math.max(0.1, range.to - range.from));
    const start = Number.isFinite(range.from + range.to) ? Math.min(to - length, Math.max(from, range.from)) : from;
    this.range.from = start;
    this.range.to = length >= to - from ? to : start + length;
    this.whole.hidden = !this.isZoomed;
  }

  draw() {
    const colours = coloursOfPage();
    // The time axes of all plots are below each other.
    const hasRightAxis = this.plots.some((plot) => plot.units.length > 1);
    for (const plot of this.plots) {
      plot.hasRightAxis = hasRightAxis;
      plot.draw(colours);
    }
    for (const plot of this.plots) plot.moveCursor(this.clock.time);
  }

  /** Moves the cursor of all plots; a zoomed range follows it. @param {number} time */
  moveCursor(time) {
    const { from, to } = this.range;
    if (this.isZoomed && this.clock.playing && (time > to || time < from)) {
      this.setRange({ from: time, to: time + to - from });
      this.draw();
    } else for (const plot of this.plots) plot.moveCursor(time);
  }

  /** @param {Plot[]} plots */
  saveCsv(plots) {
    const curves = [...new Set(plots.flatMap((plot) => plot.curves))];
    saveFile(new Blob([csvOf(curves, this.range, ({ key }) => this.ghost?.curve(key) ?? null, this.ghostName)], { type: "text/csv;charset=utf-8" }), `${fileStem(this.entry.name)}.csv`);
  }

  /** @param {Plot} plot */
  savePng(plot) {
    const name = fileStem(`${this.entry.name} ${plot.curves[0].name}`);
    pictureOf(plot, this.entry.name, coloursOfPage()).toBlob((blob) => saveFile(blob, `${name}.png`));
  }
}

/** @param {Event} event */
function detailOf(event) {
  return event instanceof CustomEvent ? event.detail : null;
}

/** @param {string[][]} plots the keys of each @returns {string} a word of the address */
function plotWord(plots) {
  const escaped = (/** @type {string} */ key) => key.replace(/[%,;]/g, (mark) => encodeURIComponent(mark));
  return plots.map((keys) => keys.map(escaped).join(",")).join(";");
}

/** @param {string} word @returns {string[][]} the keys of each plot */
function plotsOf(word) {
  const plain = (/** @type {string} */ key) => key.replace(/%(25|2C|3B)/g, decodeURIComponent);
  return word.split(";").filter(Boolean).map((keys) => keys.split(",").map(plain));
}
