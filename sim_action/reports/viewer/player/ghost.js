/** Another run beside the open one: its motion, the choice of it, and the moment at which the two part. */

/** A ghost that ends so many s before the run is said to. */
const LEAST_EARLIER = 0.1;

/** @implements {GhostRun} */
class GhostMotion extends Motion {
  /**
   * @param {Replay} replay
   * @param {Motion} open the motion of the open run
   */
  constructor(replay, open) {
    super(replay);
    const told = (/** @type {BodyData} */ body) => JSON.stringify({ ...body, track: undefined });
    const same = new Set(open.scene.bodies.filter(({ track }) => track === undefined).map(told));
    this.others = this.scene.bodies.flatMap((body, i) => (body.track === undefined && same.has(told(body)) ? [] : [i]));
  }
}

/** The choice of the ghost; it fires "chosen" when another one, or none, is to be drawn. */
class Ghosts extends EventTarget {
  /**
   * @param {GhostEntry[]} entries
   * @param {Motion} motion
   * @param {Clock} clock
   */
  constructor(entries, motion, clock) {
    super();
    this.entries = entries;
    this.motion = motion;
    this.clock = clock;
    /** The chosen one. @type {GhostEntry | null} */
    this.entry = null;
    /** @type {GhostMotion | null} */
    this.ghost = null;
    const options = entries.map(({ label, replay }) =>
      make("option", { value: label, disabled: replay === null }, replay === null ? `${label} (left out: the size of the page is limited)` : label));
    this.list = make("select", { title: "Draw another run as a ghost (g)" }, make("option", { value: "" }, "nothing"), ...options);
    this.part = make("button", { type: "button", title: "Show the moment at which the two part" });
    this.note = make("span", { role: "status" });
    this.swatch = make("span", { class: "swatch", hidden: true });
    const choice = make("label", {}, this.swatch, "Compare with ", this.list);
    this.element = make("div", { class: "against", hidden: entries.length === 0 }, choice, this.part, this.note);
    this.list.addEventListener("change", () => this.change(this.list.value));
    this.part.addEventListener("click", () => {
      clock.pause();
      clock.seek(this.entry?.parting?.time ?? clock.time);
    });
    this.tell();
  }

  /** The name of the chosen run. */
  get label() {
    return this.entry?.label ?? "";
  }

  /** Draws what the address says, or what is drawn from the start; then the address names it, too. */
  restore() {
    const first = this.entries.find(({ shown, replay }) => shown && replay)?.label ?? "";
    const label = addressed("against") ?? first;
    if (this.entries.length) remember({ against: label });
    return this.choose(label);
  }

  /** Draws the last ghost, or hides it. */
  toggle() {
    const usable = this.entries.filter(({ replay }) => replay);
    const next = usable.find(({ label }) => label === this.last) ?? usable[0];
    return next ? this.change(this.entry ? "" : next.label) : undefined;
  }

  /** Chooses as the user asks, and remembers it. @param {string} label */
  change(label) {
    remember({ against: label });
    return this.choose(label);
  }

  /** @param {string} label the name of a run; any other text: none */
  async choose(label) {
    const entry = this.entries.find((each) => each.label === label && each.replay) ?? null;
    if (entry === this.entry) return;
    this.entry = entry;
    this.last = entry?.label ?? this.last;
    const replay = entry?.replay ? await unpackedReplay(entry.replay) : null;
    // Another one may have been chosen meanwhile.
    if (this.entry !== entry) return;
    this.ghost = replay && new GhostMotion(replay, this.motion);
    this.tell();
    this.dispatchEvent(new Event("chosen"));
  }

  /** Returns the motions of the repetitions that show the confidence of the run, as far as the page has room for them. */
  async repetitions() {
    const packed = this.entries.flatMap(({ repetition, replay }) => (repetition && replay ? [replay] : []));
    return (await Promise.all(packed.map(unpackedReplay))).map((replay) => new Motion(replay));
  }

  tell() {
    const { entry } = this;
    this.list.value = this.label;
    this.swatch.hidden = entry === null;
    this.part.hidden = !entry?.parting;
    this.part.textContent = entry?.parting?.words ?? "";
    const early = this.ghost && this.ghost.end < this.motion.end - LEAST_EARLIER ? `It ended at ${clockTime(this.ghost.end)}` : "";
    this.note.textContent = [entry && !entry.parting ? entry.alike : "", early].filter(Boolean).join(". ");
  }
}
