#!/usr/bin/env python3
"""Sobol indices of the Ishigami function, by this project and by SALib, against the exact values; writes a table in Markdown.

    python3 -m venv venv && venv/bin/pip install SALib
    cargo build --release -p surgescope-tools
    venv/bin/python tools/sensitivity/compare.py target/release/ishigami > docs/src/measured/ishigami.md

Both take SEEDS seeds of N rows (N × 5 evaluations). The error is the rms over the seeds; the cover is how often an exact value lies in the 95 %
interval.
"""
import importlib.metadata
import subprocess
import sys

import numpy
from SALib.analyze import sobol as analyse
from SALib.sample import sobol as sample
from SALib.test_functions import Ishigami

SEEDS = 20
PROBLEM = {"num_vars": 3, "names": ["x1", "x2", "x3"], "bounds": [[-numpy.pi, numpy.pi]] * 3}
V1, V2, V13 = 0.5 * (1 + 0.1 * numpy.pi**4 / 5) ** 2, 49 / 8, 0.01 * numpy.pi**8 * (1 / 18 - 1 / 50)
V = V1 + V2 + V13
EXACT = numpy.array([[V1 / V, V2 / V, 0.0], [(V1 + V13) / V, V2 / V, V13 / V]])


def ours(program, rows, seed):
    text = subprocess.run([program, str(rows), str(seed)], check=True, capture_output=True, text=True).stdout
    t = numpy.array([[float(v) for v in line.split()] for line in text.splitlines()]).T
    return t[[0, 3]], t[[1, 4]], t[[2, 5]]


def salib(rows, seed):
    points = sample.sample(PROBLEM, rows, calc_second_order=False, seed=seed)
    found = analyse.analyze(PROBLEM, Ishigami.evaluate(points), calc_second_order=False, seed=seed)
    value = numpy.array([found["S1"], found["ST"]])
    half = numpy.array([found["S1_conf"], found["ST_conf"]])
    return value, value - half, value + half


def main():
    program = sys.argv[1]
    print("# Sobol indices of the Ishigami function\n")
    print(f"Against SALib {importlib.metadata.version('SALib')}, {SEEDS} seeds each. Written by `tools/sensitivity/compare.py`, which says how.\n")
    print("| rows | by | S1 | S2 | S3 | ST1 | ST2 | ST3 | rms error, first | rms error, total | cover |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    print("| exact | | " + " | ".join(f"{v:.4f}" for v in EXACT.ravel()) + " | | | |")
    for rows in (256, 1024, 4096, 16384):
        for name, of in (("surgescope", lambda s: ours(program, rows, s)), ("SALib", lambda s: salib(rows, s))):
            runs = [of(seed) for seed in range(1, SEEDS + 1)]
            values = numpy.array([r[0] for r in runs])
            inside = numpy.mean([(low <= EXACT) & (EXACT <= high) for _, low, high in runs])
            rms = numpy.sqrt(numpy.mean((values - EXACT) ** 2, axis=(0, 2)))
            cells = [f"{v:.4f}" for v in values.mean(axis=0).ravel()] + [f"{e:.1e}" for e in rms] + [f"{100 * inside:.0f} %"]
            print(f"| {rows} | {name} | " + " | ".join(cells) + " |")


main()
