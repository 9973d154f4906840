// The parameters of the model in force: drag one and the curves follow; hold it, bound it, fit.

import { at, digits, h, keyOf, named, put, svg, uncertain, unitOf } from "/assets/dom.js";
import { app, act, complain, content, inWords } from "/assets/store.js";
import { try_, whenTried } from "/assets/charts.js";
import { models } from "/assets/past.js";
import { known } from "/assets/known.js";
import { decimals, scale, slider } from "/assets/slider.js";

const rows = new Map();
const THUMB_PX = 16;

const bounds = (p) => app.bounds[p.name] || [p.lower, p.upper];
const valueOf = (p) => app.moved[p.name] ?? app.followed.get(keyOf(p)) ?? p.value;

// Sets a value by hand, from a slider, a field or the drawing; `coarse` while it moves.
export function move(name, value, coarse) {
  const p = app.state.model?.parameters.find((one) => one.name === name);
  if (!p || !Number.isFinite(value)) return;
  app.moved[name] = value;
  if (app.preview) { app.preview = null; models(); }
  update(p);
  try_(coarse);
}

// Those that follow show where they have gone.
whenTried(() => app.state.model?.parameters.forEach((p) => p.name in app.moved || update(p)));

// A person has let go.
export function release(name) {
  try_(false);
  if (!at("meanwhile").checked || app.state.job) return;
  const value = app.moved[name];
  act("/api/fit", { set: { [name]: value }, hold: [name] });
}

function update(p) {
  const row = rows.get(keyOf(p));
  if (!row) return;
  const value = valueOf(p);
  const moved = p.name in app.moved;
  const was = moved || app.followed.has(keyOf(p));
  row.slider.show(value);
  row.slider.input.setAttribute("aria-valuetext", `${digits(value, 4)} ${unitOf(p)}`);
  // moved by hand, it shows the finest step
  const places = moved ? decimals(p) : null;
  row.field.value = +(moved ? (places === null ? value.toPrecision(6) : value.toFixed(places)) : uncertain(value, p.standard_error).split(" ")[0].replace("−", "-"));
  const error = p.standard_error > 0 && `± ${uncertain(p.value, p.standard_error).split("± ")[1]}`;
  const fitted = error ? [`${error} ${unitOf(p)}`] : [unitOf(p), p.held && "held"].filter(Boolean);
  // the slider of an effect that is switched off rests: it would move nothing
  const rests = app.without.has(p.effect);
  row.box.classList.toggle("rests", rests);
  [row.slider.input, row.field, row.hold].forEach((control) => { control.disabled = rests; });
  row.said.textContent = rests ? "switched off" : was ? `was ${digits(p.value, 4)} ${unitOf(p)}` : fitted.join(", ");
  row.said.title = `fitted: ${uncertain(p.value, p.standard_error)} ${unitOf(p)}`;
  row.box.classList.toggle("moved", moved);
  const [low, high] = p.interval_95 || [];
  const shade = Number.isFinite(low) && Number.isFinite(high) && low !== null;
  const { share } = row.slider;
  // the middle of a thumb stays within the track
  row.shade.style.setProperty("left", shade ? `calc(${THUMB_PX / 2}px + ${share(low)} * (100% - ${THUMB_PX}px))` : "0");
  row.shade.style.setProperty("width", shade ? `calc(${Math.max(0.006, share(high) - share(low))} * (100% - ${THUMB_PX}px))` : "0");
}

function bound(p, i) {
  const field = h("input", { type: "number", step: "any", value: +bounds(p)[i].toPrecision(6), "aria-label": `${i ? "Upper" : "Lower"} bound of ${named(p)}`, onchange: () => {
    const own = [...bounds(p)];
    own[i] = field.valueAsNumber;
    if (!(own[0] < own[1])) { complain(new Error(`the lower bound of ${named(p)} must lie below the upper one`)); field.value = bounds(p)[i]; return; }
    app.bounds[p.name] = own;
    content();
    const inside = Math.min(own[1], Math.max(own[0], valueOf(p)));
    if (inside === valueOf(p)) update(p); else move(p.name, inside, false);
  } });
  return field;
}

function row(p) {
  const typed = () => {
    const [value, [low, high]] = [field.valueAsNumber, bounds(p)];
    if (value >= low && value <= high) { content(); move(p.name, value, false); release(p.name); return; }
    complain(new Error(`${named(p)} must lie from ${digits(low, 4)} to ${digits(high, 4)} ${unitOf(p)}; its bounds are under ⋯`));
    update(p);
  };
  const field = h("input", { type: "number", step: "any", class: "value", "aria-label": `${named(p)}, ${p.unit}`, onchange: typed });
  const drag = slider({ label: `${named(p)}: ${p.about}`, field, of: { scale: () => scale(p, ...bounds(p)), value: () => valueOf(p) }, move: (value) => move(p.name, value, true), release: () => release(p.name) });
  const held = app.hold.has(p.name) || (p.held && !app.free.has(p.name));
  const hold = h("input", { type: "checkbox", checked: held, "aria-label": `Hold ${named(p)}`, onchange: () => {
    (hold.checked ? app.hold : app.free).add(p.name);
    (hold.checked ? app.free : app.hold).delete(p.name);
  } });
  const said = h("span", { class: "said" });
  const shade = h("i", { class: "shade", "aria-hidden": "true" });
  const more = h("details", { class: "menu", ontoggle: (event) => event.target.lastChild.scrollIntoView({ block: "nearest" }) }, h("summary", { "aria-label": `Bounds of ${named(p)}`, text: "⋯" }),
    h("div", {}, h("p", { text: p.about }), h("label", {}, "from ", bound(p, 0)), h("label", {}, "to ", bound(p, 1))));
  const box = h("div", { class: `parameter${p.advice ? " doubtful" : ""}` },
    h("div", { class: "label", title: p.about }, h("b", { text: named(p) }), p.advice ? h("span", { class: "mark", title: inWords(p.advice), text: "!" }) : null, more, p.run && app.state.open.runs.length > 1 ? h("span", { class: "hint run", text: p.run }) : null),
    h("div", { class: "slider" }, shade, drag.input), field, said,
    h("button", { type: "button", class: "quiet knows", title: "How well it is known: its likelihood, and what it trades with", "aria-label": `How well ${named(p)} is known`, onclick: () => known(p) },
      svg("svg", { viewBox: "0 0 16 12", "aria-hidden": "true" }, svg("path", { d: "M1 1c2 12 12 12 14 0" }))),
    h("label", { class: "hold", title: "hold it: a fit leaves it where it is" }, hold, h("span", { text: "hold" })));
  rows.set(keyOf(p), { slider: drag, field, said, shade, box, hold });
  return box;
}

// What the fit does not settle, and what to do about it.
function looks(model) {
  const doubtful = model.parameters.filter((p) => p.advice);
  if (!doubtful.length) return null;
  const summary = doubtful.length === 1 ? "one parameter to look at" : `${doubtful.length} parameters to look at`;
  return h("details", { class: "group looks", open: looksOpen, ontoggle: (event) => { looksOpen = event.target.open; } }, h("summary", { text: summary }),
    h("ul", {}, doubtful.map((p) => h("li", {}, h("b", { text: named(p) }), ` ${inWords(p.advice)}`))));
}

// The groups of the last model: what an effect brings is brought into view.
let [grouped, of] = [[], null];
function seen(groups) {
  const added = of === app.state.open.title && [...groups.keys()].find((name) => !grouped.includes(name));
  [grouped, of] = [[...groups.keys()], app.state.open.title];
  if (!added) return;
  const box = at("hands");
  const own = [...box.querySelectorAll(".group h3")].find((title) => title.textContent === added);
  // the panel scrolls, and not the page
  box.scrollTop += own.getBoundingClientRect().top - at("parameters").getBoundingClientRect().top;
}

let clockOpen = false;
let looksOpen = false;
let drawn = null;
export function parameters() {
  const model = app.state.model;
  const key = model && JSON.stringify([app.state.open.title, model.number, model.rmse_m]);
  at("fit").disabled = at("reset").disabled = !model || Boolean(app.state.job);
  if (key === drawn) return;
  drawn = key;
  rows.clear();
  if (!model) { put(at("parameters")); return; }
  const groups = new Map([["pipe and test", []]]);
  const ofRuns = [];
  for (const p of model.parameters) {
    const own = /^(offset_m|position_m|closure_start)/.test(p.name);
    if (own) { ofRuns.push(p); continue; }
    const group = p.effect || "pipe and test";
    groups.set(group, [...(groups.get(group) || []), p]);
  }
  const astray = model.converged ? null : h("p", { class: "advice astray", text: "The fit ended at no optimum, so nothing is known of the errors of its parameters: fit again, or undo." });
  put(at("parameters"), astray, [...groups].filter(([, all]) => all.length).map(([name, all]) => h("div", { class: "group" }, h("h3", { text: name }), all.map(row))),
    h("details", { class: "group", open: clockOpen, ontoggle: (event) => { clockOpen = event.target.open; } }, h("summary", { text: "sensors and clock" }), h("div", { class: "rows" }, ofRuns.map(row))), looks(model));
  model.parameters.forEach(update);
  at("trial").textContent = "";
  seen(groups);
}

// An effect was switched off, or on again.
export const rest = () => app.state.model?.parameters.forEach(update);

export function reset() {
  app.moved = {};
  app.bounds = {};
  app.hold.clear();
  app.free.clear();
  app.without.clear();
  drawn = null;
  parameters();
  try_(false);
}

export function fit() {
  const { moved, hold, free, bounds } = app;
  if (app.without.size) {
    complain(new Error("An effect that is switched off is still in the model: take it out to fit without it, or switch it on."));
    return;
  }
  if (app.state.model.converged && !hold.size && !free.size && !Object.keys({ ...moved, ...bounds }).length) {
    complain(new Error("The model is fitted as it stands: move, hold, free or bound a parameter first."));
    return;
  }
  act("/api/fit", { set: app.moved, hold: [...app.hold], free: [...app.free], bounds: app.bounds });
}
