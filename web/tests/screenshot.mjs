/** `node screenshot.mjs PAGE PICTURE WIDTH HEIGHT BROWSER [dark]`: what somebody sees who opens the page. */

import { pathToFileURL } from "node:url";
import { visit } from "./browser.mjs";

const [file, picture, width, height, executable, dark] = process.argv.slice(2);
const how = { executable, width: Number(width), height: Number(height), dark: dark === "dark" };
await visit(pathToFileURL(file).href, how, async (page) => {
  await page.waitForSelector(".scenario.live .view canvas[data-kind]");
  await page.screenshot({ path: picture });
});
