/** A real browser that looks at a page from the disk: no network, nothing kept, WebGL by the processor. */

import { readFile } from "node:fs/promises";
import { chromium } from "playwright-core";

const QUIET = [
  "--no-sandbox",
  "--disable-gpu-sandbox",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--no-first-run",
];
const WEBGL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
/** WebGL by the processor in a page that is not drawn by way of it, as in a browser without a graphics card. */
const WEBGL_ALONE = ["--enable-unsafe-swiftshader"];
const NO_WEBGL = ["--disable-gpu", "--disable-3d-apis"];

/**
 * Starts a browser.
 * @param {{webgl?: boolean, plain?: boolean, executable: string}} how  plain: pages are not drawn by WebGL, too
 */
export function launch(how) {
  const args = [...QUIET, ...(how.webgl === false ? NO_WEBGL : how.plain ? WEBGL_ALONE : WEBGL)];
  return chromium.launch({ executablePath: how.executable, args });
}

/**
 * Opens a page, hands it to `look`, and tells what the console said and what was asked of the network.
 * @param {string} address
 * @param {{webgl?: boolean, scripts?: boolean, width?: number, height?: number, dark?: boolean, executable: string,
 *   browser?: import("playwright-core").Browser}} how  browser: one that runs, and goes on
 * @param {(page: import("playwright-core").Page) => Promise<void>} look
 */
export async function visit(address, how, look) {
  const browser = how.browser ?? (await launch(how));
  /** @type {import("playwright-core").BrowserContext | undefined} */
  let context;
  try {
    context = await browser.newContext({
      viewport: { width: how.width ?? 1280, height: how.height ?? 900 },
      colorScheme: how.dark ? "dark" : "light",
      javaScriptEnabled: how.scripts ?? true,
      reducedMotion: "reduce",
    });
    // As long as the tests wait: a busy machine decides nothing.
    context.setDefaultTimeout(600_000);
    const page = await context.newPage();
    const said = [];
    const requests = [];
    page.on("console", (message) => message.type() === "error" && said.push(message.text()));
    page.on("pageerror", (error) => said.push(String(error)));
    page.on("request", (request) => requests.push(request.url()));
    page.on("dialog", (dialog) => {
      said.push(`dialog: ${dialog.message()}`);
      void dialog.dismiss();
    });
    await page.goto(address);
    await look(page);
    return { said, requests: requests.filter((url) => !url.startsWith("data:") && url.split("#")[0] !== address.split("#")[0]) };
  } finally {
    await (how.browser ? context?.close() : browser.close());
  }
}

/** Waits until what has changed is drawn. */
export const drawn = (/** @type {import("playwright-core").Page} */ page) =>
  page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

/** The replay of the open scenario, once it is drawn. */
export const READY = ".scenario.live .view canvas[data-kind]";

/**
 * Waits for the replay, after opening the first scenario where the page shows all of them.
 * @param {import("playwright-core").Page} page
 */
export async function ready(page) {
  if (await page.$("#suite.open")) await page.click("#suite th a");
  await page.waitForSelector(READY);
}

/**
 * The file that a click saves.
 * @param {import("playwright-core").Page} page
 * @param {() => Promise<void>} click
 */
export async function saved(page, click) {
  const [download] = await Promise.all([page.waitForEvent("download"), click()]);
  return { name: download.suggestedFilename(), bytes: await readFile(/** @type {string} */ (await download.path())) };
}
