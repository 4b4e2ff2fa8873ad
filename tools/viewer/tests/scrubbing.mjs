/**
 * `node scrubbing.mjs PAGE BROWSER [SCENARIO] [WORDS]`: how a view of 640 x 480 pixels follows the slider; WORDS are
 * further ones of the address, such as `view=top&layers=rays`.
 * Prints the frames per second, and the processor time of a frame in each process, which depends less on what else runs.
 * First as in a browser without a graphics card, then with pages that are drawn by WebGL, too, as in the tests.
 */

import { readdirSync, readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { launch, READY, visit } from "./browser.mjs";

const FRAMES = 100;
const MS_PER_TICK = 10;

const [file, executable, scenario, further] = process.argv.slice(2);
const words = new URLSearchParams(further);
if (scenario) words.set("scenario", scenario);
for (const plain of [true, false]) {
  const browser = await launch({ executable, plain });
  const how = { executable, browser, width: 1500, height: 900 };
  await visit(`${pathToFileURL(file).href}#${words}`, how, async (page) => {
    await page.waitForSelector(READY);
    await page.evaluate(scrubbed, 20);
    const before = spent();
    const seconds = await page.evaluate(scrubbed, FRAMES);
    const each = [...spent()].map(([kind, ms]) => /** @type {[string, number]} */ ([kind, (ms - (before.get(kind) ?? 0)) / FRAMES]));
    const most = each.filter(([, ms]) => ms >= 0.5).map(([kind, ms]) => `${kind} ${ms.toFixed(1)}`);
    const sum = each.reduce((all, [, ms]) => all + ms, 0);
    console.log(`${plain ? "plain" : "by WebGL"}: ${(FRAMES / seconds).toFixed(1)} frames/s, ${sum.toFixed(1)} ms of the processors for a frame (${most.join(", ")})`);
  });
  await browser.close();
}

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

/** Returns the processor time in ms of each kind of process of the browser. @returns {Map<string, number>} */
function spent() {
  const parents = new Map(), ticks = new Map();
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
  const sums = new Map();
  for (const [of, count] of ticks) {
    if (mine(parents.get(of))) sums.set(kindOf(of), (sums.get(kindOf(of)) ?? 0) + MS_PER_TICK * count);
  }
  return sums;
}

/** @param {string} of @returns {string} such as "renderer" and "gpu" */
function kindOf(of) {
  try {
    return /--type=([a-z]+)/.exec(readFileSync(`/proc/${of}/cmdline`, "utf8"))?.[1] ?? "browser";
  } catch {
    return "ended";
  }
}

/** @param {string} of @returns {string[] | null} fields from the state on; null: it has ended */
function stat(of) {
  try {
    return readFileSync(`/proc/${of}/stat`, "utf8").replace(/^.*\) /s, "").split(" ");
  } catch {
    return null;
  }
}
