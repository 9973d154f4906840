// What a hostile page or script may try. Each attempt says what it saw; the server must answer a friend after it, and not have grown.
import { execFile } from "node:child_process";
import { copyFileSync, mkdirSync } from "node:fs";
import net from "node:net";
import { join } from "node:path";
import { promisify } from "node:util";
import { deflateRawSync } from "node:zlib";
import { Workbench, run, sleep } from "./workbench.mjs";

const CREEP = new URL("../../../recordings/hdpe-creep.mcap", import.meta.url).pathname;
const command = promisify(execFile);

const connect = (bench) => new Promise((done) => {
  const socket = net.connect(Number(new URL(bench.url).port), "127.0.0.1", () => done(socket));
  socket.on("error", () => done(socket));
});

// Sends bytes as they are; the status of the answer, 0 where the connection was closed without one.
function raw(bench, bytes, most_ms = 5000) {
  return new Promise(async (done) => {
    const socket = await connect(bench);
    let text = "";
    const end = () => { socket.destroy(); done(Number(text.split(" ")[1]) || 0); };
    socket.on("data", (data) => { text += data; if (text.includes("\r\n\r\n")) end(); });
    socket.on("close", end);
    setTimeout(end, most_ms).unref();
    socket.write(bytes);
  });
}

const head = (bench, method, path, more = "") => `${method} ${path} HTTP/1.1\r\nHost: ${new URL(bench.url).host}\r\nAuthorization: Bearer ${bench.token}\r\nContent-Type: application/json\r\n${more}`;

// A zip of one member of so many MB of blanks, named as a workbook's first sheet.
function bomb(megabytes) {
  const name = Buffer.from("xl/worksheets/sheet1.xml");
  const packed = deflateRawSync(Buffer.alloc(megabytes << 20, 32), { level: 9 });
  const fields = Buffer.alloc(26);
  fields.writeUInt16LE(20, 0); fields.writeUInt16LE(8, 4); fields.writeUInt32LE(packed.length, 14); fields.writeUInt32LE(megabytes << 20, 18); fields.writeUInt16LE(name.length, 22);
  const local = Buffer.concat([Buffer.from("PK\x03\x04"), fields, name, packed]);
  const central = Buffer.concat([Buffer.from("PK\x01\x02"), Buffer.from([20, 0]), fields, Buffer.alloc(14), name]);
  const end = Buffer.alloc(18);
  end.writeUInt16LE(1, 4); end.writeUInt16LE(1, 6); end.writeUInt32LE(central.length, 8); end.writeUInt32LE(local.length, 12);
  return Buffer.concat([local, central, Buffer.from("PK\x05\x06"), end]);
}

const WEIRD = [
  ["/api/simulate", '{"points": 1000000000}', [200]], ["/api/simulate", '{"points": 1e9}', [400]], ["/api/simulate", '{"points": -1}', [400]],
  ["/api/simulate", '{"set": {"wave_speed_m_s": 1e999}}', [400]], ["/api/simulate", '{"set": {"wave_speed_m_s": NaN}}', [400]],
  ["/api/simulate", '{"set": {"wave_speed_m_s": 1e-300}}', [200, 400]], ["/api/simulate", '{"set": {"wave_speed_m_s": 1e300}}', [200, 400]],
  ["/api/simulate", '{"set": {"wave_speed_m_s": -1}}', [200, 400]], ["/api/simulate", '{"set": {"wave_speed_m_s": 0}}', [200, 400]],
  ["/api/simulate", '{"set": {"closing_time_s": 1e300}}', [200, 400]], ["/api/simulate", '{"set": {"closing_time_s": 0}}', [200, 400]],
  ["/api/simulate", '{"set": {"closure_start_s": 1e300}}', [200, 400]], ["/api/simulate", '{"set": {"closure_start_s": -1e300}}', [200, 400]],
  ["/api/simulate", '{"set": {"initial_velocity_m_s": 1e300}}', [200, 400]], ["/api/simulate", '{"set": {"offset_m[P1]": 1e308}}', [200, 400]],
  ["/api/simulate", '{"from": 1e308, "to": -1e308}', [200, 400]], ["/api/simulate", '{"without": ["leak", "leak"]}', [200]],
  ["/api/simulate", `${"[".repeat(100000)}`, [400]], ["/api/simulate", `{"set": {${Array.from({ length: 5000 }, (_, i) => `"x${i}": 1`).join()}}}`, [400]],
  ["/api/simulate", "null", [400]], ["/api/simulate", '"\\ud800"', [400]], ["/api/simulate", "\u0000", [400]],
  ["/api/add", '{"effect": ""}', [202, 400]], ["/api/add", '{"effect": "../../etc/passwd"}', [202, 400]], ["/api/add", '{"effect": "viscoelastic-wall:1000000"}', [202, 400]],
  ["/api/add", '{"effect": "leak", "set": {"leak_position_m": 1e300}}', [202, 400]], ["/api/remove", '{"effect": "leak"}', [202, 400]],
  ["/api/fit", '{"bounds": {"wave_speed_m_s": [1, 0]}}', [202, 400]], ["/api/fit", '{"bounds": {"wave_speed_m_s": [-1e300, 1e300]}}', [202, 400]],
  ["/api/fit", '{"bounds": {"wave_speed_m_s": [1]}}', [400]], ["/api/fit", '{"set": {"wave_speed_m_s": 1e300}, "hold": ["wave_speed_m_s"]}', [202, 400]],
  ["/api/force", '{"model": 0}', [202, 400]], ["/api/force", '{"model": 18446744073709551615}', [202, 400]], ["/api/force", '{"model": -1}', [400]],
  ["/api/open", '{"run": "99999"}', [404]], ["/api/open", '{"run": "../run.mcap"}', [400]], ["/api/open", `{"runs": [${'"0",'.repeat(2000)}"0"]}`, [202, 400]], ["/api/open", '{"runs": []}', [404]],
  ["/api/record", '{"simulate": true, "rate_hz": 1e12, "duration_s": 1e9}', [202, 400]], ["/api/record", '{"simulate": true, "rate_hz": 1e-300}', [202, 400]],
  ["/api/record", '{"simulate": true, "rate_hz": 1000, "duration_s": 1e300}', [400]], ["/api/record", '{"simulate": true, "duration_s": -5}', [400]],
  ["/api/record", '{"simulate": true, "effects": ["no-such"]}', [400]], ["/api/record", '{"trigger": {"pre_s": 1e300, "post_s": 1}}', [400]],
  ["/api/import", '{"name": "..", "content": ""}', [400]], ["/api/import", '{"name": "a\\u0000b.csv", "content": ""}', [400]], ["/api/import", `{"name": "${"x".repeat(5000)}.csv", "content": "eA=="}`, [400]],
  ["/api/import", '{"name": "x.csv", "content": "not base64"}', [400]], ["/api/import", '{"name": "x.mcap", "content": "iU1DQVAwDQo="}', [400]], ["/api/import", '{"name": "x.tdms", "content": "VERTbQ=="}', [400]],
  ["/api/import", `{"name": "x.csv", "content": "${Buffer.from(`time_s,P1\n0,1e999\n1,nan\n`).toString("base64")}"}`, [400, 200]],
];
const ODD_QUERIES = ["run=99", "run=-1", "sensor=18446744073709551616", "from=NaN&to=NaN", "from=inf&to=-inf", "points=99999999999", "points=0", "curves=number:0,number:99,candidate:x,previous,nonsense", `curves=${"model,".repeat(3000)}model`, `sensor=all&points=20000&curves=${Array.from({ length: 300 }, (_, i) => `number:${"0".repeat(i)}1`).join()}`, "sensor=all&run=x"];

export async function hostile(program, folder) {
  const place = join(folder, "hostile");
  mkdirSync(place);
  copyFileSync(CREEP, join(place, "run.mcap"));
  const bench = await Workbench.open(program, place, "run.mcap");
  const seen = [];
  const note = async (what, found) => {
    const from = performance.now();
    const state = await bench.request("/api/state", { signal: AbortSignal.timeout(20000) }).then((answer) => answer.status, () => 0);
    seen.push({ what, found, answers: state === 200, wait: performance.now() - from, memory: bench.memory(), most: bench.most() });
  };
  try {
    await bench.fitted();
    await note("before", "");
    const idle = await Promise.all(Array.from({ length: 400 }, () => connect(bench)));
    idle.forEach((socket) => socket.write("GET / HTTP/1.1\r\nHost: x\r\nX-Slow: "));
    const held = performance.now();
    await raw(bench, head(bench, "GET", "/api/effects", "\r\n"), 60000);
    await note("400 connections that never end their head (slowloris)", `a friend waited ${((performance.now() - held) / 1000).toFixed(0)} s`);
    idle.forEach((socket) => socket.destroy());
    const large = await raw(bench, head(bench, "GET", "/api/state", `X-Large: ${"x".repeat(10 << 20)}\r\n\r\n`));
    const many = await raw(bench, head(bench, "GET", "/api/state", `${Array.from({ length: 20000 }, (_, i) => `X-${i}: y\r\n`).join("")}\r\n`));
    await note("a head of 10 MB, one of 20,000 lines", `${large}, ${many}`);
    const long = await raw(bench, head(bench, "POST", "/api/simulate", "Content-Length: 104857600\r\n\r\n"));
    const chunk = `100000\r\n${"x".repeat(1 << 20)}\r\n`;
    const chunked = await raw(bench, head(bench, "POST", "/api/simulate", `Transfer-Encoding: chunked\r\n\r\n${chunk.repeat(100)}`));
    await note("a body of 100 MB, announced and in chunks", `${long}, ${chunked}`);
    const drips = await Promise.all(Array.from({ length: 100 }, async () => { const socket = await connect(bench); socket.write(head(bench, "POST", "/api/simulate", "Content-Length: 200000\r\n\r\n{")); return socket; }));
    await note("100 bodies that never come", "");
    drips.forEach((socket) => socket.destroy());
    const streams = await Promise.all(Array.from({ length: 290 }, async () => { const socket = await connect(bench); socket.write(head(bench, "GET", "/api/events", "\r\n")); return socket; }));
    await note("290 streams of events that nobody reads", "");
    streams.forEach((socket) => socket.destroy());
    await sleep(300);
    const posts = await Promise.all(Array.from({ length: 250 }, (_, i) => bench.request("/api/simulate", { method: "POST", body: JSON.stringify({ set: { wave_speed_m_s: 300 + i }, points: 20000 }) }).then(async (a) => { await a.arrayBuffer(); return a.status; }, () => 0)));
    await note("250 simulations at once", [...new Set(posts)].join());
    const odd = [];
    for (const [path, body, allowed] of WEIRD) {
      const from = performance.now();
      const answer = await bench.request(path, { method: "POST", body, signal: AbortSignal.timeout(30000) }).then(async (a) => [a.status, await a.text()], (error) => [0, String(error)]);
      if (!allowed.includes(answer[0]) || performance.now() - from > 5000) odd.push(`${path} ${body.slice(0, 60)}: ${answer[0]} ${answer[1].slice(0, 100)} (${(performance.now() - from).toFixed(0)} ms)`);
      await bench.request("/api/record/stop", { method: "POST", body: "{}" });
      await bench.request("/api/cancel", { method: "POST", body: "{}" });
      for (let i = 0; i < 100 && (await bench.get("/api/state")).job; i++) await sleep(100);
    }
    await note(`${WEIRD.length} bodies of weird JSON, numbers and names`, odd.join("; ") || "each refused or bounded");
    const queries = [];
    for (const query of ODD_QUERIES) {
      const answer = await bench.request(`/api/curves?${query}`, { signal: AbortSignal.timeout(20000) }).then(async (a) => { await a.arrayBuffer(); return a.status; }, () => 0);
      if (![200, 400, 404].includes(answer)) queries.push(`${query.slice(0, 40)}: ${answer}`);
    }
    await note(`${ODD_QUERIES.length} odd queries`, queries.join("; ") || "each refused or bounded");
    // making them keeps this program from its connections, which the server gives up meanwhile
    const workbook = bomb(2000);
    const file = (content, name) => bench.request("/api/import", { method: "POST", headers: { Connection: "close" }, body: JSON.stringify({ name, content: content.toString("base64") }), signal: AbortSignal.timeout(120000) }).then((a) => a.status, (error) => String(error.cause || error));
    await sleep(500);
    const bombs = await Promise.all([file(workbook, "bomb.xlsx"), file(workbook, "bomb.ods"), file(Buffer.alloc(30 << 20, 44), "commas.csv"), file(Buffer.alloc(30 << 20, 48), "zeros.csv"), file(Buffer.from(`time_s${",x".repeat(1 << 20)}\n`), "wide.csv")]);
    await note("files that unpack to 2 GB, or are nothing but commas, zeros or columns", bombs.join());
    await writers(bench, program, place);
    await note("the page and a command that write one file of models, 20 times each", `${run(program, place, "model", "run.model.toml", "--json").models.length} models, whole`);
    return seen;
  } finally {
    await bench.stop();
  }
}

// The page adds and undoes while the command does; each must find the file whole.
async function writers(bench, program, place) {
  const job = async (path, body) => {
    const answer = await bench.request(path, { method: "POST", body: JSON.stringify(body) });
    if (answer.status !== 202 && answer.status !== 409) throw new Error(`${path}: ${answer.status}`);
    for (let i = 0; i < 200 && (await bench.get("/api/state")).job; i++) await sleep(20);
  };
  await job("/api/add", { effect: "unsteady-friction" });
  // what has changed under a command's hands, or has no step before it, is refused
  const refused = (error) => { if (!/first model|no step|has changed while/.test(error.stderr || "")) throw error; };
  const by_command = async () => { for (let i = 0; i < 20; i++) await command(program, [i % 2 ? "undo" : "refit", "run.model.toml"], { cwd: place }).catch(refused); };
  const by_page = async () => { for (let i = 0; i < 20; i++) await job(i % 2 ? "/api/undo" : "/api/fit", {}); };
  await Promise.all([by_command(), by_page()]);
}
