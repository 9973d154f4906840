// What every story of the workbench needs: a folder of its own, the workbench served from it, a browser page that may ask nobody else, and the
// commands to compare with.
import assert from "node:assert";
import { execFileSync, spawn } from "node:child_process";
import { copyFileSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { createInterface } from "node:readline";
import { chromium } from "playwright-core";

/** Longer than anything here takes on a loaded machine. */
export const LONG = { timeout: 120000 };
const [program, recordings] = process.argv.slice(2, 4).map((path) => resolve(path));
if (!recordings) throw new Error("usage: node STORY.mjs PROGRAM RECORDINGS [SHOTS]");
/** Where pictures are kept, where they are wanted. */
const shots = process.argv[4];

/** Plays a story: `files` are copied from the recordings as the names given, `words` are opened. */
export async function story(says, { files = {}, words, prepare = () => {} }, play) {
  const began = Date.now();
  const folder = mkdtempSync(join(tmpdir(), "story-"));
  const running = [];
  let browser;
  try {
    for (const [name, from] of Object.entries(files)) copyFileSync(join(recordings, from), join(folder, name));
    const text = (...args) => execFileSync(program, args, { cwd: folder, encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] });
    const command = (...args) => JSON.parse(text(...args, "--json"));
    await prepare({ folder, command, text });
    const serving = spawn(program, ["open", ...words, "--no-browser", "--json"], { cwd: folder, stdio: ["ignore", "pipe", "ignore"] });
    running.push(serving);
    const line = await new Promise((done, fail) => { createInterface(serving.stdout).once("line", done); serving.once("exit", () => fail(new Error("the workbench ended"))); });
    const { url, token } = JSON.parse(line);
    const origin = new URL(url).origin;
    browser = await chromium.launch({ executablePath: process.env.CHROMIUM || "/usr/bin/chromium", args: ["--no-sandbox", "--disable-quic"] });
    const wrong = [];
    const page = async (viewport = { width: 1440, height: 900 }, more = {}) => {
      const context = await browser.newContext({ viewport, ...more });
      const one = await context.newPage();
      one.setDefaultTimeout(LONG.timeout);
      one.on("pageerror", (error) => wrong.push(error.message));
      one.on("console", (message) => message.type() === "error" && wrong.push(message.text()));
      // a laboratory is offline: whoever else is asked does not answer, and it is a fault to ask
      one.on("request", (request) => request.url().startsWith(origin) || /^(data|blob):/.test(request.url()) || wrong.push(`asked ${request.url()}`));
      await one.goto(url);
      assert(!one.url().includes("token"), "the token leaves the address");
      return one;
    };
    const state = async () => (await fetch(`${origin}/api/state`, { headers: { Authorization: `Bearer ${token}` } })).json();
    const shot = async (one, name) => shots && one.screenshot({ path: join(shots, `${name}.png`) });
    await play({ folder, command, text, page, state, shot, origin });
    assert.deepEqual(wrong, []);
    console.log(`${says} (${((Date.now() - began) / 1000).toFixed(1)} s)`);
  } finally {
    await browser?.close();
    running.forEach((one) => one.kill());
    rmSync(folder, { recursive: true });
  }
}

/** Waits until the model in force is fitted and no job is at work. */
export async function settled(page, models = null) {
  await page.waitForFunction((count) => document.querySelector(".model.force") && document.querySelector("#job").hidden
    && (count === null || document.querySelectorAll(".model:not(.preview)").length === count), models);
}

/** The model in force of a file, as the command shows it. */
export function inForce(command, file) {
  const models = command("model", file);
  return models.models[models.in_force - 1];
}

/** Two numbers are the same but for so much of the second. */
export function close(a, b, share, what) {
  assert(Math.abs(a - b) <= share * Math.abs(b), `${what}: ${a} on the page, ${b} by the command`);
}

export const valueOf = (model, name) => model.parameter.find((p) => p.name === name)?.value;
