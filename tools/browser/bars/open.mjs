// How long until a run, a folder or a long run is on the screen, and how long a zoom takes.
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, utimesSync } from "node:fs";
import { join } from "node:path";
import { first_chart, watched } from "./paint.mjs";
import { recorded } from "./rigs.mjs";
import { Workbench, run } from "./workbench.mjs";

// Milliseconds from the request for the page to the first chart, of a workbench that has fitted.
export async function first_paint(program, folder, browser, path, times = 5) {
  const bench = await Workbench.open(program, folder, path);
  try {
    await bench.fitted();
    const took = [];
    for (let i = 0; i < times; i++) {
      const page = await watched(browser);
      took.push(await first_chart(page, bench.url));
      await page.close();
    }
    return took;
  } finally {
    await bench.stop();
  }
}

// So many runs, each of which the folder's index knows: one is evaluated, and the index has the same of the others.
export function many_runs(program, folder, count) {
  const runs = join(folder, "runs");
  mkdirSync(runs);
  recorded(program, runs, "run-000.mcap", { sensors: 2, rate: 500, seconds: 6, effects: "viscoelastic-wall:1" });
  run(program, runs, "watch", ".", "--once");
  for (let i = 1; i < count; i++) {
    const copy = join(runs, `run-${String(i).padStart(3, "0")}.mcap`);
    copyFileSync(join(runs, "run-000.mcap"), copy);
    utimesSync(copy, 1e9 + i, 1e9 + i);
  }
  const sql = `
import sqlite3, sys
index = sqlite3.connect("surgescope.sqlite")
columns = [row[1] for row in index.execute("PRAGMA table_info(run)") if row[1] not in ("id", "content", "file")]
for i in range(1, int(sys.argv[1])):
    names = ", ".join(columns)
    index.execute(f"INSERT INTO run (content, file, {names}) SELECT content || ?, ?, {names} FROM run WHERE id = 1", (str(i), f"run-{i:03}.mcap"))
index.commit()`;
  execFileSync("python3", ["-c", sql, String(count)], { cwd: runs });
  return "runs";
}

// Milliseconds until the list of runs stands: from the request for the page, and from the key that shows it.
export async function list_paint(program, folder, browser, path, count, times = 5) {
  const bench = await Workbench.open(program, folder, path);
  try {
    await bench.fitted();
    const took = { page: [], list: [], state: [] };
    for (let i = 0; i < times; i++) {
      const page = await watched(browser);
      took.page.push(await first_chart(page, bench.url));
      const list = await page.evaluate(async (count) => {
        document.querySelector("dialog#runs").close();
        const from = performance.now();
        document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "o", bubbles: true }));
        // the rows in view; the rest of a long table follows
        while (document.querySelectorAll("dialog#runs tbody tr").length < Math.min(count, 50)) await new Promise(requestAnimationFrame);
        await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
        return performance.now() - from;
      }, count);
      took.list.push(list);
      await page.close();
      const from = performance.now();
      await bench.get("/api/state");
      took.state.push(performance.now() - from);
    }
    return took;
  } finally {
    await bench.stop();
  }
}

// A long run: seconds from the command to the first chart, and to the first fit; milliseconds of zooms; and the server's memory, MB.
export async function long_run(program, folder, browser, path, times = 3) {
  const took = { chart: [], fitted: [], zoom: [], most: 0, exact: true };
  for (let i = 0; i < times; i++) {
    const bench = await Workbench.open(program, folder, path);
    try {
      const page = await watched(browser);
      const chart = await first_chart(page, bench.url);
      const asked = await page.evaluate(() => performance.timeOrigin);
      took.chart.push((asked + chart - performance.timeOrigin - bench.began) / 1000);
      await bench.fitted();
      took.fitted.push((performance.now() - bench.began) / 1000);
      took.zoom.push(...(await zooms(page)));
      took.exact &&= await exact(bench);
      await page.close();
      took.most = Math.max(took.most, bench.most());
    } finally {
      await bench.stop();
    }
  }
  return took;
}

// Drags over the first chart, and waits until all charts show what was asked for.
async function zooms(page) {
  const took = [];
  for (const [from, to] of [[0.1, 0.9], [0.2, 0.7], [0.3, 0.5]]) {
    const box = await page.locator(".u-over").first().boundingBox();
    const y = box.y + box.height / 2;
    await page.mouse.move(box.x + box.width * from, y);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width * to, y, { steps: 3 });
    const settled = page.evaluate(() => new Promise((done) => {
      const from = performance.now();
      const plain = window.fetch;
      window.fetch = async (...asked) => {
        const answer = await plain(...asked);
        if (!String(asked[0]).startsWith("/api/curves")) return answer;
        window.fetch = plain;
        const read = answer.arrayBuffer.bind(answer);
        answer.arrayBuffer = async () => {
          const bytes = await read();
          // by then it has been unpacked and drawn
          setTimeout(() => requestAnimationFrame(() => setTimeout(() => done(performance.now() - from))));
          return bytes;
        };
        return answer;
      };
    }));
    await page.mouse.up();
    took.push(await settled);
  }
  return took;
}

// Whether a zoom shows the largest and smallest sample that a zoom to every sample shows.
async function exact(bench) {
  const read = async (from, to, points) => {
    const answer = await bench.request(`/api/curves?run=0&sensor=1&from=${from}&to=${to}&points=${points}&curves=none`);
    const bytes = await answer.arrayBuffer();
    const length = new DataView(bytes).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
    return { head, heads: new Float64Array(bytes, 4 + length + 8 * head.points, head.points) };
  };
  const few = await read(0, 0.15, 400);
  const all = await read(0, 0.15, 20000);
  const ends = ({ heads }) => [Math.min(...heads), Math.max(...heads)].join();
  return few.head.decimated && !all.head.decimated && few.head.samples === all.head.samples && all.head.samples > 10000 && ends(few) === ends(all);
}
