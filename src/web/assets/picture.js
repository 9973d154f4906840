// A chart as a picture: what it shows, in the unit that it shows, with a title, a legend and the residual below.

import { svg } from "/assets/dom.js";

const [WIDTH, LEFT, RIGHT] = [900, 66, 884];
const PANES = [{ top: 52, bottom: 272 }, { top: 290, bottom: 390 }];
const HEIGHT = 424;

// Round values across a range.
export function ticks(low, high, most) {
  const raw = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((s) => s * power >= 0.999 * raw) * power;
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step - first + 1e-9) + 1 }, (_, i) => (first + i) * step);
}

const path = (times, values, x, y) => values.map((v, i) => (v === null || v === undefined ? "" : `${i && typeof values[i - 1] === "number" ? "L" : "M"}${x(times[i]).toFixed(1)} ${y(v).toFixed(1)}`)).join("");

// `plots` as uPlot has them, and `what` each shows; `names` of their series, in order; `noise` in the unit of the plots.
export function picture({ plots, title, what, names, noise }) {
  const of = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const text = (px, py, anchor, words, fill = of("--text-2")) => svg("text", { x: px, y: py, "text-anchor": anchor, fill, text: words });
  const line = (x1, x2, y1, y2) => svg("line", { x1, x2, y1, y2, stroke: of("--line") });
  const [from, to] = [plots[0].scales.x.min, plots[0].scales.x.max];
  const x = (t) => LEFT + ((RIGHT - LEFT) * (t - from)) / (to - from);
  const drawn = PANES.map(({ top, bottom }, i) => {
    const plot = plots[i];
    const [low, high] = [plot.scales.y.min, plot.scales.y.max];
    const y = (v) => bottom - ((bottom - top) * (v - low)) / (high - low);
    const within = (v) => Math.min(bottom, Math.max(top, y(v)));
    return svg("g", {},
      svg("clipPath", { id: `pane${i}` }, svg("rect", { x: LEFT, y: top, width: RIGHT - LEFT, height: bottom - top })),
      i ? svg("rect", { x: LEFT, width: RIGHT - LEFT, y: within(noise), height: within(-noise) - within(noise), fill: of("--band") }) : null,
      ticks(low, high, i ? 4 : 6).map((v) => [line(LEFT, RIGHT, y(v), y(v)), text(LEFT - 6, y(v) + 4, "end", `${+v.toPrecision(6)}`.replace("-", "−"))]).flat(),
      ticks(from, to, 9).map((t) => [line(x(t), x(t), top, bottom), i ? text(x(t), bottom + 16, "middle", `${+t.toPrecision(6)}`.replace("-", "−")) : null]).flat(),
      svg("g", { "clip-path": `url(#pane${i})`, fill: "none" }, plot.series.slice(1).map((series, n) => svg("path", {
        d: path(plot.data[0], plot.data[n + 1], x, y), stroke: series.stroke(plot, n + 1), "stroke-width": 1.3, "stroke-dasharray": series.dash?.join(" "),
      }))),
      text(LEFT, top - 6, "start", `${what[i]}${i ? "; the band is twice the noise" : ""}`));
  });
  let at = LEFT + 130;
  const legend = plots[0].series.slice(1).flatMap((series, n) => {
    if (!plots[0].data[n + 1].some((v) => v !== null)) return [];
    const stroke = series.stroke(plots[0], n + 1);
    const entry = [svg("line", { x1: at, x2: at + 22, y1: 42, y2: 42, stroke, "stroke-width": 2, "stroke-dasharray": series.dash?.join(" ") }), text(at + 28, 46, "start", names[n], of("--text"))];
    at += 52 + 7.2 * names[n].length;
    return entry;
  });
  return svg("svg", { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, width: WIDTH, height: HEIGHT, "font-family": "system-ui, sans-serif", "font-size": 12 },
    svg("rect", { width: WIDTH, height: HEIGHT, fill: of("--card") }), text(LEFT, 22, "start", title, of("--text")), legend, drawn,
    text(RIGHT, HEIGHT - 4, "end", "s after the start of the closure"));
}

export const asSvg = (drawn) => new Blob([drawn.outerHTML], { type: "image/svg+xml" });

// The same as pixels, fine enough for print.
export async function asPng(drawn, scale = 2) {
  const address = URL.createObjectURL(asSvg(drawn));
  try {
    const image = new Image();
    image.src = address;
    await image.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width: scale * WIDTH, height: scale * HEIGHT });
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    return await new Promise((done) => canvas.toBlob(done));
  } finally {
    URL.revokeObjectURL(address);
  }
}
