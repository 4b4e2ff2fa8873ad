/** A plot of one curve over time with its limits; all plots have the same cursor. */
class Plot {
  /**
   * @param {Curve} curve
   * @param {Clock} clock
   */
  constructor(curve, clock) {
    this.curve = curve;
    this.clock = clock;
    this.canvas = make("canvas", { role: "img", "aria-label": plotWords(curve) });
    this.cursor = make("div", { class: "cursor" });
    this.value = make("output", { class: "value" });
    this.removal = make("button", { type: "button", class: "remove", title: "Remove this plot", "aria-label": `Remove the plot of ${curve.name}`, hidden: true }, "×");
    const unit = curve.unit ? ` (${curve.unit})` : "";
    const name = curve.title && !curve.title.startsWith(curve.name) ? `${curve.name}${unit}` : unit.trim();
    const title = make("span", { class: "title" }, make("b", {}, curve.title || `${curve.name}`), ` ${curve.title ? name : unit.trim()}`);
    const frame = make("div", { class: "frame" }, this.canvas, this.cursor);
    this.element = make("div", { class: `plot ${curve.status}` }, make("div", { class: "caption" }, title, this.value, this.removal), frame);
    this.frame = frame;
    this.grab();
  }

  /** The x range of the time axis on the canvas, in CSS pixels. */
  get span() {
    return { left: 44, right: this.frame.clientWidth - 8 };
  }

  /** @param {number} time */
  moveCursor(time) {
    const { left, right } = this.span;
    const x = left + ((time - this.clock.start) / this.clock.length) * (right - left);
    this.cursor.style.transform = `translateX(${x.toFixed(2)}px)`;
    const { commanded, unit } = this.curve;
    const aim = commanded ? ` · commanded ${told(valueAt(this.curve, time, commanded), unit)}` : "";
    this.value.textContent = `${told(valueAt(this.curve, time), unit)}${aim}`;
  }

  grab() {
    const seek = (/** @type {PointerEvent} */ event) => {
      const { left, right } = this.span;
      const x = event.clientX - this.frame.getBoundingClientRect().left;
      this.clock.pause();
      this.clock.seek(this.clock.start + ((x - left) / (right - left)) * this.clock.length);
    };
    this.frame.addEventListener("pointerdown", (event) => {
      this.frame.setPointerCapture(event.pointerId);
      seek(event);
    });
    this.frame.addEventListener("pointermove", (event) => {
      if (this.frame.hasPointerCapture(event.pointerId)) seek(event);
    });
  }

  /** Draws everything but the cursor. @param {Colours} colours */
  draw(colours) {
    const ratio = devicePixelRatio || 1;
    const width = this.frame.clientWidth, height = this.frame.clientHeight;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d");
    if (!context || width < 60) return;
    context.scale(ratio, ratio);
    const { left, right } = this.span;
    const [low, high] = rangeOf(this.curve);
    const area = { left, right, top: 6, bottom: height - 18 };
    /** @type {Chart} */
    const chart = {
      context, area, colours,
      x: (time) => left + ((time - this.clock.start) / this.clock.length) * (right - left),
      y: (value) => area.bottom - ((value - low) / (high - low)) * (area.bottom - area.top),
    };
    drawAxes(chart, this.clock, low, high);
    drawLimits(chart, this.curve);
    drawCommanded(chart, this.curve);
    drawCurve(chart, this.curve);
    drawDecision(chart, this.curve);
  }
}

/** @param {Curve} curve */
function plotWords(curve) {
  const limits = [["at least", curve.lower], ["at most", curve.upper]].filter(([, limit]) => limit !== null);
  const asked = limits.map(([words, limit]) => `, ${words} ${told(Number(limit), curve.unit)}`).join("");
  const aim = curve.commanded ? ", dashed: commanded" : "";
  return `${curve.title} ${curve.name} over time${asked}${aim}`.trim();
}

/**
 * @param {Curve} curve
 * @returns {[number, number]} the range of the y axis: all values and limits, with padding
 */
function rangeOf(curve) {
  const aims = curve.commanded ? extent(curve.commanded) : [];
  const all = [...extent(curve.values), ...aims, ...[curve.lower, curve.upper].filter((limit) => limit !== null)].map(Number);
  let bottom = Math.min(...all), top = Math.max(...all);
  // Extend the axis to zero if zero is near.
  if (bottom > 0 && bottom < 0.5 * top) bottom = 0;
  // Do not magnify noise.
  const least = Math.max(curve.least, 1e-6 * Math.abs(top));
  if (top - bottom < least) {
    bottom = Math.min(bottom, Math.max(0, bottom - 1));
    top += least;
  }
  const room = 0.08 * (top - bottom);
  return [bottom === 0 ? 0 : bottom - room, top + room];
}

/** @param {Chart} chart @param {Clock} clock @param {number} low @param {number} high */
function drawAxes(chart, clock, low, high) {
  const { context, area, colours, x, y } = chart;
  context.font = "10.5px system-ui, sans-serif";
  context.fillStyle = colours.faint;
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  context.textBaseline = "middle";
  context.textAlign = "right";
  const step = niceStep((high - low) / 3);
  for (let value = Math.ceil(low / step) * step; value <= high; value += step) {
    const at = Math.round(y(value)) + 0.5;
    context.beginPath();
    context.moveTo(area.left, at);
    context.lineTo(area.right, at);
    context.stroke();
    context.fillText(shortNumber(Math.abs(value) < step / 1e6 ? 0 : value), area.left - 6, at);
  }
  context.textBaseline = "top";
  context.textAlign = "center";
  const pace = niceStep(clock.length / Math.max(2, (area.right - area.left) / 90));
  for (let time = Math.ceil(clock.start / pace) * pace; time <= clock.end + 1e-9; time += pace) {
    const at = Math.min(x(time), area.right - 8);
    context.fillText(shortNumber(Math.abs(time) < 1e-9 ? 0 : Number(time.toFixed(6))), at, area.bottom + 5);
  }
}

/** @param {Chart} chart @param {Curve} curve */
function drawLimits(chart, curve) {
  const { context, area, colours, x, y } = chart;
  context.setLineDash([5, 4]);
  context.lineWidth = 1.25;
  context.strokeStyle = curve.status === "failed" && !curve.cutOff ? colours.bad : colours.faint;
  context.fillStyle = context.strokeStyle;
  context.font = "10.5px system-ui, sans-serif";
  context.textAlign = "left";
  for (const limit of [curve.lower, curve.upper]) {
    if (limit === null) continue;
    const at = y(limit);
    context.beginPath();
    context.moveTo(Math.max(area.left, x(curve.from)), at);
    context.lineTo(Math.min(area.right, x(curve.to)), at);
    context.stroke();
    const below = at < area.top + 14;
    context.textBaseline = below ? "top" : "bottom";
    context.fillText(`${limit === curve.lower ? "at least" : "at most"} ${told(limit, curve.unit)}`, area.left + 4, at + (below ? 3 : -2));
  }
  context.setLineDash([]);
}

/** @param {Chart} chart @param {Curve} curve */
function drawCurve(chart, curve) {
  const { context, colours } = chart;
  trace(chart, curve.times, curve.values);
  context.strokeStyle = curve.status === "free" ? colours.faint : colours.accent;
  context.lineWidth = 1.75;
  context.lineJoin = "round";
  context.stroke();
}

/** The commanded values, dashed. @param {Chart} chart @param {Curve} curve */
function drawCommanded(chart, curve) {
  if (!curve.commanded) return;
  const { context, colours } = chart;
  trace(chart, curve.times, curve.commanded);
  context.setLineDash([3, 3]);
  context.strokeStyle = colours.accent;
  context.lineWidth = 1.25;
  context.stroke();
  context.setLineDash([]);
}

/** Makes the path of values over time, with gaps. @param {Chart} chart @param {Float64Array} times @param {Float64Array} values */
function trace({ context, x, y }, times, values) {
  context.beginPath();
  let drawing = false;
  for (let i = 0; i < values.length; i++) {
    if (Number.isNaN(values[i])) drawing = false;
    else if (drawing) context.lineTo(x(times[i]), y(values[i]));
    else {
      context.moveTo(x(times[i]), y(values[i]));
      drawing = true;
    }
  }
}

/** A dot where the expectation was decided. @param {Chart} chart @param {Curve} curve */
function drawDecision(chart, curve) {
  if (curve.decided === null) return;
  const value = valueAt(curve, curve.decided);
  if (Number.isNaN(value)) return;
  const { context, colours, x, y } = chart;
  context.beginPath();
  context.arc(x(curve.decided), y(value), 4, 0, 2 * Math.PI);
  context.fillStyle = curve.status === "failed" && !curve.cutOff ? colours.bad : colours.accent;
  context.fill();
  context.strokeStyle = colours.ground;
  context.lineWidth = 1.5;
  context.stroke();
}
