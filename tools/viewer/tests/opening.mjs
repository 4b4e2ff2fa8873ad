/** `node opening.mjs PAGE BROWSER`: ms from asking for the page to its table of all runs, or the plots of its only one, the least of three. */

import { pathToFileURL } from "node:url";
import { visit } from "./browser.mjs";

const [file, executable] = process.argv.slice(2);
const times = [];
for (let round = 0; round < 3; round++) {
  await visit("about:blank", { executable }, async (page) => {
    await page.addInitScript(() => {
      const look = () => {
        const plot = document.querySelector(".scenario.live .plot canvas");
        const isDrawn = plot instanceof HTMLCanvasElement && plot.width > 300;
        if (isDrawn || document.querySelector("#suite.open .suite-table")) Reflect.set(globalThis, "shown", performance.now());
        else requestAnimationFrame(look);
      };
      requestAnimationFrame(look);
    });
    await page.goto(pathToFileURL(file).href);
    // Asked in the page itself: what drives it from outside waits until the picture is made, too.
    await page.waitForFunction(() => Reflect.get(globalThis, "shown"));
    times.push(await page.evaluate(() => Reflect.get(globalThis, "shown")));
  });
}
console.log(Math.min(...times));
