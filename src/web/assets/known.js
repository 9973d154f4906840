// How well a parameter is known: its 95% interval, the profile of its likelihood, the joint posterior, and what it trades with.

import { ask } from "/assets/api.js";
import { at, digits, h, keyOf, named, put, svg, uncertain, unitOf } from "/assets/dom.js";
import { app, act, complain } from "/assets/store.js";

// What is shown: a parameter, and what the server says of it.
let shown = null;

const query = (p) => new URLSearchParams({ parameter: p.name, ...(p.run && { run: p.run }) });

export async function known(p) {
  shown = { key: keyOf(p), p };
  await look();
  if (shown?.found && !at("known").open) at("known").showModal();
}

async function look() {
  const mine = shown;
  try { mine.found = await ask(`/api/known?${query(mine.p)}`); } catch (error) { complain(error); return; }
  if (mine === shown) draw();
}

// The page has heard of a change: a profile may be there, a job may have ended, another model may be in force.
export function knownAnew() {
  if (!at("known").open) return;
  const p = app.state.model?.parameters.find((one) => keyOf(one) === shown.key);
  if (!p) { at("known").close(); return; }
  shown.p = p;
  look();
}

const [W, H, LEFT, RIGHT, TOP, BOTTOM] = [560, 220, 46, 548, 12, 186];

// The curve between the points that were computed: the root of the rise, with the sign of the side, is nearly straight (Bates & Watts 1988,
// Nonlinear Regression Analysis, section 6.1), so straight lines between its points are parabolas of the rise.
const FINE = 24;
function curve({ points, best }) {
  const roots = points.map(([v, rise]) => [v, Math.sign(v - best) * Math.sqrt(Math.max(0, rise))]);
  return roots.slice(1).flatMap(([v, root], i) => {
    const [w, other] = roots[i];
    return Array.from({ length: FINE + 1 }, (_, n) => [w + ((v - w) * n) / FINE, (other + ((root - other) * n) / FINE) ** 2]);
  });
}

// Rise of the sum of squares along the parameter. Where it passes the threshold the interval ends.
function picture(profile, p) {
  const { points, threshold } = profile;
  const room = 0.12 * (points.at(-1)[0] - points[0][0]);
  const [from, to] = [points[0][0] - room, points.at(-1)[0] + room];
  const most = Math.max(1.6 * threshold, Math.min(2.5 * threshold, Math.max(...points.map(([, rise]) => rise))));
  const x = (v) => LEFT + ((RIGHT - LEFT) * (v - from)) / (to - from || 1);
  const y = (rise) => BOTTOM - ((BOTTOM - TOP) * Math.max(0, rise)) / most;
  const text = (px, py, anchor, words) => svg("text", { x: px, y: py, "text-anchor": anchor, text: words });
  const line = (x1, x2, y1, y2, name) => svg("line", { x1, x2, y1, y2, class: name });
  const ends = profile.interval_95.map((end) => (end === null ? null : x(Math.min(to, Math.max(from, end)))));
  const [low, high] = [ends[0] ?? LEFT, ends[1] ?? RIGHT];
  return svg("svg", { viewBox: `0 0 ${W} ${H}`, class: "profile", role: "img", "aria-label": `Profile of ${named(p)}: the 95% interval is ${interval(profile.interval_95)} ${unitOf(p)}` },
    svg("rect", { x: low, width: Math.max(0, high - low), y: TOP, height: BOTTOM - TOP, class: "inside" }),
    line(LEFT, RIGHT, BOTTOM, BOTTOM, "base"), line(LEFT, RIGHT, y(threshold), y(threshold), "noise-line"),
    text(LEFT - 6, y(threshold) + 4, "end", digits(threshold, 3)), text(LEFT - 6, BOTTOM + 4, "end", "0"),
    svg("polyline", { points: curve(profile).filter(([, rise]) => rise <= 1.02 * most).map(([v, rise]) => `${x(v).toFixed(1)},${y(rise).toFixed(1)}`).join(" "), class: "falling" }),
    points.filter(([, rise]) => rise <= most).map(([v, rise]) => svg("circle", { cx: x(v), cy: y(rise), r: 2.5, class: "now" }, svg("title", { text: `${digits(v, 6)} ${unitOf(p)}: ${digits(rise, 3)}` }))),
    [points[0][0], profile.best, points.at(-1)[0]].map((v) => text(x(v), BOTTOM + 16, "middle", digits(v, 5))),
    text((LEFT + RIGHT) / 2, H - 4, "middle", `${named(p)}${unitOf(p) ? `, ${unitOf(p)}` : ""}`));
}

const interval = ([low, high]) => (low === null && high === null ? "open on both sides" : low === null ? `open to ${digits(high, 5)}` : high === null ? `${digits(low, 5)} to open` : `${digits(low, 5)} to ${digits(high, 5)}`);

// What the profile says, in words.
function says(profile, p) {
  const known = profile.linear_95.some((end) => end !== null);
  const linear = profile.disagrees ? `, by the curvature at the fit ${interval(profile.linear_95)}: trust the profile` : known ? ", as the curvature at the fit has it" : "";
  const open = profile.interval_95.map((end, i) => end === null && profile.unknown_beyond[i] === null).some(Boolean);
  return [
    `95% interval by the profile: ${interval(profile.interval_95)} ${unitOf(p)}${linear}.`,
    open ? "On an open side the bound comes before the fit gets worse than the noise explains." : null,
    ...profile.unknown_beyond.map((last, i) => (last === null ? null : `${i ? "Above" : "Below"} ${digits(last, 5)} no refit of the other parameters reached an optimum: that end is not known.`)),
    profile.unresolved ? `${profile.unresolved} of its points are no optima and were left out.` : null,
    profile.fell_by > 1 ? `It passes a better fit, by ${digits(profile.fell_by, 3)} in χ²: fit again from there.` : null,
  ].filter(Boolean).map((text) => h("p", { text }));
}

// The draws of the joint posterior, two parameters at a time, as the report has them.
function draws({ picture }) {
  const drawn = document.importNode(new DOMParser().parseFromString(picture, "image/svg+xml").documentElement, true);
  drawn.setAttribute("class", "draws");
  return drawn;
}

// What the posterior says, in words.
function sampled({ how, reservation }, p, { posterior: own }) {
  return [
    own && !reservation ? `95% interval by the posterior: ${interval(own.interval_95 || [null, null])} ${unitOf(p)}.` : null,
    reservation ? `Warning: ${reservation}.` : null,
    `${how}. Each dot is a draw: a set of values that the recordings allow. Dots along a line or a bow are values that trade with each other.`,
  ].filter(Boolean).map((text) => h("p", { text }));
}

// The ellipse of two errors with this correlation: a circle where they do not know of each other, a line where they trade.
const TILE = 88;
function trade(other, p) {
  const r = other.correlation;
  const [c, most] = [TILE / 2, 0.42 * TILE];
  const points = Array.from({ length: 49 }, (_, i) => {
    const t = (2 * Math.PI * i) / 48;
    const [u, v] = [Math.cos(t), r * Math.cos(t) + Math.sqrt(1 - Math.min(1, r * r)) * Math.sin(t)];
    return `${(c + most * u).toFixed(1)},${(c - most * v).toFixed(1)}`;
  });
  const name = `${named(other)}${other.run && app.state.open.runs.length > 1 ? ` ${other.run}` : ""}`;
  const strong = Math.abs(r) > 0.9;
  return h("figure", { class: `trade${strong ? " strong" : ""}`, title: `${named(p)} across, ${name} up: ${uncertain(other.value, other.standard_error)} ${unitOf(other)}` },
    svg("svg", { viewBox: `0 0 ${TILE} ${TILE}`, "aria-hidden": "true" },
      svg("line", { x1: 4, x2: TILE - 4, y1: c, y2: c, class: "base" }), svg("line", { x1: c, x2: c, y1: 4, y2: TILE - 4, class: "base" }),
      svg("polygon", { points: points.join(" ") })),
    h("figcaption", {}, h("b", { text: name }), h("span", { class: "number", text: ` ${r.toFixed(2).replace("-", "−")}` })));
}

const SEEN = 8;
const DRAWS = [100, 400, 1000];
let wanted = DRAWS[0];
function draw() {
  const { p, found } = shown;
  const { profile, posterior, trades_with: trades } = found;
  const working = app.state.job;
  const held = found.parameter.held;
  // the job that is at work on what a button of this dialog asked for
  const at_work = (what, key) => (working?.what === what ? h("p", {}, h("button", { type: "button", text: "Cancel", "data-key": key, onclick: () => act("/api/cancel") }), " ", h("span", { class: "progress", text: working.progress })) : null);
  const many = h("select", { "aria-label": "Independent draws of each parameter", disabled: Boolean(working), "data-key": "draws", onchange: (event) => { wanted = Number(event.target.value); } },
    DRAWS.map((n) => h("option", { value: n, text: `${n} draws`, selected: n === wanted })));
  const sample = h("button", { type: "button", class: "primary", text: posterior ? "Sample again" : "Sample", disabled: Boolean(working), "data-key": "sample", onclick: () => act("/api/posterior", { draws: wanted }) });
  const start = h("button", { type: "button", class: "primary", text: profile ? "Profile again" : "Profile", disabled: Boolean(working) || held, "data-key": "profile", onclick: () => act("/api/profile", { parameter: p.name, ...(p.run && { run: p.run }) }) });
  const strongest = trades[0];
  put(at("known"), h("form", { method: "dialog", class: "heading" }, h("h2", { text: `How well ${named(p)} is known` }), h("button", { text: "Close" })),
    h("p", {}, h("b", { text: `${uncertain(found.parameter.value, found.parameter.standard_error)} ${unitOf(p)}` }), held ? " held" : null, ` ${p.about}`),
    h("h3", { text: "Profile" }),
    h("p", { class: "hint", text: held ? "It is held, so it has no profile: let it go and fit." : "The parameter is moved step by step, and at each step all others are fitted again. The curve is how much worse the fit gets; the interval ends where that is more than noise explains." }),
    profile ? picture(profile, p) : null, profile ? says(profile, p) : null, at_work(`profiling ${p.name}`, "profile") || h("p", {}, start),
    h("h3", { text: "Joint posterior" }),
    h("p", { class: "hint", text: "Sets of values of all parameters are drawn that the recordings allow, along bounds and bent valleys too. Where the draws agree, the 95% intervals of all parameters are theirs. It may take minutes." }),
    posterior ? draws(posterior) : null, posterior ? sampled(posterior, p, found.parameter) : null, at_work("sampling the posterior", "sample") || h("p", {}, sample, " ", many),
    h("h3", { text: "What it trades with" }),
    strongest ? h("p", { class: "hint", text: Math.abs(strongest.correlation) < 0.5 ? "With none of the others: each is settled by itself." : `When it rises, ${named(strongest)} ${Math.abs(strongest.correlation) > 0.9 ? `${strongest.correlation > 0 ? "rises" : "falls"}, and the fit hardly gets worse` : `tends to ${strongest.correlation > 0 ? "rise" : "fall"}`}. A circle is no trade, a line a full one.` }) : h("p", { class: "hint", text: "Nothing is known of it: the parameter is held or at a bound, or the fit ended at no optimum." }),
    h("div", { class: "trades" }, trades.slice(0, SEEN).map((other) => trade(other, p))),
    trades.length > SEEN ? h("p", { class: "hint", text: `The other ${trades.length - SEEN} trade less: below ${Math.abs(trades[SEEN].correlation).toFixed(2)}.` }) : null);
}
