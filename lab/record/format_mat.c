/* SPDX-License-Identifier: MIT */
/// MATLAB files: any version is read, version 5 is written.
#include "lab/record/mat_file.h"

#include <string.h>

/* The text at the beginning, or the version and the mark of the byte order at the end of the 128 bytes of the header.
 * */
static enum format_match recognise(const unsigned char *head, size_t length)
{
    bool text = length >= 7 && memcmp(head, "MATLAB ", 7) == 0;
    bool mark = length >= 128 && (memcmp(head + 124, "\0\1IM", 4) == 0 || memcmp(head + 124, "\1\0MI", 4) == 0 ||
                                  memcmp(head + 124, "\0\2IM", 4) == 0 || memcmp(head + 124, "\2\0MI", 4) == 0);
    return text || mark ? format_match_sure : format_match_none;
}

static int write_mat(const char *path, const struct record *record, struct format_notes *io_notes,
                     struct error *out_error)
{
    return mat_write_record(path, record, mat_version_5, io_notes, out_error);
}

const struct record_format record_format_mat = {
    .name = "mat",
    .summary = "MATLAB file, version 5; read also in version 7.3",
    .endings = {".mat"},
    .recognise = recognise,
    .read = mat_read_record,
    .write = write_mat,
};
