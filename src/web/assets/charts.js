// The charts: what they show, from when to when, and where their curves come from. All zoom and point together.

import { AGAIN_MS, curves, simulate } from "/assets/api.js";
import { at, h, head, keyOf, put, times } from "/assets/dom.js";
import { app, complain, modelKey } from "/assets/store.js";
import { cards, measure, whenWider, widthOf } from "/assets/heights.js";
import { marks, whenMarked } from "/assets/marks.js";
import { Panel } from "/assets/panel.js";
import { colours } from "/assets/plot.js";
import { Together } from "/assets/together.js";

// The charts of all sensors, and the one of all together where that is wanted.
export const panels = [];
let together = null;
let wanted = false;

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
  await until(EVERY_MS / 8);
  while (app.state?.job?.id === following) {
    const began = performance.now();
    // a curve that cannot be had at the moment is had the next time
    const each = await ofAll(["fitting"]).catch(() => null);
    let seen = false;
    if (each && app.state?.job?.id === following) { each((panel, column) => { seen = panel.watch(column) || seen; }); draw(true); }
    // a short fit is over soon: until its first curve is there, look again at once
    await until(seen ? EVERY_MS - (performance.now() - began) : each ? EVERY_MS / 8 : AGAIN_MS);
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
    panels.splice(0, panels.length, ...open.runs.flatMap((run, r) => run.sensors.map((sensor, s) => new Panel(run, sensor, r, s, { span, zoom }))));
    panels.forEach((panel) => panel.lay());
    lay();
  }
  for (const panel of panels) {
    panel.run = open.runs[panel.r];
    panel.sensor = panel.run.sensors[panel.s];
    const rmse = panel.sensor.rmse_m;
    put(panel.rms, ...(rmse === null ? [] : [h("span", { class: "long", text: `error ${head(rmse)}, ` }), times(rmse, panel.sensor.noise_m)]));
  }
}

// A chart a sensor, or all sensors in one.
function lay() {
  together?.end();
  together = wanted && panels.length > 1 ? new Together(panels, { span, zoom }) : null;
  cards.splice(0, cards.length, ...(together ? [together] : panels));
  at("together").hidden = panels.length < 2;
  at("together").setAttribute("aria-pressed", String(Boolean(together)));
  // read before the cards are in: afterwards the browser would have to lay out the page to answer
  measure();
  put(at("charts"), cards.map((one) => one.card));
}

export function oneChart() {
  wanted = !wanted;
  lay();
  draw();
}

// What is on the screen at once, the rest after the frame; while a curve moves only what is on the screen.
export function draw(moving = false) {
  panels.forEach((panel) => (panel.away && !together) || panel.draw());
  together?.draw();
  if (!moving && !together) requestAnimationFrame(() => setTimeout(() => panels.forEach((panel) => panel.away && panel.draw())));
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
    each((panel, column) => panel.take(column, ghost, changed()));
    draw();
    const curveless = app.preview && !panels.some((panel) => panel.data.trial);
    if (curveless || !changed()) at("trial").textContent = curveless ? `no curve is kept of ${app.preview}: its fit was given up early` : "";
    if (changed() && !app.preview) try_(app.drags);
  } catch (error) { if (mine === latest) complain(error); }
}

let onTried = () => {};
export const whenTried = (redraw) => { onTried = redraw; };
const changed = () => Object.keys(app.moved).length > 0 || app.without.size > 0;

function tried(found, coarse) {
  for (const panel of panels) {
    const model = found.column[`${panel.r}/${panel.s}/model_m`];
    Object.assign(panel.data, { adds: false, fitting: false, trial: model.length === panel.data.time.length ? model : null });
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
  const plot = cards.find((one) => one.plots.length)?.plots[0];
  if (plot) marks.add(plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : (span()[0] + span()[1]) / 2);
}
whenMarked(() => cards.forEach((one) => { one.plots.forEach((plot) => plot.redraw(false, false)); one.read(); }));

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours.clear(); [...panels, ...cards].forEach((one) => one.plots.forEach((plot) => plot.redraw(false, true))); });
