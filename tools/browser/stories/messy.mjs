// (b) A messy table is dropped on the page, its column mapped, and fitted.
import assert from "node:assert";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { close, settled, story } from "./helpers.mjs";

// Semicolons, decimal commas, German headings, a remark above.
const mess = (csv) => {
  const lines = csv.split("\n").filter((line) => line && !line.startsWith("#"));
  const heading = `Zeit [s];${lines[0].split(",").slice(1).join(";").replace("P1", "Druck Ventil")}`;
  return [heading, ...lines.slice(1).map((line) => line.replaceAll(",", ";").replaceAll(".", ","))].join("\n");
};

// Two loggers of one closure: what the second has is taken out of the first.
const parted = (csv, name) => {
  const lines = csv.split("\n").filter((line) => line && !line.startsWith("#")).map((line) => line.split(","));
  const at = lines[0].indexOf(name);
  const rows = (keep) => lines.map((cells) => cells.filter((_, i) => i === 0 || keep(i))).filter((cells) => cells.slice(1).some(Boolean)).map((cells) => cells.join(",")).join("\n");
  return [rows((i) => i !== at), rows((i) => i === at)];
};

await story("two files that are dropped together become one recording", { files: { "run.mcap": "hdpe-creep.mcap" }, words: ["run.mcap"] }, async ({ folder, text, page: open, state, shot }) => {
  text("export", "run.mcap", "-o", "plain.csv");
  const files = parted(readFileSync(join(folder, "plain.csv"), "utf8"), "P2");
  const page = await open();
  await settled(page);
  const drop = (names) => page.evaluate(([contents, names]) => {
    const data = new DataTransfer();
    contents.forEach((content, i) => data.items.add(new File([content], names[i], { type: "text/csv" })));
    document.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true }));
  }, [files, names]);
  await drop(["valve.csv", "middle.csv"]);
  await page.waitForFunction(() => document.querySelector("#import h3")?.textContent === "valve.csv and middle.csv, as understood");
  const said = await page.textContent("#import");
  assert(said.includes("middle.csv: aligned by the front"), said);
  await shot(page, "two-files");
  await page.click("#import button.primary");
  await page.waitForFunction(() => document.querySelector("#title").textContent.includes("valve.mcap"));
  await settled(page);
  const sensors = (await state()).open.runs[0].sensors.map((sensor) => sensor.name).sort();
  assert.deepEqual(sensors, ["P1", "P2", "P3"]);
});

const RIG = ["name = \"copper\"", "[fluid]", "name = \"water\"", "temperature_degC = 18.0", "[[pipe]]", "name = \"main\"", "length_m = 100.0", "inner_diameter_mm = 19.0", "wall_thickness_mm = 1.5", "material = \"copper\"", "[upstream]", "kind = \"reservoir\"", "[downstream]", "kind = \"valve\"", "closing_time_s = 0.1",
  ...[["Valve", "pressure", 100, "bar"], ["Middle", "pressure", 62, "bar"], ["Flow", "flow", 100, "L/min"]].flatMap(([name, kind, place, unit]) => ["[[sensor]]", `name = "${name}"`, `kind = "${kind}"`, `position_m = ${place}.0`, `unit = "${unit}"`])].join("\n");

await story("what the file does not say of its times is asked for before it is imported", { files: { "logger.csv": "logger.csv" }, words: ["rig.toml"], prepare: ({ folder }) => writeFileSync(join(folder, "rig.toml"), RIG) }, async ({ folder, page: open, shot }) => {
  const page = await open();
  await page.waitForFunction(() => document.querySelector("#title").textContent.length > 0);
  await page.evaluate((content) => {
    const data = new DataTransfer();
    data.items.add(new File([content], "again.csv", { type: "text/csv" }));
    document.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true }));
  }, readFileSync(join(folder, "logger.csv"), "utf8"));
  const unit = page.locator('#import select[data-key="time_unit"]');
  await unit.waitFor();
  assert(await page.locator("#import button.primary").isDisabled(), "the unit of the times is not guessed");
  await shot(page, "times-asked");
  await unit.selectOption("ms");
  await page.waitForFunction(() => !document.querySelector("#import button.primary").disabled);
  await page.click("#import button.primary");
  await page.waitForFunction(() => document.querySelector("#title").textContent.includes("again.mcap"));
  await settled(page);
});

await story("a messy table is mapped and fitted as by `import` and `calibrate`", { files: { "run.mcap": "copper-leak.mcap" }, words: ["run.mcap"] }, async ({ folder, command, text, page: open, state, shot }) => {
  text("export", "run.mcap", "-o", "plain.csv");
  const messy = mess(readFileSync(join(folder, "plain.csv"), "utf8"));
  const page = await open();
  await settled(page);
  await page.evaluate((content) => {
    const data = new DataTransfer();
    data.items.add(new File([content], "Messung 7.csv", { type: "text/csv" }));
    document.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true }));
  }, messy);
  const choice = page.locator('#import select[data-key="column P1"]');
  await choice.waitFor();
  await shot(page, "messy");
  const options = await choice.locator("option").allTextContents();
  const column = options.find((option) => option.includes("Druck Ventil"));
  assert(column, `the columns are ${options}`);
  if ((await choice.inputValue()) !== column) {
    assert(await page.locator("#import button.primary").isDisabled(), "nothing is imported while the mapping is open");
    await choice.selectOption(column);
  }
  await page.waitForFunction(() => { const so = document.querySelector("#import button.primary"); return so && !so.disabled && document.querySelector("#import").textContent.includes("as understood"); });
  await page.click("#import button.primary");
  await page.waitForFunction(() => document.querySelector("#title").textContent.includes("Messung 7"));
  await settled(page);

  const own = (await state()).model;
  const [name] = (await state()).open.runs.map((run) => run.name);
  const by_command = command("calibrate", name, "--effects", "none").runs[0];
  close(own.rmse_m, by_command.rmse_m, 0.001, "error of what was written");
  close(own.rmse_m, command("calibrate", "run.mcap", "--effects", "none").runs[0].rmse_m, 0.02, "error of the recording it came from");

  // Volts of a logger that only counts its samples: rate and ranges are asked for.
  const rows = readFileSync(join(folder, "plain.csv"), "utf8").split("\n").filter((line) => line && !line.startsWith("#"));
  const at = rows[0].split(",").findIndex((name) => name.startsWith("P1"));
  const kpa = rows.slice(1).map((line) => Number(line.split(",")[at]));
  const rate = 1 / (Number(rows[2].split(",")[0]) - Number(rows[1].split(",")[0]));
  await page.evaluate((content) => {
    const data = new DataTransfer();
    data.items.add(new File([content], "volts.csv", { type: "text/csv" }));
    document.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true }));
  }, ["sample,ch0_V", ...kpa.map((p, i) => `${i},${(1 + p / 250).toFixed(6)}`)].join("\n"));
  await page.locator('#import input[data-key="rate"]').waitFor();
  await page.fill('#import input[data-key="rate"]', String(rate));
  await page.press('#import input[data-key="rate"]', "Enter");
  await page.locator('#import select[data-key="column P1"] option').nth(1).waitFor({ state: "attached" });
  await page.selectOption('#import select[data-key="column P1"]', { index: 1 });
  await page.fill('#import input[data-key="scale P1"]', "1..5 -> 0..1000 kPa");
  await page.press('#import input[data-key="scale P1"]', "Enter");
  await page.waitForFunction(() => { const so = document.querySelector("#import button.primary"); return so && !so.disabled && document.querySelector("#import").textContent.includes("as understood"); });
  await shot(page, "volts");
  await page.dblclick("#import button.primary");
  await page.waitForFunction(() => document.querySelector("#title").textContent.includes("volts"));
  await settled(page);
  const [volts] = (await state()).open.runs.map((run) => run.name);
  close((await state()).model.rmse_m, command("calibrate", volts, "--effects", "none").runs[0].rmse_m, 0.001, "error of what was in volts");
  assert.equal((await state()).runs.filter((run) => run.name.startsWith("volts")).length, 1, "a double click imports once");
});

await story("a file of another rig is read with the rig that a person chooses", { files: { "run.mcap": "copper-leak.mcap", "plastic.mcap": "hdpe-creep.mcap" }, words: ["."] }, async ({ folder, text, page: open, state, shot }) => {
  text("export", "plastic.mcap", "-o", "plain.csv");
  const page = await open();
  await page.waitForFunction(() => document.querySelectorAll("#runs tbody tr").length === 2);
  // the rig of a run that is not open is known once its row has been looked at
  await page.waitForFunction(() => [...document.querySelectorAll("#runs tbody tr")].every((row) => /copper|hdpe/.test(row.textContent)));
  await page.evaluate((content) => {
    const data = new DataTransfer();
    data.items.add(new File([content], "wet.csv", { type: "text/csv" }));
    document.dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true }));
  }, readFileSync(join(folder, "plain.csv"), "utf8"));
  const rig = page.locator('#import select[data-key="rig"]');
  await rig.waitFor();
  const rigs = await rig.locator("option").allTextContents();
  assert.equal(rigs.length, 2, `${rigs}`);
  await rig.selectOption(rigs.find((name) => name.includes("hdpe")));
  await page.locator('#import select[data-key="column P3"]').waitFor();
  assert.equal(await rig.inputValue(), rigs.find((name) => name.includes("hdpe")));
  await shot(page, "another-rig");
  await page.click("#import button.primary");
  await page.waitForFunction(() => document.querySelector("#title").textContent.includes("wet"));
  await settled(page);
  assert.equal((await state()).open.runs[0].sensors.length, 3);
});
