// (a) A stranger opens a recording, reads where the model fails, diagnoses, previews, adds, and sees the error at the noise.
import assert from "node:assert";
import { close, inForce, settled, story } from "./helpers.mjs";

await story("a stranger ends where the commands end", { files: { "run.mcap": "hdpe-creep.mcap" }, words: ["run.mcap"] }, async ({ command, page: open, shot }) => {
  const page = await open();
  await settled(page);
  assert((await page.textContent("#fails")).includes("times the noise"));
  await page.click("#fails button");
  assert.equal(await page.getAttribute("[data-range=all]", "aria-pressed"), "false", "the sentence leads to its place");
  await page.keyboard.press("3");
  await shot(page, "where-it-fails");
  // in the sensors' own unit the sentences say the same, of which nothing is left in metres
  const rmse = async (unit) => Number((await page.textContent("#fails")).match(new RegExp(`RMSE ([\\d.]+) ${unit},`))[1]);
  const inMetres = await rmse("m");
  await page.keyboard.press("m");
  close(await rmse("kPa"), 9.79 * inMetres, 0.02, "the error in kPa");
  assert(!/\d m\b/.test(await page.textContent("#fails")));
  await page.keyboard.press("m");

  await page.click("#diagnose");
  await page.waitForSelector(".candidate");
  // a label may hold slashes: the columns behind it are still read from their own place
  const read = await page.evaluate(async () => {
    const names = ["0/0/time_s", "0/0/candidate:valve-law/power_m", "0/1/time_s", "0/1/candidate:valve-law/power_m"];
    const head = JSON.stringify({ sensors: [{ run: 0, sensor: 0, points: 2 }, { run: 0, sensor: 1, points: 3 }], columns: names }).padEnd(204);
    const bytes = new Uint8Array(4 + 204 + 10 * 8);
    new DataView(bytes.buffer).setUint32(0, 204, true);
    bytes.set(new TextEncoder().encode(head), 4);
    bytes.set(new Uint8Array(Float64Array.from({ length: 10 }, (_, i) => i).buffer), 208);
    const plain = window.fetch;
    window.fetch = async () => new Response(bytes);
    try { return Object.values((await (await import("/assets/api.js")).curves(null, 3, ["model"])).column); } finally { window.fetch = plain; }
  });
  assert.deepEqual(read, [[0, 1], [2, 3], [4, 5, 6], [7, 8, 9]]);
  await page.hover(".candidate");
  await page.waitForSelector(".model.preview");
  await page.waitForFunction(() => document.querySelector(".u-legend").textContent.includes("with viscoelastic-wall"));
  await shot(page, "preview");
  // while it is added, the program tells models on the way, each with its error; how many of them are drawn depends on how long the fit takes
  await page.evaluate(() => {
    window.told = [];
    const source = new EventSource("/api/events");
    source.addEventListener("progress", (event) => window.told.push(JSON.parse(event.data)));
    return new Promise((done) => source.addEventListener("open", done, { once: true }));
  });
  await page.click(".candidate button.primary");
  await settled(page, 2);
  await page.waitForFunction(() => window.told.some((one) => one.moves));
  const told = await page.evaluate(() => window.told);
  const errors = told.map((one) => one.rmse_m).filter((rmse) => rmse !== null);
  assert(Math.min(...errors) < 0.1 * Math.max(...errors), `the error fell on the way: ${errors}`);
  // in the end the curve of the grown model is drawn, and no other on its way
  await page.waitForFunction(() => [...document.querySelectorAll("#charts .rms")].every((rms) => /error 0\.0\d+ m/.test(rms.textContent)));
  const legend = await page.$$eval("#charts .chart:first-of-type .u-series", (all) => all.filter((one) => !one.hidden && !one.classList.contains("none")).map((one) => one.textContent));
  assert(legend.some((one) => one.startsWith("model")) && !legend.some((one) => one.startsWith("being fitted")), `${legend}`);
  const drawn = await page.evaluate(() => {
    const canvas = document.querySelector("#charts .chart canvas");
    return canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value > 0);
  });
  assert(drawn, "the chart is not empty");
  await page.waitForFunction(() => document.querySelector("#fails").textContent.includes("more than its noise"));
  await shot(page, "added");

  command("calibrate", "run.mcap", "--effects", "none", "--save", "by-command.toml");
  command("add", "viscoelastic-wall", "by-command.toml");
  const [a, b] = [inForce(command, "run.model.toml"), inForce(command, "by-command.toml")];
  close(a.rmse_m, b.rmse_m, 0.01, "error");
  assert.deepEqual(a.effects.map((e) => e.split(":")[0]), b.effects.map((e) => e.split(":")[0]));
  // both models side by side
  await page.click("text=compare");
  await page.click("text=side by side");
  assert((await page.textContent("#sidebyside tbody tr")).includes("1.6"), "the error of the base model stands beside");
});
