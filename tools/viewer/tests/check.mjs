/**
 * `node check.mjs BROWSER`: looks at pages in one browser, until its standard input ends. A line of it is a JSON list: the page, or the
 * address of a server on this machine, and the names of checks. Each check has a fresh context of the browser.
 * Prints one line of JSON for each check, its name and its error (empty: none).
 */

import assert from "node:assert/strict";
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";
import { READY, drawn, launch, ready, visit } from "./browser.mjs";
import { ACCESSIBLE } from "./checks/accessible.mjs";
import { CAMERAS } from "./checks/cameras.mjs";
import { GHOSTS } from "./checks/ghosts.mjs";
import { FRAMES } from "./checks/frames.mjs";
import { GROUPS } from "./checks/groups.mjs";
import { PACE } from "./checks/pace.mjs";
import { SEEN } from "./checks/seen.mjs";
import { SIGNALS } from "./checks/signals.mjs";
import { SUITE } from "./checks/suite.mjs";

const CLOCK = ".readout";

/** @typedef {import("playwright-core").Page} Page */

const time = async (/** @type {Page} */ page) => Number.parseFloat((await page.textContent(CLOCK)) ?? "");
const cursor = (/** @type {Page} */ page) => page.$eval(".cursor", (element) => element.getBoundingClientRect().left);
const picture = async (/** @type {Page} */ page) => (await page.locator(".view canvas").screenshot()).toString("base64");
const kind = (/** @type {Page} */ page) => page.getAttribute(".view canvas", "data-kind");
const text = (/** @type {Page} */ page) => page.evaluate(() => document.body.innerText);

/** Without `webgl` the replay is drawn from above, which takes less time. @type {Record<string, {how?: {webgl?: boolean, scripts?: boolean, width?: number, height?: number, dark?: boolean}, hash?: string, look: (page: Page) => Promise<void>}>} */
const CHECKS = {
  ...CAMERAS,
  ...GHOSTS,
  ...SEEN,
  ...PACE,
  ...SIGNALS,
  ...FRAMES,
  ...SUITE,
  ...GROUPS,
  ...ACCESSIBLE,
  loads: {
    look: async (page) => {
      await ready(page);
      assert.equal(await kind(page), "3d");
      assert.match(await text(page), /did not pass/);
      assert.ok((await page.$$(".plot")).length >= 3);
    },
  },
  "opens where it failed": {
    look: async (page) => {
      await ready(page);
      const failed = Number(await page.getAttribute(".reason.failed button.moment", "data-time"));
      assert.ok(failed > 0);
      assert.ok(Math.abs((await time(page)) - failed) < 0.01);
      assert.match((await page.textContent(".happening")) ?? "", /touches wall/);
      // Before a dark wall, too, it can be read.
      const behind = await page.$eval(".happening", (words) => getComputedStyle(words).backgroundColor);
      assert.equal(behind, await page.$eval("html", (all) => getComputedStyle(all).backgroundColor));
    },
  },
  "names a contact without a force": {
    look: async (page) => {
      await ready(page);
      assert.equal(await page.textContent(".happening"), "base touches agv, neither gives way");
    },
  },
  "opens where runs parted": {
    look: async (page) => {
      await ready(page);
      const parted = Number(await page.getAttribute(".reason button.moment", "data-time"));
      assert.ok(parted > 0);
      assert.ok(Math.abs((await time(page)) - parted) < 0.01);
      await page.waitForFunction(() => document.querySelector(".against select")?.value === "another repetition");
      assert.match((await page.textContent(".against button")) ?? "", /^The motions part at [\d.]+ s/);
    },
  },
  "opens where it broke off": {
    look: async (page) => {
      await ready(page);
      assert.ok(Math.abs((await time(page)) - 1.1) < 0.06);
      assert.equal(await page.isVisible(".happening"), false);
    },
  },
  "play moves the robot": {
    // The longer run: a slow machine does not come to its end meanwhile.
    hash: "#scenario=burger%20pushes%20on&t=0",
    look: async (page) => {
      await ready(page);
      await page.keyboard.press("Home");
      const [before, seen] = [await time(page), await picture(page)];
      await page.click(".play");
      await page.waitForFunction(() => Number.parseFloat(document.querySelector(".readout")?.textContent ?? "") > 0.7);
      await page.click(".play");
      assert.equal(await page.getAttribute(".play", "aria-label"), "Play");
      const after = await time(page);
      assert.ok(after > before);
      assert.notEqual(await picture(page), seen);
      await page.waitForTimeout(150);
      assert.equal(await time(page), after);
    },
  },
  "scrubbing moves the cursor": {
    how: { webgl: false },
    look: async (page) => {
      await ready(page);
      await page.keyboard.press("Home");
      const before = await cursor(page);
      await page.locator("input[type=range]").fill("0.5");
      assert.ok(Math.abs((await time(page)) - 0.5) < 0.01);
      const middle = await cursor(page);
      assert.ok(middle > before + 10);
      const frame = await page.locator(".plot .frame").first().boundingBox();
      assert.ok(frame);
      const axis = frame.y + frame.height - 8;
      await page.mouse.move(frame.x + frame.width * 0.4, axis);
      await page.mouse.down();
      await page.mouse.move(frame.x + frame.width * 0.8, axis);
      await page.mouse.up();
      assert.ok((await cursor(page)) > middle + 10);
      assert.ok((await time(page)) > 0.6);
    },
  },
  "a link opens at its time": {
    how: { webgl: false },
    hash: "#scenario=burger%20pushes%20on&t=4.5",
    look: async (page) => {
      await ready(page);
      assert.equal(await page.textContent(".scenario.open h2"), "burger pushes on");
      assert.equal(await time(page), 4.5);
      await page.evaluate(() => {
        location.hash = "#scenario=burger%20drives%20straight&t=0.5";
      });
      await page.waitForFunction(() => document.querySelector(".readout")?.textContent === "0.50 s");
      assert.equal(await page.textContent(".scenario.open h2"), "burger drives straight");
    },
  },
  "a link tells runs of one name apart": {
    how: { webgl: false },
    hash: "#scenario=burger&n=2&t=0.5",
    look: async (page) => {
      const opened = (/** @type {string} */ file) =>
        page.waitForFunction((name) => document.querySelector(".scenario.open")?.textContent?.includes(name), file);
      await ready(page);
      await opened("second.sim.yml");
      assert.equal(await time(page), 0.5);
      await page.evaluate(() => {
        location.hash = "#scenario=burger&t=0.5";
      });
      await opened("first.sim.yml");
      await page.click("nav.scenarios li a:not([aria-current])");
      await opened("second.sim.yml");
    },
  },
  "links in the frame of a notebook stay in it": {
    look: async (page) => {
      const frame = page.frameLocator("iframe");
      await frame.locator("#suite.open th a").first().click();
      await frame.locator(READY).waitFor();
      await frame.locator("nav.scenarios li a:not([aria-current])").click();
      await frame.locator(".scenario.open h2", { hasText: "burger pushes on" }).waitFor();
      await frame.locator(READY).waitFor();
    },
  },
  "the address tells what is seen": {
    how: { webgl: false },
    look: async (page) => {
      await ready(page);
      await page.click("nav.scenarios li a:not([aria-current])");
      await page.waitForFunction(() => document.querySelector(".scenario.open h2")?.textContent === "burger pushes on");
      await ready(page);
      await page.locator("input[type=range]").fill("2.25");
      await page.waitForFunction(() => location.hash === "#scenario=burger%20pushes%20on&t=2.25");
    },
  },
  "keys do what buttons do": {
    look: async (page) => {
      await ready(page);
      await page.keyboard.press("Home");
      assert.equal(await time(page), 0);
      await page.keyboard.press("ArrowRight");
      assert.ok(Math.abs((await time(page)) - 1 / 30) < 0.006);
      await page.keyboard.press("End");
      const end = await time(page);
      await page.keyboard.press("Home");
      await page.keyboard.press("1");
      assert.ok(Math.abs((await time(page)) - end) < 0.02);
      await page.keyboard.press("f");
      assert.equal(await page.getAttribute(".tools [aria-pressed]", "aria-pressed"), "true");
      await page.keyboard.press("Home");
      await page.keyboard.press("Space");
      await page.waitForFunction(() => Number.parseFloat(document.querySelector(".readout")?.textContent ?? "") > 0.2);
      await page.keyboard.press("Space");
      await page.keyboard.press("v");
      await page.waitForSelector(".view canvas[data-kind=top]");
    },
  },
  "each key stays with its word": {
    how: { width: 1100, height: 700 },
    look: async (page) => {
      await ready(page);
      const pairs = await page.$$eval(".keys > *", (all) => all.map((one) => [one.textContent, one.getClientRects().length]));
      assert.deepEqual(pairs[pairs.length - 1], ["? all keys", 1]);
      // They take more than one line here.
      const lines = await page.$$eval(".keys > *", (all) => new Set(all.map((one) => one.getBoundingClientRect().top)).size);
      assert.equal(lines, 2);
    },
  },
  "every button has the focus in turn, and shows it": {
    how: { webgl: false },
    look: async (page) => {
      await ready(page);
      const met = new Set();
      for (let i = 0; i < 40; i++) {
        await page.keyboard.press("Tab");
        met.add(await page.evaluate(() => {
          const { activeElement } = document;
          const outlined = activeElement && getComputedStyle(activeElement).outlineStyle !== "none";
          return outlined ? activeElement.getAttribute("aria-label") ?? activeElement.textContent : "";
        }));
      }
      for (const words of ["Play", "Time", "Speed", "Follow", "Copy"]) assert.ok(met.has(words), `no focus on ${words}`);
    },
  },
  "without WebGL it is seen from above": {
    how: { webgl: false },
    look: async (page) => {
      await ready(page);
      assert.equal(await kind(page), "top");
      assert.match((await page.textContent(".note")) ?? "", /no WebGL/);
      await replays(page);
    },
  },
  "without the viewer it is seen from above": {
    look: async (page) => {
      await ready(page);
      assert.equal(await kind(page), "top");
      assert.match((await page.textContent(".note")) ?? "", /without the 3D viewer/);
      await replays(page);
    },
  },
  "hostile names stay text": {
    look: async (page) => {
      await ready(page);
      assert.equal(await page.$("img:not(.picture), iframe, object, b:not(.title b):not(.remarks b)"), null);
      assert.equal(await page.evaluate(() => Reflect.get(globalThis, "pwned")), undefined);
      assert.match(await text(page), /<\/script><img src=x onerror=/);
      assert.match((await page.textContent(".happening")) ?? "", /<\/script>/);
      const marks = await page.evaluate(() => /[\u202a-\u202e\u2066-\u2069\u2028]/.test(document.documentElement.textContent ?? ""));
      assert.equal(marks, false);
    },
  },
  "places and times far from zero stop nothing": {
    how: { webgl: false },
    hash: "#scenario=far",
    look: async (page) => {
      await ready(page);
      assert.equal(await kind(page), "top");
      assert.ok((await page.$$(".plot")).length > 0);
    },
  },
  "with scripts blocked verdict and drawing are there": {
    how: { scripts: false },
    look: async (page) => {
      assert.ok(await page.isVisible("svg.drawing"));
      assert.ok(await page.isVisible("text=base_footprint touched wall"));
      assert.ok(await page.isVisible("text=travelled 0.913 m of 1.5 m in 30.0 s"));
      const box = await page.locator("svg.drawing").first().boundingBox();
      assert.ok(box && box.width > 300 && box.height > 100);
    },
  },
  "a phone has no sideways scroll": {
    how: { width: 390, height: 844 },
    look: async (page) => {
      await ready(page);
      const [wide, seen] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
      assert.equal(wide, seen);
      const small = await page.$$eval("button, select", (all) => all.filter((one) => one.getBoundingClientRect().right > innerWidth + 1).length);
      assert.equal(small, 0);
      await page.keyboard.press("p");
      const inside = await page.$eval("dialog.chooser", (dialog) => {
        const { left, right } = dialog.getBoundingClientRect();
        return left >= 0 && right <= innerWidth;
      });
      assert.ok(inside, "the list of signals is on the screen");
    },
  },
  "a chosen link has a path and a frame": {
    hash: "#scenario=burger%20drives%20straight&t=0.5",
    look: async (page) => {
      await ready(page);
      const before = await picture(page);
      await page.selectOption("select[aria-label=Link]", { label: "base_scan" });
      await drawn(page);
      assert.notEqual(await picture(page), before);
      await page.keyboard.press("v");
      await page.waitForSelector("canvas[data-kind=top]");
      const above = await picture(page);
      await page.selectOption("select[aria-label=Link]", { index: 0 });
      await drawn(page);
      assert.notEqual(await picture(page), above);
    },
  },
  "a point of a sweep opens its run": {
    how: { webgl: false },
    look: async (page) => {
      await page.waitForSelector(".run-point");
      assert.equal(await page.textContent(".scenario.open h2"), "push");
      await page.selectOption("select[aria-label=Across]", { label: "friction" });
      await page.selectOption("select[aria-label=Up]", { label: "yaw" });
      assert.equal((await page.$$(".points .run-point")).length, 30);
      assert.equal((await page.$$(".points .failed")).length, 3);
      const point = page.locator(".points [aria-label^='Run 3,']");
      await point.hover();
      assert.match((await page.textContent(".readout-of-run")) ?? "", /^Run 3, failed: friction 0\.12, yaw -8 deg, smallest margin -26\.67 % open this run$/);
      await point.click();
      await page.waitForFunction(() => document.querySelector(".scenario.open h2")?.textContent === "push[friction=0.12,yaw=-8deg]");
      await ready(page);
      assert.match(await page.evaluate(() => location.hash), /^#scenario=push%5Bfriction%3D0\.12%2Cyaw%3D-8deg%5D/);
      await page.click(".scenario.open header a:text-is('push')");
      await page.waitForSelector(".scenario.open .points");
    },
  },
  "a sweep is used by keys alone": {
    how: { webgl: false },
    look: async (page) => {
      await page.waitForSelector(".run-point");
      await page.focus(".points");
      const name = () => page.$eval("[aria-selected=true]", (one) => one.getAttribute("aria-label"));
      await page.keyboard.press("Home");
      await page.keyboard.press("ArrowRight");
      const met = new Set([await name()]);
      for (let i = 0; i < 29; i++) {
        await page.keyboard.press("ArrowRight");
        met.add(await name());
      }
      for (let i = 0; i < 29; i++) {
        await page.keyboard.press("ArrowLeft");
        met.add(await name());
      }
      assert.equal(met.size, 30);
      await page.selectOption("select[aria-label=Show]", "share");
      await page.focus(".points");
      await page.keyboard.press("Home");
      assert.match((await name()) ?? "", /^\d+ %: \d+ of \d+ passed at /);
      await page.selectOption("select[aria-label=Show]", "runs");
      await page.focus(".points");
      await page.keyboard.press("End");
      const chosen = /** @type {string} */ (await name());
      await page.keyboard.press("Enter");
      await page.waitForFunction(() => document.querySelector(".scenario.open h2")?.textContent !== "push");
      const friction = Number(/friction ([\d.]+)/.exec(chosen)?.[1]);
      assert.ok((await page.textContent(".scenario.open h2"))?.includes(`friction=${friction},`), chosen);
    },
  },
  "with scripts blocked a gate has its verdict and runs": {
    how: { scripts: false },
    look: async (page) => {
      assert.ok(await page.isVisible("svg.bar"));
      assert.ok(await page.isVisible("text=27 of 30 runs passed (90 %)"));
      assert.equal(await page.locator(".runs tbody tr:visible").count(), 20);
      await page.click("text=10 more runs");
      assert.equal(await page.locator(".runs tbody tr:visible").count(), 30);
      assert.equal(await page.isVisible(".sweep"), false);
    },
  },
  "a gate fits on a phone": {
    how: { width: 390, height: 844 },
    look: async (page) => {
      await page.waitForSelector(".run-point");
      const [wide, seen] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
      assert.equal(wide, seen);
    },
  },
  "with scripts blocked each of many has its article": {
    how: { scripts: false },
    look: async (page) => {
      assert.equal(await page.locator("article h2:visible").count(), 67);
      assert.ok(await page.isVisible("#s65 svg.drawing"));
      await page.click("#suite th a >> nth=3");
      assert.match(page.url(), /#s3$/);
    },
  },
  "many are filtered, and open quickly": {
    how: { webgl: false },
    look: async (page) => {
      assert.equal(await page.locator("article h2").count(), 1);
      await page.selectOption("#suite label:has-text('Tag') select", "dock-2");
      assert.equal(await page.textContent("#suite .told"), "22 of 66 shown");
      assert.equal(await page.inputValue("#suite label:has-text('Tag') select"), "dock-2");
      await page.selectOption("#suite label:has-text('Tag') select", "");
      await page.fill("#suite input[type=search]", "dock failed");
      assert.equal(await page.textContent("#suite .told"), "4 of 66 shown");
      await page.fill("#suite input[type=search]", "");
      await ready(page);
      assert.equal((await page.$$("nav.scenarios li a")).length, 66);
      await page.fill("input[type=search]", "number 42");
      assert.equal(await page.locator("nav.scenarios li:not([hidden]) a").count(), 1);
      await page.click("nav.scenarios li:not([hidden]) a");
      await page.waitForFunction(() => document.querySelector(".scenario.open h2")?.textContent === "number 42");
      assert.ok(await page.isVisible(".scenario.open .command button:has-text('Copy')"));
      await page.fill("input[type=search]", "no such thing");
      assert.ok(await page.isVisible("text=No scenario matches."));
    },
  },
};

/** The replay works, whatever draws it. @param {Page} page */
async function replays(page) {
  await page.keyboard.press("Home");
  const seen = await picture(page);
  await page.locator("input[type=range]").fill("0.9");
  assert.notEqual(await picture(page), seen);
}

const [executable] = process.argv.slice(2);
// Whether there is WebGL is decided when a browser starts. A page that is itself drawn by WebGL takes twice the processor.
/** @type {Map<boolean, import("playwright-core").Browser>} */
const browsers = new Map();

/** @param {boolean} webgl */
async function running(webgl) {
  const browser = browsers.get(webgl) ?? (await launch({ executable, webgl, plain: true }));
  browsers.set(webgl, browser);
  return browser;
}

/** @param {string} file @param {string} name */
async function passes(file, name) {
  const check = CHECKS[name];
  assert.ok(check, `there is no check "${name}", but: ${Object.keys(CHECKS).join(", ")}`);
  const webgl = check.how?.webgl ?? true;
  const browser = await running(webgl);
  const isServed = file.startsWith("http://127.0.0.1:");
  const address = (isServed ? file : pathToFileURL(file).href) + (check.hash ?? "");
  const { said, requests } = await visit(address, { executable, browser, ...check.how }, check.look);
  // three.js says itself that there is no WebGL.
  assert.deepEqual(said.filter((line) => webgl || !line.includes("WebGL")), []);
  assert.deepEqual(requests.filter((url) => !isServed || !url.startsWith(file)), [], "something was asked of a network");
}

for await (const line of createInterface({ input: process.stdin })) {
  const [file, ...names] = JSON.parse(line);
  for (const name of names) {
    const error = await passes(file, name).then(() => "", (/** @type {Error} */ problem) => problem.stack ?? String(problem));
    console.log(JSON.stringify([name, error]));
  }
}
for (const browser of browsers.values()) await browser.close();
