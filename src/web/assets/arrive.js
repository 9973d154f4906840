// A file that is dropped on the page: looked at first; written once a person agrees on which column is which sensor.

import { post } from "/assets/api.js";
import { at, digits, h, put } from "/assets/dom.js";
import { app, complain } from "/assets/store.js";
import { runs } from "/assets/runs.js";

const base64 = (file) => new Promise((resolve, reject) => {
  const reader = new FileReader();
  reader.onload = () => resolve(reader.result.slice(reader.result.indexOf(",") + 1));
  reader.onerror = () => reject(new Error(`${file.name} cannot be read`));
  reader.readAsDataURL(file);
});

export async function arrive(file) {
  if (!at("runs").open) runs();
  const box = at("import");
  put(box, h("p", { text: `Reading ${file.name}…` }));
  box.scrollIntoView({ block: "nearest" });
  let content;
  try { content = await base64(file); } catch (error) { complain(error); return; }
  const look = async (map, ignore, without, accept) => {
    try {
      const found = await post("/api/import", { name: file.name, content, map, ignore, without, accept });
      if (accept) at("runs").close(); else show(found);
    } catch (error) {
      put(box, h("h3", { text: file.name }), h("p", { class: "advice", text: error.message }));
    }
  };
  const show = (found) => {
    const understood = new Map((found.understood?.sensors || []).map((s) => [s.sensor, s]));
    // a column may be known by a short name and by its whole heading
    const columnOf = (s) => found.columns.find((c) => c === s?.column || s?.column?.includes(c) || (s?.column && c.includes(s.column)));
    const choices = found.sensors.map((sensor) => {
      const choice = h("select", { "aria-label": `Column of ${sensor}`, "data-key": `column ${sensor}` }, h("option", { value: "", text: "not recorded" }), found.columns.map((c) => h("option", { value: c, text: c })));
      choice.value = columnOf(understood.get(sensor)) ?? (found.columns.includes(sensor) ? sensor : "");
      choice.onchange = () => look(...said(), false);
      return [sensor, choice];
    });
    const said = () => {
      const map = choices.filter(([, choice]) => choice.value).map(([sensor, choice]) => [choice.value, sensor]);
      const taken = new Set(map.map(([column]) => column));
      return [map, found.columns.filter((c) => !taken.has(c)), choices.filter(([, choice]) => !choice.value).map(([sensor]) => sensor)];
    };
    const line = ([sensor, choice]) => {
      const s = understood.get(sensor);
      return h("tr", {}, h("th", { scope: "row", text: sensor }), h("td", {}, choice), h("td", { text: s?.unit ?? "" }), h("td", { class: "number", text: s?.samples ?? "" }), h("td", { class: "number", text: s ? s.first.map((v) => digits(v, 4)).join("  ") : "" }));
    };
    const notes = found.problem ? [] : [found.taken, ...found.mended.map((m) => m.text), ...found.warnings.map((w) => w.text), ...found.sensor_faults.map((f) => f.says)].filter(Boolean);
    put(box, h("div", { class: "card arriving" },
      h("h3", { text: found.problem ? `${file.name}: which column is which sensor?` : `${file.name}, as understood` }),
      found.problem ? h("p", { class: "advice", text: found.problem }) : null,
      app.state.open ? h("p", { class: "hint", text: `Read with the rig of ${app.state.open.title}: its sensors, their units and their places.` }) : null,
      h("table", {}, h("thead", {}, h("tr", {}, ["sensor", "column of the file", "unit", "samples", "first values"].map((text) => h("th", { scope: "col", text })))), h("tbody", {}, choices.map(line))),
      notes.length ? h("ul", {}, notes.map((text) => h("li", { text }))) : null,
      h("p", { class: "buttons" }, h("button", { type: "button", class: "primary", text: "Import so", disabled: Boolean(found.problem), onclick: () => look(...said(), true) }), h("button", { type: "button", text: "Leave it", onclick: () => put(box) }))));
  };
  await look([], [], [], false);
}
