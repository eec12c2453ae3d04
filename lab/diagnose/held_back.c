/* SPDX-License-Identifier: MIT */
#include "lab/diagnose/held_back.h"

#include <stdlib.h>
#include <string.h>

/// A view of rows from .. from + rows of a run.
static bool part_of(const struct run *run, size_t from, size_t rows, size_t settle_periods, struct run *out)
{
    *out = *run;
    out->rows = rows;
    out->columns = malloc(run->column_count * sizeof *out->columns);
    if (!out->columns)
        return false;
    for (size_t i = 0; i < run->column_count; i++)
        out->columns[i] = (struct run_column){run->columns[i].name, run->columns[i].data + from};
    out->periods = 0;
    out->settle_periods = settle_periods;
    out->has_settle_periods = settle_periods > 0;
    return true;
}

bool held_back_split(const struct run *run, struct held_back *out_parts)
{
    struct held_back *p = out_parts;
    size_t n = run->period_samples;
    memset(p, 0, sizeof *p);
    if (n >= 16 && run->rows >= 7 * n) {
        size_t periods = run->rows / n, settle = run->settle_periods > 0 ? run->settle_periods : 1;
        size_t counted = periods - settle, held = counted / 3;
        p->from = (periods - held - 1) * n; // one period more, to lead into the first that counts
        p->first_row = p->from + n;
        return part_of(run, 0, p->first_row, settle, &p->fitted) &&
               part_of(run, p->from, (held + 1) * n, 1, &p->judged);
    }
    size_t rows = p->from = p->first_row = run->rows / 3 * 2;
    return part_of(run, 0, rows, 0, &p->fitted) && part_of(run, rows, run->rows - rows, 0, &p->judged);
}

void held_back_free(struct held_back *self)
{
    free(self->fitted.columns);
    free(self->judged.columns);
    memset(self, 0, sizeof *self);
}
