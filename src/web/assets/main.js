// The page: what is drawn when, and the keys.

import { AWAY, ask, listen } from "/assets/api.js";
import { at, h, put, showIn } from "/assets/dom.js";
import { app, act, complain, content, modelKey, onState, refresh, renew, tell } from "/assets/store.js";
import { charts, draw, load, mark, oneChart, pan, part, span } from "/assets/charts.js";
import { fails, models } from "/assets/past.js";
import { fit, parameters, reset } from "/assets/hands.js";
import { commandOf, copy } from "/assets/commands.js";
import { rig } from "/assets/rig.js";
import { catalogue, job, missing, progress } from "/assets/future.js";
import { list, runs } from "/assets/runs.js";
import { arrive } from "/assets/arrive.js";
import { tables } from "/assets/newrig.js";
import { folds } from "/assets/folds.js";
import { knownAnew } from "/assets/known.js";
import { live, recording, toRecorder, whenLooked } from "/assets/live.js";
import { marks } from "/assets/marks.js";
import { record } from "/assets/record.js";

const KEYS = [["1 2 3", "first rise, a cycle, the whole record"], ["← →", "pan"], ["d", "diagnose"], ["f", "fit"], ["u r", "undo, redo"], ["m", "heads in m, or in the sensors' own unit"], ["p", "a place along the pipe: arrows move it, Enter adds an effect there"], ["c", "the candidates: Tab to Add"], ["s", "the sliders"], ["t", "all sensors in one chart"], ["x", "a mark in the charts, where the cursor is: two marks read the time and the heads between them"], [", .", "the last mark to the left or right"], ["o", "runs"], ["e", "effects"], ["Escape", "cancel the job; take the marks away"], ["?", "these keys"]];

function title() {
  const open = app.state.open;
  const run = open?.runs[0];
  const about = run && [run.recorded_at && new Date(run.recorded_at).toLocaleString(), run.velocity_m_s && `${run.flow_m3_s === null ? "≈ " : ""}${run.velocity_m_s.toFixed(2)} m/s`, run.temperature_degC && `${run.temperature_degC.toFixed(1)} °C`].filter(Boolean).join(", ");
  const recorder = document.body.classList.contains("recorder");
  at("title").textContent = recorder ? `Recording on ${app.state.recording.rig.name}` : open ? [open.title, about].filter(Boolean).join(" · ") : app.state.place;
  document.title = open ? `${open.title} · surgescope` : "surgescope";
  const own = run?.sensors.find((s) => s.unit)?.unit.symbol;
  const recorded = app.state.recording.running && Object.values(app.state.recording.rig.heads)[0]?.symbol;
  at("own-unit").hidden = !own && !recorded;
  at("own-unit").textContent = (recorder && recorded) || own || recorded || "own";
  at("show-runs").textContent = `Runs (${app.state.runs.length})`;
  if (open && open.title !== shown) {
    if (shown && !app.opens) complain(new Error(`${open.title} is open now, by another tab or a recording: all tabs of one program show the same run.`));
    shown = open.title;
    app.opens = false;
  }
  const left = Boolean(open && app.state.folder && !app.state.runs.some((run) => run.open));
  if (left && !gone) complain(new Error(`The recording of ${open.title} is no longer in the folder. What was read of it stays on the page.`));
  gone = left;
  const warnings = open?.warnings || [];
  if (open && warned !== open.title) {
    warned = open.title;
    if (warnings.length) complain(new Error(warnings.join(" ")), true);
  }
}
let gone = false;
let warned = null;
let shown = null;

// Who opens a folder meets its list first, once a tab; its newest run waits behind it.
function meet() {
  if (met) return;
  met = true;
  if (!app.state.folder || app.state.runs.length < 2 || sessionStorage.getItem("listed")) return;
  sessionStorage.setItem("listed", "yes");
  runs();
}
let met = false;

whenLooked(title);
let loaded = null;
// the first curves
let first = null;
onState(() => {
  // where no run is open there is nothing to fit or to explain
  document.body.classList.toggle("bare", !app.state.open && !app.state.job);
  recording();
  meet();
  tables();
  list();
  inUnit();
  charts();
  // the curves are on their way while the rest is drawn
  const key = modelKey();
  if (key !== loaded) {
    loaded = key;
    const coming = load();
    first ||= coming;
  }
  rig();
  models();
  fails();
  missing();
  job();
  parameters();
  knownAnew();
});

// Errors of all sensors together have the sensors' own unit where that is one.
function inUnit() {
  const own = (app.state.open?.runs || []).flatMap((run) => run.sensors.map((sensor) => sensor.unit));
  const one = own.every((unit) => unit && unit.per_m === own[0].per_m);
  showIn(app.unit === "own" && one ? own[0] : null);
}

function unit(name) {
  app.unit = name;
  document.querySelectorAll("[data-unit]").forEach((b) => b.setAttribute("aria-pressed", String(b.dataset.unit === name)));
  if (!app.state) return;
  inUnit();
  charts();
  models();
  fails();
  missing();
  draw();
}

const redraw = () => refresh().catch(complain);
const diagnose = () => act("/api/diagnose");

document.querySelectorAll("[data-unit]").forEach((b) => b.addEventListener("click", () => unit(b.dataset.unit)));
document.querySelectorAll("[data-range]").forEach((b) => b.addEventListener("click", () => part(b.dataset.range)));
folds();
// How far a key moves a mark, s.
const shift = () => (span()[1] - span()[0]) / 400;
// On a phone one part is seen at a time.
function tab(name) {
  document.querySelector("main").dataset.tab = name;
  document.querySelectorAll("#tabs button").forEach((b) => b.setAttribute("aria-pressed", String(b.dataset.tab === name)));
}
document.querySelectorAll("#tabs button").forEach((b) => b.addEventListener("click", () => tab(b.dataset.tab)));
at("diagnose").addEventListener("click", diagnose);
at("show-catalogue").addEventListener("click", catalogue);
at("together").addEventListener("click", oneChart);
at("show-runs").addEventListener("click", runs);
at("show-record").addEventListener("click", () => (app.state.recording.running ? toRecorder() : record()));
at("show-keys").addEventListener("click", keys);
at("fit").addEventListener("click", fit);
at("reset").addEventListener("click", () => { reset(); missing(); rig(); });
at("copy").addEventListener("click", () => app.state.model && copy(commandOf("fit")));

function keys() {
  put(at("keys"), h("form", { method: "dialog", class: "heading" }, h("h2", { text: "Keys" }), h("button", { text: "Close" })),
    h("table", {}, h("tbody", {}, KEYS.map(([key, what]) => h("tr", {}, h("th", { scope: "row" }, h("kbd", { text: key })), h("td", { text: what }))))),
    h("p", { text: "Drag over a chart to zoom in, double-click to see the whole record; two clicks read differences. On a slider, arrow keys and wheel move by a tenth of its error, with Shift by a hundredth. Everything can be reached with Tab." }));
  at("keys").showModal();
}

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open], body.making")) return;
  const slides = event.target.matches("input[type=range]");
  if (event.target.matches("input:not([type=checkbox], [type=range]), select, textarea") || (slides && event.key.startsWith("Arrow"))) return;
  const does = {
    1: () => part("rise"), 2: () => part("cycle"), 3: () => part("all"), ArrowLeft: () => pan(-0.25), ArrowRight: () => pan(0.25),
    d: diagnose, f: fit, u: () => act("/api/undo"), r: () => act("/api/redo"), m: () => unit(app.unit === "m" && !at("own-unit").hidden ? "own" : "m"), o: runs, e: () => app.state.model && catalogue(), "?": keys,
    p: () => document.querySelector("#rig .pointer")?.focus(), c: () => { tab("future"); document.querySelector("#candidates .candidate")?.focus(); }, s: () => { tab("hands"); document.querySelector("#parameters input[type=range]")?.focus(); },
    x: mark, t: oneChart, ",": () => marks.shift(-shift()), ".": () => marks.shift(shift()),
    Escape: () => (app.state.job ? act("/api/cancel") : marks.clear()),
  }[event.key];
  if (!does) return;
  event.preventDefault();
  does();
});

// A menu that opens near an edge is brought into view.
document.addEventListener("toggle", (event) => event.target.matches("details.menu[open]") && event.target.lastElementChild.scrollIntoView({ block: "nearest" }), true);

// A menu closes when something else is touched, or by Escape.
const menus = () => document.querySelectorAll("details.menu[open]");
document.addEventListener("pointerdown", (event) => menus().forEach((menu) => menu.contains(event.target) || menu.removeAttribute("open")));
document.addEventListener("keydown", (event) => event.key === "Escape" && menus().forEach((menu) => { menu.removeAttribute("open"); menu.querySelector("summary").focus(); }));

document.addEventListener("dragover", (event) => event.preventDefault());
document.addEventListener("drop", (event) => {
  event.preventDefault();
  const files = [...event.dataTransfer.files];
  if (files.length) arrive(files);
});

let away = false;
const events = {
  progress, live, state: redraw, model: redraw,
  done: () => { redraw().then(() => tell(app.state.model ? `done: error ${app.state.model.rmse_m.toPrecision(3)} m` : "done")); },
  failed: (told) => { redraw(); if (told.message !== "cancelled") complain(new Error(told.message)); else tell("cancelled"); },
  error: () => { if (!away) complain(new Error(AWAY)); away = true; },
  open: () => { if (away) content(); away = false; redraw(); },
};

function effects(all) {
  all.forEach((e) => [e, ...(e.variants || [])].forEach((one) => app.effects.set(one.name, one)));
  if (app.state) missing();
}

// The charts come first, and are painted. Then the page listens, and fetches the state again: no change in between is lost. A tab that is not seen
// paints nothing, and does not wait for it.
const FRAME_MS = 100;
const painted = () => new Promise((done) => { requestAnimationFrame(() => setTimeout(done)); setTimeout(done, FRAME_MS); });
const why = () => !app.state.open && app.state.failed && complain(new Error(app.state.failed), true);
renew().then(why).catch(complain).then(() => first).then(painted).then(() => {
  listen(events);
  redraw();
  ask("/api/effects").then(effects).catch(complain);
});
