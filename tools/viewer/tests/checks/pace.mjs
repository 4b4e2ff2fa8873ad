/** Checks of the view that the processor draws: with fewer pixels while it moves, sharp once it rests. */

import assert from "node:assert/strict";

/** @typedef {import("playwright-core").Page} Page */

const isSharp = () => {
  const canvas = /** @type {HTMLCanvasElement} */ (document.querySelector(".view canvas"));
  return canvas.width === Math.floor(canvas.clientWidth * Math.min(2, devicePixelRatio));
};

/** @type {Record<string, {hash?: string, look: (page: Page) => Promise<void>}>} */
export const PACE = {
  "a moving picture follows, and is sharp at rest": {
    hash: "#scenario=burger%20pushes%20on&t=0",
    look: async (page) => {
      await page.waitForSelector(".scenario.live .view canvas[data-kind='3d']");
      const changes = await page.evaluate(async () => {
        const canvas = /** @type {HTMLCanvasElement} */ (document.querySelector(".view canvas"));
        const slider = /** @type {HTMLInputElement} */ (document.querySelector(".track input"));
        const widths = new Set();
        const written = new Set();
        for (let i = 1; i <= 12; i++) {
          slider.value = String(i / 10);
          slider.dispatchEvent(new Event("input"));
          await new Promise((done) => requestAnimationFrame(done));
          widths.add(canvas.width);
          written.add(location.hash);
        }
        return { widths: [...widths], written: written.size };
      });
      assert.ok(Math.min(...changes.widths) < Math.max(...changes.widths), String(changes.widths));
      assert.ok(changes.written < 12, "the address follows every frame");
      await page.waitForFunction(isSharp);
      await page.waitForFunction(() => location.hash.includes("t=1.2"));
    },
  },
};
