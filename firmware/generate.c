/* SPDX-License-Identifier: MIT */
/* Writes the const tables of a measurement as a C header, made on the host so that nothing is calculated at start-up
 * and flash holds what does not change: bins, twiddles, the block DFT's coefficients. Reads an .mst file.
 * usage: generate TABLE.mst BLOCK_SAMPLES >measurement.h */
#include "frf/block_table.h"
#include "frf/twiddle.h"
#include "msgen/table.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

enum { table_bytes_max = 1 << 24, per_line = 8 };

static void fail(const char *what, const char *why)
{
    fprintf(stderr, "generate: %s: %s\n", what, why);
    exit(1);
}

static void *allocate(size_t count, size_t size)
{
    void *memory = calloc(count, size);
    if (!memory) {
        fail("memory", "there is not enough");
    }
    return memory;
}

static void check(const char *what, enum core_status status)
{
    if (status != core_ok) {
        fail(what, core_status_str(status));
    }
}

static void print_words(const char *type, const char *name, const int32_t *values, uint32_t count)
{
    printf("static const %s measurement_%s[%" PRIu32 "] = {", type, name, count);
    for (uint32_t i = 0; i < count; ++i) {
        /* The smallest integer is no constant of its own in C. */
        if (values[i] == INT32_MIN) {
            printf("%s-2147483647 - 1,", i % per_line == 0 ? "\n    " : "");
        } else {
            printf("%s%" PRId32 ",", i % per_line == 0 ? "\n    " : "", values[i]);
        }
    }
    printf("\n};\n\n");
}

static void print_twiddles(uint32_t period)
{
    uint32_t words = FRF_TWIDDLE_WORDS(period);
    int16_t *q15 = allocate(words, sizeof *q15);
    int32_t *q31 = allocate(words, sizeof *q31), *wide = allocate(words, sizeof *wide);
    struct frf_twiddles_q15 table_q15;
    struct frf_twiddles_q31 table_q31;
    check("twiddles", frf_twiddles_build_q15(q15, words, period, &table_q15));
    check("twiddles", frf_twiddles_build_q31(q31, words, period, &table_q31));
    for (uint32_t i = 0; i < words; ++i) {
        wide[i] = q15[i];
    }
    print_words("int16_t", "sines_q15", wide, words);
    print_words("int32_t", "sines_q31", q31, words);
    printf("static const struct frf_twiddles_q15 measurement_twiddles_q15 = {\n"
           "    measurement_sines_q15 + %d, measurement_sines_q15 + %d, %" PRIu32 "u};\n"
           "static const struct frf_twiddles_q31 measurement_twiddles_q31 = {\n"
           "    measurement_sines_q31 + %d, measurement_sines_q31 + %d, %" PRIu32 "u};\n\n",
           (int)(table_q15.sine - q15), (int)(table_q15.cosine - q15), period, (int)(table_q31.sine - q31),
           (int)(table_q31.cosine - q31), period);
    free(q15);
    free(q31);
    free(wide);
}

static void print_block(const uint32_t *bins, uint32_t bin_count, uint32_t period, uint32_t block)
{
    const struct frf_block_layout layout = {block, block, 1};
    uint32_t words = FRF_BLOCK_TABLE_WORDS(bin_count, block, block);
    int32_t *storage = allocate(words, sizeof *storage);
    struct frf_block_table table;
    check("block table", frf_block_build(storage, words, bins, bin_count, period, &layout, &table));
    print_words("int32_t", "coefficients", storage, words);
    printf("static const struct frf_block_table measurement_block_table = {\n"
           "    .rows = measurement_coefficients + %d,\n    .restore = measurement_coefficients + %d,\n"
           "    .bins = measurement_bins,\n    .bin_count = %" PRIu32 "u,\n    .period_samples = %" PRIu32
           "u,\n    .part_samples = %" PRIu32 "u,\n    .layout = {%" PRIu32 "u, %" PRIu32
           "u, 1u},\n    .gain_shift = %" PRIu32 "u};\n\n",
           (int)(table.rows - storage), (int)(table.restore - storage), bin_count, period, table.part_samples, block,
           block, table.gain_shift);
    free(storage);
}

static size_t read_file(const char *path, uint8_t *out_bytes)
{
    FILE *file = fopen(path, "rb");
    if (!file) {
        fail(path, "cannot be read");
    }
    size_t size = fread(out_bytes, 1, table_bytes_max, file);
    fclose(file);
    return size;
}

int main(int argument_count, char **arguments)
{
    if (argument_count != 3) {
        fail("usage", "generate TABLE.mst BLOCK_SAMPLES");
    }
    uint8_t *bytes = allocate(table_bytes_max, 1);
    struct msgen_table table;
    check(arguments[1], msgen_table_open(bytes, read_file(arguments[1], bytes), &table));
    uint32_t *bins = allocate(table.bin_count, sizeof *bins);
    printf("/* Made by firmware/generate.c. */\n#ifndef MEASUREMENT_H\n#define MEASUREMENT_H\n\n"
           "#include \"frf/block_table.h\"\n#include \"frf/twiddle.h\"\n\n"
           "#define MEASUREMENT_PERIOD_SAMPLES %" PRIu32 "u\n#define MEASUREMENT_BIN_COUNT %" PRIu32
           "u\n#define MEASUREMENT_BLOCK_SAMPLES %su\n\nstatic const uint32_t measurement_bins[%" PRIu32 "] = {\n    ",
           table.period_samples, table.bin_count, arguments[2], table.bin_count);
    for (uint32_t i = 0; i < table.bin_count; ++i) {
        bins[i] = msgen_table_bin(&table, i);
        printf("%" PRIu32 ",", bins[i]);
    }
    printf("\n};\n\n");
    print_twiddles(table.period_samples);
    print_block(bins, table.bin_count, table.period_samples, (uint32_t)strtoul(arguments[2], NULL, 10));
    printf("#endif\n");
    free(bins);
    free(bytes);
    return 0;
}
