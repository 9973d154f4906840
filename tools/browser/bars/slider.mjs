// A slider dragged by the mouse: how long until the curve of a value is on the screen, and how many curves a second there are;
// `meanwhile` the other parameters follow.
import { watched } from "./paint.mjs";
import { Workbench, share, sleep } from "./workbench.mjs";

export async function slider(program, folder, browser, recording, meanwhile = false, seconds = 4) {
  const bench = await Workbench.open(program, folder, recording);
  try {
    await bench.fitted();
    const page = await watched(browser);
    await page.goto(bench.url);
    const handle = page.locator("#parameters input[type=range]").first();
    await handle.waitFor();
    await page.waitForFunction(() => document.querySelectorAll(".uplot").length > 1);
    if (meanwhile) await page.check("#meanwhile");
    await sleep(500);
    const box = await handle.boundingBox();
    const at = (part) => [box.x + box.width * part, box.y + box.height / 2];
    const input = await page.context().newCDPSession(page);
    const mouse = (type, part) => input.send("Input.dispatchMouseEvent", { type, x: at(part)[0], y: at(part)[1], button: "left", buttons: 1, clickCount: 1 });
    await mouse("mousePressed", 0.5);
    // as a hand moves it: the next place does not wait until the last is drawn
    const moves = [];
    for (let from = Date.now(), now = 0; now < seconds; now = (Date.now() - from) / 1000) {
      moves.push(mouse("mouseMoved", 0.5 + 0.3 * Math.sin(4 * now)));
      await sleep(16);
    }
    await Promise.all(moves);
    await mouse("mouseReleased", 0.5);
    await sleep(500);
    const { moved, painted } = await page.evaluate(() => window.seen);
    await page.close();
    // the first curves on the screen that were asked for after the slider had moved
    const waits = moved.map((at) => painted.find(([asked]) => asked >= at)?.[1] - at).filter(Number.isFinite);
    const during = painted.filter(([asked]) => asked <= moved.at(-1));
    const rate = (1000 * (during.length - 1)) / (during.at(-1)[1] - during[0][1]);
    return { moves: moved.length, least: Math.min(...waits), median: share(waits, 0.5), p95: share(waits, 0.95), rate };
  } finally {
    await bench.stop();
  }
}
