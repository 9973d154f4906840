// (d) A simulated shot with a hidden effect is recorded live and ends at its diagnosis.
import assert from "node:assert";
import { copyFileSync } from "node:fs";
import { join } from "node:path";
import { close, settled, story } from "./helpers.mjs";

const rig = new URL("../../../rigs/demo-hdpe.toml", import.meta.url);

await story("a recorded shot is diagnosed as by `diagnose`", { words: ["rig.toml"], prepare: ({ folder }) => copyFileSync(rig, join(folder, "rig.toml")) }, async ({ command, page: open, state, shot }) => {
  const page = await open();
  await page.click("#show-record");
  await page.getByLabel("Record from").selectOption("simulated");
  await page.selectOption('#record select[aria-label="Hide an effect in the test"]', "leak");
  await page.click("#record summary");
  const place = page.locator('#record [data-key="set leak_position_m"]');
  await place.fill("40");
  await page.getByLabel("Samples per second").fill("500");
  await page.getByLabel("Speed times real time").fill("4");
  await page.getByLabel("Stop after").fill("10");
  await shot(page, "record");
  await page.click("#record button.primary");
  await page.waitForFunction(() => !document.querySelector("#live").hidden && /[1-9]\d* samples/.test(document.querySelector("#live-line").textContent));
  await page.waitForFunction(() => document.querySelector("#live-disk").textContent.includes("GB free"));
  // the page is the recorder's: strips in the unit that is chosen, and nothing of a run
  await page.waitForFunction(() => document.querySelectorAll(".strip canvas").length === 5 && /\d m$/.test(document.querySelector(".strip .level").textContent));
  assert.deepEqual(await page.locator("main, #tabs, [data-range], #take").evaluateAll((all) => all.filter((one) => one.checkVisibility()).map((one) => one.id || one.tagName)), []);
  const inked = () => page.evaluate(() => { const canvas = document.querySelector(".strip canvas"); return canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.some((v, i) => i % 4 === 3 && v > 200); });
  assert(await inked(), "a curve is drawn");
  await page.keyboard.press("m");
  await page.waitForFunction(() => /\d kPa$/.test(document.querySelector(".strip .level").textContent));
  const [head, pressure] = await page.evaluate(async () => { const { app } = await import("/assets/store.js"); const { per_m: per, zero } = app.state.recording.rig.heads.P1; return [(parseFloat(document.querySelector(".strip .level").textContent) - zero) / per, parseFloat(document.querySelector(".strip .level").textContent)]; });
  close(pressure, 9.79 * head, 0.02, "the level in kPa");
  await page.keyboard.press("m");
  await shot(page, "live");
  // it is opened, fitted and diagnosed by itself
  await page.waitForSelector(".verdict");
  await settled(page);
  await shot(page, "diagnosed");
  const now = await state();
  const { file, data_lost: lost } = now.recording.ended;
  assert.equal(lost, false);
  const found = command("diagnose", now.open.runs[0].name);
  assert.equal(now.diagnosis.verdict, found.verdict);
  assert.equal(now.diagnosis.candidates[0].effect, found.candidates[0].effect);
  assert.equal(found.candidates[0].effect, "leak", `the hidden effect of ${file} is named`);
  close(now.diagnosis.candidates[0].rmse_m, found.candidates[0].rmse_m, 0.01, "error with the leak");
  assert((await page.textContent(".verdict")).includes("leak"));
});
