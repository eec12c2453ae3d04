/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/suggest.h"

#include <string.h>

enum { length_max = 40 };

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

/// Letters to be changed, left out, put in or swapped with a neighbour (optimal string alignment): the three last rows
/// of its table are enough.
static size_t distance_between(const char *a, size_t a_length, const char *b, size_t b_length)
{
    size_t rows[3][length_max + 1];
    for (size_t j = 0; j <= b_length; j++) {
        rows[0][j] = j;
    }
    for (size_t i = 1; i <= a_length; i++) {
        const size_t *before = rows[(i - 1) % 3];
        size_t *row = rows[i % 3];
        row[0] = i;
        for (size_t j = 1; j <= b_length; j++) {
            row[j] = least(least(before[j] + 1, row[j - 1] + 1), before[j - 1] + (a[i - 1] != b[j - 1]));
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
                row[j] = least(row[j], rows[(i - 2) % 3][j - 2] + 1);
            }
        }
    }
    return rows[a_length % 3][b_length];
}

void suggest_begin(struct suggestion *out_self, const char *word, size_t length)
{
    *out_self = (struct suggestion){.word = word, .length = length};
}

void suggest_consider(struct suggestion *self, const char *name)
{
    const size_t length = strlen(name);
    if (self->length < 2 || self->length > length_max || length > length_max) {
        return;
    }
    const size_t allowed = self->length < 4 ? 1 : self->length < 7 ? 2 : self->length / 3;
    size_t distance = distance_between(self->word, self->length, name, length);
    if (self->length >= 3 && self->length < length && memcmp(self->word, name, self->length) == 0) {
        distance = 1;
    }
    if (distance > allowed || (self->best && distance > self->distance)) {
        return;
    }
    self->equals = self->best && distance == self->distance ? self->equals + 1 : 1;
    self->best = name;
    self->distance = distance;
}

const char *suggest_found(const struct suggestion *self)
{
    return self->equals == 1 ? self->best : NULL;
}
