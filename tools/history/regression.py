#!/usr/bin/env python3
"""The numbers that src/history/regression.rs is tested against, by scipy: random-effects regression, Paule-Mandel, Student's intervals."""

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t

run = np.array([-3.5, -2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5])
kelvin = np.array([-4.0, 1.0, 3.5, -2.0, 0.5, 4.0, -1.0, -2.0])
y = np.array([403.1, 394.2, 388.9, 399.7, 394.8, 387.1, 398.3, 400.9])
se = np.array([0.3, 0.5, 0.2, 1.1, 0.4, 0.3, 0.8, 0.25])
x = np.column_stack([np.ones(8), run, kelvin])
freedom = len(y) - x.shape[1]


def whitened(variance):
    """Least squares of rows divided by their standard deviations."""
    sd = np.sqrt(se**2 + variance)
    return np.linalg.lstsq(x / sd[:, None], y / sd, rcond=None)


variance = brentq(lambda v: whitened(v)[1][0] - freedom, 0.0, 100.0, xtol=1e-14, rtol=1e-14)
coefficients = whitened(variance)[0]
sd = np.sqrt(se**2 + variance)
_, r = np.linalg.qr(x / sd[:, None])
covariance = np.linalg.inv(r.T @ r)
row = np.array([1.0, 3.5, -2.0])
print("coefficients", [f"{v:.9f}" for v in coefficients])
print("half widths ", [f"{v:.9f}" for v in t.ppf(0.975, freedom) * np.sqrt(np.diag(covariance))])
print("scatter     ", f"{np.sqrt(variance):.9f}")
print("prediction  ", f"{row @ coefficients:.9f}", f"{t.ppf(0.995, freedom) * np.sqrt(row @ covariance @ row + variance + 0.4**2):.9f}")
