/* SPDX-License-Identifier: MIT */
/// MATLAB files of version 7.3; format_mat.c reads them.
#include "lab/record/mat_file.h"

static int write_mat73(const char *path, const struct record *record, struct format_notes *io_notes,
                       struct error *out_error)
{
    return mat_write_record(path, record, mat_version_73, io_notes, out_error);
}

const struct record_format record_format_mat73 = {
    .name = "mat73",
    .summary = "MATLAB file, version 7.3 (HDF5), for variables of 2 GiB and more",
    .write = write_mat73,
};
