/** The pictures of cameras beside the view, in step with the clock. */

class Pictures {
  /** @param {Replay} replay */
  constructor({ cameras }) {
    this.strips = (cameras ?? []).map(({ sensor, every, pictures }) => {
      const image = make("img", { alt: "", class: "picture" });
      const button = make("button", { type: "button", title: "Enlarge or reduce this picture", "aria-pressed": "false" }, image);
      const caption = make("figcaption", { class: "faint" });
      button.addEventListener("click", () => {
        const isLarge = figure.classList.toggle("large");
        button.setAttribute("aria-pressed", String(isLarge));
      });
      const figure = make("figure", {}, button, caption);
      return { sensor, every, pictures, image, caption, figure, shown: -1 };
    });
    this.element = make("div", { class: "pictures", hidden: !this.strips.length }, ...this.strips.map(({ figure }) => figure));
  }

  /** Shows the latest picture of each camera. @param {number} time s @param {boolean} isShown */
  show(time, isShown) {
    this.element.hidden = !isShown || !this.strips.length;
    if (this.element.hidden) return;
    for (const strip of this.strips) {
      const later = strip.pictures.findIndex((picture) => picture.time > time + 1e-6);
      const number = later < 0 ? strip.pictures.length - 1 : Math.max(0, later - 1);
      if (number === strip.shown) continue;
      strip.shown = number;
      const { time: taken, png } = strip.pictures[number];
      strip.image.src = `data:image/png;base64,${png}`;
      strip.image.alt = `Picture of ${strip.sensor} at ${clockTime(taken)}`;
      const kept = strip.every > 1 ? `, every ${ordinal(strip.every)} picture` : "";
      write(strip.caption, `${strip.sensor} (camera) at ${clockTime(taken)}${kept}`);
    }
  }
}
