/**
 * `node scrubbing.mjs PAGE BROWSER [SCENARIO] [VIEW]`: how a view of 640 x 480 pixels follows the slider.
 * Prints the frames per second, and the processor time of a frame, which depends less on what else runs.
 */

import { readdirSync, readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { visit } from "./browser.mjs";

const FRAMES = 100;
const MS_PER_TICK = 10;

const [file, executable, scenario, view] = process.argv.slice(2);
const words = new URLSearchParams({ ...(scenario && { scenario }), ...(view && { view }) });
await visit(`${pathToFileURL(file).href}#${words}`, { executable, width: 1500, height: 900 }, async (page) => {
  await page.waitForSelector(".scenario.live .view canvas[data-kind]");
  await page.evaluate(scrubbed, 20);
  const before = spent();
  const seconds = await page.evaluate(scrubbed, FRAMES);
  const each = (spent() - before) / FRAMES;
  console.log(`${(FRAMES / seconds).toFixed(1)} frames/s, ${each.toFixed(1)} ms of the processors for a frame`);
});

/** Moves the slider in the page from start to end. @param {number} frames @returns {Promise<number>} s */
async function scrubbed(frames) {
  const element = /** @type {HTMLElement} */ (document.querySelector(".scenario.live .view"));
  Object.assign(element.style, { aspectRatio: "auto", width: "640px", height: "480px" });
  const slider = /** @type {HTMLInputElement} */ (document.querySelector(".track input"));
  const next = () => new Promise((done) => requestAnimationFrame(done));
  await next();
  const start = performance.now();
  for (let i = 0; i < frames; i++) {
    slider.value = String(Number(slider.min) + ((Number(slider.max) - Number(slider.min)) * i) / frames);
    slider.dispatchEvent(new Event("input"));
    await next();
  }
  return (performance.now() - start) / 1000;
}

/** Returns the processor time in ms of the browser. */
function spent() {
  const parents = new Map();
  const ticks = new Map();
  for (const process_ of readdirSync("/proc").filter((name) => /^\d+$/.test(name))) {
    const fields = stat(process_);
    if (!fields) continue;
    parents.set(process_, fields[1]);
    ticks.set(process_, Number(fields[11]) + Number(fields[12]));
  }
  const mine = (/** @type {string | undefined} */ of) => {
    for (let at = of; at !== undefined; at = parents.get(at)) if (at === String(process.pid)) return true;
    return false;
  };
  return MS_PER_TICK * [...ticks].reduce((sum, [of, count]) => sum + (mine(parents.get(of)) ? count : 0), 0);
}

/** @param {string} of @returns {string[] | null} fields from the state on; null: it has ended */
function stat(of) {
  try {
    return readFileSync(`/proc/${of}/stat`, "utf8").replace(/^.*\) /s, "").split(" ");
  } catch {
    return null;
  }
}
