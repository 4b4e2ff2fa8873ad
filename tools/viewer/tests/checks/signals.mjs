/** The checks of plots: the choice of signals, zoom, values, files and the address. */

import assert from "node:assert/strict";
import { ready, saved } from "../browser.mjs";

/** @typedef {import("playwright-core").Page} Page */

const hash = (/** @type {Page} */ page) => page.evaluate(() => new URLSearchParams(location.hash.slice(1)));
const word = async (/** @type {Page} */ page, /** @type {string} */ key) =>
  page.evaluate((name) => new URLSearchParams(location.hash.slice(1)).get(name), key);
const names = (/** @type {Page} */ page) => page.$$eval(".plot", (plots) => plots.map((plot) => [...plot.querySelectorAll(".title b")].map((name) => name.textContent)));
const first = (/** @type {Page} */ page) => page.locator(".plot").first();

/** Drags in the area of the first plot, between two shares of its width. @param {Page} page @param {number} from @param {number} to */
async function drag(page, from, to) {
  const box = await first(page).locator(".frame").boundingBox();
  assert.ok(box);
  await page.mouse.move(box.x + box.width * from, box.y + 40);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * to, box.y + 40, { steps: 3 });
  await page.mouse.up();
}

/** The words that each plot has on its canvas, with their places. @param {Page} page */
async function written(page) {
  await page.evaluate(() => {
    const all = Reflect.set(globalThis, "written", new Map()) && Reflect.get(globalThis, "written");
    const write = CanvasRenderingContext2D.prototype.fillText;
    CanvasRenderingContext2D.prototype.fillText = function (words, x, y, most = Infinity) {
      const width = Math.min(most, this.measureText(words).width);
      const left = x - width * { left: 0, start: 0, center: 0.5, right: 1, end: 1 }[this.textAlign];
      const top = y - (this.textBaseline === "top" ? -1 : this.textBaseline === "middle" ? 4 : 9);
      all.set(this.canvas, [...(all.get(this.canvas) ?? []), { words, left, right: left + width, top, bottom: top + 8 }]);
      write.call(this, words, x, y, most);
    };
  });
  await page.keyboard.press("0");
  return page.$$eval(".plot .frame canvas", (plots) =>
    plots.map((canvas) => /** @type {(Box & {words: string})[]} */ (Reflect.get(globalThis, "written").get(canvas))));
}

/** @type {Record<string, {how?: {webgl?: boolean, width?: number, height?: number, dark?: boolean}, hash?: string, look: (page: Page) => Promise<void>}>} */
export const SIGNALS = {
  "signals are chosen by mouse": {
    how: { webgl: false },
    hash: "#scenario=burger%20drives%20straight&t=0.5",
    look: async (page) => {
      await ready(page);
      const before = (await names(page)).length;
      await page.click("text=Add a plot");
      await page.click("[role=option]:has-text('base_scan z')");
      await page.click("[data-key='base.yaw']");
      await page.click("[data-key='base.speed']");
      await page.click("dialog .foot button");
      // A third unit has a plot of its own.
      assert.deepEqual((await names(page)).slice(0, 2), [["base_scan z", "yaw"], ["speed"]]);
      assert.match((await first(page).textContent()) ?? "", /base_scan z \(m\)0\.1\d* m/);
      assert.ok((await word(page, "plots"))?.startsWith("links.base_scan z,base.yaw;base.speed;"));
      await first(page).locator("summary").click();
      await page.click("text=Remove yaw");
      await page.locator(".plot").nth(1).locator("summary").click();
      await page.locator(".plot").nth(1).locator("text=Remove this plot").click();
      assert.equal((await names(page)).length, before + 1);
    },
  },
  "signals are chosen by keys alone": {
    how: { webgl: false },
    look: async (page) => {
      await ready(page);
      const before = await word(page, "plots");
      await page.keyboard.press("p");
      await page.keyboard.type("base yaw");
      await page.keyboard.press("Enter");
      await page.keyboard.press("Control+a");
      await page.keyboard.type("base");
      await page.keyboard.press("ArrowDown");
      await page.keyboard.press("ArrowDown");
      await page.keyboard.press("Enter");
      await page.keyboard.press("Escape");
      assert.deepEqual((await names(page))[0], ["yaw", "tilt"]);
      assert.equal(before, null);
      await page.keyboard.press("Home");
      await page.keyboard.press("+");
      assert.equal(await page.isVisible("text=Whole run"), true);
      await page.keyboard.press("0");
      assert.equal(await page.isVisible("text=Whole run"), false);
      assert.equal(await word(page, "zoom"), null);
    },
  },
  "a drag zooms all plots, and the address restores them": {
    how: { webgl: false },
    hash: "#scenario=burger%20pushes%20on&t=4.5&plots=base.speed,base.tilt;base.x",
    look: async (page) => {
      await ready(page);
      assert.deepEqual(await names(page), [["speed", "tilt"], ["x"]]);
      const time = await page.textContent(".readout");
      await drag(page, 0.3, 0.6);
      assert.equal(await page.textContent(".readout"), time);
      const zoom = /^([\d.]+)-([\d.]+)$/.exec((await word(page, "zoom")) ?? "");
      assert.ok(zoom && Number(zoom[1]) > 3 && Number(zoom[2]) < 25, String(await hash(page)));
      // The time under the pointer is one of the shown range.
      const pointed = Number.parseFloat((await first(page).locator(".hover").textContent()) ?? "");
      assert.ok(Math.abs((pointed - Number(zoom[1])) / (Number(zoom[2]) - Number(zoom[1])) - 0.6) < 0.1, `${pointed} of ${zoom[0]}`);
      await page.reload();
      await ready(page);
      assert.deepEqual(await names(page), [["speed", "tilt"], ["x"]]);
      assert.equal(await page.isVisible("text=Whole run"), true);
      const { name, bytes } = await saved(page, () => page.click("text=CSV"));
      assert.equal(name, "burger-pushes-on.csv");
      const [head, ...rows] = bytes.toString("utf8").split("\r\n");
      assert.equal(head, "time (s),speed (m/s),tilt (rad),x (m)");
      assert.equal(rows.pop(), "");
      const times = rows.map((row) => Number(row.split(",")[0]));
      assert.ok(times[0] >= Number(zoom[1]) - 1e-3 && times[times.length - 1] <= Number(zoom[2]) + 1e-3);
      assert.ok(rows.length > 100 && rows.every((row) => row.split(",").length === 4 && !row.includes("0000000")));
      await first(page).locator("summary").click();
      const drawn = await saved(page, () => page.click("text=Save as PNG"));
      assert.equal(drawn.name, "burger-pushes-on-speed.png");
      assert.equal(drawn.bytes.subarray(1, 4).toString(), "PNG");
      await page.locator(".plot .frame").first().dblclick();
      assert.equal(await word(page, "zoom"), null);
    },
  },
  "a joint is plotted with its command": {
    how: { webgl: false },
    hash: "#scenario=burger&t=1&plots=joints.wheel_joint",
    look: async (page) => {
      await ready(page);
      const said = (await page.locator(".plot .value").first().textContent()) ?? "";
      assert.match(said, /^286(\.\d)? deg · commanded 315(\.\d)? deg$/);
      const box = await first(page).locator(".frame").boundingBox();
      assert.ok(box);
      await page.mouse.move(box.x + 50, box.y + 20);
      assert.notEqual(await page.locator(".plot .value").first().textContent(), said);
      await page.mouse.move(box.x, box.y - 60);
      assert.equal(await page.locator(".plot .value").first().textContent(), said);
      // Both are found by the words for them.
      await page.keyboard.press("p");
      for (const [typed, found] of [["commanded", "wheel_jointmeasured and commanded, deg"], ["expectations", "1. travelledtravelm"]]) {
        await page.keyboard.press("Control+a");
        await page.keyboard.type(typed);
        assert.deepEqual(await page.locator(".chooser [role=option]").allTextContents(), [found]);
      }
    },
  },
  "words of plots do not overlap, and time axes agree": {
    hash: "#scenario=burger&t=1&plots=expectations.1.%20gap;base.y;base.yaw,base.speed;expectations.1.%20height",
    look: async (page) => {
      await ready(page);
      const plots = await written(page);
      assert.deepEqual(plots.map((all) => all.filter(({ words }) => words === "1 s").length), [1, 1, 1, 1]);
      const places = plots.map((all) => all.find(({ words }) => words === "1 s")?.left);
      assert.equal(new Set(places).size, 1, String(places));
      assert.ok(plots[1].some(({ words }) => /^-0\.000\d$/.test(words)), JSON.stringify(plots[1]));
      for (const all of plots) {
        for (const one of all) {
          assert.ok(one.left >= 0, one.words);
          const met = all.find((other) => other !== one && other.left < one.right && other.right > one.left && other.top < one.bottom && other.bottom > one.top);
          assert.equal(met && `${one.words} meets ${met.words}`, undefined);
        }
      }
      for (const place of [0, 3]) assert.deepEqual(plots[place].filter(({ words }) => /^at/.test(words)).length, 2);
    },
  },
};
