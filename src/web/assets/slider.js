// A slider of a parameter. Half of it is linear and spans three standard errors on either side of the fitted value, so that a pixel there is less
// than a tenth of the error; beyond it is logarithmic and reaches the bounds. The wheel and the arrow keys move by a tenth of the error, with
// Shift by a hundredth, wherever it stands.

import { h } from "/assets/dom.js";

const STEPS = 4000;
// Of the error that a key moves by, and with Shift; of the whole span where the error is not known.
const STEP = 0.1;
const FINE = 0.1;
const UNKNOWN = 1e-3;
// The linear part: errors on either side, and the least share of the slider.
const NEAR = 3;
const HALF = 0.5;
// Of the slider, what PageUp moves by.
const PAGE = 0.05;
// How long a hand rests between keys before it counts as having let go, ms.
const RESTS_MS = 500;
// The wheel's, px: what a notch of a mouse scrolls.
const NOTCH_PX = 100;

// What lies where on a slider from `low` to `high`: `share` of a value, and the `value` of a share.
export function scale(p, low, high) {
  const log = p.log && low > 0;
  const to = log ? (value) => Math.log(Math.max(value, low)) : (value) => value;
  const back = (x) => Math.min(high, Math.max(low, log ? Math.exp(x) : x));
  const [centre, a, b] = [to(p.value), to(low), to(high)];
  const error = p.standard_error > 0 ? p.standard_error / (log ? p.value : 1) : null;
  // one step from a value, of so many tenths of its error
  const moved = (value, steps) => back(to(value) + (error === null ? UNKNOWN * (b - a) : STEP * error) * steps);
  const near = NEAR * error;
  const [from, until] = [Math.max(a, centre - near), Math.min(b, centre + near)];
  // where the error is not known, or the bounds leave the fitted value out, all of it is linear
  if (error === null || !(from < until)) return { moved, share: (value) => (to(value) - a) / (b - a || 1), value: (share) => back(a + (b - a) * share) };
  const ways = [from > a ? Math.log((centre - a) / near) : 0, until < b ? Math.log((b - centre) / near) : 0];
  const far = ways[0] + ways[1];
  const middle = Math.max(HALF, (until - from) / (until - from + near * far));
  const [left, right] = ways.map((way) => (far > 0 ? ((1 - middle) * way) / far : 0));
  return {
    moved,
    share: (value) => {
      const x = to(value);
      if (x < from) return left * (1 - Math.log((centre - x) / near) / ways[0]);
      if (x > until) return left + middle + (right * Math.log((x - centre) / near)) / ways[1];
      return left + (middle * (x - from)) / (until - from);
    },
    value: (share) => {
      if (share < left) return back(centre - near * Math.exp(ways[0] * (1 - share / left)));
      if (right > 0 && share > left + middle) return back(centre + near * Math.exp((ways[1] * (share - left - middle)) / right));
      return back(from + ((until - from) * (share - left)) / middle);
    },
  };
}

// How many decimals show the finest step.
export const decimals = (p) => (p.standard_error > 0 ? Math.min(12, Math.max(0, Math.ceil(1 - Math.log10(STEP * FINE * p.standard_error)))) : null);

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
    const { share, value } = of.scale();
    by(far ? value(Math.min(1, Math.max(0, share(of.value()) + PAGE * far))) : of.scale().moved(of.value(), way * (event.shiftKey ? FINE : 1)));
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
  return { input, show: (value) => { input.value = STEPS * of.scale().share(value); }, share: (value) => Math.min(1, Math.max(0, of.scale().share(value))) };
}
