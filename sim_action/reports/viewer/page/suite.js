/** The page of all scenarios: chips of statuses, sorting, groups, and the rows of the table that are shown. */

class Suite {
  /**
   * @param {HTMLElement} article
   * @param {Filter} filter
   */
  constructor(article, filter) {
    this.article = article;
    this.filter = filter;
    this.table = find(article, ".suite-table > table");
    this.order = orderOf(filter.units);
    /** Where the reader was when a scenario was opened. */
    this.scrolled = { main: 0, page: 0 };
    this.chips = this.offerChips();
    this.told = make("p", { class: "faint told", role: "status" });
    find(article, ".suite-table").before(this.tools(), this.told);
    this.folds = [...this.table.querySelectorAll(".below")].map((row) => ({
      summary: find(row, "summary"),
      words: find(row, "summary").textContent ?? "",
      rows: [...row.querySelectorAll(".runs > table > tbody > tr")].map((run) => ({ run, id: run.querySelector("a")?.hash.slice(1) ?? "" })),
    }));
    this.offerSorting();
    filter.addEventListener("change", () => this.show());
    this.show();
  }

  offerChips() {
    return [...this.article.querySelectorAll(".chips li")].map((item) => {
      const status = item.getAttribute("data-status") ?? "";
      const chip = make("button", { type: "button", class: "chip", "aria-pressed": "false" }, ...item.childNodes);
      item.append(chip);
      chip.addEventListener("click", () => {
        const chosen = this.filter.state.status;
        this.filter.change({ status: chosen.includes(status) ? chosen.filter((one) => one !== status) : [...chosen, status] });
      });
      return { status, chip };
    });
  }

  tools() {
    const { filter } = this;
    const tags = [...new Set(filter.units.flatMap(({ tags: some }) => some))].sort();
    const folders = together(filter.units, "folder").size;
    const files = together(filter.units, "file").size;
    const sorts = Object.entries(SORTS).filter(([key]) => key !== "change" || this.article.matches(".changed"));
    /** @type {[string, string][]} */
    const groups = [["", "none"]];
    if (folders > 1) groups.push(["folder", "folder"]);
    if (files > 1) groups.push(["file", "file"]);
    return make(
      "div",
      { class: "suite-tools", hidden: filter.units.length < SHORT_LIST },
      filterBox(filter, "Filter the table"),
      this.select("Tag", "tag", [["", "any"], ...tags.map((tag) => /** @type {[string, string]} */ ([tag, tag]))]),
      this.select("Sort", "sort", sorts.map(([key, { words }]) => [key, words])),
      this.select("Group by", "group", groups),
    );
  }

  /**
   * @param {string} title
   * @param {"tag" | "sort" | "group"} key
   * @param {[string, string][]} options
   */
  select(title, key, options) {
    const element = make("select", {}, ...options.map(([value, words]) => make("option", { value }, words)));
    element.addEventListener("change", () => this.filter.change({ [key]: element.value }));
    const show = () => {
      // A hyphen before the key of an order reverses it.
      element.value = key === "sort" ? this.filter.state[key].replace(/^-/, "") : this.filter.state[key];
    };
    this.filter.addEventListener("change", show);
    show();
    return make("label", { hidden: options.length < 2 }, `${title} `, element);
  }

  /** Turns the titles of columns into buttons that sort; a second click reverses the order. */
  offerSorting() {
    for (const title of this.table.querySelectorAll("thead th[data-sort]")) {
      const key = title.getAttribute("data-sort") ?? "";
      const button = make("button", { type: "button" }, ...title.childNodes);
      title.append(button);
      button.addEventListener("click", () => {
        const { sort } = this.filter.state;
        this.filter.change({ sort: sort === key ? `-${key}` : key });
      });
    }
  }

  show() {
    const { filter } = this;
    const { state, shown, order } = filter;
    for (const { status, chip } of this.chips) chip.setAttribute("aria-pressed", String(state.status.includes(status)));
    for (const { body, heads, texts } of filter.units) {
      const hidden = ![...heads, ...texts.keys()].some((id) => shown.has(id));
      if (body && body.hidden !== hidden) body.hidden = hidden;
    }
    for (const { summary, words, rows } of this.folds) {
      let left = 0;
      for (const { run, id } of rows) {
        run.toggleAttribute("hidden", !shown.has(id));
        left += Number(shown.has(id));
      }
      const text = left < rows.length ? `${left} of ${words}` : words;
      if (summary.textContent !== text) summary.textContent = text;
    }
    this.arrange(order);
    for (const title of this.table.querySelectorAll("thead th[data-sort]")) {
      const key = title.getAttribute("data-sort") ?? "";
      const sorted = state.sort.replace("-", "") === key;
      const rising = (SORTS[/** @type {keyof SORTS} */ (key)]?.sign ?? 1) * (state.sort.startsWith("-") ? -1 : 1) > 0;
      if (sorted) title.setAttribute("aria-sort", rising ? "ascending" : "descending");
      else title.removeAttribute("aria-sort");
    }
    const count = filter.sequence.length;
    this.told.textContent = count ? `${count} of ${filter.total} shown` : "No scenario matches.";
    this.told.hidden = !filter.narrows;
  }

  /** Puts the rows in their order, below the titles of their groups. @param {ScenarioUnit[]} order */
  arrange(order) {
    const { group } = this.filter.state;
    for (const old of this.table.querySelectorAll(".group-title")) old.remove();
    const key = orderOf(order);
    if (key !== this.order) this.table.append(...order.flatMap(({ body }) => body ?? []));
    this.order = key;
    if (!group) return;
    for (const [name, units] of together(order, group)) {
      const ids = units.flatMap(({ counted }) => counted.filter((id) => this.filter.shown.has(id)));
      const failures = units.flatMap(({ counted, status }) => counted.filter((id) => this.filter.shown.has(id)
        && !NOT_FAILURES.has(status ?? this.filter.entries.get(id)?.status ?? "")));
      if (!ids.length) continue;
      const told = `${ids.length}${failures.length ? `, ${failures.length} did not pass` : ""}`;
      const title = make("th", { colspan: 7, scope: "rowgroup" }, `${name || "no folder"} `, make("small", { class: "faint" }, told));
      units[0].body?.before(make("tbody", { class: "group-title" }, make("tr", {}, title)));
    }
  }

  /** Moves the focus to the next or previous row. @param {number} step 1 or -1 */
  step(step) {
    const links = [...this.table.querySelectorAll(":scope > tbody:not([hidden]) > tr > th > a")].filter((link) => link instanceof HTMLElement);
    const focused = document.activeElement?.closest(".suite-table > table > tbody")?.querySelector("th > a");
    const place = links.findIndex((link) => link === focused);
    const next = place < 0 ? links[step > 0 ? 0 : links.length - 1] : links[place + step];
    next?.focus();
    next?.scrollIntoView({ block: "nearest" });
  }

  /** Keeps the place of the reader. */
  leave() {
    this.scrolled = { main: find(document, "main").scrollTop, page: scrollY };
  }

  /** Shows the place where the reader was, with the focus at the scenario that was open. @param {string | null} link */
  back(link) {
    find(document, "main").scrollTo(0, this.scrolled.main);
    scrollTo(0, this.scrolled.page);
    if (link === null) return;
    const row = [...this.table.querySelectorAll("a")].find((anchor) => anchor.hash === link);
    if (document.activeElement === document.body || document.activeElement?.matches("main")) row?.focus({ preventScroll: true });
    row?.scrollIntoView({ block: "nearest" });
  }
}

/** @param {ScenarioUnit[]} units */
function orderOf(units) {
  return units.map(({ place }) => place).join();
}
