// The rig to scale. What an effect places along the pipe can be dragged there, or moved with the arrow keys; a double click, or Enter at the
// keyboard's mark, offers what else could stand at a place.

import { at, digits, named, put, svg, uncertain } from "/assets/dom.js";
import { app } from "/assets/store.js";
import { move, release } from "/assets/hands.js";
import { offer } from "/assets/place.js";
import { AXIS, draw, plan } from "/assets/drawing.js";

const TAP = matchMedia("(pointer: coarse)").matches ? "double-tap" : "double-click";

// From where to where the pipe is drawn, of what width; how wide a letter of a name is. On a phone all is larger.
let [FROM, TO, WIDTH, LETTER] = [70, 930, 1000, 7];
const phone = matchMedia("(max-width: 700px)");
phone.addEventListener("change", () => app.state && rig());
const STEP = 0.002;
const WAY = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };
// As far from a pipe a double click still means it, in the drawing's units.
const NEAR = 60;
// Where the keyboard's mark stands, as a share of all lines' length, one line after the other.
let mark = 0.5;

// Where in the drawing an event points.
function pointOf(event) {
  const box = at("rig").firstElementChild.getBoundingClientRect();
  const scale = WIDTH / box.width;
  return [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
}
const step = (event, length) => WAY[event.key] * length * STEP * (event.shiftKey ? 10 : 1);

function marker(p, where, lines, row) {
  const [line, length] = [p.line ?? 0, lines[p.line ?? 0].length_m];
  const shift = (m) => { const [x, y] = where.at(line, m); return `translate(${x} ${y - AXIS})`; };
  const value = app.moved[p.name] ?? p.value;
  const place = (m) => Math.min(p.upper, Math.max(p.lower, m));
  const group = svg("g", { class: "marker", tabindex: 0, role: "slider", "data-key": p.name, "aria-label": `${named(p)} along ${lines[line].name ?? "the pipe"}`, "aria-valuemin": p.lower, "aria-valuemax": p.upper, "aria-valuenow": value, "aria-valuetext": `${digits(value, 4)} m`, transform: shift(value) },
    svg("circle", { cy: AXIS + 22, r: 22, class: "handle" }),
    svg("path", { d: `M0 ${AXIS + 8} l-9 16 a10 10 0 1 0 18 0 z` }),
    svg("text", { y: AXIS + 52 + 16 * row, text: "" }));
  const text = group.querySelector("text");
  const show = (m) => {
    group.setAttribute("transform", shift(m));
    group.setAttribute("aria-valuenow", m);
    group.setAttribute("aria-valuetext", `${digits(m, 4)} m`);
    const said = p.standard_error > 0 && m === p.value ? uncertain(m, p.standard_error) : m.toFixed(Math.abs(m) < 100 ? 2 : 1);
    const what = /_(start|end)_m$/.test(p.name) ? named(p) : p.effect;
    text.textContent = `${what} ${said} m`;
    // a name near an end of the pipe stays within the drawing
    const share = (where.at(line, m)[0] - FROM) / (TO - FROM);
    text.setAttribute("text-anchor", share < 0.15 ? "start" : share > 0.85 ? "end" : "middle");
  };
  show(value);
  const to = (m, coarse) => { show(place(m)); move(p.name, place(m), coarse); };
  group.addEventListener("pointerdown", (down) => {
    group.setPointerCapture(down.pointerId);
    const drag = (event) => to(where.along(line, pointOf(event)).m, true);
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

// The keyboard's mark: the arrow keys move it from line to line, Enter offers what could stand there.
function pointer(where, lines) {
  const whole = lines.reduce((sum, line) => sum + line.length_m, 0);
  const group = svg("g", { class: "pointer", tabindex: 0, role: "slider", "data-key": "place", "aria-label": "A place along the pipe; Enter offers effects to add there", "aria-valuemin": 0, "aria-valuemax": whole },
    svg("path", { d: `M0 ${AXIS - 6} l-7 -13 h14 z` }), svg("text", { y: AXIS - 26, "text-anchor": "middle" }));
  const place = () => {
    let m = mark * whole;
    const line = lines.findIndex((one, i) => m <= one.length_m || i === lines.length - 1 || ((m -= one.length_m), false));
    return { line, m: Math.min(m, lines[line].length_m) };
  };
  const show = () => {
    const { line, m } = place();
    const [x, y] = where.at(line, m);
    const said = `${digits(m, 4)} m${lines[line].name ? ` along ${lines[line].name}` : ""}`;
    group.setAttribute("transform", `translate(${x} ${y - AXIS})`);
    group.setAttribute("aria-valuenow", mark * whole);
    group.setAttribute("aria-valuetext", said);
    group.querySelector("text").textContent = `${said} · Enter adds here`;
  };
  show();
  group.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") offer(place());
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
  const { length_m: length, lines } = open.rig;
  const where = plan(open.rig, { from: FROM, to: TO });
  const point = (p) => where.at(p.line ?? 0, p.value);
  const sensors = [...new Map(open.runs.flatMap((r) => r.sensors).map((s) => [s.name, s])).values()];
  const [under, over] = draw({ ...open.rig, sensors }, { from: FROM, to: TO, letter: LETTER });
  const all = app.state.model?.parameters || [];
  const placed = all.filter((p) => p.effect && /_(position|start|end)_m$/.test(p.name)).sort((a, b) => point(a)[0] - point(b)[0]);
  const stretches = placed.filter((p) => /_start_m$/.test(p.name)).map((p) => [p, placed.find((q) => q.name === p.name.replace("_start_m", "_end_m"))]).filter(([, to]) => to);
  const valve = where.put(open.rig.nodes[open.rig.valve].at);
  const pocket = (app.state.model?.effects || []).some((effect) => effect === "air-pocket");
  const rows = placed.map((p, i) => (i && point(p)[0] - point(placed[i - 1])[0] < 170 ? 1 : 0));
  rows.forEach((row, i) => { if (row && rows[i - 1]) rows[i] = 0; });
  at("rig-hint").textContent = `${open.rig.name}, ${digits(length, 4)} m${app.state.model ? ` · ${placed.length ? "drag an effect along the pipe; " : ""}${TAP} the pipe to add ${placed.length ? "one" : "an effect"} there` : ""}`;
  put(at("rig"), svg("svg", { viewBox: `0 0 ${WIDTH} ${where.height + (placed.length ? 108 + 16 * Math.max(...rows) : 86)}`, role: "group", "aria-label": `Rig ${open.rig.name}`, ondblclick: (event) => { const place = where.nearest(pointOf(event)); if (place.off < NEAR) offer(place); } },
    under,
    stretches.map(([from, to]) => svg("polyline", { points: where.path(from.line ?? 0, from.value, to.value), fill: "none", class: "stretch" })),
    pocket ? svg("g", {}, svg("circle", { cx: valve[0] - 8, cy: valve[1] - 7, r: 6, class: "air" }), svg("title", { text: "air pocket at the valve" })) : null,
    over, app.state.model ? pointer(where, lines) : null, placed.map((p, i) => marker(p, where, lines, rows[i]))));
}
