// (h) On a laptop: all sensors at a glance, panels that fold and resize, sliders as fine as the error, marks that read differences, how well a
// parameter is known, and an effect taken out again.
import assert from "node:assert";
import { settled, story } from "./helpers.mjs";

await story("a laptop shows all sensors, and hands move what they mean to", { files: { "run.mcap": "hdpe-creep.mcap" }, words: ["run.mcap"] }, async ({ page: open, command, state, shot }) => {
  const page = await open({ width: 1366, height: 768 });
  await settled(page);
  await page.keyboard.press("d");
  await page.waitForSelector(".candidate");
  await settled(page);
  const before = await state();
  await page.click('[aria-label="Add viscoelastic-wall:3"]');
  await settled(page, 2);

  // every chart, the last one's time axis with it, without scrolling
  const seen = () => page.evaluate(() => {
    const pane = document.querySelector("#evidence");
    const edge = pane.getBoundingClientRect().bottom;
    return { charts: [...document.querySelectorAll(".chart")].filter((card) => card.getBoundingClientRect().bottom <= edge + 1).length, scrolls: pane.scrollHeight - pane.clientHeight, high: document.querySelector(".chart .uplot").getBoundingClientRect().height };
  });
  await page.waitForFunction(() => document.querySelectorAll(".chart canvas").length === 6);
  const whole = await seen();
  assert.deepEqual([whole.charts, whole.scrolls], [3, 0], JSON.stringify(whole));
  assert(whole.high > 50, `${whole.high} px`);
  await shot(page, "laptop");

  // the model is drawn over the measurement, and that over what was before; the measurement is the widest
  const order = await page.evaluate(() => [...document.querySelector(".chart").querySelectorAll(".u-series .u-label")].slice(1).map((label) => label.textContent));
  assert.deepEqual(order.slice(0, 3), ["before", "measured", "model"]);

  // all sensors in one chart: each has its measurement, its model and what is tried
  await page.keyboard.press("t");
  await page.waitForFunction(() => document.querySelectorAll(".chart").length === 1 && document.querySelector(".chart canvas"));
  const series = await page.evaluate(async () => { const [one] = (await import("/assets/heights.js")).cards; return one.drawn.map((plot) => plot.slice(1).map((curve) => curve.some((v) => typeof v === "number"))); });
  const sensor = (measured) => [measured, true, false];
  assert.deepEqual(series, [[0, 0, 0].flatMap(() => sensor(true)), [0, 0, 0].flatMap(() => sensor(false))]);
  await shot(page, "laptop-one-chart");
  await page.keyboard.press("t");
  await page.waitForFunction(() => document.querySelectorAll(".chart").length === 3);

  // folded panels leave their room to the charts, and a page that is loaded again keeps them so
  await page.click('[aria-label="Fold Parameters"]');
  await page.click('[aria-label="Fold Models"]');
  await page.waitForFunction((high) => document.querySelector(".chart .uplot").getBoundingClientRect().height > high + 10, whole.high);
  await page.reload();
  await settled(page, 2);
  assert(await page.locator("#hands").isHidden() && await page.locator("#past").isHidden());
  await page.click('[aria-label="Show Parameters"]');
  await page.click('[aria-label="Show Models"]');
  const size = (id) => page.locator(id).boundingBox();
  const [hands, past] = [await size("#hands"), await size("#past")];
  const grip = page.locator('[aria-label="Size of Parameters"]');
  const { x, y } = await grip.boundingBox();
  await page.mouse.move(x + 300, y + 4);
  await page.mouse.down();
  await page.mouse.move(x + 300, y - 76, { steps: 4 });
  await page.mouse.up();
  assert(Math.abs((await size("#hands")).height - hands.height - 80) < 3, "the parameters follow the hand");
  await page.locator('[aria-label="Size of Models"]').focus();
  await page.keyboard.press("ArrowRight");
  assert.equal((await size("#past")).width, past.width + 24);
  await grip.dblclick({ position: { x: 300, y: 4 } });
  await page.locator('[aria-label="Size of Models"]').dblclick({ position: { x: 4, y: 40 } });
  assert.deepEqual([(await size("#hands")).height, (await size("#past")).width], [hands.height, past.width]);

  // a pixel, a key and a notch of the wheel move a slider by a tenth of the error or less
  const { parameters } = (await state()).model;
  const speed = parameters.find((p) => p.name === "wave_speed_m_s");
  const slider = page.locator("#parameters input[type=range]").first();
  const field = page.locator("#parameters .value").first();
  const value = async () => Number(await field.inputValue());
  const box = await slider.boundingBox();
  const thumb = await slider.evaluate((input) => input.valueAsNumber / input.max);
  const middle = box.x + 8 + (box.width - 16) * thumb;
  await page.mouse.move(middle, box.y + box.height / 2);
  await page.mouse.down();
  const steps = [];
  for (let px = 1; px <= 6; px++) { await page.mouse.move(middle + px, box.y + box.height / 2); steps.push(await value()); }
  const finest = steps.slice(1).map((v, i) => v - steps[i]);
  assert(finest.every((step) => step >= 0 && step <= 0.1 * speed.standard_error) && steps.at(-1) > steps[0], `${steps}, ± ${speed.standard_error}`);

  // while it is dragged far away no scale moves
  const scales = () => page.evaluate(() => [...document.querySelectorAll(".chart .uplot")].map((plot) => [...plot.querySelectorAll("canvas")].map((c) => c.height).join()).concat(document.querySelector("#charts").scrollHeight));
  const ticks = () => page.evaluate(() => window.scales());
  await page.evaluate(async () => { const { panels } = await import("/assets/charts.js"); window.scales = () => panels.flatMap((p) => p.plots.map((plot) => [plot.scales.y.min, plot.scales.y.max])); });
  const [still, laid] = [await ticks(), await scales()];
  for (let px = 10; px < box.width / 2 - 12; px += 10) { await page.mouse.move(middle + px, box.y + box.height / 2); await page.waitForTimeout(20); }
  await page.waitForFunction(() => Number(document.querySelector("#trial").textContent.match(/([\d.]+) × noise/)?.[1]) > 20);
  assert.deepEqual([await ticks(), await scales()], [still, laid], "scales stand still under a hand");
  await shot(page, "laptop-dragged");
  await page.mouse.up();
  await page.waitForFunction((old) => JSON.stringify(window.scales()) !== old, JSON.stringify(still));
  await page.click("#reset");
  await page.waitForFunction(() => document.querySelector("#trial").textContent === "");

  await slider.focus();
  const moved = async (act) => { const from = await value(); await act(); return Math.abs((await value()) - from) / speed.standard_error; };
  await page.keyboard.press("ArrowRight");
  for (const [act, most] of [[() => page.keyboard.press("ArrowRight"), 0.101], [() => page.keyboard.press("Shift+ArrowRight"), 0.0101], [() => page.mouse.wheel(0, -100), 0.101]]) {
    await page.mouse.move(box.x + 5, box.y + box.height / 2);
    const share = await moved(async () => { await act(); await page.waitForTimeout(60); });
    assert(share > 0 && share <= most + 1e-3, `${share} of the error, not ${most}`);
  }
  // a wheel over one that has not the focus scrolls the panel
  await page.locator("#parameters input[type=range]").nth(1).hover();
  const other = await page.locator("#parameters .value").nth(1).inputValue();
  await page.mouse.wheel(0, -100);
  assert.equal(await page.locator("#parameters .value").nth(1).inputValue(), other);
  await page.click("#reset");
  await page.waitForTimeout(700);

  // two clicks read the time and the heads between them, as the curves have them
  const over = await page.locator(".u-over").first().boundingBox();
  await page.mouse.click(over.x + 0.2 * over.width, over.y + 10);
  await page.mouse.move(over.x + 0.3 * over.width, over.y + 10);
  await page.waitForFunction(() => document.querySelector(".reading").textContent.startsWith("Δt"));
  await page.mouse.click(over.x + 0.5 * over.width, over.y + 10);
  const [reading] = await page.locator(".reading").allTextContents();
  const [, seconds, measured] = reading.match(/Δt \+([\d.]+) s · measured ([+−][\d.]+) m · model/);
  const run = (await state()).open.runs[0];
  assert(Math.abs(Number(seconds) / (0.3 * (run.to_s - run.from_s)) - 1) < 0.02, reading);
  const expected = await page.evaluate(async () => {
    const [{ panels }, { valueAt }] = await Promise.all([import("/assets/charts.js"), import("/assets/marks.js")]);
    const [time, , heads] = panels[0].drawn[0];
    const at = (share) => valueAt(time, heads, time[0] + share * (time.at(-1) - time[0]));
    return at(0.5) - at(0.2);
  });
  assert(Math.abs(Number(measured.replace("−", "-")) - expected) < 0.2, `${reading}; ${expected}`);
  await shot(page, "laptop-marks");
  await page.keyboard.press("Escape");
  assert.deepEqual((await page.locator(".reading").allTextContents()).join(""), "");

  // how well a parameter is known: by the profile as the command has it
  await page.click('[aria-label="How well wave speed is known"]');
  await page.waitForSelector("#known[open] .trade");
  await page.click("#known >> text=Profile >> nth=1");
  await page.waitForSelector("#known .profile");
  await shot(page, "laptop-known");
  const name = await page.getAttribute("#known .profile", "aria-label");
  const [low, high] = name.match(/interval is ([\d.]+) to ([\d.]+)/).slice(1).map(Number);
  const there = command("calibrate", "run.mcap", "--effects", "viscoelastic-wall:3", "--profile", "wave_speed_m_s").parameters.find((p) => p.name === "wave_speed_m_s").interval_95;
  assert(Math.abs(low - there[0]) < 0.1 * (there[1] - there[0]) && Math.abs(high - there[1]) < 0.1 * (there[1] - there[0]), `${name}; ${there}`);
  await page.keyboard.press("Escape");

  // an effect that is switched off takes its sliders with it for the moment; taken out, the model that was is back with its diagnosis
  const resting = () => page.locator("#parameters .rests input[type=range]:disabled").count();
  await page.uncheck("#effects-in input[type=checkbox]");
  assert.equal(await resting(), 6);
  await page.check("#effects-in input[type=checkbox]");
  assert.equal(await resting(), 0);
  await page.click('[aria-label="Take viscoelastic-wall:3 out"]');
  await page.waitForFunction(() => document.querySelector(".model.force .name").textContent === "base model");
  const after = await state();
  assert.deepEqual([after.model.rmse_m, after.diagnosis], [before.model.rmse_m, before.diagnosis]);
  await page.waitForSelector('.candidate [aria-label="Add viscoelastic-wall:3"]');
});
