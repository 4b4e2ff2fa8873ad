/** The current sim time, shown by all parts of the page. */
class Clock extends EventTarget {
  /** @param {number} start s @param {number} end s */
  constructor(start, end) {
    super();
    this.start = start;
    this.end = end;
    this.time = start;
    this.speed = 1;
    this.playing = false;
    this.pending = 0;
  }

  /** The duration in s, never zero. */
  get length() {
    return Math.max(1e-6, this.end - this.start);
  }

  /** @param {number} time s; clamped to the run */
  seek(time) {
    this.time = Math.min(this.end, Math.max(this.start, time));
    this.dispatchEvent(new Event("tick"));
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (this.time >= this.end - 1e-6) this.seek(this.start);
    this.playing = true;
    let before = performance.now();
    const advance = (/** @type {number} */ now) => {
      const passed = Math.max(0, now - before) / 1000;
      before = now;
      this.seek(this.time + passed * this.speed);
      if (this.time >= this.end) this.pause();
      else this.pending = requestAnimationFrame(advance);
    };
    this.pending = requestAnimationFrame(advance);
    this.dispatchEvent(new Event("state"));
  }

  pause() {
    if (!this.playing) return;
    cancelAnimationFrame(this.pending);
    this.playing = false;
    this.dispatchEvent(new Event("state"));
  }
}
