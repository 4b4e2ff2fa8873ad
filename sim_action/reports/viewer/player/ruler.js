/** Over a view from above: a scale, the coordinates under the pointer, and the distance between two places. */

/** The largest way in px that the pointer moves in a click. */
const STILL = 4;

class Ruler {
  constructor() {
    this.bar = make("span", { class: "bar-of-scale" });
    this.words = make("span");
    this.place = make("span", { class: "place" });
    this.element = make("p", { class: "ruler", hidden: true, title: "Click two places to measure their distance" }, this.bar, this.words, this.place);
    /** @type {View | null} */
    this.view = null;
    /** @type {HTMLCanvasElement | null} */
    this.canvas = null;
    /** The places to measure between, at most two. @type {[number, number][]} */
    this.ends = [];
    /** Where the pointer is and went down, in px of the canvas. @type {[number, number]} */
    this.pointer = [NaN, NaN];
    this.down = this.pointer;
    this.line = drawn("path");
    this.drawing = drawn("svg");
    this.drawing.setAttribute("class", "measured");
    this.drawing.setAttribute("aria-hidden", "true");
    this.drawing.append(this.line);
  }

  /** Measures on a canvas. @param {HTMLCanvasElement} canvas @param {View} view */
  measure(canvas, view) {
    this.canvas = canvas;
    this.view = view;
    this.ends = [];
    const at = (/** @type {MouseEvent} */ event) => /** @type {[number, number]} */ ([event.offsetX, event.offsetY]);
    canvas.addEventListener("pointermove", (event) => {
      this.pointer = at(event);
      this.tell();
    });
    canvas.addEventListener("pointerleave", () => {
      this.pointer = [NaN, NaN];
      this.tell();
    });
    canvas.addEventListener("pointerdown", (event) => {
      this.down = at(event);
    });
    canvas.addEventListener("click", (event) => {
      const [x, y] = at(event);
      if (Math.hypot(x - this.down[0], y - this.down[1]) > STILL) return;
      const place = view.metresPerPixel() === null ? null : view.under(x, y);
      if (!place) return;
      this.ends = this.ends.length === 1 ? [...this.ends, place] : [place];
      this.draw();
    });
    canvas.after(this.drawing);
  }

  /** Draws scale and distance for the view as it is now. */
  draw() {
    const metres = this.view?.metresPerPixel() ?? null;
    this.element.hidden = metres === null;
    this.drawing.classList.toggle("shown", metres !== null && this.ends.length > 0);
    if (metres === null || !this.view) return;
    const length = niceStep(50 * metres);
    this.bar.style.width = `${length / metres}px`;
    this.words.textContent = `${shortNumber(length)} m`;
    const [left, top] = this.view.under(0, 0) ?? [0, 0];
    const pixels = this.ends.map(([x, y]) => [(x - left) / metres, (top - y) / metres]);
    const crosses = pixels.map(([x, y]) => `M${x - 5} ${y}h10M${x} ${y - 5}v10`).join("");
    const joined = pixels.length === 2 ? `M${pixels.map((place) => place.join(" ")).join("L")}` : "";
    this.line.setAttribute("d", `${crosses}${joined}`);
    this.tell();
  }

  /** Says what is under the pointer, and the distance. */
  tell() {
    const metres = this.view?.metresPerPixel() ?? null;
    if (metres === null || !this.view) return;
    const digits = Math.max(0, Math.min(4, Math.ceil(-Math.log10(metres))));
    const said = (/** @type {number} */ value) => value.toFixed(digits);
    const [x, y] = this.pointer;
    const here = Number.isNaN(x) ? null : this.view.under(x, y);
    const words = here ? [`x ${said(here[0])} m, y ${said(here[1])} m`] : [];
    if (this.ends.length === 2) {
      const [a, b] = this.ends;
      words.push(`distance ${said(Math.hypot(b[0] - a[0], b[1] - a[1]))} m`);
    }
    this.place.textContent = words.join(" · ");
  }
}

/** @param {string} name of an element of SVG */
function drawn(name) {
  return document.createElementNS("http://www.w3.org/2000/svg", name);
}
