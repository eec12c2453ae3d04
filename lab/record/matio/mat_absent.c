/* SPDX-License-Identifier: MIT */
/// In the place of mat_read.c, mat_write.c and mat_library.c where matio is not there.
#include "lab/record/mat_file.h"

static int refuse(const char *path, struct error *out_error)
{
    return error_set(out_error, error_refused,
                     "%s: this servoscope was built without matio, which MATLAB files need: install libmatio-dev "
                     "(Debian, Ubuntu; others: matio) and build again (./run build does both); or use --to uff or csv",
                     path);
}

bool mat_built_in(void)
{
    return false;
}

int mat_read_record(const char *path, const struct format_options *options, struct record *out_record,
                    struct format_notes *io_notes, struct error *out_error)
{
    (void)options;
    (void)io_notes;
    *out_record = (struct record){0};
    return refuse(path, out_error);
}

int mat_write_record(const char *path, const struct record *record, enum mat_version version,
                     struct format_notes *io_notes, struct error *out_error)
{
    (void)record;
    (void)version;
    (void)io_notes;
    return refuse(path, out_error);
}
