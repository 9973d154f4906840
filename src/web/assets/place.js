// An effect added at a place: what can stand along the pipe, to be put where a person points.

import { at, digits, h, put } from "/assets/dom.js";
import { app } from "/assets/store.js";
import { add } from "/assets/future.js";

// Half the length with which a stretch of pipe starts, of the whole.
const HALF = 0.05;

// What an effect starts from at a place.
function starts(located, m, length) {
  const within = (v) => Math.min(0.999 * length, Math.max(0.001 * length, v));
  if (!located.to) return { [located.from]: within(m) };
  return { [located.from]: within(m - HALF * length), [located.to]: within(m + HALF * length) };
}

// Offers the effects that can stand at a place, m along a line.
export function offer({ line, m }) {
  const { open, model, job } = app.state;
  if (!model) return;
  const { name, length_m: length } = open.rig.lines[line];
  const dialog = at("place");
  const place = h("input", { type: "number", min: 0, max: digits(length, 5), step: "any", value: +m.toFixed(length < 20 ? 3 : 1), "aria-label": `Place, m ${name ? `along ${name}` : "from the supply"}`, oninput: () => place.setCustomValidity("") });
  const has = (effect) => model.effects.some((own) => own.split(/[:@]/)[0] === effect);
  const one = (located) => {
    const about = app.effects.get(located.effect);
    return h("p", { class: "foot" }, h("span", {}, h("b", { text: located.effect }), about ? ` ${about.summary}` : ""),
      h("button", { type: "button", class: "primary", text: has(located.effect) ? "In the model" : "Add here", "aria-label": `Add ${located.effect} here`, disabled: Boolean(job) || has(located.effect), onclick: () => {
        const m = place.valueAsNumber;
        if (!(m >= 0 && m <= length)) { place.setCustomValidity(`from 0 to ${digits(length, 5)} m`); place.reportValidity(); return; }
        dialog.close();
        add(name ? `${located.effect}@${name}` : located.effect, starts(located, m, length));
      } }));
  };
  put(dialog, h("form", { method: "dialog", class: "heading" }, h("h2", {}, "Add an effect at ", place, name ? ` m along ${name}` : " m"), h("button", { text: "Close" })),
    h("p", { class: "hint", text: `The fit starts there and finds the best place nearby. Distances are from ${name ? `where ${name} begins` : "the supply"}.` }), open.rig.located.map(one));
  dialog.showModal();
}
