/* SPDX-License-Identifier: MIT */
/// How to spread a given power over given lines so that parameters are estimated best: D-optimal design.
/// The output error of a line is white noise; a line with power p_k and sensitivities g_k = dG_k / dtheta adds
/// p_k Re(g_k g_k^H) to the information matrix M (fourth paper, equation 1), and det M is to be largest.
#ifndef SERVOSCOPE_DESIGN_OPTIMAL_POWER_H
#define SERVOSCOPE_DESIGN_OPTIMAL_POWER_H

#include <complex.h>
#include <stddef.h>

enum { design_optimal_parameters_max = 8 };

/// How far from optimal a result may be: max_k trace(M^-1 M_k) <= (1 + gap) m. The determinant's m-th root is then
/// within exp(-gap) of the largest there is.
#define DESIGN_OPTIMAL_GAP 1e-3

enum design_optimal_status {
    design_optimal_ok,
    design_optimal_not_finite, ///< a sensitivity is not finite
    design_optimal_singular,   ///< the lines do not tell the parameters apart, whatever their power
    design_optimal_slow,       ///< the gap is still open after very many steps
    design_optimal_memory,
};

struct design_optimal_report {
    size_t line;  ///< with design_optimal_not_finite: which
    size_t steps; ///< of the algorithm
    double gap;   ///< max_k trace(M^-1 M_k) / m - 1
};

/// Finds the D-optimal power shares: >= 0, their sum 1.
/// Method:  multiplicative algorithm of Titterington, p_k <- p_k trace(M^-1 M_k) / m, whose determinants never fall,
///          until the equivalence theorem of Kiefer and Wolfowitz says that the gap is closed
/// Shapes:  sensitivities: lines x parameters, line after line; out_power: lines
/// Range:   1 <= parameters <= design_optimal_parameters_max; any units: shares do not depend on them
/// Test:    tests/unit/test_design_amplitude.c
enum design_optimal_status design_optimal_power(size_t lines, size_t parameters, const double complex *sensitivities,
                                                double *out_power, struct design_optimal_report *out_report);

#endif
