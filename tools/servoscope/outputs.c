/* SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* mkstemp */
#include "tools/servoscope/outputs.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

/// Whether two names lead to one ordinary file.
static bool same_file(const char *one, const char *other)
{
    struct stat a, b;
    if (strcmp(one, other) == 0) {
        return strncmp(one, "/dev/", 5) != 0;
    }
    return stat(one, &a) == 0 && stat(other, &b) == 0 && S_ISREG(a.st_mode) && a.st_dev == b.st_dev &&
           a.st_ino == b.st_ino;
}

static bool is_among(const char *path, const char *const *others, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (others[i] && same_file(path, others[i])) {
            return true;
        }
    }
    return false;
}

/// What is written to try a disk, and what has to be free on it: the smallest result with room around it.
enum { probe_bytes = 4096, free_bytes = 1 << 16 };

/// A device that is no terminal takes a line end, or it takes nothing: /dev/full.
static int check_device(const char *path, struct error *out_error)
{
    const int file = open(path, O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    int reason = file < 0 ? errno : 0;
    if (file >= 0 && !isatty(file) && write(file, "\n", 1) != 1) {
        reason = errno;
    }
    if (file >= 0) {
        close(file);
    }
    return reason ? error_set(out_error, error_refused, "%s: cannot be written: %s", path, strerror(reason)) : 0;
}

/// Whether the folder's disk takes a file of some size: it may be full, or a quota used up. Leaves nothing behind.
static int probe_folder(const char *path, const char *folder, struct error *out_error)
{
    static const char nothing[probe_bytes];
    struct statvfs disk;
    if (statvfs(folder, &disk) == 0 && disk.f_blocks > 0 &&
        (double)disk.f_bavail * (double)disk.f_frsize < free_bytes) {
        return error_set(out_error, error_refused, "%s: cannot be written: %s", path, strerror(ENOSPC));
    }
    const size_t size = strlen(folder) + 32;
    char *name = malloc(size);
    if (!name) {
        return error_set(out_error, error_refused, "memory is short");
    }
    snprintf(name, size, "%s/.servoscope-XXXXXX", folder);
    const int file = mkstemp(name);
    int reason = file < 0 ? errno : 0;
    if (file >= 0) {
        const ssize_t written = write(file, nothing, sizeof nothing);
        reason = written < 0 ? errno : written < probe_bytes ? ENOSPC : 0;
        close(file);
        unlink(name);
    }
    free(name);
    return reason ? error_set(out_error, error_refused, "%s: cannot be written: %s", path, strerror(reason)) : 0;
}

static int check_folder(const char *path, struct error *out_error)
{
    struct stat file;
    if (stat(path, &file) == 0 && S_ISDIR(file.st_mode)) {
        return error_set(out_error, error_refused, "%s: is a folder, a file name was expected", path);
    }
    if (stat(path, &file) == 0 && !S_ISREG(file.st_mode)) {
        return S_ISCHR(file.st_mode) ? check_device(path, out_error) : 0;
    }
    const char *slash = strrchr(path, '/');
    size_t length = slash ? (size_t)(slash - path) : 0;
    char *folder = malloc(length + 2);
    if (!folder) {
        return error_set(out_error, error_refused, "memory is short");
    }
    memcpy(folder, path, length);
    strcpy(folder + length, slash ? "/" : ".");
    int status = 0;
    if (access(folder, W_OK) != 0) {
        status = error_set(out_error, error_refused, "%s: cannot be written: %s: %s", path, folder, strerror(errno));
    } else {
        status = probe_folder(path, folder, out_error);
    }
    free(folder);
    return status;
}

int outputs_check(const char *const *inputs, size_t input_count, const char *const *outputs, size_t output_count,
                  struct error *out_error)
{
    int status = 0;
    for (size_t i = 0; i < output_count && !status; i++) {
        if (!outputs[i]) {
            continue;
        }
        if (is_among(outputs[i], inputs, input_count) || is_among(outputs[i], outputs, i)) {
            status = error_set(out_error, error_usage, "%s: would be overwritten: name another file for the result",
                               outputs[i]);
        } else {
            status = check_folder(outputs[i], out_error);
        }
    }
    return status;
}
