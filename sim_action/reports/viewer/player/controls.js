/** The controls of the clock: play, pause, slider, speed, and buttons for decisive moments. */

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 10];
const MOST_TOUCHES = 60;

class Controls {
  /**
   * @param {Clock} clock
   * @param {Motion} motion
   * @param {ExpectationEntry[]} expectations
   */
  constructor(clock, motion, expectations) {
    this.clock = clock;
    this.play = make("button", { type: "button", class: "play", "aria-label": "Play", title: "Play or pause (space)" });
    this.play.append(symbol("M4 2.5v11l9-5.5z"));
    this.slider = make("input", { type: "range", min: clock.start, max: clock.end, step: "any", "aria-label": "Time" });
    this.readout = make("output", { class: "readout" });
    this.pace = make("select", { "aria-label": "Speed", title: "Speed" });
    for (const speed of SPEEDS) this.pace.append(make("option", { value: speed, selected: speed === 1 }, `${speed}×`));
    const track = make("div", { class: "track" }, ...touchMarks(clock, motion), this.slider, ...eventMarks(clock, motion), ...decisionMarks(clock, expectations));
    /** Where the ghost and the run part. */
    this.parted = make("span", { class: "parted", hidden: true });
    track.prepend(this.parted);
    this.element = make("div", { class: "controls" }, this.play, this.readout, track, this.pace);
    this.listen();
  }

  listen() {
    const { clock } = this;
    this.play.addEventListener("click", () => clock.toggle());
    this.slider.addEventListener("input", () => {
      clock.pause();
      clock.seek(Number(this.slider.value));
    });
    this.pace.addEventListener("change", () => {
      clock.speed = Number(this.pace.value);
    });
    clock.addEventListener("tick", () => this.show());
    clock.addEventListener("state", () => {
      this.play.setAttribute("aria-label", clock.playing ? "Pause" : "Play");
      this.play.replaceChildren(symbol(clock.playing ? "M4 2.5h3v11H4zM9 2.5h3v11H9z" : "M4 2.5v11l9-5.5z"));
    });
  }

  /** Marks the time at which the ghost and the run part. @param {number | null} time */
  markParting(time) {
    this.parted.hidden = time === null;
    if (time !== null) this.parted.style.left = share(this.clock, time);
  }

  show() {
    this.slider.value = String(this.clock.time);
    this.slider.setAttribute("aria-valuetext", clockTime(this.clock.time));
    write(this.readout, clockTime(this.clock.time));
  }
}

/** @param {string} path of 16 units */
function symbol(path) {
  const name = "http://www.w3.org/2000/svg";
  const drawing = document.createElementNS(name, "svg");
  drawing.setAttribute("viewBox", "0 0 16 16");
  drawing.setAttribute("aria-hidden", "true");
  const line = document.createElementNS(name, "path");
  line.setAttribute("d", path);
  drawing.append(line);
  return drawing;
}

/**
 * Creates a button above the slider for each moment at which an expectation was decided.
 * @param {Clock} clock
 * @param {ExpectationEntry[]} expectations
 */
function decisionMarks(clock, expectations) {
  return moments(expectations).map(({ time, status, name }, i) => {
    const words = `${name}: ${clockTime(time)}${i < 9 ? ` (key ${i + 1})` : ""}`;
    const mark = make("button", { type: "button", class: `decision ${status}`, title: words, "aria-label": words });
    mark.style.left = share(clock, time);
    mark.addEventListener("click", () => {
      clock.pause();
      clock.seek(time);
    });
    return mark;
  });
}

/**
 * @param {ExpectationEntry[]} expectations
 * @returns {{time: number, status: string, name: string}[]} failures first, as on the page
 */
function moments(expectations) {
  const decided = [...expectations].sort((a, b) => badness(a) - badness(b));
  return decided.flatMap(({ time, status, name, cutOff }) =>
    typeof time === "number" ? [{ time, name, status: cutOff ? "cut" : status }] : []);
}

/** @param {Clock} clock @param {Motion} motion */
function touchMarks(clock, motion) {
  return motion.replay.contacts.slice(0, MOST_TOUCHES).map((contact) => {
    const mark = make("span", { class: "touched" });
    mark.style.left = share(clock, contact.time);
    mark.style.width = `max(2px, ${((contact.until - contact.time) / clock.length) * 100}%)`;
    return mark;
  });
}

/** Creates a button below the slider for each mark of the timeline, such as a fault. @param {Clock} clock @param {Motion} motion */
function eventMarks(clock, motion) {
  return (motion.replay.events ?? []).map(({ time, until, words, planned }) => {
    const told = `${words}: ${clockTime(time)}${until === undefined ? "" : ` to ${clockTime(until)}`}`;
    if (planned) {
      // A run may have a hundred segments of commands: they are no steps for the keyboard.
      const place = make("span", { class: "event planned", title: told });
      place.style.left = share(clock, time);
      return place;
    }
    const mark = make("button", { type: "button", class: "event", title: told, "aria-label": told });
    mark.style.left = share(clock, time);
    mark.addEventListener("click", () => {
      clock.pause();
      clock.seek(time);
    });
    return mark;
  });
}

/** @param {Clock} clock @param {number} time */
function share(clock, time) {
  return `${Math.min(100, Math.max(0, ((time - clock.start) / clock.length) * 100))}%`;
}
