// The command line that does what an action of the page does, to be copied.

import { at, h, svg } from "/assets/dom.js";
import { app, tell } from "/assets/store.js";

export const word = (text) => (/^[\w@:.,=+/-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

// The command of an action. What a person has moved or held is part of the fit's.
export function commandOf(action, effect) {
  const { model } = app.state;
  const known = model.commands;
  if (action !== "fit") return effect ? known[action].replace("EFFECT", () => word(effect)) : known[action];
  const held = model.parameters.filter((p) => (p.held || app.hold.has(p.name)) && !app.free.has(p.name));
  const bounded = model.parameters.filter((p) => p.name in app.bounds && !held.includes(p));
  const changed = Object.keys(app.moved).length + app.hold.size + app.free.size + bounded.length;
  if (!changed) return known.fit;
  const free = model.parameters.filter((p) => p.name in app.moved && !held.includes(p));
  const each = (all) => [...new Map(all.map((p) => [p.name, p])).values()];
  const option = (name, all, of) => (all.length ? ` ${name} ${each(all).map((p) => word(`${p.name}=${of(p)}`)).join(" ")}` : "");
  const value = (p) => app.moved[p.name] ?? p.value;
  const hold = (p) => (held.includes(p) ? value(p) : app.bounds[p.name].join(":"));
  return known.calibrate.replace("--effects EFFECTS", () => `--effects ${word(model.effects.join(",") || "none")}`) + option("--hold", [...held, ...bounded], hold) + option("--start", free, value);
}

export async function copy(text) {
  const said = at("copied");
  try { await navigator.clipboard.writeText(text); said.textContent = `copied: ${text}`; } catch { said.textContent = text; }
  said.hidden = false;
  tell(said.textContent);
  clearTimeout(copy.waits);
  copy.waits = setTimeout(() => { said.hidden = true; }, 6000);
}

// A small button that copies it; while the model in force is not fitted yet there is nothing to copy.
export function copier(action, effect) {
  if (!app.state.model) return null;
  const label = `Copy the command: ${commandOf(action, effect)}`;
  return h("button", { type: "button", class: "quiet copier", title: label, "aria-label": label, "data-key": `copy ${action} ${effect || ""}`, onclick: () => copy(commandOf(action, effect)) },
    svg("svg", { viewBox: "0 0 16 16", "aria-hidden": "true" }, svg("path", { d: "M5.5 5.5V3a1 1 0 0 1 1-1h6.5a1 1 0 0 1 1 1v6.5a1 1 0 0 1-1 1H10.5 M3 5.5h6.5a1 1 0 0 1 1 1V13a1 1 0 0 1-1 1H3a1 1 0 0 1-1-1V6.5a1 1 0 0 1 1-1z" })));
}
