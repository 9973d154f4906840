// What is missing: the diagnosis, what each candidate would do, and any effect of the catalogue by hand.

import { at, atNoise, h, head, probable, put, svg, times, toCharts } from "/assets/dom.js";
import { app, act, inWords, proposals } from "/assets/store.js";
import { load, try_, watchFit } from "/assets/charts.js";
import { falls, least, models } from "/assets/past.js";
import { copier } from "/assets/commands.js";
import { rest } from "/assets/hands.js";

function sentence(found) {
  const p = `probability ${probable(found.probability)}`;
  if (found.verdict === "nothing-missing") return `Nothing is missing (${p}).`;
  if (found.verdict === "unknown-effect") return `Something is missing that no effect of the catalogue explains (${p}).`;
  const names = found.pair ? found.pair.labels.join(" and ") : found.candidates[0]?.label;
  return `Missing: ${names} (${p}).`;
}

// Draws what a candidate would do, before anything is added.
function preview(label) {
  // the list moves while a job begins, and the pointer only seems to
  if (app.preview === label || (label && app.state.job)) return;
  app.preview = label;
  load();
  models();
}

// Equation and source, folded away.
function theory(about) {
  if (!about?.equation) return null;
  return h("details", { class: "theory" }, h("summary", { text: "equation and source" }), h("pre", { text: about.equation }), h("p", { class: "hint", text: about.source }));
}

const near = (c) => atNoise(c.rmse_m, app.state.model.noise_m);

// What is left with a candidate.
function explains(c) {
  const alone = c.probability_alone === undefined ? "" : "alone: ";
  if (alone && c.rmse_m >= app.state.diagnosis.start.rmse_m) return "alone it explains next to nothing";
  return `${alone}error → ${head(c.rmse_m)}${near(c) ? ", down to the noise" : `, ${times(c.rmse_m, app.state.model.noise_m)}`}`;
}

function candidate(c) {
  const about = c.labels ? { summary: "Together they explain what neither does alone." } : app.effects.get(c.effect);
  const show = () => preview(c.label);
  const bar = h("span", { class: "bar", "aria-hidden": "true" }, h("i", { style: { width: `${100 * c.probability}%` } }));
  const others = c.indistinguishable_from.map((other) => other.labels?.join(" and ") || other);
  // two that are both out of the question are not worth a line
  const alike = others.length && c.probability >= 0.01 ? h("p", { class: "hint", text: `These recordings cannot tell ${c.labels ? "them" : "it"} from ${others.join(", ")}.` }) : null;
  const card = h("article", { class: "card candidate", tabindex: 0, "data-key": `p${c.label}`, "aria-label": `${c.label}, probability ${probable(c.probability)}`, onmouseenter: show, onfocus: show, onmouseleave: () => preview(null) },
    h("h3", {}, c.label, bar, h("span", { class: "number", text: probable(c.probability) })),
    about ? h("p", { text: about.summary }) : null, alike, theory(about),
    h("button", { type: "button", class: "link on-phone", text: "show in the charts", onclick: () => { show(); toCharts(); } }),
    h("p", { class: "foot" }, h("span", { text: explains(c) }),
      h("button", { type: "button", class: app.state.diagnosis.verdict === "nothing-missing" ? null : "primary", text: c.labels ? "Add both" : "Add", "aria-label": `Add ${c.label}`, "data-key": `a${c.label}`, disabled: Boolean(app.state.job), onfocus: show, onclick: (event) => { follows = event.detail === 0; add(c.labels?.join(",") || c.label); } }), c.labels ? copier("diagnose") : copier("add", c.label)));
  return card;
}

export function add(effect, set = {}) {
  app.preview = null;
  act("/api/add", { effect, set });
}

// Whether the keyboard started the job: its focus goes to Cancel then, and back to Diagnose at the end.
let follows = false;
function focusFollows(working) {
  if (!follows || !(document.activeElement === document.body || at("job").contains(document.activeElement))) return;
  if (working) { document.querySelector("[data-key=cancel]").focus({ preventScroll: true }); return; }
  follows = false;
  at("diagnose").focus({ preventScroll: true });
}

// The error against iteration while a job runs, on a logarithmic axis.
let errors = [];
export function job() {
  const { job: at_work, model } = app.state;
  at("diagnose").disabled = Boolean(at_work) || !model;
  const box = at("job");
  box.hidden = !at_work;
  if (!at_work) { errors = []; focusFollows(false); return; }
  errors = at_work.errors;
  put(box, h("p", {}, h("b", { text: at_work.what }), " ", h("span", { class: "progress", text: at_work.progress })), h("div", { id: "falling" }),
    h("button", { type: "button", text: "Cancel", "data-key": "cancel", title: "key Escape", onclick: () => act("/api/cancel") }));
  focusFollows(true);
  falling();
}

// A diagnosis fits many models by turns, a profile one at many places, and a posterior none: their errors make no curve.
const descends = (what) => !/^(diagnosing|profiling|sampling)/.test(what);

const [LEFT, RIGHT, TOP, BOTTOM] = [52, 292, 8, 74];
function falling() {
  const box = at("falling");
  if (!box || errors.length < 2 || !app.state.job || !descends(app.state.job.what)) return;
  // a fit starts from several places: their errors after one another would look as if it went astray
  const lowest = errors.map(((low) => ([, error]) => (low = Math.min(low, error)))(Infinity));
  const now = lowest.at(-1);
  const noise = app.state.model?.noise_m || now;
  const logs = lowest.map(Math.log);
  const [low, high] = [Math.min(Math.log(noise), ...logs), Math.max(...logs)];
  const y = (log) => TOP + ((BOTTOM - TOP) * (high - log)) / (high - low || 1);
  const x = (i) => LEFT + ((RIGHT - LEFT) * i) / (errors.length - 1);
  const label = (px, py, text, anchor = "end", kind = null) => svg("text", { x: px, y: py, "text-anchor": anchor, class: kind, text });
  const noiseAt = y(Math.log(noise));
  put(box, svg("svg", { viewBox: "0 0 300 92", role: "img", "aria-label": `least error so far by iteration, now ${head(now)}` },
    svg("line", { x1: LEFT, x2: RIGHT, y1: noiseAt, y2: noiseAt, class: "noise-line" }),
    label(LEFT - 5, noiseAt + 4, "noise", "end", "noise-label"), high - Math.log(noise) > 0.3 ? label(LEFT - 5, TOP + 6, head(Math.exp(high))) : null,
    svg("polyline", { points: logs.map((l, i) => `${x(i).toFixed(1)},${y(l).toFixed(1)}`).join(" "), class: "falling" }),
    svg("circle", { cx: RIGHT, cy: y(logs.at(-1)), r: 3, class: "now" }),
    label(LEFT, 89, "least error so far by iteration", "start"), label(RIGHT, 89, `${errors.at(-1)[0]}: ${head(now)}`)));
}

export function progress(list) {
  const own = list.filter((told) => told.job === app.state?.job?.id);
  if (!own.length) return;
  const [last, moved] = [own.at(-1), own.filter((told) => told.rmse_m !== null)];
  errors.push(...moved.map((told) => [told.iteration, told.rmse_m]));
  document.querySelectorAll(".progress").forEach((words) => { words.textContent = last.progress; });
  falling();
  if (!descends(last.what)) return;
  if (own.some((told) => told.moves)) watchFit(last.job);
  if (moved.length && app.state.model) falls(least(errors));
}

export function missing() {
  const { diagnosis: found, model, job: at_work } = app.state;
  const verdict = [];
  if (found) {
    verdict.push(h("p", { class: `verdict ${found.verdict}`, text: sentence(found) }));
    const warnings = found.warnings;
    // an effect that is missing bends the start model; where the answer explains the record, what that caused is of less weight
    const explained = found.verdict === "missing-effect" && near(proposals()[0]);
    if (warnings.length) verdict.push(h("details", { class: "theory checks", open: !explained }, h("summary", { text: warnings.length === 1 ? "one thing to check first" : `${warnings.length} things to check first` }), warnings.map((text) => h("p", { class: "advice", text: inWords(text) }))));
  } else if (model && !at_work) verdict.push(h("p", { class: "hint", text: "Diagnose asks every effect of the catalogue what it would explain. Point at a candidate to see its curve before you add it." }));
  put(at("verdict"), verdict);
  const shown = (found ? proposals() : []).filter((c, i) => i < 5 || c.probability > 0.01).slice(0, 8);
  const next = found?.next_test ? h("article", { class: "card next" }, h("h3", { text: "Next test" }), h("p", { text: found.next_test })) : null;
  const rest_of = (found?.rest || []).map((one, i) => h("article", { class: "card next" }, h("h3", { text: i ? "Or" : "What would explain the rest" }), h("p", { text: `${one.says} (probability ${probable(one.probability)})` })));
  put(at("candidates"), model ? [...rest_of, ...shown.map(candidate)] : null, next);
  const own = model?.effects || [];
  put(at("effects-in"), own.length ? h("h2", { text: "In the model" }) : null, own.map((effect) => {
    const off = h("input", { type: "checkbox", checked: !app.without.has(effect), onchange: () => { if (off.checked) app.without.delete(effect); else app.without.add(effect); rest(); try_(false); } });
    const about = app.effects.get(effect.split(/[:@]/)[0]);
    const [name, elements] = effect.split(":");
    const more = about?.most_elements > Number(elements || 1) ? h("button", { type: "button", text: "More elements", "aria-label": `More elements of ${name}`, title: "as many more as the recording supports", "data-key": `e${effect}`, disabled: Boolean(at_work), onclick: () => add(name) }) : null;
    return h("div", { class: "own" }, h("p", { class: "foot" }, h("label", { title: "off: simulate without it for a moment" }, off, ` ${effect}`), more, h("button", { type: "button", text: "Take out", "aria-label": `Take ${effect} out`, "data-key": `t${effect}`, disabled: Boolean(at_work), onclick: () => act("/api/remove", { effect }) })), theory(about));
  }));
  at("show-catalogue").disabled = !model || Boolean(at_work);
}

export function catalogue() {
  const dialog = at("catalogue");
  const list = h("div", { class: "list" });
  const search = h("input", { type: "search", placeholder: "search", "aria-label": "Search the catalogue", oninput: () => fill() });
  const fill = () => {
    const wanted = search.value.toLowerCase();
    const has = (e) => !wanted || `${e.name} ${e.summary} ${e.trace}`.toLowerCase().includes(wanted);
    const own = (e) => app.state.model.effects.some((one) => one === e.name || (!one.includes("@") && one.split(":")[0] === e.name));
    put(list, [...app.effects.values()].filter(has).map((e) => h("article", { class: "card" },
      h("h3", {}, e.name, h("button", { type: "button", class: "primary", disabled: own(e), text: own(e) ? "In the model" : "Add", "aria-label": `Add ${e.name}`, onclick: () => { dialog.close(); add(e.name); } })),
      h("p", { text: e.summary }), h("pre", { text: e.equation }), h("p", { class: "hint", text: e.source }))));
  };
  put(dialog, h("form", { method: "dialog", class: "heading" }, h("h2", { text: "Effects" }), search, h("button", { text: "Close" })), list);
  fill();
  dialog.showModal();
}
