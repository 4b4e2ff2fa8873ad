/** The list of scenarios on the left: its filter, and arrow keys that go through it as one stop of the tab key. */

const SHORT_LIST = 8;

class ScenarioList {
  /**
   * @param {HTMLElement} element the fold around the list
   * @param {Filter} filter
   */
  constructor(element, filter) {
    this.element = element;
    this.filter = filter;
    this.list = find(element, "ol");
    this.anchors = new Map([...this.list.querySelectorAll("a")].map((anchor) => [anchor.hash.slice(1), anchor]));
    this.stops = /** @type {HTMLElement[]} */ ([...this.list.querySelectorAll("a, summary")]);
    this.order = filter.order;
    this.rove();
    if (this.anchors.size >= SHORT_LIST) this.offerFilter();
  }

  offerFilter() {
    this.none = make("p", { class: "faint none", hidden: true, role: "status" }, "No scenario matches.");
    this.list.before(make("div", { class: "finder" }, filterBox(this.filter, "Filter scenarios")), this.none);
    this.filter.addEventListener("change", () => this.show());
  }

  show() {
    const { shown, order } = this.filter;
    for (const [id, anchor] of this.anchors) anchor.closest("li")?.toggleAttribute("hidden", !shown.has(id));
    // The entry of a survivor stands below that of its scenario.
    for (const { item, heads, texts } of order) item.hidden = ![...heads, ...texts.keys()].some((id) => shown.has(id));
    if (order !== this.order) this.list.append(...order.map(({ item }) => item));
    if (order !== this.order) this.stops = [...this.list.querySelectorAll("a, summary")].filter((one) => one instanceof HTMLElement);
    this.order = order;
    if (this.none) this.none.hidden = shown.size > 0;
    this.stop(this.stops.find((one) => one.hasAttribute("aria-current") && isSeen(one)) ?? this.stops.find(isSeen));
  }

  /** Lets the tab key stop at one entry, and the arrow keys go on from there. */
  rove() {
    for (const each of this.stops) each.tabIndex = -1;
    this.stop(this.stops[0]);
    this.list.addEventListener("focusin", ({ target }) => target instanceof HTMLElement && this.stop(target));
    this.list.addEventListener("keydown", (event) => {
      const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
      if (!step || !(event.target instanceof HTMLElement)) return;
      let place = this.stops.indexOf(event.target) + step;
      while (this.stops[place] && !isSeen(this.stops[place])) place += step;
      this.stops[place]?.focus();
      event.preventDefault();
    });
  }

  /** @param {HTMLElement | undefined} stop */
  stop(stop) {
    if (!stop) return;
    if (this.current) this.current.tabIndex = -1;
    stop.tabIndex = 0;
    this.current = stop;
  }

  /** Marks the entry of the open article; null: none. @param {string | null} id */
  mark(id) {
    for (const marked of this.list.querySelectorAll("[aria-current]")) marked.removeAttribute("aria-current");
    const anchor = this.anchors.get(id ?? "");
    if (!anchor) return;
    anchor.setAttribute("aria-current", "true");
    anchor.closest("li.group > details")?.setAttribute("open", "");
    anchor.scrollIntoView({ block: "nearest" });
    this.stop(anchor);
  }
}

/** Returns true unless it is hidden or in a closed fold. @param {HTMLElement} element */
function isSeen(element) {
  return element.checkVisibility();
}

/**
 * Creates a search box for the text of the filter; all of them show the same text.
 * @param {Filter} filter
 * @param {string} label
 */
function filterBox(filter, label) {
  const box = make("input", { type: "search", placeholder: "Filter", title: "Name, file, tag, status or reason (/)", "aria-label": label, class: "filter" });
  box.addEventListener("input", () => filter.change({ find: box.value }));
  filter.addEventListener("change", () => {
    if (document.activeElement !== box) box.value = filter.state.find;
  });
  return box;
}
