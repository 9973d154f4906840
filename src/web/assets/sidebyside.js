// The model in force and another one: their errors and parameters in one table.

import { ask } from "/assets/api.js";
import { at, digits, h, head, keyOf, put, times, uncertain, withUnit } from "/assets/dom.js";
import { app, complain } from "/assets/store.js";

const said = (p) => (p ? (p.fixed ? `${digits(p.value, 5)} held` : uncertain(p.value, p.standard_error)) : "–");
const knows = (p) => p.fixed || p.standard_error > 0;

// How far two values lie apart, in their common error where both have one.
function apart(a, b) {
  if (!a || !b) return "";
  const error = Math.hypot(a.standard_error || 0, b.standard_error || 0);
  const change = digits(a.value - b.value, 2);
  return error > 0 && knows(a) && knows(b) ? `${change} (${digits(Math.abs(a.value - b.value) / error, 2)} σ)` : change;
}

export async function sideBySide(other) {
  let all;
  try { all = await ask("/api/models"); } catch (error) { complain(error); return; }
  const pair = [app.state.model.number, other].map((number) => ({ ...app.state.models[number - 1], parameters: new Map(all[number - 1].parameters.map((p) => [keyOf(p), p])) }));
  const [now, then] = pair;
  const keys = [...new Set(pair.flatMap((m) => [...m.parameters.keys()]))];
  const line = (label, ...cells) => h("tr", {}, h("th", { scope: "row", text: label }), cells.map((text) => h("td", { class: "number", text })));
  // a key is a name and, after a space, a run
  const label = (key, [name, ...run] = key.split(" ")) => withUnit(name) + (app.state.open.runs.length > 1 ? ` ${run.join(" ")}` : "");
  const dialog = at("sidebyside");
  put(dialog, h("form", { method: "dialog", class: "heading" }, h("h2", { text: `Model ${now.number} and model ${then.number}` }), h("button", { text: "Close" })),
    h("p", { class: "hint", text: "The charts draw both: the model in force in its colour, the other in grey. σ: the standard error of the difference." }),
    h("div", { class: "list" }, h("table", {},
      h("thead", {}, h("tr", {}, h("th"), pair.map((m) => h("th", { scope: "col", class: "number", text: `${m.number} · ${m.effects.join(" + ") || "base model"}` })), h("th", { scope: "col", class: "number", text: "difference" }))),
      h("tbody", {}, line("error", ...pair.map((m) => head(m.rmse_m)), head(now.rmse_m - then.rmse_m)), line("", ...pair.map((m) => times(m.rmse_m, m.noise_m)), ""),
        keys.map((k) => line(label(k), ...pair.map((m) => said(m.parameters.get(k))), apart(now.parameters.get(k), then.parameters.get(k))))))));
  dialog.showModal();
}
