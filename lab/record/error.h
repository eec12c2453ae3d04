/* SPDX-License-Identifier: MIT */
/// How every host-side function says what went wrong.
/// A function that can fail takes `struct error *out_error` last, returns 0 or a non-zero exit status, and fills in one
/// line for the person at the machine: place (file, line), value, what was expected. The caller prints it, once.
#ifndef SERVOSCOPE_RECORD_ERROR_H
#define SERVOSCOPE_RECORD_ERROR_H

enum {
    error_none = 0,
    error_refused = 1, ///< data refused, limit violated, drive fault: exit status 1
    error_usage = 2,   ///< wrong usage: exit status 2
};

struct error {
    int status;         ///< one of the values above
    char message[1024]; ///< one line without the newline; empty if status is 0
};

/// Fills in *out_error (which may be NULL) and returns `status`, so that a caller can write `return error_set(...)`.
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
int error_set(struct error *out_error, int status, const char *format, ...);

#endif
