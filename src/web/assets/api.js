// The server: requests, curves as arrays, events.

export const AWAY = "The workbench does not answer. The page goes on when the connection is back. If `surgescope open` has ended, start it again and open the address that it prints: the models that you made are in their file.";
const reach = (path, options) => fetch(path, options).catch(() => { throw new Error(AWAY); });

export async function ask(path) {
  return checked(await reach(path));
}

export async function post(path, body = {}) {
  const answer = await reach(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
  return checked(answer);
}

async function checked(answer) {
  const body = await answer.json().catch(() => ({ error: `the workbench answered ${answer.status}` }));
  if (!answer.ok) throw new Error(body.error);
  return body;
}

// A line of JSON that says what follows, then its columns of numbers. What is no number is null, as the charts want it.
async function unpacked(answer) {
  if (!answer.ok) return checked(answer);
  const bytes = await answer.arrayBuffer();
  const length = new DataView(bytes).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  const points = new Map((head.sensors || []).map((s, i) => ["run" in s ? `${s.run}/${s.sensor}` : String(i), s.points]));
  let from = 4 + length;
  head.column = {};
  for (const name of head.columns) {
    // a label has slashes, too
    const count = head.points ?? points.get(/^\d+(\/\d+)?(?=\/)/.exec(name)?.[0]);
    head.column[name] = Array.from(new Float64Array(bytes, from, count), (v) => (Number.isFinite(v) ? v : null));
    from += 8 * count;
  }
  return head;
}

async function stretch(path, asked, range) {
  const query = new URLSearchParams({ ...asked, ...(range && { from: range[0], to: range[1] }) });
  return unpacked(await reach(`${path}?${query}`));
}

// Those of all sensors by one request: the server simulates each model once.
export async function curves(range, points, names) {
  return stretch("/api/curves", { sensor: "all", points, curves: names.join(",") }, range);
}

export async function compared(runs, range, points) {
  return stretch("/api/compare", { runs: runs.join(","), points }, range);
}

export async function simulate(question) {
  const headers = { "Content-Type": "application/json", Accept: "application/octet-stream" };
  return unpacked(await reach("/api/simulate", { method: "POST", headers, body: JSON.stringify(question) }));
}

// Events as they come. A browser opens six connections to a host, so one page listens and tells the others; when it is closed another takes over.
// A fit tells its errors faster than anyone can look: the handler of `progress` gets a list of them from time to time, and leaves the fit the processor.
const GATHERED_MS = 200;
export const AGAIN_MS = 3000;
export function listen(handlers) {
  const others = new BroadcastChannel("events");
  const hear = (name, data) => handlers[name]?.(data);
  others.addEventListener("message", ({ data }) => hear(...data));
  const tell = (name, data) => { hear(name, data); others.postMessage([name, data]); };
  let gathered = [];
  const flush = () => { if (gathered.length) tell("progress", gathered); gathered = []; };
  const stream = () => {
    // it comes back by itself after a break, but not where a program started anew knows the page no longer
    const source = new EventSource("/api/events");
    source.addEventListener("error", () => source.readyState === EventSource.CLOSED && setTimeout(stream, AGAIN_MS));
    Object.keys(handlers).forEach((name) => source.addEventListener(name, (event) => {
      const data = event.data ? JSON.parse(event.data) : null;
      if (name === "progress") {
        if (gathered.push(data) === 1) setTimeout(flush, GATHERED_MS);
        return;
      }
      flush();
      tell(name, data);
    }));
  };
  // a page that came over a network has no locks, and listens for itself
  if (navigator.locks) navigator.locks.request("events", () => { stream(); return new Promise(() => {}); });
  else stream();
}
