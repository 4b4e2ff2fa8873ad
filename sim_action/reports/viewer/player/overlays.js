/** What is drawn over the top view: the scans of lidars, and forces. */

/**
 * @param {TopView} view
 * @param {Scans[]} scans
 * @param {ReadonlySet<string>} shown layers
 */
function drawScans(view, scans, shown) {
  const { context } = view;
  const size = 3.2 * (devicePixelRatio || 1);
  for (const track of scans) {
    const { origin, points, returns } = track;
    const colour = track.colour(view.colours);
    if (shown.has("rays")) {
      context.beginPath();
      for (let i = 0; i < 3 * returns; i += 3) {
        context.moveTo(...view.pixel(origin));
        context.lineTo(...view.pixel([points[i], points[i + 1]]));
      }
      context.strokeStyle = `${colour}38`;
      context.lineWidth = 1;
      context.stroke();
    }
    if (!shown.has("points")) continue;
    context.fillStyle = colour;
    for (let i = 0; i < 3 * returns; i += 3) {
      const [x, y] = view.pixel([points[i], points[i + 1]]);
      context.fillRect(x - size / 2, y - size / 2, size, size);
    }
  }
}

/**
 * @param {TopView} view
 * @param {Pushes} pushes
 * @param {number} time
 */
function drawPushes(view, pushes, time) {
  for (const { from, to } of pushes.at(time)) {
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    const head = (/** @type {number} */ side) => [to[0] - 0.25 * dx - side * 0.12 * dy, to[1] - 0.25 * dy + side * 0.12 * dx];
    view.line([from, to, head(1), to, head(-1)], view.colours.bad, 2.5);
  }
}
