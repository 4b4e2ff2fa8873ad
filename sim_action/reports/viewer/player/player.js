/** The player of one run: view, controls and plots with a common clock. */
class Player {
  /**
   * @param {Replay} replay
   * @param {ScenarioEntry} entry
   */
  constructor(replay, entry) {
    const motion = new Motion(replay);
    this.motion = motion;
    this.entry = entry;
    this.clock = new Clock(motion.start, motion.end);
    const failed = new Set(entry.expectations.flatMap((expected, i) => (expected.status === "failed" && !expected.cutOff ? [i] : [])));
    this.views = new Views(this.clock, motion, failed);
    this.controls = new Controls(this.clock, motion, entry.expectations);
    this.plots = curvesOf(motion, entry.expectations).map((curve) => new Plot(curve, this.clock));
    this.choice = new SignalChoice(motion, (curve) => this.addPlot(curve));
    this.views.element.addEventListener("linkchosen", () => this.choice.offer(this.views.link));
    const plots = make("div", { class: "plots" }, this.choice.element, ...this.plots.map((plot) => plot.element));
    const screen = make("div", { class: "screen" }, this.views.element, this.controls.element, keysHint());
    this.element = make("div", { class: "player" }, screen, plots);
    this.clock.addEventListener("tick", () => this.show());
    this.observer = new ResizeObserver(() => this.resize());
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.repaint = () => this.changeColours();
    this.dark.addEventListener("change", this.repaint);
  }

  /** Starts drawing; to be called when the element is in the page. @param {number | null} time */
  async open(time) {
    this.clock.seek(time ?? this.mattered());
    // The observer also reports the first size and so draws the plots, before the view is ready.
    this.observer.observe(this.element);
    await painted();
    if (this.element.isConnected) await this.views.open();
  }

  /** The decisive sim time: that of the failure, or the end of a run with an error, else the start. */
  mattered() {
    const first = moments(this.entry.expectations)[0];
    if (this.entry.moment !== null) return this.entry.moment;
    if (first && first.status === "failed") return first.time;
    return this.entry.status === "error" ? this.clock.end : this.clock.start;
  }

  /** Adds a plot above the others. @param {Curve} curve */
  addPlot(curve) {
    const plot = new Plot(curve, this.clock);
    this.plots.push(plot);
    plot.removal.hidden = false;
    plot.removal.addEventListener("click", () => {
      this.plots.splice(this.plots.indexOf(plot), 1);
      plot.element.remove();
    });
    this.choice.element.after(plot.element);
    plot.draw(coloursOfPage());
    plot.moveCursor(this.clock.time);
  }

  show() {
    this.views.draw();
    for (const plot of this.plots) plot.moveCursor(this.clock.time);
  }

  resize() {
    const colours = coloursOfPage();
    for (const plot of this.plots) plot.draw(colours);
    this.views.resize();
    this.show();
  }

  changeColours() {
    if (this.views.canvas.dataset.kind === "3d") void this.views.open();
    this.resize();
  }

  dispose() {
    this.clock.pause();
    this.observer.disconnect();
    this.dark.removeEventListener("change", this.repaint);
    this.views.dispose();
    this.element.remove();
  }
}

/** Resolves when the browser has painted. */
function painted() {
  return new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
}

function keysHint() {
  const keys = [["space", "play"], ["← →", "step"], ["1 – 9", "moments"], ["f", "follow"]];
  const shown = keys.flatMap(([key, words]) => [make("kbd", {}, key), ` ${words}  `]);
  return make("p", { class: "keys" }, ...shown);
}
