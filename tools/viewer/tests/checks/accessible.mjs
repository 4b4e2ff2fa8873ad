/** The check of accessibility by axe: the page as it opens, and its first scenario, on a light desktop and a dark phone. */

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { ready } from "../browser.mjs";

/** @typedef {import("playwright-core").Page} Page */

const AXE = createRequire(import.meta.url).resolve("axe-core/axe.min.js");
const SCREENS = /** @type {const} */ ([
  { width: 1280, height: 900, scheme: "light" },
  { width: 390, height: 844, scheme: "dark" },
]);

/** The rules that are broken, each with the elements that break it. @param {Page} page */
export async function broken(page) {
  // The policy of the page lets no script element in.
  await page.evaluate(await readFile(AXE, "utf8"));
  const { violations } = /** @type {import("axe-core").AxeResults} */ (await page.evaluate("axe.run({ resultTypes: ['violations'] })"));
  return violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target, html }) => `${target} ${html.slice(0, 120)}`).join(" | ")}`);
}

/** @type {Record<string, {look: (page: Page) => Promise<void>}>} */
export const ACCESSIBLE = {
  "axe finds nothing": {
    look: async (page) => {
      const found = [];
      const isSuite = await page.$("#suite.open");
      for (const opened of isSuite ? ["suite", "scenario"] : ["scenario"]) {
        if (await page.$("article.group.open")) await page.waitForSelector(".run-point");
        else if (opened === "scenario") await ready(page);
        for (const { scheme, ...size } of SCREENS) {
          await page.setViewportSize(size);
          await page.emulateMedia({ colorScheme: scheme });
          found.push(...(await broken(page)).map((words) => `${opened}, ${scheme}: ${words}`));
        }
        await page.setViewportSize(SCREENS[0]);
      }
      assert.deepEqual(found, []);
    },
  },
};
