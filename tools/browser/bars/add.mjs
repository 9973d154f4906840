// `Add` in the page against `surgescope add`; and the server killed in the middle of it.
import { copyFileSync, rmSync } from "node:fs";
import { join } from "node:path";
import { Workbench, run, sleep } from "./workbench.mjs";

const CREEP = new URL("../../../recordings/hdpe-creep.mcap", import.meta.url).pathname;
const EFFECT = "viscoelastic-wall";

// Milliseconds that the command takes, and that the page takes from the click to the curve of the grown model; how many errors it showed.
export async function add(program, folder, browser, times = 10) {
  const took = { command: [], page: [], errors: [] };
  for (let i = 0; i < times; i++) {
    copyFileSync(CREEP, join(folder, "add.mcap"));
    run(program, folder, "calibrate", "add.mcap", "--effects", "none", "--save", "add.model.toml");
    let from = performance.now();
    run(program, folder, "add", EFFECT, "add.model.toml", "--json");
    took.command.push(performance.now() - from);
    run(program, folder, "calibrate", "add.mcap", "--effects", "none", "--save", "page.model.toml");
    const bench = await Workbench.open(program, folder, "page.model.toml");
    try {
      await bench.fitted();
      const page = await browser.newPage();
      await page.goto(bench.url);
      await page.waitForSelector(".model.force");
      await sleep(500); // nobody clicks before the page stands still
      const [ms, errors] = await page.evaluate(async (effect) => {
        let errors = 0;
        const shown = new Promise((done) => new MutationObserver(() => {
          const line = document.querySelector("#falling polyline");
          errors = Math.max(errors, line ? line.getAttribute("points").split(" ").length : 0);
          // the model that it grew out of is drawn beside it, and was not before
          const before = document.querySelectorAll(".legend .u-series")[1];
          if (document.querySelectorAll(".model:not(.preview)").length === 2 && before && !before.hidden) done();
        }).observe(document.body, { childList: true, subtree: true, attributes: true }));
        const from = performance.now();
        await fetch("/api/add", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ effect }) });
        await shown;
        await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
        return [performance.now() - from, errors];
      }, EFFECT);
      took.page.push(ms);
      took.errors.push(errors);
      await page.close();
    } finally {
      await bench.stop();
      ["add.model.toml", "page.model.toml"].forEach((name) => rmSync(join(folder, name), { force: true }));
    }
  }
  return took;
}

// Kills the server at random moments of an addition; how often the file of models was not whole, or had not the last finished model in force.
export async function kills(program, folder, times) {
  copyFileSync(CREEP, join(folder, "kill.mcap"));
  run(program, folder, "calibrate", "kill.mcap", "--effects", "none", "--save", "kill.model.toml");
  const models = () => run(program, folder, "model", "kill.model.toml", "--json");
  let [torn, finished] = [0, 0];
  for (let i = 0; i < times; i++) {
    const before = models();
    const bench = await Workbench.open(program, folder, "kill.model.toml");
    await bench.fitted();
    await bench.post("/api/add", { effect: `${EFFECT}:1` });
    await sleep(Math.random() * 700);
    await bench.stop("SIGKILL");
    const after = models();
    const grown = after.models.length - before.models.length;
    if (grown > 1 || grown < 0 || after.in_force !== (grown ? after.models.length : before.in_force)) torn++;
    if (grown) { finished++; run(program, folder, "undo", "kill.model.toml"); }
  }
  return { torn, finished };
}
