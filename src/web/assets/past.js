// The models so far on one axis of error, where the one in force fails, and its error by sensor and cycle.

import { at, atNoise, digits, h, head, put, times, toCharts } from "/assets/dom.js";
import { app, act, inWords, proposals } from "/assets/store.js";
import { load, zoom } from "/assets/charts.js";
import { copier } from "/assets/commands.js";
import { sideBySide } from "/assets/sidebyside.js";

// The widths of a sensor's name and of a cell of a cycle, px.
const [NAME_PX, CELL_PX] = [62, 26];
const LEVELS = [1.25, 2, 4, 8, 16, 32, 64];

// Where an error stands on the axis, percent: its noise is at 12.
function place(models) {
  const noise = Math.min(...models.map((m) => m.noise_m));
  const most = Math.max(...models.map((m) => m.rmse_m), 1.5 * noise);
  return (error) => 12 + (80 * Math.max(-0.1, Math.log(error / noise))) / Math.log(most / noise);
}

// What a model has that its parent had not.
export function nameOf(model, parent) {
  const own = model.effects.filter((effect) => !parent?.effects.includes(effect));
  if (!model.grown_from) return model.name;
  return own.length ? `+ ${own.join(" + ")}` : inWords(model.why);
}

// How many additions lie between a model and the one that all grew out of.
function depth(model, all) {
  const parent = all[model.grown_from - 1];
  return parent ? 1 + depth(parent, all) : 0;
}

function row(model, axis, all) {
  const parent = all[model.grown_from - 1];
  const inForce = model.number === app.state.model?.number;
  const near = atNoise(model.rmse_m, model.noise_m);
  const compared = app.compare === model.number;
  const compare = h("button", {
    type: "button", class: "quiet", text: compared ? "hide" : "compare", "aria-pressed": String(compared), "data-key": `c${model.number}`,
    "aria-label": `Compare with model ${model.number}`, onclick: () => { app.compare = compared ? null : model.number; models(); load(); },
  });
  const beside = compared ? h("button", { type: "button", class: "quiet", text: "side by side", "data-key": `b${model.number}`, onclick: () => sideBySide(model.number) }) : null;
  const force = () => act("/api/force", { model: model.number });
  const able = !inForce && !model.preview;
  // where the list is no chain, it says what each one grew out of
  const from = parent && model.grown_from !== model.number - 1 ? `, from ${model.grown_from}` : "";
  return h("div", { onclick: (event) => able && !event.target.closest("button") && force(), class: `model${able ? " able" : ""}${inForce ? " force" : ""}${model.preview ? " preview" : ""}${compared ? " compared" : ""}`, id: model.fitting ? "fitting" : null },
    // the name moves in, not the axis: all errors stand on one
    h("span", { class: "called", style: { "padding-left": `${10 * Math.min(4, model.preview ? 0 : depth(model, all))}px` } }, model.preview ? null : h("span", { class: "hint", text: `${model.number}${from} ` }), h("button", {
      type: "button", class: "name", "data-key": `m${model.number}`, disabled: !able, "aria-current": inForce ? "true" : null, title: model.why,
      text: model.preview ? model.name : nameOf(model, parent), onclick: force,
    })),
    h("span", { class: "error", text: head(model.rmse_m) }),
    h("div", { class: "axis", "aria-hidden": "true" },
      h("i", { class: "noise", style: { left: "12%" } }), h("i", { class: `dot ${model.preview ? "proposed" : near ? "good" : ""}`, style: { left: `${axis(model.rmse_m)}%` } })),
    h("span", { class: "hint", text: times(model.rmse_m, model.noise_m) }), inForce || model.preview ? null : h("span", {}, compare, beside));
}

// A fit starts from several places: its latest error may be that of a place that it gives up.
export const least = (errors) => Math.min(...errors.map(([, error]) => error));

// The model that a job fits, as far as it has come.
const fitted = () => {
  const { job, model } = app.state;
  if (!job?.errors.length || !model || !/^(adding|removing|fitting)/.test(job.what)) return null;
  return { ...model, number: 0, name: job.what, grown_from: null, rmse_m: least(job.errors), preview: true, fitting: true };
};

// What an addition that the record does not support needs to hear.
function unsupported(all) {
  const own = all.find((model) => model.number === app.state.model?.number);
  if (!own?.grown_from || own.evidence === null || own.evidence > 0) return null;
  const parent = all[own.grown_from - 1];
  return h("p", { class: "advice", text: `The record does not support ${nameOf(own, parent).replace("+ ", "")}: the error was ${head(parent.rmse_m)} without it. Undo takes it out.` });
}

let axis = null;
export function models() {
  const all = app.state.models;
  const shown = [...all];
  const candidate = proposals().find((c) => c.label === app.preview);
  if (candidate && app.state.model) shown.push({ ...app.state.model, number: 0, name: `+ ${candidate.label}`, why: `+ ${candidate.label} (preview)`, grown_from: null, rmse_m: candidate.rmse_m, preview: true });
  const going = fitted();
  if (going) shown.push(going);
  if (!shown.length) { put(at("models"), h("p", { class: "hint", text: app.state.job ? "The base model is being fitted." : "It was not fitted: open the run again." })); return; }
  axis = place(shown);
  const step = (path, text, able, key) => h("button", { type: "button", text, title: key, disabled: !able || Boolean(app.state.job), "data-key": path, onclick: () => act(path) });
  const list = h("div", { class: "list" }, shown.map((model) => row(model, axis, all)));
  put(at("models"), list, unsupported(all),
    h("div", { class: "buttons" }, step("/api/undo", "↶ Undo", app.state.can_undo, "key u"), step("/api/redo", "↷ Redo", app.state.can_redo, "key r"), app.state.can_undo ? copier("undo") : null));
  // of a long list the model in force, and one that is being fitted or looked at, are in view
  const seen = list.querySelector(".preview") || list.querySelector(".force");
  if (seen) list.scrollTop = seen.offsetTop - (list.clientHeight - seen.clientHeight) / 2;
}

// The error of the model that is being fitted has moved.
export function falls(rmse) {
  const box = at("fitting");
  if (!box || !axis) { models(); return; }
  box.querySelector(".error").textContent = head(rmse);
  box.querySelector(".hint").textContent = times(rmse, app.state.model.noise_m);
  box.querySelector(".dot").style.setProperty("left", `${Math.min(96, axis(rmse))}%`);
}

// Metres, which are heads, in the page's unit.
const inHeads = (text) => text.replace(/([\d.]+) m\b/g, (_, value) => head(Number(value)));

// A sensor's error, and what is wrong; before the first colon stand names.
function said(fail) {
  const [, name, error] = /^(.*?: )(.*)$/.exec(fail.error);
  const show = fail.from_s === null ? null : h("button", { type: "button", class: "link", text: "show", "aria-label": `Show where: ${fail.text}`, onclick: () => see(fail) });
  return h("li", {}, h("b", { text: name + inHeads(error) }), " ", show, h("ul", {}, fail.clauses.map((clause) => h("li", { text: inHeads(clause) }))));
}

const see = ({ from_s, to_s }) => { zoom([from_s, to_s]); toCharts(); };

export function fails() {
  const model = app.state.model;
  const items = (model?.fails || []).map(said);
  if (model && !items.length) items.push(h("li", { text: "No sensor shows more than its noise." }));
  put(at("fails"), items);
  const rows = model?.cycles || [];
  const most = Math.max(0, ...rows.map((r) => r.cells.length));
  const level = (v) => { const i = LEVELS.findIndex((l) => v <= l); return i < 0 ? 7 : i; };
  const cell = (r, c) => h("td", {}, h("button", { type: "button", class: `h${level(c.over_noise)}`, text: c.over_noise.toFixed(c.over_noise < 9.95 ? 1 : 0), "aria-label": `${r.name}, cycle ${c.cycle}: ${digits(c.over_noise, 2)} times the noise; show it`, title: `cycle ${c.cycle}: ${digits(c.from_s, 4)} s to ${digits(c.to_s, 4)} s`, onclick: () => see(c) }));
  const several = app.state.open?.runs.length > 1;
  // as many cycles in a row as the panel has room for
  const room = Math.max(4, Math.floor((at("cycles").clientWidth - NAME_PX) / CELL_PX));
  const named = (r) => h("th", { scope: "row", text: several ? `${r.name} ${r.run + 1}` : r.name });
  const block = (from) => {
    const numbers = Array.from({ length: Math.min(room, most - from) }, (_, i) => from + i);
    const own = rows.filter((r) => r.cells.length > from);
    return [h("thead", {}, h("tr", {}, h("th", { scope: "col", text: "cycle" }), numbers.map((i) => h("th", { scope: "col", text: i + 1 })))),
      h("tbody", {}, own.map((r) => h("tr", {}, named(r), r.cells.slice(from, from + room).map((c) => cell(r, c)))))];
  };
  const blocks = Array.from({ length: Math.ceil(most / room) }, (_, i) => block(i * room)).flat();
  put(at("cycles"), rows.length ? h("table", {}, blocks) : null);
}
