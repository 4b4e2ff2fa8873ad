/** The checks of scenarios with many runs: keys that go through folded rows and groups, and the plot over parameters. */

import assert from "node:assert/strict";

/** @typedef {import("playwright-core").Page} Page */

const titled = (/** @type {Page} */ page, /** @type {string} */ name) =>
  page.waitForFunction((words) => document.querySelector(".scenario.open h2")?.textContent === words, name);
const focused = (/** @type {Page} */ page) => page.evaluate(() => document.activeElement?.textContent ?? "");

/** @type {Record<string, {hash?: string, look: (page: Page) => Promise<void>}>} */
export const GROUPS = {
  "keys go past folded rows, and back": {
    look: async (page) => {
      const names = await page.$$eval("#suite .suite-table > tbody > tr:first-child > th > a", (links) => links.map((link) => link.textContent));
      assert.equal(names.length, 4);
      // A fold that is open has links, too.
      await page.$eval("#suite .fold details", (fold) => fold.setAttribute("open", ""));
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
};
