#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes what test_frf_reference.c compares with: two small recordings and their responses by textbook numpy.

    python3 tests/golden/frf_reference.py        (numpy 1.22 or later)

Nothing of servoscope is used. Every method is written from its equation, with numpy's transforms and LAPACK's least squares, and
without any of the short cuts of the C code (residuals in place of covariances, orthonormal polynomials, two signals in one
transform).
"""
import csv
import os

import numpy as np

SEED = 20240611
FOLDER = os.path.dirname(os.path.abspath(__file__))
RATE_HZ = 1000.0
PERIOD, PERIODS, SETTLE = 64, 8, 2
BINS = np.array([1, 2, 3, 4, 5, 6, 8, 9, 11, 12, 14, 15, 17, 20, 21, 23, 26, 29, 30, 31])
ROWS, SEGMENT = 1000, 100


def closed_loop(reference, rng, noise):
    """u = r - .4 y, y = G u + v with a resonance, both measured with noise, from rest."""
    y = np.zeros(len(reference))
    u = np.zeros(len(reference))
    v = noise * rng.standard_normal(len(reference))
    state = np.zeros(2)
    for n, r in enumerate(reference):
        y[n] = state[0] + v[n]
        u[n] = r - 0.4 * y[n]
        state = np.array([1.5 * state[0] - 0.8 * state[1] + 0.3 * u[n], state[0]])
    return u + 0.2 * noise * rng.standard_normal(len(u)), y + 0.2 * noise * rng.standard_normal(len(y))


def write_run(name, keys, columns):
    with open(os.path.join(FOLDER, name), "w", newline="\n") as file:
        for key, value in keys.items():
            file.write(f"# {key}: {value}\n")
        file.write(",".join(columns) + "\n")
        for row in zip(*columns.values()):
            file.write(",".join(repr(float(x)) for x in row) + "\n")


def variance_of_quotient(Y, U, var_y, var_u, cov_yu):
    """First paper, (24)-(27) mended; variances of the spectra Y and U themselves."""
    return abs(Y / U) ** 2 * (var_y / abs(Y) ** 2 + var_u / abs(U) ** 2 - 2 * np.real(cov_yu / (Y * np.conj(U))))


def mean(u, y):
    U = np.fft.rfft(u.reshape(PERIODS, PERIOD)[SETTLE:], axis=1)[:, BINS]
    Y = np.fft.rfft(y.reshape(PERIODS, PERIOD)[SETTLE:], axis=1)[:, BINS]
    M = PERIODS - SETTLE
    Um, Ym = U.mean(axis=0), Y.mean(axis=0)
    var_u = (abs(U - Um) ** 2).sum(axis=0) / (M - 1) / M
    var_y = (abs(Y - Ym) ** 2).sum(axis=0) / (M - 1) / M
    cov = ((Y - Ym) * np.conj(U - Um)).sum(axis=0) / (M - 1) / M
    return BINS * RATE_HZ / PERIOD, Ym / Um, np.sqrt(variance_of_quotient(Ym, Um, var_y, var_u, cov))


def hann(u, y):
    u, y = u[SETTLE * PERIOD:], y[SETTLE * PERIOD:]
    P = PERIODS - SETTLE
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(len(u)) / len(u))
    U, Y = np.fft.rfft(window * u), np.fft.rfft(window * y)
    G, std = [], []
    for k in BINS * P:
        g = Y[k] / U[k]
        neighbours = [k + m for m in range(-(P // 2), P // 2 + 1) if abs(m) >= 2]
        G.append(g)
        std.append(np.sqrt(np.mean(abs(Y[neighbours] - g * U[neighbours]) ** 2)) / abs(U[k]))
    return BINS * RATE_HZ / PERIOD, np.array(G), np.array(std)


def lpm(u, y, order, half_width):
    U, Y = np.fft.rfft(u), np.fft.rfft(y)
    top = (len(u) - 1) // 2
    G, std = [], []
    for k in BINS * PERIODS:
        below = [i for i in range(k - 1, 0, -1) if i % PERIODS]
        above = [i for i in range(k + 1, top + 1) if i % PERIODS]
        take_below = min(half_width, len(below))
        take_above = min(2 * half_width - take_below, len(above))
        take_below = 2 * half_width - take_above
        lines = np.array(below[:take_below] + above[:take_above])
        K = np.vander((lines - k).astype(float), order + 1, increasing=True)
        T, *_ = np.linalg.lstsq(K, np.column_stack([Y[lines], U[lines]]), rcond=None)
        V = np.column_stack([Y[lines], U[lines]]) - K @ T
        q = 2 * half_width - (order + 1)
        factor = 1 + np.linalg.inv(K.T @ K)[0, 0]
        Yk, Uk = Y[k] - T[0, 0], U[k] - T[0, 1]
        C = factor * (V.T @ np.conj(V)) / q
        G.append(Yk / Uk)
        std.append(np.sqrt(variance_of_quotient(Yk, Uk, C[0, 0].real, C[1, 1].real, C[0, 1])))
    return BINS * RATE_HZ / PERIOD, np.array(G), np.array(std)


def segments(x, samples):
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(samples) / samples)
    starts = range(0, len(x) - samples + 1, samples // 2)
    return np.array([np.fft.rfft(window * (x[s:s + samples] - x[s:s + samples].mean())) for s in starts])[:, 1:(samples + 1) // 2]


def welch(u, y, z):
    U, Y, Z = (segments(x, SEGMENT) for x in (u, y, z))
    M = len(U)
    independent = M / (1 + 2 * (M - 1) / M / 36)
    S_yz, S_uz = (Y * np.conj(Z)).sum(axis=0), (U * np.conj(Z)).sum(axis=0)
    G = S_yz / S_uz
    noise = (abs(Y - G * U) ** 2).sum(axis=0) / M / (1 - 1 / independent)
    variance = M / independent * noise * (abs(Z) ** 2).sum(axis=0) / abs(S_uz) ** 2
    return np.arange(1, G.size + 1) * RATE_HZ / SEGMENT, G, np.sqrt(variance)


def lpm_arbitrary(u, y, z, order, half_width):
    U, Y, Z = np.fft.rfft(u), np.fft.rfft(y), np.fft.rfft(z)
    top = (len(u) - 1) // 2
    frequency, G, std = [], [], []
    for k in range(half_width, top - half_width + 1, half_width):
        lines = np.arange(k - half_width, k + half_width + 1)
        if lines[0] < 1:
            continue
        powers = np.vander((lines - k) / half_width, order + 1, increasing=True)
        K = np.column_stack([powers * Z[lines, None], powers])
        theta, *_ = np.linalg.lstsq(K, np.column_stack([Y[lines], U[lines]]), rcond=None)
        V = np.column_stack([Y[lines], U[lines]]) - K @ theta
        q = len(lines) - K.shape[1]
        C = (V.T @ np.conj(V)) / q * np.linalg.inv(np.conj(K.T) @ K)[0, 0].real
        frequency.append(k * RATE_HZ / len(u))
        G.append(theta[0, 0] / theta[0, 1])
        std.append(np.sqrt(variance_of_quotient(theta[0, 0], theta[0, 1], C[0, 0].real, C[1, 1].real, C[0, 1])))
    return np.array(frequency), np.array(G), np.array(std)


def main():
    rng = np.random.default_rng(SEED)
    n = np.arange(PERIOD)
    phases = rng.uniform(0, 2 * np.pi, len(BINS))
    period = sum(np.cos(2 * np.pi * k * n / PERIOD + p) for k, p in zip(BINS, phases))
    r = np.tile(period, PERIODS)
    u, y = closed_loop(r, rng, 0.1)
    write_run("frf_reference_periodic.csv",
              {"sample_rate_hz": RATE_HZ, "period_samples": PERIOD, "excited_bins": [int(k) for k in BINS]},
              {"torque_Nm": u, "velocity_rad_per_s": y, "velocity_ref_rad_per_s": r})
    results = [("mean", mean(u, y)), ("hann", hann(u, y)), ("lpm2", lpm(u, y, 2, 6)), ("lpm4", lpm(u, y, 4, 7))]
    r = rng.standard_normal(ROWS)
    u, y = closed_loop(r, rng, 0.3)
    write_run("frf_reference_arbitrary.csv", {"sample_rate_hz": RATE_HZ},
              {"torque_Nm": u, "velocity_rad_per_s": y, "velocity_ref_rad_per_s": r})
    results += [("h1", welch(u, y, u)), ("indirect", welch(u, y, r)), ("lpm_arbitrary", lpm_arbitrary(u, y, r, 2, 7))]
    with open(os.path.join(FOLDER, "frf_reference.csv"), "w", newline="\n") as file:
        file.write(f"# script: frf_reference.py\n# seed: {SEED}\n# numpy: {np.__version__}\n")
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["method", "frequency_hz", "real", "imag", "std"])
        for method, (frequency, G, std) in results:
            for f, g, s in zip(frequency, G, std):
                out.writerow([method] + [repr(float(x)) for x in (f, g.real, g.imag, s)])


if __name__ == "__main__":
    main()
