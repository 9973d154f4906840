// The rig to scale. What an effect places along the pipe can be dragged there, or moved with the arrow keys.

import { at, digits, named, put, svg } from "/assets/dom.js";
import { app } from "/assets/store.js";
import { move, release } from "/assets/hands.js";

const [FROM, TO, WIDTH, AXIS] = [70, 930, 1000, 52];

function marker(p, x, length) {
  const value = app.moved[p.name] ?? p.value;
  const place = (m) => Math.min(p.upper, Math.max(p.lower, m));
  const group = svg("g", { class: "marker", tabindex: 0, role: "slider", "data-key": p.name, "aria-label": `${named(p)} along the pipe`, "aria-valuemin": p.lower, "aria-valuemax": p.upper, "aria-valuenow": value, "aria-valuetext": `${digits(value, 4)} m`, transform: `translate(${x(value)} 0)` },
    svg("path", { d: `M0 ${AXIS + 8} l-9 16 a10 10 0 1 0 18 0 z` }),
    svg("text", { y: AXIS + 50, "text-anchor": "middle", text: "" }));
  const show = (m) => {
    group.setAttribute("transform", `translate(${x(m)} 0)`);
    group.setAttribute("aria-valuenow", m);
    group.setAttribute("aria-valuetext", `${digits(m, 4)} m`);
    const error = p.standard_error > 0 && m === p.value ? ` ± ${digits(p.standard_error, 2)}` : "";
    group.querySelector("text").textContent = `${p.effect} ${m.toFixed(Math.abs(m) < 100 ? 2 : 1)}${error} m`;
  };
  show(value);
  const to = (m, coarse) => { show(place(m)); move(p.name, place(m), coarse); };
  group.addEventListener("pointerdown", (down) => {
    group.setPointerCapture(down.pointerId);
    const drag = (event) => {
      const box = group.ownerSVGElement.getBoundingClientRect();
      to(((((event.clientX - box.left) / box.width) * WIDTH - FROM) / (TO - FROM)) * length, true);
    };
    group.addEventListener("pointermove", drag);
    group.addEventListener("pointerup", () => { group.removeEventListener("pointermove", drag); release(p.name); }, { once: true });
    down.preventDefault();
    group.focus();
  });
  group.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
    if (!way) return;
    event.preventDefault();
    event.stopPropagation();
    to((app.moved[p.name] ?? p.value) + way * length * (event.shiftKey ? 0.02 : 0.002), true);
  });
  group.addEventListener("keyup", (event) => { if (event.key.startsWith("Arrow")) release(p.name); });
  return group;
}

export function rig() {
  const open = app.state.open;
  at("rig-card").hidden = !open;
  if (!open) return;
  const { length_m: length, pipes, supply } = open.rig;
  const x = (m) => FROM + ((TO - FROM) * m) / length;
  const widest = Math.max(...pipes.map((p) => p.inner_diameter_m));
  const sensors = [...new Map(open.runs.flatMap((r) => r.sensors).map((s) => [s.name, s])).values()].sort((a, b) => a.position_m - b.position_m);
  let last = -1e9;
  const foot = (s) => {
    // names that would touch stand one above the other
    const low = x(s.position_m) - last < 70;
    last = low ? -1e9 : x(s.position_m);
    return svg("g", {}, svg("circle", { cx: x(s.position_m), cy: AXIS, r: 5, class: "sensor" }), svg("text", { x: x(s.position_m), y: low ? 16 : 32, "text-anchor": "middle", text: `${s.name} ${digits(s.position_m, 4)} m` }));
  };
  const placed = (app.state.model?.parameters || []).filter((p) => p.effect && /_position_m$/.test(p.name));
  at("rig-hint").textContent = placed.length ? "drag an effect along the pipe" : `${open.rig.name}, ${digits(length, 4)} m`;
  put(at("rig"), svg("svg", { viewBox: `0 0 ${WIDTH} ${placed.length ? 112 : 86}`, role: "group", "aria-label": `Rig ${open.rig.name}` },
    supply === "pump" ? svg("circle", { cx: FROM - 14, cy: AXIS, r: 14, class: "supply" }) : svg("rect", { x: FROM - 30, y: AXIS - 34, width: 30, height: 44, class: "supply" }),
    svg("text", { x: FROM - 15, y: AXIS + 26, "text-anchor": "middle", text: supply === "pump" ? "pump" : "supply" }),
    pipes.map((p) => svg("line", { x1: x(p.from_m), x2: x(p.to_m), y1: AXIS, y2: AXIS, class: "pipe", "stroke-width": Math.max(3, (9 * p.inner_diameter_m) / widest) }, svg("title", { text: `${p.name}: ${digits(p.to_m - p.from_m, 4)} m, ${digits(1000 * p.inner_diameter_m, 4)} mm` }))),
    svg("path", { d: `M${TO} ${AXIS - 9} l20 18 v-18 l-20 18 z`, class: "valve" }), svg("text", { x: TO + 10, y: AXIS + 26, "text-anchor": "middle", text: "valve" }),
    sensors.map(foot), placed.map((p) => marker(p, x, length))));
}
