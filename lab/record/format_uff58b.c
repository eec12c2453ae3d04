/* SPDX-License-Identifier: MIT */
/// Universal files in binary, dataset 58b: every bit of every number; format_uff.c reads them.
#include "lab/record/uff_write.h"

static int write_uff58b(const char *path, const struct record *record, struct format_notes *io_notes,
                        struct error *out_error)
{
    return uff_write_record(path, record, true, io_notes, out_error);
}

const struct record_format record_format_uff58b = {
    .name = "uff58b",
    .summary = "universal file, dataset 58b, binary: all digits",
    .write = write_uff58b,
};
