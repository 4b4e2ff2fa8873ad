/** The pages of `view --live`: they ask the server for news, and show the progress of the call. */

(() => {
  const PERIOD = 1000;
  const PATIENT_PERIOD = 3000;
  const FOLLOW = "sim-action follow";

  /**
   * @typedef {{place: number, name: string, file: string, why: string, since?: number | null, status?: string,
   *   symbol?: string, word?: string, took?: number, link?: string}} Row
   * @typedef {{call: number, version: string, hasMore: boolean, problem: string, isOver: boolean, elapsed: number,
   *   noun?: string, total?: number, finished?: number, left?: number | null, counts?: [string, string, string][],
   *   lists?: {title: string, count: number, rows: Row[]}[]}} State
   */

  /** @type {State | null} */
  let state = null;
  let heardAt = 0;
  let isLost = false;
  const line = document.querySelector(".live-line");

  /** @param {string} id */
  const at = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

  /** @param {string} name @param {string} words @param {string} [kind] */
  function part(name, words, kind = "") {
    const element = document.createElement(name);
    element.textContent = words;
    if (kind) element.className = kind;
    return element;
  }

  /** @param {number} count @param {string} noun */
  const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

  /** @param {number} seconds */
  function duration(seconds) {
    const whole = Math.round(seconds);
    if (whole < 60) return `${whole} s`;
    if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
    return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
  }

  async function ask() {
    try {
      const answer = await fetch(`state?after=${state ? state.version : ""}`, { cache: "no-store" });
      if (answer.status === 200) {
        state = /** @type {State} */ (await answer.json());
        heardAt = performance.now();
        isLost = false;
        if (line) showNews(state);
        else showProgress(state);
      } else if (answer.status !== 204) throw new Error(answer.statusText);
      if (isLost) {
        isLost = false;
        if (state && !line) showProgress(state);
      }
    } catch {
      isLost = true;
    }
    if (line) tellLoss();
    else showClock();
    setTimeout(whenSeen, state?.hasMore ? 0 : isLost ? PATIENT_PERIOD : PERIOD);
  }

  /** A page in the background asks for nothing. */
  function whenSeen() {
    if (document.visibilityState === "visible") void ask();
    else document.addEventListener("visibilitychange", whenSeen, { once: true });
  }

  /** @param {State} now */
  function showProgress(now) {
    const { noun = "scenario", total = 0, finished = 0, counts = [], lists = [] } = now;
    const bar = /** @type {HTMLProgressElement} */ (at("live-bar"));
    bar.max = Math.max(1, total);
    bar.value = finished;
    const title = !total ? "Waiting for a run" : now.isOver ? `The run has ended: ${finished} of ${counted(total, noun)} finished`
      : `${finished} of ${counted(total, noun)} finished`;
    at("live-title").textContent = title;
    document.title = total ? `${now.isOver ? "ended" : `${finished}/${total}`} · sim-action` : "Progress · sim-action";
    const shown = counts.flatMap(([kind, symbol, words]) => [part("span", symbol, `mark ${kind}`), ` ${words}   `]);
    at("live-counts").replaceChildren(...shown);
    at("live-problem").textContent = now.problem;
    at("live-problem").hidden = !now.problem;
    at("live-report").hidden = finished === 0;
    const focused = document.activeElement?.getAttribute("href");
    at("live-lists").replaceChildren(...lists.filter(({ count }) => count > 0).map(listOf));
    const again = [...document.querySelectorAll("#live-lists a")].find((link) => link.getAttribute("href") === focused);
    if (focused && again instanceof HTMLElement) again.focus({ preventScroll: true });
  }

  /** @param {{title: string, count: number, rows: Row[]}} list */
  function listOf({ title, count, rows }) {
    const section = part("section", "");
    const items = part("ul", "");
    items.append(...rows.map(itemOf));
    section.append(part("h2", `${title} (${count})`), items);
    if (count > rows.length) section.append(part("p", `${count - rows.length} more`, "faint"));
    return section;
  }

  /** @param {Row} row */
  function itemOf(row) {
    const item = part("li", "");
    const mark = part("span", row.symbol ?? (typeof row.since === "number" ? "▶" : "·"), `mark ${row.status ?? ""}`);
    if (row.word) {
      mark.setAttribute("role", "img");
      mark.setAttribute("aria-label", row.word);
    } else mark.setAttribute("aria-hidden", "true");
    const name = part(row.link ? "a" : "span", row.name, "name");
    if (row.link) name.setAttribute("href", row.link);
    const time = part("span", row.took === undefined ? "" : `${row.took} s`, "faint time");
    if (typeof row.since === "number") time.dataset.since = String(row.since);
    item.append(mark, name, time);
    if (row.why) item.append(part("small", row.why, "faint"));
    return item;
  }

  /** The times go on between two answers. */
  function showClock() {
    const clock = at("live-clock");
    if (isLost || !state) {
      clock.textContent = isLost ? "sim-action has ended, or cannot be reached: this page shows what it last knew." : "";
      return;
    }
    const passed = state.isOver || !state.total ? 0 : (performance.now() - heardAt) / 1000;
    const left = typeof state.left === "number" ? Math.max(0, state.left - passed) : null;
    const told = [`${duration(state.elapsed + passed)}`];
    if (left !== null && !state.isOver && (state.finished ?? 0) < (state.total ?? 0)) told.push(`about ${duration(left)} left`);
    clock.textContent = state.total ? told.join(" · ") : "The page begins as soon as a run writes into this folder.";
    if (state.isOver) return;
    for (const time of document.querySelectorAll("[data-since]")) {
      const since = Number(time.getAttribute("data-since"));
      time.textContent = `for ${duration(Math.max(0, state.elapsed + passed - since))}`;
    }
  }

  /** @param {State} now */
  function showNews(now) {
    if (!(line instanceof HTMLElement)) return;
    const { call, finished, over } = line.dataset;
    const isOther = String(now.call) !== call;
    const more = (now.finished ?? 0) - (isOther ? 0 : Number(finished));
    const isNew = (now.finished ?? 0) > 0 && (isOther || more > 0 || String(Number(now.isOver)) !== over);
    at("live-news").textContent = more > 0
      ? `${counted(more, now.noun ?? "scenario")} ${more === 1 ? "has a new result" : "have new results"}.`
      : isNew ? "The run has ended." : "";
    at("live-update").hidden = !isNew;
    const follow = /** @type {HTMLInputElement} */ (at("live-follow"));
    // The address keeps the scenario, the time, and whatever else is shown.
    if (isNew && follow.checked && (now.isOver || !isOther)) location.reload();
  }

  function tellLoss() {
    if (isLost) at("live-news").textContent = "sim-action has ended, or cannot be reached: this page stays as it is.";
  }

  if (line) {
    const follow = /** @type {HTMLInputElement} */ (at("live-follow"));
    follow.checked = sessionStorage.getItem(FOLLOW) === "yes";
    follow.addEventListener("change", () => {
      sessionStorage.setItem(FOLLOW, follow.checked ? "yes" : "no");
      if (state) showNews(state);
    });
    at("live-update").addEventListener("click", () => location.reload());
  } else setInterval(showClock, PERIOD);
  void ask();
})();
