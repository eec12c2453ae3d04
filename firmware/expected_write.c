/* SPDX-License-Identifier: MIT */
/* Writes to the file that FIRMWARE_EXPECTED in the environment names. */
#include "firmware/expected.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

enum { values_max = 4096 };
static int64_t values[values_max];
static uint32_t count;

void expected_take(int64_t value)
{
    if (count < values_max) {
        values[count] = value;
    }
    ++count;
}

bool expected_finish(void)
{
    const char *path = getenv("FIRMWARE_EXPECTED");
    FILE *file = path && count <= values_max ? fopen(path, "w") : NULL;
    if (!file) {
        fprintf(stderr, "FIRMWARE_EXPECTED: expected the name of a file to write, for at most %d values\n", values_max);
        return false;
    }
    fprintf(file, "/* Made by firmware/expected_write.c. */\n#define EXPECTED_COUNT %" PRIu32 "u\n", count);
    fprintf(file, "static const uint32_t expected_values[2u * EXPECTED_COUNT] = {\n");
    for (uint32_t i = 0; i < count; ++i) {
        uint64_t bits = (uint64_t)values[i];
        fprintf(file, "    0x%" PRIx32 ",0x%" PRIx32 ",\n", (uint32_t)bits, (uint32_t)(bits >> 32));
    }
    fprintf(file, "};\n");
    return fclose(file) == 0;
}
