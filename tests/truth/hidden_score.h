/* SPDX-License-Identifier: MIT */
#ifndef HIDDEN_SCORE_H
#define HIDDEN_SCORE_H

#include "tests/truth/truth_case.h"

enum { SCORE_NAMED_LENGTH = 160 };

/// What became of one case. Gaps (a figure that the diagnosis did not give) are NaN.
enum score_outcome {
    score_right,  ///< exactly the truth, which may be `no_discrepancy` or `unexplained`
    score_tied,   ///< another cause of a stated tie that holds the truth
    score_missed, ///< said less than the truth: no cause of a catalogued effect, no doubt about an unknown one
    score_wrong,  ///< a cause that is not there, or the truth with others
    score_failed, ///< no diagnosis: exit status, time limit, or an answer that is not in the contract
    score_outcome_count
};

struct score {
    enum score_outcome outcome;
    char named[SCORE_NAMED_LENGTH]; ///< causes joined by "+", else the verdict, else why it failed
    int names_cause;
    double evidence_nats;
    double worst_z;        ///< largest error over stated standard deviation among the true cause's parameters
    double worst_relative; ///< largest relative error among them
    double nominal_nrmse, refitted_nrmse, extended_nrmse, floor_nrmse, whitened_rms;
    double seconds;
};

const char *score_outcome_name(enum score_outcome outcome);
/// Judge the diagnosis file at `path` against the truth. `seconds` is left alone.
void score_read(struct score *self, const struct truth_case *truth, const char *path);
/// The case could not be diagnosed, for a reason.
void score_fail(struct score *self, const char *why);

#endif
