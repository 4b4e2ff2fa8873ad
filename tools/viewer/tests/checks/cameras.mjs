/** Cameras of the view, and what is measured from above. */

import assert from "node:assert/strict";
import { drawn, ready } from "../browser.mjs";


/** @typedef {import("playwright-core").Page} Page */

const word = (/** @type {Page} */ page) => page.evaluate(() => new URLSearchParams(location.hash.slice(1)).get("view"));

/** @type {Record<string, {how?: {width?: number, height?: number}, hash?: string, look: (page: Page) => Promise<void>}>} */
export const CAMERAS = {
  "from above distances are measured": {
    hash: "#scenario=burger%20drives%20straight&t=0.5&view=top",
    look: async (page) => {
      await ready(page);
      assert.equal(await page.inputValue("select[aria-label=View]"), "top");
      await page.waitForSelector(".ruler:not([hidden])");
      const box = await page.locator(".view canvas").boundingBox();
      const bar = await page.locator(".bar-of-scale").boundingBox();
      assert.ok(box && bar);
      const metres = Number.parseFloat((await page.textContent(".ruler span:nth-child(2)")) ?? "");
      const [x, y] = [box.x + box.width / 2 - 50, box.y + box.height / 2];
      await page.mouse.click(x, y);
      await page.mouse.click(x + 100, y);
      const said = /x (-?[\d.]+) m, y (-?[\d.]+) m · distance ([\d.]+) m/.exec((await page.textContent(".place")) ?? "");
      assert.ok(said);
      // To the width of a line.
      assert.ok(Math.abs(Number(said[3]) - (100 * metres) / bar.width) < 0.05 * Number(said[3]), `${said[3]}`);
      await page.mouse.move(x, y);
      const [there] = /-?[\d.]+/.exec((await page.textContent(".place")) ?? "") ?? [];
      assert.ok(Math.abs(Number(said[1]) - Number(there) - Number(said[3])) < 0.01);
    },
  },
  "a body that comes from aside is in view": {
    hash: "#scenario=a&t=0&view=top",
    look: async (page) => {
      for (const side of ["top", "drawing"]) {
        await ready(page);
        await page.selectOption("select[aria-label=View]", side);
        const box = await page.locator(".view canvas").boundingBox();
        assert.ok(box);
        await page.mouse.move(box.x + box.width / 2, box.y + 1);
        const [, y] = /y (-?[\d.]+) m/.exec((await page.textContent(".place")) ?? "") ?? [];
        // It begins at 3 m; another one is 50 m away.
        assert.ok(Number(y) > 2.9 && Number(y) < 6, `${side}: ${y}`);
      }
    },
  },
  "the address tells the camera": {
    hash: "#scenario=burger%20drives%20straight&t=0.5",
    look: async (page) => {
      await ready(page);
      const before = (await page.locator(".view canvas").screenshot()).toString("base64");
      await page.selectOption("select[aria-label=View]", "behind");
      assert.equal(await word(page), "behind");
      assert.equal(await page.getAttribute(".tools [aria-pressed]", "aria-pressed"), "true");
      await drawn(page);
      assert.notEqual((await page.locator(".view canvas").screenshot()).toString("base64"), before);
      await page.locator("select[aria-label=View]").blur();
      await page.keyboard.press("c");
      await page.waitForSelector("canvas[data-kind=top]");
      assert.equal(await word(page), "drawing");
      await page.keyboard.press("c");
      await page.waitForSelector("canvas[data-kind='3d']");
      assert.equal(await word(page), null);
    },
  },
};
