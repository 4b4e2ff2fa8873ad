/** The keyboard shortcuts of the page. */

const STEP = 1 / 30;

/**
 * @param {Player} player
 * @returns {Record<string, (event: KeyboardEvent) => void>}
 */
function keyActions(player) {
  const { clock, views, plots } = player;
  const move = (/** @type {number} */ time) => {
    clock.pause();
    clock.seek(time);
  };
  return {
    " ": () => clock.toggle(),
    ArrowLeft: (event) => move(clock.time - (event.shiftKey ? 1 : STEP)),
    ArrowRight: (event) => move(clock.time + (event.shiftKey ? 1 : STEP)),
    Home: () => move(clock.start),
    End: () => move(clock.end),
    f: () => views.toggleFollow(),
    h: () => views.showAll(),
    v: () => void views.toggleKind(),
    l: () => player.layers.toggle(),
    c: () => void views.nextSide(),
    p: () => plots.choose(null),
    "+": () => plots.zoomBy(0.5),
    "=": () => plots.zoomBy(0.5),
    "-": () => plots.zoomBy(2),
    0: () => plots.zoom(plots.all),
    Escape: () => plots.zoom(plots.all),
    g: () => void player.ghosts.toggle(),
  };
}

/**
 * @param {() => Player | null} current
 */
function listenToKeys(current) {
  document.addEventListener("keydown", (event) => {
    const player = current();
    if (!player || event.ctrlKey || event.metaKey || event.altKey || !isFree(event)) return;
    const moment = /^[1-9]$/.test(event.key) ? moments(player.entry.expectations)[Number(event.key) - 1] : undefined;
    const action = keyActions(player)[event.key];
    if (moment) {
      player.clock.pause();
      player.clock.seek(moment.time);
    } else if (action) action(event);
    else return;
    event.preventDefault();
  });
}

/**
 * Returns true unless the focused element handles the key itself.
 * @param {KeyboardEvent} event
 */
function isFree(event) {
  const target = event.target instanceof Element ? event.target : document.body;
  if (target.matches("input[type=search], textarea, select") || target.closest("dialog")) return false;
  if (event.key === " ") return !target.closest("button, a, summary, input[type=checkbox]");
  return true;
}
