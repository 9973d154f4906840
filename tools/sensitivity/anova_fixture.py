#!/usr/bin/env python3
"""Writes tests/reference/anova_scipy.json: groups of numbers, with F and p of scipy's `f_oneway`.

    python3 -m venv venv && venv/bin/pip install scipy && venv/bin/python tools/sensitivity/anova_fixture.py

The same seed gives the same numbers; `cargo test --test it sensitivity::` reads them.
"""
import json
import pathlib

import numpy
import scipy
from scipy.stats import f_oneway

rng = numpy.random.default_rng(5)
cases = []


def add(name, groups):
    groups = [[float(v) for v in group] for group in groups]
    result = f_oneway(*groups)
    cases.append({"name": name, "groups": groups, "f": float(result.statistic), "p": float(result.pvalue)})


for shift in (0.0, 0.2, 1.0, 5.0, 50.0):
    add(f"the paper's 4 levels of 3 repeats, means {shift} apart", [rng.normal(40 + shift * k, 1, 3) for k in range(4)])
add("unequal groups", [rng.normal(k, 2, n) for k, n in enumerate((2, 5, 9, 3))])
add("two groups", [rng.normal(0, 1, 30), rng.normal(0.4, 1, 25)])
add("a large common value", [1e6 + rng.normal(0.3 * k, 1, 6) for k in range(5)])
add("small numbers", [1e-7 * rng.normal(1 + 0.5 * k, 1, 8) for k in range(3)])
add("many groups", [rng.normal(0, 1, 4) for _ in range(40)])
add("hardly any difference", [rng.normal(0, 1, 500) for _ in range(3)])
add("one value in a group", [[1.0], [2.0, 2.5], [3.0, 2.0, 4.0]])

target = pathlib.Path(__file__).parents[2] / "tests/reference/anova_scipy.json"
lines = ",\n".join(json.dumps(case) for case in cases)
target.write_text(f'{{"scipy": {json.dumps(scipy.__version__)}, "cases": [\n{lines}\n]}}\n')
print(f"{len(cases)} cases, scipy {scipy.__version__}, p from {min(c['p'] for c in cases):.1e}")
