// Fingers on a chart: two spread the time axis, one moves it along. Up and down scroll the page as ever.

// `over` is the area of a plot; `span` tells the range that is shown, `zoom` sets it.
export function fingers(over, span, zoom) {
  const down = new Map();
  let start = null;
  const begin = () => {
    const [low, high] = span();
    const { left, width } = over.getBoundingClientRect();
    const time = (x) => low + ((high - low) * (x - left)) / width;
    start = { left, width, per_px: (high - low) / width, times: new Map([...down].map(([id, x]) => [id, time(x)])) };
  };
  const move = (event) => {
    if (!down.has(event.pointerId)) return;
    down.set(event.pointerId, event.clientX);
    const { left, width, per_px, times } = start;
    // what was under each finger stays under it
    const [[one, x], [two, other] = []] = [...down].slice(0, 2);
    const apart = other - x;
    const spread = two !== undefined && Math.abs(apart) > 8 ? (times.get(two) - times.get(one)) / apart : per_px;
    if (!(spread > 0)) return;
    const low = times.get(one) - (x - left) * spread;
    zoom([low, low + width * spread]);
  };
  const end = (event) => { down.delete(event.pointerId); begin(); };
  over.addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "touch") return;
    down.set(event.pointerId, event.clientX);
    begin();
  });
  over.addEventListener("pointermove", move);
  ["pointerup", "pointercancel"].forEach((name) => over.addEventListener(name, end));
}
