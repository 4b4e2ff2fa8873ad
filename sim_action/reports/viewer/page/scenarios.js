/** The scenarios of the page; one of them is open. */
class Scenarios {
  /** @param {ScenarioEntry[]} entries */
  constructor(entries) {
    this.entries = entries;
    /** @type {ScenarioEntry | null} */
    this.open = null;
    /** @type {Player | null} */
    this.player = null;
    this.pending = 0;
    /** @type {Map<string, HTMLAnchorElement>} */
    this.anchors = new Map();
    this.byId = new Map(entries.map((entry) => [entry.id, entry]));
    for (const anchor of document.querySelectorAll('nav.scenarios a, article a[href^="#s"]')) {
      if (!(anchor instanceof HTMLAnchorElement)) continue;
      const entry = this.byId.get(anchor.hash.slice(1));
      if (!entry) continue;
      if (anchor.closest("nav")) this.anchors.set(entry.id, anchor);
      anchor.href = linkTo(entry, null);
      anchor.addEventListener("click", (event) => {
        // In a frame without an address, as in a notebook, the link would lead to the page around the frame.
        if (location.protocol !== "about:") return;
        event.preventDefault();
        location.hash = anchor.hash;
      });
    }
    addEventListener("hashchange", () => void this.follow());
  }

  /** Opens the scenario of the address, or the first one that counts. */
  async follow() {
    const first = this.entries.find(({ kind }) => kind === "scenario" || kind === "gate") ?? this.entries[0];
    const wanted = asked(this.entries) ?? (this.open ? null : { scenario: first, time: null });
    if (!wanted?.scenario) return;
    if (wanted.scenario !== this.open) await this.show(wanted.scenario, wanted.time);
    else if (wanted.time !== null) {
      this.player?.clock.pause();
      this.player?.clock.seek(wanted.time);
      this.player?.plots.restore();
      await this.player?.ghosts.restore();
    }
  }

  /**
   * @param {ScenarioEntry} entry
   * @param {number | null} time
   */
  async show(entry, time) {
    this.leave();
    this.open = entry;
    // The words of another scenario mean nothing here.
    if (asked([entry]) === null) rememberLink(linkTo(entry, time));
    const article = find(document, `#${entry.id}`);
    article.classList.add("open");
    if (embedded) linkToWhole(article, (moment) => linkTo(entry, moment), () => this.player?.clock.time ?? null);
    const anchor = this.anchors.get(entry.id);
    anchor?.setAttribute("aria-current", "true");
    anchor?.closest("li.group > details")?.setAttribute("open", "");
    anchor?.scrollIntoView({ block: "nearest" });
    if (entry.sweep) await this.plot(entry.sweep, find(article, ".sweep"));
    if (entry.replay) await this.mount(entry, article, time);
  }

  leave() {
    if (!this.open) return;
    this.player?.dispose();
    this.player = null;
    find(document, `#${this.open.id}`).classList.remove("open", "live");
    this.anchors.get(this.open.id)?.removeAttribute("aria-current");
    if (innerWidth <= 800) document.querySelector("nav.scenarios > details")?.removeAttribute("open");
    scrollTo(0, 0);
    find(document, "main").scrollTo(0, 0);
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
    const rememberTime = () => {
      if (this.player === player && !player.clock.playing) remember({ t: timeWord(player.clock.time) });
    };
    player.clock.addEventListener("tick", rememberTime);
    player.clock.addEventListener("state", rememberTime);
  }

  /**
   * Draws the plot over the parameters, once.
   * @param {string} block
   * @param {HTMLElement} place
   */
  async plot(block, place) {
    if (!place.hidden) return;
    place.hidden = false;
    const data = JSON.parse((await unpacked(block)) ?? "{}");
    const entries = data.entries.map((/** @type {string | null} */ id) => this.byId.get(id ?? "") ?? null);
    place.append(new Sweep(block, data, entries).element);
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
