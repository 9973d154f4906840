// What a person takes away of a chart: numbers, a picture.

import { h } from "/assets/dom.js";
import { app, complain } from "/assets/store.js";
import { asPng, asSvg, picture } from "/assets/picture.js";

function save(blob, name) {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const fileOf = (panel) => `${panel.run.name.replace(/\.[^.]+$/, "")}-${panel.sensor.name}`;

// The curves that the chart shows, over the stretch and in the unit that it shows. The server names the file.
function table(panel, kind) {
  const shown = ["model", app.compare ? `number:${app.compare}` : "previous", app.preview && `candidate:${app.preview}`].filter(Boolean);
  const query = new URLSearchParams({ run: panel.r, sensor: panel.s, points: 20000, curves: shown.join(","), unit: app.unit });
  if (app.range) { query.set("from", app.range[0]); query.set("to", app.range[1]); }
  h("a", { href: `/api/curves.${kind}?${query}`, download: "" }).click();
}

export function menu(panel) {
  const item = (text, work) => h("button", { type: "button", text, onclick: (e) => { e.target.closest("details").open = false; Promise.resolve().then(work).catch(complain); } });
  return h("details", { class: "menu" }, h("summary", { "aria-label": `Take away the chart of ${panel.sensor.name}`, title: "Take away", text: "⤓" }),
    h("div", {}, item("CSV", () => table(panel, "csv")), item("Parquet", () => table(panel, "parquet")),
      item("PNG", async () => save(await asPng(picture(panel.pictured())), `${fileOf(panel)}.png`)), item("SVG", () => save(asSvg(picture(panel.pictured())), `${fileOf(panel)}.svg`))));
}
