// The panels around the charts fold and resize: each has a bar at its edge, with a button that folds it. The browser remembers the choice.

import { at, h } from "/assets/dom.js";

// What a bar is called; which way it grows: along x or y, by 1 or −1; its least and most size, px.
const PANELS = {
  past: { name: "Models", axis: "x", way: 1, least: 180, most: 520, arrows: ["◂", "▸"] },
  future: { name: "What is missing", axis: "x", way: -1, least: 220, most: 560, arrows: ["▸", "◂"] },
  hands: { name: "Parameters", axis: "y", way: -1, least: 70, most: 700, arrows: ["▾", "▴"] },
};
const STEP_PX = 24;
const KEY = "panels";

function read() {
  try { return JSON.parse(localStorage.getItem(KEY)) || {}; } catch { return {}; }
}
const kept = read();
function keep(name, change) {
  kept[name] = { ...kept[name], ...change };
  try { localStorage.setItem(KEY, JSON.stringify(kept)); } catch { /* a browser that keeps nothing */ }
}

const main = document.querySelector("main");

function size(name, px) {
  const { least, most } = PANELS[name];
  const within = px === null ? null : Math.round(Math.min(most, Math.max(least, px)));
  if (within === null) main.style.removeProperty(`--${name}`); else main.style.setProperty(`--${name}`, `${within}px`);
  return within;
}

function bar(name) {
  const { axis, way, arrows, name: called } = PANELS[name];
  const panel = at(name);
  const now = () => (axis === "x" ? panel.offsetWidth : panel.offsetHeight);
  const label = h("span", { text: called });
  const button = h("button", { type: "button", "aria-controls": name, onclick: () => fold(!folded) });
  const grip = h("span", { class: "grip", role: "separator", tabindex: 0, "aria-orientation": axis === "x" ? "vertical" : "horizontal", "aria-label": `Size of ${called}`, title: "drag to resize; double-click for the usual size" });
  let folded = false;
  const fold = (to_folded) => {
    folded = to_folded;
    main.classList.toggle(`without-${name}`, folded);
    button.replaceChildren(arrows[Number(folded)], ...(folded ? [label] : []));
    button.setAttribute("aria-expanded", String(!folded));
    const does = `${folded ? "Show" : "Fold"} ${called}`;
    button.setAttribute("aria-label", does);
    button.title = does;
    grip.hidden = folded;
    keep(name, { folded });
  };
  const to = (px) => { keep(name, { px: size(name, px) }); grip.setAttribute("aria-valuenow", now()); };
  grip.addEventListener("pointerdown", (down) => {
    grip.setPointerCapture(down.pointerId);
    const [from, start] = [axis === "x" ? down.clientX : down.clientY, now()];
    const drag = (event) => to(start + way * ((axis === "x" ? event.clientX : event.clientY) - from));
    grip.addEventListener("pointermove", drag);
    grip.addEventListener("pointerup", () => grip.removeEventListener("pointermove", drag), { once: true });
    down.preventDefault();
    grip.focus();
  });
  grip.addEventListener("focus", () => grip.setAttribute("aria-valuenow", now()));
  grip.addEventListener("dblclick", () => to(null));
  grip.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
    if (!by && event.key !== "Enter") return;
    event.preventDefault();
    event.stopPropagation();
    if (by) to(now() + way * by * STEP_PX); else fold(true);
  });
  const edge = h("div", { class: `edge ${name}` }, grip, button);
  (way > 0 ? panel.after.bind(panel) : panel.before.bind(panel))(edge);
  size(name, kept[name]?.px ?? null);
  fold(Boolean(kept[name]?.folded));
}

// The drawing of the rig folds by its heading.
function rig() {
  const button = at("fold-rig");
  const fold = (folded) => {
    at("rig").hidden = folded;
    button.setAttribute("aria-expanded", String(!folded));
    button.textContent = folded ? "▾" : "▴";
    button.setAttribute("aria-label", `${folded ? "Show" : "Fold"} the drawing of the rig`);
    keep("rig", { folded });
  };
  button.addEventListener("click", () => fold(!at("rig").hidden));
  fold(Boolean(kept.rig?.folded));
}

export function folds() {
  Object.keys(PANELS).forEach(bar);
  rig();
}
