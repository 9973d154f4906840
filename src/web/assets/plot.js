// One plot of a chart: its series, scales and labels; of the curves, or of model − measured.

import { digits } from "/assets/dom.js";
import { app } from "/assets/store.js";
import { AXIS_PX, hasAxis, heights, widthOf } from "/assets/heights.js";
import { clicks, marks } from "/assets/marks.js";
import { fingers } from "/assets/touch.js";

// asked for many times a frame
export const colours = new Map();
export function colour(name) {
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(name).trim());
  return colours.get(name);
}

// A residual near the noise fills its plot with steep lines: hairlines are drawn five times as fast as wider ones.
const HAIR = 1;
// In the order of drawing: the measurement over what was before and under the models, dark and wide, so that it shows where they cover it.
const SERIES = [
  { key: "ghost", label: "before", stroke: () => colour("--ghost"), width: 1 },
  { key: "measured", label: "measured", stroke: () => colour("--measured"), width: 3 },
  { key: "model", label: "model", stroke: () => colour("--model"), width: 1.5 },
  { key: "trial", label: "proposed", stroke: () => colour("--proposed"), width: 1.5, dash: [6, 4] },
];

export function shown(panel, heads) {
  const unit = app.unit === "own" ? panel.sensor.unit : null;
  return unit ? heads.map((v) => (v === null ? null : v * unit.per_m + unit.zero)) : heads;
}
export const symbol = (panel) => (app.unit === "own" && panel.sensor.unit ? panel.sensor.unit.symbol : "m");
export const perM = (panel) => (app.unit === "own" && panel.sensor.unit ? panel.sensor.unit.per_m : 1);
export const ghostly = () => (app.compare ? `model ${app.compare}` : "before");
function below(panel) {
  if (panel.data.adds && app.preview) return `model − measured; dashed: the part that ${app.preview} explains`;
  return panel.leaves ? `model − measured; ${ghostly()} is off this scale` : "model − measured";
}
export const what = (panel, residual) => `${residual ? below(panel) : symbol(panel) === "m" ? "head" : "pressure"}, ${symbol(panel)}`;

// What a plot shows, above it.
const LABEL_PX = 13;
function label(u, text) {
  u.ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  u.ctx.textAlign = "right";
  u.ctx.fillStyle = colour("--text-2");
  u.ctx.fillText(text, u.bbox.left + u.bbox.width - 4 * devicePixelRatio, u.bbox.top - 3 * devicePixelRatio);
}

// Zero and a round number on either side of it.
function around0(most) {
  const size = 10 ** Math.floor(Math.log10(most));
  const round = [5, 2, 1].find((n) => n * size <= most) * size;
  return [-round, 0, round];
}

function limits(panel, residual, low, high) {
  const noise = 2.5 * panel.sensor.noise_m * perM(panel);
  if (low === null || high === null) return [-noise, noise];
  if (residual) {
    const own = panel.fills().flat().filter((v) => typeof v === "number");
    if (own.length) [low, high] = [Math.min(...own), Math.max(...own)];
  }
  if (!residual) return [low - 0.05 * (high - low || 1), high + 0.05 * (high - low || 1)];
  const most = Math.max(Math.abs(low), Math.abs(high), noise);
  return [-1.05 * most, 1.05 * most];
}

// The options of uPlot. `span` is what all charts show, `zoom` changes it.
function options(panel, residual, { span, zoom }, series) {
  const axis = { stroke: () => colour("--text-2"), grid: { stroke: () => colour("--line"), width: 1 }, ticks: { show: false } };
  const hooks = {
    drawClear: [(u) => {
      if (!residual) return;
      const noise = 2 * panel.sensor.noise_m * perM(panel);
      const [top, bottom] = [u.valToPos(noise, "y", true), u.valToPos(-noise, "y", true)];
      u.ctx.fillStyle = colour("--band");
      u.ctx.fillRect(u.bbox.left, Math.max(top, u.bbox.top), u.bbox.width, Math.min(bottom, u.bbox.top + u.bbox.height) - Math.max(top, u.bbox.top));
    }],
    draw: [(u) => {
      marks.draw(u, colour("--strong"));
      label(u, what(panel, residual));
    }],
    setCursor: [() => residual || panel.read()],
    setSelect: [(u) => {
      if (u.select.width < 4) return;
      zoom([u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")]);
      u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    }],
  };
  const value = (_, v) => (v === null || v === undefined ? "" : digits(v, 5));
  // while something is dragged the scale stands still, and the curve alone moves
  const range = (u, low, high) => (app.drags && u.scales.y.min !== null && u.scales.y.min !== undefined ? [u.scales.y.min, u.scales.y.max] : limits(panel, residual, low, high));
  const times = (_, s) => (residual && hasAxis(panel) ? s.map((v) => `${+v.toFixed(4)} s`) : s.map(() => ""));
  return {
    height: heights(panel)[Number(residual)], pxAlign: false, padding: [LABEL_PX, 24, 2, 0], legend: { show: !residual, live: true, mount: (_, legend) => panel.legend.replaceChildren(legend) },
    cursor: { sync: { key: "surge", setSeries: false }, drag: { x: true, y: false, setScale: false }, bind: { dblclick: () => () => { marks.clear(); zoom(null); return null; } } },
    scales: { x: { time: false, range: () => span() }, y: { range } },
    axes: [{ ...axis, size: () => (residual && hasAxis(panel) ? AXIS_PX : 0), gap: 3, values: times }, { ...axis, size: 60, space: residual ? 16 : 26, ...(residual ? { splits: (_, __, low, high) => around0(high) } : {}) }],
    series: [{ label: "\u00a0", value: (_, v) => (v === null || v === undefined ? "" : `at ${digits(v, 5)} s`) }, ...series.map((s) => ({ value, points: { show: false }, spanGaps: false, ...s, ...(residual && { width: HAIR }) }))],
    hooks,
  };
}

// Data without the parts of the curves that are tried which lie beyond a scale that stands still: a dashed line that runs far outside costs a
// hundred times what is seen of it. `tried` are their places.
export function onScales(data, plots, tried) {
  if (!app.drags || !plots.length) return data;
  return data.map((of_plot, i) => {
    const { min, max } = plots[i].scales.y;
    const [low, high] = [min - (max - min), max + (max - min)];
    const beyond = (v) => v === undefined || v === null || v < min || v > max;
    const cut = (v, n, all) => (typeof v !== "number" || (beyond(v) && beyond(all[n - 1]) && beyond(all[n + 1])) ? null : Math.min(high, Math.max(low, v)));
    return of_plot.map((values, n) => (tried(n) ? values.map(cut) : values));
  });
}

// The two plots of a chart, in its box.
export function plots(panel, axis, series = SERIES) {
  const { span, zoom } = axis;
  return [false, true].map((residual, i) => {
    const plot = new uPlot({ width: widthOf(), ...options(panel, residual, axis, series) }, panel.drawn[i], panel.box);
    clicks(plot);
    fingers(plot.over, span, (range) => (app.range || range[1] - range[0] < 0.98 * (span()[1] - span()[0])) && zoom(range));
    return plot;
  });
}
