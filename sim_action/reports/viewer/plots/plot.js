/** A plot of curves over time with their limits; all plots have the same cursor and show the same time. */

/** The height of the time axis below the plot, in CSS pixels. */
const TIME_AXIS = 18;
/** A shorter drag is a click. */
const LEAST_DRAG = 5;

class Plot extends EventTarget {
  /**
   * @param {Curve[]} curves at least one, of at most two units
   * @param {Clock} clock
   * @param {{from: number, to: number}} range the shown time, shared by all plots; a drag dispatches `zoomed`
   */
  constructor(curves, clock, range) {
    super();
    this.curves = curves;
    this.clock = clock;
    this.range = range;
    /** The same curves of another run. @type {Map<string, Curve>} */
    this.ghosts = new Map();
    this.ghostName = "";
    /** The sim time at which the other run ended. */
    this.ghostEnd = Infinity;
    this.canvas = make("canvas", { role: "img" });
    this.cursor = make("div", { class: "cursor" });
    this.hover = make("div", { class: "cursor hover", hidden: true }, make("span"));
    this.picked = make("div", { class: "picked", hidden: true });
    this.menu = new PlotMenu(this);
    this.legend = make("div", { class: "lines" });
    const help = "Click: go to this time. Drag: zoom. Drag on the time axis: scrub. Double click: whole run.";
    this.frame = make("div", { class: "frame", title: help }, this.canvas, this.picked, this.cursor, this.hover);
    this.element = make("div", { class: "plot" }, make("div", { class: "caption" }, this.legend, this.menu.element), this.frame);
    /** @type {HTMLOutputElement[]} */
    this.values = [];
    /** The time under the pointer. @type {number | null} */
    this.pointed = null;
    /** As it was drawn last, in CSS pixels: to ask for it has the page lay itself out. */
    this.width = 0;
    /** True if there is room for an axis on the right: in all plots of a run, or in none. */
    this.hasRightAxis = false;
    this.show(curves);
    this.grab();
  }

  get units() {
    return [...new Set(this.curves.map((curve) => curve.unit))];
  }

  get keys() {
    return this.curves.map((curve) => curve.key);
  }

  /** Returns true if a curve has an axis here: there are at most two. @param {Curve} curve */
  takes(curve) {
    return this.units.length < 2 || this.units.includes(curve.unit);
  }

  /** Shows other curves. @param {Curve[]} curves at least one */
  show(curves) {
    this.curves = curves;
    this.values = curves.map(() => make("output", { class: "value" }));
    const several = curves.length > 1;
    this.legend.replaceChildren(...curves.map((curve, i) => {
      const sample = several ? [lineSample(i, curve.aimed)] : [];
      return make("div", { class: "line" }, ...sample, curveTitle(curve), this.values[i]);
    }));
    this.canvas.setAttribute("aria-label", curves.map(plotWords).join("; "));
    this.menu.describe();
  }

  /**
   * Draws the same curves of another run as thin lines; those that it does not have are left out.
   * @param {Catalogue | null} other
   * @param {string} [name] of the other run
   */
  setGhost(other, name = "other run") {
    const found = other ? this.keys.map((key) => other.curve(key)) : [];
    this.ghosts = new Map(found.flatMap((curve) => (curve ? [[curve.key, curve]] : [])));
    this.ghostName = name;
    this.ghostEnd = other?.motion.end ?? Infinity;
  }

  /** The x range of the time axis on the canvas, in CSS pixels. */
  get span() {
    return { left: 44, right: this.width - (this.hasRightAxis ? 46 : 8) };
  }

  /** @param {number} time */
  placeOf(time) {
    const { left, right } = this.span, { from, to } = this.range;
    return left + ((time - from) / (to - from)) * (right - left);
  }

  /** @param {PointerEvent | MouseEvent} event @returns {number} the time below the pointer, within the shown range */
  timeOf(event) {
    const { left, right } = this.span, { from, to } = this.range;
    const x = event.clientX - this.frame.getBoundingClientRect().left;
    return from + Math.min(1, Math.max(0, (x - left) / (right - left))) * (to - from);
  }

  /** @param {number} time */
  moveCursor(time) {
    const { from, to } = this.range;
    this.cursor.hidden = time < from - 1e-6 || time > to + 1e-6;
    this.cursor.style.transform = `translateX(${this.placeOf(time).toFixed(2)}px)`;
    if (this.pointed === null) this.tell(time);
  }

  /** Shows values at the pointer, or at the time of the clock. @param {number | null} time */
  point(time) {
    this.pointed = time;
    this.hover.hidden = time === null;
    if (time !== null) {
      this.hover.style.transform = `translateX(${this.placeOf(time).toFixed(2)}px)`;
      find(this.hover, "span").textContent = clockTime(time);
    }
    this.tell(time ?? this.clock.time);
  }

  /** @param {number} time */
  tell(time) {
    this.curves.forEach((curve, i) => {
      const { commanded, unit } = curve;
      const aim = commanded ? ` · commanded ${told(valueAt(curve, time, commanded), unit)}` : "";
      const ghost = this.ghosts.get(curve.key);
      const known = ghost?.values.some((value) => !Number.isNaN(value));
      const value = ghost && known ? valueAt(ghost, time) : NaN;
      const has_ended = Number.isNaN(value) && time > this.ghostEnd;
      const other = ghost && known ? ` · ${this.ghostName} ${has_ended ? "ended" : told(value, unit)}` : "";
      const ends = curve.band && [curve.band.low, curve.band.high].map((values) => told(valueAt(curve, time, values), unit));
      const range = ends ? ` · in ${curve.band?.runs} runs ${[...new Set(ends)].join(" to ")}` : "";
      write(this.values[i], `${told(valueAt(curve, time), unit)}${aim}${range}${other}`);
    });
  }

  grab() {
    const { frame, clock } = this;
    let start = 0, from = 0, does = "";
    const seek = (/** @type {PointerEvent} */ event) => {
      clock.pause();
      clock.seek(this.timeOf(event));
    };
    frame.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      frame.setPointerCapture(event.pointerId);
      const box = frame.getBoundingClientRect();
      [start, from, does] = [event.clientX, this.timeOf(event), event.clientY > box.bottom - TIME_AXIS ? "scrub" : "click"];
      if (does === "scrub") seek(event);
    });
    frame.addEventListener("pointermove", (event) => {
      if (!does) {
        if (event.pointerType !== "touch") this.dispatchEvent(new CustomEvent("pointed", { detail: this.timeOf(event) }));
        return;
      }
      if (does === "scrub") seek(event);
      else if (does === "zoom" || Math.abs(event.clientX - start) > LEAST_DRAG) {
        does = "zoom";
        this.pick(from, this.timeOf(event));
      }
    });
    const end = (/** @type {PointerEvent} */ event) => {
      if (does === "click" && event.type === "pointerup") seek(event);
      if (does === "zoom" && event.type === "pointerup") {
        this.zoom(from, this.timeOf(event));
        // Another time is under the pointer now.
        this.dispatchEvent(new CustomEvent("pointed", { detail: event.pointerType === "touch" ? null : this.timeOf(event) }));
      }
      does = "";
      this.picked.hidden = true;
    };
    frame.addEventListener("pointerup", end);
    frame.addEventListener("pointercancel", end);
    frame.addEventListener("pointerleave", () => this.dispatchEvent(new CustomEvent("pointed", { detail: null })));
    frame.addEventListener("dblclick", () => this.zoom(clock.start, clock.end));
  }

  /** Marks the time that a drag has picked. @param {number} from @param {number} to */
  pick(from, to) {
    const [left, right] = [from, to].map((time) => this.placeOf(time)).sort((a, b) => a - b);
    this.picked.hidden = false;
    this.picked.style.transform = `translateX(${left.toFixed(1)}px)`;
    this.picked.style.width = `${(right - left).toFixed(1)}px`;
  }

  /** @param {number} one @param {number} other */
  zoom(one, other) {
    this.dispatchEvent(new CustomEvent("zoomed", { detail: { from: Math.min(one, other), to: Math.max(one, other) } }));
  }

  /** Draws everything but the cursor. @param {Colours} colours */
  draw(colours) {
    const ratio = devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = this.frame;
    this.width = width;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d");
    if (!context || width < 60) return;
    context.scale(ratio, ratio);
    this.paint(context, { ...this.span, top: 6, bottom: height - TIME_AXIS }, colours);
    this.legend.querySelectorAll("canvas").forEach((sample, i) => drawSample(sample, i, this.curves[i].aimed, colours));
  }

  /** @param {CanvasRenderingContext2D} context @param {Chart["area"]} area @param {Colours} colours */
  paint(context, area, colours) {
    const { range } = this;
    const x = (/** @type {number} */ time) => area.left + ((time - range.from) / (range.to - range.from)) * (area.right - area.left);
    /** @type {Chart} */
    const chart = { context, area, colours, range, x };
    const ghosts = [...this.ghosts.values()];
    const axes = this.units.map((unit) => axisOf([...this.curves, ...ghosts].filter((curve) => curve.unit === unit), range, this.clock));
    const axis = (/** @type {Curve} */ curve) => axes[this.units.indexOf(curve.unit)];
    for (const curve of this.curves) drawWindow(chart, curve, this.clock);
    drawAxes(chart, axes);
    /** @type {Box[]} */
    const taken = [];
    for (const curve of this.curves) drawLimits(chart, curve, axis(curve), taken);
    context.save();
    context.beginPath();
    context.rect(area.left, 0, area.right - area.left, area.bottom + 2);
    context.clip();
    this.curves.forEach((curve, i) => drawBand(chart, axis(curve), curve, lineColour(colours, i)));
    this.curves.forEach((curve, i) => {
      const colour = lineColour(colours, i), dash = DASHES[i % DASHES.length];
      const ghost = this.ghosts.get(curve.key);
      if (ghost) drawLine(chart, axis(curve), { ...ghost, colour: colours.ghost, width: 1.1, dash });
      if (curve.commanded) drawLine(chart, axis(curve), { ...curve, values: curve.commanded, colour, width: 1.25, dash: COMMANDED_DASH });
      drawLine(chart, axis(curve), { ...curve, colour, width: 1.75, dash: curve.aimed ? COMMANDED_DASH : dash });
    });
    context.restore();
    this.curves.forEach((curve, i) => drawDecision(chart, curve, axis(curve), lineColour(colours, i)));
  }
}

/** @param {Curve} curve */
function curveTitle(curve) {
  const unit = curve.unit ? ` (${curve.unit})` : "";
  const name = curve.title && !curve.title.startsWith(curve.name) ? `${curve.name}${unit}` : unit.trim();
  return make("span", { class: "title" }, make("b", {}, curve.title || curve.name), ` ${curve.title ? name : unit.trim()}`);
}

/** @param {Curve} curve */
function plotWords(curve) {
  const limits = [["at least", curve.lower], ["at most", curve.upper]].filter(([, limit]) => limit !== null);
  const asked = limits.map(([words, limit]) => `, ${words} ${told(Number(limit), curve.unit)}`).join("");
  return `${curve.title} ${curve.name} over time${asked}${curveMarks(curve)}`.trim();
}

/** Says what is drawn with a curve. @param {Curve} curve */
function curveMarks({ commanded, band }) {
  return `${commanded ? ", fine dashes: commanded" : ""}${band ? `, band: lowest and highest of ${band.runs} runs` : ""}`;
}

/** @param {Colours} colours @param {number} number */
function lineColour(colours, number) {
  return colours.lines[number % colours.lines.length];
}

/** Returns the sample of a line in a legend. @param {number} number @param {boolean} aimed */
function lineSample(number, aimed) {
  return make("canvas", { class: "sample", "aria-hidden": "true", "data-line": aimed ? "commanded" : number });
}

/** @param {HTMLCanvasElement} sample @param {number} number @param {boolean} aimed @param {Colours} colours */
function drawSample(sample, number, aimed, colours) {
  const ratio = devicePixelRatio || 1;
  [sample.width, sample.height] = [Math.round(28 * ratio), Math.round(8 * ratio)];
  const context = sample.getContext("2d");
  if (!context) return;
  context.scale(ratio, ratio);
  context.strokeStyle = lineColour(colours, number);
  context.lineWidth = 2;
  context.setLineDash(aimed ? COMMANDED_DASH : DASHES[number % DASHES.length]);
  strokeLine(context, 0, 4, 28, 4);
}
