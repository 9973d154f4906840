// Turns each sensor's data into charts with one time axis: head above, model - measured below, a chart with a scale of its own for each model.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3], [12, 5]];
  const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";
  const narrow = () => window.innerWidth < 640;
  const charts = [];
  // Heads are in m or, by the switch above the sensors, as each sensor shows them: per_m * head + zero.
  const METRES = { name: "m", per_m: 1, zero: 0 };
  let own = false;
  const unitOf = (panel) => (own && panel.unit) || METRES;
  const switched = [];

  const digits = (step) => Math.max(0, Math.min(9, Math.ceil(-Math.log10(step) - 1e-9)));
  // Decimals that write a step exactly: marks stand 2.5 apart as well.
  const exact = (step) => {
    const whole = (x) => Math.round(x) > 0 && Math.abs(x - Math.round(x)) < 1e-6 * x;
    const found = [0, 1, 2, 3, 4, 5, 6, 7, 8].find((n) => whole(step * 10 ** n));
    return found ?? 9;
  };
  const fixed = (v, n) => (v == null ? "–" : v.toFixed(n).replace("-", "\u2212"));
  const labels = (u, splits, axis, space, step) => splits.map((v) => fixed(v, exact(step)).replace(/^\u2212(0(\.0+)?)$/, "$1"));

  // The index of the nearest sample that a series has, since overlays bring times of their own; none where it has ended.
  const nearest = (u, series, at, x) => {
    const ys = u.data[series], xs = u.data[0];
    if (ys[at] !== undefined) return at;
    let a = at, b = at;
    while (a > 0 && ys[a] === undefined) a--;
    while (b < xs.length - 1 && ys[b] === undefined) b++;
    const best = ys[a] === undefined || (ys[b] !== undefined && xs[b] - x < x - xs[a]) ? b : a;
    return Math.abs(u.valToPos(xs[best], "x") - u.valToPos(x, "x")) < 20 ? best : null;
  };

  const axes = (label) => [
    { stroke: () => css("--soft"), grid: { stroke: () => css("--grid"), width: 1 }, ticks: { stroke: () => css("--rule"), size: 5 },
      font: FONT, values: labels, space: 70, size: 28, gap: 4,
      ...(label ? { label, labelFont: FONT, labelSize: 20, labelGap: 0 } : {}) },
    { stroke: () => css("--soft"), grid: { stroke: () => css("--grid"), width: 1 }, ticks: { stroke: () => css("--rule"), size: 5 },
      font: FONT, values: labels, size: 58, space: 32, gap: 4 },
  ];

  function swatch(s) {
    const mark = s.band
      ? `<rect y="1" width="26" height="10" fill="var(--band)"/>`
      : s.points
      ? `<circle cx="13" cy="6" r="3" fill="var(${s.colour})"/>`
      : `<path d="M0 6h26" stroke="var(${s.colour})" stroke-width="${Math.max(2, s.width)}" stroke-dasharray="${s.dash.join(" ")}"/>`;
    return `<svg width="26" height="12" aria-hidden="true">${mark}</svg>`;
  }

  // One button a series; pressed means shown. Values follow the cursor.
  function legend(element, chart, series, options) {
    const values = series.map((s, i) => {
      if (s.lower) return null; // its button is that of the band's upper edge
      const button = document.createElement("button");
      button.type = "button";
      button.setAttribute("aria-pressed", s.show);
      button.innerHTML = swatch(s);
      button.append(s.label);
      const value = button.appendChild(document.createElement("output"));
      button.addEventListener("click", () => {
        const show = !chart.series[i + 1].show;
        button.setAttribute("aria-pressed", show);
        chart.setSeries(i + 1, { show });
        if (s.band) chart.setSeries(i + 2, { show });
      });
      element.append(button);
      return value;
    });
    return () => values.forEach((value, i) => {
      if (!value || series[i].band) return;
      const at = chart.cursor.idxs && chart.cursor.idxs[i + 1];
      const v = at == null ? null : chart.data[i + 1][at];
      value.textContent = v == null ? "" : `${fixed(v, options.decimals())} ${options.unit()}`;
    });
  }

  function plot(element, legendElement, points, series, options) {
    const height = () => (narrow() ? options.low : options.high);
    let refresh = () => {};
    const chart = new uPlot({
      width: element.clientWidth, height: height(), pxAlign: 0,
      legend: { show: false },
      padding: [10, 12, 0, 0],
      scales: { x: { time: false }, y: { range: options.range } },
      axes: axes(options.xLabel),
      cursor: {
        sync: { key: options.key, filters: { pub: (type) => type === "mousemove" || type === "mouseleave" } },
        drag: { x: true, y: false, dist: 5 },
        bind: { dblclick: () => () => { options.reset(); return null; } },
        dataIdx: nearest,
        points: { size: 7 },
      },
      series: [{}, ...series.map((s) => ({
        label: s.label, show: s.show, width: s.width, spanGaps: false, dash: s.dash.length ? s.dash : undefined,
        stroke: () => css(s.colour), paths: s.points ? () => null : undefined,
        points: s.points ? { show: true, size: 5, fill: () => css(s.colour), width: 0 } : { show: false },
      }))],
      bands: series.flatMap((s, i) => (s.band ? [{ series: [i + 1, i + 2], fill: () => css("--band") }] : [])),
      hooks: {
        setCursor: [() => refresh()],
        setScale: [(u, key) => key === "x" && options.zoomed(u)],
        draw: [(u) => options.over && options.over(u)],
      },
    }, points, element);
    refresh = legend(legendElement, chart, series, options);
    element.chart = chart;
    new ResizeObserver(() => {
      if (element.clientWidth > 0) chart.setSize({ width: element.clientWidth, height: height() });
    }).observe(element);
    charts.push(chart);
    return chart;
  }

  // Lines at two standard deviations of the noise: a perfect model's residual stays between them 19 times out of 20.
  const limits = (noise) => (u) => {
    if (!(noise() > 0)) return;
    const { left, width, top, height } = u.bbox, scale = uPlot.pxRatio;
    u.ctx.save();
    u.ctx.strokeStyle = css("--text");
    u.ctx.lineWidth = 1.25 * scale;
    u.ctx.setLineDash([5 * scale, 4 * scale]);
    for (const level of [2 * noise(), -2 * noise()]) {
      const y = u.valToPos(level, "y", true);
      if (y < top || y > top + height) continue;
      u.ctx.beginPath();
      u.ctx.moveTo(left, y);
      u.ctx.lineTo(left + width, y);
      u.ctx.stroke();
    }
    u.ctx.restore();
  };

  // Where a model begins to predict.
  const ahead = (u) => {
    if (data.ahead_from == null) return;
    const { left, width, top, height } = u.bbox, x = u.valToPos(data.ahead_from, "x", true);
    if (x < left || x > left + width) return;
    u.ctx.save();
    u.ctx.strokeStyle = u.ctx.fillStyle = css("--text");
    u.ctx.lineWidth = 1.25 * uPlot.pxRatio;
    u.ctx.beginPath();
    u.ctx.moveTo(x, top);
    u.ctx.lineTo(x, top + height);
    u.ctx.stroke();
    u.ctx.font = `${12 * uPlot.pxRatio}px system-ui, sans-serif`;
    u.ctx.textBaseline = "top";
    u.ctx.fillText("predicted from here", x + 6 * uPlot.pxRatio, top + 4 * uPlot.pxRatio);
    u.ctx.restore();
  };

  function build(live) {
    const index = live.dataset.panel, p = data.panels[index];
    live.hidden = false;
    const stage = (s, show, width) => ({ label: s.title, colour: `--s${s.colour}`, dash: DASHES[s.colour], width, show });
    const head = [{ label: "measured", colour: "--measured", dash: [], width: 6, show: true },
      ...data.stages.map((s) => stage(s, true, 1.5)),
      ...p.overlays.map((o) => ({ label: o.label, colour: "--overlay", dash: [], width: 0, show: true, points: true }))];
    // Upper and lower edge of the band around the last model.
    const edges = (middle) => [1, -1].map((sign) => p.band.map((half, k) => (half == null || middle(k) == null ? null : middle(k) + sign * half)));
    const edge = { colour: "--band", dash: [], width: 0, show: true };
    const banded = p.band.length > 0 ? [{ ...edge, label: "95% band", band: true }, { ...edge, label: "", lower: true }] : [];
    head.push(...banded);
    const last = p.models[p.models.length - 1];
    const rests = p.models.map((m) => ({ points: [p.x, m.map((v, k) => (v == null || p.measured[k] == null ? null : v - p.measured[k]))], banded: m === last ? banded : [] }));
    let headPoints = [p.x, p.measured, ...p.models];
    if (p.overlays.length) headPoints = uPlot.join([headPoints, ...p.overlays.map((o) => [o.x, o.y])]);
    if (banded.length) {
      const around = edges((k) => last[k]);
      headPoints = p.overlays.length ? uPlot.join([headPoints, [p.x, ...around]]) : [...headPoints, ...around];
      rests.at(-1).points.push(...edges(() => 0));
    }

    const full = { min: headPoints[0][0], max: headPoints[0][headPoints[0].length - 1] };
    if (!(full.max > full.min)) full.max = full.min + 1;
    const charted = [];
    const show = (range) => charted.forEach((u) => u.setScale("x", range));
    const zoomed = (u) => {
      const { min, max } = u.scales.x;
      for (const other of charted) {
        if (other !== u && (other.scales.x.min !== min || other.scales.x.max !== max)) other.setScale("x", { min, max });
      }
    };
    const noise = () => (p.noise || 0) * unitOf(p).per_m;
    const clear = () => (noise() > 0 ? Math.min(6, digits(noise()) + 1) : 3);
    const inUnit = (columns, zero) => columns.map((c, i) => (i === 0 ? c : c.map((v) => (v == null ? v : v * unitOf(p).per_m + zero))));
    const shared = { key: `panel-${index}`, zoomed, reset: () => show(full), unit: () => unitOf(p).name };
    const element = (name) => live.querySelector(name);
    charted.push(plot(element(".plot.head"), element('.legend[data-of="head"]'), headPoints, head,
      { ...shared, high: 320, low: 250, decimals: () => Math.max(0, clear() - 1), over: ahead, range: (u, min, max) => padded(min, max) }));
    rests.forEach(({ points, banded }, i) => charted.push(plot(element(`.plot.residual[data-stage="${i}"]`), element(`.legend[data-of="residual-${i}"]`), points, [stage(data.stages[i], true, 1), ...banded],
      { ...shared, high: 220, low: 190, decimals: clear, over: (u) => { limits(noise)(u); ahead(u); }, xLabel: i === rests.length - 1 ? "time after the start of the closure, s" : null,
        range: (u, min, max) => padded(Math.min(min ?? 0, -2.5 * noise()), Math.max(max ?? 0, 2.5 * noise())) })));
    show(full);
    switched.push(() => {
      const { min, max } = charted[0].scales.x;
      charted[0].setData(inUnit(headPoints, unitOf(p).zero), false);
      rests.forEach(({ points }, i) => charted[i + 1].setData(inUnit(points, 0), false));
      show({ min, max });
      texts(live.closest(".sensor"), unitOf(p));
    });

    if (p.noise > 0) {
      const key = element('.legend[data-of="residual-0"]').appendChild(document.createElement("span"));
      key.className = "key";
      key.innerHTML = swatch({ colour: "--text", width: 1, dash: [5, 4] });
      key.append("\u00b12 × noise");
    }
    const time = element('.legend[data-of="head"]').appendChild(document.createElement("span"));
    time.className = "time";
    charted[0].hooks.setCursor.push((u) => {
      time.textContent = u.cursor.left >= 0 ? `t = ${fixed(u.posToVal(u.cursor.left, "x"), 4)} s` : "";
    });
    // The same by buttons, for keyboards and touch screens.
    const move = (factor, shift) => () => {
      const { min, max } = charted[0].scales.x, width = Math.min(full.max - full.min, (max - min) * factor);
      let from = (min + max) / 2 - width / 2 + shift * (max - min);
      from = Math.max(full.min, Math.min(full.max - width, from));
      show({ min: from, max: from + width });
    };
    for (const [text, name, act] of [["\u2039", "Earlier", move(1, -0.4)], ["\u203a", "Later", move(1, 0.4)],
      ["\u2212", "Zoom out", move(2, 0)], ["+", "Zoom in", move(0.5, 0)], ["All", "Whole record", shared.reset]]) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = text;
      button.title = name;
      button.setAttribute("aria-label", name);
      button.addEventListener("click", act);
      element(".buttons").append(button);
    }
  }

  // The same heads in text and tables. A value keeps the digits that it has in m.
  function texts(section, unit) {
    for (const e of section.querySelectorAll("data")) {
      e.dataset.m ??= e.textContent;
      const decimals = (e.dataset.m.split(".")[1] ?? "").length - Math.round(Math.log10(unit.per_m));
      const v = e.value * unit.per_m + (e.classList.contains("level") ? unit.zero : 0);
      const sign = e.classList.contains("signed") && v > 0 ? "+" : "";
      e.textContent = unit === METRES ? e.dataset.m : sign + fixed(v, Math.max(0, decimals));
    }
    section.querySelectorAll(".unit").forEach((e) => { e.textContent = unit.name; });
    section.querySelectorAll(".quantity").forEach((e) => { e.textContent = unit === METRES ? "Head" : "Pressure"; });
    for (const e of section.querySelectorAll("th")) {
      e.dataset.m ??= e.textContent;
      e.textContent = e.dataset.m.replace(/, m$/, `, ${unit.name}`);
    }
  }

  // One switch for all sensors; paper always has m, as its still pictures do.
  function units(line) {
    const use = (to) => {
      own = to;
      switched.forEach((change) => change());
      buttons.forEach(([button, of]) => button.setAttribute("aria-pressed", of === own));
    };
    const buttons = [["m", false], [`each sensor's own unit (${line.dataset.own})`, true]].map(([text, of]) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = text;
      button.setAttribute("aria-pressed", of === own);
      button.addEventListener("click", () => use(of));
      line.append(button, " ");
      return [button, of];
    });
    line.hidden = false;
    let before = own;
    window.addEventListener("beforeprint", () => { before = own; use(false); });
    window.addEventListener("afterprint", () => use(before));
  }

  // A button that copies a command; a click on the command itself selects it whole.
  function copy(command) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "Copy";
    button.addEventListener("click", async () => {
      try {
        await navigator.clipboard.writeText(command.textContent);
        button.textContent = "Copied";
      } catch {
        window.getSelection().selectAllChildren(command);
        button.textContent = "Selected";
      }
      setTimeout(() => { button.textContent = "Copy"; }, 2000);
    });
    command.after(button);
  }

  function padded(min, max) {
    if (!Number.isFinite(min) || !Number.isFinite(max)) return [0, 1];
    const pad = max > min ? 0.06 * (max - min) : Math.abs(max) * 0.05 || 1;
    return [min - pad, max + pad];
  }

  for (const live of document.querySelectorAll(".live")) {
    try {
      build(live);
    } catch (error) {
      live.hidden = true; // the still picture stays
      console.error(error);
    }
  }
  document.querySelectorAll(".units").forEach(units);
  document.querySelectorAll(".command").forEach(copy);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => charts.forEach((u) => u.redraw(false, true)));
})();
