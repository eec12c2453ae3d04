/* SPDX-License-Identifier: MIT */
/// Rows that set a measured figure beside the published one and what is required of it, and fail outside.
/// The same program is a test (short) and a benchmark (SERVOSCOPE_LONG=1: as many runs as the requirement names).
#ifndef SERVOSCOPE_SUPPORT_CLAIM_H
#define SERVOSCOPE_SUPPORT_CLAIM_H

#include "unity.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

static inline bool claim_long(void)
{
    const char *text = getenv("SERVOSCOPE_LONG");
    return text && text[0] != '\0' && text[0] != '0';
}

static inline void claim_title(void)
{
    printf("%-64s %14s %12s   %s\n", "claim", "paper", "ours", "required");
}

/// Prints a row and fails unless lowest <= ours <= highest; -INFINITY or INFINITY: no limit on that side.
static inline void claim_within(const char *claim, const char *paper, double ours, double lowest, double highest)
{
    char required[64];
    if (isinf(lowest)) {
        snprintf(required, sizeof required, "<= %.6g", highest);
    } else if (isinf(highest)) {
        snprintf(required, sizeof required, ">= %.6g", lowest);
    } else {
        snprintf(required, sizeof required, "%.6g .. %.6g", lowest, highest);
    }
    printf("%-64s %14s %12.6g   %s\n", claim, paper, ours, required);
    if (!(ours >= lowest && ours <= highest)) {
        char message[256];
        snprintf(message, sizeof message, "%s: %.9g, required %s", claim, ours, required);
        TEST_FAIL_MESSAGE(message);
    }
}

#endif
