// (p) A rig whose device is a program: a person sees what a recording starts, and nothing is started before they agree to it.
import assert from "node:assert";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { story } from "./helpers.mjs";

const demo = readFileSync(new URL("../../../rigs/demo-hdpe.toml", import.meta.url), "utf8");
const script = `touch started; echo ready >&2; i=0; while :; do echo $((i * 1000)),1,2,3,4,5; i=$((i + 10)); sleep 0.01; done`;
const device = /\[\[device\]\][\s\S]*?(?=\n\[\[|\n*$)/;
const rig = demo.replace(device, `[[device]]\nname = "daq"\nprotocol = "lines"\ncommand = ["sh", "-c", '${script}']\n`);

await story("a program is started when a person has agreed to it", { words: ["rig.toml"], prepare: ({ folder }) => writeFileSync(join(folder, "rig.toml"), rig) }, async ({ folder, page: open, state, shot }) => {
  assert(rig.includes(script) && !rig.includes("baud"), "the demo's device was replaced");
  const page = await open();
  await page.click("#show-record");
  await page.getByLabel("Record from").selectOption("devices");
  assert((await page.textContent("#record code")).includes("touch started"), "what it starts is shown");
  const start = page.locator("#record button.primary");
  assert(await start.isDisabled());
  await page.getByLabel("Record from").selectOption("simulated");
  assert(await start.isEnabled() && !await page.locator("#record code").isVisible(), "a simulated test starts nothing");
  await page.getByLabel("Record from").selectOption("devices");
  await shot(page, "program");
  assert(!existsSync(join(folder, "started")));
  await page.getByLabel("Start it").check();
  await start.click();
  await page.waitForFunction(() => !document.querySelector("#live").hidden && /[1-9]\d* samples/.test(document.querySelector("#live-line").textContent));
  await page.waitForFunction(() => document.querySelector("#live-trigger").textContent.includes("daq says: ready"));
  await shot(page, "program-live");
  assert(existsSync(join(folder, "started")));
  await page.click("#live >> text=Stop");
  await page.waitForFunction(() => document.querySelector("#live").hidden);
  const { recording } = await state();
  assert.equal(recording.running, false);
  assert(recording.ended.file.endsWith(".mcap"), JSON.stringify(recording.ended));
});
