// The rig to scale. What an effect places along the pipe can be dragged there, or moved with the arrow keys; a double click, or Enter at the
// keyboard's mark, offers what else could stand at a place.

import { at, digits, named, put, svg, uncertain } from "/assets/dom.js";
import { app } from "/assets/store.js";
import { move, release } from "/assets/hands.js";
import { offer } from "/assets/place.js";
import { AXIS, line } from "/assets/drawing.js";

const TAP = matchMedia("(pointer: coarse)").matches ? "double-tap" : "double-click";

// From where to where the pipe is drawn, of what width; how wide a letter of a name is. On a phone all is larger.
let [FROM, TO, WIDTH, LETTER] = [70, 930, 1000, 7];
const phone = matchMedia("(max-width: 700px)");
phone.addEventListener("change", () => app.state && rig());
const STEP = 0.002;
const WAY = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };
// Where the keyboard's mark stands, as a share of the length.
let mark = 0.5;

// Where along the pipe an event points, m.
function placeOf(event, length) {
  const box = at("rig").firstElementChild.getBoundingClientRect();
  return ((((event.clientX - box.left) / box.width) * WIDTH - FROM) / (TO - FROM)) * length;
}
const step = (event, length) => WAY[event.key] * length * STEP * (event.shiftKey ? 10 : 1);

function marker(p, x, length, row) {
  const value = app.moved[p.name] ?? p.value;
  const place = (m) => Math.min(p.upper, Math.max(p.lower, m));
  const group = svg("g", { class: "marker", tabindex: 0, role: "slider", "data-key": p.name, "aria-label": `${named(p)} along the pipe`, "aria-valuemin": p.lower, "aria-valuemax": p.upper, "aria-valuenow": value, "aria-valuetext": `${digits(value, 4)} m`, transform: `translate(${x(value)} 0)` },
    svg("circle", { cy: AXIS + 22, r: 22, class: "handle" }),
    svg("path", { d: `M0 ${AXIS + 8} l-9 16 a10 10 0 1 0 18 0 z` }),
    svg("text", { y: AXIS + 52 + 16 * row, text: "" }));
  const text = group.querySelector("text");
  const show = (m) => {
    group.setAttribute("transform", `translate(${x(m)} 0)`);
    group.setAttribute("aria-valuenow", m);
    group.setAttribute("aria-valuetext", `${digits(m, 4)} m`);
    const said = p.standard_error > 0 && m === p.value ? uncertain(m, p.standard_error) : m.toFixed(Math.abs(m) < 100 ? 2 : 1);
    const what = /_(start|end)_m$/.test(p.name) ? named(p) : p.effect;
    text.textContent = `${what} ${said} m`;
    // a name near an end of the pipe stays within the drawing
    text.setAttribute("text-anchor", m < 0.15 * length ? "start" : m > 0.85 * length ? "end" : "middle");
  };
  show(value);
  const to = (m, coarse) => { show(place(m)); move(p.name, place(m), coarse); };
  group.addEventListener("pointerdown", (down) => {
    group.setPointerCapture(down.pointerId);
    const drag = (event) => to(placeOf(event, length), true);
    const up = () => { group.removeEventListener("pointermove", drag); if (p.name in app.moved) release(p.name); };
    group.addEventListener("pointermove", drag);
    group.addEventListener("pointerup", up, { once: true });
    down.preventDefault();
    group.focus();
  });
  group.addEventListener("dblclick", (event) => event.stopPropagation());
  group.addEventListener("keydown", (event) => {
    if (!WAY[event.key]) return;
    event.preventDefault();
    event.stopPropagation();
    to((app.moved[p.name] ?? p.value) + step(event, length), true);
  });
  group.addEventListener("keyup", (event) => { if (WAY[event.key]) release(p.name); });
  return group;
}

// The keyboard's mark: the arrow keys move it, Enter offers what could stand there.
function pointer(x, length) {
  const group = svg("g", { class: "pointer", tabindex: 0, role: "slider", "data-key": "place", "aria-label": "A place along the pipe; Enter offers effects to add there", "aria-valuemin": 0, "aria-valuemax": length },
    svg("path", { d: `M0 ${AXIS - 6} l-7 -13 h14 z` }), svg("text", { y: AXIS - 26, "text-anchor": "middle" }));
  const show = () => {
    const m = mark * length;
    group.setAttribute("transform", `translate(${x(m)} 0)`);
    group.setAttribute("aria-valuenow", m);
    group.setAttribute("aria-valuetext", `${digits(m, 4)} m`);
    group.querySelector("text").textContent = `${digits(m, 4)} m · Enter adds here`;
  };
  show();
  group.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") offer(mark * length);
    else if (WAY[event.key]) { mark = Math.min(1, Math.max(0, mark + 5 * step(event, 1))); show(); } else return;
    event.preventDefault();
    event.stopPropagation();
  });
  return group;
}

export function rig() {
  const open = app.state.open;
  at("rig-card").hidden = !open;
  if (!open) return;
  [FROM, TO, WIDTH, LETTER] = phone.matches ? [42, 440, 484, 8] : [70, 930, 1000, 7];
  const { length_m: length, pipes, supply } = open.rig;
  const x = (m) => FROM + ((TO - FROM) * m) / length;
  const sensors = [...new Map(open.runs.flatMap((r) => r.sensors).map((s) => [s.name, s])).values()];
  const [under, over] = line({ length, pipes, supply, sensors }, { from: FROM, to: TO, letter: LETTER });
  const all = app.state.model?.parameters || [];
  const placed = all.filter((p) => p.effect && /_(position|start|end)_m$/.test(p.name)).sort((a, b) => a.value - b.value);
  const stretches = placed.filter((p) => /_start_m$/.test(p.name)).map((p) => [p, placed.find((q) => q.name === p.name.replace("_start_m", "_end_m"))]).filter(([, to]) => to);
  const pocket = (app.state.model?.effects || []).some((effect) => effect === "air-pocket");
  const rows = placed.map((p, i) => (i && x(p.value) - x(placed[i - 1].value) < 170 ? 1 : 0));
  rows.forEach((row, i) => { if (row && rows[i - 1]) rows[i] = 0; });
  at("rig-hint").textContent = `${open.rig.name}, ${digits(length, 4)} m${app.state.model ? ` · ${placed.length ? "drag an effect along the pipe; " : ""}${TAP} the pipe to add ${placed.length ? "one" : "an effect"} there` : ""}`;
  put(at("rig"), svg("svg", { viewBox: `0 0 ${WIDTH} ${placed.length ? 108 + 16 * Math.max(...rows) : 86}`, role: "group", "aria-label": `Rig ${open.rig.name}`, ondblclick: (event) => { const m = placeOf(event, length); if (m >= 0 && m <= length) offer(m); } },
    under,
    stretches.map(([from, to]) => svg("line", { x1: x(from.value), x2: x(to.value), y1: AXIS, y2: AXIS, class: "stretch" })),
    pocket ? svg("g", {}, svg("circle", { cx: TO - 8, cy: AXIS - 7, r: 6, class: "air" }), svg("title", { text: "air pocket at the valve" })) : null,
    over, app.state.model ? pointer(x, length) : null, placed.map((p, i) => marker(p, x, length, rows[i]))));
}
