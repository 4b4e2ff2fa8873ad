/** The checks of the way from all scenarios to one moment of a run: by mouse, by keys alone, and by its address. */

import assert from "node:assert/strict";
import { READY } from "../browser.mjs";

/** @typedef {import("playwright-core").Page} Page */

const MAX_STOPS = 5;
const SHOWN = "nav.scenarios li:not([hidden]) a";

const title = (/** @type {Page} */ page) => page.textContent(".scenario.open h2");
const titled = (/** @type {Page} */ page, /** @type {string} */ name) =>
  page.waitForFunction((words) => document.querySelector(".scenario.open h2")?.textContent === words, name);
const named = (/** @type {Page} */ page, /** @type {string} */ name) =>
  assert.equal(new URLSearchParams(new URL(page.url()).hash.slice(1)).get("scenario"), name);
const rows = (/** @type {Page} */ page) => page.locator("#suite .suite-table > table > tbody:visible").count();

/** What a reader sees. @param {Page} page */
async function state(page) {
  await page.waitForSelector(".against .swatch:visible");
  return {
    scenario: await title(page),
    time: await page.textContent(".readout"),
    plots: await page.$$eval(".plot", (plots) => plots.map((plot) => [...plot.querySelectorAll(".title b")].map((name) => name.textContent))),
    ghost: await page.inputValue(".against select"),
    parted: await page.textContent(".against button"),
    list: await page.$$eval(SHOWN, (links) => links.map((link) => link.textContent)),
  };
}

/** The tab stops from the start of the page to the open article. @param {Page} page */
async function stopsBefore(page) {
  for (let stops = 0; stops < 20; stops++) {
    await page.keyboard.press("Tab");
    if (await page.evaluate(() => document.activeElement?.closest(".scenario.open"))) return stops;
  }
  return Infinity;
}

/** Opens the address of a page anew, and goes on from there. @param {Page} page */
async function openedAnew(page) {
  const seen = await state(page);
  assert.deepEqual(seen.plots[0], ["yaw", "speed"]);
  assert.equal(seen.ghost, "base run");
  assert.equal(seen.list.length, 4);
  const fresh = await page.context().newPage();
  const address = page.url();
  await page.close();
  await fresh.goto(address);
  await fresh.waitForSelector(READY);
  assert.deepEqual(await state(fresh), seen);
  assert.ok((await stopsBefore(fresh)) <= MAX_STOPS);
  // The next failure of the same filter, and all of them.
  await fresh.keyboard.press("n");
  await titled(fresh, "number 42");
  assert.equal(await fresh.locator(SHOWN).count(), 4);
  await fresh.keyboard.press("u");
  await fresh.waitForSelector("#suite.open");
  assert.equal(await rows(fresh), 4);
  assert.equal(await fresh.getAttribute("#suite .chips button", "aria-pressed"), "true");
}

const names = (/** @type {Page} */ page) =>
  page.$$eval("#suite .suite-table > table > tbody:not(.group-title) > tr:first-child > th > a", (links) => links.map((link) => link.textContent));
const groupTitles = (/** @type {Page} */ page) => page.$$eval("#suite .group-title th", (titles) => titles.map((title) => title.textContent));
const sorted = (/** @type {Page} */ page) =>
  page.$$eval("#suite thead th[aria-sort]", (titles) => titles.map((title) => `${title.getAttribute("data-sort")} ${title.getAttribute("aria-sort")}`));
const arranged = async (/** @type {Page} */ page) => [await names(page), await groupTitles(page), await sorted(page)];

/** @type {Record<string, {how?: {webgl?: boolean, width?: number, height?: number}, look: (page: Page) => Promise<void>}>} */
export const SUITE = {
  "from all scenarios to one moment, by mouse": {
    how: { width: 1000, height: 600 },
    look: async (page) => {
      assert.equal(await rows(page), 66);
      await page.click("#suite .chips button:has-text('failed')");
      assert.equal(await rows(page), 4);
      await page.click("#suite tbody:visible th a");
      await titled(page, "number 0");
      named(page, "number 0");
      await page.click(`${SHOWN} >> nth=1`);
      await titled(page, "number 21");
      await page.waitForSelector(READY);
      // The focus is on the link.
      await page.keyboard.press("Space");
      await page.waitForSelector("[aria-label=Pause]");
      await page.keyboard.press("Space");
      const slider = await page.locator(".player input[type=range]").boundingBox();
      assert.ok(slider);
      await page.mouse.click(slider.x + slider.width / 4, slider.y + slider.height / 2);
      await page.click("text=Add a plot");
      await page.click("[data-key='base.yaw']");
      await page.click("[data-key='base.speed']");
      await page.click("dialog .foot button");
      await page.selectOption(".against select", "");
      await page.selectOption(".against select", "base run");
      await openedAnew(page);
    },
  },
  "from all scenarios to one moment, by keys alone": {
    // Drawn from above it takes less time, and the keys are the same.
    how: { webgl: false },
    look: async (page) => {
      assert.ok((await stopsBefore(page)) <= MAX_STOPS);
      assert.match(await page.evaluate(() => document.activeElement?.textContent ?? ""), /4 failed/);
      await page.keyboard.press("Space");
      assert.equal(await rows(page), 4);
      for (const name of ["number 0", "number 21"]) {
        await page.keyboard.press("n");
        await titled(page, name);
        named(page, name);
      }
      await page.waitForSelector(READY);
      await page.keyboard.press("Home");
      await page.keyboard.press("Shift+ArrowRight");
      await page.keyboard.press("ArrowRight");
      await page.keyboard.press("p");
      for (const words of ["base yaw", "base speed"]) {
        await page.keyboard.press("Control+a");
        await page.keyboard.type(words);
        await page.keyboard.press("Enter");
      }
      await page.keyboard.press("Escape");
      await page.keyboard.press("g");
      await page.waitForSelector(".against .swatch", { state: "hidden" });
      await page.keyboard.press("g");
      await openedAnew(page);
    },
  },
  "many are sorted and grouped, and the address keeps it": {
    how: { webgl: false },
    look: async (page) => {
      const choose = (/** @type {string} */ label, /** @type {string} */ value) => page.selectOption(`#suite label:has-text('${label}') select`, value);
      const click = (/** @type {string} */ key) => page.click(`#suite thead th[data-sort=${key}] button`);
      await choose("Sort", "name");
      const rising = Array.from({ length: 66 }, (_, number) => `number ${number}`);
      assert.deepEqual(await names(page), rising);
      assert.deepEqual(await sorted(page), ["name ascending"]);
      await click("name");
      assert.deepEqual(await names(page), [...rising].reverse());
      assert.deepEqual(await sorted(page), ["name descending"]);
      assert.equal(await page.inputValue("#suite label:has-text('Sort') select"), "name");
      // The longest first, then the shortest; one has no time.
      const timed = rising.filter((name) => name !== "number 5");
      await click("sim");
      assert.deepEqual(await names(page), [...[...timed].reverse(), "number 5"]);
      assert.deepEqual(await sorted(page), ["sim descending"]);
      await click("sim");
      assert.deepEqual(await names(page), [...timed, "number 5"]);
      assert.deepEqual(await sorted(page), ["sim ascending"]);
      await choose("Group by", "folder");
      assert.deepEqual(await groupTitles(page), ["even/ 33, 2 did not pass", "odd/ 33, 2 did not pass"]);
      const seen = await arranged(page);
      await page.reload();
      await page.waitForSelector("#suite .group-title");
      assert.deepEqual(await arranged(page), seen);
      // From the row with the focus on, in this order: 0 and 21 are behind it.
      await page.focus("#suite th a:text-is('number 22')");
      await page.keyboard.press("n");
      await titled(page, "number 42");
      await page.keyboard.press("u");
      await page.waitForSelector("#suite.open");
      await page.fill("#suite input[type=search]", "newly fails");
      assert.equal(await rows(page), 6);
      await page.fill("#suite input[type=search]", "");
      await page.click("#suite .chips button:has-text('failed')");
      assert.deepEqual(await groupTitles(page), ["even/ 2, 2 did not pass", "odd/ 2, 2 did not pass"]);
    },
  },
};
