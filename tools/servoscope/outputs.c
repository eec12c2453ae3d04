/* SPDX-License-Identifier: MIT */
#include "tools/servoscope/outputs.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
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

static int check_folder(const char *path, struct error *out_error)
{
    struct stat file;
    if (stat(path, &file) == 0 && S_ISDIR(file.st_mode)) {
        return error_set(out_error, error_refused, "%s: is a folder, a file name was expected", path);
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
