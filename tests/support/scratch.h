/* SPDX-License-Identifier: MIT */
/// Files that a test writes and reads: a temporary folder of its own, removed at the end.
/// Call scratch_open() in main before the tests and scratch_close() after them.
#ifndef SERVOSCOPE_TESTS_SUPPORT_SCRATCH_H
#define SERVOSCOPE_TESTS_SUPPORT_SCRATCH_H

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static char scratch_folder[256];

static inline void scratch_open(void)
{
    const char *parent = getenv("TMPDIR");
    if (!parent) // in memory if possible: writing to the disk waits for it, thousands of times
        parent = access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp";
    snprintf(scratch_folder, sizeof scratch_folder, "%s/servoscope-test-XXXXXX", parent);
    if (!mkdtemp(scratch_folder)) {
        perror(scratch_folder);
        exit(1);
    }
}

/// Path of a file in the folder; four paths are remembered at a time.
static inline const char *scratch_path(const char *name)
{
    static char paths[4][512];
    static unsigned next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", scratch_folder, name);
    return path;
}

static inline const char *scratch_bytes(const char *name, const void *bytes, size_t length)
{
    const char *path = scratch_path(name);
    FILE *stream = fopen(path, "wb");
    if (!stream || fwrite(bytes, 1, length, stream) != length || fclose(stream) != 0) {
        perror(path);
        exit(1);
    }
    return path;
}

static inline const char *scratch_text(const char *name, const char *text)
{
    return scratch_bytes(name, text, strlen(text));
}

/// A file's bytes with a zero behind them, to be freed; NULL if it is not there.
static inline char *scratch_load(const char *path, size_t *out_length)
{
    FILE *stream = fopen(path, "rb");
    if (!stream)
        return NULL;
    fseek(stream, 0, SEEK_END);
    size_t length = (size_t)ftell(stream);
    rewind(stream);
    char *bytes = calloc(length + 1, 1);
    if (!bytes || fread(bytes, 1, length, stream) != length) {
        perror(path);
        exit(1);
    }
    fclose(stream);
    if (out_length)
        *out_length = length;
    return bytes;
}

/// How many files the folder holds: none may be left over by a failed write.
static inline int scratch_count(void)
{
    int count = 0;
    DIR *folder = opendir(scratch_folder);
    for (const struct dirent *entry; folder && (entry = readdir(folder));)
        count += strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0;
    if (folder)
        closedir(folder);
    return count;
}

static inline void scratch_empty(void)
{
    DIR *folder = opendir(scratch_folder);
    for (const struct dirent *entry; folder && (entry = readdir(folder));)
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
            unlink(scratch_path(entry->d_name));
    if (folder)
        closedir(folder);
}

static inline void scratch_close(void)
{
    scratch_empty();
    rmdir(scratch_folder);
}

#endif
