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
    this.layers = new Layers(replay, entry.expectations);
    this.views = new Views(this.clock, motion, failed, this.layers);
    this.controls = new Controls(this.clock, motion, entry.expectations);
    this.plots = new PlotPanel(motion, entry, this.clock);
    this.ghosts = new Ghosts(entry.ghosts, motion, this.clock);
    this.ghosts.addEventListener("chosen", () => this.compare());
    const screen = make("div", { class: "screen" }, this.views.element, this.controls.element, this.ghosts.element, this.views.sensed, this.views.pictures.element, notesOf(replay.scene), keysHint(this));
    this.element = make("div", { class: "player" }, screen, this.plots.element);
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
    if (!this.element.isConnected) return;
    await this.views.open();
    // Another scenario may have been opened meanwhile, which the address names by now.
    if (!this.element.isConnected) return;
    await this.ghosts.restore();
    this.showRepetitions(await this.ghosts.repetitions());
  }

  /** Draws the paths of repetitions as thin lines, and their values as bands. @param {Motion[]} motions */
  showRepetitions(motions) {
    if (!motions.length || !this.element.isConnected) return;
    this.views.showRepetitions(motions);
    this.plots.showRepetitions(motions);
    this.show();
  }

  /** The decisive sim time: that of the failure, or the end of a run with an error, else the start. */
  mattered() {
    const first = moments(this.entry.expectations)[0];
    if (this.entry.moment !== null) return this.entry.moment;
    if (first && first.status === "failed") return first.time;
    return this.entry.status === "error" ? this.clock.end : this.clock.start;
  }

  /** Draws the chosen ghost in the view and in the plots. */
  compare() {
    const { ghost, label, entry } = this.ghosts;
    this.views.compare(ghost);
    this.controls.markParting(entry?.parting?.time ?? null);
    this.plots.setGhost(ghost, label);
    this.show();
  }

  show() {
    this.views.draw();
    this.plots.moveCursor(this.clock.time);
  }

  resize() {
    this.plots.draw();
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

/** The differences between the drawing and the model, and the meaning of shaded areas of the ground. @param {SceneData} scene */
function notesOf({ notes = [], patches = [] }) {
  const frictions = [...new Set(patches.map(({ friction }) => friction))].sort((a, b) => a - b).slice(0, 5);
  const shaded = frictions.length ? [`Shaded areas of the ground have a friction of ${frictions.join(", ")}`] : [];
  return make("p", { class: "notes faint" }, [...shaded, ...notes].map((note) => `${note}.`).join(" "));
}

/** Resolves when the browser has painted. */
function painted() {
  return new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
}
