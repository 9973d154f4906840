// Opens the report of a calibration or of a diagnosis in Chromium and checks what a reader relies on.
//
//   npm ci && node check_report.mjs REPORT.html [FOLDER FOR PICTURES [ANSWER.json]]
//
// ANSWER.json is what `diagnose --json` said when it wrote the report: the page must say the same.
// Needs Debian's `chromium` (or CHROMIUM=/path/to/it); `pdftoppm` for pictures of the printed pages. Exit 1 when a check fails.
import { chromium } from "playwright-core";
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { diagnosis, texts } from "./diagnosis.mjs";

const [file, folder = "pictures", answerFile] = process.argv.slice(2);
if (!file || !existsSync(file)) {
  console.error("usage: node check_report.mjs REPORT.html [FOLDER FOR PICTURES [ANSWER.json]]");
  process.exit(2);
}
mkdirSync(folder, { recursive: true });
const answer = answerFile && JSON.parse(readFileSync(answerFile, "utf8"));
const url = pathToFileURL(resolve(file)).href;

let failures = 0;
function check(what, ok, detail = "") {
  console.log(`${ok ? "ok  " : "FAIL"} ${what}${ok || detail === "" ? "" : `: ${detail}`}`);
  if (!ok) failures += 1;
}

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync"],
});

// A page in a context of its own that collects everything a reader should never see.
async function open(options = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, colorScheme: "light", ...options });
  const page = await context.newPage();
  const problems = [], requests = [];
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && problems.push(m.text()));
  page.on("pageerror", (e) => problems.push(String(e)));
  page.on("request", (r) => r.url() !== url && requests.push(r.url()));
  await page.goto(url, { waitUntil: "load" });
  await page.waitForTimeout(300);
  return { page, problems, requests };
}

const picture = (page, name) => page.screenshot({ path: join(folder, name), fullPage: true });
const settled = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));

// Share of canvas pixels that are not transparent.
const inked = (page) => page.$$eval(".plot canvas", (all) => all.map((c) => {
  const { data } = c.getContext("2d").getImageData(0, 0, c.width, c.height);
  let n = 0;
  for (let i = 3; i < data.length; i += 4) n += data[i] > 0;
  return n / (data.length / 4);
}));

const scales = (page, panel) => page.$$eval(`#sensor-${panel} .plot`, (all) => all.map((p) => [p.chart.scales.x.min, p.chart.scales.x.max]));

async function contents(page, problems, requests) {
  const sensors = await page.$$eval("section.sensor", (all) => all.length);
  const panels = JSON.parse(await page.textContent("#data")).panels;
  check("one section a sensor", sensors === panels.length && sensors > 0, `${sensors} sections, ${panels.length} panels`);
  check("the verdict is a sentence", /(RMSE .* m|calibration has no|Predicted to)/.test(await page.textContent(".verdict")));
  const tables = await page.$$eval("section.sensor table", (all) => all.filter((t) => t.tBodies[0].rows.length > 0).length);
  const without = await page.$$eval("section.sensor", (all) => all.filter((s) => s.textContent.includes("No peaks or troughs")).length);
  check("every sensor has its extrema", tables + without === sensors, `${tables} tables`);
  check("parameters and rig are there", await page.$$eval("h2", (all) => ["Parameters", "Rig", "How it was computed"].every((t) => all.some((h) => h.textContent === t))));
  const ink = await inked(page);
  const charts = panels.reduce((sum, panel) => sum + 1 + panel.models.length, 0);
  check("a drawn chart of the head and one of each model's residual a sensor", ink.length === charts && ink.every((share) => share > 0.01), ink.map((s) => s.toFixed(3)).join(" "));
  check("still pictures give way to charts", await page.$$eval(".still", (all) => all.every((s) => getComputedStyle(s).display === "none")));
  check("no console error", problems.length === 0, problems.join(" | "));
  check("no network request", requests.length === 0, requests.join(" | "));
}

async function zoom(page) {
  const same = (a, b) => a.every((r, i) => r.every((v, k) => Math.abs(v - b[i][k]) < 1e-9 * Math.max(1, Math.abs(v))));
  const synced = (all) => all.length > 1 && all.every((one) => one[0] === all[0][0] && one[1] === all[0][1]);
  const full = await scales(page, 0);
  check("all charts start on the whole record", synced(full), JSON.stringify(full));
  for (const name of ["head", "residual"]) {
    const over = page.locator(`#sensor-0 .plot.${name} .u-over`).last();
    await over.scrollIntoViewIfNeeded();
    const box = await over.boundingBox();
    const [y, from, to] = [box.y + box.height / 2, box.x + box.width * 0.05, box.x + box.width * 0.3];
    await page.mouse.move(from, y);
    await page.mouse.down();
    await page.mouse.move((from + to) / 2, y + 3, { steps: 4 });
    await page.mouse.move(to, y + 3, { steps: 4 });
    await page.mouse.up();
    await settled(page);
    const zoomed = await scales(page, 0);
    const span = full[0][1] - full[0][0];
    check(`drag on ${name} zooms all charts alike`, synced(zoomed) && Math.abs((zoomed[0][1] - zoomed[0][0]) / span - 0.25) < 0.02, JSON.stringify(zoomed));
    if (name === "head") {
      await page.mouse.move(box.x + box.width * 0.5, y);
      await settled(page);
      const values = await page.$$eval("#sensor-0 .legend output", (all) => all.filter((o) => /\d m$/.test(o.textContent)).length);
      const lines = await page.$$eval("#sensor-0 .u-cursor-x", (all) => all.filter((c) => !c.classList.contains("u-off") && /translate/.test(c.style.transform)).map((c) => c.style.transform));
      check("the cursor reads values in all charts", values >= 3, `${values} values`);
      check("the cursor moves in all charts", lines.length === full.length && lines.every((line) => line === lines[0]), lines.join(" "));
      await page.locator("#sensor-0").screenshot({ path: join(folder, "zoomed.png") });
    }
    await over.dblclick();
    await settled(page);
    check(`double-click on ${name} shows all again`, same(await scales(page, 0), full), JSON.stringify(await scales(page, 0)));
  }
  await page.getByRole("button", { name: "Zoom in" }).first().click();
  await settled(page);
  const half = await scales(page, 0);
  check("the zoom button halves the range", synced(half) && Math.abs((half[0][1] - half[0][0]) * 2 - (full[0][1] - full[0][0])) < 1e-6, JSON.stringify(half));
  await page.getByRole("button", { name: "Whole record" }).first().click();
  await settled(page);
  check("the whole-record button resets", same(await scales(page, 0), full));
}

async function legend(page) {
  const button = page.locator('#sensor-0 .legend[data-of="head"] button').nth(1);
  const shown = () => page.$eval("#sensor-0 .plot.head", (p) => p.chart.series[2].show);
  const before = await shown();
  await button.click();
  check("a legend button hides its curve", before && !(await shown()) && (await button.getAttribute("aria-pressed")) === "false");
  await button.press("Enter");
  check("the keyboard shows it again", (await shown()) && (await button.getAttribute("aria-pressed")) === "true");
}

// One switch shows every head as its sensor does: charts, legends, tables. A second press brings m back.
async function units(page) {
  const buttons = page.locator(".units button");
  const panels = JSON.parse(await page.textContent("#data")).panels;
  if (panels.every((p) => p.unit === null)) {
    check("no switch where sensors show heads", (await buttons.count()) === 0);
    return;
  }
  const seen = () => page.$$eval("section.sensor", (all) => all.map((s) => ({ unit: s.querySelector(".unit").textContent,
    level: Number((s.querySelector("data.level")?.textContent ?? "0").replace("\u2212", "-")), chart: s.querySelector(".plot.head").chart.data[1].find((v) => v != null),
    heading: s.querySelector("th:nth-child(3)")?.textContent ?? "" })));
  const before = await seen();
  await buttons.nth(1).click();
  await settled(page);
  const after = await seen();
  check("the switch shows each sensor's own unit", panels.every((p, i) => {
    if (p.unit === null) return after[i].chart === before[i].chart;
    const shown = (v) => v * p.unit.per_m + p.unit.zero;
    // Levels are printed to four digits.
    const near = (a, b, rounded = 0) => Math.abs(a - b) <= (0.02 + rounded) * p.unit.per_m;
    return after[i].unit === p.unit.name && near(after[i].chart, shown(before[i].chart)) && near(after[i].level, shown(before[i].level), 1e-3 * Math.abs(before[i].level)) && !/, m$/.test(after[i].heading);
  }), JSON.stringify([before, after]));
  await picture(page, "own-units.png");
  await buttons.nth(0).click();
  await settled(page);
  check("and back in m", JSON.stringify(await seen()) === JSON.stringify(before));
}

// What to do next stands above the fold with a command; a wide window has the index beside the page.
async function guides(page) {
  const commands = await page.$$eval(".advice .command", (all) => all.map((c) => [c.textContent, c.nextElementSibling?.textContent, c.getBoundingClientRect().top < window.innerHeight]));
  check("commands to copy begin with the program and have a button", commands.every(([text, button, high]) => text.startsWith("surgescope ") && button === "Copy" && high), JSON.stringify(commands));
  check("tables of peaks are folded", await page.$$eval("section.sensor details", (all) => all.every((d) => !d.open)));
  const beside = await page.evaluate(() => document.querySelector("nav.contents").getBoundingClientRect().right <= document.querySelector("h1").getBoundingClientRect().left);
  check("the index stands beside the page", beside);
}

// Smallest contrast of any text with the ground it stands on (WCAG 2).
const contrast = (page) => page.evaluate(() => {
  const rgb = (text) => (text.match(/[\d.]+/g) ?? [0, 0, 0, 0]).map(Number);
  const light = (c) => c.slice(0, 3).map((v) => v / 255).map((v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = (e) => {
    for (; e; e = e.parentElement) {
      const c = rgb(getComputedStyle(e).backgroundColor);
      if (c.length < 4 || c[3] > 0.5) return c;
    }
    return [255, 255, 255];
  };
  let worst = { ratio: Infinity };
  const walker = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode, e = node.parentElement;
    if (!node.textContent.trim() || !e.checkVisibility() || e.closest("svg")) continue;
    const [a, b] = [light(rgb(getComputedStyle(e).color)), light(ground(e))].sort((x, y) => y - x);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < worst.ratio) worst = { ratio, text: node.textContent.trim().slice(0, 40) };
  }
  return worst;
});

async function readable(page, mode) {
  const worst = await contrast(page);
  check(`text is readable in ${mode} mode`, worst.ratio >= 4.5, `${worst.ratio.toFixed(2)} at '${worst.text}'`);
}

async function fits(page, width) {
  const [wide, culprits] = await page.evaluate(() => {
    const limit = document.documentElement.clientWidth;
    const inScroller = (e) => e.closest(".scroll, pre, .plot, .hidden");
    const out = [...document.querySelectorAll("main *")].filter((e) => !inScroller(e) && e.checkVisibility() && e.getBoundingClientRect().right > limit + 0.5);
    return [document.documentElement.scrollWidth - limit, out.slice(0, 3).map((e) => `${e.tagName}.${e.className}`)];
  });
  check(`nothing overflows at ${width} px`, wide <= 0 && culprits.length === 0, `${wide} px, ${culprits.join(" ")}`);
  const cut = await page.$$eval("main *", (all) => all.filter((e) => e.checkVisibility() && e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 1
    && !e.closest(".plot, svg, .hidden, thead") && ["hidden", "clip"].includes(getComputedStyle(e).overflowX)).map((e) => `${e.tagName}.${e.className}`));
  check(`what does not fit at ${width} px can be scrolled to`, cut.length === 0, cut.slice(0, 3).join(" "));
}

// A page of still pictures: creep, sensitivity, frequency.
async function stillPage(page, problems, requests) {
  const drawn = await page.$$eval("main svg", (all) => all.filter((s) => s.checkVisibility() && s.querySelectorAll("path, rect, circle").length > 3).length);
  check("its charts are drawn", drawn > 0, `${drawn} charts`);
  const odd = await page.$$eval("main", ([m]) => ["NaN", "undefined", "Infinity"].filter((word) => m.innerHTML.includes(word)));
  check("no number is odd", odd.length === 0, odd.join(" "));
  check("it has tables", await page.$$eval("main table", (all) => all.length > 0 && all.every((t) => t.tBodies[0].rows.length > 0)));
  await picture(page, "light.png");
  await fits(page, 1400);
  await readable(page, "light");
  const light = await background(page);
  await page.emulateMedia({ colorScheme: "dark" });
  await settled(page);
  check("dark mode changes the ground", (await background(page)) !== light, light);
  await readable(page, "dark");
  await picture(page, "dark.png");
  await page.setViewportSize({ width: 390, height: 800 });
  await settled(page);
  await fits(page, 390);
  await picture(page, "narrow.png");
  check("no console error or request", problems.length === 0 && requests.length === 0, [...problems, ...requests].join(" | "));
}

const background = (page) => page.evaluate(() => getComputedStyle(document.body).backgroundColor);

try {
  const { page, problems, requests } = await open();
  if (!(await page.$("#data"))) {
    await stillPage(page, problems, requests);
    await browser.close();
    console.log(failures === 0 ? "all checks passed" : `${failures} checks failed`);
    process.exit(failures === 0 ? 0 : 1);
  }
  await contents(page, problems, requests);
  const diagnosed = await page.$eval("body", (b) => b.dataset.page === "diagnosis");
  check("a report with an answer is that of a diagnosis", diagnosed || !answer);
  if (diagnosed) await diagnosis(page, check, answer);
  await picture(page, "light.png");
  await guides(page);
  await units(page);
  await zoom(page);
  await legend(page);
  await fits(page, 1400);
  await readable(page, "light");

  const light = await background(page);
  const pixels = () => page.$eval(".plot canvas", (c) => c.toDataURL());
  const before = await pixels();
  await page.emulateMedia({ colorScheme: "dark" });
  await settled(page);
  check("dark mode changes the ground", (await background(page)) !== light, light);
  check("dark mode redraws the charts", (await pixels()) !== before);
  await readable(page, "dark");
  await page.mouse.move(0, 0);
  await picture(page, "dark.png");

  await page.pdf({ path: join(folder, "print.pdf"), format: "A4", printBackground: true });
  await page.emulateMedia({ media: "print" });
  check("print shows the still pictures", await page.$$eval(".still", (all) => all.every((s) => s.getBoundingClientRect().height > 100)));
  // An A4 page between its margins.
  await page.setViewportSize({ width: 680, height: 1000 });
  await settled(page);
  const cut = await page.$$eval(".scroll", (all) => all.filter((s) => s.checkVisibility() && (s.scrollHeight > s.clientHeight + 1 || s.scrollWidth > s.clientWidth + 1))
    .map((s) => `${s.getAttribute("aria-label")}: ${s.scrollWidth} of ${s.clientWidth} px`));
  check("print cuts no table off", cut.length === 0, cut.join(", "));
  const unseen = await page.$$eval("section, details:not(#rig details)", (all) => all.filter((s) => s.getBoundingClientRect().height < 40).map((s) => s.id || s.textContent.slice(0, 30)));
  check("print hides no section and unfolds what is folded", unseen.length === 0, unseen.join(", "));
  check("print hides the charts", await page.$$eval(".live", (all) => all.every((s) => getComputedStyle(s).display === "none")));
  try {
    execFileSync("pdftoppm", ["-r", "60", "-png", join(folder, "print.pdf"), join(folder, "print")]);
  } catch {
    console.log("note: no pdftoppm, so no pictures of the printed pages");
  }
  check("still no console error or request", problems.length === 0 && requests.length === 0, [...problems, ...requests].join(" | "));

  const narrow = await open({ viewport: { width: 390, height: 800 }, isMobile: false });
  await fits(narrow.page, 390);
  await texts(narrow.page, check, "narrow");
  await picture(narrow.page, "narrow.png");
  await narrow.page.setViewportSize({ width: 1000, height: 800 });
  await narrow.page.waitForTimeout(200);
  check("charts follow the window's width", await narrow.page.$$eval(".plot", (all) => all.every((p) => Math.abs(p.chart.width - p.clientWidth) <= 1)));

  const silent = await open({ javaScriptEnabled: false, viewport: { width: 1000, height: 900 } });
  check("without scripts the still pictures are shown", await silent.page.locator(".still svg").first().isVisible());
  await picture(silent.page, "no-script.png");
} finally {
  await browser.close();
}
console.log(failures === 0 ? "all checks passed" : `${failures} checks failed`);
process.exit(failures === 0 ? 0 : 1);
