/** Checks of another run that is drawn as a ghost. */

import assert from "node:assert/strict";
import { ready, saved } from "../browser.mjs";

/** @typedef {import("playwright-core").Page} Page */

const picture = async (/** @type {Page} */ page) => (await page.locator(".view canvas").screenshot()).toString("base64");
const chosen = (/** @type {Page} */ page) => page.inputValue(".against select");
const word = (/** @type {Page} */ page) => page.evaluate(() => new URLSearchParams(location.hash.slice(1)).get("against"));
const time = async (/** @type {Page} */ page) => Number.parseFloat((await page.textContent(".readout")) ?? "");

/** @param {Page} page @param {string} label */
async function isDrawn(page, label) {
  await ready(page);
  await page.waitForFunction((name) => {
    const list = document.querySelector(".against select");
    return list instanceof HTMLSelectElement && list.value === name && document.querySelector(".against .swatch")?.hasAttribute("hidden") === !name;
  }, label);
}

/** @type {Record<string, {hash?: string, how?: {width?: number, height?: number, dark?: boolean}, look: (page: Page) => Promise<void>}>} */
export const GHOSTS = {
  "a survivor plays with the run without a fault as a ghost": {
    hash: "#scenario=burger%20(scaled%3Ax2)&t=2",
    look: async (page) => {
      await isDrawn(page, "the run without the fault");
      assert.match((await page.textContent(".against button")) ?? "", /^The motions part at [\d.]+ s, by more than 5 mm$/);
      const before = await picture(page);
      await page.keyboard.press("g");
      await isDrawn(page, "");
      assert.notEqual(await picture(page), before);
      await page.click('nav a[href="#scenario=burger"]');
      await ready(page);
      assert.equal(await page.isVisible(".against"), false);
    },
  },
  "a phone has room for a finding": {
    how: { width: 390, height: 844 },
    look: async (page) => {
      await ready(page);
      const widths = await page.$$eval("td[data-title=Finding]", (all) => all.map((one) => one.getBoundingClientRect().width).filter(Boolean));
      assert.ok(widths.length > 0);
      assert.ok(Math.min(...widths) >= 150, `the cells are ${widths} px wide`);
    },
  },
  "the base run is a ghost, by mouse": {
    look: async (page) => {
      await isDrawn(page, "base run");
      assert.match((await page.textContent(".scenario.open .since")) ?? "", /^Since the base run: .*; the motions part at [\d.]+ s, by more than 5 mm; newly fails/);
      assert.ok(await page.isVisible(".parted"));
      await page.click(".against button");
      const parted = await time(page);
      assert.ok((await page.textContent(".against button"))?.includes(`${parted.toFixed(2)} s`));
      assert.match((await page.textContent(".plot .value")) ?? "", / · base run \d/);
      for (const kind of ["3d", "top"]) {
        assert.equal(await page.getAttribute(".view canvas", "data-kind"), kind);
        await page.keyboard.press("End");
        const with_ghost = await picture(page);
        await page.selectOption(".against select", "");
        await isDrawn(page, "");
        assert.notEqual(await picture(page), with_ghost);
        assert.equal(await word(page), "");
        await page.selectOption(".against select", "base run");
        await isDrawn(page, "base run");
        assert.equal(await picture(page), with_ghost);
        assert.equal(await word(page), "base run");
        await page.keyboard.press("v");
        await page.waitForFunction((former) => document.querySelector(".view canvas")?.getAttribute("data-kind") !== former, kind);
      }
    },
  },
  "files have the ghost, too": {
    hash: "#scenario=burger%20moves&plots=base.speed",
    look: async (page) => {
      await isDrawn(page, "base run");
      const lines = (await saved(page, () => page.click("text=CSV"))).bytes.toString("utf8").split("\r\n");
      assert.equal(lines[0], "time (s),speed (m/s),speed [base run] (m/s)");
      assert.match(lines[2], /^[\d.]+,0\.5,0\.75$/);
      const height = async () => {
        await page.click(".plot summary");
        return (await saved(page, () => page.click("text=Save as PNG"))).bytes.readUInt32BE(20);
      };
      const with_ghost = await height();
      await page.selectOption(".against select", "");
      await isDrawn(page, "");
      // A line of the legend, twice as large as on the page.
      assert.equal(with_ghost - (await height()), 36);
      assert.equal((await saved(page, () => page.click("text=CSV"))).bytes.toString("utf8").split("\r\n")[0], "time (s),speed (m/s)");
    },
  },
  "a ghost that ended earlier is said to": {
    hash: "#scenario=burger%20goes%20on&plots=base.speed&t=0.5&against=base+run",
    look: async (page) => {
      await isDrawn(page, "base run");
      assert.match((await page.textContent(".against")) ?? "", /It ended at 1\.50 s$/);
      assert.equal(await page.textContent(".plot .value"), "0.5 m/s · base run 0.667 m/s");
      await page.keyboard.press("End");
      assert.equal(await page.textContent(".plot .value"), "0.5 m/s · base run ended");
      await page.keyboard.press("g");
      await isDrawn(page, "");
      assert.doesNotMatch((await page.textContent(".against")) ?? "", /ended/);
    },
  },
  "repetitions are thin lines in views and bands in plots": {
    look: async (page) => {
      /** @type {string[][]} */
      const seen = [];
      for (const name of ["burger", "alone"]) {
        await page.evaluate((hash) => {
          location.hash = hash;
        }, `#scenario=${name}&plots=base.speed&t=0.5`);
        const words = name === "alone" ? "0.5 m/s" : "0.5 m/s · in 3 runs 0.25 m/s to 0.75 m/s";
        const isSaid = (/** @type {string} */ said) => ["h2", ".plot .value"].map((part) => document.querySelector(`.scenario.live ${part}`)?.textContent).join() === said;
        await page.waitForFunction(isSaid, `${name},${words}`);
        await page.waitForSelector(".view canvas[data-kind='3d']");
        seen.push([await picture(page), (await page.locator(".plot .frame canvas").screenshot()).toString("base64")]);
        await page.keyboard.press("v");
        await page.waitForSelector(".view canvas[data-kind=top]");
        seen.push([await picture(page)]);
        if (name === "alone") continue;
        assert.match((await page.getAttribute(".plot .frame canvas", "aria-label")) ?? "", /, band: lowest and highest of 3 runs$/);
        const lines = (await saved(page, () => page.click("text=CSV"))).bytes.toString("utf8").split("\r\n");
        assert.equal(lines[0], "time (s),speed (m/s),speed lowest of 3 runs (m/s),speed highest of 3 runs (m/s)");
        assert.match(lines[2], /^[\d.]+,0\.5,0\.25,0\.75$/);
      }
      seen.slice(0, 2).forEach((pictures, i) => pictures.forEach((one, j) => assert.notEqual(one, seen[2 + i][j])));
    },
  },
  // Numbers that are no numbers would be errors of the console.
  "a robot without shapes has a path": { hash: "#scenario=bare", look: ready },
  "the ghost of an address is drawn, by keys": {
    hash: "#scenario=burger%20moves&against=base+run",
    look: async (page) => {
      await isDrawn(page, "base run");
      await page.keyboard.press("g");
      await isDrawn(page, "");
      assert.ok(!(await page.textContent(".plot .value"))?.includes("base run"));
      await page.reload();
      await isDrawn(page, "");
      await page.keyboard.press("g");
      await isDrawn(page, "base run");
      for (const label of ["", "base run"]) {
        await page.evaluate((word) => {
          location.hash = `#scenario=burger%20moves&t=0.5&against=${encodeURIComponent(word)}`;
        }, label);
        await isDrawn(page, label);
      }
      await page.focus(".against button");
      await page.keyboard.press("Enter");
      assert.ok((await page.textContent(".against button"))?.includes(`${(await time(page)).toFixed(2)} s`));
    },
  },
};
