#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Reference for tests/golden/test_tune_reference.c: model reference control by numpy, in other words than the program's.

Plants are sampled through their eigenvalues, least squares is numpy's SVD, M comes from its poles. Prints the C tables.
usage: python3 tests/golden/tune_reference.py
"""
import numpy as np

RATE = 2000.0
J, B = 0.00516, 0.01
K, C, BEARING = 60.0, 0.01, 0.005
LINES = np.arange(1.0, 951.0)
Z = np.exp(2j * np.pi * LINES / RATE)


def sampled(numerator, denominator):
    """Zero-order hold of a transfer function with distinct poles, by partial fractions; one sample of delay added."""
    poles = np.roots(denominator)
    response = np.zeros_like(Z)
    for pole in poles:
        residue = np.polyval(numerator, pole) / np.polyval(np.polyder(denominator), pole)
        step = np.exp(pole / RATE)
        response += residue * (step - 1) / pole / (Z - step)
    return response / Z


def two_mass(product_of_bearings):
    motor, load = 0.6 * J, 0.4 * J
    return sampled([load, C + BEARING, K],
                   [motor * load, J * (C + BEARING), J * K + 2 * C * BEARING + product_of_bearings, 2 * K * BEARING])


def reference(bandwidth_hz):
    w = 2 * np.pi * bandwidth_hz
    return sampled([1.8 * w, w * w], [1.0, 1.8 * w, w * w])


def solve(G, M, F):
    beta = np.stack([np.ones_like(Z), 1 / RATE / (1 - 1 / Z)], axis=1)

    def least_squares(weight):
        rows = (F * weight * (1 - M) * G)[:, None] * beta
        target = F * weight * M
        return np.linalg.lstsq(np.vstack([rows.real, rows.imag]), np.hstack([target.real, target.imag]), rcond=None)[0]

    def decibel(gains):
        L = beta @ gains * G
        return 10 * np.log10(np.mean(abs(F * (M - L / (1 + L))) ** 2))

    linear = least_squares(1 - M)
    reweighted = linear
    for _ in range(30):
        reweighted = least_squares(1 / (1 + beta @ reweighted * G))
    return [*linear, decibel(linear), *reweighted, decibel(reweighted)]


def main():
    flat = np.ones_like(LINES)
    log = LINES ** -0.5 / np.sqrt(np.mean(1 / LINES))
    plants = [("rigid", sampled([1.0], [J, B])), ("two-mass", two_mass(0.0)), ("two-mass, whole", two_mass(BEARING ** 2))]
    for name, G in plants:
        for weighting, F in (("flat", flat), ("log", log)):
            for bandwidth_hz in (30, 60, 100):
                numbers = ", ".join(f"{x:.12g}" for x in solve(G, reference(bandwidth_hz), F))
                print(f'    {{"{name}", {bandwidth_hz}, tune_weighting_{weighting}, {{{numbers}}}}},')


if __name__ == "__main__":
    main()
