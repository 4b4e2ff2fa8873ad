/** The menu of a plot: add a signal, save it, remove it. */
class PlotMenu {
  /** @param {Plot} plot */
  constructor(plot) {
    this.plot = plot;
    this.list = make("div", { class: "items" });
    this.opener = make("summary", { title: "Add, save, remove" }, "⋯");
    this.element = make("details", { class: "menu" }, this.opener, this.list);
    this.element.addEventListener("focusout", (event) => {
      if (!(event.relatedTarget instanceof Node) || !this.element.contains(event.relatedTarget)) this.element.open = false;
    });
    this.element.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !this.element.open) return;
      event.stopPropagation();
      this.element.open = false;
      this.opener.focus();
    });
  }

  /** Names the plot, and offers what can be done with it. */
  describe() {
    const { curves } = this.plot;
    const names = curves.map((curve) => curve.name).join(", ");
    this.opener.setAttribute("aria-label", `Plot of ${names}: add, save, remove`);
    const several = curves.length > 1 ? curves.map((curve) => this.item(`Remove ${curve.name}`, "taken", curve.key)) : [];
    this.list.replaceChildren(
      this.item("Add a signal …", "choosing"),
      this.item("Save as CSV", "csv"),
      this.item("Save as PNG", "png"),
      ...several,
      this.item("Remove this plot", "removed"),
    );
  }

  /** @param {string} words @param {string} event dispatched by the plot @param {string} [detail] */
  item(words, event, detail) {
    const button = make("button", { type: "button" }, words);
    button.addEventListener("click", () => {
      this.element.open = false;
      this.plot.dispatchEvent(new CustomEvent(event, { detail }));
    });
    return button;
  }
}
