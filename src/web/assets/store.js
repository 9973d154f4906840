// What the page knows: the server's state, and what only this page has chosen.

import { ask, post } from "/assets/api.js";
import { at, h, named } from "/assets/dom.js";

export const app = {
  state: null,
  effects: new Map(),
  unit: "m",
  // seconds after the start of the closure; null is the whole record
  range: null,
  // a candidate's label, the number of another model, both drawn beside the model in force
  preview: null,
  compare: null,
  // what a person has changed of parameters since the last fit
  moved: {},
  hold: new Set(),
  free: new Set(),
  bounds: {},
  without: new Set(),
  // something is being dragged: scales stand still
  drags: false,
  // what followed while another parameter was dragged
  followed: new Map(),
  // this page itself opens another run
  opens: false,
};

const redraws = [];
export const onState = (redraw) => redraws.push(redraw);

let model = null;
let asked = null;
// Events come in bundles, such as a new model and the end of its job: one answer serves them all.
export function refresh() {
  asked ||= new Promise((done) => setTimeout(done)).then(() => { asked = null; return renew(); });
  return asked;
}

// What tells one fitted model of one recording from another.
export const modelKey = () => JSON.stringify([app.state.open?.title, app.state.model?.number, app.state.model?.rmse_m]);

export async function renew() {
  const state = await ask("/api/state");
  if (JSON.stringify(state) === JSON.stringify(app.state)) return;
  app.state = state;
  const key = modelKey();
  if (key !== model) {
    model = key;
    app.moved = {};
    app.bounds = {};
    app.hold.clear();
    app.free.clear();
    app.without.clear();
    app.drags = false;
    app.followed.clear();
    app.preview = null;
    app.compare = null;
  }
  redraws.forEach((redraw) => redraw());
}

// What a diagnosis proposes to add: two effects together, where no single one is the answer, and each effect.
export function proposals() {
  const { candidates = [], pair } = app.state.diagnosis || {};
  return pair ? [{ ...pair, label: pair.labels.join(" + ") }, ...candidates] : candidates;
}

export function tell(text) {
  at("told").textContent = text;
}

// What is wrong; `once`: what a person has taken notice of does not come back when the page is loaded again.
export function complain(error, once = false) {
  const text = error.message || String(error);
  if (once && sessionStorage.getItem(`noticed ${text}`)) return;
  const noticed = () => { if (once) sessionStorage.setItem(`noticed ${text}`, "yes"); message.remove(); };
  const message = h("p", {}, h("span", { text }), h("button", { type: "button", text: "Dismiss", onclick: noticed }));
  const dialog = [...document.querySelectorAll("dialog[open]")].at(-1);
  if (!dialog) { at("messages").replaceChildren(message); return; }
  // what lies behind a dialog can be neither read nor reached
  const own = dialog.querySelector(".messages") || h("div", { class: "messages", role: "alert" });
  own.replaceChildren(message);
  if (!own.isConnected) dialog.firstElementChild.after(own);
}

// What was wrong no longer is.
export const content = () => document.querySelectorAll(".messages").forEach((box) => box.replaceChildren());

// A sentence with parameters named as people name them.
export const inWords = (text) => (app.state.model?.parameters || []).reduce((said, p) => said.replaceAll(p.name, named(p)), text);

// Starts a job; what is wrong is shown. The second of a double click is none.
const acting = new Set();
export async function act(path, body) {
  if (acting.has(path)) return null;
  acting.add(path);
  app.opens ||= ["/api/open", "/api/record"].includes(path);
  try {
    content();
    const answer = await post(path, body);
    await refresh();
    return answer;
  } catch (error) {
    app.opens = false;
    complain(error);
    return null;
  } finally {
    acting.delete(path);
  }
}
