/* SPDX-License-Identifier: MIT */
/// Whether the scatter of one period tells something of the next one's. F12 takes periods for independent; coloured
/// noise that is slow against a period, a disturbance near a line, or a drift make them alike, and the mean is then
/// less sure than their scatter says.
#ifndef SERVOSCOPE_ESTIMATE_SUCCESSION_H
#define SERVOSCOPE_ESTIMATE_SUCCESSION_H

#include "lab/estimate/periodic.h"
#include "lab/record/frf_file.h"

#include <stdbool.h>
#include <stddef.h>

enum { succession_blocks = 32, succession_fewest = 8, succession_most = 64 };

struct succession {
    size_t periods;     ///< in a row that were looked at; 0: fewer than succession_fewest, nothing is known
    double correlation; ///< of the residual with that of the period before, mean over lines; 0: independent
    double chance;      ///< that independent periods show as much, of both signs
    bool certain;
    size_t block_lines; ///< consecutive lines that are judged together
    size_t block_count;
    double factor[succession_blocks]; ///< by which the standard deviation is too small; 1 unless `certain`
};

/// Tests the residuals e_m = (Y_m - Ybar) - G (U_m - Ubar) of the last succession_most consecutive periods.
///
/// Equation:  r = 1/(M-1) sum_m Re(e_m conj e_{m-1}) / s^2 + 1/(M-1), s^2 the mean of |e|^2, e each line over its own
///            s;
///            the last term is what the mean taken out costs. Mean over a block's lines, and over all.
///            Chance: 8000 random orders of the periods, which under independence are as good as the true one, whatever
///            the lines have in common: of the mean over all lines, and of the largest |r| of a block, the smaller of
///            both doubled. Certain below 1e-3.
///            factor = sqrt((1 + r)/(1 - r)) where r > 0: the mean of a first-order autoregression. Negative r (leakage
///            of noise that is fast against a period: what one end takes the next beginning gives) makes the standard
///            deviation too large rather than too small, and is left alone.
/// Errors:    false if memory is short
/// Test:      tests/unit/test_succession.c
bool succession_test(const struct periodic *recording, const struct frf *frf, struct succession *out);

/// Enlarges std and noise_std of the valid lines.
void succession_enlarge(const struct succession *self, struct frf *io_frf);

#endif
