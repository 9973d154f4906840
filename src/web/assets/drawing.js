// A rig from its supply to its valve, with what branches off and its sensors: as it stands, or as far as it is known.

import { digits, svg } from "/assets/dom.js";

export const AXIS = 52;

// The plan of pipes in series, which the server gives for a rig that it has.
export function inSeries(length_m, supply) {
  const node = (name, kind, x) => ({ name, kind, at: [x, 0], outward: [2 * x - 1, 0] });
  return { lines: [{ length_m, corners: [[0, 0], [1, 0]] }], nodes: [node("supply", supply, 0), node("valve", "valve", 1)] };
}

// Where the lines of a rig are in a drawing; `from` and `to` say where it begins and ends.
export function plan({ lines, nodes }, { from, to }) {
  const wide = to - from;
  const heights = [0, ...nodes.map((n) => n.at[1]), ...lines.flatMap((l) => l.corners.map((c) => c[1]))];
  const [top, bottom] = [Math.min(...heights), Math.max(...heights)];
  const put = ([x, y]) => [from + wide * x, AXIS + wide * (y - top)];
  // each line as legs, of which each knows where it begins and ends along the line, m
  const legs = lines.map((line) => {
    const corners = line.corners.map(put);
    const lengths = corners.slice(1).map((c, i) => Math.hypot(c[0] - corners[i][0], c[1] - corners[i][1]));
    const per_px = line.length_m / lengths.reduce((a, b) => a + b, 0);
    let begin = 0;
    return lengths.map((l, i) => ({ a: corners[i], b: corners[i + 1], begin, end: (begin += l * per_px) }));
  });
  const at = (line, m) => {
    const { a, b, begin, end } = legs[line].find((leg) => m <= leg.end) || legs[line].at(-1);
    const s = Math.min(1, Math.max(0, (m - begin) / (end - begin)));
    return [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])];
  };
  // the place on a line that lies nearest to a point
  const along = (line, [x, y]) => legs[line].map(({ a, b, begin, end }) => {
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const s = Math.min(1, Math.max(0, ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy)));
    return { line, m: begin + s * (end - begin), off: Math.hypot(x - a[0] - s * dx, y - a[1] - s * dy) };
  }).reduce((best, one) => (one.off < best.off ? one : best));
  const nearest = (point) => lines.map((_, line) => along(line, point)).reduce((best, one) => (one.off < best.off ? one : best));
  // the way along a line from one place to another
  const path = (line, begin, end) => [at(line, begin), ...legs[line].filter((leg) => leg.end > begin && leg.end < end).map((leg) => leg.b), at(line, end)].map((p) => p.join(",")).join(" ");
  return { put, at, along, nearest, path, height: wide * (bottom - top) };
}

function mark({ kind, at: [x, y], outward, name }) {
  const [cx, cy] = [x + 15 * (outward?.[0] ?? 0), y + 15 * (outward?.[1] ?? 0)];
  const shapes = {
    pump: () => svg("circle", { cx, cy, r: 14, class: "supply" }),
    reservoir: () => svg("rect", { x: cx - 15, y: cy - 34, width: 30, height: 44, class: "supply" }),
    valve: () => svg("path", { d: `M${cx - 10} ${cy - 9} l20 18 v-18 l-20 18 z`, class: "valve" }),
    "check-valve": () => svg("path", { d: `M${x - 7} ${y - 9} v18 l14 -9 z`, class: "valve" }),
    junction: () => svg("circle", { cx: x, cy: y, r: 3, class: "valve" }),
  };
  // what feeds a pipe is drawn as a tank while it is not known
  const shape = (shapes[kind] || shapes.reservoir)();
  const aside = kind === "junction" ? { x: x + 8, y: y + 18 } : { x: cx, y: cy + 26, "text-anchor": "middle" };
  return svg("g", {}, shape, svg("text", { ...aside, text: name }));
}

// `frame` says from where to where the rig is drawn, and how wide a letter is. What lies below other marks, and what lies above them.
export function draw({ lines, nodes, pipes, sensors }, frame) {
  const { from, to, letter } = frame;
  const { put, at, path } = plan({ lines, nodes }, frame);
  const widest = Math.max(...pipes.map((p) => p.inner_diameter_m));
  const last = new Map();
  const foot = ([s, [place, y]]) => {
    // names that would touch stand one above the other
    const text = `${s.name} ${+s.position_m.toPrecision(4)} m${s.assumed ? "?" : ""}`;
    const wide = letter * text.length;
    const anchor = place > to - 30 ? "end" : place < from + wide / 2 ? "start" : "middle";
    const left = place - { start: 0, middle: wide / 2, end: wide }[anchor];
    const row = Math.round(y / 20);
    const raised = left < (last.get(row) ?? -1e9);
    last.set(row, raised ? -1e9 : left + wide);
    return svg("g", {}, svg("circle", { cx: place, cy: y, r: 5, class: s.assumed ? "sensor assumed" : "sensor" }), svg("text", { x: anchor === "start" ? place + 4 : place, y: y - (raised ? 36 : 20), "text-anchor": anchor, text }));
  };
  const named = (n) => ({ ...n, at: put(n.at), name: lines.length === 1 && n.kind === "pump" ? "pump" : n.name });
  const [ends, between] = [nodes.filter((n) => n.kind !== "junction"), nodes.filter((n) => n.kind === "junction")];
  const under = [...ends.filter((n) => n.kind !== "valve").map((n) => mark(named(n))),
    ...pipes.map((p) => svg("polyline", { points: path(p.line ?? 0, p.from_m, p.to_m), fill: "none", class: "pipe", "stroke-width": Math.max(3, (9 * p.inner_diameter_m) / widest) }, svg("title", { text: `${p.name}: ${digits(p.to_m - p.from_m, 4)} m, ${digits(1000 * p.inner_diameter_m, 4)} mm` })))];
  const over = [...ends.filter((n) => n.kind === "valve").map((n) => mark(named(n))), ...between.map((n) => mark(named(n))),
    ...sensors.map((s) => [s, at(s.line ?? 0, s.position_m)]).sort((a, b) => a[1][0] - b[1][0]).map(foot)];
  return [under, over];
}
