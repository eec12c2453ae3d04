/* SPDX-License-Identifier: MIT */
#include "lab/estimate/arbitrary.h"

#include "lab/estimate/columns.h"

#include <math.h>

/// What the numbers of a ramp may have been rounded to.
static const double rounding_of_ramp = 1e-6;

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

/// A constant and a ramp excite nothing, and what a window leaves of them would pass for power on every line.
static int check_excites(const struct arbitrary *self, const char *column, struct error *out_error)
{
    const double *x = run_column(self->run, column) + self->first;
    const double middle = 0.5 * (double)(self->rows - 1);
    double mean = 0.0;
    double product = 0.0;
    double square = 0.0;
    double rest = 0.0;
    for (size_t n = 0; n < self->rows; n++) {
        mean += x[n] / (double)self->rows;
    }
    for (size_t n = 0; n < self->rows; n++) {
        const double distance = (double)n - middle;
        product += distance * (x[n] - mean);
        square += distance * distance;
    }
    const double slope = product / square;
    for (size_t n = 0; n < self->rows; n++) {
        const double left = x[n] - mean - slope * ((double)n - middle);
        rest += left * left / (double)self->rows;
    }
    const double height = fmax(fabs(slope) * (double)self->rows, rounding_of_ramp * fabs(mean));
    if (sqrt(rest) > rounding_of_ramp * height) {
        return 0;
    }
    return error_set(out_error, error_refused,
                     "%s: %s is a straight line from %.6g to %.6g, and what else is in it, %.2g RMS, is rounding: "
                     "expected a signal that excites the drive, see --input, --reference",
                     self->run->path, column, x[0], x[self->rows - 1], sqrt(rest));
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
    status = check_excites(out_self, out_self->input, out_error);
    return status || !out_self->reference ? status : check_excites(out_self, out_self->reference, out_error);
}
