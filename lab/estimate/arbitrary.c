/* SPDX-License-Identifier: MIT */
#include "lab/estimate/arbitrary.h"

#include "lab/estimate/columns.h"

static void find_longest_stretch(size_t first_row, struct arbitrary *io_self)
{
    const struct run *run = io_self->run;
    const double *valid = run_column(run, "valid");
    size_t start = first_row;
    for (size_t row = first_row; row <= run->rows; row++) {
        bool lost = row < run->rows && valid && !(valid[row] > 0.5);
        if (lost) {
            io_self->first_lost_row = io_self->lost == 0 ? row + 1 : io_self->first_lost_row;
            io_self->lost++;
        }
        if (lost || row == run->rows) {
            if (row - start > io_self->rows) {
                io_self->first = start;
                io_self->rows = row - start;
            }
            start = row + 1;
        }
    }
}

int arbitrary_cut(const struct run *run, const struct arbitrary_options *options, struct arbitrary *out_self,
                  struct error *out_error)
{
    struct columns columns;
    const struct columns wanted = {options->input, options->output, options->reference};
    *out_self = (struct arbitrary){.run = run, .start = options->first_row};
    int status = columns_choose(run, &wanted, &columns, out_error);
    if (status) {
        return status;
    }
    out_self->input = columns.input;
    out_self->output = columns.output;
    out_self->reference = columns.reference;
    find_longest_stretch(options->first_row, out_self);
    if (out_self->rows < arbitrary_fewest_rows) {
        return error_set(out_error, error_refused,
                         "%s: the longest stretch without lost samples has %zu rows: expected at least %d for a "
                         "response without periods",
                         run->path, out_self->rows, arbitrary_fewest_rows);
    }
    return 0;
}
