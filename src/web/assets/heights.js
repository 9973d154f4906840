// How high the charts are: all that there are share the pane as long as each can be read; more than those scroll.

import { at } from "/assets/dom.js";

// The charts as they stand one below the other.
export const cards = [];

// Of the curves and of the residual, px, where they scroll.
const SCROLLED = [164, 100];
// Of both together where they share the pane; the curves' part of it.
const LEAST_PX = 104;
const MOST_PX = 560;
const CURVES = 0.58;
// The time axis, and from which height on each chart has its own and not the last alone.
export const AXIS_PX = 20;
const OWN_AXIS_PX = 190;
// Padding and border of a card on either side; between cards; what a card needs beside its plots.
const CARD_PX = 13;
const GAP_PX = 8;
const FRAME_PX = 34;

const wide = matchMedia("(min-width: 701px)");
let [width, shared] = [0, null];

function share() {
  if (!wide.matches) return null;
  const [pane, rig] = [at("evidence"), at("rig-card")];
  const style = getComputedStyle(pane);
  const used = parseFloat(style.paddingTop) + parseFloat(style.paddingBottom) + (rig.hidden ? 0 : rig.offsetHeight + GAP_PX);
  const { card, box } = cards[0];
  const frame = box.isConnected ? card.offsetHeight - box.offsetHeight : FRAME_PX;
  const free = pane.clientHeight - used - cards.length * (frame + GAP_PX);
  const [each, last] = [free / cards.length - AXIS_PX, (free - AXIS_PX) / cards.length];
  if (last < LEAST_PX) return null;
  return Math.floor(Math.min(MOST_PX, each >= OWN_AXIS_PX ? each : Math.min(OWN_AXIS_PX - 1, last)));
}

export const hasAxis = (panel) => shared === null || shared >= OWN_AXIS_PX || panel === cards.at(-1);

// Of a chart's curves, and of its residual with the axis.
export function heights(panel) {
  if (shared === null) return SCROLLED;
  const curves = Math.round(CURVES * shared);
  return [curves, shared - curves + (hasAxis(panel) ? AXIS_PX : 0)];
}

export const widthOf = () => width;

// Told once a width has come to rest.
const RESTS_MS = 250;
let later = null;
let wider = () => {};
export const whenWider = (work) => { wider = work; };

// One look at the pane for all charts: when they are laid, and when the pane, the window or the drawing of the rig changes.
export function measure() {
  if (!cards.length) return;
  const now = [Math.max(240, at("charts").clientWidth - 2 * CARD_PX), share()];
  const first = !cards[0].box.style.minHeight;
  if (now[0] === width && now[1] === shared && !first) return;
  if (now[0] !== width) {
    clearTimeout(later);
    later = setTimeout(() => wider(), RESTS_MS);
  }
  [width, shared] = now;
  for (const panel of cards) {
    const [curves, residual] = heights(panel);
    // kept free until it is drawn
    panel.box.style.minHeight = `${curves + residual}px`;
    panel.plots.forEach((plot, i) => plot.setSize({ width, height: i ? residual : curves }));
  }
}
const sizes = new ResizeObserver(measure);
["evidence", "charts", "rig-card"].forEach((id) => sizes.observe(at(id)));
