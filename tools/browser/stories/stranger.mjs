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

  await page.click("#diagnose");
  await page.waitForSelector(".candidate");
  await page.hover(".candidate");
  await page.waitForSelector(".model.preview");
  await page.waitForFunction(() => document.querySelector(".u-legend").textContent.includes("with viscoelastic-wall"));
  await shot(page, "preview");
  // while it is added, the curve moves and the error falls
  await page.evaluate(() => {
    window.seen = { curves: new Set(), errors: new Set() };
    const look = () => {
      const fitted = [...document.querySelectorAll(".u-legend .u-label")].some((label) => label.textContent === "being fitted");
      const canvas = document.querySelector(".chart canvas");
      if (fitted && canvas) window.seen.curves.add(canvas.toDataURL());
      const error = document.querySelector("#fitting .error")?.textContent;
      if (error) window.seen.errors.add(error);
      window.looks = setTimeout(look, 40);
    };
    look();
  });
  await page.click(".candidate button.primary");
  await settled(page, 2);
  const seen = await page.evaluate(() => { clearTimeout(window.looks); return [window.seen.curves.size, window.seen.errors.size]; });
  assert(seen[0] >= 2 && seen[1] >= 5, `${seen[0]} curves and ${seen[1]} errors were seen on the way`);
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
