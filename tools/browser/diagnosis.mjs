// What the page of a diagnosis must show, beside what every report does. `answer` is the document of `diagnose --json` that was written
// with the page; without it the page is only held against itself.

const near = (a, b, tolerance = 1e-6) => Math.abs(a - b) <= tolerance;
const number = (text) => Number(text.replace("\u2212", "-"));
const sorted = (values) => values.every((v, i) => i === 0 || v <= values[i - 1] + 1e-9);

export async function diagnosis(page, check, answer) {
  const data = JSON.parse(await page.textContent("#data"));
  const verdict = await page.$eval("body", (b) => b.dataset.verdict);
  const sensors = data.panels.length;
  // One more model where no effect explains what is left: that with the nearest effect, if it could be fitted.
  const models = await page.$$eval(".stairs .step:not(.scale)", (all) => all.length);
  check("the staircase has a step a model", models === data.stages.length || (verdict === "unknown-effect" && models === data.stages.length + 1), `${models} steps`);
  if (answer) check("the verdict is that of the answer", verdict === answer.verdict, verdict);

  const wanted = ["errors", "ranking", "failings", "heat", "spectrum", "sensors", "parameters", "correlation", "energy", "computation", "rig"];
  if (verdict !== "nothing-missing" || models > 1) wanted.push("signature");
  const there = await page.$$eval("section[id]", (all) => all.filter((s) => s.checkVisibility() && s.offsetHeight > 40).map((s) => s.id));
  check("every section is there", wanted.every((id) => there.includes(id)), wanted.filter((id) => !there.includes(id)).join(" "));
  const links = await page.$$eval("nav.contents a", (all) => all.map((a) => a.getAttribute("href").slice(1)));
  check("the contents lead to all of them", wanted.every((id) => links.includes(id)), links.join(" "));

  await staircase(page, check, models);
  await ranking(page, check, answer);
  await failings(page, check, answer);
  await heat(page, check, sensors, models);
  await figures(page, check, sensors);
  await correlation(page, check);
  await energy(page, check);
  check("a parameter has its standard error", await page.$$eval("#parameters tbody tr", (rows) => rows.length > 4 && rows.some((r) => /\d\(\d+\)/.test(r.textContent))));
}

async function staircase(page, check, models) {
  const steps = await page.$$eval(".stairs .step:not(.scale)", (all) => all.map((s) => {
    const middle = (e) => { const box = e?.getBoundingClientRect(); return box && (box.left + box.right) / 2; };
    return { dot: middle(s.querySelector(".dot")), floor: middle(s.querySelector(".floor")),
      rmse: Number(s.querySelector("strong").textContent.replace(" m", "")), times: s.querySelector("small").textContent };
  }));
  check("every step has a dot and the noise as its floor", steps.length === models && steps.every((s) => s.dot > 0 && s.floor > 0), JSON.stringify(steps));
  check("the dots descend", sorted(steps.map((s) => s.dot)) && sorted(steps.map((s) => s.rmse)), JSON.stringify(steps));
  check("a dot passes the floor where its error passes the noise", steps.every((s) => {
    const ratio = parseFloat(s.times);
    return ratio < 0.98 ? s.dot < s.floor : ratio > 1.1 ? s.dot > s.floor : true;
  }), JSON.stringify(steps));
}

async function ranking(page, check, answer) {
  const groups = await page.$eval("#ranking", (section) => {
    const groups = [];
    for (const e of section.children) {
      if (e.tagName === "H3") groups.push({ heading: e.textContent, rows: [], next: [] });
      const group = groups.at(-1);
      if (!group) continue;
      for (const row of e.querySelectorAll("tbody tr:has([data-probability])")) {
        // An effect of a pair shows how likely it is to be missing alone; the answer counts the pair as well.
        group.rows.push({ isPair: row.querySelector("strong.pair") !== null, isMember: row.querySelector("[data-probability] + small") !== null, effect: (row.querySelector("code") ?? row.cells[0]).textContent, probability: Number(row.querySelector("[data-probability]").dataset.probability),
          width: row.querySelector(".probability i").style.width, parameters: row.cells[5].textContent });
      }
      if (e.classList.contains("next")) group.next.push(e.textContent);
    }
    return groups;
  });
  check("a ranking a diagnosis, each with its next test", groups.length > 0 && groups.every((g) => g.rows.length > 1 && g.next.length === 1), groups.map((g) => g.heading).join(" | "));
  for (const { heading, rows } of groups) {
    const candidates = rows.filter((r) => r.effect !== "none of these");
    const pairs = candidates.filter((r) => r.isPair).length;
    // The first row is the answer; the effects of a pair follow it, however likely they are alone.
    const answers = candidates.filter((r) => !r.isMember);
    check(`${heading}: the effects of a pair stand under it`, pairs === 0 || (candidates[0].isPair && candidates.filter((r) => r.isMember).length === 2));
    const sum = rows.reduce((s, r) => s + r.probability, 0);
    check(`${heading}: probabilities descend and sum to 1`, sorted(answers.map((r) => r.probability)) && near(sum, 1, 1e-6) && rows.length === candidates.length + 1, `${sum}`);
    check(`${heading}: bars show them`, rows.every((r) => near(parseFloat(r.width), 100 * r.probability, 0.051)));
  }
  if (!answer) return;
  const { rows, next } = groups.at(-1);
  const candidates = rows.filter((r) => r.effect !== "none of these" && !r.isPair);
  const pair = rows.find((r) => r.isPair);
  check("the pair is that of the answer", answer.pair === null ? !pair : near(pair?.probability, answer.pair.probability) && pair.effect === answer.pair.labels.join(" and "), pair?.effect);
  const same = candidates.length === answer.candidates.length && answer.candidates.every((c, i) =>
    candidates[i].effect.split(/[:@/]/)[0] === c.effect && near(candidates[i].probability, c.probability_alone ?? c.probability)
      && c.parameters.every((p) => candidates[i].parameters.includes(`${p.name} = `)));
  check("the ranking is that of the answer, the first one first", same, `${candidates[0]?.effect} against ${answer.candidates[0]?.effect}`);
  const unseen = await page.$$eval("#ranking tbody tr:not(:has([data-probability])) td:first-child", (cells) => cells.map((c) => c.textContent.trim()));
  check("what could not be seen is that of the answer", answer.least_visible.every((v) => unseen.includes(v.effect)) && unseen.length >= answer.least_visible.length, unseen.join(", "));
  check("the next test is that of the answer", answer.next_test === "" ? /none|no test/.test(next[0]) : next[0].includes(answer.next_test), next[0]);
}

async function failings(page, check, answer) {
  const said = await page.$eval("#failings", (s) => {
    const last = [...s.querySelectorAll("h3")].at(-1).nextElementSibling;
    return last.tagName === "UL" ? [...last.children].map((li) => li.textContent.trim()) : [];
  });
  if (answer) check("the page says where the model fails as the answer does", JSON.stringify(said) === JSON.stringify(answer.fails), said.join(" | "));
}

async function heat(page, check, sensors, models) {
  const maps = await page.$$eval("#heat figure", (all) => all.map((f) => ({
    cycles: [...f.querySelectorAll("thead th.number")].map((h) => Number(h.textContent)),
    rows: [...f.querySelectorAll("table")].map((t) => t.tBodies[0].rows.length),
    cells: [...f.querySelectorAll("td.cell")].map((c) => ({ times: Number(c.textContent), level: Number(c.className.match(/h(\d)/)?.[1]) })),
    empty: f.querySelectorAll("td:not(.cell)").length,
  })));
  check("a heat map a model", maps.length === models, `${maps.length}`);
  check("a row a sensor, a column a cycle", maps.every((m) => m.rows.every((n) => n === sensors) && m.cycles.length > 1 && m.cycles.every((c, i) => c === m.cycles[0] + i)), JSON.stringify(maps.map((m) => m.cycles)));
  check("a cell a sensor and cycle", maps.every((m) => m.cells.length + m.empty === sensors * m.cycles.length && m.cells.length > m.empty), JSON.stringify(maps.map((m) => [m.cells.length, m.empty])));
  const cells = maps.flatMap((m) => m.cells).sort((a, b) => a.times - b.times);
  check("colours follow the numbers", cells.every((c, i) => Number.isFinite(c.times) && c.level >= 0 && (i === 0 || c.level >= cells[i - 1].level || c.times === cells[i - 1].times)));
}

async function figures(page, check, sensors) {
  const curves = (selector) => page.$$eval(`${selector} svg.chart`, (all) => all.map((s) => ({
    points: [...s.querySelectorAll("path[class^=series]")].map((p) => p.getAttribute("d").split("L").length), marks: s.querySelectorAll("path.mark").length,
    measured: s.querySelectorAll("path.measured").length })));
  const spectra = await curves("#spectrum");
  check("a spectrum a sensor, with harmonics", spectra.length === sensors && spectra.every((s) => s.marks >= 3 && Math.max(...s.points) > 50), JSON.stringify(spectra));
  const found = await page.$$eval("#signature h3", (all) => all.length);
  const signatures = await curves("#signature");
  check("a signature a sensor and effect, over the residual", signatures.length === sensors * found && signatures.every((s) => s.measured === 2 && Math.max(...s.points) > 50), JSON.stringify(signatures));
  await texts(page, check, "wide");
}

// Letters of the still charts: inside the picture, and none on another.
export async function texts(page, check, mode) {
  const bad = await page.$$eval("svg.chart", (all) => all.filter((s) => s.checkVisibility()).flatMap((s) => {
    const frame = s.getBoundingClientRect();
    const boxes = [...s.querySelectorAll("text")].map((t) => ({ text: t.textContent, box: t.getBoundingClientRect() }));
    const out = boxes.filter(({ box }) => box.left < frame.left - 1 || box.right > frame.right + 1 || box.top < frame.top - 1 || box.bottom > frame.bottom + 1)
      .map(({ text }) => `'${text}' sticks out`);
    for (const [i, a] of boxes.entries()) {
      for (const b of boxes.slice(i + 1)) {
        const across = Math.min(a.box.right, b.box.right) - Math.max(a.box.left, b.box.left);
        const down = Math.min(a.box.bottom, b.box.bottom) - Math.max(a.box.top, b.box.top);
        // Boxes are taller than letters.
        if (across > 1 && down > 0.35 * Math.min(a.box.height, b.box.height)) out.push(`'${a.text}' on '${b.text}'`);
      }
    }
    return out;
  }));
  check(`letters of charts are whole and apart (${mode})`, bad.length === 0, bad.slice(0, 5).join(", "));
}

async function correlation(page, check) {
  const rows = await page.$$eval("#correlation tbody tr", (all) => all.map((r) => [...r.querySelectorAll("td")].map((c) => c.textContent)));
  const matrix = rows.map((r) => r.map(number));
  check("the correlations are a square", matrix.length > 2 && matrix.every((r) => r.length === matrix.length), `${matrix.length}`);
  check("its diagonal is 1", matrix.every((r, i) => r[i] === 1 && rows[i][i] === "1"));
  check("it is symmetric, within ±1", matrix.every((r, i) => r.every((v, j) => v === matrix[j][i] && Math.abs(v) <= 1)));
}

async function energy(page, check) {
  const books = await page.$$eval("#energy .book", (all) => all.map((b) => ({
    shares: [...b.querySelectorAll("i")].map((i) => Number(i.dataset.share)),
    widths: [...b.querySelectorAll("i")].map((i) => i.getBoundingClientRect().width / b.querySelector(".track").clientWidth) })));
  check("each reading of the energy book is shared out whole", books.length > 1 && books.every((b) => near(b.shares.reduce((a, c) => a + c, 0), 1)), JSON.stringify(books.map((b) => b.shares)));
  check("its bars show the shares", books.every((b) => b.shares.every((s, i) => near(s, b.widths[i], 0.004))));
  check("its table has the same accounts", (await page.$$eval("#energy tbody tr", (r) => r.length)) === books[0]?.shares.length);
}
