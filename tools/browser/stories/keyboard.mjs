// (f) Offline and by the keyboard alone: every control is reached by Tab, and the loop is played without a mouse.
import assert from "node:assert";
import { close, inForce, settled, story, valueOf } from "./helpers.mjs";

await story("the keyboard alone ends where the commands end", { files: { "run.mcap": "hdpe-creep.mcap" }, words: ["run.mcap"] }, async ({ command, page: open, state, shot }) => {
  const page = await open();
  await settled(page);
  const focused = () => page.evaluate(() => { const a = document.activeElement; return a.dataset.key || a.id || a.getAttribute("aria-label") || a.textContent; });
  const to = async (wanted, most = 120) => {
    for (let i = 0; i < most; i++) {
      const now = await focused();
      if (wanted(now)) return now;
      await page.keyboard.press("Tab");
    }
    throw new Error(`Tab does not lead there; it ends at ${await focused()}`);
  };
  // the focus can be seen
  await to((now) => now === "diagnose");
  const outline = await page.evaluate(() => getComputedStyle(document.activeElement).outlineStyle);
  assert.notEqual(outline, "none");

  await page.keyboard.press("1");
  assert.equal(await page.getAttribute("[data-range=rise]", "aria-pressed"), "true");
  await page.keyboard.press("2");
  assert.equal(await page.getAttribute("[data-range=cycle]", "aria-pressed"), "true");
  await page.keyboard.press("3");
  await page.keyboard.press("?");
  await page.waitForSelector("#keys[open]");
  await page.keyboard.press("Escape");

  // a diagnosis is cancelled, and nothing is changed
  await page.keyboard.press("d");
  await page.waitForFunction(() => !document.querySelector("#job").hidden);
  await page.keyboard.press("Escape");
  await settled(page, 1);
  assert.equal((await state()).diagnosis, null);

  await page.keyboard.press("d");
  await page.waitForSelector(".candidate");
  await settled(page);
  await to((now) => now === "aviscoelastic-wall:3");
  await page.waitForSelector(".model.preview");
  await shot(page, "by-keyboard");
  await page.keyboard.press("Enter");
  await settled(page, 2);
  await page.waitForFunction(() => document.activeElement.id === "diagnose");

  // a slider is moved, its parameter held, the others fitted
  await to((now) => now.startsWith("wave speed"));
  for (let i = 0; i < 4; i++) await page.keyboard.press("ArrowRight");
  await page.waitForFunction(() => document.querySelector("#trial").textContent.includes("× noise"));
  const moved = Number(await page.inputValue("#parameters .parameter.moved .value"));
  await to((now) => now === "Hold wave speed");
  await page.keyboard.press("Space");
  // a bound is part of the command that does the same
  await to((now) => now === "Bounds of tau1");
  await page.keyboard.press("Enter");
  await to((now) => now === "Lower bound of tau1");
  await page.keyboard.press("Control+A");
  await page.keyboard.type("0.02");
  await page.keyboard.press("Tab");
  await page.keyboard.press("Escape");
  await to((now) => now === "copy");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#copied:not([hidden])");
  const copied = (await page.textContent("#copied")).match(/surgescope (.*)/)[1].split(" ");
  assert(copied.some((word) => word.startsWith("tau1_s=0.02:")), copied.join(" "));
  await page.keyboard.press("f");
  await settled(page, 3);
  const own = inForce(command, "run.model.toml");
  close(valueOf(own, "wave_speed_m_s"), moved, 1e-3, "the value that was held");
  assert(valueOf(own, "tau1_s") >= 0.02);
  close(own.rmse_m, command(...copied).rmse_m, 0.01, "error with the wave speed held and a bound");
  // the command has put its model into the same file
  await settled(page, 4);
  await page.keyboard.press("u");
  await page.waitForFunction(() => document.querySelectorAll(".model")[2]?.classList.contains("force"));

  // an effect is put at a place along the pipe
  await settled(page);
  await page.keyboard.press("p");
  assert.equal(await focused(), "place");
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#place[open]");
  assert(Math.abs(Number(await page.inputValue("#place input")) / (0.51 * (await state()).open.rig.length_m) - 1) < 0.02);
  await page.keyboard.press("Escape");
});
