/** The checks of pages in frames, and of pages that a server on this machine gives. */

import assert from "node:assert/strict";
import { ready } from "../browser.mjs";
import { broken } from "./accessible.mjs";

/** @typedef {import("playwright-core").Page} Page */

const READY = ".scenario.live .view canvas[data-kind]";
const hash = (/** @type {Page} */ page) => page.evaluate(() => location.hash);

/** @type {Record<string, {how?: {width?: number, height?: number}, hash?: string, look: (page: Page) => Promise<void>}>} */
export const FRAMES = {
  "embedded there is only the player": {
    hash: "#embed&scenario=burger%20pushes%20on&t=1.5",
    how: { width: 320, height: 300 },
    look: async (page) => {
      await ready(page);
      const address = await hash(page);
      assert.equal(await page.textContent(".readout"), "1.50 s");
      for (const hidden of ["nav.scenarios", ".run p", ".plots", ".keys", ".expectations", ".reasons"]) {
        assert.equal(await page.locator(`${hidden}:visible`).count(), 0, hidden);
      }
      const beyond = await page.evaluate(() =>
        [...document.querySelectorAll(".view, .view canvas, .controls, .controls button, h2, .tools button")]
          .filter((one) => one.checkVisibility())
          .filter((one) => one.getBoundingClientRect().right > innerWidth + 1 || one.getBoundingClientRect().bottom > innerHeight + 1).length);
      assert.equal(beyond, 0);
      const view = await page.locator(".view").boundingBox();
      assert.ok(view && view.width === 320 && view.height > 150);
      assert.equal(await page.evaluate(() => document.activeElement?.tagName), "BODY");
      await page.keyboard.press("ArrowRight");
      assert.notEqual(await page.textContent(".readout"), "1.50 s");
      assert.equal(await hash(page), address);
      await page.locator("h2 a").focus();
      await page.keyboard.press("Shift");
      const link = (await page.getAttribute("h2 a", "href")) ?? "";
      assert.match(link, /report\.html#scenario=burger%20pushes%20on&t=1\.533$/);
      assert.equal(await page.getAttribute("h2 a", "target"), "_blank");
    },
  },
  "embedded the picture begins below the name": {
    hash: "#embed&scenario=burger%20pushes%20on&t=1.5",
    how: { width: 600, height: 420 },
    look: async (page) => {
      await ready(page);
      const [name, view, tools] = await Promise.all(["h2", ".view", ".tools"].map((part) => page.locator(`.scenario.open ${part}`).boundingBox()));
      assert.ok(name && view && tools);
      assert.ok(view.y - (name.y + name.height) < 12, `${view.y - name.y - name.height} px`);
      assert.ok(tools.y >= view.y);
      assert.equal(await page.title(), "burger pushes on · 2 of 2 scenarios did not pass · sim-action");
      assert.deepEqual(await broken(page), []);
      await page.evaluate(() => {
        location.hash = "#embed&scenario=no%20such";
      });
      await page.waitForSelector("text=No scenario 'no such' in this report.");
      assert.equal(await page.locator(".scenario:visible").count(), 0);
    },
  },
  "a frame without rights plays": {
    look: async (page) => {
      const frame = page.frameLocator("iframe");
      await frame.locator(READY).waitFor();
      await frame.locator("input[type=range]").fill("0.5");
      assert.equal(await frame.locator(".readout").textContent(), "0.50 s");
      assert.equal(await frame.locator("h2 a").count(), 0);
      assert.equal(await frame.locator(".plots:visible").count(), 0);
    },
  },
  "progress leads to a report that offers what is new": {
    look: async (page) => {
      await page.click("#live-lists a");
      await ready(page);
      await page.locator("input[type=range]").fill("0.9");
      const address = await hash(page);
      assert.match(address, /scenario=cart&t=0\.9/);
      await page.click("#live-update");
      await page.waitForFunction(() => document.querySelectorAll("article").length === 3);
      await ready(page);
      assert.equal(await hash(page), address);
      assert.equal(await page.textContent(".readout"), "0.90 s");
      await page.click("text=Progress");
      await page.waitForFunction(() => document.querySelector("#live-title")?.textContent === "The run has ended: 2 of 2 scenarios finished");
      await page.setViewportSize({ width: 390, height: 844 });
      const [wide, seen] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
      assert.equal(wide, seen);
    },
  },
};
