// A chart a sensor: measurement and models, below them model − measured on the same axis. All charts zoom and point together.

import { AGAIN_MS, curves, simulate } from "/assets/api.js";
import { at, digits, h, head, keyOf, put, times } from "/assets/dom.js";
import { app, complain, modelKey } from "/assets/store.js";
import { measure, panels, whenWider, widthOf } from "/assets/heights.js";
import { clicks, marks, reading, whenMarked } from "/assets/marks.js";
import { colours, ghostly, options, perM, shown, symbol, what } from "/assets/plot.js";
import { menu } from "/assets/take.js";
import { fingers } from "/assets/touch.js";

const gap = (values, n) => values || new Array(n).fill(null);
// Whether curves stand at the same times: others have as many points.
const same = (a, b) => a.length === b.length && a[0] === b[0] && a.at(-1) === b.at(-1);
const minus = (a, b) => a.map((v, i) => (v === null || b[i] === null ? null : v - b[i]));

// How many times the residual of the model in force one before it may leave and still be drawn beside it.
const LEAVES = 5;

// What all charts show, s.
export function span() {
  if (app.range) return app.range;
  const runs = app.state?.open?.runs || [];
  return [Math.min(...runs.map((r) => r.from_s)), Math.max(...runs.map((r) => r.to_s))];
}

// One request for curves at a time, and the latest range wins.
let loading = false;
let late = false;
async function follow() {
  if (loading) { late = true; return; }
  loading = true;
  await load();
  loading = false;
  if (late) { late = false; follow(); }
}

export function zoom(range) {
  const whole = ((kept) => { app.range = null; const all = span(); app.range = kept; return all; })(app.range);
  app.range = range && [Math.max(whole[0], range[0]), Math.min(whole[1], range[1])];
  if (app.range && app.range[1] - app.range[0] < 1e-5) app.range = null;
  press(app.range ? "" : "all");
  draw();
  follow();
}

export function pan(share) {
  if (!app.range) return;
  const by = share * (app.range[1] - app.range[0]);
  zoom(app.range.map((s) => s + by));
}

export function part(name) {
  const period = app.state?.open?.runs[0]?.period_s;
  if (name === "all" || !period) return zoom(null);
  zoom(name === "rise" ? [-0.03 * period, 0.3 * period] : [-0.05 * period, 1.05 * period]);
  press(name);
}

function press(name) {
  document.querySelectorAll("[data-range]").forEach((button) => button.setAttribute("aria-pressed", String(button.dataset.range === name)));
}

class Panel {
  constructor(run, sensor, r, s) {
    // what was drawn last: the curves and the residual
    Object.assign(this, { run, sensor, r, s, data: { time: [] }, plots: [], drawn: [[], []] });
    this.rms = h("span", { class: "rms" });
    this.legend = h("div", { class: "legend" });
    this.reading = h("output", { class: "reading" });
    this.box = h("div", { class: "plot" });
    const several = app.state.open.runs.length > 1 ? ` · ${run.name}` : "";
    this.card = h("div", { class: "card chart", role: "group", "aria-label": `Measurement and model at ${sensor.name}` },
      h("h3", {}, h("b", { text: sensor.name }), ` ${digits(sensor.position_m, 4)} m${several}`, this.legend, this.reading, this.rms, menu(this)), this.box);
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
    this.card.classList.toggle("reads", Boolean(text));
  }
  // The curve of the model that is being fitted, where it stands at the times that are shown.
  watch(column) {
    const [time, now] = [column("time_s"), column("fitting_m")];
    if (!now) return;
    if (!this.data.time.length) this.data = { time, measured: column("measured_m") };
    if (same(time, this.data.time)) Object.assign(this.data, { trial: now, adds: false });
  }
  draw() {
    const { time, measured, ghost, model, trial, adds } = this.data;
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
    if (this.plots.length) this.plots.forEach((plot, i) => plot.setData(this.drawn[i]));
    else this.build();
    const legend = this.legend.querySelectorAll(".u-series");
    [[1, ghost], [3, model]].forEach(([i, curve]) => { legend[i].hidden = !curve; });
    // one that comes and goes with the hand moves nothing
    legend[4].classList.toggle("none", !trial);
    legend[1].querySelector(".u-label").textContent = ghostly();
    legend[4].querySelector(".u-label").textContent = following ? "being fitted" : app.preview ? `with ${app.preview}` : "proposed";
  }
  build() {
    this.plots = [false, true].map((residual, i) => new uPlot({ width: widthOf(), ...options(this, residual, { span, zoom }) }, this.drawn[i], this.box));
    this.plots.forEach((plot) => {
      clicks(plot);
      fingers(plot.over, span, (range) => (app.range || range[1] - range[0] < 0.98 * (span()[1] - span()[0])) && zoom(range));
    });
    if (marks.any()) this.read();
  }
  take(column, ghost) {
    const time = column("time_s");
    const keeps = changed() && same(time, this.data.time) && !app.preview;
    const trial = app.preview ? column(`candidate:${app.preview}_m`) : keeps ? this.data.trial : null;
    this.data = { time, measured: column("measured_m"), model: column("model_m"), ghost: column(`${ghost}_m`), trial, adds: Boolean(app.preview && trial) };
  }
}

// How many points the charts have: curves that are laid over each other have as many. A pane of another width gets others.
let points = 0;
whenWider(() => points && points !== widthOf() && load());

// The curves of all sensors, to be handed to their panels.
async function ofAll(names) {
  const { column } = await curves(app.range, points, names);
  const of = (panel) => (name) => column[`${panel.r}/${panel.s}/${name}`];
  return (hand) => panels.filter((panel) => of(panel)("time_s")).forEach((panel) => hand(panel, of(panel)));
}

// The model that is being fitted, a few times a second, until its job ends.
let following = null;
const EVERY_MS = 200;
export async function watchFit(job) {
  if (following) return;
  following = job;
  const until = (ms) => new Promise((done) => setTimeout(done, Math.max(20, ms)));
  // at once there is nothing to see; a fit of half a second is to be seen, too
  await until(EVERY_MS / 4);
  while (app.state?.job?.id === following) {
    const began = performance.now();
    // a curve that cannot be had at the moment is had the next time
    const each = await ofAll(["fitting"]).catch(() => null);
    if (each && app.state?.job?.id === following) { each((panel, column) => panel.watch(column)); draw(true); }
    await until(each ? EVERY_MS - (performance.now() - began) : AGAIN_MS);
  }
  following = null;
  panels.forEach((panel) => { panel.data.trial = null; });
  load();
}

// Builds the charts where other recordings are open, and labels them.
let title = null;
export function charts() {
  const open = app.state.open;
  if (!open) { put(at("charts"), h("p", { class: "card empty", text: "Nothing is open yet: choose a run, or drop a file here." })); title = null; return; }
  if (open.title !== title) {
    title = open.title;
    app.range = null;
    marks.clear();
    panels.forEach((panel) => panel.end());
    panels.splice(0, panels.length, ...open.runs.flatMap((run, r) => run.sensors.map((sensor, s) => new Panel(run, sensor, r, s))));
    // read before the cards are in: afterwards the browser would have to lay out the page to answer
    measure();
    put(at("charts"), panels.map((panel) => panel.card));
    panels.forEach((panel) => panel.lay());
  }
  for (const panel of panels) {
    panel.run = open.runs[panel.r];
    panel.sensor = panel.run.sensors[panel.s];
    const rmse = panel.sensor.rmse_m;
    put(panel.rms, ...(rmse === null ? [] : [h("span", { class: "long", text: `error ${head(rmse)}, ` }), times(rmse, panel.sensor.noise_m)]));
  }
}

// What is on the screen at once, the rest after the frame; while a curve moves only what is on the screen.
export function draw(moving = false) {
  panels.forEach((panel) => panel.away || panel.draw());
  if (!moving) requestAnimationFrame(() => setTimeout(() => panels.forEach((panel) => panel.away && panel.draw())));
}

let latest = 0;
export async function load() {
  if (!panels.length) return;
  const mine = ++latest;
  points = widthOf();
  const ghost = app.compare ? `number:${app.compare}` : "previous";
  const names = ["model", ghost, ...(app.preview ? [`candidate:${app.preview}`] : [])];
  try {
    const each = await ofAll(names);
    // what was asked for since then counts, however late this answer comes
    if (mine !== latest) return;
    each((panel, column) => panel.take(column, ghost));
    draw();
    const curveless = app.preview && !panels.some((panel) => panel.data.trial);
    if (curveless || !changed()) at("trial").textContent = curveless ? `no curve is kept of ${app.preview}: its fit was given up early` : "";
    if (changed() && !app.preview) try_();
  } catch (error) { if (mine === latest) complain(error); }
}

let onTried = () => {};
export const whenTried = (redraw) => { onTried = redraw; };
const changed = () => Object.keys(app.moved).length > 0 || app.without.size > 0;

function tried(found, coarse) {
  for (const panel of panels) {
    const model = found.column[`${panel.r}/${panel.s}/model_m`];
    panel.data.adds = false;
    panel.data.trial = model.length === panel.data.time.length ? model : null;
  }
  draw(coarse);
  app.followed = new Map(found.followed.map((p) => [keyOf(p), p.value]));
  onTried();
  const others = at("meanwhile").checked ? ", the others after a few steps (a fit goes on from there)" : "";
  const grid = found.coarse ? ` (coarse grid, ${found.reaches} reaches)` : "";
  at("trial").textContent = `with these values${others}: error ${head(found.rmse_m)}, ${times(found.rmse_m, found.noise_m)}${grid}`;
}

// Simulates with what a person has moved: one request at a time, and the latest values win.
let flying = false;
let next = null;
export async function try_(coarse = false) {
  app.drags = coarse;
  if (flying) { next = { coarse }; return; }
  if (!changed()) { app.followed.clear(); onTried(); panels.forEach((panel) => { panel.data.trial = null; }); draw(); at("trial").textContent = ""; return; }
  flying = true;
  const of = modelKey();
  try {
    const [from, to] = app.range || [undefined, undefined];
    const found = await simulate({ set: app.moved, without: [...app.without], from, to, points, coarse, follow: at("meanwhile").checked });
    // where another model has come into force meanwhile, the answer is not of it
    if (of === modelKey()) tried(found, coarse);
  } catch (error) { complain(error); }
  flying = false;
  if (next) { const again = next; next = null; try_(again.coarse); }
}

// The key that sets a mark: where the cursor is, or in the middle of what is shown.
export function mark() {
  const plot = panels.find((panel) => panel.plots.length)?.plots[0];
  if (plot) marks.add(plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : (span()[0] + span()[1]) / 2);
}
whenMarked(() => panels.forEach((panel) => { panel.plots.forEach((plot) => plot.redraw(false, false)); panel.read(); }));

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours.clear(); panels.forEach((panel) => panel.plots.forEach((plot) => plot.redraw(false, true))); });
