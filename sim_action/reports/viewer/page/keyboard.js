/** The keyboard shortcuts of the page: one table for what they do, and for the help that lists them. */

const STEP = 1 / 30;

/** The first one that uses a key has it. @type {Shortcut[]} */
const SHORTCUTS = [
  { part: "Scenarios", keys: ["j"], words: "next scenario", act: ({ scenarios: all }) => all.step(1) },
  { part: "Scenarios", keys: ["k"], words: "previous scenario", act: ({ scenarios: all }) => all.step(-1) },
  { part: "Scenarios", keys: ["n"], words: "next scenario that did not pass", act: ({ scenarios: all }) => all.nextFailure() },
  {
    part: "Replay", keys: ["Escape"], words: "plots of the whole run, if they are zoomed",
    act: ({ player }) => (player?.plots.isZoomed ? player.plots.zoom(player.plots.all) : false),
  },
  { part: "Scenarios", keys: ["u", "Escape"], words: "all scenarios", act: ({ scenarios: all }) => all.toSuite() },
  { part: "Scenarios", keys: ["/"], words: "filter", act: ({ scenarios: all }) => all.focusFilter() },
  { part: "Scenarios", keys: ["?"], words: "these keys", act: () => showHelp() },
  { part: "Replay", keys: [" "], words: "play or pause", hint: "play", act: ({ player }) => player?.clock.toggle() },
  {
    part: "Replay", keys: ["ArrowLeft", "ArrowRight"], words: "a thirtieth of a second back or on; with Shift a second", hint: "step",
    act: ({ player, event }) => {
      const size = event.shiftKey ? 1 : STEP;
      if (player) goTo(player, player.clock.time + (event.key === "ArrowLeft" ? -size : size));
    },
  },
  { part: "Replay", keys: ["Home"], words: "start", act: ({ player }) => player && goTo(player, player.clock.start) },
  { part: "Replay", keys: ["End"], words: "end", act: ({ player }) => player && goTo(player, player.clock.end) },
  {
    part: "Replay", keys: ["1", "2", "3", "4", "5", "6", "7", "8", "9"], words: "moment of a decision", hint: "moments",
    act: ({ player, event }) => {
      const moment = moments(player?.entry.expectations ?? [])[Number(event.key) - 1];
      return player && moment ? goTo(player, moment.time) : false;
    },
  },
  { part: "Replay", keys: ["f"], words: "follow the robot", hint: "follow", act: ({ player }) => player?.views.toggleFollow() },
  { part: "Replay", keys: ["h"], words: "show the whole path", act: ({ player }) => player?.views.showAll() },
  { part: "Replay", keys: ["v"], words: "3D or drawing from above", act: ({ player }) => void player?.views.toggleKind() },
  { part: "Replay", keys: ["c"], words: "next camera", act: ({ player }) => void player?.views.nextSide() },
  { part: "Replay", keys: ["l"], words: "layers: what the robot saw", act: ({ player }) => player?.layers.toggle() },
  { part: "Replay", keys: ["p"], words: "plot of signals", hint: "plot", act: ({ player }) => player?.plots.choose(null) },
  { part: "Replay", keys: ["+", "="], words: "zoom into the plots", hint: "zoom", act: ({ player }) => player?.plots.zoomBy(0.5) },
  { part: "Replay", keys: ["-"], words: "zoom out", act: ({ player }) => player?.plots.zoomBy(2) },
  { part: "Replay", keys: ["0"], words: "plots of the whole run", act: ({ player }) => player?.plots.zoom(player.plots.all) },
  {
    part: "Replay", keys: ["g"], words: "ghost: another run in the same picture", hint: "ghost",
    isThere: (player) => player.entry.ghosts.length > 0, act: ({ player }) => void player?.ghosts.toggle(),
  },
];

/** Keys whose names are too long or invisible -> the words for them. @type {Record<string, string>} */
const KEY_WORDS = { " ": "space", ArrowLeft: "←", ArrowRight: "→", Escape: "Esc" };

/** @param {Player} player @param {number} time */
function goTo(player, time) {
  player.clock.pause();
  player.clock.seek(time);
}

/** @param {Scenarios} scenarios */
function listenToKeys(scenarios) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !isFree(event)) return;
    const { player } = scenarios;
    const able = SHORTCUTS.filter(({ keys, part }) => keys.includes(event.key) && (part !== "Replay" || player));
    if (able.some((shortcut) => shortcut.act({ scenarios, player, event }) !== false)) event.preventDefault();
  });
}

/**
 * Returns true unless the focused element handles the key itself.
 * @param {KeyboardEvent} event
 */
function isFree(event) {
  const target = event.target instanceof Element ? event.target : document.body;
  if (target.matches("input[type=search], textarea, select") || target.closest("dialog")) return false;
  // An open menu of the player closes.
  if (event.key === "Escape" && target.closest(".player details")) return false;
  if (event.key === " ") return !target.closest("button, summary, input[type=checkbox]");
  return true;
}

/** The names of the keys of a shortcut. @param {Shortcut} shortcut */
function keyNames({ keys }) {
  const names = keys.map((key) => KEY_WORDS[key] ?? key);
  return names.length > 2 ? [`${names[0]} – ${names[names.length - 1]}`] : names;
}

/** The most useful keys of the player, below its controls. @param {Player} player */
function keysHint(player) {
  const pair = (/** @type {string} */ keys, /** @type {string} */ words) => make("span", {}, make("kbd", {}, keys), ` ${words}`);
  const shown = SHORTCUTS.filter(({ isThere }) => isThere?.(player) ?? true)
    .flatMap((shortcut) => (shortcut.hint ? [pair(keyNames(shortcut).join(" "), shortcut.hint)] : []));
  return make("p", { class: "keys" }, ...shown, pair("?", "all keys"));
}

/** Opens the list of all keys. */
function showHelp() {
  const shown = SHORTCUTS.filter(({ part, keys }) => part !== "Scenarios" || keys.includes("?") || document.querySelector("nav.scenarios"));
  const parts = [...new Set(shown.map(({ part }) => part))].map((part) => {
    const rows = shown.filter((one) => one.part === part).map((one) => {
      const keys = keyNames(one).flatMap((name) => [make("kbd", {}, name), " "]);
      return make("div", {}, make("dt", {}, ...keys), make("dd", {}, one.words));
    });
    return make("section", {}, make("h3", {}, part), make("dl", {}, ...rows));
  });
  const close = make("button", { type: "button", class: "chip" }, "Close");
  const dialog = make("dialog", { class: "help", "aria-labelledby": "help-title" }, make("h2", { id: "help-title" }, "Keys"), ...parts, close);
  close.addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", ({ target }) => target === dialog && dialog.close());
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
