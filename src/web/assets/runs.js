// The runs of the place: a table to sort and filter, a reference run, and what can be done with several.

import { ask } from "/assets/api.js";
import { at, atNoise, digits, h, put, svg } from "/assets/dom.js";
import { app, act, complain } from "/assets/store.js";
import { compare } from "/assets/compare.js";
import { drift } from "/assets/drift.js";
import { arrive } from "/assets/arrive.js";

let order = { key: "when", down: true };
const chosen = new Set();
let reference = null;
// The rest of a long table follows after a moment, so that it does not delay the charts.
const [AT_ONCE, LATER_MS] = [50, 250];

// What the server has looked up of runs that are not open, by their number.
const glances = new Map();
const says = (value) => (Array.isArray(value) ? value.length > 0 : value !== null && value !== undefined);
export function known(run) {
  const glance = glances.get(run.id) || {};
  const all = { ...run, ...Object.fromEntries(Object.entries(glance).filter(([key]) => !says(run[key]))) };
  // the models beside a run go before what `watch` found in it, and its verdict is that of another model then
  if (run.kept || !glance.effects) return all;
  const same = glance.effects.join() === run.effects?.join();
  return { ...all, rmse_m: glance.rmse_m, noise_m: glance.noise_m, ...(same ? {} : { verdict: null, effect: null }) };
}

const over = (r) => (r.rmse_m === null || r.rmse_m === undefined || !r.noise_m ? null : r.rmse_m / r.noise_m);
const words = (r) => (r.effect ? `missing: ${r.effect}` : (r.verdict || "").replaceAll("-", " "));
const COLUMNS = [
  ["name", "run", (r) => r.name], ["when", "recorded", (r) => r.when || null], ["rig", "rig", (r) => r.rig || null],
  ["temperature_degC", "°C", (r) => r.temperature_degC], ["flow_m3_s", "L/s", (r) => (typeof r.flow_m3_s === "number" ? 1000 * r.flow_m3_s : null)],
  ["error", "error × noise", over], ["verdict", "verdict", words],
];
const KINDS = [["", "all runs"], ["sound", "at the noise"], ["poor", "above the noise"], ["missing", "something missing"], ["unknown", "not looked at"]];
const is = {
  sound: (r) => over(r) !== null && atNoise(over(r), 1), poor: (r) => over(r) !== null && !atNoise(over(r), 1),
  missing: (r) => ["missing-effect", "unknown-effect"].includes(r.verdict), unknown: (r) => over(r) === null && !r.verdict,
};

export function spark(heads) {
  if (!heads || heads.length < 2) return null;
  const [low, high] = [Math.min(...heads), Math.max(...heads)];
  const points = heads.map((v, i) => `${((80 * i) / (heads.length - 1)).toFixed(1)},${(19 - (18 * (v - low)) / (high - low || 1)).toFixed(1)}`);
  return svg("svg", { viewBox: "0 0 80 20", class: "spark", "aria-hidden": "true" }, svg("polyline", { points: points.join(" ") }));
}

function cell([key, , of], run) {
  const value = of(run);
  if (key === "name") return h("td", {}, h("button", { type: "button", class: "link", text: run.name, "data-key": `open ${run.id}`, onclick: () => open([run.id]) }), run.open ? h("span", { class: "hint", text: " open" }) : "", run.error ? h("span", { class: "advice", text: ` ${run.error}` }) : "", run.error?.includes("“Recover”") ? h("button", { type: "button", text: "Recover", "data-key": `recover ${run.id}`, onclick: () => recover(run.id) }) : "");
  if (key === "when") return h("td", { text: value ? new Date(value).toLocaleString() : "" });
  if (key === "error") return h("td", { class: `number ${value === null ? "" : atNoise(value, 1) ? "good" : "poor"}`, text: value === null ? "" : digits(value, value < 10 ? 2 : 3) });
  return typeof value === "number" ? h("td", { class: "number", text: digits(value, 3) }) : h("td", { text: value ?? "" });
}

// Why one model cannot be fitted to runs: they are of different rigs.
export function apart(ids) {
  const rigs = new Set(app.state.runs.map(known).filter((run) => ids.includes(run.id) && run.rig).map((run) => run.rig));
  return rigs.size > 1 ? `These runs are of different rigs (${[...rigs].join(", ")}): a model belongs to one rig.` : null;
}

// What can be saved of a recording that was cut off, beside it.
async function recover(id) {
  app.opens = true;
  const saved = await act("/api/recover", { run: id });
  if (!saved) return;
  at("runs").close();
  complain(new Error([`${saved.written} holds what could be saved; the torn file stays as it is.`, ...saved.lost.map((loss) => `Lost: ${loss}.`)].join(" ")));
}

async function open(ids) {
  if (await act("/api/open", { runs: ids })) at("runs").close();
}

// Rows in view are looked up one after the other.
const waiting = [];
let looking = false;
async function look(done) {
  if (looking) return;
  looking = true;
  for (let id = waiting.pop(); id !== undefined; id = waiting.pop()) {
    try { glances.set(id, await ask(`/api/glance?run=${id}`)); } catch { glances.set(id, {}); }
    done(id);
  }
  looking = false;
  // what was looked up may order the table otherwise
  if (at("runs").open && app.state.runs.length <= AT_ONCE) again();
}

export function runs() {
  const dialog = at("runs");
  const search = h("input", { type: "search", placeholder: "filter by name, rig, verdict", "aria-label": "Filter runs", oninput: () => fill() });
  const kind = h("select", { "aria-label": "Show", onchange: () => fill() }, KINDS.map(([value, text]) => h("option", { value, text })));
  const body = h("tbody");
  const count = h("span", { class: "hint", role: "status" });
  const rows = new Map();
  let later = null;
  const ids = () => app.state.runs.map((r) => r.id).filter((id) => chosen.has(id));
  const together = h("button", { type: "button", text: "Open together", title: "Fit one model to all chosen runs of one rig", onclick: () => open(ids()) });
  const beside = h("button", { type: "button", class: "primary", text: "Compare", onclick: () => compare([reference, ...ids().filter((id) => id !== reference)]) });
  const drifts = app.state.runs.length > 2 ? h("button", { type: "button", text: "Drift", title: "How fitted parameters change from run to run", onclick: drift }) : null;
  const file = h("input", { type: "file", multiple: true, accept: ".csv,.txt,.tsv,.tdms,.mcap,.xlsx,.ods", onchange: () => file.files.length && arrive([...file.files]) });
  const update = () => {
    [...chosen].forEach((id) => app.state.runs.some((r) => r.id === id) || chosen.delete(id));
    if (!chosen.has(reference)) reference = ids()[0] ?? null;
    beside.disabled = chosen.size < 2;
    together.disabled = chosen.size < 2 || Boolean(apart(ids()));
    together.title = apart(ids()) || "Fit one model to all chosen runs of one rig";
    beside.textContent = chosen.size > 1 ? `Compare ${chosen.size} runs` : "Compare";
    body.querySelectorAll("input[type=radio]").forEach((radio) => { radio.disabled = !chosen.has(radio.value); radio.checked = radio.value === reference; });
  };
  const row = (run) => {
    const box = h("input", { type: "checkbox", checked: chosen.has(run.id), "aria-label": `Choose ${run.name}`, "data-key": `choose ${run.id}`, onchange: () => { if (box.checked) chosen.add(run.id); else chosen.delete(run.id); update(); } });
    const radio = h("input", { type: "radio", name: "reference", value: run.id, "aria-label": `${run.name} is the reference`, onchange: () => { reference = run.id; } });
    return h("tr", { class: run.open ? "open" : "", "data-run": run.id }, h("td", {}, box), h("td", {}, radio), h("td", {}, spark(run.spark)), COLUMNS.map((c) => cell(c, run)));
  };
  const seen = new IntersectionObserver((entries) => {
    entries.filter((e) => e.isIntersecting && !glances.has(e.target.dataset.run)).forEach((e) => { glances.set(e.target.dataset.run, {}); waiting.unshift(e.target.dataset.run); });
    look((id) => {
      const run = app.state.runs.find((r) => r.id === id);
      const old = rows.get(id);
      if (!run || !old?.isConnected) return;
      const focused = old.contains(document.activeElement) ? document.activeElement.dataset.key : null;
      const fresh = row(known(run));
      old.replaceWith(fresh);
      rows.set(id, fresh);
      if (focused) fresh.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
      update();
    });
  });
  const sort = (key) => { order = { key, down: order.key === key ? !order.down : false }; heads(); fill(); };
  const fill = () => {
    const wanted = search.value.toLowerCase();
    const of = COLUMNS.find(([key]) => key === order.key)[2];
    const all = app.state.runs.map(known);
    const shown = all.filter((r) => `${r.name} ${r.rig || ""} ${words(r)}`.toLowerCase().includes(wanted) && (is[kind.value] || (() => true))(r)).sort((a, b) => {
      const [x, y] = [of(a) ?? null, of(b) ?? null];
      if (x === y) return a.name.localeCompare(b.name, undefined, { numeric: true });
      // a run of which nothing is known comes last, whichever way
      if (x === null || y === null) return x === null ? 1 : -1;
      return (x < y) === order.down ? 1 : -1;
    });
    rows.clear();
    seen.disconnect();
    const fresh = (run) => { const tr = row(known(run)); rows.set(run.id, tr); if (!glances.has(run.id)) seen.observe(tr); return tr; };
    put(body, shown.slice(0, AT_ONCE).map(fresh));
    clearTimeout(later);
    if (shown.length > AT_ONCE) later = setTimeout(() => { body.append(...shown.slice(AT_ONCE).map(fresh)); update(); }, LATER_MS);
    count.textContent = shown.length === all.length ? (all.length === 1 ? "1 run" : `${all.length} runs`) : `${shown.length} of ${all.length} runs`;
    update();
  };
  const head = h("thead");
  const heads = () => {
    const heading = ([key, label]) => h("th", { scope: "col", class: ["temperature_degC", "flow_m3_s", "error"].includes(key) ? "number" : null, "aria-sort": order.key === key ? (order.down ? "descending" : "ascending") : null }, h("button", { type: "button", class: "link", "data-key": `sort ${key}`, text: `${label}${order.key === key ? (order.down ? " ↓" : " ↑") : ""}`, onclick: () => sort(key) }));
    put(head, h("tr", {}, h("th", {}, h("span", { class: "unseen", text: "chosen" })), h("th", { scope: "col", title: "The run that others are compared with", text: "ref." }), h("th", {}, h("span", { class: "unseen", text: "head" })), COLUMNS.map(heading)));
  };
  // a model may have been made since: what is not open is looked up again
  glances.clear();
  heads();
  put(dialog, h("form", { method: "dialog", class: "heading" }, h("h2", { text: `Runs · ${app.state.place}` }), h("button", { text: "Close" })),
    h("div", { class: "heading tools" }, search, kind, count, h("span", { class: "fill" }), beside, together, drifts),
    h("div", { id: "import" }),
    h("div", { class: "list" }, h("table", { class: "runs" }, head, body)),
    h("p", {}, h("label", {}, "Import a file of a logger, or several of one closure (or drop them on the page): ", file)));
  fill();
  again = fill;
  if (!dialog.open) dialog.showModal();
}

// A table that is open follows the folder.
let again = null;
let listed = null;
export function list() {
  const now = JSON.stringify(app.state.runs);
  if (now !== listed && at("runs").open) again();
  listed = now;
}
