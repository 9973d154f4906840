#!/usr/bin/env python3
"""Kills a watch at random moments until all is done, then says whether anything was done twice or left out.

  kills.py SURGESCOPE RECORDING [RUNS [SEED]]

Plays RECORDING into RUNS recordings (6) of 5 s and kills a watch over them after 0.05 s to four times what one run takes, again and
again. Exit 1 when a check fails.
"""

import random
import sqlite3
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

program, recording = sys.argv[1], sys.argv[2]
runs = int(sys.argv[3]) if len(sys.argv) > 3 else 6
random.seed(int(sys.argv[4]) if len(sys.argv) > 4 else 1)
folder = Path(tempfile.mkdtemp(prefix="kills-"))


def record(into, n):
    subprocess.run([program, "record", "--replay", recording, "--speed", "0", "--duration", "5", "--note", f"n={n}",
                    "-o", into / f"run-{n:02}.mcap"], check=True, capture_output=True)


for n in range(runs):
    record(folder, n)
with tempfile.TemporaryDirectory() as alone:
    record(Path(alone), runs)
    begin = time.monotonic()
    subprocess.run([program, "watch", alone, "--once"], check=True, capture_output=True)
    one_run_s = time.monotonic() - begin


def rows(query):
    path = folder / "surgescope.sqlite"
    if not path.exists():
        return []
    with sqlite3.connect(path) as index:
        try:
            return index.execute(query).fetchall()
        except sqlite3.OperationalError:
            return []  # killed before the tables were there


kills, out = 0, ""
while len(rows("SELECT 1 FROM run WHERE state = 'done'")) < runs and kills < 200:
    watch = subprocess.Popen([program, "watch", folder, "--every", "0.05"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        watch.wait(timeout=random.uniform(0.05, 4.0 * one_run_s))
    except subprocess.TimeoutExpired:
        watch.kill()
    out += watch.communicate()[0]
    kills += 1
left = subprocess.run([program, "watch", folder, "--once"], capture_output=True, text=True)
failures = []


def check(what, ok):
    print("ok  " if ok else "FAIL", what)
    if not ok:
        failures.append(what)


check(f"{runs} runs are done after {kills} kills", [r[0] for r in rows("SELECT state FROM run")] == ["done"] * runs)
check("nothing was left to do", left.returncode == 0 and left.stdout == "")
check("watch gives no verdict twice", all(out.count(f"run-{n:02}.mcap: ") <= 1 for n in range(runs)))
tries = sum(r[0] for r in rows("SELECT tries FROM run"))
check(f"runs were begun {tries} times: once each and once for each kill that hit one", runs < tries <= runs + kills)
for n in range(runs):
    model = tomllib.loads((folder / f"run-{n:02}.model.toml").read_text())
    page = (folder / f"run-{n:02}.html").read_text()
    check(f"run {n}: one model, a whole page", len(model["model"]) == 1 and page.endswith("</html>\n"))
temporary = list(folder.glob(".surgescope-*.tmp"))
print("temporary files left by kills:", len(temporary))
sys.exit(bool(failures))
