/**
 * The address of the page names what is shown: `#scenario=NAME&t=4.5`, `&n=2` for the second scenario of that name.
 * Further words belong to the part of the page that they describe; each part reads and remembers its own.
 */

/**
 * @param {string} key
 * @returns {string | null} the value of a word of the address; null: it has none
 */
function addressed(key) {
  return new URLSearchParams(location.hash.slice(1)).get(key);
}

/**
 * Changes words of the address and keeps the others; it adds no entry to the history.
 * @param {Record<string, string | null>} words null removes a word
 */
function remember(words) {
  const all = new URLSearchParams(location.hash.slice(1));
  for (const [key, value] of Object.entries(words)) {
    if (value === null) all.delete(key);
    else all.set(key, value);
  }
  rememberLink(`#${hashOf([...all])}`);
}

/**
 * @param {ScenarioEntry[]} scenarios
 * @returns {{scenario: ScenarioEntry, time: number | null} | null} the scenario and time of the address
 */
function asked(scenarios) {
  const name = addressed("scenario");
  if (name === null) return null;
  const called = scenarios.filter((scenario) => scenario.name === name);
  const scenario = called.find(({ number }) => number === Number(addressed("n") ?? 1)) ?? called[0];
  const time = Number.parseFloat(addressed("t") ?? "");
  return scenario ? { scenario, time: Number.isFinite(time) ? time : null } : null;
}

/**
 * @param {ScenarioEntry} scenario
 * @param {number | null} time
 */
function linkTo(scenario, time) {
  const words = [["scenario", scenario.name]];
  if (scenario.number > 1) words.push(["n", String(scenario.number)]);
  if (time !== null) words.push(["t", timeWord(time)]);
  return `#${hashOf(words)}`;
}

/** @param {number} time s */
function timeWord(time) {
  return String(Number(time.toFixed(3)));
}

/** @param {string[][]} words */
function hashOf(words) {
  return words.map(([key, value]) => `${key}=${encodeURIComponent(value)}`).join("&");
}

/** @param {string} hash */
function rememberLink(hash) {
  // A frame keeps the address that its page gave it.
  if (embedded) return;
  try {
    history.replaceState(null, "", hash);
  } catch {
    // The address cannot be changed in some contexts; then there is no link to share.
  }
}
