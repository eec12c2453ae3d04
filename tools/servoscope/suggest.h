/* SPDX-License-Identifier: MIT */
/// "Did you mean": the name that a misspelt word was most likely meant to be.
#ifndef SERVOSCOPE_TOOLS_SUGGEST_H
#define SERVOSCOPE_TOOLS_SUGGEST_H

#include <stddef.h>

/// Finds the name nearest to a word.
struct suggestion {
    const char *word; ///< as it was typed, without the minus signs in front
    size_t length;    ///< of it
    const char *best; ///< NULL: no name is near
    size_t distance;  ///< of the best
    size_t equals;    ///< how many names are as near
};

/// `length`: characters of the word that count.
void suggest_begin(struct suggestion *out_self, const char *word, size_t length);

/// Compares a name. Near is: one letter in three wrong, missing, too many or swapped with its neighbour (at least one,
/// of words of four and more two), or the beginning of the name if it has three letters or more.
/// Test:   tests/unit/test_suggest.c
void suggest_consider(struct suggestion *self, const char *name);

/// The name that was meant, NULL if none or several are as likely.
const char *suggest_found(const struct suggestion *self);

#endif
