// What a person takes away of a chart: numbers, a picture.

import { h, svg } from "/assets/dom.js";
import { app } from "/assets/store.js";

function save(blob, name) {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function png(panel) {
  const canvases = panel.plots.map((plot) => plot.ctx.canvas);
  const whole = h("canvas", { width: canvases[0].width, height: canvases.reduce((sum, c) => sum + c.height, 0) });
  const context = whole.getContext("2d");
  context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--card").trim();
  context.fillRect(0, 0, whole.width, whole.height);
  canvases.reduce((y, canvas) => { context.drawImage(canvas, 0, y); return y + canvas.height; }, 0);
  whole.toBlob((blob) => save(blob, `${panel.sensor.name}.png`));
}

function picture(panel) {
  const [width, height] = [900, 360];
  const lines = [["measured", "#1f2430"], ["model", "#c8500a"], ["trial", "#0a66c2"]].filter(([key]) => panel.data[key]);
  const time = panel.data.time;
  const all = lines.flatMap(([key]) => panel.data[key].filter((v) => v !== null));
  const [low, high] = [Math.min(...all), Math.max(...all)];
  const x = (t) => (60 + (820 * (t - time[0])) / (time.at(-1) - time[0])).toFixed(1);
  const y = (v) => (310 - (280 * (v - low)) / (high - low || 1)).toFixed(1);
  const path = (values) => values.map((v, i) => (v === null ? "" : `${i && values[i - 1] !== null ? "L" : "M"}${x(time[i])} ${y(v)}`)).join("");
  const label = (text, px, py, anchor = "start") => svg("text", { x: px, y: py, "text-anchor": anchor, "font-size": 13, text });
  const drawn = svg("svg", { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${width} ${height}`, width, height, "font-family": "sans-serif" },
    svg("rect", { width, height, fill: "#fff" }),
    lines.map(([key, stroke]) => svg("path", { d: path(panel.data[key]), fill: "none", stroke, "stroke-width": 1.3 })),
    lines.map(([key, fill], i) => svg("text", { x: 70 + 110 * i, y: 20, fill, "font-size": 13, text: key === "trial" ? "proposed" : key })),
    label(`${high.toFixed(2)} m`, 55, 34, "end"), label(`${low.toFixed(2)} m`, 55, 314, "end"),
    label(`${time[0].toFixed(3)} s`, 60, 335), label(`${time.at(-1).toFixed(3)} s after the start of the closure`, 880, 335, "end"));
  save(new Blob([drawn.outerHTML], { type: "image/svg+xml" }), `${panel.sensor.name}.svg`);
}

// The curves that the chart shows, over the stretch that it shows.
function table(panel, kind) {
  const shown = ["model", app.compare ? `number:${app.compare}` : "previous", app.preview && `candidate:${app.preview}`].filter(Boolean);
  const query = new URLSearchParams({ run: panel.r, sensor: panel.s, points: 20000, curves: shown.join(",") });
  if (app.range) { query.set("from", app.range[0]); query.set("to", app.range[1]); }
  h("a", { href: `/api/curves.${kind}?${query}`, download: `${panel.sensor.name}.${kind}` }).click();
}

export function menu(panel) {
  const item = (text, work) => h("button", { type: "button", text, onclick: (e) => { work(panel); e.target.closest("details").open = false; } });
  return h("details", { class: "menu" }, h("summary", { "aria-label": `Take away the chart of ${panel.sensor.name}`, title: "Take away", text: "⤓" }),
    h("div", {}, item("CSV", (of) => table(of, "csv")), item("Parquet", (of) => table(of, "parquet")), item("PNG", png), item("SVG", picture)));
}
