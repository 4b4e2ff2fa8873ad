/** What is shown as files: CSV of the values, PNG of a plot. */

/**
 * Returns the values of curves in the shown time as RFC 4180 CSV, in SI units; a field is empty where there is no value.
 * @param {Curve[]} curves
 * @param {{from: number, to: number}} range
 * @param {(curve: Curve) => Curve | null} ghostOf returns the same curve of the run that is drawn as a ghost
 * @param {string} ghostName
 */
function csvOf(curves, range, ghostOf, ghostName) {
  const columns = curves.flatMap((curve) => {
    const name = curve.title && curve.title !== curve.name ? `${curve.title}: ${curve.name}` : curve.name;
    const unit = curve.si ? ` (${curve.si})` : "";
    const measured = { head: `${name}${curve.aimed ? " commanded" : ""}${unit}`, curve, values: curve.values };
    const commanded = curve.commanded ? [{ head: `${name} commanded${unit}`, curve, values: curve.commanded }] : [];
    const { band } = curve;
    const ends = band ? [{ which: "lowest", values: band.low }, { which: "highest", values: band.high }] : [];
    const range = ends.map(({ which, values }) => ({ head: `${name} ${which} of ${band?.runs} runs${unit}`, curve, values }));
    const ghost = ghostOf(curve);
    const other = ghost ? [{ head: `${name} [${ghostName}]${unit}`, curve: ghost, values: ghost.values }] : [];
    return [measured, ...commanded, ...range, ...other];
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
  const samples = plot.curves.flatMap((curve, i) => {
    const title = curve.title && curve.title !== curve.name ? `${curve.title}: ` : "";
    const words = `${title}${curve.name}${curve.unit ? ` (${curve.unit})` : ""}`;
    const dash = DASHES[i % DASHES.length];
    const measured = { words: `${words}${curveMarks(curve)}`, colour: lineColour(colours, i), width: 2, dash: curve.aimed ? COMMANDED_DASH : dash };
    return plot.ghosts.has(curve.key) ? [measured, { words: `${words}, ${plot.ghostName}`, colour: colours.ghost, width: 1.1, dash }] : [measured];
  });
  const top = 14 + line * (1 + samples.length), height = top + 200;
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
  samples.forEach(({ words, colour, width: thickness, dash }, i) => {
    const y = 8 + line * (1.5 + i);
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.setLineDash(dash);
    strokeLine(context, 10, y, 40, y);
    context.setLineDash([]);
    write("400", words, 48, y);
  });
  const right = width - (plot.units.length > 1 ? 46 : 10);
  plot.paint(context, { left: 46, right, top: top + 6, bottom: height - 30 }, colours);
  context.fillStyle = colours.faint;
  context.textAlign = "right";
  context.textBaseline = "bottom";
  context.fillText("time", right, height - 1);
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
