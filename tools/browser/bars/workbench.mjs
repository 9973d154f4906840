// A workbench at work: its address, what it takes of the machine, and a page of it in a real browser.
import { execFileSync, spawn } from "node:child_process";
import { once } from "node:events";
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { chromium } from "playwright-core";

export const DESKTOP = { width: 1440, height: 900 };
const TICKS_PER_S = 100;

export const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

export async function until(what, wished, most_ms = 120000) {
  for (const from = Date.now(); Date.now() - from < most_ms; await sleep(20)) {
    const found = await wished();
    if (found) return found;
  }
  throw new Error(`${what} did not come about`);
}

// A command that must succeed; its document where it prints one.
export function run(program, folder, ...words) {
  const text = execFileSync(program, words, { cwd: folder, stdio: ["ignore", "pipe", "ignore"], maxBuffer: 1 << 28 }).toString();
  return words.includes("--json") ? JSON.parse(text) : text;
}

export class Workbench {
  static async open(program, folder, ...paths) {
    const began = performance.now();
    const process = spawn(program, ["open", ...paths, "--no-browser", "--json"], { cwd: folder, stdio: ["ignore", "pipe", "ignore"] });
    const [line] = await once(createInterface(process.stdout), "line");
    return Object.assign(new Workbench(), { process, ...JSON.parse(line), began });
  }
  get origin() { return new URL(this.url).origin; }
  async request(path, options = {}) {
    return fetch(this.origin + path, { ...options, headers: { Authorization: `Bearer ${this.token}`, "Content-Type": "application/json", ...options.headers } });
  }
  async get(path) { return (await this.request(path)).json(); }
  async post(path, body = {}) {
    const answer = await this.request(path, { method: "POST", body: JSON.stringify(body) });
    if (answer.status >= 400) throw new Error(`${path}: ${answer.status} ${await answer.text()}`);
    return answer.json();
  }
  async fitted() { return until("a fitted model", async () => { const state = await this.get("/api/state"); return state.model && !state.job && state; }); }
  status(key) { return Number(readFileSync(`/proc/${this.process.pid}/status`, "utf8").match(new RegExp(`${key}:\\s+(\\d+)`))[1]) / 1024; }
  memory() { return this.status("VmRSS"); }
  most() { return this.status("VmHWM"); }
  // seconds of processor time so far
  cpu() {
    const fields = readFileSync(`/proc/${this.process.pid}/stat`, "utf8").split(") ")[1].split(" ");
    return (Number(fields[11]) + Number(fields[12])) / TICKS_PER_S;
  }
  async stop(signal = "SIGTERM") {
    if (this.process.exitCode !== null || this.process.signalCode) return;
    const ended = once(this.process, "exit");
    this.process.kill(signal);
    await ended;
  }
}

export const browser = () => chromium.launch({ executablePath: process.env.CHROMIUM || "/usr/bin/chromium", args: ["--no-sandbox", "--disable-quic"] });

export const sorted = (values) => [...values].sort((a, b) => a - b);
export const share = (values, part) => sorted(values)[Math.min(values.length - 1, Math.ceil(part * values.length) - 1)];
export const median = (values) => share(values, 0.5);
export const ms = (value) => `${value.toFixed(value < 10 ? 1 : 0)} ms`;
