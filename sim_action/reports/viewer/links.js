/** Links into the page: `#scenario=NAME&t=4.5`, and `&n=2` for the second of that name. */

/**
 * @param {ScenarioEntry[]} scenarios
 * @returns {{scenario: ScenarioEntry, time: number | null} | null} the scenario and time of the address
 */
function asked(scenarios) {
  const words = new URLSearchParams(location.hash.slice(1));
  const name = words.get("scenario");
  if (name === null) return null;
  const called = scenarios.filter((scenario) => scenario.name === name);
  const scenario = called.find(({ number }) => number === Number(words.get("n") ?? 1)) ?? called[0];
  const time = Number.parseFloat(words.get("t") ?? "");
  return scenario ? { scenario, time: Number.isFinite(time) ? time : null } : null;
}

/**
 * @param {ScenarioEntry} scenario
 * @param {number | null} time
 */
function linkTo(scenario, time) {
  const words = [`scenario=${encodeURIComponent(scenario.name)}`];
  if (scenario.number > 1) words.push(`n=${scenario.number}`);
  if (time !== null) words.push(`t=${Number(time.toFixed(3))}`);
  return `#${words.join("&")}`;
}

/** @param {string} hash */
function rememberLink(hash) {
  try {
    history.replaceState(null, "", hash);
  } catch {
    // The address cannot be changed in some contexts; then there is no link to share.
  }
}
