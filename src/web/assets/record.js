// What starts a recording: on the rig's devices, or of a simulated test.

import { at, digits, h, named, put, unitOf } from "/assets/dom.js";
import { ask } from "/assets/api.js";
import { app, act } from "/assets/store.js";
import { expect } from "/assets/live.js";

// A question: its name, its field, and what stands behind it.
function row(label, field, behind = "") {
  return h("label", { class: "asked" }, h("span", { text: label }), " ", field, " ", h("span", { class: "hint" }, behind));
}

function number(label, value, behind) {
  const field = h("input", { type: "number", step: "any", min: 0, value });
  return { field, row: row(label, field, behind) };
}

function choice(label, options) {
  const field = h("select", {}, options.map(([value, text]) => h("option", { value, text })));
  return { field, row: h("label", { class: "asked" }, h("span", { text: label }), field) };
}

// The values of a simulated test, those that a person has changed marked by their names.
function settings() {
  const box = h("div", { class: "values" });
  const set = new Map();
  const draw = async (effects) => {
    let found;
    try { found = await ask(`/api/simulation?effects=${encodeURIComponent(effects.join(","))}`); } catch (error) { put(box, h("p", { class: "advice", text: error.message })); return; }
    [...set.keys()].forEach((name) => found.settings.some((s) => s.name === name) || set.delete(name));
    put(box, h("p", { class: "hint", text: `Rig ${found.rig}, ${digits(found.length_m, 4)} m, period ${digits(found.period_s, 3)} s. What you do not change is as in the rig file, or as before the closure of the open run.` }), found.settings.map((s) => {
      const field = h("input", { type: "number", step: "any", value: set.get(s.name) ?? +s.value.toPrecision(6), "data-key": `set ${s.name}`, onchange: () => { if (Number.isFinite(field.valueAsNumber)) set.set(s.name, field.valueAsNumber); else set.delete(s.name); } });
      const one = row(named(s), field, unitOf(s));
      one.title = s.about;
      return one;
    }));
  };
  return { box, set, draw };
}

export function record() {
  const dialog = at("record");
  const source = choice("Record from", app.state.can_record.map((name) => [name, name === "devices" ? "the rig's devices" : "a simulated test"]));
  const values = settings();
  const effects = h("input", { type: "text", placeholder: "none", onchange: () => values.draw(list()) });
  const list = () => effects.value.split(",").map((e) => e.trim()).filter(Boolean);
  const more = h("select", { "aria-label": "Hide an effect in the test", onchange: () => { effects.value = [effects.value, more.value].filter(Boolean).join(", "); more.value = ""; values.draw(list()); } },
    h("option", { value: "", text: "add one…" }), [...app.effects.keys()].map((name) => h("option", { value: name, text: name })));
  const rate = number("Samples per second", 1000, "of each sensor");
  const speed = number("Speed", 1, "times real time");
  const duration = number("Stop after", "", "s");
  const trigger = choice("Keep", [["", "everything, as one recording"], ...(app.state.has_trigger ? [["edge", "a shot each time the valve is commanded"]] : []), ["level", "a shot each time the pressure passes a level"], ["slope", "a shot each time the pressure rises fast"]]);
  const level = number("Level", "", "in the sensor's unit");
  const [before, after] = [number("From", 2, "s before the trigger"), number("To", 20, "s after the trigger")];
  const simulated = h("div", { class: "rows" }, row("Hidden effects", effects, more), rate.row, speed.row,
    h("details", { ontoggle: () => values.box.childElementCount || values.draw(list()) }, h("summary", { text: "Values of the test" }), values.box));
  const shots = h("div", { class: "rows" }, level.row, before.row, after.row);
  // A rig file may come from anybody: who records sees what it starts on this computer, and says so.
  const { commands } = app.state;
  const agree = h("input", { type: "checkbox", onchange: () => show() });
  const programs = h("div", { class: "rows" }, h("p", { class: "hint" }, "This recording starts ", commands.length === 1 ? "a program" : "programs", " on this computer, as the rig file says:"),
    commands.map((c) => h("p", {}, `${c.device}: `, h("code", { text: c.shown }), h("span", { class: "hint", text: ` in ${c.folder}` }))),
    h("label", { class: "asked" }, h("span", { text: commands.length === 1 ? "Start it" : "Start them" }), " ", h("span", {}, agree)));
  const begin = h("button", { class: "primary", text: "Start" });
  const show = () => {
    simulated.hidden = source.field.value !== "simulated";
    programs.hidden = !simulated.hidden || !commands.length;
    begin.disabled = !programs.hidden && !agree.checked;
    shots.hidden = !trigger.field.value;
    level.row.hidden = trigger.field.value === "edge";
    level.row.firstChild.textContent = trigger.field.value === "slope" ? "Rise" : "Level";
    level.row.lastChild.textContent = trigger.field.value === "slope" ? "per second, in the sensor's unit" : "in the sensor's unit";
    duration.field.placeholder = simulated.hidden ? "until you stop it" : "the whole test";
  };
  source.field.onchange = trigger.field.onchange = show;
  const start = async (event) => {
    event.preventDefault();
    const wanted = { simulate: source.field.value === "simulated" };
    if (duration.field.value) wanted.duration_s = duration.field.valueAsNumber;
    if (wanted.simulate) Object.assign(wanted, { effects: list(), set: Object.fromEntries(values.set), rate_hz: rate.field.valueAsNumber, speed: speed.field.valueAsNumber });
    const kind = trigger.field.value;
    if (kind) wanted.trigger = { pre_s: before.field.valueAsNumber, post_s: after.field.valueAsNumber, ...(kind === "edge" ? {} : { [kind]: level.field.valueAsNumber }) };
    if (!programs.hidden && agree.checked) wanted.commands = Object.fromEntries(commands.map((c) => [c.device, c.words]));
    expect();
    if (await act("/api/record", wanted)) dialog.close();
  };
  put(dialog, h("form", { onsubmit: start }, h("div", { class: "heading" }, h("h2", { text: "Record" }), h("button", { type: "button", text: "Close", onclick: () => dialog.close() })),
    h("p", { class: "hint", text: "When a recording ends, it appears among the runs and is opened, fitted and diagnosed." }),
    h("div", { class: "rows" }, source.row), programs, simulated, h("div", { class: "rows" }, duration.row, trigger.row), shots,
    h("p", { class: "buttons" }, begin)));
  show();
  dialog.showModal();
}
