// Measures what the workbench promises, and prints the table of docs/src/measured/workbench.md.
// usage: node bars.mjs PROGRAM RECORDER [WHAT…]; RECORDER is the tool of that name, WHAT some of the names below (all but `size`)
import { mkdtempSync, rmSync } from "node:fs";
import { loadavg, tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { add, kills } from "./bars/add.mjs";
import { hostile } from "./bars/hostile.mjs";
import { first_paint, list_paint, long_run, many_runs } from "./bars/open.mjs";
import { crowd, nobody, one_page, recording } from "./bars/record.mjs";
import { recorded } from "./bars/rigs.mjs";
import { size } from "./bars/size.mjs";
import { slider } from "./bars/slider.mjs";
import { browser as launched, median, run } from "./bars/workbench.mjs";

const [program, recorder] = process.argv.slice(2, 4).map((path) => resolve(path));
const folder = mkdtempSync(join(tmpdir(), "bars-"));
const browser = await launched();
const both = (values, unit, digits = 0) => `${Math.min(...values).toFixed(digits)} (${median(values).toFixed(digits)}) ${unit}`;
const row = (...cells) => console.log(`| ${cells.join(" | ")} |`);

const measures = {
  async paint() {
    const path = recorded(program, folder, "short.mcap", { sensors: 2, rate: 1000, seconds: 10 });
    row("first paint of a run of 2 × 10,000 samples", "300 ms", both(await first_paint(program, folder, browser, path), "ms"));
  },
  async folder() {
    const found = await list_paint(program, folder, browser, many_runs(program, folder, 500), 500);
    row("first paint of a folder of 500 runs; its list; the server's share", "500 ms", `${both(found.page, "ms")}; ${both(found.list, "ms")}; ${both(found.state, "ms")}`);
  },
  async slider() {
    const path = recorded(program, folder, "two.mcap", { sensors: 2, rate: 1000, seconds: 10 });
    run(program, folder, "calibrate", path, "--effects", "viscoelastic-wall:2", "--save", "two.model.toml");
    for (const meanwhile of [false, true]) {
      const found = [];
      for (let i = 0; i < 5; i++) found.push(await slider(program, folder, browser, "two.model.toml", meanwhile));
      const of = (key) => both(found.map((f) => f[key]), "ms");
      const rates = found.map((f) => f.rate);
      row(`slider moved → curve redrawn, 2 sensors, 2 elements${meanwhile ? ", the others follow" : ""}: half of them, 95%; curves a second`, "60 ms; 30", `${of("median")}; ${of("p95")}; ${Math.max(...rates).toFixed(0)} (${median(rates).toFixed(0)})`);
    }
  },
  async long() {
    const path = recorded(program, folder, "long.mcap", { sensors: 3, rate: 100000, seconds: 100, effects: "viscoelastic-wall:1" });
    const found = await long_run(program, folder, browser, path);
    row("3 × 10 million samples: command → chart; zoom", "1.5 s; 150 ms", `${both(found.chart, "s", 1)}; ${both(found.zoom, "ms")}; fitted after ${both(found.fitted, "s", 1)}`);
    row("the same: server's memory; every peak on zoom", "1440 MB; yes", `${(found.most * 1.048576).toFixed(0)} MB; ${found.exact ? "yes" : "NO"}`);
  },
  async add() {
    const found = await add(program, folder, browser);
    const more = found.page.map((page, i) => page - found.command[i]);
    row("`Add` on `hdpe-creep`: page; command; what the page takes more, in turn; errors shown", "+ 100 ms; 5", `${both(found.page, "ms")}; ${both(found.command, "ms")}; median ${median(more).toFixed(0)} ms, most ${Math.max(...more).toFixed(0)} ms; ${Math.min(...found.errors)}`);
  },
  async record() {
    const seconds = 20;
    const one = (name, looks_on, lasting = seconds) => recording(program, recorder, folder, name, lasting, looks_on);
    const [alone, page] = [[], []];
    for (let i = 0; i < 5; i++) {
      alone.push(await one(`alone-${i}`, nobody));
      page.push(await one(`page-${i}`, one_page(browser)));
    }
    row("3 × 100 kHz with a page: samples lost; strips a second", "0; 20", `${Math.max(...page.map((p) => p.wanted - p.samples))}; ${both(page.map((p) => p.seen), "", 1)}`);
    const share = (found, of) => both(found.map((f) => 100 * f[of]), "%", 1);
    row("recorder's threads without a page; with one", "+ 10%", `${share(alone, "cpu")}; ${share(page, "cpu")} of a core`);
    row("the whole program without a page; with one", "", `${share(alone, "all")}; ${share(page, "all")} of a core`);
    const many = await one("crowd", crowd(browser), 3 * seconds);
    row("50 pages open, reloaded, closed, one at 56 kbit/s: samples lost; pages that show it; memory", "0; all; bounded", `${many.wanted - many.samples}; ${many.seen} of 49; ${many.most.toFixed(0)} MB (${Math.max(...page.map((p) => p.most)).toFixed(0)} MB with one page)`);
  },
  async kills() {
    const times = 50;
    const found = await kills(program, folder, times);
    row(`kill -9 in the middle of an add, ${times} times: files not whole or not in force`, "0", `${found.torn}; ${found.finished} had finished`);
  },
  async hostile() {
    for (const { what, found, answers, wait, memory, most } of await hostile(program, folder)) {
      row(`hostile: ${what}`, "answers, bounded", `${answers ? "answers" : "SILENT"} after ${wait.toFixed(0)} ms; ${memory.toFixed(0)} MB (most ${most.toFixed(0)}); ${found}`);
    }
  },
  async size() {
    const { before, now } = size(folder);
    row("binary; cold build", "+ 3 MB; + 25 s", `+ ${((now.bytes - before.bytes) / 1e6).toFixed(1)} MB; ${before.seconds.toFixed(0)} → ${now.seconds.toFixed(0)} s`);
  },
};

try {
  const wanted = process.argv.slice(4);
  row("what", "bar", "measured");
  row("---", "---", "---");
  for (const name of wanted.length ? wanted : Object.keys(measures).filter((name) => name !== "size")) {
    await measures[name]().catch((error) => row(name, "", `failed: ${error.message.split("\n")[0]}`));
  }
  console.log(`\nLeast (median); load average ${loadavg().map((load) => load.toFixed(1)).join(", ")}.`);
} finally {
  await browser.close();
  rmSync(folder, { recursive: true, force: true });
}
