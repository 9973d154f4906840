// A recording as it runs: levels, strips, losses; and what starts and ends it.

import { at, digits, h, named, put, unitOf } from "/assets/dom.js";
import { ask } from "/assets/api.js";
import { app, act, complain } from "/assets/store.js";

const number = (label, value, props = {}) => {
  const field = h("input", { type: "number", step: "any", min: 0, value, ...props });
  return { field, row: h("label", {}, `${label} `, field) };
};

// A recording was started, or seen to run, whose end this page has not reported yet.
let waits = false;

export function record() {
  const dialog = at("record");
  const can = app.state.can_record;
  const source = h("select", { "aria-label": "What is recorded" }, can.map((name) => h("option", { value: name, text: name === "devices" ? "the rig's devices" : "a simulated test" })));
  const effects = h("input", { type: "text", placeholder: "leak, viscoelastic-wall:1", "aria-label": "Effects of the simulated test", onchange: () => ask_values() });
  const more = h("select", { "aria-label": "Hide an effect in the test", onchange: () => { effects.value = [effects.value, more.value].filter(Boolean).join(", "); more.value = ""; ask_values(); } },
    h("option", { value: "", text: "hide an effect…" }), [...app.effects.keys()].map((name) => h("option", { value: name, text: name })));
  const list = () => effects.value.split(",").map((e) => e.trim()).filter(Boolean);
  // The values of the test, those that a person has changed marked by their names.
  const values = h("div", { class: "values" });
  const set = new Map();
  const ask_values = async () => {
    let found;
    try { found = await ask(`/api/simulation?effects=${encodeURIComponent(list().join(","))}`); } catch (error) { put(values, h("p", { class: "advice", text: error.message })); return; }
    [...set.keys()].forEach((name) => found.settings.some((s) => s.name === name) || set.delete(name));
    put(values, h("p", { class: "hint", text: `Rig ${found.rig}, ${digits(found.length_m, 4)} m, period ${digits(found.period_s, 3)} s. Values that you do not change are the rig's, or those of the open run.` }), found.settings.map((s) => {
      const field = h("input", { type: "number", step: "any", value: set.get(s.name) ?? +s.value.toPrecision(6), "data-key": `set ${s.name}`, onchange: () => { if (Number.isFinite(field.valueAsNumber)) set.set(s.name, field.valueAsNumber); else set.delete(s.name); } });
      return h("label", { title: s.about }, `${named(s)} `, field, ` ${unitOf(s)}`);
    }));
  };
  const rate = number("samples per second", 1000);
  const speed = number("times faster than real time", 1);
  const duration = number("duration, s", "");
  const trigger = h("select", { "aria-label": "Trigger" }, [["", "one recording"], ...(app.state.has_trigger ? [["edge", "shots, at the valve's command"]] : []), ["level", "shots, at a level"], ["slope", "shots, at a rise per second"]].map(([value, text]) => h("option", { value, text })));
  const level = number("level or rise, in the sensor's unit", "");
  const [pre, post] = [number("s before", 2), number("s after", 20)];
  const simulated = h("div", {}, h("label", {}, "effects ", effects, " ", more), rate.row, speed.row, h("details", { ontoggle: () => values.childElementCount || ask_values() }, h("summary", { text: "values of the test" }), values));
  const shots = h("div", {}, level.row, pre.row, post.row);
  const show = () => { simulated.hidden = source.value !== "simulated"; shots.hidden = !trigger.value; level.row.hidden = trigger.value === "edge"; duration.field.placeholder = simulated.hidden ? "until stopped" : "the whole test"; };
  source.onchange = trigger.onchange = show;
  const start = async (event) => {
    event.preventDefault();
    const wanted = { simulate: source.value === "simulated" };
    if (duration.field.value) wanted.duration_s = duration.field.valueAsNumber;
    if (wanted.simulate) { Object.assign(wanted, { effects: list(), set: Object.fromEntries(set), rate_hz: rate.field.valueAsNumber, speed: speed.field.valueAsNumber }); }
    if (trigger.value) wanted.trigger = { pre_s: pre.field.valueAsNumber, post_s: post.field.valueAsNumber, ...(trigger.value === "edge" ? {} : { [trigger.value]: level.field.valueAsNumber }) };
    waits = true;
    if (await act("/api/record", wanted)) dialog.close();
  };
  put(dialog, h("form", { onsubmit: start }, h("div", { class: "heading" }, h("h2", { text: "Record" }), h("button", { type: "button", text: "Close", onclick: () => dialog.close() })),
    h("p", { class: "hint", text: "Each recording appears among the runs; it is fitted and diagnosed when it ends." }),
    h("label", {}, "record ", source), simulated, duration.row, h("label", {}, "as ", trigger), shots, h("p", {}, h("button", { class: "primary", text: "Start" }))));
  show();
  dialog.showModal();
}

const strips = new Map();

function strip(sensor) {
  const canvas = h("canvas", { width: 600, height: 64, role: "img" });
  const [level, state] = [h("b"), h("span", { class: "hint" })];
  return { canvas, level, state, card: h("div", { class: "card strip" }, h("h3", {}, sensor.name, " ", level, " ", state), canvas) };
}

function draw(canvas, trace) {
  const context = canvas.getContext("2d");
  context.clearRect(0, 0, canvas.width, canvas.height);
  const known = trace.filter(Boolean);
  if (!known.length) return;
  const [low, high] = [Math.min(...known.map((b) => b[0])), Math.max(...known.map((b) => b[1]))];
  const y = (v) => 60 - (56 * (v - low)) / (high - low || 1);
  context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--measured").trim();
  const width = canvas.width / 100;
  trace.forEach((bin, i) => { if (bin) context.fillRect(canvas.width - (trace.length - i) * width, y(bin[1]), width + 0.5, Math.max(1.5, y(bin[0]) - y(bin[1]))); });
}

// Room on the disk, every few seconds while a recording runs.
async function room() {
  const box = at("live-disk");
  if (!box || at("live").hidden) return;
  try {
    const disk = await ask("/api/disk");
    const lasts = disk?.lasts_s && (disk.lasts_s < 7200 ? `${Math.round(disk.lasts_s / 60)} min` : disk.lasts_s < 172800 ? `${Math.round(disk.lasts_s / 3600)} h` : `${Math.round(disk.lasts_s / 86400)} days`);
    box.textContent = disk ? `disk: ${digits(disk.free_bytes / 1e9, 3)} GB free${lasts ? `, enough for ${lasts}` : ""}` : "";
    box.classList.toggle("advice", Boolean(disk?.lasts_s && disk.lasts_s < 600));
  } catch { box.textContent = ""; }
}
setInterval(room, 3000);

export function live(told) {
  const box = at("live");
  const names = told.sensors.map((s) => s.name).join();
  if (box.dataset.names !== names) {
    box.dataset.names = names;
    strips.clear();
    told.sensors.forEach((s) => strips.set(s.name, strip(s)));
    put(box, h("div", { class: "card" }, h("p", { id: "live-line" }), h("p", { id: "live-trigger", class: "hint" }), h("p", { id: "live-disk", class: "hint" }), h("button", { type: "button", class: "warn", text: "Stop recording", onclick: () => act("/api/record/stop") })), [...strips.values()].map((s) => s.card));
  }
  if (box.hidden) { box.hidden = false; room(); }
  at("live-line").textContent = `${told.file ? `${told.file}: ` : ""}${digits(told.recorded_s ?? 0, 4)} s, ${told.samples} samples, ${told.samples_per_s > 0 ? `${Math.round(told.samples_per_s)} a second, ` : ""}${told.gaps === 1 ? "1 gap" : `${told.gaps} gaps`}`;
  const trigger = told.trigger;
  at("live-trigger").textContent = [trigger && `trigger ${trigger.condition}: ${trigger.phase}, ${trigger.fired === 1 ? "1 shot" : `${trigger.fired} shots`}`, ...told.devices.map((d) => d.trouble), ...told.sensors.map((s) => s.says && `${s.name} ${s.says}`)].filter(Boolean).join("; ");
  for (const sensor of told.sensors) {
    const own = strips.get(sensor.name);
    own.level.textContent = sensor.level === null ? "–" : `${digits(sensor.level, 4)} ${unitOf(sensor)}`;
    own.state.textContent = [sensor.rate_hz && `${digits(sensor.rate_hz, 4)} Hz`, sensor.gaps && `${sensor.gaps} gaps`, sensor.fault?.what].filter(Boolean).join(", ");
    own.canvas.setAttribute("aria-label", `${sensor.name}, the last ten seconds`);
    draw(own.canvas, sensor.trace);
  }
}

export function recording() {
  const { recording: now, can_record: can } = app.state;
  if (now.running) waits = true;
  else if (now.ended && waits) {
    waits = false;
    if (now.ended.error) complain(new Error(`The recording failed: ${now.ended.error}`));
    else if (now.ended.data_lost) complain(new Error(`Data was lost on the way: ${now.ended.says}; the gaps are in the recording.`));
  }
  at("show-record").hidden = !can.length;
  at("show-record").disabled = now.running;
  if (now.running && now.live) live(now.live);
  if (!now.running) at("live").hidden = true;
  at("charts").hidden = now.running && !app.state.open;
}
