// A slider of a parameter: linear within the standard error of its fitted value and logarithmic beyond, so that interval and bounds are both on
// it, and a step of the mouse near the fit is less than a tenth of the error. The wheel and the arrow keys move by a tenth, with Shift by a
// hundredth, wherever it stands.

import { h } from "/assets/dom.js";

const STEPS = 4000;
// Of the error that a key moves by, and with Shift; of the whole span where the error is not known.
const STEP = 0.1;
const FINE = 0.1;
const UNKNOWN = 1e-3;
// How long a hand rests between keys before it counts as having let go, ms.
const RESTS_MS = 500;
// The wheel's, px: what a notch of a mouse scrolls.
const NOTCH_PX = 100;

// `low` and `high` bound the slider; `value` is where a share of it lies, `share` the inverse.
export function scale(p, low, high) {
  const log = p.log && low > 0;
  const to = log ? (value) => Math.log(Math.max(value, low)) : (value) => value;
  const back = log ? Math.exp : (x) => x;
  const [centre, a, b] = [to(p.value), to(low), to(high)];
  const error = p.standard_error > 0 ? p.standard_error / (log ? p.value : 1) : b - a;
  const at = (x) => Math.asinh((x - centre) / error);
  const [from, to_] = [at(a), at(b)];
  return {
    share: (value) => Math.min(1, Math.max(0, (at(to(value)) - from) / (to_ - from || 1))),
    value: (share) => (share <= 0 ? low : share >= 1 ? high : back(centre + error * Math.sinh(from + (to_ - from) * share))),
    // one step from a value, of so many tenths of its error; larger ones follow the scale
    moved: (value, steps) => {
      const by = (p.standard_error > 0 ? STEP * error : UNKNOWN * (b - a)) * steps;
      return Math.min(high, Math.max(low, back(to(value) + by)));
    },
    far: (value, way) => Math.min(high, Math.max(low, back(centre + error * Math.sinh(at(to(value)) + way)))),
  };
}

// How many decimals show the finest step.
export const decimals = (p) => (p.standard_error > 0 ? Math.min(12, Math.max(0, Math.ceil(-Math.log10(STEP * FINE * p.standard_error)))) : null);

const WAY = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };
const FAR = { PageDown: -1, PageUp: 1 };

// The slider and its field. `of` gives the scale as it stands and the value; `move` is called while it moves, `release` when a hand has let go.
export function slider({ label, of, move, release, field }) {
  const input = h("input", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": label, title: "arrow keys or wheel: a tenth of the error; with Shift a hundredth; PageUp and PageDown: far",
    oninput: () => move(of.scale().value(input.valueAsNumber / STEPS)), onchange: release });
  let rests = null;
  const by = (value) => {
    move(value);
    clearTimeout(rests);
    rests = setTimeout(release, RESTS_MS);
  };
  const keys = (event) => {
    const [way, far] = [WAY[event.key], FAR[event.key]];
    if ((!way && !far) || event.ctrlKey || event.metaKey || event.altKey) return;
    // in a field left and right belong to the text
    if (event.target === field && (event.key === "ArrowLeft" || event.key === "ArrowRight")) return;
    event.preventDefault();
    by(far ? of.scale().far(of.value(), far) : of.scale().moved(of.value(), way * (event.shiftKey ? FINE : 1)));
  };
  // a page that is scrolled moves nothing: the wheel is the slider's once it has the focus
  const wheel = (event) => {
    if (document.activeElement !== event.currentTarget || input.disabled) return;
    event.preventDefault();
    // with Shift a browser turns the wheel sideways
    const turned = event.deltaY || event.deltaX;
    const notches = event.deltaMode ? Math.sign(turned) : turned / NOTCH_PX;
    by(of.scale().moved(of.value(), -notches * (event.shiftKey ? FINE : 1)));
  };
  for (const one of [input, field]) {
    one.addEventListener("keydown", keys);
    one.addEventListener("wheel", wheel, { passive: false });
  }
  return { input, show: (value) => { input.value = STEPS * of.scale().share(value); }, share: (value) => 100 * of.scale().share(value) };
}
