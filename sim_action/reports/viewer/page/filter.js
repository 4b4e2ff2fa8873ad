/** The scenarios that are shown, and their order: one state for the list on the left and the page of all scenarios. */

const NOT_FAILURES = new Set(["passed", "warned", "skipped"]);

/** What scenarios are sorted by -> its words, and the sign of the order: 1 shows the smallest value first. */
const SORTS = {
  status: { words: "status", sign: 1 },
  name: { words: "name", sign: 1 },
  margin: { words: "smallest margin", sign: 1 },
  sim: { words: "longest sim time", sign: -1 },
  wall: { words: "longest wall time", sign: -1 },
  change: { words: "change", sign: 1 },
};

class Filter extends EventTarget {
  /** @param {ScenarioEntry[]} entries */
  constructor(entries) {
    super();
    this.entries = new Map(entries.map((entry) => [entry.id, entry]));
    this.units = unitsOfPage(this.entries);
    /** @type {FilterState} */
    this.state = { status: [], find: "", tag: "", sort: "status", group: "" };
    /** The ids of the articles that are shown. @type {Set<string>} */
    this.shown = new Set();
    /** The units in their order, hidden ones too. @type {ScenarioUnit[]} */
    this.order = this.units;
    this.apply();
  }

  /** The number of scenarios and gates. */
  get total() {
    return this.units.reduce((sum, { counted }) => sum + counted.length, 0);
  }

  /** The shown scenarios and gates in their order. @returns {ScenarioEntry[]} */
  get sequence() {
    const ids = this.order.flatMap(({ counted }) => counted.filter((id) => this.shown.has(id)));
    return ids.flatMap((id) => this.entries.get(id) ?? []);
  }

  /** The id of the scenario or gate whose row in the table has the focus; empty if none has it. */
  get focused() {
    const unit = this.units.find(({ body }) => body?.contains(document.activeElement));
    return unit?.heads[0] ?? unit?.counted[0] ?? "";
  }

  get narrows() {
    const { status, find, tag } = this.state;
    return status.length > 0 || find.trim() !== "" || tag !== "";
  }

  /** @param {Partial<FilterState>} changes */
  change(changes) {
    const before = JSON.stringify(this.state);
    this.state = { ...this.state, ...changes };
    if (JSON.stringify(this.state) === before) return;
    this.apply();
    this.dispatchEvent(new Event("change"));
  }

  apply() {
    const { status, find, tag, sort, group } = this.state;
    const words = find.toLowerCase().split(/\s+/).filter(Boolean);
    this.shown.clear();
    for (const unit of this.units) {
      if (tag && !unit.tags.includes(tag)) continue;
      for (const [id, text] of unit.texts) {
        const judged = unit.status ?? this.entries.get(id)?.status ?? "";
        if ((status.length === 0 || status.includes(judged)) && words.every((word) => text.includes(word))) this.shown.add(id);
      }
      if (unit.heads.length && [...unit.texts.keys()].some((id) => this.shown.has(id))) {
        for (const id of unit.heads) this.shown.add(id);
      }
    }
    const sorted = sort === "status" ? this.units : [...this.units].sort(comparison(sort));
    this.order = group ? [...together(sorted, group).values()].flat() : sorted;
  }

  /** The words of the address that name this state; null: as at the start. @returns {Record<string, string | null>} */
  get words() {
    const { status, find, tag, sort, group } = this.state;
    const words = { status: status.join(","), find: find.trim(), tag, sort: sort === "status" ? "" : sort, group };
    return Object.fromEntries(Object.entries(words).map(([key, value]) => [key, value || null]));
  }

  /** The address of the page of all scenarios in this state. @returns {string} */
  get link() {
    // Not the id of its article alone, to which browsers would scroll.
    return `#${hashOf([["suite", "all"], ...Object.entries(this.words).flatMap(([key, value]) => (value === null ? [] : [[key, value]]))])}`;
  }

  /** True if the address names a state. */
  get isAddressed() {
    return Object.keys(this.words).some((key) => addressed(key) !== null);
  }

  /** Takes the state that the address names. */
  restore() {
    const sort = addressed("sort") ?? "status";
    const group = addressed("group") ?? "";
    this.change({
      status: (addressed("status") ?? "").split(",").filter(Boolean),
      find: addressed("find") ?? "",
      tag: addressed("tag") ?? "",
      sort: sort.replace("-", "") in SORTS ? sort : "status",
      group: group === "folder" || group === "file" ? group : "",
    });
  }
}

/**
 * @param {string} sort a key of SORTS; with a hyphen: reversed
 * @returns {(a: ScenarioUnit, b: ScenarioUnit) => number}
 */
function comparison(sort) {
  const key = sort.replace("-", "");
  const sign = (SORTS[/** @type {keyof SORTS} */ (key)] ?? SORTS.status).sign * (sort.startsWith("-") ? -1 : 1);
  if (key === "name") {
    const { compare } = new Intl.Collator(undefined, { numeric: true });
    return (a, b) => sign * compare(a.name, b.name) || a.place - b.place;
  }
  return (a, b) => {
    const [one, other] = [a.numbers[key], b.numbers[key]];
    // Those without a value come last in both directions.
    if (one === undefined || other === undefined) return Number(one === undefined) - Number(other === undefined) || a.place - b.place;
    return sign * (one - other) || a.place - b.place;
  };
}

/**
 * @param {ScenarioUnit[]} units
 * @param {string} group "folder" or "file"
 * @returns {Map<string, ScenarioUnit[]>}
 */
function together(units, group) {
  /** @type {Map<string, ScenarioUnit[]>} */
  const found = new Map();
  for (const unit of units) {
    const name = group === "file" ? unit.file : unit.file.replace(/[^/]*$/, "");
    const several = found.get(name);
    if (several) several.push(unit);
    else found.set(name, [unit]);
  }
  return found;
}

/**
 * Reads the scenarios of the page, each with its variations or runs, from the list and from the table of all.
 * @param {Map<string, ScenarioEntry>} entries
 * @returns {ScenarioUnit[]}
 */
function unitsOfPage(entries) {
  const bodies = [...document.querySelectorAll("#suite .suite-table > table > tbody")];
  return [...document.querySelectorAll("nav.scenarios > details > ol > li")].map((item, place) => {
    const body = bodies[place];
    const data = body instanceof HTMLElement ? body.dataset : {};
    const anchors = /** @type {HTMLAnchorElement[]} */ ([...item.querySelectorAll("a")]);
    const known = anchors.map((anchor) => ({ anchor, id: anchor.hash.slice(1) })).filter(({ id }) => entries.has(id));
    const isHead = (/** @type {string} */ id) => ["gate", "variations"].includes(entries.get(id)?.kind ?? "");
    const heads = known.map(({ id }) => id).filter(isHead);
    const runs = known.length > heads.length ? known.filter(({ id }) => !isHead(id)) : known;
    const title = item.querySelector("summary .name, a .name")?.firstChild?.textContent ?? "";
    const changed = body?.querySelector(":scope > tr > [data-title=Change]")?.textContent ?? "";
    const shared = `${title} ${item.matches(".gate") ? anchors[0].textContent : ""} ${data.file ?? ""} ${data.tags ?? ""} ${changed}`;
    const numbers = Object.entries({ margin: data.margin, sim: data.sim, wall: data.wall, change: data.change });
    return {
      item: /** @type {HTMLElement} */ (item),
      body: body instanceof HTMLElement ? body : null,
      place,
      name: title,
      file: data.file ?? "",
      tags: (data.tags ?? "").split(" ").filter(Boolean),
      status: data.status ?? null,
      numbers: Object.fromEntries(numbers.filter(([, value]) => value !== undefined).map(([key, value]) => [key, Number(value)])),
      heads,
      counted: item.matches(".gate") ? heads : runs.map(({ id }) => id).filter((id) => entries.get(id)?.kind !== "sample"),
      texts: new Map(runs.map(({ anchor, id }) => {
        const mark = anchor.querySelector("[aria-label]")?.getAttribute("aria-label") ?? "";
        return [id, `${shared} ${anchor.textContent} ${mark}`.toLowerCase()];
      })),
    };
  });
}
