/** The checks of what sensors saw: scans, forces, pictures and the menu of layers. */

import assert from "node:assert/strict";
import { drawn, ready } from "../browser.mjs";

/** @typedef {import("playwright-core").Page} Page */

const word = (/** @type {Page} */ page) => page.evaluate(() => new URLSearchParams(location.hash.slice(1)).get("layers"));
const picture = async (/** @type {Page} */ page) => (await page.locator(".view canvas").screenshot()).toString("base64");
const box = (/** @type {Page} */ page, /** @type {string} */ label) => page.locator(".layers label", { hasText: label }).locator("input");

/** @type {Record<string, {how?: object, hash?: string, look: (page: Page) => Promise<void>}>} */
export const SEEN = {
  "layers are chosen by keys, and the address keeps them": {
    hash: "#scenario=a&t=1",
    look: async (page) => {
      await ready(page);
      for (const label of ["Lidar points", "Contact forces", "Pictures"]) assert.ok(await box(page, label).isChecked(), label);
      assert.equal(await box(page, "Lidar rays").isChecked(), false);
      const before = await picture(page);
      await page.keyboard.press("l");
      assert.ok(await page.evaluate(() => {
        const boxes = [".layers div", ".view"].map((name) => document.querySelector(name)?.getBoundingClientRect());
        return boxes[0] && boxes[1] && boxes[0].left >= boxes[1].left && boxes[0].right <= boxes[1].right;
      }), "the menu is inside the view");
      await page.keyboard.press("Tab");
      await page.keyboard.press("Space");
      await page.keyboard.press("Escape");
      assert.equal(await page.locator(".layers").getAttribute("open"), null);
      assert.match((await word(page)) ?? "", /rays/);
      await drawn(page);
      assert.notEqual(await picture(page), before);
      await page.reload();
      await ready(page);
      assert.ok(await box(page, "Lidar rays").isChecked());
    },
  },
  "sensors are in step with the clock": {
    hash: "#scenario=a&t=0",
    look: async (page) => {
      await ready(page);
      const said = async () => (await page.locator(".sensed p:visible").allTextContents()).join("\n");
      const swatches = () => page.locator(".sensed .swatch:visible").evaluateAll((all) => all.map((one) => getComputedStyle(one).backgroundColor));
      assert.match(await said(), /^front \(lidar\): nearest 0\.50 m, 90 deg to the left; 1 ray too near to measure \(every 2nd scan is shown\)\nCommanded path\nArrows of contact forces: 0\.1 m is 2 N$/);
      // The colours of the points of the first lidar, and of the commanded path.
      assert.deepEqual(await swatches(), ["rgb(184, 92, 0)", "rgb(111, 100, 0)"]);
      assert.equal(await page.getAttribute(".picture", "alt"), "Picture of eye at 0.00 s");
      const width = await page.$eval(".picture", (image) => image.getBoundingClientRect().width);
      await page.locator("input[type=range]").first().fill("1.95");
      await drawn(page);
      assert.match(await said(), /nearest 0\.30 m, straight ahead/);
      assert.equal(await page.getAttribute(".picture", "alt"), "Picture of eye at 1.50 s");
      assert.ok(await page.$eval(".picture", (image) => image instanceof HTMLImageElement && image.naturalWidth === 4));
      await page.click(".pictures button");
      assert.ok((await page.$eval(".picture", (image) => image.getBoundingClientRect().width)) > 2 * width);
      await page.keyboard.press("v");
      await page.waitForSelector("canvas[data-kind=top]");
      await drawn(page);
      const before = await picture(page);
      await box(page, "Contact forces").evaluate((input) => input instanceof HTMLElement && input.click());
      await drawn(page);
      assert.notEqual(await picture(page), before);
      assert.doesNotMatch(await said(), /Arrows/);
      await box(page, "Commanded path").evaluate((input) => input instanceof HTMLElement && input.click());
      await box(page, "Lidar points").evaluate((input) => input instanceof HTMLElement && input.click());
      await drawn(page);
      assert.doesNotMatch(await said(), /Commanded/);
      assert.deepEqual(await swatches(), []);
    },
  },
  "with scripts blocked an article says which sensor saw what": {
    how: { scripts: false },
    look: async (page) => {
      const said = await page.evaluate(() => document.querySelector(".sightings")?.textContent);
      assert.match(said ?? "", /wall was first seen by front \(lidar\) at 0\.00 s, 1\.2 m away straight ahead; the robot touched it at 1\.90 s, 1\.90 s later\./);
      assert.match(said ?? "", /no controller or expectation reads it: rear\./);
    },
  },
};
