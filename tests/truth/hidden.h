/* SPDX-License-Identifier: MIT */
#ifndef HIDDEN_H
#define HIDDEN_H

#include "tests/truth/hidden_score.h"

/// A campaign of hidden cases: what is asked for, what came of it, and the rates with their bounds.

enum { HIDDEN_PATH_LENGTH = 1024, HIDDEN_CASES_MAX = 100000, HIDDEN_KINDS_MAX = 64 };

enum hidden_class { hidden_clean, hidden_single, hidden_combination, hidden_unknown, hidden_class_count };

enum hidden_rate {
    hidden_rate_clear,
    hidden_rate_moderate,
    hidden_rate_faint,
    hidden_rate_combinations,
    hidden_rate_precision,
    hidden_rate_false_alarms,
    hidden_rate_unknown_clear,
    hidden_rate_unknown_moderate,
    hidden_rate_unknown_named,
    hidden_rate_parameters,
    hidden_rate_white,
    hidden_rate_white_mean,
    hidden_rate_failed,
    hidden_rate_count
};

struct hidden_options {
    const char *program;
    const char *work;
    int cases, jobs, time_limit_s, keep;
    int beyond_chance; ///< a rate breaks its bound only if chance would do that less than once in a thousand
    double minutes;    ///< 0: no limit
    uint64_t seed;
    enum truth_size size; ///< truth_size_count: in turn
    enum truth_protocol protocol;
    int only; ///< a class, or hidden_class_count
    int kinds;
    struct truth_wish kind[HIDDEN_KINDS_MAX]; ///< in turn; none: the campaign's own mixture
    double bound[hidden_rate_count];
};

struct hidden_record {
    struct truth_wish wish;
    enum hidden_class class;
    int done, reached;
    char protocol;
    double evidence_nats; ///< the least of its effects
    struct score score;
};

const char *hidden_rate_name(enum hidden_rate rate);
/// Required of 400 fresh cases.
double hidden_rate_bound(enum hidden_rate rate);
/// Print everything; 1 when a rate is beyond its bound.
int hidden_report(const struct hidden_options *options, const struct hidden_record *records);

#endif
