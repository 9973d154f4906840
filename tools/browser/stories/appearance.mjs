// Light and dark, on a desk, a projector and a phone: every text has the contrast of WCAG AA, every control a name, nothing runs off the side.
import assert from "node:assert";
import { settled, story } from "./helpers.mjs";

// What of the page fails, in words. Texts over pictures of charts are not counted.
function faults() {
  const found = [];
  const rgb = (text) => {
    const canvas = Object.assign(document.createElement("canvas"), { width: 1, height: 1 }).getContext("2d", { willReadFrequently: true });
    canvas.fillStyle = text;
    canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const light = ([r, g, b]) => [r, g, b].map((v) => v / 255).map((v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)).reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const behind = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const colour = rgb(getComputedStyle(e).backgroundColor);
      if (colour[3] > 250) return colour;
    }
    return [255, 255, 255, 255];
  };
  const seen = (e) => e.checkVisibility({ opacityProperty: true, visibilityProperty: true }) && e.getBoundingClientRect().width > 1;
  for (const element of document.querySelectorAll("body *")) {
    const own = [...element.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || !seen(element) || element.closest(":disabled, .unseen, .hold span")) continue;
    const style = getComputedStyle(element);
    const colour = rgb(element.closest("svg") ? style.fill : style.color);
    const [a, b] = [light(colour), light(behind(element))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    const large = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.66 && style.fontWeight >= 700);
    if (ratio < (large ? 3 : 4.5)) found.push(`contrast ${ratio.toFixed(2)}: "${element.textContent.trim().slice(0, 40)}"`);
  }
  for (const control of document.querySelectorAll("button, input, select, summary, a, [tabindex]")) {
    if (!seen(control)) continue;
    const name = control.getAttribute("aria-label") || control.textContent.trim() || control.labels?.[0]?.textContent.trim() || control.title;
    if (!name) found.push(`no name: ${control.outerHTML.slice(0, 80)}`);
  }
  if (document.documentElement.scrollWidth > innerWidth) found.push(`${document.documentElement.scrollWidth - innerWidth} pixels run off the side`);
  return [...new Set(found)];
}

await story("light, dark, phone and projector can be read", { files: { "run.mcap": "hdpe-creep.mcap", "other.mcap": "hdpe-creep.mcap" }, words: ["."], prepare: ({ text }) => text("calibrate", "run.mcap", "--effects", "viscoelastic-wall:1", "--save", "run.model.toml") }, async ({ page: open, shot }) => {
  const fine = async (page, what) => assert.deepEqual(await page.evaluate(faults), [], what);
  const leave = async (page) => { await page.keyboard.press("Escape"); await page.waitForTimeout(150); };
  // A folder opens on its list.
  const listed = async (page, what) => {
    await page.waitForSelector("#runs[open] tbody tr >> nth=1");
    await fine(page, `${what}, the list`);
    await leave(page);
  };
  for (const colorScheme of ["light", "dark"]) {
    const page = await open({ width: 1440, height: 900 }, { colorScheme });
    await listed(page, colorScheme);
    await settled(page);
    await fine(page, `${colorScheme}, the page`);
    await shot(page, `desk-${colorScheme}`);
    await page.keyboard.press("e");
    await fine(page, `${colorScheme}, the catalogue`);
    await leave(page);
    await page.keyboard.press("o");
    await page.waitForSelector("#runs .spark >> nth=1");
    await page.locator("#runs tbody input[type=checkbox]").nth(0).check();
    await page.locator("#runs tbody input[type=checkbox]").nth(1).check();
    await fine(page, `${colorScheme}, the runs`);
    await page.click("#runs button.primary");
    await page.waitForSelector("#compared-table table");
    await fine(page, `${colorScheme}, the comparison`);
    await leave(page);
    await leave(page);
    await page.click("#show-record");
    await fine(page, `${colorScheme}, the recorder`);
    await page.context().close();
  }
  const phone = await open({ width: 390, height: 844 }, { isMobile: true, hasTouch: true, deviceScaleFactor: 2 });
  await listed(phone, "phone");
  await phone.waitForFunction(() => document.querySelectorAll(".chart canvas").length > 1);
  for (const tab of ["evidence", "past", "future", "hands"]) {
    await phone.click(`#tabs [data-tab=${tab}]`);
    await fine(phone, `phone, ${tab}`);
    await shot(phone, `phone-${tab}`);
  }
  const sheet = await phone.locator("#hands").boundingBox();
  assert(sheet.y > 300 && sheet.y + sheet.height <= 845, "the sliders are a sheet from below");
  const projector = await open({ width: 1920, height: 1080 });
  await listed(projector, "projector");
  await settled(projector);
  await fine(projector, "projector");
});
