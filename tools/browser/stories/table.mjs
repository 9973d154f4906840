// A folder that holds a logger's table and nothing else: a rig is made beside it, by mouse and by keyboard, then import, fit, diagnosis.
import assert from "node:assert";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { LONG, close, inForce, settled, story, valueOf } from "./helpers.mjs";

const remark = (page, key) => page.textContent(`[id="remark-${key}"]`);
const ready = (page) => page.waitForFunction(() => document.querySelector("#new-rig-says")?.textContent.includes("Writes"));
const waitRemark = (page, key, words) => page.waitForFunction(([id, text]) => document.getElementById(id)?.textContent.includes(text), [`remark-${key}`, words]);

await story("from a table to the leak in it, without a terminal", { files: { "logger.csv": "logger.csv" }, words: ["."] }, async ({ folder, command, page: open, state, shot }) => {
  const page = await open({ width: 1366, height: 768 });
  await page.waitForSelector("#new-rig tbody tr");
  assert.deepEqual(await page.$$eval("#new-rig .called > span", (all) => all.map((one) => one.textContent)), ["Valve", "Middle", "Flow"]);
  assert(!(await page.textContent("body")).includes("option `"));
  await shot(page, "table-open");
  // by keyboard: what the table does not say has the focus first
  assert.equal(await page.evaluate(() => document.activeElement.dataset.key), "time_unit");
  await page.selectOption("[data-key=time_unit]", "ms");
  await page.fill("[data-key=material]", "coper");
  await waitRemark(page, "material", "did you mean copper?");
  assert.equal(await page.getAttribute("[data-key=material]", "aria-invalid"), "true");
  // the button says what is missing by going there, and writes nothing
  await page.click("#new-rig .primary");
  await page.waitForFunction(() => document.activeElement.dataset.key === "material");
  assert.deepEqual(readdirSync(folder), ["logger.csv"]);
  await page.fill("[data-key=material]", "copper");
  await page.press("[data-key=material]", "Tab");
  await page.keyboard.type("328.1 ft");
  await page.waitForFunction(() => document.querySelector("#new-rig-drawing").textContent.includes("100 m"));
  await page.keyboard.press("Tab");
  await page.keyboard.type("22x1.5");
  await ready(page);
  await page.fill("[data-key=length]", "100");
  await page.fill("[data-key=temperature]", "18");
  await waitRemark(page, "columns.1.place", "measure it");
  assert((await page.textContent("#new-rig-drawing")).includes("Middle"), "the drawing follows");
  const before = await page.getAttribute("#new-rig-drawing .sensor.assumed", "cx");
  await page.fill('[data-key="columns.0.place"]', "100");
  await page.waitForFunction(() => document.querySelectorAll("#new-rig-drawing .sensor:not(.assumed)").length === 1);
  assert(before !== null);
  await page.fill('[data-key="columns.1.place"]', "62");
  await page.waitForFunction(() => document.querySelector("#new-rig-drawing").textContent.includes("Middle 62"));
  // a reload keeps what was written
  await page.reload();
  await ready(page);
  assert.equal(await page.inputValue("[data-key=material]"), "copper");
  await shot(page, "table-ready");
  await page.focus("[data-key=name]");
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.querySelector("#title").textContent.includes("logger.mcap"));
  await settled(page);
  assert(await page.isHidden("#new-rig"));
  assert.deepEqual(readdirSync(folder).filter((name) => /logger|rig/.test(name)).sort(), ["logger.csv", "logger.mcap", "rig.toml"]);
  await shot(page, "table-fitted");
  const own = (await state()).model;
  close(own.rmse_m, command("calibrate", "logger.mcap", "--effects", "none").runs[0].rmse_m, 0.001, "error of the base model");
  await page.click("#diagnose");
  await page.waitForSelector(".candidate", LONG);
  await page.waitForFunction(() => /Missing: leak/.test(document.querySelector("#verdict").textContent));
  const [leak] = (await state()).diagnosis.candidates;
  close(leak.parameters.find((p) => p.name === "leak_position_m").value, 35, 0.01, "place of the leak");
  await page.click(".candidate button.primary");
  await settled(page, 2);
  command("calibrate", "logger.mcap", "--effects", "none", "--save", "by-command.toml");
  command("add", "leak", "by-command.toml");
  const [by_page, by_command] = [inForce(command, "logger.model.toml"), inForce(command, "by-command.toml")];
  close(by_page.rmse_m, by_command.rmse_m, 0.01, "error with the leak");
  close(valueOf(by_page, "leak_position_m"), 35, 0.01, "place of the leak in the model");
  await shot(page, "table-answer");
});

await story("a table in volts that counts its samples is dropped on an empty folder", { words: ["."] , files: {} }, async ({ folder, page: open, state, shot }) => {
  const rows = readFileSync(join(process.argv[3], "logger.csv"), "utf8").split("\n").slice(4).filter(Boolean);
  const volts = ["sample,ch0_V", ...rows.map((row, i) => `${i},${(1 + 0.2 * Number(row.split(";")[2])).toFixed(5)}`)].join("\n");
  const page = await open({ width: 1920, height: 1080 });
  await page.waitForFunction(() => document.querySelector("#title").textContent.length > 0);
  await page.evaluate((content) => {
    const data = new DataTransfer();
    data.items.add(new File([content], "volts.csv", { type: "text/csv" }));
    document.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true }));
  }, volts);
  await waitRemark(page, "file", "the field “samples per second”");
  await page.fill("[data-key=rate]", "1000");
  await page.waitForSelector("#new-rig tbody tr");
  await waitRemark(page, "columns", "No column is a pressure yet");
  await page.selectOption('[data-key="columns.0.is"]', "pressure");
  await page.waitForSelector('[data-key="columns.0.unit"]:visible');
  await page.waitForFunction(() => document.getElementById("remark-columns.0.unit").textContent.length > 0);
  assert(await page.isHidden('[id="remark-columns.0.place"]'), "the unit is asked for beside the unit, and not beside the place");
  await page.fill('[data-key="columns.0.unit"]', "1..5 -> 0..20");
  await waitRemark(page, "columns.0.unit", "unit of the result");
  await page.fill('[data-key="columns.0.unit"]', "1..5 -> 0..20 bar");
  for (const [key, value] of [["material", "copper"], ["length", "100"], ["inner_diameter", "19"], ["flow", "11.15 L/min"]]) await page.fill(`[data-key=${key}]`, value);
  await waitRemark(page, "wall", "needed");
  await page.fill("[data-key=wall]", "1.5");
  await ready(page);
  await shot(page, "table-volts");
  writeFileSync(join(folder, "rig.toml"), "not to be replaced");
  await page.dblclick("#new-rig .primary");
  await page.waitForFunction(() => document.querySelector("#title").textContent.includes("volts.mcap"));
  await settled(page);
  assert.deepEqual(readdirSync(folder).filter((name) => name.endsWith(".toml")).sort(), ["rig-2.toml", "rig.toml"]);
  assert.equal((await state()).runs.length, 1, "a double click imports once");
});

// One record in two files, one half after the other.
const halves = (csv) => {
  const lines = csv.split("\n").filter(Boolean);
  const [head, rows] = [lines.slice(0, 3), lines.slice(3)];
  const half = Math.floor(rows.length / 2);
  return [rows.slice(0, half), rows.slice(half)].map((part) => [...head, ...part].join("\n"));
};

await story("two tables of one closure become one recording, and what is missing is named", { words: ["."], prepare: ({ folder }) => {
  halves(readFileSync(join(process.argv[3], "logger.csv"), "utf8")).forEach((text, i) => writeFileSync(join(folder, `part${i + 1}.csv`), text));
} }, async ({ folder, page: open, state, shot }) => {
  const page = await open({ width: 1366, height: 768 });
  await page.click('[data-key="table part1.csv"]');
  await page.check('[data-key="with part2.csv"]');
  await page.waitForFunction(() => document.querySelector("#new-rig-title")?.textContent === "A rig for part1.csv and part2.csv");
  for (const [key, value] of [["material", "copper"], ["length", "-5"], ["size", "22x1.5"], ["temperature", "18"]]) await page.fill(`[data-key=${key}]`, value);
  await page.selectOption('#new-rig [data-key="time_unit"]', "ms");
  await page.waitForFunction(() => /Cannot be taken: length: it must be from/.test(document.querySelector("#new-rig-says").textContent));
  await page.click("#new-rig-says button.link");
  assert.equal(await page.evaluate(() => document.activeElement.dataset.key), "length");
  await page.fill("[data-key=length]", "100");
  await ready(page);
  await shot(page, "table-joined");
  await page.click("#new-rig .primary");
  await page.waitForFunction(() => document.querySelector("#title").textContent.includes("part1.mcap"));
  await settled(page);
  const [run] = (await state()).open.runs;
  assert(run.to_s > 2.5, `the second half is in the record: it ends at ${run.to_s} s`);
  assert(readdirSync(folder).includes("rig.toml"));
});
