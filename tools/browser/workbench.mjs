// Plays the loop in the workbench with the keyboard and the mouse, offline, and compares where it ends with what the commands say.
// usage: node workbench.mjs PROGRAM RECORDING
import assert from "node:assert";
import { execFileSync, spawn } from "node:child_process";
import { copyFileSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { createInterface } from "node:readline";
import { chromium } from "playwright-core";

const [program, recording] = process.argv.slice(2).map((path) => resolve(path));
const folder = mkdtempSync(join(tmpdir(), "workbench-"));
copyFileSync(recording, join(folder, "run.mcap"));
const run = (...words) => JSON.parse(execFileSync(program, [...words, "--json"], { cwd: folder, stdio: ["ignore", "pipe", "ignore"] }));

const serving = spawn(program, ["open", "run.mcap", "--no-browser", "--json"], { cwd: folder, stdio: ["ignore", "pipe", "ignore"] });
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM || "/usr/bin/chromium", args: ["--no-sandbox", "--disable-quic"] });
try {
  const [line] = await new Promise((done) => createInterface(serving.stdout).once("line", (text) => done([text])));
  const { url } = JSON.parse(line);
  const origin = new URL(url).origin;
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  const wrong = [];
  page.on("pageerror", (error) => wrong.push(error.message));
  page.on("console", (message) => message.type() === "error" && wrong.push(message.text()));
  page.on("request", (request) => request.url().startsWith(origin) || /^(data|blob):/.test(request.url()) || wrong.push(`asked ${request.url()}`));
  await page.goto(url);
  assert(!page.url().includes("token"), "the token leaves the address");
  await page.waitForSelector(".model.force");
  assert((await page.textContent("#fails")).includes("times the noise"));

  await page.keyboard.press("d");
  await page.waitForSelector(".candidate", { timeout: 120000 });
  await page.hover(".candidate");
  await page.waitForSelector(".model.preview");
  await page.click(".candidate button.primary");
  await page.waitForFunction(() => document.querySelectorAll(".model:not(.preview)").length === 2, null, { timeout: 120000 });
  await page.waitForFunction(() => document.querySelector("#fails").textContent.includes("more than its noise"));

  const by_page = run("model", "run.model.toml");
  run("calibrate", "run.mcap", "--effects", "none", "--save", "by-command.toml");
  const by_command = run("add", "viscoelastic-wall", "by-command.toml");
  const [a, b] = [by_page, by_command].map((file) => file.models[file.in_force - 1]);
  assert(Math.abs(a.rmse_m / b.rmse_m - 1) < 0.01, `${a.rmse_m} by the page, ${b.rmse_m} by the command`);
  assert.deepEqual(a.effects.map((e) => e.split(":")[0]), b.effects.map((e) => e.split(":")[0]));

  // a slider moved by the keyboard simulates; nothing of it is kept
  const slider = page.locator("#parameters input[type=range]").first();
  await slider.focus();
  for (let i = 0; i < 5; i++) await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => document.querySelector("#trial").textContent.includes("× noise"));
  assert.equal(run("model", "run.model.toml").models.length, 2);

  // a command goes back; the page follows
  run("undo", "run.model.toml");
  await page.waitForFunction(() => document.querySelector(".model.force .name")?.textContent === "base model", null, { timeout: 30000 });
  await page.keyboard.press("Escape");
  await page.locator("#diagnose").focus();
  await page.keyboard.press("r");
  await page.waitForFunction(() => document.querySelectorAll(".model")[1]?.classList.contains("force"), null, { timeout: 30000 });
  assert.deepEqual(wrong, []);
  console.log("the workbench ends where the commands end");
} finally {
  await browser.close();
  serving.kill();
  rmSync(folder, { recursive: true });
}
