// Elements from plain calls. Text goes in as text, so names from files cannot become markup.

const SVG = "http://www.w3.org/2000/svg";

function fill(element, props, children) {
  for (const [name, value] of Object.entries(props || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "text") element.textContent = value;
    else if (name === "style") for (const [key, of] of Object.entries(value)) element.style.setProperty(key, of);
    else if (name === "value") element.value = value;
    else if (name === "checked") element.checked = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

export const h = (tag, props, ...children) => fill(document.createElement(tag), props, children);
export const svg = (tag, props, ...children) => fill(document.createElementNS(SVG, tag), props, children);
export const at = (id) => document.getElementById(id);

// On a phone one part of the page is seen at a time.
export const toCharts = () => document.querySelector("#tabs [data-tab=evidence]").click();

// Replaces what is in an element, and keeps the focus where it was.
export function put(element, ...children) {
  const key = element.contains(document.activeElement) ? document.activeElement.dataset.key : null;
  element.replaceChildren(...children.flat().filter(Boolean));
  if (key) element.querySelector(`[data-key="${CSS.escape(key)}"]`)?.focus({ preventScroll: true });
}

// So many significant digits, without an exponent where people would not write one.
export function digits(value, n = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  if (size < -4 || size > 6) return value.toExponential(n - 1).replaceAll("-", "−");
  return value.toFixed(Math.max(0, n - 1 - size)).replace("-", "−");
}

// A value to the digits that its error leaves it: 367.2 ± 0.4.
export function uncertain(value, error) {
  if (!(error > 0) || !Number.isFinite(error)) return digits(value, 5);
  const first = Math.floor(Math.log10(error));
  // the rule of the program's number.rs: two digits where the error begins below 3.55
  const place = error / 10 ** first < 3.55 ? first - 1 : first;
  const said = (v) => (place < 0 ? v.toFixed(Math.min(12, -place)) : String(Math.round(v / 10 ** place) * 10 ** place));
  return `${said(value)} ± ${said(error)}`.replaceAll("-", "−");
}

const rounded = (value, symbol) => `${digits(value, value < 1 ? 2 : 3)} ${symbol}`;
export const metres = (value) => rounded(value, "m");
// An error in the unit that the page shows heads in.
const METRE = { symbol: "m", per_m: 1 };
let unit = METRE;
export const showIn = (other) => { unit = other || METRE; };
export const head = (value_m) => rounded(value_m * unit.per_m, unit.symbol);
export const times = (rmse, noise) => (noise > 0 && Number.isFinite(rmse) ? `${digits(rmse / noise, rmse / noise < 10 ? 2 : 3)} × noise` : "");
export const probable = (p) => (p > 0.99 ? "> 0.99" : p < 0.01 ? "< 0.01" : p.toFixed(2));

// A parameter's name for people: without its unit, which ends it.
const SYMBOLS = { m3_s: "m³/s", mm_per_m: "mm/m", m_s: "m/s", per_GPa: "1/GPa", GPa: "GPa", degC: "°C", mm2: "mm²", mm: "mm", mL: "mL", ms: "ms", kPa: "kPa", Hz: "Hz", m: "m", s: "s", K: "K", percent: "%" };
const UNITS = new RegExp(`_(${Object.keys(SYMBOLS).join("|")})$`);
export function named(parameter) {
  const match = parameter.name.match(/^([^[]+)(\[.*\])?$/);
  return `${match[1].replace(UNITS, "").replaceAll("_", " ").replace(/\bcda$/, "CdA")}${match[2] ? ` ${match[2].slice(1, -1)}` : ""}`;
}
// The same with the unit behind it, for a line of a table.
export function withUnit(name) {
  const symbol = SYMBOLS[name.replace(/\[.*/, "").match(UNITS)?.[1]];
  return symbol ? `${named({ name })}, ${symbol}` : named({ name });
}
// Whether an error is no more than the noise, as far as a page says so.
export const atNoise = (rmse_m, noise_m) => rmse_m < 1.25 * noise_m;
// What tells a parameter from those of the same name in other runs.
export const keyOf = (p) => `${p.name} ${p.run || ""}`;
export const unitOf = ({ unit }) => (unit === "1" ? "" : unit.replace("deg", "°").replace(/([a-z])([23])\b/g, (_, of, power) => of + "²³"[power - 2]));
