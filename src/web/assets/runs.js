// The runs of the place: a table to sort and search, runs fitted together, and files that are dropped on the page.

import { post } from "/assets/api.js";
import { at, digits, h, put, svg } from "/assets/dom.js";
import { app, act, complain } from "/assets/store.js";

let order = { key: "when", down: true };
let chosen = new Set();

const COLUMNS = [
  ["name", "run", (r) => r.name], ["when", "recorded", (r) => r.when || ""], ["rig", "rig", (r) => r.rig || ""],
  ["temperature_degC", "°C", (r) => r.temperature_degC], ["flow_m3_s", "flow, L/s", (r) => (r.flow_m3_s === null ? null : 1000 * r.flow_m3_s)],
  ["error", "error × noise", (r) => (r.rmse_m === null || !r.noise_m ? null : r.rmse_m / r.noise_m)], ["verdict", "verdict", (r) => words(r)],
];
const words = (r) => (r.effect ? `missing: ${r.effect}` : (r.verdict || "").replace("-", " "));

function spark(heads) {
  if (heads.length < 2) return null;
  const [low, high] = [Math.min(...heads), Math.max(...heads)];
  const points = heads.map((v, i) => `${((80 * i) / (heads.length - 1)).toFixed(1)},${(19 - (18 * (v - low)) / (high - low || 1)).toFixed(1)}`);
  return svg("svg", { viewBox: "0 0 80 20", class: "spark", "aria-hidden": "true" }, svg("polyline", { points: points.join(" ") }));
}

function cell(column, run) {
  const [key, , of] = column;
  const value = of(run);
  if (key === "name") return h("td", {}, h("button", { type: "button", class: "link", text: run.name, onclick: () => open([run.id]) }), run.open ? " (open)" : "");
  if (key === "when") return h("td", { text: value ? new Date(value).toLocaleString() : "" });
  return typeof value === "number" ? h("td", { class: "number", text: digits(value, 3) }) : h("td", { text: value ?? "" });
}

async function open(ids) {
  if (await act("/api/open", { runs: ids })) at("runs").close();
}

export function runs() {
  const dialog = at("runs");
  const search = h("input", { type: "search", placeholder: "filter", "aria-label": "Filter runs", oninput: () => fill() });
  const body = h("tbody");
  const several = h("button", { type: "button", text: "Open together", disabled: true, onclick: () => open([...chosen]) });
  const file = h("input", { type: "file", accept: ".csv,.txt,.tsv,.tdms,.mcap,.xlsx,.ods", onchange: () => file.files[0] && dropped(file.files[0]) });
  const sort = (key) => { order = { key, down: order.key === key ? !order.down : false }; fill(); };
  const fill = () => {
    const wanted = search.value.toLowerCase();
    const of = COLUMNS.find(([key]) => key === order.key)[2];
    const sorted = app.state.runs.filter((r) => `${r.name} ${r.rig || ""} ${words(r)}`.toLowerCase().includes(wanted)).sort((a, b) => {
      const [x, y] = [of(a), of(b)];
      const way = x === y ? 0 : x === null || (y !== null && x < y) ? -1 : 1;
      return order.down ? -way : way;
    });
    put(body, sorted.map((run) => {
      const box = h("input", { type: "checkbox", checked: chosen.has(run.id), "aria-label": `Choose ${run.name}`, onchange: () => { if (box.checked) chosen.add(run.id); else chosen.delete(run.id); several.disabled = chosen.size < 2; } });
      return h("tr", { class: run.open ? "open" : "" }, h("td", {}, box), COLUMNS.map((c) => cell(c, run)), h("td", {}, spark(run.spark)));
    }));
  };
  chosen = new Set();
  const heading = ([key, label]) => h("th", { scope: "col", "aria-sort": order.key === key ? (order.down ? "descending" : "ascending") : null }, h("button", { type: "button", class: "link", text: label, onclick: () => sort(key) }));
  put(dialog, h("form", { method: "dialog", class: "heading" }, h("h2", { text: `Runs · ${app.state.place}` }), search, several, h("button", { text: "Close" })),
    h("p", {}, h("label", {}, "Import a file of a logger (or drop it on the page): ", file)), h("div", { id: "import" }),
    h("div", { class: "list" }, h("table", {}, h("thead", {}, h("tr", {}, h("th"), COLUMNS.map(heading), h("th"))), body)));
  fill();
  dialog.showModal();
}

const base64 = (file) => new Promise((resolve, reject) => {
  const reader = new FileReader();
  reader.onload = () => resolve(reader.result.slice(reader.result.indexOf(",") + 1));
  reader.onerror = () => reject(new Error(`${file.name} cannot be read`));
  reader.readAsDataURL(file);
});

// A file is looked at first; it is written once a person agrees.
export async function dropped(file) {
  if (!at("runs").open) runs();
  const box = at("import");
  put(box, h("p", { text: `Reading ${file.name}…` }));
  let content;
  try { content = await base64(file); } catch (error) { complain(error); return; }
  const look = async (map, without, accept) => {
    try {
      const found = await post("/api/import", { name: file.name, content, map, without, accept });
      if (accept) { at("runs").close(); return; }
      show(found);
    } catch (error) { put(box, h("p", { class: "advice", text: error.message }), mapping(map, without)); }
  };
  const mapping = (map, without) => {
    const text = h("input", { type: "text", placeholder: "column=sensor, column=sensor", value: map.map((pair) => pair.join("=")).join(", "), "aria-label": "Columns and their sensors" });
    const gone = h("input", { type: "text", placeholder: "sensors that were not recorded", value: without.join(", "), "aria-label": "Sensors that were not recorded" });
    const list = (field) => field.value.split(",").map((part) => part.trim()).filter(Boolean);
    const said = () => [list(text).map((pair) => pair.split("=").map((part) => part.trim())).filter((pair) => pair.length === 2), list(gone)];
    return h("p", {}, text, " ", gone, " ", h("button", { type: "button", text: "Look again", onclick: () => look(...said(), false) }), " ", h("button", { type: "button", class: "primary", text: "Import so", onclick: () => look(...said(), true) }));
  };
  const show = (found) => {
    const sensors = found.understood.sensors.map((s) => h("tr", {}, h("th", { scope: "row", text: s.sensor }), h("td", { text: s.column ?? "not recorded" }), h("td", { text: s.unit }), h("td", { class: "number", text: s.samples }), h("td", { text: s.first.map((v) => digits(v, 4)).join("  ") })));
    const map = found.understood.sensors.filter((s) => s.column && s.column !== s.sensor).map((s) => [s.column, s.sensor]);
    const notes = [...found.mended.map((m) => m.text), ...found.warnings.map((w) => w.text), ...found.sensor_faults.map((f) => f.says)];
    put(box, h("h3", { text: `${file.name}, as understood` }), h("table", {}, h("thead", {}, h("tr", {}, ["sensor", "column", "unit", "samples", "first values"].map((text) => h("th", { scope: "col", text })))), h("tbody", {}, sensors)),
      h("ul", {}, notes.map((text) => h("li", { text }))), mapping(map, found.understood.sensors.filter((s) => !s.column).map((s) => s.sensor)));
  };
  await look([], [], false);
}
