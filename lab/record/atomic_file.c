/* SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* realpath */
#include "lab/record/atomic_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { temporary_name_tries = 100 };

static void forget(struct atomic_file *self)
{
    free(self->path);
    free(self->temporary);
    *self = (struct atomic_file){0};
}

/* A name beside `path` that does not exist yet. open() with O_EXCL rather than mkstemp(), which would give the file
 * mode 600 instead of what the user's umask says. */
static int create_temporary(struct atomic_file *self, const struct stat *old)
{
    size_t size = strlen(self->path) + 48;
    self->temporary = malloc(size);
    if (!self->temporary)
        return -1;
    for (int attempt = 0; attempt < temporary_name_tries; attempt++) {
        snprintf(self->temporary, size, "%s.tmp-%ld-%d", self->path, (long)getpid(), attempt);
        int file = open(self->temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (file >= 0) {
            if (old)
                (void)fchmod(file, old->st_mode & 0777);
            return file;
        }
        if (errno != EEXIST)
            break;
    }
    free(self->temporary);
    self->temporary = NULL;
    return -1;
}

FILE *atomic_file_open(struct atomic_file *self, const char *path, struct error *out_error)
{
    *self = (struct atomic_file){0};
    struct stat old;
    bool exists = stat(path, &old) == 0;
    if (exists && S_ISDIR(old.st_mode)) {
        error_set(out_error, error_refused, "%s: is a folder, a file name was expected", path);
        return NULL;
    }
    // A pipe behind /dev/stdout has no path of its own.
    bool in_place = exists && !S_ISREG(old.st_mode);
    self->path = exists && !in_place ? realpath(path, NULL) : strdup(path);
    int file = -1;
    if (self->path) {
        file = in_place ? open(path, O_WRONLY | O_CLOEXEC) : create_temporary(self, exists ? &old : NULL);
    }
    if (file >= 0)
        self->stream = fdopen(file, "w");
    if (self->stream)
        return self->stream;
    error_set(out_error, error_refused, "%s: cannot be written: %s", path, strerror(errno));
    if (file >= 0)
        close(file);
    if (self->temporary)
        unlink(self->temporary);
    forget(self);
    return NULL;
}

/* Returns 0 or the errno of the first step that failed. A stream that failed earlier may have lost its errno to later
 * calls; what is left there counts only if it can have come from a write. */
static int flush_and_close(struct atomic_file *self)
{
    int reason = ferror(self->stream) ? (errno == ENOSPC || errno == EFBIG ? errno : EIO) : 0;
    if (fflush(self->stream) != 0 && (reason == 0 || reason == EIO))
        reason = errno;
    if (reason == 0 && self->temporary && fsync(fileno(self->stream)) != 0)
        reason = errno;
    if (fclose(self->stream) != 0 && reason == 0)
        reason = errno;
    self->stream = NULL;
    return reason;
}

int atomic_file_commit(struct atomic_file *self, struct error *out_error)
{
    if (!self->stream)
        return error_set(out_error, error_refused, "file is not open for writing");
    int reason = flush_and_close(self);
    if (reason == 0 && self->temporary && rename(self->temporary, self->path) != 0)
        reason = errno;
    int status = error_none;
    if (reason != 0) {
        status = error_set(out_error, error_refused, "%s: writing failed: %s; %s", self->path, strerror(reason),
                           self->temporary ? "the file is as it was before" : "what was written is not complete");
        if (self->temporary)
            unlink(self->temporary);
    }
    forget(self);
    return status;
}

void atomic_file_discard(struct atomic_file *self)
{
    if (self->stream)
        fclose(self->stream);
    if (self->temporary)
        unlink(self->temporary);
    forget(self);
}
