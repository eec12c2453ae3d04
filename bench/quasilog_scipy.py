# SPDX-License-Identifier: MIT
"""The same estimate with numpy and scipy: linear start (three weighted iterations), then least_squares with the exact Jacobian.

usage: quasilog_scipy.py DATA OURS ORDER   (OURS: lines, seconds and cost of the C estimate)
"""
import sys
import time

import numpy as np
from scipy.optimize import least_squares

RATE_HZ = 65536.0
data = np.loadtxt(sys.argv[1])
with open(sys.argv[2], encoding="utf-8") as file:
    lines, our_seconds, our_cost = (float(word) for word in file.read().split())
order = int(sys.argv[3])
u, y, weight = data[:, 1] + 1j * data[:, 2], data[:, 3] + 1j * data[:, 4], 1 / np.sqrt(data[:, 5])
powers = np.exp(-2j * np.pi * np.outer(data[:, 0], np.arange(order + 1)) / RATE_HZ)


def stack(values):
    return np.concatenate([values.real, values.imag])


def split(theta):
    return powers[:, 1:] @ theta[:order] + 1, powers @ theta[order:]


def residual(theta):
    a, b = split(theta)
    return stack((y - b / a * u) * weight)


def jacobian(theta):
    a, b = split(theta)
    factor = (u * weight / a)[:, None]
    return stack(np.hstack([factor * (b / a)[:, None] * powers[:, 1:], -factor * powers]))


def estimate():
    scale = weight
    for _ in range(3):
        matrix = np.hstack([-y[:, None] * powers[:, 1:], u[:, None] * powers]) * scale[:, None]
        theta = np.linalg.lstsq(stack(matrix), stack(y * scale), rcond=None)[0]
        scale = weight / np.abs(split(theta)[0])
    return least_squares(residual, theta, jac=jacobian, method="lm", x_scale="jac", ftol=1e-13, xtol=1e-13, gtol=1e-13)


best = np.inf
for _ in range(5):
    start = time.perf_counter()
    result = estimate()
    best = min(best, time.perf_counter() - start)
print(f"{int(lines):6d} lines, order {order} over {order:<8d} {1e3 * our_seconds:12.3f} {1e3 * best:12.3f} "
      f"{best / our_seconds:8.1f} {our_cost:14.6f} {2 * result.cost:14.6f}")
