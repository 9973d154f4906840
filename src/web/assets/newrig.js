// A rig made from a table: what was understood of it, the questions that it leaves open, and a drawing that follows.

import { post } from "/assets/api.js";
import { at, digits, h, put, svg } from "/assets/dom.js";
import { app, complain, refresh } from "/assets/store.js";
import { AXIS, draw as drawn_rig, inSeries } from "/assets/drawing.js";
import { spark } from "/assets/runs.js";

const KINDS = [["pressure", "pressure"], ["flow", "flow"], ["temperature", "temperature"], ["valve-position", "valve position"], ["trigger", "trigger"], ["none", "no sensor"]];
const QUANTITY = { pressure: "pressure", flow: "flow", temperature: "temperature", "valve-position": "ratio", trigger: "ratio" };
// What is asked of the pipe: field, label, what an answer looks like, choices of a list.
const PIPE = [
  ["material", "Material of the wall", "copper", "new-rig-materials"],
  ["length", "Length from the supply to the valve, m", "100"],
  ["size", "Size of the pipe", "22x1.5 or DN50"],
  ["inner_diameter", "or its inner diameter, mm", "19"],
  ["wall", "and thickness of the wall, mm", "1.5"],
  ["temperature", "Temperature of the water, °C", "20"],
  ["supply", "What feeds the pipe", null, [["", "not known"], ["reservoir", "a reservoir or a tank"], ["pump", "a pump"]]],
  ["closing_time", "Closing time of the valve, s", "0.1"],
  ["discharge_head", "Head behind the valve, m", "0"],
  ["flow", "Flow before the closure, measured by hand", "0.25 L/s"],
  ["name", "Name of the rig", ""],
];
// What is asked of a table's text and times, by both forms about one.
export const READING = [
  ["rate", "samples per second", "1000"],
  ["time_unit", "unit of the times", null, [["", "choose"], ["s", "s"], ["ms", "ms"], ["us", "µs"], ["ns", "ns"], ["min", "min"], ["h", "h"], ["d", "days"]]],
  ["date_order", "day or month first", null, [["", "choose"], ["dmy", "day first"], ["mdy", "month first"]]],
  ["zone", "time zone", "+01:00"],
  ["message_time", "time of a message", null, [["", "choose"], ["log", "when it was logged"], ["publish", "when it was published"]]],
  ["time_field", "field of a message with its time", "header.stamp"],
  ["encoding", "code page", "cp1250"],
];
const LATER_MS = 250;
// A longer reason is not said twice.
const SHORT = 160;
const plain = (value) => String(+value.toPrecision(4)).replace("-", "−");
const MAKE = "Make the rig and import the table";
const phone = matchMedia("(max-width: 700px)");
const frame = () => (phone.matches ? { from: 42, to: 440, letter: 8, width: 484 } : { from: 60, to: 930, letter: 7, width: 1000 });

// The table that the form is about; none where there is no form.
let table = null;
// What is written; of columns by their names.
let answers = {};
// What the workbench made of it last, and the field of each name.
let found = null;
const fields = new Map();
let [running, again, waits, writing] = [null, false, null, false];

const kept = () => `new rig ${table}`;
const further = () => answers.further || [];
const together = () => [table, ...further()].join(" and ");
const columnsSaid = () => Object.entries(answers.columns || {}).map(([column, said]) => ({ column, ...said }));
const form = () => ({ ...answers, further: undefined, columns: columnsSaid() });

// Beside a field: what is wrong with it, what is missing, what is taken where the person writes nothing.
function field(key, label, input) {
  const remark = h("p", { class: "remark", id: `remark-${key}`, hidden: true });
  input.setAttribute("aria-describedby", remark.id);
  input.dataset.key = key;
  fields.set(key, { input, remark });
  return h("div", { class: "field" }, h("label", {}, h("span", { text: label }), input), remark);
}

export function entry(value, example, choices, changed) {
  if (Array.isArray(choices)) {
    const list = h("select", { onchange: () => changed(list.value) }, choices.map(([name, text]) => h("option", { value: name, text })));
    list.value = value;
    return list;
  }
  const text = h("input", { type: "text", value, placeholder: example ? `such as ${example}` : "", list: choices, autocomplete: "off", spellcheck: "false", oninput: () => changed(text.value) });
  return text;
}

function say(key, value) {
  answers[key] = value;
  later();
}

function sayOfReading(key, value) {
  answers.reading = { ...answers.reading, [key]: value };
  later();
}

function sayOf(column, key, value) {
  answers.columns ||= {};
  answers.columns[column] = { ...answers.columns[column], [key]: value };
  later();
}

function later() {
  sessionStorage.setItem(kept(), JSON.stringify(answers));
  clearTimeout(waits);
  waits = setTimeout(() => look().catch(complain), LATER_MS);
}

// One question at a time, the last of them always: a long table takes a while.
function look() {
  clearTimeout(waits);
  again = true;
  running ||= looked().finally(() => { running = null; });
  return running;
}

async function looked() {
  while (again && table) {
    again = false;
    const of = table;
    const about = await post("/api/new-rig", { table, further: further(), form: form() });
    if (table !== of) continue;
    const same = found && found.columns.map((c) => c.name).join("\n") === about.columns.map((c) => c.name).join("\n") && String(found.further) === String(about.further);
    found = about;
    if (!same) build();
    show();
  }
}

const places = ["pressure", "flow"];

// When a column was sampled; said once where it holds for all.
const sampled = (column) => `${column.samples} samples${column.rate_hz ? `, ${plain(column.rate_hz)} a second` : ""}, from ${plain(column.from_s ?? 0)} to ${plain(column.to_s ?? 0)} s`;
const alike = () => new Set(found.columns.map(sampled)).size === 1;

function row(column, i) {
  const said = answers.columns?.[column.name] || {};
  const cell = (key, label, input) => h("td", {}, field(`columns.${i}.${key}`, label, input));
  const is = entry(said.is ?? "", null, [["", "choose"], ...KINDS], (value) => sayOf(column.name, "is", value));
  const unit = entry(said.unit ?? "", null, `new-rig-units-${i}`, (value) => sayOf(column.name, "unit", value));
  const place = entry(said.place ?? "", null, null, (value) => sayOf(column.name, "place", value));
  return h("tr", {}, h("th", { scope: "row" }, h("div", { class: "called" }, h("span", { text: column.short || column.name }), spark(column.spark)), h("p", { class: "hint sampled" }), h("p", { class: "hint values-seen", text: `${column.first.map((v) => digits(v, 4)).join("  ")} …` })),
    cell("is", `What ${column.name} is`, is), cell("unit", `Unit of ${column.name}, or its ranges where it is in V or mA`, unit), cell("place", `Distance of ${column.name} from the supply, m`, place), h("datalist", { id: `new-rig-units-${i}` }));
}

// Other tables that lie beside it, or were dropped with it: whether they are of the same closure only a person knows.
function others() {
  if (!found.beside.length) return null;
  const one = (name) => {
    const box = h("input", { type: "checkbox", checked: further().includes(name), "data-key": `with ${name}`, onchange: () => {
      say("further", box.checked ? [...further(), name] : further().filter((own) => own !== name));
    } });
    return h("label", {}, box, ` ${name}`);
  };
  return h("fieldset", { class: "others", "data-key": "further" }, h("legend", { text: found.beside.length > 1 ? "Other tables are here. Tick those of the same closure, and they are joined:" : "Another table is here. Tick it if it is of the same closure, and they are joined:" }), found.beside.map(one));
}

function build() {
  fields.clear();
  const box = at("new-rig");
  const of = ([key, label, example, choices]) => field(key, label, entry(answers[key] ?? "", example, choices, (value) => say(key, value)));
  const ofReading = ([key, label, example, choices]) => field(key, label, entry(answers.reading?.[key] ?? "", example, choices, (value) => sayOfReading(key, value)));
  put(box, h("form", { onsubmit: (event) => { event.preventDefault(); make(); } },
    h("div", { class: "heading" }, h("h2", { id: "new-rig-title" }), h("p", { class: "hint", text: "Answer what the table cannot say. Nothing is written before you press the button." }),
      app.state.open || app.state.tables.length > 1 || !app.state.tables.includes(table) ? h("button", { type: "button", text: "Back", onclick: () => leave() }) : null),
    h("div", { class: "card drawing" }, h("div", { id: "new-rig-drawing" }), h("p", { class: "hint", id: "new-rig-pipe" })),
    h("div", { class: "sides" },
      h("section", { class: "card", "aria-label": "The table" }, h("h3", { text: "The table, as it is understood" }), others(), h("p", { class: "remark", id: "remark-further", hidden: true }),
        h("p", { class: "remark", id: "remark-file", role: "status", hidden: true }), h("p", { class: "remark", id: "remark-columns", hidden: true }),
        h("div", { class: "times" }, READING.map(ofReading)),
        found.columns.length ? h("table", {}, h("thead", {}, h("tr", {}, ["column", "is", "unit, or ranges from V or mA", "m from the supply"].map((text) => h("th", { scope: "col", text })))), h("tbody", {}, found.columns.map(row))) : null,
        h("ul", { id: "new-rig-understood" })),
      h("section", { class: "card", "aria-label": "The pipe" }, h("h3", { text: "The pipe" }), h("datalist", { id: "new-rig-materials" }, found.materials.map((name) => h("option", { value: name }))), PIPE.map(of), h("p", { class: "remark", id: "remark-rig", hidden: true }))),
    h("div", { class: "foot" }, h("div", { id: "new-rig-says", role: "status" }), h("button", { class: "primary", text: MAKE }))));
  for (const key of ["file", "further", "columns", "rig"]) fields.set(key, { remark: at(`remark-${key}`) });
}

// What is wrong goes before what is missing, and that before what is taken.
const WEIGHTS = ["assumed", "open", "wrong"];
const heaviest = (remarks) => remarks.reduce((a, b) => (WEIGHTS.indexOf(b.weight) > WEIGHTS.indexOf(a.weight) ? b : a));

// A field by its name in a sentence.
const OF_ALL = { file: "the table", further: "the tables together", columns: "what the columns are", rig: "the rig" };
const OF_COLUMN = { is: "what it is, of", unit: "the unit of", place: "the place of" };
function called(key) {
  const [, i, what] = /^columns\.(\d+)\.(.*)$/.exec(key) || [];
  if (what) return `${OF_COLUMN[what]} ${found.columns[i].short || found.columns[i].name}`;
  const [, label] = [...PIPE, ...READING].find(([own]) => own === key) || [];
  const short = label?.replace(/^(or its|and) /, "").split(/,| from /)[0];
  return OF_ALL[key] || (short ? short[0].toLowerCase() + short.slice(1) : key);
}

// Where to mend it: no column is a pressure: the remark is about all columns, and the first is where to begin.
function go(key) {
  const own = fields.get(key)?.input || document.querySelector(`#new-rig [data-key="${key}"] input`) || [...fields].find(([, { input }]) => key === "columns" && input?.dataset.key.endsWith(".is"))?.[1].input;
  own?.focus();
  return Boolean(own);
}

// What stands against the rig, each by its name; what cannot be taken also with the reason.
function against(wanting) {
  const of = (weight) => [...new Map(wanting.filter((remark) => remark.weight === weight).map((remark) => [remark.field, remark])).values()];
  const link = ({ field }) => h("button", { type: "button", class: "link", text: called(field), onclick: () => go(field) });
  const open = of("open").filter(({ field }, _, all) => field !== "file" || all.length === 1);
  return [
    ...of("wrong").map((remark) => h("p", { class: "wrong" }, "Cannot be taken: ", link(remark), remark.says.length > SHORT ? ": the reason stands beside it" : `: ${remark.says}`)),
    open.length ? h("p", {}, "Missing: ", open.flatMap((remark, i) => (i ? [", ", link(remark)] : [link(remark)]))) : null,
  ];
}

function show() {
  at("new-rig-title").textContent = `A rig for ${together()}`;
  const remarks = new Map();
  found.remarks.forEach((remark) => remarks.set(remark.field, [...(remarks.get(remark.field) || []), remark]));
  // where a sensor stands is looked for once its unit is known
  const unitOpen = found.remarks.some(({ field, weight }) => field.endsWith(".unit") && weight !== "assumed");
  for (const [key, { input, remark }] of fields) {
    const heard = remarks.has(key) ? heaviest(remarks.get(key)) : null;
    const said = unitOpen && key.endsWith(".place") && heard?.weight === "assumed" ? null : heard;
    remark.hidden = !said;
    remark.className = `remark ${said?.weight || ""}`;
    remark.textContent = said?.says || "";
    if (!input) continue;
    input.setAttribute("aria-invalid", String(said?.weight === "wrong"));
    input.closest(".field").dataset.weight = said?.weight || "";
  }
  // a question that neither the table nor a person has raised is none
  READING.forEach(([key]) => { fields.get(key).input.closest(".field").hidden = !answers.reading?.[key] && !remarks.has(key); });
  found.columns.forEach((column, i) => {
    const [is, unit, place] = ["is", "unit", "place"].map((key) => fields.get(`columns.${i}.${key}`).input);
    const said = answers.columns?.[column.name] || {};
    document.querySelectorAll("#new-rig .sampled")[i].textContent = alike() ? "" : sampled(column);
    // what the table shows stands in the list; a person may choose otherwise
    if (!said.is) is.value = column.is || "none";
    unit.placeholder = column.unit || (column.is ? "bar, or 1..5 -> 0..10 bar" : "");
    place.closest(".field").hidden = !places.includes(column.is);
    unit.closest(".field").hidden = !column.is;
    place.placeholder = column.position_m === null ? "" : plain(column.position_m);
    put(at(`new-rig-units-${i}`), found.units.filter(([, quantity]) => quantity === QUANTITY[column.is]).map(([symbol]) => h("option", { value: symbol })));
  });
  fields.get("flow").input.closest(".field").hidden = found.columns.some((column) => column.is === "flow");
  fields.get("name").input.placeholder = found.name;
  put(at("new-rig-understood"), [...new Set([...(found.columns.length && alike() ? [sampled(found.columns[0])] : []), ...found.understood])].map((text) => h("li", { text })), [...new Set(found.guessed)].map((text) => h("li", { class: "advice", text: `a guess: ${text}` })));
  draw();
  const wanting = found.remarks.filter((remark) => remark.weight !== "assumed");
  const doubts = found.rig?.doubts || [];
  put(at("new-rig-says"), against(wanting),
    found.rig ? h("p", {}, "Writes ", h("b", { text: found.writes[0] }), " and ", h("b", { text: found.writes[1] }), ` in ${found.folder}; nothing is replaced.`) : null,
    doubts.length ? h("ul", { class: "advice" }, doubts.map((text) => h("li", { text }))) : null,
    found.rig ? h("details", {}, h("summary", { text: `${found.writes[0]} as it will be` }), h("pre", { text: found.rig.text })) : null);
}

const assumedAt = (i) => found.remarks.some((remark) => remark.field === `columns.${i}.place` && remark.weight === "assumed");

function draw() {
  const pipe = found.pipe;
  if (!pipe) { put(at("new-rig-drawing")); return; }
  const drawn = frame();
  // a length that nobody has said is drawn, but not written
  const length = pipe.length_m ?? 1;
  const known = (column) => column.position_m !== null && pipe.length_m !== null;
  const sensors = found.columns.map((column, i) => ({ name: column.short || column.name, position_m: Math.min(column.position_m ?? 0, length), assumed: assumedAt(i), column })).filter(({ column }) => places.includes(column.is) && known(column));
  const [under, over] = drawn_rig({ ...inSeries(length, pipe.supply), sensors, pipes: [{ name: "pipe", from_m: 0, to_m: length, inner_diameter_m: (pipe.inner_diameter_mm ?? 20) / 1000 }] }, drawn);
  const middle = (drawn.from + drawn.to) / 2;
  const size = pipe.length_m === null ? "length?" : `${plain(pipe.length_m)} m`;
  put(at("new-rig-drawing"), svg("svg", { viewBox: `0 6 ${drawn.width} 78`, role: "img", "aria-label": "The rig as it is known" }, under, over, svg("text", { x: middle, y: AXIS + 26, "text-anchor": "middle", text: size })));
  const wall = pipe.inner_diameter_mm === null || pipe.wall_thickness_mm === null ? "its size is not known yet" : `${plain(pipe.inner_diameter_mm)} mm inside, wall ${plain(pipe.wall_thickness_mm)} mm`;
  at("new-rig-pipe").textContent = `${size === "length?" ? "A pipe" : `${size} of pipe`}${pipe.material ? ` of ${pipe.material}` : ""}, ${wall}. A place with a question mark is assumed.`;
}

async function make() {
  // the second of a double click is none
  if (writing) return;
  writing = true;
  try {
    await look();
    const wanting = new Set(found.remarks.filter((remark) => remark.weight !== "assumed").map((remark) => remark.field));
    if (wanting.size) {
      const first = [...fields.keys()].find((key) => wanting.has(key) && fields.get(key).input);
      if (!first || !go(first)) [...wanting].some(go);
      return;
    }
    app.opens = true;
    document.querySelector("#new-rig .primary").textContent = "Importing…";
    await post("/api/new-rig", { table, further: further(), form: form(), accept: true });
    sessionStorage.removeItem(kept());
    leave(true);
    await refresh();
  } catch (error) {
    app.opens = false;
    const button = document.querySelector("#new-rig .primary");
    if (button) button.textContent = MAKE;
    complain(error);
  } finally {
    writing = false;
  }
}

// Shows the form of a table of the folder, or of one that was dropped.
export async function makeRig(name, dropped = []) {
  table = name;
  found = null;
  answers = JSON.parse(sessionStorage.getItem(kept()) || "{}");
  // what was ticked may be gone; what is dropped together is of one closure
  if (dropped.length) answers.further = dropped;
  else if (further().length) answers.further = further().filter((own) => app.state.tables.includes(own));
  document.body.classList.add("making");
  at("new-rig").hidden = false;
  put(at("new-rig"), h("p", { text: `Reading ${name}…` }));
  try {
    await look();
    [...fields.values()].find(({ input }) => input && !input.closest("[hidden]"))?.input.focus({ preventScroll: true });
  } catch (error) { leave(); complain(error); }
}

let left = false;
function leave(made = false) {
  table = null;
  left = !made;
  document.body.classList.remove("making");
  put(at("new-rig"));
  at("new-rig").hidden = true;
  tables();
}

// Where a folder holds tables and nothing else, they are what there is to begin with.
let begun = false;
export function tables() {
  const { open, job, runs, table: named, tables: all } = app.state;
  if (table || open || job) {
    if (!table) at("new-rig").hidden = true;
    return;
  }
  const only = named || (all.length === 1 && !runs.length ? all[0] : null);
  if (only && !begun && !left) { begun = true; makeRig(only); return; }
  at("new-rig").hidden = !all.length;
  put(at("new-rig"), h("h2", { text: runs.length ? "Tables in this folder" : "No recording is here yet, but tables of a logger" }), h("p", { class: "hint", text: all.length > 1 ? "Choose one to make a rig and a recording of it. Further tables of the same closure are joined to it in the next step." : "Choose it to make a rig and a recording of it." }),
    h("ul", {}, all.map((name) => h("li", {}, h("button", { type: "button", class: "link", text: name, "data-key": `table ${name}`, onclick: () => makeRig(name) })))));
}
