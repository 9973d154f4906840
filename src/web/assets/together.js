// All sensors in one chart: the measurement of each in a colour of its own, the model over it.

import { h } from "/assets/dom.js";
import { marks, reading } from "/assets/marks.js";
import { colour, onScales, plots, symbol } from "/assets/plot.js";

const COLOURS = ["--measured", "--run2", "--run3", "--run4", "--run5"];
const of = (i) => COLOURS[i % COLOURS.length];

export class Together {
  // `panels` are the charts of the sensors, which go on taking the curves.
  constructor(panels, axis) {
    Object.assign(this, { panels, axis, plots: [], drawn: [[], []], data: {} });
    this.reading = h("output", { class: "reading" });
    this.box = h("div", { class: "plot" }, this.reading);
    const name = (panel) => `${panel.sensor.name}${panel.run === panels[0].run ? "" : ` ${panel.run.name}`}`;
    this.names = panels.map(name);
    const key = (text, stroke) => h("span", { class: "key" }, h("i", { class: "swatch", style: { background: `var(${stroke})` } }), text);
    this.card = h("div", { class: "card chart", role: "group", "aria-label": "Measurement and model at all sensors" },
      h("h3", {}, h("b", { text: "All sensors" }), h("div", { class: "legend" }, this.names.map((text, i) => key(text, of(i))), key("model", "--model"))), this.box);
    this.legend = h("div");
    this.lay();
  }
  lay() {
    const { panels } = this;
    // one unit for all, and the noise of the loudest
    this.sensor = { ...panels[0].sensor, noise_m: Math.max(...panels.map((panel) => panel.sensor.noise_m)) };
  }
  end() {
    this.plots.forEach((plot) => plot.destroy());
  }
  read() {
    const [plot] = this.plots;
    if (!plot) return;
    const cursor = plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null;
    const each = this.panels.map((panel, i) => reading(panel.drawn[0][0], [[this.names[i], panel.drawn[0][2]]], cursor, symbol(this)));
    // the time is the same for all
    const text = each.map((said, i) => (i ? said.split(" · ").slice(1).join(" · ") : said)).filter(Boolean).join(" · ");
    if (text === this.reading.textContent) return;
    this.reading.textContent = text;
  }
  fills() {
    return this.drawn[1].slice(1);
  }
  draw() {
    this.lay();
    const known = this.panels.filter((panel) => panel.drawn[0].length);
    if (known.length < this.panels.length) return;
    // measurement, model and what is tried of each, at the times of all; a sensor that has none at a time has a line across it
    this.drawn = [0, 1].map((i) => uPlot.join(this.panels.map((panel) => [panel.drawn[i][0], ...panel.drawn[i].slice(2)])));
    const data = onScales(this.drawn, this.plots, (n) => n > 0 && n % 3 === 0);
    if (this.plots.length) this.plots.forEach((plot, i) => plot.setData(data[i]));
    else this.build();
  }
  build() {
    const series = this.panels.flatMap((_, i) => [
      { label: this.names[i], stroke: () => colour(of(i)), width: 3 },
      { label: `model ${this.names[i]}`, stroke: (u) => colour(u === this.plots[1] ? of(i) : "--model"), width: 1.5 },
      { label: `proposed ${this.names[i]}`, stroke: () => colour("--proposed"), width: 1.5, dash: [6, 4] },
    ]).map((one) => ({ ...one, spanGaps: true }));
    this.plots = plots(this, this.axis, series);
    if (marks.any()) this.read();
  }
}
