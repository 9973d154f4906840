// A recording as it runs: the page is the recorder's, with a strip a sensor, its level and health, losses and the trigger. Who wants to look at
// a run meanwhile goes there and comes back.

import { ask } from "/assets/api.js";
import { at, digits, h, put, unitOf } from "/assets/dom.js";
import { app, act, complain } from "/assets/store.js";
import { ticks } from "/assets/picture.js";

// Height of a strip where not all fit the page, px; what a strip's axis takes.
const LEAST_PX = 66;
const AXIS_PX = { left: 58, right: 12, top: 8, bottom: 18 };
// The seconds of a trace, a bin each tenth.
const SECONDS = 10;
// A scale that is so much wider than its curve is drawn closer.
const LOOSE = 3;

const strips = new Map();
// The recorder has the page, unless a person looks at a run.
let aside = false;

function strip(sensor) {
  const canvas = h("canvas", { role: "img", "aria-label": `${sensor.name}, the last ${SECONDS} seconds` });
  const [level, state] = [h("b", { class: "level" }), h("span", { class: "hint" })];
  return { canvas, level, state, scale: null, card: h("div", { class: "card strip" }, h("h3", {}, sensor.name, level, state), canvas) };
}

// What turns a sensor's value into what the page shows, and its symbol: heads where they are wanted, and the sensor gives a pressure.
function shownAs(sensor) {
  const head = app.unit === "m" ? app.state.recording.rig?.heads?.[sensor.name] : null;
  return head ? { of: (v) => (v - head.zero) / head.per_m, symbol: "m" } : { of: (v) => v, symbol: unitOf(sensor) };
}

// A scale stands still as long as the curve is on it and fills a part of it.
function scaled(was, low, high, accuracy) {
  const room = 0.1 * (high - low) || accuracy || Math.abs(high) * 1e-3 || 1;
  const fits = was && low >= was[0] && high <= was[1] && (was[1] - was[0] < LOOSE * (high - low + 2 * room));
  return fits ? was : [low - room, high + room];
}

const paint = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// The trace as a line: of each bin its least and its most value, in the order in which the curve passes them as far as its neighbours tell.
function draw(own, trace, symbol) {
  const { canvas } = own;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const known = trace.filter(Boolean);
  if (!known.length || !width) return;
  const sharp = devicePixelRatio;
  if (canvas.width !== Math.round(width * sharp) || canvas.height !== Math.round(height * sharp)) [canvas.width, canvas.height] = [Math.round(width * sharp), Math.round(height * sharp)];
  own.scale = scaled(own.scale, Math.min(...known.map((b) => b[0])), Math.max(...known.map((b) => b[1])));
  const [low, high] = own.scale;
  const { left, right, top, bottom } = AXIS_PX;
  const x = (i) => left + ((width - left - right) * (i + 0.5)) / trace.length;
  const y = (v) => height - bottom - ((height - top - bottom) * (v - low)) / (high - low);
  const context = canvas.getContext("2d");
  context.setTransform(sharp, 0, 0, sharp, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "11px system-ui, sans-serif";
  context.lineWidth = 1;
  context.strokeStyle = paint("--line");
  context.fillStyle = paint("--text-2");
  context.textAlign = "right";
  for (const v of ticks(low, high, 4)) {
    context.beginPath();
    context.moveTo(left, y(v));
    context.lineTo(width - right, y(v));
    context.stroke();
    context.fillText(`${+v.toPrecision(6)}`.replace("-", "−"), left - 6, y(v) + 4);
  }
  context.textAlign = "left";
  context.fillText(symbol, 2, top + 4);
  [[0, `${SECONDS} s ago`, "left"], [0.5, `${SECONDS / 2} s`, "center"], [1, "now", "right"]].forEach(([share, text, align]) => { context.textAlign = align; context.fillText(text, x(share * trace.length - 0.5), height - 4); });
  context.strokeStyle = paint("--measured");
  context.lineWidth = 1.5;
  context.lineJoin = "round";
  // a gap ends a line
  for (let i = 0; i < trace.length; i++) {
    if (!trace[i]) continue;
    let end = i;
    while (trace[end + 1]) end++;
    context.beginPath();
    for (let n = i; n <= end; n++) {
      const [before, after] = [trace[Math.max(i, n - 1)], trace[Math.min(end, n + 1)]];
      const rises = after[0] + after[1] >= before[0] + before[1];
      context.lineTo(x(n - 0.5), y(trace[n][rises ? 0 : 1]));
      context.lineTo(x(n + 0.5), y(trace[n][rises ? 1 : 0]));
    }
    context.stroke();
    i = end;
  }
}

// Room on the disk, every few seconds while a recording runs.
async function room() {
  const box = at("live-disk");
  if (!box || at("live").hidden) return;
  try {
    const disk = await ask("/api/disk");
    const lasts = disk?.lasts_s && (disk.lasts_s < 7200 ? `${Math.round(disk.lasts_s / 60)} min` : disk.lasts_s < 172800 ? `${Math.round(disk.lasts_s / 3600)} h` : `${Math.round(disk.lasts_s / 86400)} days`);
    box.textContent = disk ? `Disk: ${digits(disk.free_bytes / 1e9, 3)} GB free${lasts ? `, enough for ${lasts}` : ""}.` : "";
    box.classList.toggle("advice", Boolean(disk?.lasts_s && disk.lasts_s < 600));
  } catch { box.textContent = ""; }
}
setInterval(room, 3000);

function lay(told) {
  strips.clear();
  told.sensors.forEach((s) => strips.set(s.name, strip(s)));
  put(at("live"),
    h("div", { class: "card heading" }, h("p", { id: "live-line" }), h("p", { id: "live-trigger" }), h("p", { id: "live-disk", class: "hint" }),
      h("button", { type: "button", id: "live-aside", text: "Look at the open run", onclick: () => look(true) }),
      h("button", { type: "button", class: "warn", text: "Stop recording", onclick: () => act("/api/record/stop") })),
    h("div", { id: "strips", style: { "--least": `${LEAST_PX}px` } }, [...strips.values()].map((s) => s.card)));
}

const PHASE = { settling: "waits until the pressure is steady", armed: "armed", fired: "fired", over: "over" };

export function live(told) {
  const box = at("live");
  const names = told.sensors.map((s) => s.name).join();
  if (box.dataset.names !== names || !strips.size) { box.dataset.names = names; lay(told); }
  if (box.hidden) { box.hidden = false; room(); }
  at("live-line").textContent = `${told.file ? `${told.file}: ` : ""}${digits(told.recorded_s ?? 0, 4)} s, ${told.samples} samples, ${told.samples_per_s > 0 ? `${Math.round(told.samples_per_s)} a second, ` : ""}${told.gaps === 1 ? "1 gap" : `${told.gaps} gaps`}`;
  const { trigger } = told;
  const waits = trigger?.of_seconds ? ` (${digits(trigger.seconds, 2)} of ${digits(trigger.of_seconds, 2)} s)` : "";
  at("live-trigger").textContent = [trigger && `Trigger: ${trigger.condition}, ${PHASE[trigger.phase] ?? trigger.phase}${waits}; ${trigger.fired === 1 ? "1 shot" : `${trigger.fired} shots`}`, ...told.devices.map((d) => d.trouble), ...told.devices.map((d) => d.says && `${d.name} says: ${d.says}`), ...told.sensors.map((s) => s.says && `${s.name} ${s.says}`)].filter(Boolean).join("; ");
  at("live-aside").hidden = !app.state.open;
  for (const sensor of told.sensors) {
    const own = strips.get(sensor.name);
    const { of, symbol } = shownAs(sensor);
    if (own.symbol !== symbol) Object.assign(own, { symbol, scale: null });
    own.level.textContent = sensor.level === null ? "–" : `${digits(of(sensor.level), 4)} ${symbol}`;
    own.state.textContent = [sensor.rate_hz && `${digits(sensor.rate_hz, 4)} Hz`, sensor.gaps && `${sensor.gaps} gaps`].filter(Boolean).join(", ");
    own.card.classList.toggle("faulty", Boolean(sensor.fault));
    if (sensor.fault) own.state.textContent += `; ${sensor.fault.what}`;
    draw(own, sensor.trace.map((bin) => bin && bin.map(of)), symbol);
  }
}

// Whether the page is the recorder's.
let looked = () => {};
export const whenLooked = (work) => { looked = work; };
function look(to) {
  aside = to;
  document.body.classList.toggle("recorder", app.state.recording.running && !aside);
  looked();
}

// A recording was started, or seen to run, whose end this page has not reported yet.
let waits = false;
export const expect = () => { [waits, aside] = [true, false]; };

export function recording() {
  const { recording: now, can_record: can } = app.state;
  if (now.running) waits = true;
  else if (now.ended && waits) {
    waits = false;
    if (now.ended.error) complain(new Error(`The recording failed: ${now.ended.error}`));
    else if (now.ended.data_lost) complain(new Error(`Data was lost on the way: ${now.ended.says}; the gaps are in the recording.`));
  }
  at("show-record").hidden = !can.length && !now.running;
  at("show-record").lastChild.textContent = now.running ? " Recording" : " Record";
  look(now.running && aside);
  if (now.running && now.live) live(now.live);
  if (!now.running) { at("live").hidden = true; strips.clear(); }
}

// The button in the head of the page, while a recording runs.
export const toRecorder = () => look(!aside);
