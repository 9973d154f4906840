// A slider dragged by the mouse: how long until the curve of a value is on the screen, and how many curves a second there are.
import { DESKTOP, Workbench, share, sleep } from "./workbench.mjs";

// Notes in the page when a slider moved, when a simulation was asked for, and when its curves had been painted.
function watch() {
  const seen = { moved: [], asked: [], painted: [] };
  window.seen = seen;
  addEventListener("input", (event) => event.target.type === "range" && seen.moved.push(event.timeStamp), true);
  const plain = window.fetch;
  let answered = 0;
  window.fetch = async (address, options) => {
    if (address !== "/api/simulate") return plain(address, options);
    const at = performance.now();
    const answer = await plain(address, options);
    answered = at;
    return answer;
  };
  const channel = new MessageChannel();
  channel.port1.onmessage = ({ data }) => seen.painted.push([data, performance.now()]);
  let uPlot;
  Object.defineProperty(window, "uPlot", {
    get: () => uPlot,
    set: (made) => {
      uPlot = new Proxy(made, {
        construct: (target, [options, ...rest]) => {
          const hooks = { ...options.hooks, draw: [...(options.hooks?.draw || []), () => {
            if (!answered) return;
            const of = answered;
            answered = 0;
            // after the frame that shows it
            requestAnimationFrame(() => channel.port2.postMessage(of));
          }] };
          return new target({ ...options, hooks }, ...rest);
        },
      });
    },
  });
}

export async function slider(program, folder, browser, recording, seconds = 4) {
  const bench = await Workbench.open(program, folder, recording);
  try {
    await bench.fitted();
    const page = await browser.newPage({ viewport: DESKTOP });
    await page.addInitScript(watch);
    await page.goto(bench.url);
    const handle = page.locator("#parameters input[type=range]").first();
    await handle.waitFor();
    await page.waitForFunction(() => document.querySelectorAll(".uplot").length > 1);
    await sleep(500);
    const box = await handle.boundingBox();
    const at = (part) => [box.x + box.width * part, box.y + box.height / 2];
    await page.mouse.move(...at(0.5));
    await page.mouse.down();
    const from = Date.now();
    for (let i = 0; Date.now() - from < 1000 * seconds; i++) {
      await page.mouse.move(...at(0.5 + 0.3 * Math.sin(i / 15)));
      await sleep(12);
    }
    await page.mouse.up();
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
