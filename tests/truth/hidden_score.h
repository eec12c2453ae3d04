/* SPDX-License-Identifier: MIT */
#ifndef HIDDEN_SCORE_H
#define HIDDEN_SCORE_H

#include "tests/truth/truth_case.h"

enum { SCORE_TEXT_LENGTH = 160 };

/// What became of one case.
enum score_outcome {
    score_right,  ///< exactly the truth, which may be `no_discrepancy` or `unexplained`
    score_tied,   ///< another cause of a stated tie that holds the truth
    score_equal,  ///< another set of causes that makes the same motion: no data could tell, the case is at fault
    score_missed, ///< said less than the truth: not all causes, no doubt about an unknown one, doubt where none is due
    score_wrong,  ///< a cause that is not there
    score_failed, ///< no diagnosis: exit status, time limit, or an answer that is not in the contract
    score_outcome_count
};

/// Gaps (a figure that the diagnosis did not give) are NaN.
struct score {
    enum score_outcome outcome;
    char named[SCORE_TEXT_LENGTH]; ///< causes joined by "+", else the verdict, else why it failed
    char verdict[24];
    int causes, causes_there; ///< named; and of them in the truth
    int parameters, parameters_within_1_std, parameters_within_2_std, parameters_within_3_std;
    double worst_z; ///< largest error over stated standard deviation among the parameters of true causes
    char worst_parameter[SCORE_TEXT_LENGTH];
    double left_nats; ///< expected evidence of the truth over the named causes, where they are not the truth
    double nominal_nrmse, refitted_nrmse, extended_nrmse, floor_nrmse, whitened_rms;
    double mean_rms, mean_rms_chance; ///< of the mean of the periods, and what chance exceeds once in twenty
    double seconds;
};

const char *score_outcome_name(enum score_outcome outcome);
/// Judge the diagnosis file at `path` against the truth. `seconds` is left alone.
void score_read(struct score *self, const struct truth_case *truth, const char *path);
/// The case could not be diagnosed, for a reason.
void score_fail(struct score *self, const char *why);

#endif
