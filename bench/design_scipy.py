#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The first paper's L-infinity with a general optimiser: scipy's least_squares(method='trf') with the analytic Jacobian.

Testbed of the paper, limits at the samples, Newman phases, p = 2, 4, ..., 512, at most 400 evaluations and tolerances of 1e-6
for each p, c_A renewed after every p. Prints {"effective_torque_Nm", "cpu_s"}; needs numpy and scipy.
"""
import json
import time

import numpy as np
from scipy.optimize import least_squares

INERTIA_KGM2, TORQUE_NM, VELOCITY_RAD_PER_S = 0.00516, 1.0, 0.05 / 0.0159
LINES, SAMPLES, RATE_HZ = 200, 2000, 1000.0


def main():
    begun = time.process_time()
    omega = 2 * np.pi * 0.5 * np.arange(1, LINES + 1)
    acceleration = TORQUE_NM / INERTIA_KGM2
    amplitude = np.minimum(VELOCITY_RAD_PER_S / omega, acceleration / omega**2)
    gains = (amplitude * omega / VELOCITY_RAD_PER_S, amplitude * omega**2 / acceleration)
    angle = np.outer(np.arange(SAMPLES) / RATE_HZ, omega)
    cosine, sine = np.cos(angle), np.sin(angle)

    def signals(phi):
        """Velocity and acceleration over their limits, stacked (equation 11)."""
        c, s = np.cos(phi), np.sin(phi)
        velocity, acceleration_ = gains
        return np.concatenate((-cosine @ (velocity * s) - sine @ (velocity * c),
                               -cosine @ (acceleration_ * c) + sine @ (acceleration_ * s)))

    def slopes(phi):
        """Their derivatives by each phase (equation 10 without the power)."""
        c, s = np.cos(phi), np.sin(phi)
        velocity, acceleration_ = gains
        return np.concatenate((-cosine * (velocity * c) + sine * (velocity * s),
                               cosine * (acceleration_ * s) + sine * (acceleration_ * c)))

    phi = np.pi * np.arange(LINES) ** 2 / LINES
    scale = 1 / np.abs(signals(phi)).max()
    for exponent in range(1, 10):
        half = 2.0 ** (exponent - 1)
        result = least_squares(
            lambda x: (scale * signals(x)) ** half,
            phi,
            jac=lambda x: (half * scale * (scale * signals(x)) ** (half - 1))[:, None] * slopes(x),
            method="trf", ftol=1e-6, xtol=1e-6, gtol=1e-6, max_nfev=400)
        phi = result.x
        scale = 1 / np.abs(signals(phi)).max()
    effective = INERTIA_KGM2 * scale * np.sqrt(np.sum((amplitude * omega**2) ** 2) / 2)
    print(json.dumps({"effective_torque_Nm": float(effective), "cpu_s": time.process_time() - begun}))


if __name__ == "__main__":
    main()
