// (e) Two tabs and a command line work on one model.
import assert from "node:assert";
import { inForce, settled, story } from "./helpers.mjs";

await story("two tabs and a command line see one model", { files: { "run.mcap": "hdpe-creep.mcap" }, words: ["run.mcap"] }, async ({ command, page: open, state }) => {
  const [one, other] = [await open(), await open()];
  await Promise.all([settled(one), settled(other)]);
  const errors = async (page) => page.locator(".model:not(.preview) .error").allTextContents();

  // what one adds, the other sees, while it runs and at its end
  await one.click("#show-catalogue");
  await one.click('#catalogue button[aria-label="Add viscoelastic-wall"]');
  await other.waitForFunction(() => !document.querySelector("#job").hidden && document.querySelector("#job").textContent.includes("adding viscoelastic-wall"));
  assert(await other.locator("#fit").isDisabled(), "one job at a time");
  await Promise.all([settled(one, 2), settled(other, 2)]);
  assert.deepEqual(await errors(one), await errors(other));

  // a command goes back; both follow
  command("undo", "run.model.toml");
  for (const page of [one, other]) await page.waitForFunction(() => document.querySelector(".model.force .name")?.textContent === "base model");
  // the other goes forth; the command sees it
  await settled(other);
  await other.click("text=↷ Redo");
  await one.waitForFunction(() => document.querySelectorAll(".model")[1]?.classList.contains("force"));
  await Promise.all([settled(one), settled(other)]);
  assert.equal(command("model", "run.model.toml").in_force, 2);

  // a command adds a third model
  command("add", "sensor-gain@P1", "run.model.toml");
  await Promise.all([settled(one, 3), settled(other, 3)]);
  const [file, now] = [inForce(command, "run.model.toml"), await state()];
  assert.deepEqual(now.model.effects, file.effects);
  assert(Math.abs(now.model.rmse_m / file.rmse_m - 1) < 1e-3, `${now.model.rmse_m} and ${file.rmse_m}`);
});
