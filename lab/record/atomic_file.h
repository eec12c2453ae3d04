/* SPDX-License-Identifier: MIT */
/// Output files that are whole or as they were: written under a temporary name in the same folder, flushed to the disk,
/// then renamed over the old one. Every file that servoscope writes goes through here.
///
///     struct atomic_file file;
///     FILE *stream = atomic_file_open(&file, path, out_error);
///     if (!stream) return out_error->status;
///     fprintf(stream, ...);                       (results need not be checked: commit does)
///     return atomic_file_commit(&file, out_error);
///
/// A device or a pipe (/dev/stdout, /dev/null) has nothing to rename over and is written in place. A symbolic link
/// stays; the file it leads to is replaced.
#ifndef SERVOSCOPE_RECORD_ATOMIC_FILE_H
#define SERVOSCOPE_RECORD_ATOMIC_FILE_H

#include "lab/record/error.h"

#include <stdio.h>

/// Between open and commit or discard; all NULL outside. Read-only for the application.
struct atomic_file {
    FILE *stream;    ///< to write to
    char *path;      ///< where the file will be; owned
    char *temporary; ///< where it is now; owned; NULL when written in place
};

/// Opens a file for writing and returns its stream, NULL on error.
/// Errors: error_refused with the path and the system's reason; *self then needs no discard.
/// Test:   tests/unit/test_atomic_file.c
FILE *atomic_file_open(struct atomic_file *self, const char *path, struct error *out_error);

/// Puts the file in place and closes it.
/// Errors: error_refused if any write since open failed (disk full, quota), if flushing or renaming failed: the
///         temporary file is removed and `path` is as it was. *self is empty afterwards in every case.
/// Test:   tests/unit/test_atomic_file.c, tests/fault/test_record_files.c
int atomic_file_commit(struct atomic_file *self, struct error *out_error);

/// Closes and removes the temporary file; harmless on an empty or committed *self.
void atomic_file_discard(struct atomic_file *self);

#endif
