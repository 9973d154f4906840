// A chart a sensor: measurement and models, below them model − measured on the same axis. All charts zoom and point together.

import { AGAIN_MS, curves, simulate } from "/assets/api.js";
import { at, digits, h, head, keyOf, put, times } from "/assets/dom.js";
import { app, complain, modelKey } from "/assets/store.js";
import { menu } from "/assets/take.js";
import { fingers } from "/assets/touch.js";

const panels = [];
// asked for many times a frame
const colours = new Map();
function colour(name) {
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return colours.get(name);
}
const SERIES = [
  { key: "measured", label: "measured", stroke: () => colour("--measured"), width: 1 },
  { key: "ghost", label: "before", stroke: () => colour("--ghost"), width: 1 },
  { key: "model", label: "model", stroke: () => colour("--model"), width: 1.5 },
  { key: "trial", label: "proposed", stroke: () => colour("--proposed"), width: 1.5, dash: [6, 4] },
];
// Of the curves, of the residual; the stylesheet keeps their sum free until they are drawn.
const HEIGHTS = [164, 100];
// Padding and border of a card on either side.
const CARD_PX = 13;
const gap = (values, n) => values || new Array(n).fill(null);
// Whether curves stand at the same times: others have as many points.
const same = (a, b) => a.length === b.length && a[0] === b[0] && a.at(-1) === b.at(-1);
const minus = (a, b) => a.map((v, i) => (v === null || b[i] === null ? null : v - b[i]));

function shown(panel, heads) {
  const unit = app.unit === "own" ? panel.sensor.unit : null;
  return unit ? heads.map((v) => (v === null ? null : v * unit.per_m + unit.zero)) : heads;
}
const symbol = (panel) => (app.unit === "own" && panel.sensor.unit ? panel.sensor.unit.symbol : "m");
const ghostly = () => (app.compare ? `model ${app.compare}` : "before");
function below(panel) {
  if (panel.data.adds && app.preview) return `model − measured; dashed: the part that ${app.preview} explains`;
  return panel.leaves ? `model − measured; ${ghostly()} is off this scale` : "model − measured";
}
const what = (panel, residual) => `${residual ? below(panel) : symbol(panel) === "m" ? "head" : "pressure"}, ${symbol(panel)}`;
const perM = (panel) => (app.unit === "own" && panel.sensor.unit ? panel.sensor.unit.per_m : 1);

function options(panel, residual) {
  const axis = { stroke: () => colour("--text-2"), grid: { stroke: () => colour("--line"), width: 1 }, ticks: { show: false } };
  const hooks = {
    drawClear: [(u) => {
      if (!residual) return;
      const noise = 2 * panel.sensor.noise_m * perM(panel);
      const [top, bottom] = [u.valToPos(noise, "y", true), u.valToPos(-noise, "y", true)];
      u.ctx.fillStyle = colour("--band");
      u.ctx.fillRect(u.bbox.left, Math.max(top, u.bbox.top), u.bbox.width, Math.min(bottom, u.bbox.top + u.bbox.height) - Math.max(top, u.bbox.top));
    }],
    draw: [(u) => {
      u.ctx.fillStyle = colour("--text-2");
      u.ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
      u.ctx.textAlign = "right";
      u.ctx.fillText(what(panel, residual), u.bbox.left + u.bbox.width - 4 * devicePixelRatio, u.bbox.top - 4 * devicePixelRatio, u.bbox.width);
    }],
    setSelect: [(u) => {
      if (u.select.width < 4) return;
      zoom([u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")]);
      u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    }],
  };
  const value = (_, v) => (v === null || v === undefined ? "" : digits(v, 5));
  return {
    height: residual ? HEIGHTS[1] : HEIGHTS[0], pxAlign: false, padding: [16, 24, residual ? 0 : 8, 0], legend: { show: !residual, live: true, mount: (_, legend) => panel.legend.replaceChildren(legend) },
    cursor: { sync: { key: "surge", setSeries: false }, drag: { x: true, y: false, setScale: false }, bind: { dblclick: () => () => { zoom(null); return null; } } },
    scales: { x: { time: false, range: () => span() }, y: { range: (u, low, high) => limits(panel, residual, low, high) } },
    axes: [{ ...axis, show: residual, size: 30, values: (_, s) => s.map((v) => `${+v.toFixed(4)} s`) }, { ...axis, size: 60, space: 36, ...(residual ? { splits: (_, __, low, high) => around0(high) } : {}) }],
    series: [{ label: "\u00a0", value: (_, v) => (v === null || v === undefined ? "" : `at ${digits(v, 5)} s`) }, ...SERIES.map((s) => ({ ...s, value, points: { show: false }, spanGaps: false }))],
    hooks,
  };
}

// How many times the residual of the model in force one before it may leave and still be drawn beside it.
const LEAVES = 5;

// Zero and a round number on either side of it.
function around0(most) {
  const size = 10 ** Math.floor(Math.log10(most));
  const round = [5, 2, 1].find((n) => n * size <= most) * size;
  return [-round, 0, round];
}

function limits(panel, residual, low, high) {
  const noise = 2.5 * panel.sensor.noise_m * perM(panel);
  if (low === null || high === null) return [-noise, noise];
  if (residual) {
    // what the model in force leaves fills the axis; what one before it left may leave it
    const [ghost, model, trial] = panel.drawn[1].slice(2);
    const own = [model, trial].flatMap((curve) => curve || []).filter((v) => v !== null);
    if (own.length) [low, high] = [Math.min(...own), Math.max(...own)];
    else if (!ghost) return [-noise, noise];
  }
  if (!residual) return [low - 0.05 * (high - low || 1), high + 0.05 * (high - low || 1)];
  const most = Math.max(Math.abs(low), Math.abs(high), noise);
  return [-1.05 * most, 1.05 * most];
}

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
    this.box = h("div", { class: "plot" });
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
  lay(width) {
    this.width = width;
    const size = new ResizeObserver(([now]) => {
      const width = Math.max(240, Math.round(now.contentRect.width));
      if (Math.abs(this.width - width) < 2) return;
      this.width = width;
      this.plots.forEach((plot, i) => plot.setSize({ width, height: HEIGHTS[i] }));
    });
    const place = new IntersectionObserver((now) => { this.away = !now.at(-1).isIntersecting; });
    this.observers = [size, place];
    this.observers.forEach((observer) => observer.observe(this.box));
  }
  end() {
    this.observers.forEach((observer) => observer.disconnect());
    this.plots.forEach((plot) => plot.destroy());
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
    const heads = [gap(measured, n), gap(ghost, n), gap(model, n), gap(trial, n)];
    const left = (v) => (v && measured ? minus(v, measured).map((d) => (d === null ? null : d * perM(this))) : gap(null, n));
    // what a candidate would take away, over what is left; of moved parameters what they would leave
    const proposed = adds && trial && model ? minus(model, trial).map((d) => (d === null ? null : d * perM(this))) : left(trial);
    const [before, now] = [left(ghost), left(model)];
    const most = (curve) => curve.reduce((high, d) => Math.max(high, Math.abs(d)), 0);
    // a line that leaves the axis at every swing shows nothing
    this.leaves = ghost && model && most(before) > LEAVES * Math.max(most(now), this.sensor.noise_m * perM(this));
    this.drawn = [[time, ...heads.map((v) => shown(this, v))], [time, gap(null, n), this.leaves ? gap(null, n) : before, now, proposed]];
    if (this.plots.length) this.plots.forEach((plot, i) => plot.setData(this.drawn[i]));
    else this.build();
    const legend = this.legend.querySelectorAll(".u-series");
    [ghost, model, trial].forEach((curve, i) => { legend[i + 2].hidden = !curve; });
    legend[2].querySelector(".u-label").textContent = ghostly();
    legend[4].querySelector(".u-label").textContent = following ? "being fitted" : app.preview ? `with ${app.preview}` : "proposed";
  }
  build() {
    this.plots = [false, true].map((residual, i) => new uPlot({ width: this.width, ...options(this, residual) }, this.drawn[i], this.box));
    this.plots.forEach((plot) => fingers(plot.over, span, (range) => (app.range || range[1] - range[0] < 0.98 * (span()[1] - span()[0])) && zoom(range)));
  }
  take(column, ghost) {
    const time = column("time_s");
    const keeps = changed() && same(time, this.data.time) && !app.preview;
    const trial = app.preview ? column(`candidate:${app.preview}_m`) : keeps ? this.data.trial : null;
    this.data = { time, measured: column("measured_m"), model: column("model_m"), ghost: column(`${ghost}_m`), trial, adds: Boolean(app.preview && trial) };
  }
}

// The curves of all sensors, to be handed to their panels.
async function ofAll(names) {
  const { column } = await curves(app.range, panels[0].width, names);
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
    panels.forEach((panel) => panel.end());
    // read before the cards are in: afterwards the browser would have to lay out the page to answer
    const width = Math.max(240, at("charts").clientWidth - 2 * CARD_PX);
    panels.splice(0, panels.length, ...open.runs.flatMap((run, r) => run.sensors.map((sensor, s) => new Panel(run, sensor, r, s))));
    put(at("charts"), panels.map((panel) => panel.card));
    panels.forEach((panel) => panel.lay(width));
  }
  for (const panel of panels) {
    panel.run = open.runs[panel.r];
    panel.sensor = panel.run.sensors[panel.s];
    const rmse = panel.sensor.rmse_m;
    panel.rms.textContent = rmse === null ? "" : `error ${head(rmse)}, ${times(rmse, panel.sensor.noise_m)}`;
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
  if (flying) { next = { coarse }; return; }
  if (!changed()) { app.followed.clear(); onTried(); panels.forEach((panel) => { panel.data.trial = null; }); draw(); at("trial").textContent = ""; return; }
  flying = true;
  const of = modelKey();
  try {
    const [from, to] = app.range || [undefined, undefined];
    const points = panels[0].width;
    const found = await simulate({ set: app.moved, without: [...app.without], from, to, points, coarse, follow: at("meanwhile").checked });
    // where another model has come into force meanwhile, the answer is not of it
    if (of === modelKey()) tried(found, coarse);
  } catch (error) { complain(error); }
  flying = false;
  if (next) { const again = next; next = null; try_(again.coarse); }
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours.clear(); panels.forEach((panel) => panel.plots.forEach((plot) => plot.redraw(false, true))); });
