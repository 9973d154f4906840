// Several runs beside a reference: curves aligned at the closure, their differences, and a table.

import { compared } from "/assets/api.js";
import { at, digits, h, metres, put, times, uncertain, withUnit } from "/assets/dom.js";
import { act, complain } from "/assets/store.js";

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const COLOURS = 6;
const stroke = (i) => (i === 0 ? "--measured" : `--run${(i - 1) % COLOURS}`);
const dash = (i) => [null, [7, 4], [2, 3]][Math.floor((i - 1) / COLOURS) % 3];

let shown = null;

export async function compare(ids) {
  shown?.plots.forEach((plot) => plot.destroy());
  shown = { ids, range: null, plots: [] };
  const dialog = at("compare");
  const part = (text, range) => h("button", { type: "button", text, onclick: () => { shown.range = range(); load(); } });
  const period = () => shown.found.runs[0].measured.find((q) => q.label === "period")?.value;
  put(dialog, h("form", { method: "dialog", class: "heading" }, h("h2", { text: "Runs, aligned at the start of the closure" }),
    h("div", { class: "choice", role: "group", "aria-label": "Part of the record" },
      part("first rise", () => period() && [-0.03 * period(), 0.3 * period()]), part("cycle", () => period() && [-0.05 * period(), 1.05 * period()]), part("all", () => null)),
    h("button", { text: "Close" })), h("div", { id: "compared" }, h("p", { text: "Reading the runs…" })));
  if (!dialog.open) dialog.showModal();
  await load();
}

async function load() {
  const mine = shown;
  const width = Math.max(280, at("compared").clientWidth - 26);
  try {
    const found = await compared(mine.ids, mine.range, Math.round(2 * width));
    if (mine !== shown) return;
    const first = !mine.found;
    mine.found = found;
    mine.rigs = new Set(found.runs.map((run) => run.rig));
    if (first) build(width);
    fill();
  } catch (error) { put(at("compared"), h("p", { class: "advice", text: error.message })); complain(error); }
}

function build(width) {
  const { found } = shown;
  const axis = { stroke: () => colour("--text-2"), grid: { stroke: () => colour("--line"), width: 1 }, ticks: { show: false } };
  const value = (_, v) => (v === null || v === undefined ? "–" : digits(v, 5));
  const series = found.runs.map((run, i) => ({ label: run.name, stroke: () => colour(stroke(i)), width: i ? 1.2 : 1.6, dash: dash(i), value, points: { show: false } }));
  const setSelect = (u) => {
    if (u.select.width < 4) return;
    shown.range = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    load();
  };
  const options = (differs) => ({
    width, height: differs ? 110 : 220, pxAlign: false, padding: [8, 24, 0, 0], legend: { show: !differs, live: true },
    cursor: { sync: { key: "runs", setSeries: false }, drag: { x: true, y: false, setScale: false }, bind: { dblclick: () => () => { shown.range = null; load(); return null; } } },
    scales: { x: { time: false, range: (u, low, high) => shown.range || [low, high] } },
    axes: [{ ...axis, show: differs, size: 30, values: (_, s) => s.map((v) => `${+v.toFixed(4)} s`) }, { ...axis, size: 60, space: differs ? 30 : 40 }],
    series: [{ label: "\u00a0", value: (_, v) => (v === null || v === undefined ? "" : `at ${digits(v, 5)} s`) }, ...series.map((s, i) => ({ ...s, show: !(differs && i === 0) }))], hooks: { setSelect: [setSelect] },
  });
  const cards = found.sensors.map((sensor) => {
    const box = h("div", { class: "plot" });
    return { box, card: h("div", { class: "card chart" }, h("h3", {}, h("b", { text: sensor.name }), ` ${digits(sensor.position_m, 4)} m in ${found.runs[0].name}, head in m; below: difference to ${found.runs[0].name}`), box) };
  });
  const { rigs } = shown;
  const differ = rigs.size > 1 ? h("p", { class: "advice", text: `These runs are of different rigs (${[...rigs].join(", ")}). Sensors of one name may stand at different places; a run without a sensor of that name is not in its chart.` }) : null;
  put(at("compared"), differ, cards.map((c) => c.card), h("div", { id: "compared-table", class: "list" }));
  shown.plots = cards.flatMap((c) => [false, true].map((differs) => new uPlot(options(differs), [[], ...found.runs.map(() => [])], c.box)));
}

function fill() {
  const { found, plots, ids } = shown;
  found.sensors.forEach((_, s) => {
    const of = (name) => found.column[`${s}/${name}`];
    const heads = ids.map((id) => of(`${id}_m`));
    const less = (own) => own.map((v, i) => (v === null || heads[0][i] === null ? null : v - heads[0][i]));
    plots[2 * s].setData([of("time_s"), ...heads]);
    plots[2 * s + 1].setData([of("time_s"), ...heads.map(less)]);
  });
  table();
}

function table() {
  const { found, rigs } = shown;
  const [reference, ...others] = found.runs;
  const swatch = (i) => h("i", { class: "swatch", "aria-hidden": "true", style: { background: `var(${stroke(i)})` } });
  const difference = (a, b, n = 2) => (typeof a === "number" && typeof b === "number" ? `${a > b ? "+" : ""}${digits(a - b, n)}` : "");
  const pair = (own, of) => [h("td", { class: "number", text: own ? of(own) : "–" })];
  const cells = (values, of, difference_of) => values.flatMap((v, i) => [...pair(v, of), ...(i ? [h("td", { class: "number difference", text: difference_of(v, values[0]) })] : [])]);
  const line = (label, values, of, difference_of = () => "") => h("tr", {}, h("th", { scope: "row", text: label }), cells(values, of, difference_of));
  const q = (v) => (v?.value === null ? "–" : v.standard_error > 0 ? uncertain(v.value, v.standard_error) : digits(v.value, 4));
  const delta = (a, b) => difference(a?.value, b?.value);
  const measured = reference.measured.map((own, i) => line(own.unit === "1" ? own.label : `${own.label}, ${own.unit}`, found.runs.map((r) => r.measured.find((m) => m.label === own.label) ?? r.measured[i]), q, delta));
  const apart = found.sensors.map((sensor) => line(`difference at ${sensor.name}, rms`, found.runs.map((r, i) => (i ? r.differences_m[sensor.name] : null)), (v) => (v === null ? "–" : `${metres(v)} (${times(v, sensor.noise_m)})`)));
  const names = [...new Set(found.runs.flatMap((r) => r.parameters.map((p) => p.name)))];
  const parameters = names.map((name) => line(withUnit(name), found.runs.map((r) => r.parameters.find((p) => p.name === name)), q, delta));
  const section = (text) => h("tr", { class: "section" }, h("th", { scope: "rowgroup", colspan: 2 * found.runs.length, text }));
  put(at("compared-table"), h("table", {},
    h("thead", {}, h("tr", {}, h("th"), found.runs.flatMap((r, i) => [h("th", { scope: "col", class: "number" }, swatch(i), r.name, i ? "" : " (reference)"), ...(i ? [h("th", { scope: "col", class: "number", text: "difference" })] : [])]))),
    h("tbody", {}, section("Measured"), measured, apart, section("Model"),
      line("effects", found.runs.map((r) => r.model), (v) => v.join(", ") || "base model"),
      line("error × noise", found.runs.map((r) => (r.rmse_m ? r.rmse_m / r.noise_m : null)), (v) => digits(v, 3)), parameters)),
    names.length ? null : h("p", { class: "hint", text: "These runs have no models yet: open one, or let `surgescope watch` fit the folder." }),
    h("p", { class: "buttons" }, others.length && rigs.size < 2 ? h("button", { type: "button", text: "Fit one model to all of them", onclick: async () => { if (await act("/api/open", { runs: shown.ids })) { at("compare").close(); at("runs").close(); } } }) : null));
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => shown?.plots.forEach((plot) => {
  plot.redraw(false, true);
  plot.root.querySelectorAll(".u-series .u-marker").forEach((mark, i, all) => mark.style.setProperty("border-color", colour(stroke(i - (all.length - shown.ids.length)))));
}));
