// Two marks on the time axis of all charts, and what lies between them: the time, and the heads of measurement and model. A click sets the
// first, then the second; until then the cursor takes its place. A third click begins anew.

import { digits } from "/assets/dom.js";

// s after the start of the closure, in the order in which they were set.
let set = [];
let redraw = () => {};
export const whenMarked = (work) => { redraw = work; };

function put(times) {
  set = times;
  redraw();
}

export const marks = {
  clear: () => set.length && put([]),
  any: () => set.length > 0,
  add: (t) => put(set.length === 1 ? [set[0], t] : [t]),
  // Moves the last one.
  shift: (by) => set.length && put([...set.slice(0, -1), set.at(-1) + by]),
  draw: (u, stroke) => {
    u.ctx.strokeStyle = stroke;
    u.ctx.lineWidth = devicePixelRatio;
    for (const t of set) {
      const x = Math.round(u.valToPos(t, "x", true)) + 0.5;
      if (x < u.bbox.left || x > u.bbox.left + u.bbox.width) continue;
      u.ctx.beginPath();
      u.ctx.moveTo(x, u.bbox.top);
      u.ctx.lineTo(x, u.bbox.top + u.bbox.height);
      u.ctx.stroke();
    }
  },
};

// A curve at a time, on the straight line between its points; none beyond them.
export function valueAt(time, values, t) {
  if (!(t >= time[0] && t <= time.at(-1))) return null;
  let [low, high] = [0, time.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time[middle] <= t) low = middle; else high = middle;
  }
  const [a, b] = [values[low], values[high]];
  if (typeof a !== "number" || typeof b !== "number") return null;
  return time[high] === time[low] ? a : a + ((b - a) * (t - time[low])) / (time[high] - time[low]);
}

const signed = (v, symbol) => `${v > 0 ? "+" : ""}${digits(v, 3)} ${symbol}`;

// What lies between the marks, or the mark and a cursor, in words; `curves` are names with values in the unit of the chart.
export function reading(time, curves, cursor, symbol) {
  const [from, to = cursor] = set;
  if (from === undefined || to === null || to === undefined) return "";
  const change = ([name, values]) => {
    const [a, b] = [valueAt(time, values, from), valueAt(time, values, to)];
    return a === null || b === null ? null : `${name} ${signed(b - a, symbol)}`;
  };
  return [`Δt ${signed(to - from, "s")}`, ...curves.map(change).filter(Boolean)].join(" · ");
}

// Clicks of a plot set marks; a drag zooms and sets none.
export function clicks(plot) {
  let down = null;
  plot.over.addEventListener("mousedown", (event) => { down = [event.clientX, event.clientY]; });
  plot.over.addEventListener("click", (event) => {
    if (!down || event.detail > 1 || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 3) return;
    marks.add(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
  });
}

