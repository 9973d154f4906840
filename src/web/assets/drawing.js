// A pipe from its supply to its valve, to scale, with its sensors: as it stands, or as far as it is known.

import { digits, svg } from "/assets/dom.js";

export const AXIS = 52;

// `frame` says from where to where the pipe is drawn, and how wide a letter is. What lies below other marks, and what lies above them.
export function line({ length, pipes, supply, sensors }, { from, to, letter }) {
  const x = (m) => from + ((to - from) * m) / length;
  const widest = Math.max(...pipes.map((p) => p.inner_diameter_m));
  let last = -1e9;
  const foot = (s) => {
    // names that would touch stand one above the other
    const text = `${s.name} ${+s.position_m.toPrecision(4)} m${s.assumed ? "?" : ""}`;
    const [place, wide] = [x(s.position_m), letter * text.length];
    const anchor = place > to - 30 ? "end" : place < from + wide / 2 ? "start" : "middle";
    const left = place - { start: 0, middle: wide / 2, end: wide }[anchor];
    const raised = left < last;
    last = raised ? -1e9 : left + wide;
    return svg("g", {}, svg("circle", { cx: place, cy: AXIS, r: 5, class: s.assumed ? "sensor assumed" : "sensor" }), svg("text", { x: anchor === "start" ? place + 4 : place, y: raised ? 16 : 32, "text-anchor": anchor, text }));
  };
  const under = [supply === "pump" ? svg("circle", { cx: from - 14, cy: AXIS, r: 14, class: "supply" }) : svg("rect", { x: from - 30, y: AXIS - 34, width: 30, height: 44, class: "supply" }),
    svg("text", { x: from - 15, y: AXIS + 26, "text-anchor": "middle", text: supply === "pump" ? "pump" : "supply" }),
    ...pipes.map((p) => svg("line", { x1: x(p.from_m), x2: x(p.to_m), y1: AXIS, y2: AXIS, class: "pipe", "stroke-width": Math.max(3, (9 * p.inner_diameter_m) / widest) }, svg("title", { text: `${p.name}: ${digits(p.to_m - p.from_m, 4)} m, ${digits(1000 * p.inner_diameter_m, 4)} mm` })))];
  const over = [svg("path", { d: `M${to} ${AXIS - 9} l20 18 v-18 l-20 18 z`, class: "valve" }), svg("text", { x: to + 10, y: AXIS + 26, "text-anchor": "middle", text: "valve" }),
    ...[...sensors].sort((a, b) => a.position_m - b.position_m).map(foot)];
  return [under, over];
}
