// (c) A leak is put on the drawing, dragged along the pipe to its place, fitted, and undone; then the joint posterior is sampled.
import assert from "node:assert";
import { close, inForce, LONG, settled, story, valueOf } from "./helpers.mjs";

await story("a leak dragged to its place ends where the commands end", {
  files: { "run.mcap": "copper-leak.mcap" }, words: ["run.model.toml"],
  prepare: ({ command }) => command("calibrate", "run.mcap", "--effects", "unsteady-friction", "--save", "run.model.toml"),
}, async ({ command, page: open, state, shot }) => {
  const page = await open();
  await settled(page, 1);
  const { length_m: length } = (await state()).open.rig;
  // the drawing is 1000 wide, the pipe from 70 to 930
  const at = async (m) => { const box = await page.locator("#rig svg").boundingBox(); return [box.x + (box.width * (70 + (860 * m) / length)) / 1000, box.y + (box.width * 52) / 1000]; };
  await page.mouse.dblclick(...(await at(0.5 * length)));
  await page.waitForSelector("#place[open]");
  await shot(page, "place");
  await page.click('#place button[aria-label="Add leak here"]');
  await settled(page, 2);
  const found = valueOf(inForce(command, "run.model.toml"), "leak_position_m");

  // away from its place, and back by hand: the error rises and falls
  const said = () => page.textContent("#trial").then((text) => Number(text.match(/([\d.]+) × noise/)?.[1] ?? NaN));
  const marker = page.locator('#rig .marker');
  const drag = async (to) => {
    const box = await marker.locator("path").boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    for (const share of [0.25, 0.5, 0.75, 1]) {
      const [x] = await at(to);
      await page.mouse.move(box.x + box.width / 2 + share * (x - box.x - box.width / 2), box.y + box.height / 2);
      await page.waitForTimeout(40);
    }
    const before = await page.textContent("#trial");
    await page.mouse.up();
    await page.waitForFunction((old) => document.querySelector("#trial").textContent !== old || document.querySelector("#trial").textContent.includes("× noise"), before);
    await page.waitForTimeout(600);
    return said();
  };
  const away = await drag(found > 0.5 * length ? 0.2 * length : 0.8 * length);
  await shot(page, "leak-away");
  const back = await drag(found);
  assert(away > 1.3 * back, `${away} × noise away from its place, ${back} there`);
  await page.click("#fit");
  await settled(page, 3);
  await shot(page, "leak");
  const fitted = inForce(command, "run.model.toml");

  command("calibrate", "run.mcap", "--effects", "unsteady-friction", "--save", "by-command.toml");
  command("add", "leak", "by-command.toml");
  const other = inForce(command, "by-command.toml");
  close(fitted.rmse_m, other.rmse_m, 0.01, "error");
  close(valueOf(fitted, "leak_position_m"), valueOf(other, "leak_position_m"), 0.02, "place of the leak");
  await page.keyboard.press("u");
  await page.waitForFunction(() => document.querySelectorAll(".model")[1]?.classList.contains("force"));
  assert.equal(command("model", "run.model.toml").in_force, 2);

  // the joint posterior: a panel for each two parameters, and intervals that are those of the draws
  await page.click('[aria-label="How well wave speed is known"]');
  await page.click("#known [data-key=sample]");
  await page.waitForSelector("#known svg.draws", { timeout: 5 * LONG.timeout });
  await settled(page);
  const sampled = (await state()).model.parameters.filter((p) => p.posterior);
  const shown = Math.min(7, sampled.length);
  assert(shown > 2 && sampled.every((p) => p.posterior.effective_draws >= 100), JSON.stringify(sampled));
  assert.equal(await page.locator("#known svg.draws rect.grid").count(), (shown * (shown + 1)) / 2);
  assert((await page.textContent("#known")).includes("95% interval by the posterior"));
  assert.deepEqual(sampled.map((p) => p.interval_95), sampled.map((p) => p.posterior.interval_95));
  await page.locator("#known svg.draws").scrollIntoViewIfNeeded();
  await shot(page, "posterior");
});
