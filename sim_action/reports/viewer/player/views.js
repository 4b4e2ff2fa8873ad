/** The view of the run: 3D if the page contains the viewer and the browser has WebGL, else the top view. */

/** @type {Promise<MakeView3D | null> | null} */
let viewerOfPage = null;

/** @returns {Promise<MakeView3D | null>} null if it is not in this file */
function viewer3D() {
  viewerOfPage ??= unpacked("viewer3d").then((text) => {
    if (text === null) return null;
    // The content security policy of the page allows this script by its hash.
    document.head.append(make("script", {}, text));
    return globalThis.simActionView3D ?? null;
  });
  return viewerOfPage;
}

/** What the 3D view and the drawing show, as the address says it -> as the menu says it. @type {Record<string, string>} */
const SIDES = { overview: "Overview", front: "Front", side: "Side", top: "From above", behind: "From behind", drawing: "Drawing" };

class Views {
  /**
   * @param {Clock} clock
   * @param {Motion} motion
   * @param {ReadonlySet<number>} failed
   * @param {Layers} layers
   */
  constructor(clock, motion, failed, layers) {
    this.clock = clock;
    this.motion = motion;
    this.failed = failed;
    this.layers = layers;
    this.following = false;
    /** The link whose path and frame are drawn; 0: the base, with its path alone. */
    this.link = 0;
    /** The run that is drawn as a ghost. @type {GhostMotion | null} */
    this.ghost = null;
    /** The runs whose paths are thin lines. @type {Motion[]} */
    this.repetitions = [];
    this.pending = 0;
    /** @type {View | null} */
    this.view = null;
    this.canvas = make("canvas");
    this.note = make("p", { class: "note", role: "status" });
    this.happening = make("p", { class: "happening" });
    this.pictures = new Pictures(motion.replay);
    this.lines = this.linesBelow();
    this.sensed = make("div", { class: "sensed" }, ...this.lines.map(({ element }) => element));
    /** The camera of the 3D view. @type {Preset} */
    this.preset = "overview";
    const sides = Object.entries(SIDES).map(([value, words]) => make("option", { value }, words));
    this.side = make("select", { "aria-label": "View", title: "Camera (c: the next one; v: drawing or 3D)", hidden: true }, ...sides);
    this.ruler = new Ruler();
    this.follow = make("button", { type: "button", title: "Follow the robot (f)", "aria-pressed": "false" }, "Follow");
    this.whole = make("button", { type: "button", title: "Show the whole path (h)" }, "Show all");
    const options = motion.scene.links.map(({ name }, i) => make("option", { value: i }, i ? name : `Link: ${name}`));
    this.links = make("select", { "aria-label": "Link", title: "Show the path and the frame of a link", hidden: options.length < 2 }, ...options);
    this.tools = make("div", { class: "tools" }, layers.element, this.links, this.side, this.follow, this.whole);
    this.element = make("div", { class: "view" }, this.canvas, this.ruler.element, this.tools, this.note, this.happening);
    this.side.addEventListener("change", () => void this.look(this.side.value));
    this.tapped = (/** @type {Event} */ event) => this.element.classList.toggle("held", event.target === this.canvas);
    document.addEventListener("click", this.tapped);
    this.follow.addEventListener("click", () => this.toggleFollow());
    this.whole.addEventListener("click", () => this.showAll());
    layers.addEventListener("change", () => {
      this.view?.showLayers(layers.shown);
      this.draw();
    });
    this.links.addEventListener("change", () => this.choose(Number(this.links.value)));
  }

  /** Shows the run, in 3D if possible, as the address says. */
  async open() {
    const asked = addressed("view") ?? "";
    if (asked in SIDES && asked !== "drawing") this.preset = /** @type {Preset} */ (asked);
    if (asked === "drawing") {
      this.side.hidden = (await viewer3D()) === null;
      this.showTop();
    } else await this.open3D();
  }

  async open3D() {
    try {
      const make3D = await viewer3D();
      if (this.disposed) return;
      if (make3D) {
        this.show((canvas) => make3D(canvas, this.motion, this.failed, coloursOfPage()), "3d");
        this.side.hidden = false;
        this.turnTo(this.preset);
        return;
      }
      this.note.textContent = "Top view only: this report was made without the 3D viewer.";
    } catch {
      this.note.textContent = "Top view only: this browser has no WebGL for 3D.";
    }
    this.showTop();
  }

  showTop() {
    this.show((canvas) => new TopView(canvas, this.motion, this.failed), "top");
  }

  /**
   * @param {(canvas: HTMLCanvasElement) => View} make_view
   * @param {"3d" | "top"} kind
   */
  show(make_view, kind) {
    this.view?.dispose();
    this.view = null;
    // A canvas keeps its first kind of context, so each kind of view needs a new one.
    const canvas = make("canvas", { role: "img", "aria-label": "The robot and its world", "data-kind": kind });
    this.canvas.replaceWith(canvas);
    this.canvas = canvas;
    this.view = make_view(canvas);
    this.view.choose(this.link, this.repetitions);
    this.view.showLayers(this.layers.shown);
    this.view.compare(this.ghost);
    canvas.addEventListener("viewmoved", () => this.draw());
    this.side.value = kind === "3d" ? this.preset : "drawing";
    this.ruler.measure(canvas, this.view);
    this.resize();
  }

  async toggleKind() {
    if (!this.side.hidden) await this.look(this.canvas.dataset.kind === "3d" ? "drawing" : this.preset);
  }

  /** Shows the next side. */
  async nextSide() {
    const all = Object.keys(SIDES);
    if (!this.side.hidden) await this.look(all[(all.indexOf(this.side.value) + 1) % all.length]);
  }

  /** Shows a side, and has the address say so. @param {string} side */
  async look(side) {
    remember({ view: side === "overview" ? null : side });
    this.side.value = side;
    if (side === "drawing") return this.showTop();
    this.preset = /** @type {Preset} */ (side);
    if (this.canvas.dataset.kind === "3d") this.turnTo(this.preset);
    else await this.open3D();
  }

  /** @param {Preset} preset */
  turnTo(preset) {
    this.view?.from(preset);
    if (this.following !== (preset === "behind")) this.toggleFollow();
    this.draw();
  }

  /** Shows the path and the frame of a link. @param {number} link */
  choose(link) {
    this.link = link;
    this.view?.choose(link, this.repetitions);
    this.draw();
  }

  /** Draws the paths of other runs as thin lines. @param {Motion[]} runs */
  showRepetitions(runs) {
    this.repetitions = runs;
    this.choose(this.link);
  }

  /** Draws another run as a ghost; null: none. @param {GhostMotion | null} ghost */
  compare(ghost) {
    this.ghost = ghost;
    this.view?.compare(ghost);
    this.draw();
  }

  toggleFollow() {
    this.following = !this.following;
    this.follow.setAttribute("aria-pressed", String(this.following));
    this.draw();
  }

  showAll() {
    if (this.following) this.toggleFollow();
    this.view?.home();
    this.draw();
  }

  resize() {
    this.view?.resize();
    this.draw();
  }

  /** Schedules a single redraw, however often it is called before. */
  draw() {
    this.pending ||= requestAnimationFrame(() => {
      this.pending = 0;
      this.drawNow();
    });
  }

  drawNow() {
    for (const scans of this.motion.scans) scans.seek(this.clock.time, this.motion);
    this.sayBelow();
    this.pictures.show(this.clock.time, this.layers.shown.has("pictures"));
    this.view?.draw(this.motion.at(this.clock.time), this.following);
    this.ruler.draw();
    const touching = this.motion.touching(this.clock.time).slice(0, 3);
    const { links, bodies } = this.motion.scene;
    const words = touching.map(({ time, until, link, body, force, impulse }) => {
      // A message about one physics step has the force of that step, and a mean would be another number.
      const mean = force !== undefined && until > time ? `up to ${told(force, "N")} over 50 ms, ` : "";
      const strength = force === undefined ? "neither gives way" : `${mean}${told(impulse, "N s")} in all`;
      return `${links[link].name} touches ${bodies[body].name}, ${strength}`;
    });
    write(this.happening, words.join("\n"));
  }

  /** The lines below the view: what sensors measure at the present moment, and what is drawn in which colour or scale. */
  linesBelow() {
    const { scans, pushes, replay } = this.motion;
    const line = (/** @type {string[]} */ layers, /** @type {number | null} */ colour, /** @type {() => string} */ words) => {
      const swatch = colour === null ? null : lineSwatch(colour);
      const text = make("span");
      return { layers, words, swatch, text, element: make("p", {}, ...(swatch ? [swatch] : []), text) };
    };
    return [
      ...scans.map((each) => line(["points", "rays"], each.line, () => each.words())),
      line(["command"], COMMAND_COLOUR, () => (replay.commanded_path?.length && this.layers.shown.has("command") ? "Commanded path" : "")),
      line([], null, () => (this.layers.shown.has("forces") ? pushes.words : "")),
    ];
  }

  sayBelow() {
    for (const { layers, words, swatch, text, element } of this.lines) {
      const said = words();
      write(text, said);
      element.hidden = !said;
      if (swatch) swatch.hidden = !layers.some((name) => this.layers.shown.has(name));
    }
  }

  dispose() {
    this.disposed = true;
    cancelAnimationFrame(this.pending);
    document.removeEventListener("click", this.tapped);
    this.view?.dispose();
    this.view = null;
  }
}
