/** The checks of scenarios with many runs: keys that go through folded rows and groups, and the plot over parameters. */

import assert from "node:assert/strict";

/** @typedef {import("playwright-core").Page} Page */

const titled = (/** @type {Page} */ page, /** @type {string} */ name) =>
  page.waitForFunction((words) => document.querySelector(".scenario.open h2")?.textContent === words, name);
const focused = (/** @type {Page} */ page) => page.evaluate(() => document.activeElement?.textContent ?? "");

/** @type {Record<string, {hash?: string, how?: {width: number, height: number}, look: (page: Page) => Promise<void>}>} */
export const GROUPS = {
  "keys go past folded rows, and back": {
    look: async (page) => {
      const names = await page.$$eval("#suite .suite-table > table > tbody > tr:first-child > th > a", (links) => links.map((link) => link.textContent));
      assert.equal(names.length, 4);
      // A fold that is open has links, too.
      await page.$eval("#suite .below details", (fold) => fold.setAttribute("open", ""));
      for (const name of names) {
        await page.keyboard.press("j");
        assert.equal(await focused(page), name);
      }
      for (const name of names.reverse().slice(1)) {
        await page.keyboard.press("k");
        assert.equal(await focused(page), name);
      }
    },
  },
  "a heat map has a cell for each listed value": {
    hash: "#scenario=stop",
    look: async (page) => {
      await page.waitForSelector(".run-point");
      const chosen = { Across: "speed", Up: "friction", Show: "heat map of the mean" };
      for (const [label, option] of Object.entries(chosen)) await page.selectOption(`select[aria-label=${label}]`, { label: option });
      const told = await page.$$eval(".points .cell", (cells) => cells.map((cell) => cell.getAttribute("aria-label") ?? ""));
      assert.equal(told.length, 15);
      assert.ok(told.includes("-6.7 % (mean of smallest margin): 0 of 1 passed at speed 0.4, friction 0.3"), told.join("\n"));
      const labels = await page.$$eval(".points .axes text:not(.name)", (all) => all.map((one) => one.textContent));
      assert.deepEqual(labels.sort(), ["0.1", "0.15", "0.2", "0.3", "0.3", "0.4", "0.5", "0.9"]);
      // The address has the choice, and a page that opens with it restores it.
      await page.selectOption("select[aria-label=Up]", { label: "smallest margin" });
      const address = new URLSearchParams(new URL(page.url()).hash.slice(1));
      assert.deepEqual(["across", "up", "show"].map((key) => address.get(key)), [null, "smallest margin", "margin"]);
      await page.reload();
      await page.waitForSelector(".points .cell");
      const fields = await page.$$eval(".fields select", (all) => all.map((one) => (one instanceof HTMLSelectElement ? one.selectedOptions[0].label : "")));
      assert.deepEqual(fields, ["speed", "smallest margin", "smallest margin", chosen.Show]);
      // A run and back: the choice is still there.
      await page.click("nav.scenarios li li a:has-text('friction=0.9') >> nth=0");
      await page.waitForFunction(() => !document.querySelector(".group.open"));
      await page.click("nav.scenarios a:has-text('All 15 variations')");
      await page.waitForSelector(".points .cell");
      assert.match(page.url(), /show=margin/);
    },
  },
  "keys go into a group that is open": {
    look: async (page) => {
      const press = async (/** @type {string} */ key, /** @type {string} */ name) => {
        await page.keyboard.press(key);
        await titled(page, name);
      };
      const open = (/** @type {string} */ name) => page.evaluate((words) => void (location.hash = `#scenario=${words}`), name);
      await open("stop");
      await titled(page, "stop");
      await press("n", "stop[speed=0.4,friction=0.3]");
      await press("n", "stop[speed=0.4,friction=0.5]");
      await press("k", "stop[speed=0.4,friction=0.3]");
      await open("stop");
      await titled(page, "stop");
      await press("j", "stop[speed=0.4,friction=0.3]");
      // The runs of a gate come only after the gate itself.
      await open("push");
      await titled(page, "push");
      await press("n", "push[friction=0.12,yaw=-8deg]");
      await press("j", "push[friction=0.11,yaw=-9deg]");
      await press("n", "push[friction=0.1,yaw=-10deg]");
      await press("n", "stop[speed=0.4,friction=0.3]");
      await open("push");
      await titled(page, "push");
      await press("k", "stop[speed=0.1,friction=0.9]");
      await press("j", "push");
    },
  },
  "a link to a scenario that is not there says so": {
    hash: "#scenario=no%20such&t=1",
    look: async (page) => {
      const whole = await page.title();
      await page.waitForSelector("#suite.open");
      assert.equal(await page.textContent(".missing:visible"), "No scenario 'no such' in this report.");
      assert.deepEqual(await page.locator("#suite label:has-text('Sort') option").allTextContents().then((all) => all.slice(0, 2)), ["status", "name"]);
      await page.keyboard.press("n");
      await titled(page, "stop[speed=0.4,friction=0.3]");
      assert.equal(await page.title(), `stop[speed=0.4,friction=0.3] · ${whole}`);
      assert.equal(await page.isVisible(".missing"), false);
      await page.keyboard.press("u");
      await page.waitForSelector("#suite.open");
      assert.equal(await page.title(), whole);
    },
  },
  "the filter of the list covers what scrolls below it": {
    how: { width: 1000, height: 500 },
    look: async (page) => {
      await page.$eval("nav.scenarios", (list) => list.scrollTo(0, 300));
      const box = await page.locator("nav.scenarios .filter").boundingBox();
      assert.ok(box);
      const met = await page.evaluate(({ x, y, height, width }) =>
        [[x - 8, y + 4], [x + 30, y - 4], [x + width + 8, y + height], [x + 30, y + height + 2]]
          .map(([left, top]) => document.elementFromPoint(left, top)?.className), box);
      assert.deepEqual(met, ["finder", "finder", "finder", "finder"]);
    },
  },
};
