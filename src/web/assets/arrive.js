// What is dropped on the page, one file or several of one closure: looked at first; written once a person agrees on which column is which sensor.

import { post } from "/assets/api.js";
import { at, digits, h, put } from "/assets/dom.js";
import { app, complain } from "/assets/store.js";
import { known, runs } from "/assets/runs.js";
import { READING, entry, makeRig } from "/assets/newrig.js";

const base64 = (file) => new Promise((resolve, reject) => {
  const reader = new FileReader();
  reader.onload = () => resolve(reader.result.slice(reader.result.indexOf(",") + 1));
  reader.onerror = () => reject(new Error(`${file.name} cannot be read`));
  reader.readAsDataURL(file);
});

const contents = (files) => Promise.all(files.map(async (file) => ({ name: file.name, content: await base64(file) })));

// Tables of a rig that is not there yet: a form asks for it. False where the file knows its rig.
async function withoutRig(files, new_rig = false) {
  const [first, ...further] = await contents(files);
  const found = await post("/api/import", { ...first, further, new_rig });
  if (!found.needs_rig) return false;
  at("runs").close();
  await makeRig(found.needs_rig, found.further);
  return true;
}

// How the clocks of several files come together.
const ALIGNED = [["", "the surest way that all allow"], ["trigger", "trigger"], ["time", "time"], ["front", "front"]];

export async function arrive(files) {
  const [file, ...others] = files;
  const names = files.map((one) => one.name).join(" and ");
  const no_rig = !app.state.open && !app.state.can_record.length;
  try { if (no_rig && (await withoutRig(files))) return; } catch (error) { complain(error); return; }
  if (!at("runs").open) runs();
  const box = at("import");
  put(box, h("p", { text: `Reading ${names}…` }));
  box.scrollIntoView({ block: "nearest" });
  let [content, further] = ["", []];
  try { [{ content }, ...further] = await contents(files); } catch (error) { complain(error); return; }
  let [writing, rigOf, align] = [false, null, ""];
  // what is written of its text and times
  const reading = {};
  // what the numbers of a sensor's column stand for, where they are volts, milliamperes or in another unit than the rig's
  const scale = new Map();
  // the column of a sensor, also while the file cannot be understood
  const chosen = new Map();
  const look = async (map, ignore, without, accept) => {
    // the second of a double click is none
    if (writing) return;
    writing = accept;
    app.opens ||= accept;
    const scales = map.filter(([, sensor]) => scale.get(sensor)).map(([column, sensor]) => [column, scale.get(sensor)]);
    try {
      const found = await post("/api/import", { name: file.name, content, further, align: align || null, map, ignore, without, accept, scales, reading, rig_of: rigOf });
      if (accept) at("runs").close(); else show(found);
    } catch (error) {
      writing = false;
      put(box, h("h3", { text: names }), h("p", { class: "advice", text: error.message }), h("button", { type: "button", text: "Start again", onclick: () => arrive(files) }));
    }
  };
  // Where the runs are of several rigs, a person says of which one the file is.
  const rigs = (found) => {
    const of_file = found.as_it_is ? `This is a recording of the rig ${found.rig}, and it is taken as it is.` : `Read with the rig ${found.rig}: its sensors, their units and their places.`;
    const { open, runs } = app.state;
    const all = runs.map(known);
    const of = new Map(all.filter((run) => run.rig).map((run) => [run.rig, run.id]));
    const own = open && all.find((run) => run.open)?.rig;
    if (found.as_it_is || !open || of.size < 2) return h("p", { class: "hint", text: of_file });
    const choice = h("select", { "data-key": "rig", onchange: () => { rigOf = of.get(choice.value); scale.clear(); chosen.clear(); look([], [], [], false); } }, [...of.keys()].map((rig) => h("option", { value: rig, text: rig })));
    choice.value = [...of].find(([, id]) => id === rigOf)?.[0] ?? own ?? "";
    return h("label", {}, "recorded on the rig ", choice);
  };
  const aligned = () => {
    if (!others.length) return null;
    const choice = h("select", { "data-key": "align", onchange: () => { align = choice.value; look(...said(), false); } }, ALIGNED.map(([value, text]) => h("option", { value, text })));
    choice.value = align;
    return h("label", {}, "aligned by ", choice);
  };
  let said = () => [[], [], []];
  const show = (found) => {
    const understood = new Map((found.understood?.sensors || []).map((s) => [s.sensor, s]));
    // a column may be known by a short name and by its whole heading
    const columnOf = (s) => found.columns.find((c) => c === s?.column || s?.column?.includes(c) || (s?.column && c.includes(s.column)));
    const choices = found.sensors.map((sensor) => {
      const choice = h("select", { "aria-label": `Column of ${sensor}`, "data-key": `column ${sensor}` }, h("option", { value: "", text: "not recorded" }), found.columns.map((c) => h("option", { value: c, text: c })));
      chosen.set(sensor, columnOf(understood.get(sensor)) ?? chosen.get(sensor) ?? (found.columns.includes(sensor) ? sensor : ""));
      choice.value = chosen.get(sensor);
      choice.onchange = () => { chosen.set(sensor, choice.value); look(...said(), false); };
      return [sensor, choice];
    });
    said = () => {
      const map = choices.filter(([, choice]) => choice.value).map(([sensor, choice]) => [choice.value, sensor]);
      const taken = new Set(map.map(([column]) => column));
      return [map, found.columns.filter((c) => !taken.has(c)), choices.filter(([, choice]) => !choice.value).map(([sensor]) => sensor)];
    };
    const needed = new Map(found.remarks.map((remark) => [remark.field, remark.says]));
    // what a person has to say is not guessed
    const open = found.remarks.filter((remark) => remark.weight === "open").map((remark) => remark.field);
    const ofReading = READING.filter(([key]) => reading[key] || needed.has(key)).map(([key, label, example, choices]) => {
      const input = entry(reading[key] ?? "", example, choices, () => {});
      input.dataset.key = key;
      input.addEventListener("change", () => { reading[key] = input.value; look(...said(), false); });
      return h("label", {}, `${label} `, input, h("span", { class: open.includes(key) ? "advice" : "hint", text: ` ${needed.get(key) ?? ""}` }));
    });
    const line = ([sensor, choice]) => {
      const volts = h("input", { type: "text", size: 18, placeholder: "psi, or 1..5 -> 0..10 bar", value: scale.get(sensor) ?? "", "aria-label": `Unit of the numbers of ${sensor}, or the ranges of its transducer, where the heading does not say`, "data-key": `scale ${sensor}`, onchange: () => {
        scale.set(sensor, volts.value.trim());
        if (choice.value) look(...said(), false);
      } });
      const s = understood.get(sensor);
      return h("tr", {}, h("th", { scope: "row", text: sensor }), h("td", {}, choice), h("td", {}, volts), h("td", { text: s?.unit ?? "" }), h("td", { class: "number", text: s?.samples ?? "" }), h("td", { class: "number", text: s ? s.first.map((v) => digits(v, 4)).join("  ") : "" }));
    };
    const notes = found.problem ? [] : [...new Set([found.taken, ...found.joined, ...found.mended.map((m) => (m.guessed ? `a guess: ${m.text}` : m.text)), ...found.warnings.map((w) => w.text), ...found.sensor_faults.map((f) => f.says), ...found.doubts].filter(Boolean))];
    put(box, h("div", { class: "card arriving" },
      h("h3", { text: found.problem ? `${names}: which column is which sensor?` : `${names}, as understood` }),
      found.problem ? h("p", { class: "advice", text: found.problem }) : null,
      rigs(found), aligned(),
      ofReading, h("table", {}, h("thead", {}, h("tr", {}, ["sensor", "column of the file", "another unit, or from V or mA", "unit", "samples", "first values"].map((text) => h("th", { scope: "col", text })))), h("tbody", {}, choices.map(line))),
      notes.length ? h("ul", {}, notes.map((text) => h("li", { text }))) : null,
      h("p", { class: "buttons" }, h("button", { type: "button", class: "primary", text: "Import", disabled: Boolean(found.problem || open.length), onclick: () => look(...said(), true) }), h("button", { type: "button", text: "Do not import", onclick: () => put(box) }), found.as_it_is ? null : h("button", { type: "button", text: "It is of another rig: make one", onclick: () => withoutRig(files, true).catch(complain) }))));
  };
  await look([], [], [], false);
}
