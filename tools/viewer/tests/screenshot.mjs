/** `node screenshot.mjs PAGE PICTURE WIDTH HEIGHT BROWSER [light|dark] [SELECTOR] [HASH]`: a picture of a page, once an element is there. */

import { pathToFileURL } from "node:url";
import { visit } from "./browser.mjs";

const [file, picture, width, height, executable, colours, selector, hash] = process.argv.slice(2);
const how = { executable, width: Number(width), height: Number(height), dark: colours === "dark" };
await visit(pathToFileURL(file).href + (hash ?? ""), how, async (page) => {
  await page.waitForSelector(selector ?? ".scenario.live .view canvas[data-kind]");
  await page.screenshot({ path: picture });
});
