// When something is on the screen: a page tells it itself, after the frame that shows it.
import { DESKTOP, sleep } from "./workbench.mjs";

// Notes in a page when a chart that has numbers was first painted, and each time the curves of a simulation were.
function watch() {
  const seen = { chart: null, moved: [], painted: [], live: [] };
  window.seen = seen;
  const channel = new MessageChannel();
  channel.port1.onmessage = ({ data: [what, value] }) => {
    const now = performance.now();
    if (what === "chart") seen.chart ??= now;
    else if (what === "live") seen.live.push(now);
    else seen.painted.push([value, now]);
  };
  const after = (...told) => requestAnimationFrame(() => channel.port2.postMessage(told));
  addEventListener("input", (event) => event.target.type === "range" && seen.moved.push(event.timeStamp), true);
  const plain = window.fetch;
  let answered = 0;
  window.fetch = async (address, options) => {
    const asked = performance.now();
    const answer = await plain(address, options);
    if (address === "/api/simulate") answered = asked;
    return answer;
  };
  let uPlot;
  Object.defineProperty(window, "uPlot", {
    get: () => uPlot,
    set: (made) => {
      const drawn = (plot) => {
        if (seen.chart === null && plot.data[0].length) after("chart");
        if (answered) after("curves", answered);
        answered = 0;
      };
      uPlot = new Proxy(made, { construct: (of, [options, ...rest]) => new of({ ...options, hooks: { ...options.hooks, draw: [drawn] } }, ...rest) });
    },
  });
  // the line above the strips changes with each
  let strip = null;
  addEventListener("DOMContentLoaded", () => new MutationObserver(() => {
    const text = document.getElementById("live-line")?.textContent;
    if (!text || text === strip) return;
    strip = text;
    after("live");
  }).observe(document.getElementById("live"), { childList: true, subtree: true, characterData: true }));
}

export async function watched(browser, viewport = DESKTOP) {
  const page = await browser.newPage({ viewport });
  await page.addInitScript(watch);
  return page;
}

// Milliseconds from the request for the page to its first chart. The page is left alone until then: a question would cost it 20 ms.
export async function first_chart(page, url) {
  await page.goto(url, { waitUntil: "commit" });
  for (let looks = 0; looks < 120; looks++) {
    await sleep(500);
    const chart = await page.evaluate(() => window.seen?.chart);
    if (chart) return chart;
  }
  throw new Error(`no chart within a minute at ${url}`);
}
