// A recording of three channels at 100 kHz while pages look on, are reloaded, closed and slow.
import { spawn, execFileSync } from "node:child_process";
import { once } from "node:events";
import { mkdirSync, readFileSync, readdirSync } from "node:fs";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { watched } from "./paint.mjs";
import { Workbench, sleep, until } from "./workbench.mjs";

const RATE = 100000;
const TICKS_PER_S = 100;

// Seconds of processor time by thread name.
function threads(pid) {
  const used = new Map();
  for (const task of readdirSync(`/proc/${pid}/task`)) {
    try {
      const [, name, rest] = readFileSync(`/proc/${pid}/task/${task}/stat`, "utf8").match(/\((.*)\) (.*)/s);
      const fields = rest.split(" ");
      used.set(name, (used.get(name) || 0) + (Number(fields[11]) + Number(fields[12])) / TICKS_PER_S);
    } catch { /* a thread that has just ended */ }
  }
  return used;
}

// Records for some seconds while `looks_on` does something with pages. Returns what was recorded and what it took.
export async function recording(program, recorder, folder, name, seconds, looks_on) {
  const place = join(folder, name);
  mkdirSync(place);
  const device = spawn(recorder, ["device", String(RATE), String(seconds + 8), "rig.toml"], { cwd: place, stdio: ["pipe", "pipe", "ignore"] });
  await once(createInterface(device.stdout), "line");
  const bench = await Workbench.open(program, place, "rig.toml");
  try {
    await bench.post("/api/record", { duration_s: seconds });
    device.stdin.end("go\n");
    let [most, used] = [0, new Map()];
    const looking = looks_on(bench, seconds);
    const ended = await until("the end of the recording", async () => {
      const now = threads(bench.process.pid);
      // its thread ends with it
      if (now.has("recording")) used = now;
      most = Math.max(most, bench.memory());
      const state = await bench.get("/api/state");
      return state.recording.running ? null : state.recording.ended;
    }, 1000 * (seconds + 60));
    const seen = await looking;
    if (ended.error) throw new Error(ended.error);
    const file = ended.file.split("/").at(-1);
    const samples = Number(execFileSync(recorder, ["check", String(RATE), file], { cwd: place }));
    const cpu = [...used].filter(([thread]) => thread === "recording" || thread.startsWith("port")).reduce((sum, [, s]) => sum + s, 0);
    const all = [...used.values()].reduce((sum, s) => sum + s, 0);
    return { samples, wanted: RATE * seconds, lost: ended.data_lost, cpu: cpu / seconds, all: all / seconds, most, seen };
  } finally {
    await bench.stop();
    device.kill();
  }
}

export const nobody = async () => null;

// One page all the time: how many strips it paints a second.
export const one_page = (browser) => async (bench, seconds) => {
  const page = await watched(browser);
  await page.goto(bench.url);
  await page.waitForSelector("#live-line");
  await sleep(1000 * (seconds - 4));
  const live = await page.evaluate(() => window.seen.live);
  await page.close();
  return (1000 * (live.length - 1)) / (live.at(-1) - live[0]);
};

// Pages that come and go, one that hears 56 kbit/s, and fifty open at a time.
export const crowd = (browser) => async (bench, seconds) => {
  const end = Date.now() + 1000 * seconds;
  const context = await browser.newContext();
  const slow = await context.newPage();
  const line = await context.newCDPSession(slow);
  await line.send("Network.enable");
  await line.send("Network.emulateNetworkConditions", { offline: false, latency: 200, downloadThroughput: 7000, uploadThroughput: 7000 });
  const opened = [slow.goto(bench.url, { timeout: 1000 * seconds }).catch(() => null)];
  const other = await browser.newContext();
  for (let i = 0; i < 49; i++) {
    const page = await other.newPage();
    const goes = (waitUntil) => page.goto(bench.url, { waitUntil, timeout: 1000 * seconds });
    if (i % 7 !== 3) opened.push(goes("domcontentloaded").catch(() => null));
    else {
      // in the middle of its loading: reloaded before, it would stay the blank page that it was
      await goes("commit");
      opened.push(page.reload({ waitUntil: "domcontentloaded", timeout: 1000 * seconds }).catch(() => null));
    }
  }
  await Promise.all(opened.slice(1));
  // on a busy machine fifty pages take a minute to open: they have as long as there is a recording to show
  const timeout = Math.max(1, end - Date.now());
  const shows = other.pages().map((page) => page.waitForSelector("#live-line", { timeout }).then(() => true, () => false));
  const alive = (await Promise.all(shows)).filter(Boolean).length;
  await other.close();
  await context.close();
  return alive;
};
