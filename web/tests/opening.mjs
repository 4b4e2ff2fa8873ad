/** `node opening.mjs PAGE BROWSER`: ms from asking for the page to the picture of its first run, the least of three. */

import { pathToFileURL } from "node:url";
import { visit } from "./browser.mjs";

const [file, executable] = process.argv.slice(2);
const times = [];
for (let round = 0; round < 3; round++) {
  await visit("about:blank", { executable }, async (page) => {
    const started = performance.now();
    await page.goto(pathToFileURL(file).href);
    await page.waitForSelector(".scenario.live .view canvas[data-kind]");
    times.push(performance.now() - started);
  });
}
console.log(Math.min(...times));
