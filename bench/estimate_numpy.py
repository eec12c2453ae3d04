#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The numpy side of bench/estimate.sh: times it, compares results; in the last round prints the table.
usage: estimate_numpy.py FOLDER ROUND"""
import json
import sys
import time

import numpy as np

ORDER, HALF_WIDTH = 2, 6
ROUNDS = 3


def mean(u, y, lines, settle):
    U = np.fft.rfft(u[settle:], axis=1)[:, 1:lines + 1]
    Y = np.fft.rfft(y[settle:], axis=1)[:, 1:lines + 1]
    M = len(U)
    Um, Ym = U.mean(axis=0), Y.mean(axis=0)
    dU, dY = U - Um, Y - Ym
    scale = 1 / (M - 1) / M
    var_u, var_y = (abs(dU) ** 2).sum(axis=0) * scale, (abs(dY) ** 2).sum(axis=0) * scale
    cov = (dY * dU.conj()).sum(axis=0) * scale
    G = Ym / Um
    return G, np.sqrt(abs(G) ** 2 * (var_y / abs(Ym) ** 2 + var_u / abs(Um) ** 2 - 2 * np.real(cov / (Ym * Um.conj()))))


def window(k, P, top):
    """The nearest lines without excitation, as many on each side as there are."""
    below = [i for i in range(k - 1, max(k - 3 * HALF_WIDTH * 2, 0), -1) if i % P]
    above = [i for i in range(k + 1, min(k + 3 * HALF_WIDTH * 2, top + 1)) if i % P]
    take_below = min(HALF_WIDTH, len(below))
    take_above = min(2 * HALF_WIDTH - take_below, len(above))
    return np.array(below[:2 * HALF_WIDTH - take_above] + above[:take_above])


def finish(Yk, Uk, V, factor):
    G = Yk / Uk
    q = 2 * HALF_WIDTH - (ORDER + 1)
    return G, np.sqrt(factor / q * (abs(V[..., 0] - G[..., None] * V[..., 1]) ** 2).sum(axis=-1)) / abs(Uk)


def lpm_loop(u, y, lines):
    P, N = u.shape
    U, Y = np.fft.rfft(u.ravel()), np.fft.rfft(y.ravel())
    X = np.column_stack([Y, U])
    G, std = np.zeros(lines, complex), np.zeros(lines)
    for j in range(lines):
        k = (j + 1) * P
        w = window(k, P, (P * N - 1) // 2)
        K = np.vander((w - k).astype(float), ORDER + 1, increasing=True)
        T = np.linalg.lstsq(K, X[w], rcond=None)[0]
        factor = 1 + np.linalg.inv(K.T @ K)[0, 0]
        G[j], std[j] = finish(Y[k] - T[0, 0], U[k] - T[0, 1], X[w] - K @ T, factor)
    return G, std


def lpm_matrix(u, y, lines):
    """Away from the edges the distances are the same for every line: one pseudo-inverse, one product."""
    P, N = u.shape
    X = np.column_stack([np.fft.rfft(y.ravel()), np.fft.rfft(u.ravel())])
    offsets = window(100 * P, P, (P * N - 1) // 2) - 100 * P
    K = np.vander(offsets.astype(float), ORDER + 1, increasing=True)
    inverse = np.linalg.pinv(K)
    k = np.arange(1, lines + 1) * P
    k = k[(k + offsets.min() > 0) & (k + offsets.max() <= (P * N - 1) // 2)]
    W = X[k[:, None] + offsets]
    T = np.einsum("si,kij->ksj", inverse, W)
    return finish(X[k, 0] - T[:, 0, 0], X[k, 1] - T[:, 0, 1], W - np.einsum("is,ksj->kij", K, T),
                  1 + np.linalg.inv(K.T @ K)[0, 0])


def timed(function, repeats):
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        result = function()
        best = min(best, time.process_time() - start)
    return best, result


def measure(case, ours):
    """Seconds and result of each way numpy has of doing this case, with what is required and a remark."""
    N, P, lines = ours["period_samples"], ours["periods"], ours["lines"]
    u, y = np.fromfile(case + ".f64").reshape(2, P, N)
    if ours["method"] == "mean":
        return [(*timed(lambda: mean(u, y, lines, ours["settle"]), 15), 1.0, "rfft over periods")]
    return [(*timed(lambda: lpm_loop(u, y, lines), 1), 10.0 if P <= 8 else None, "least squares per line"),
            (*timed(lambda: lpm_matrix(u, y, lines), 5), None, "one matrix product for all lines")]


def best_of_rounds(folder, name, row, seconds):
    """The least of this and of the rounds before."""
    path = f"{folder}/{name}-{row}-seconds"
    try:
        with open(path, encoding="utf-8") as stream:
            seconds = min(seconds, float(stream.read()))
    except FileNotFoundError:
        pass
    with open(path, "w", encoding="utf-8") as stream:
        stream.write(repr(seconds))
    return seconds


def main():
    folder, last = sys.argv[1], int(sys.argv[2]) == ROUNDS
    if last:
        print(f"numpy {np.__version__}; seconds of processor time, best of several; ratio: numpy over ours")
        print(f"{'method':6} {'N':>6} {'P':>4} {'lines':>6} {'ours':>9} {'numpy':>9} {'ratio':>7} {'required':>9} "
              f"{'largest difference':>19}  remark")
    missed = []
    growth = {}
    for line in open(f"{folder}/times-{sys.argv[2]}", encoding="utf-8"):
        ours = json.loads(line)
        N, P, lines = ours["period_samples"], ours["periods"], ours["lines"]
        name = f"{ours['method']}-{N}-{P}"
        seconds = best_of_rounds(folder, name, "ours", ours["seconds"])
        real, imaginary, std = np.fromfile(f"{folder}/{name}-result.f64").reshape(3, lines)
        growth.setdefault(ours["method"], []).append((N, P, seconds))
        for row, (time_s, (G, s), required, remark) in enumerate(measure(f"{folder}/{name}", ours)):
            time_s = best_of_rounds(folder, name, row, time_s)
            difference = float("nan")
            if len(G) == lines:
                difference = max(np.max(abs(real + 1j * imaginary - G) / abs(G)), np.max(abs(std / s - 1)))
                if not difference <= 1e-9:
                    missed.append(f"{name}: results differ by {difference:.2g}")
            if not last:
                continue
            if required and time_s / seconds < required:
                missed.append(f"{name}: ratio {time_s / seconds:.3g}")
            print(f"{ours['method']:6} {N:6} {P:4} {lines:6} {seconds:9.5f} {time_s:9.5f} {time_s / seconds:7.2f} "
                  f"{'>= %g' % required if required else '':>9} {difference:19.2g}  {remark}")
    for method, points in growth.items() if last else ():
        rows = ", ".join(f"{1e9 * s / (N * P):.2f} ({N} x {P})" for N, P, s in points)
        print(f"growth: {method} takes, in ns per row (both columns): {rows}")
    if last and missed:
        sys.exit("missed: " + "; ".join(missed))


if __name__ == "__main__":
    main()
