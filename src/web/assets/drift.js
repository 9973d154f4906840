// How the parameters of a rig drift from run to run, as `surgescope history` has it.

import { ask } from "/assets/api.js";
import { at, digits, h, named, put, svg, uncertain } from "/assets/dom.js";
import { app, act } from "/assets/store.js";
import { copy, word } from "/assets/commands.js";

const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [420, 150, 60, 410, 10, 122];

const slope = (s, of) => (s ? `${s.value > 0 ? "+" : ""}${digits(s.value, 2)} per ${of} (95%: ${digits(s.interval[0], 2)} to ${digits(s.interval[1], 2)})${s.interval[0] > 0 || s.interval[1] < 0 ? ", it drifts" : ""}` : null);

async function open(file) {
  const run = app.state.runs.find((r) => r.name === file);
  if (run && (await act("/api/open", { runs: [run.id] }))) { at("drift").close(); at("runs").close(); }
}

function chart(p) {
  const bars = p.values.flatMap((v) => [v.value - 2 * v.standard_error, v.value + 2 * v.standard_error]);
  const room = 0.06 * (Math.max(...bars) - Math.min(...bars));
  const [low, high] = [Math.min(...bars) - room, Math.max(...bars) + room];
  const [first, last] = [Math.min(...p.values.map((v) => v.run)), Math.max(...p.values.map((v) => v.run))];
  const x = (run) => LEFT + 12 + ((RIGHT - LEFT - 24) * (run - first)) / (last - first || 1);
  const y = (v) => BOTTOM - ((BOTTOM - TOP) * (v - low)) / (high - low || 1);
  const text = (px, py, label, anchor) => svg("text", { x: px, y: py, "text-anchor": anchor, text: label });
  const per = p.drift?.per_run;
  const at_run = (run) => y(p.drift.mean + per.value * (run - p.drift.mean_run));
  // where something is missing, nobody knows how far the value is off
  const known = (v) => (v.sound ? uncertain(v.value, v.standard_error) : `${digits(v.value, 3)}?`);
  const dot = (v) => svg("g", { class: v.sound ? "point" : "point doubtful" },
    v.sound ? svg("line", { x1: x(v.run), x2: x(v.run), y1: y(v.value - 2 * v.standard_error), y2: y(v.value + 2 * v.standard_error) }) : null,
    svg("circle", { cx: x(v.run), cy: y(v.value), r: 4, tabindex: 0, role: "button", "aria-label": `Open ${v.file}: ${known(v)}`, onclick: () => open(v.file), onkeydown: (e) => e.key === "Enter" && open(v.file) },
      svg("title", { text: `${v.file}: ${known(v)}` })));
  return svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, class: "drift", role: "group", "aria-label": `${named(p)} over runs` },
    svg("line", { x1: LEFT, x2: RIGHT, y1: BOTTOM, y2: BOTTOM, class: "base" }), text(LEFT - 4, y(high) + 10, digits(high, 4), "end"), text(LEFT - 4, BOTTOM, digits(low, 4), "end"),
    text(x(first), HEIGHT - 10, `run ${first}`, "middle"), last > first ? text(x(last), HEIGHT - 10, `run ${last}`, "middle") : null,
    per ? svg("line", { x1: x(first), x2: x(last), y1: at_run(first), y2: at_run(last), class: "trend" }) : null, p.values.map(dot));
}

export async function drift() {
  const dialog = at("drift");
  const body = h("div");
  put(dialog, h("form", { method: "dialog", class: "heading" }, h("h2", { text: "Drift of parameters over runs" }), h("button", { text: "Close" })), body);
  if (!dialog.open) dialog.showModal();
  let rigs;
  try { rigs = await ask("/api/history"); } catch (error) {
    // which runs belong together is a folder's to say
    if (!app.state.folder) { put(body, h("p", { class: "advice", text: error.message })); return; }
    const command = `surgescope watch ${word(app.state.place)} --once`;
    put(body, h("p", {}, "In a terminal, ", h("code", { text: command }), " fits every run of this folder and keeps what it finds; the drift is then shown here. ",
      h("button", { type: "button", text: "Copy the command", onclick: () => copy(command) })));
    return;
  }
  const one = (p) => h("div", { class: "card" }, h("h3", { text: `${named(p)}${p.unit === "1" ? "" : `, ${p.unit}`}` }), p.values.length ? chart(p) : null,
    h("p", { class: "hint", text: [slope(p.drift?.per_run, "run"), slope(p.drift?.per_kelvin, "kelvin")].filter(Boolean).join("; ") || "too few runs for a drift" }));
  put(body, rigs.map((rig) => h("section", {}, h("h3", { text: `${rig.rig}: ${rig.runs.length === 1 ? "1 run" : `${rig.runs.length} runs`}, ${rig.effects.join(" + ") || "base model"}` }),
    h("p", { class: "hint", text: "Bars: ± 2 standard errors. Hollow: something is missing in that run, so it is not counted, and nobody knows how far it is off. Click a run to open it." }),
    rig.parameters.length ? h("div", { class: "drifts" }, rig.parameters.map(one)) : h("p", { text: "No run of this rig has been fitted yet." }))));
}
