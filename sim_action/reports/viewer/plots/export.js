/** What is shown as files: CSV of the values, PNG of a plot. */

/**
 * Returns the values of curves in the shown time as RFC 4180 CSV, in SI units; a field is empty where there is no value.
 * @param {Curve[]} curves
 * @param {{from: number, to: number}} range
 */
function csvOf(curves, range) {
  const columns = curves.flatMap((curve) => {
    const name = curve.title && curve.title !== curve.name ? `${curve.title}: ${curve.name}` : curve.name;
    const unit = curve.si ? ` (${curve.si})` : "";
    const measured = { head: `${name}${curve.aimed ? " commanded" : ""}${unit}`, curve, values: curve.values };
    return curve.commanded ? [measured, { head: `${name} commanded${unit}`, curve, values: curve.commanded }] : [measured];
  });
  // Times of several rates that differ by rounding are one row.
  const rowOf = (/** @type {number} */ time) => time.toFixed(6);
  /** @type {Map<string, string[]>} */
  const rows = new Map();
  columns.forEach(({ curve, values }, column) => {
    curve.times.forEach((time, i) => {
      if (time < range.from - 1e-9 || time > range.to + 1e-9) return;
      const key = rowOf(time);
      const row = rows.get(key) ?? columns.map(() => "");
      rows.set(key, row);
      row[column] = Number.isNaN(values[i]) ? "" : exactNumber(values[i] / curve.factor);
    });
  });
  const sorted = [...rows].sort(([one], [other]) => Number(one) - Number(other));
  const lines = [["time (s)", ...columns.map(({ head }) => head)].map(csvField), ...sorted.map(([time, row]) => [exactNumber(Number(time)), ...row])];
  return lines.map((fields) => `${fields.join(",")}\r\n`).join("");
}

/** Returns a stored number without the noise of its binary form. @param {number} value */
function exactNumber(value) {
  return String(Number(value.toPrecision(12)));
}

/** @param {string} text */
function csvField(text) {
  // A spreadsheet would run a name that begins like a formula.
  const safe = /^[=+\-@]/.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

/**
 * Draws a plot with its title and legend on an opaque ground.
 * @param {Plot} plot
 * @param {string} heading
 * @param {Colours} colours
 */
function pictureOf(plot, heading, colours) {
  const width = Math.max(480, plot.frame.clientWidth), ratio = 2, line = 18;
  const top = 14 + line * (1 + plot.curves.length), height = top + 200;
  const canvas = make("canvas", { width: width * ratio, height: height * ratio });
  const context = canvas.getContext("2d");
  if (!context) return canvas;
  context.scale(ratio, ratio);
  context.fillStyle = colours.ground;
  context.fillRect(0, 0, width, height);
  context.textBaseline = "middle";
  const write = (/** @type {string} */ font, /** @type {string} */ words, /** @type {number} */ left, /** @type {number} */ y) => {
    context.font = `${font} 12px system-ui, sans-serif`;
    context.fillStyle = colours.text;
    context.fillText(words, left, y, width - left - 8);
  };
  write("600", heading, 10, 6 + line / 2);
  plot.curves.forEach((curve, i) => {
    const y = 8 + line * (1.5 + i);
    context.strokeStyle = lineColour(colours, i);
    context.lineWidth = 2;
    context.setLineDash(curve.aimed ? COMMANDED_DASH : DASHES[i % DASHES.length]);
    strokeLine(context, 10, y, 40, y);
    context.setLineDash([]);
    const aim = curve.commanded ? ", fine dashes: commanded" : "";
    const title = curve.title && curve.title !== curve.name ? `${curve.title}: ` : "";
    write("400", `${title}${curve.name}${curve.unit ? ` (${curve.unit})` : ""}${aim}`, 48, y);
  });
  const right = width - (plot.units.length > 1 ? 46 : 10);
  plot.paint(context, { left: 46, right, top: top + 6, bottom: height - 24 }, colours);
  context.fillStyle = colours.faint;
  context.textAlign = "right";
  context.textBaseline = "bottom";
  context.fillText("time in s", right, height - 1);
  return canvas;
}

/** @param {Blob | null} blob @param {string} name */
function saveFile(blob, name) {
  if (!blob) return;
  const address = URL.createObjectURL(blob);
  const link = make("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** @param {string} words @returns {string} the words as the name of a file */
function fileStem(words) {
  return words.normalize("NFKD").replace(/[^\w.-]+/g, "-").replace(/^[-.]+|[-.]+$/g, "").slice(0, 80) || "plot";
}
