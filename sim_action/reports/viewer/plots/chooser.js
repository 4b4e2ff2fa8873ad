/** The dialog in which signals are chosen: typed words narrow the list, Enter or a click adds and removes. */

/** More than these are found by typing. */
const MOST_LISTED = 200;

class Chooser {
  /**
   * @param {Catalogue} catalogue
   * @param {(key: string) => boolean} isChosen
   * @param {(key: string) => void} toggle
   */
  constructor(catalogue, isChosen, toggle) {
    this.signals = grouped(catalogue);
    this.isChosen = isChosen;
    this.toggle = toggle;
    /** @type {HTMLElement[]} */
    this.options = [];
    this.active = 0;
    const list = `signals-${++Chooser.count}`;
    this.search = make("input", {
      type: "search", role: "combobox", "aria-expanded": "true", "aria-controls": list, "aria-autocomplete": "list",
      "aria-label": "Find a signal", placeholder: "Find a signal", autocomplete: "off", spellcheck: "false",
    });
    this.list = make("div", { id: list, role: "listbox", "aria-label": "Signals", "aria-multiselectable": "true", class: "signals" });
    this.found = make("p", { class: "faint", role: "status" });
    const done = make("button", { type: "button", class: "copy" }, "Done");
    const keys = make("p", { class: "faint" }, make("kbd", {}, "↑ ↓"), " choose  ", make("kbd", {}, "Enter"), " add or remove  ", make("kbd", {}, "Esc"), " done");
    this.element = make("dialog", { class: "chooser", "aria-label": "Signals of a plot" }, this.search, this.list, this.found, make("div", { class: "foot" }, keys, done));
    done.addEventListener("click", () => this.close());
    this.element.addEventListener("cancel", (event) => {
      event.preventDefault();
      this.close();
    });
    this.search.addEventListener("input", () => this.fill());
    this.search.addEventListener("keydown", (event) => this.press(event));
    this.element.addEventListener("click", (event) => {
      if (event.target === this.element) this.close();
    });
  }

  close() {
    // Else the keys of the page would still go to the hidden dialog.
    if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
    this.element.close();
  }

  open() {
    this.search.value = "";
    this.fill();
    this.element.showModal();
    this.search.focus();
  }

  /** Lists the signals that have all typed words. */
  fill() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = (/** @type {string} */ title, /** @type {Signal} */ signal) => {
      const all = `${title} ${signal.name} ${signal.about} ${signal.kind}`.toLowerCase();
      return words.every((word) => all.includes(word));
    };
    this.options = [];
    let found = 0;
    const groups = this.signals.map(([title, signals]) => {
      const fitting = signals.filter((signal) => fits(title, signal));
      const room = Math.max(0, MOST_LISTED - found);
      found += fitting.length;
      const options = fitting.slice(0, room).map((signal) => this.option(signal));
      return options.length ? [make("div", { role: "group", "aria-label": title }, make("div", { class: "group", "aria-hidden": "true" }, title), ...options)] : [];
    });
    this.list.replaceChildren(...groups.flat());
    const more = found > MOST_LISTED ? `, the first ${MOST_LISTED} are listed` : "";
    this.found.textContent = found ? `${found} ${found === 1 ? "signal" : "signals"}${more}` : "No signal matches.";
    this.activate(0);
  }

  /** @param {Signal} signal */
  option(signal) {
    const { name: unit } = shownUnit(signal.unit);
    const id = `${this.list.id}-${this.options.length}`;
    const option = make("div", { role: "option", id, "data-key": signal.key, "aria-selected": String(this.isChosen(signal.key)) }, signal.name);
    if (signal.about) option.append(make("small", { class: "about" }, signal.about));
    option.append(make("small", {}, [signal.kind, unit].filter(Boolean).join(", ")));
    const number = this.options.length;
    option.addEventListener("click", () => {
      this.activate(number);
      this.take();
    });
    this.options.push(option);
    return option;
  }

  /** @param {number} number */
  activate(number) {
    this.options[this.active]?.classList.remove("active");
    this.active = Math.min(this.options.length - 1, Math.max(0, number));
    const option = this.options[this.active];
    option?.classList.add("active");
    option?.scrollIntoView({ block: "nearest" });
    this.search.setAttribute("aria-activedescendant", option?.id ?? "");
  }

  take() {
    const key = this.options[this.active]?.dataset.key;
    if (key === undefined) return;
    this.toggle(key);
    for (const option of this.options) option.setAttribute("aria-selected", String(this.isChosen(option.dataset.key ?? "")));
    this.search.focus();
  }

  /** @param {KeyboardEvent} event */
  press(event) {
    const steps = { ArrowDown: 1, ArrowUp: -1, PageDown: 8, PageUp: -8 };
    const step = steps[/** @type {keyof typeof steps} */ (event.key)];
    if (step) this.activate(this.active + step);
    else if (event.key === "Enter") this.take();
    // A field for searches would clear its words, and stay.
    else if (event.key === "Escape") this.close();
    else return;
    event.preventDefault();
  }
}

/** The number of choosers, for ids. */
Chooser.count = 0;

/** @param {Catalogue} catalogue @returns {[string, Signal[]][]} the signals by the titles of their groups */
function grouped(catalogue) {
  /** @type {Map<string, Signal[]>} */
  const groups = new Map(Object.keys(GROUPS).map((group) => [group, []]));
  for (const signal of catalogue.signals.values()) {
    const group = groups.get(signal.group);
    if (group) group.push(signal);
    else groups.set(signal.group, [signal]);
  }
  return [...groups].filter(([, signals]) => signals.length).map(([group, signals]) => [titleOfGroup(group), signals]);
}

/** @param {string} group */
function titleOfGroup(group) {
  return new Map(Object.entries(GROUPS)).get(group) ?? group;
}
