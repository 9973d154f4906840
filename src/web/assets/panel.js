// The chart of a sensor: measurement and models, below them model − measured on the same axis.

import { digits, h } from "/assets/dom.js";
import { app } from "/assets/store.js";
import { marks, reading } from "/assets/marks.js";
import { ghostly, onScales, perM, plots, shown, symbol, what } from "/assets/plot.js";
import { menu } from "/assets/take.js";

const gap = (values, n) => values || new Array(n).fill(null);
// Whether curves stand at the same times: others have as many points.
const same = (a, b) => a.length === b.length && a[0] === b[0] && a.at(-1) === b.at(-1);
const minus = (a, b) => a.map((v, i) => (v === null || b[i] === null ? null : v - b[i]));

// How many times the residual of the model in force one before it may leave and still be drawn beside it.
const LEAVES = 5;

export class Panel {
  // `axis` has what all charts show, `span`, and what changes it, `zoom`.
  constructor(run, sensor, r, s, axis) {
    // what was drawn last: the curves and the residual
    Object.assign(this, { run, sensor, r, s, axis, data: { time: [] }, plots: [], drawn: [[], []] });
    this.rms = h("span", { class: "rms" });
    this.legend = h("div", { class: "legend" });
    this.reading = h("output", { class: "reading" });
    this.box = h("div", { class: "plot" }, this.reading);
    const several = app.state.open.runs.length > 1 ? ` · ${run.name}` : "";
    this.card = h("div", { class: "card chart", role: "group", "aria-label": `Measurement and model at ${sensor.name}` },
      h("h3", {}, h("b", { text: sensor.name }), ` ${digits(sensor.position_m, 4)} m${several}`, this.legend, this.rms, menu(this)), this.box);
  }
  // The chart as picture.js takes it.
  pictured() {
    if (!this.plots.length) throw new Error(`${this.sensor.name} has no curve yet`);
    const names = [...this.legend.querySelectorAll(".u-series .u-label")].slice(1).map((label) => label.textContent);
    const title = `${this.run.name} · ${this.sensor.name} at ${digits(this.sensor.position_m, 4)} m${this.rms.textContent ? ` · ${this.rms.textContent}` : ""}`;
    return { plots: this.plots, title, what: [false, true].map((residual) => what(this, residual)), names, noise: 2 * this.sensor.noise_m * perM(this) };
  }
  lay() {
    this.place = new IntersectionObserver((now) => { this.away = !now.at(-1).isIntersecting; });
    this.place.observe(this.box);
  }
  end() {
    this.place.disconnect();
    this.plots.forEach((plot) => plot.destroy());
  }
  // What lies between two marks, or between one and the cursor.
  read() {
    const [plot] = this.plots;
    if (!plot) return;
    const [time, , ...heads] = this.drawn[0];
    const cursor = plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null;
    const said = ["measured", "model", "proposed"].map((name, i) => [name, heads[i]]);
    const text = reading(time, said, cursor, symbol(this));
    if (text === this.reading.textContent) return;
    this.reading.textContent = text;
  }
  // The curve of the model that is being fitted, where it stands at the times that are shown.
  watch(column) {
    const [time, now] = [column("time_s"), column("fitting_m")];
    if (!now) return false;
    if (!this.data.time.length) this.data = { time, measured: column("measured_m") };
    if (same(time, this.data.time)) Object.assign(this.data, { trial: now, adds: false, fitting: true });
    return true;
  }
  draw() {
    const { time, measured, ghost, model, trial, adds, fitting } = this.data;
    const n = time.length;
    // an empty chart would cost as much as one with curves
    if (!n && !this.plots.length) return;
    const heads = [gap(ghost, n), gap(measured, n), gap(model, n), gap(trial, n)];
    const left = (v) => (v && measured ? minus(v, measured).map((d) => (d === null ? null : d * perM(this))) : gap(null, n));
    // what a candidate would take away, over what is left; of moved parameters what they would leave
    const proposed = adds && trial && model ? minus(model, trial).map((d) => (d === null ? null : d * perM(this))) : left(trial);
    const [before, now] = [left(ghost), left(model)];
    const most = (curve) => curve.reduce((high, d) => Math.max(high, Math.abs(d)), 0);
    // a line that leaves the axis at every swing shows nothing
    this.leaves = ghost && model && most(before) > LEAVES * Math.max(most(now), this.sensor.noise_m * perM(this));
    this.drawn = [[time, ...heads.map((v) => shown(this, v))], [time, this.leaves ? gap(null, n) : before, gap(null, n), now, proposed]];
    // all sensors may stand in one chart instead
    if (!this.box.isConnected) return;
    const data = onScales(this.drawn, this.plots, (n) => n === 4);
    if (this.plots.length) this.plots.forEach((plot, i) => plot.setData(data[i]));
    else this.build();
    const legend = this.legend.querySelectorAll(".u-series");
    [[1, ghost], [3, model]].forEach(([i, curve]) => { legend[i].hidden = !curve; });
    // one that comes and goes with the hand moves nothing
    legend[4].classList.toggle("none", !trial);
    legend[1].querySelector(".u-label").textContent = ghostly();
    legend[4].querySelector(".u-label").textContent = fitting ? "being fitted" : app.preview ? `with ${app.preview}` : "proposed";
  }
  build() {
    this.plots = plots(this, this.axis);
    if (marks.any()) this.read();
  }
  // What fills the axis of the residual; what one before it left may leave it.
  fills() {
    return this.drawn[1].slice(3);
  }
  take(column, ghost, keepsTrial) {
    const time = column("time_s");
    const keeps = keepsTrial && same(time, this.data.time) && !app.preview;
    const trial = app.preview ? column(`candidate:${app.preview}_m`) : keeps ? this.data.trial : null;
    this.data = { time, measured: column("measured_m"), model: column("model_m"), ghost: column(`${ghost}_m`), trial, adds: Boolean(app.preview && trial) };
  }
}
