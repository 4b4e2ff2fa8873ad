/** The scenarios of the page: one of them is open, or the page of all. */

/** After so many ms at one time the address names it. */
const REST = 200;

class Scenarios {
  /**
   * @param {ScenarioEntry[]} entries
   * @param {Filter} filter
   * @param {ScenarioList | null} list
   * @param {Suite | null} suite
   */
  constructor(entries, filter, list, suite) {
    this.entries = entries;
    this.filter = filter;
    this.list = list;
    this.suite = suite;
    /** @type {ScenarioEntry | null} */
    this.open = null;
    /** @type {HTMLElement | null} */
    this.article = null;
    /** @type {Player | null} */
    this.player = null;
    /** The plots over parameters by their blocks. @type {Map<string, Sweep>} */
    this.sweeps = new Map();
    this.pending = 0;
    /** The title of the whole page. */
    this.title = document.title;
    this.missing = make("p", { class: "missing", role: "status", hidden: true });
    find(document, "main").prepend(this.missing);
    this.byId = new Map(entries.map((entry) => [entry.id, entry]));
    /** @type {HTMLAnchorElement | null} */
    this.all = document.querySelector("nav.scenarios .all");
    this.link(document);
    document.querySelector(".skip")?.addEventListener("click", (event) => {
      event.preventDefault();
      find(document, "main").focus();
    });
    document.addEventListener("click", (event) => {
      // In a frame without an address, as in a notebook, the link would lead to the page around the frame.
      if (location.protocol !== "about:" || event.defaultPrevented || !(event.target instanceof Element)) return;
      const anchor = event.target.closest("nav.scenarios a, article a[href^='#']");
      if (!(anchor instanceof HTMLAnchorElement)) return;
      event.preventDefault();
      location.hash = anchor.hash;
    });
    filter.addEventListener("change", () => this.rememberFilter());
    addEventListener("hashchange", () => void this.follow());
  }

  /** Has links to articles change the address to that of their scenario. @param {ParentNode} part of the page */
  link(part) {
    for (const anchor of part.querySelectorAll('nav.scenarios a, article a[href^="#s"]')) {
      if (!(anchor instanceof HTMLAnchorElement)) continue;
      const entry = this.byId.get(anchor.hash.slice(1));
      if (entry) anchor.href = linkTo(entry, null);
    }
  }

  /** Parses the content of an article that is still text. @param {HTMLElement} article */
  unpack(article) {
    const content = article.querySelector(":scope > noscript");
    if (!content) return;
    article.innerHTML = content.textContent ?? "";
    this.link(article);
    offerCopies(article);
  }

  /** Opens what the address names: a scenario, or all of them; without a page of all, the first one that counts. */
  async follow() {
    const wanted = asked(this.entries);
    const missing = wanted ? null : addressed("scenario");
    this.missing.hidden = missing === null;
    this.missing.textContent = missing === null ? "" : `No scenario '${missing}' in this report.`;
    if (missing !== null && embedded) {
      // Another scenario in its place would not be noticed.
      this.leave();
      return;
    }
    // A link to a scenario leaves the filter as it is.
    if (this.filter.isAddressed || !wanted) this.filter.restore();
    if (!wanted && this.suite && !embedded) {
      this.showSuite(this.suite);
      return;
    }
    const first = this.entries.find(({ kind }) => kind === "scenario" || kind === "gate") ?? this.entries[0];
    const { scenario, time } = wanted ?? { scenario: this.open ?? first, time: null };
    if (!scenario) return;
    if (scenario !== this.open) {
      await this.show(scenario, time);
      return;
    }
    this.sweeps.get(scenario.sweep ?? "")?.restore();
    if (time !== null) {
      this.player?.clock.pause();
      this.player?.clock.seek(time);
      this.player?.plots.restore();
      await this.player?.ghosts.restore();
    }
  }

  /** @param {Suite} suite */
  showSuite(suite) {
    if (this.article === suite.article) return;
    const left = this.open;
    this.leave();
    suite.article.classList.add("open");
    this.article = suite.article;
    document.title = this.title;
    this.all?.setAttribute("aria-current", "page");
    this.list?.mark(null);
    this.rememberFilter();
    suite.back(left ? linkTo(left, null) : null);
  }

  /** Puts the state of the filter into the address, and into the link to the page of all. */
  rememberFilter() {
    if (this.all) this.all.href = this.filter.link;
    if (this.suite && this.article === this.suite.article) rememberLink(this.filter.link);
    else if (this.open) remember(this.filter.words);
  }

  /**
   * @param {ScenarioEntry} entry
   * @param {number | null} time
   */
  async show(entry, time) {
    const hadOther = this.article !== null;
    this.leave();
    this.open = entry;
    // The words of another scenario mean nothing here.
    if (asked([entry]) === null) rememberLink(linkTo(entry, time));
    const article = find(document, `#${entry.id}`);
    this.article = article;
    this.unpack(article);
    document.title = `${entry.name} · ${this.title}`;
    this.rememberFilter();
    article.classList.add("open");
    if (embedded) linkToWhole(article, (moment) => linkTo(entry, moment), () => this.player?.clock.time ?? null);
    this.list?.mark(entry.id);
    if (hadOther && document.activeElement === document.body) document.querySelector("main")?.focus({ preventScroll: true });
    if (entry.sweep) await this.plot(entry, entry.sweep, find(article, ".sweep"));
    if (entry.replay) await this.mount(entry, article, time);
  }

  leave() {
    if (!this.article) return;
    if (this.suite && this.article === this.suite.article) this.suite.leave();
    const { player } = this;
    // It stops its clock, whose time is not that of the scenario that the address names by now.
    this.player = this.open = null;
    player?.dispose();
    this.article.classList.remove("open", "live");
    this.article = null;
    this.all?.removeAttribute("aria-current");
    if (innerWidth <= 800) document.querySelector("nav.scenarios > details")?.removeAttribute("open");
    scrollTo(0, 0);
    find(document, "main").scrollTo(0, 0);
  }

  /** Opens the next or previous scenario in the shown order; on the page of all, goes to its row. @param {number} step */
  step(step) {
    if (this.suite && this.article === this.suite.article) this.suite.step(step);
    else this.go(this.beyond(step)[0]);
  }

  /** Opens the next scenario that did not pass, after the last one the first again. */
  nextFailure() {
    const isTable = this.suite !== null && this.article === this.suite.article;
    const after = this.beyond(1, isTable ? this.filter.focused : this.open?.id);
    const failures = [...after, ...this.filter.sequence].filter(({ status }) => !NOT_FAILURES.has(status));
    this.go(failures.find((entry) => entry !== this.open));
  }

  /**
   * The scenarios after the open one in the shown order; -1: before it, the nearest first.
   * @param {number} step
   * @param {string} [open]
   */
  beyond(step, open = this.open?.id ?? "") {
    const { shown, order } = this.filter;
    const ids = order.flatMap(({ heads, counted, texts }) => {
      const is_around = heads.includes(open) || texts.has(open);
      // In a gate, or from the page of all variations, its runs come next; the open one has its place even if it is hidden.
      const all = is_around ? [...(heads.includes(open) ? heads : []), ...counted, ...texts.keys()] : counted;
      return [...new Set(all)].filter((id) => id === open || shown.has(id));
    });
    const place = ids.indexOf(open);
    const found = step > 0 ? ids.slice(place + 1) : ids.slice(0, Math.max(0, place)).reverse();
    return found.flatMap((id) => this.byId.get(id) ?? []);
  }

  /** @param {ScenarioEntry | undefined} entry */
  go(entry) {
    if (entry) location.hash = linkTo(entry, null);
  }

  /** @returns {boolean} false if there is no page of all scenarios, or if it is open */
  toSuite() {
    if (!this.suite || !this.open) return false;
    location.hash = this.filter.link;
    return true;
  }

  /** @returns {boolean} false if there is no filter */
  focusFilter() {
    document.querySelector("nav.scenarios > details")?.setAttribute("open", "");
    const boxes = [...document.querySelectorAll("input.filter")].filter((box) => box instanceof HTMLInputElement && isSeen(box));
    const box = boxes.find((one) => this.article?.contains(one)) ?? boxes[0];
    if (!(box instanceof HTMLInputElement)) return false;
    box.focus();
    box.select();
    return true;
  }

  /**
   * @param {ScenarioEntry} entry
   * @param {HTMLElement} article
   * @param {number | null} time
   */
  async mount(entry, article, time) {
    const turn = ++this.pending;
    const replay = await unpackedReplay(entry.replay ?? "");
    // Another scenario may have been opened meanwhile.
    if (turn !== this.pending || this.open !== entry) return;
    const player = new Player(replay, entry);
    this.player = player;
    find(article, ".stage").append(player.element);
    article.classList.add("live");
    this.offerMoments(article, player);
    await player.open(time);
    const timed = () => {
      if (this.player === player && !player.clock.playing) remember({ t: timeWord(player.clock.time) });
    };
    let waiting = 0, moved = -Infinity;
    // While the time moves the address waits: browsers allow few changes of it, and each costs as much as a frame.
    const rememberTime = () => {
      clearTimeout(waiting);
      const now = performance.now();
      if (now - moved > REST) timed();
      else waiting = setTimeout(timed, REST);
      moved = now;
    };
    timed();
    player.clock.addEventListener("tick", rememberTime);
    player.clock.addEventListener("state", rememberTime);
  }

  /**
   * Draws the plot over the parameters, once, and has it show what the address says.
   * @param {ScenarioEntry} entry
   * @param {string} block
   * @param {HTMLElement} place
   */
  async plot(entry, block, place) {
    if (place.hidden) {
      place.hidden = false;
      const data = JSON.parse((await unpacked(block)) ?? "{}");
      const entries = data.entries.map((/** @type {string | null} */ id) => this.byId.get(id ?? "") ?? null);
      const made = new Sweep(block, data, entries);
      this.sweeps.set(block, made);
      place.append(made.element);
    }
    // Another scenario may have been opened meanwhile, which the address names by now.
    if (this.open === entry) this.sweeps.get(block)?.restore();
  }

  /**
   * Turns the sim times in an article into buttons that show this moment.
   * @param {HTMLElement} article
   * @param {Player} player
   */
  offerMoments(article, player) {
    for (const told_moment of article.querySelectorAll(".moment[data-time]")) {
      const time = Number(told_moment.getAttribute("data-time"));
      const words = told_moment.textContent ?? "";
      const button = make("button", { type: "button", class: "moment", "data-time": time, title: "Show this moment" }, words);
      button.addEventListener("click", () => {
        player.clock.pause();
        player.clock.seek(time);
        player.element.scrollIntoView({ block: "nearest" });
      });
      told_moment.replaceWith(button);
    }
  }
}
