/** The top view of a run on a 2D canvas, used without 3D or by choice. */
/** @implements {View} */
class TopView {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Motion} motion
   * @param {ReadonlySet<number>} failed numbers of expectations
   */
  constructor(canvas, motion, failed) {
    const context = canvas.getContext("2d");
    if (!context) throw new Error("no 2D canvas available");
    this.canvas = canvas;
    this.context = context;
    this.motion = motion;
    this.failed = failed;
    this.colours = coloursOfPage();
    const points = (/** @type {{shapes: Shape[]}} */ owner) =>
      owner.shapes.map((shape) => hullPoints(shape, motion.scene.meshes));
    this.links = motion.scene.links.map(points);
    this.bodies = motion.scene.bodies.map(points);
    const still = motion.at(motion.start);
    /** The outlines of fixed bodies, computed once. */
    this.still = motion.scene.bodies.map((body, i) =>
      body.track === undefined ? this.bodies[i].map((several) => outline(several, still.bodies, 7 * i)) : null);
    /** @type {ReadonlySet<string>} */
    this.shown = new Set();
    this.link = 0;
    /** The path of the chosen link. */
    this.trail = motion.base;
    /** The same path in repetitions. @type {Float64Array[][]} */
    this.repeated = [];
    /** @type {GhostRun | null} */
    this.ghost = null;
    /** The points of the links and bodies of the ghost. @type {{links: Float64Array[][], bodies: Float64Array[][]}} */
    this.ghostPoints = { links: [], bodies: [] };
    /** @type {[number, number]} */
    this.centre = [0, 0];
    this.span = 1;
    this.scale = 1;
    this.home();
    this.grab();
  }

  /** Shows the whole path of the robot, of the ghost, and of bodies that pass. */
  home() {
    const paths = [this.motion.base, ...(this.ghost ? [this.ghost.base] : [])];
    const others = this.motion.passages().map(({ place }) => place);
    const [[x0, x1], [y0, y1]] = [0, 1].map((axis) =>
      extent([...paths.flatMap((path) => extent(path[axis])), ...others.map((place) => place[axis])]));
    this.centre = [(x0 + x1) / 2, (y0 + y1) / 2];
    this.span = Math.max(1.2, 1.25 * (x1 - x0) + 0.8, 1.8 * (y1 - y0) + 0.8);
  }

  /** Draws the path of a link, and its paths in repetitions as thin lines. @param {number} link @param {Run[]} repetitions */
  choose(link, repetitions) {
    this.link = link;
    [this.trail, ...this.repeated] = [this.motion, ...repetitions].map((run) => (link ? run.trail(link) : run.base));
  }

  /** @param {ReadonlySet<string>} shown */
  showLayers(shown) {
    this.shown = shown;
  }

  /** @param {GhostRun | null} ghost */
  compare(ghost) {
    this.ghost = ghost;
    const points = (/** @type {{shapes: Shape[]}} */ owner) =>
      owner.shapes.map((shape) => hullPoints(shape, ghost?.scene.meshes ?? {}));
    this.ghostPoints = { links: ghost?.scene.links.map(points) ?? [], bodies: ghost?.scene.bodies.map(points) ?? [] };
    if (ghost) this.home();
  }

  /** All sides are that from above. */
  from() {
    this.home();
  }

  metresPerPixel() {
    return this.span / (this.canvas.clientWidth || 1);
  }

  /**
   * @param {number} x
   * @param {number} y
   * @returns {[number, number]} the place in m under a pixel
   */
  under(x, y) {
    const metres = this.metresPerPixel();
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [this.centre[0] + (x - width / 2) * metres, this.centre[1] + (height / 2 - y) * metres];
  }

  resize() {
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    this.colours = coloursOfPage();
  }

  dispose() {}

  /**
   * @param {Moment} moment
   * @param {boolean} follow
   */
  draw(moment, follow) {
    if (follow) this.centre = [moment.links[0], moment.links[1]];
    const { context, colours } = this;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = colours.floor;
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    this.scale = this.canvas.width / this.span;
    this.tintGround();
    this.drawGrid();
    this.drawPatches();
    this.drawBodies(moment);
    const isShown = (/** @type {MarkData} */ { expectation }) => expectation === undefined || this.shown.has("expectations");
    for (const mark of this.motion.replay.marks.filter(isShown)) this.drawMark(mark);
    const { commanded_path } = this.motion.replay;
    if (commanded_path && this.shown.has("command")) this.line(commanded_path, colours.lines[COMMAND_COLOUR], 1.5, [2, 4]);
    if (this.ghost) this.drawGhost(this.ghost, moment.time);
    for (const path of this.repeated) this.path(path, colours.accent, 0.8);
    this.drawWay(moment.time);
    this.drawRobot(moment);
    if (this.shown.has("forces")) drawPushes(this, this.motion.pushes, moment.time);
    drawScans(this, this.motion.scans, this.shown);
    if (this.shown.has("contacts")) this.drawContacts(moment.time);
  }

  /** @param {number[]} point @returns {[number, number]} */
  pixel(point) {
    return [
      this.canvas.width / 2 + (point[0] - this.centre[0]) * this.scale,
      this.canvas.height / 2 - (point[1] - this.centre[1]) * this.scale,
    ];
  }

  /** Mixes the colour of the ground into that of the page, as the 3D view does; squares would look like the grid. */
  tintGround() {
    const { ground } = this.motion.scene;
    if (!ground) return;
    const { color, checker = color } = ground;
    this.context.globalAlpha = 0.25;
    this.context.fillStyle = `rgb(${color.map((part, i) => Math.round(127.5 * (part + checker[i]))).join(" ")})`;
    this.context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    this.context.globalAlpha = 1;
  }

  drawGrid() {
    const { context, canvas } = this;
    const rough = this.span / 8;
    context.strokeStyle = this.colours.line;
    context.lineWidth = 1;
    context.beginPath();
    const left = this.centre[0] - this.span / 2, high = (this.span * canvas.height) / canvas.width;
    for (const x of roundNumbers(left, left + this.span, rough)) {
      const [px] = this.pixel([x, 0]);
      context.moveTo(px, 0);
      context.lineTo(px, canvas.height);
    }
    const low = this.centre[1] - high / 2;
    for (const y of roundNumbers(low, low + high, rough)) {
      const [, py] = this.pixel([0, y]);
      context.moveTo(0, py);
      context.lineTo(canvas.width, py);
    }
    context.stroke();
  }

  /** Draws areas of the ground with their own friction and says it in those that are large enough. */
  drawPatches() {
    const { context, colours } = this;
    const size = 11 * (devicePixelRatio || 1);
    context.font = `${size}px system-ui, sans-serif`;
    context.textAlign = "left";
    context.textBaseline = "top";
    for (const { x, y, size: [width, depth], friction } of this.motion.scene.patches ?? []) {
      const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => [x + (a * width) / 2, y + (b * depth) / 2]);
      this.area(corners, `${colours.text}12`, colours.line);
      const words = `friction ${friction}`;
      if (context.measureText(words).width + size > width * this.scale || 2 * size > depth * this.scale) continue;
      const [left, top] = this.pixel([x - width / 2, y + depth / 2]);
      context.fillStyle = colours.faint;
      context.fillText(words, left + size / 2, top + size / 2);
    }
  }

  /** @param {Moment} moment */
  drawBodies(moment) {
    this.bodies.forEach((shapes, i) => {
      if (!moment.here[i]) return;
      const outlines = this.still[i] ?? shapes.map((points) => outline(points, moment.bodies, 7 * i));
      for (const corners of outlines) this.area(corners, this.colours.body, this.colours.faint);
    });
  }

  /** @param {Moment} moment */
  drawRobot(moment) {
    this.links.forEach((shapes, i) => {
      for (const points of shapes) this.area(outline(points, moment.links, 7 * i), `${this.colours.robot}b0`, this.colours.text);
    });
    const at = 7 * this.link;
    turn(moment.links, at, 0.12, 0, 0, turned);
    const { context } = this;
    context.strokeStyle = this.colours.accent;
    context.lineWidth = 2 * (devicePixelRatio || 1);
    context.beginPath();
    context.moveTo(...this.pixel([moment.links[at], moment.links[at + 1]]));
    context.lineTo(...this.pixel([moment.links[at] + turned[0], moment.links[at + 1] + turned[1]]));
    context.stroke();
  }

  /** Draws the other run in one colour, dimmer after its end. @param {GhostRun} ghost @param {number} time */
  drawGhost(ghost, time) {
    const { colours, ghostPoints } = this;
    const moment = ghost.at(time);
    this.path(ghost.base, `${colours.ghost}80`, 1.5);
    this.context.globalAlpha = time > ghost.end + 1e-6 ? 0.4 : 1;
    for (const i of ghost.others) {
      if (!moment.here[i]) continue;
      for (const points of ghostPoints.bodies[i]) this.area(outline(points, moment.bodies, 7 * i), `${colours.ghost}30`, colours.ghost);
    }
    ghostPoints.links.forEach((shapes, i) => {
      for (const points of shapes) this.area(outline(points, moment.links, 7 * i), `${colours.ghost}48`, colours.ghost);
    });
    this.context.globalAlpha = 1;
  }

  /** @param {number} time */
  drawWay(time) {
    const { trail, motion: { count } } = this;
    const now = this.motion.row(time);
    for (const [from, to, alpha] of [[now, count - 1, 0.3], [0, now, 1]]) {
      const points = [];
      for (let i = from; i <= to; i++) points.push([trail[0][i], trail[1][i]]);
      this.context.globalAlpha = alpha;
      this.line(points, this.colours.accent, 2);
    }
    this.context.globalAlpha = 1;
  }

  /** @param {number} time */
  drawContacts(time) {
    const ratio = devicePixelRatio || 1;
    for (const [i, contact] of this.motion.replay.contacts.entries()) {
      if (contact.time > time + 0.02) continue;
      const [x, y] = this.pixel(this.motion.pushes.place(i, time));
      this.context.fillStyle = this.failed.size ? this.colours.bad : this.colours.text;
      this.context.beginPath();
      this.context.arc(x, y, (time <= contact.until + 0.02 ? 5 : 2.5) * ratio, 0, 2 * Math.PI);
      this.context.fill();
    }
  }

  /** @param {MarkData} mark */
  drawMark(mark) {
    const failed = mark.expectation !== undefined && this.failed.has(mark.expectation);
    const colour = failed ? this.colours.bad : this.colours.accent;
    if (mark.kind === "polyline") {
      const width = (2 * (mark.tolerance ?? 0) * this.scale) / (devicePixelRatio || 1);
      if (width) this.line(mark.points, `${colour}24`, width);
      this.line(mark.points, colour, 1.5, [6, 5]);
    } else if (mark.kind === "arrow") {
      if (mark.tolerance) this.area(sectorPoints(mark, mark.tolerance), `${colour}24`, colour);
      this.line(arrowPoints(mark), colour, 2);
    } else this.area(mark.kind === "polygon" ? mark.points : circlePoints(mark), `${colour}14`, colour);
  }

  /** @param {number[][]} corners @param {string} fill @param {string} edge */
  area(corners, fill, edge) {
    const { context } = this;
    context.beginPath();
    for (const corner of corners) context.lineTo(...this.pixel(corner));
    context.closePath();
    context.fillStyle = fill;
    context.fill();
    context.strokeStyle = edge;
    context.lineWidth = devicePixelRatio || 1;
    context.stroke();
  }

  /** @param {number[][]} points @param {string} colour @param {number} width @param {number[]} [dashes] */
  line(points, colour, width, dashes = []) {
    const { context } = this;
    context.setLineDash(dashes.map((dash) => dash * (devicePixelRatio || 1)));
    context.beginPath();
    for (const point of points) context.lineTo(...this.pixel(point));
    context.strokeStyle = colour;
    context.lineWidth = width * (devicePixelRatio || 1);
    context.lineJoin = "round";
    context.lineCap = dashes.length ? "butt" : "round";
    context.stroke();
    context.setLineDash([]);
  }

  /** @param {Float64Array[]} places columns @param {string} colour @param {number} width */
  path([x, y], colour, width) {
    this.line(Array.from(x, (_, i) => [x[i], y[i]]), colour, width);
  }

  /** Dragging moves the view, the wheel zooms, a double click shows everything. */
  grab() {
    const { canvas } = this;
    const redraw = () => canvas.dispatchEvent(new CustomEvent("viewmoved"));
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) return;
      const metres = this.span / canvas.clientWidth;
      this.centre = [this.centre[0] - event.movementX * metres, this.centre[1] + event.movementY * metres];
      redraw();
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.span = Math.min(1e4, Math.max(0.05, this.span * Math.exp(event.deltaY * 0.001)));
      redraw();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => {
      this.home();
      redraw();
    });
  }
}

/** @param {CircleMark} mark */
function circlePoints(mark) {
  return Array.from({ length: 48 }, (_, i) => {
    const angle = (i * Math.PI) / 24;
    return [mark.x + mark.radius * Math.cos(angle), mark.y + mark.radius * Math.sin(angle)];
  });
}

/** The headings that are allowed. @param {ArrowMark} mark @param {number} tolerance rad */
function sectorPoints({ x, y, yaw }, tolerance) {
  const rim = Array.from({ length: 17 }, (_, i) => yaw + (tolerance * (i - 8)) / 8);
  return [[x, y], ...rim.map((angle) => [x + 0.3 * Math.cos(angle), y + 0.3 * Math.sin(angle)])];
}

/** @param {ArrowMark} mark */
function arrowPoints(mark) {
  const at = (/** @type {number} */ length, /** @type {number} */ angle) =>
    [mark.x + length * Math.cos(mark.yaw + angle), mark.y + length * Math.sin(mark.yaw + angle)];
  return [at(0, 0), at(0.3, 0), at(0.23, 0.2), at(0.3, 0), at(0.23, -0.2)];
}

/**
 * @param {ArrayLike<number>} values
 * @returns {[number, number]} minimum and maximum without NaN
 */
function extent(values) {
  let low = Infinity, high = -Infinity;
  for (let i = 0; i < values.length; i++) {
    if (values[i] < low) low = values[i];
    if (values[i] > high) high = values[i];
  }
  return low <= high ? [low, high] : [0, 0];
}

/**
 * @param {number} rough
 * @returns {number} the next value at or above of the form 1, 2 or 5 times a power of ten
 */
function niceStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].map((digit) => digit * power).find((step) => step >= rough * 0.999) ?? 10 * power;
}

/**
 * @param {number} low
 * @param {number} high
 * @param {number} rough about how far apart they are
 * @returns {number[]} the round numbers in a range; none if the range is so far from zero that it has no such numbers
 */
function roundNumbers(low, high, rough) {
  const step = niceStep(rough), first = Math.ceil(low / step), count = Math.floor(high / step) - first + 1;
  return count > 0 && count < 1000 ? Array.from({ length: count }, (_, i) => (first + i) * step) : [];
}
