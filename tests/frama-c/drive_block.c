/* SPDX-License-Identifier: MIT */
/* The block DFT over any samples, cuts and gaps, folded, with a basis and in parts, with any coefficients. */
#include "tests/frama-c/any.h"

#include "frf/block.h"

enum { period = 16, block = 8, words_max = 64 };

static const uint32_t bins[2] = {2, 6};
static int32_t rows[words_max], restore[4], basis[words_max], storage[words_max], part[words_max];
static int16_t samples[2 * period];

/* Cuts, gaps and periods are numbers, so that Eva follows them one by one; samples and coefficients are any. What one
 * call leaves is joined before the next. */
static void run(const struct frf_block_table *table, bool spread)
{
    struct frf_block dft;
    struct frf_block_period latched = {storage, 0, 0};
    struct frf_block_config config = {table, 1, 1, spread, storage, words_max, part, words_max, 0, 0};
    if (frf_block_init(&dft, &config) != core_ok) {
        return;
    }
    static const uint32_t counts[3] = {3, period, period + 5}, gaps[3] = {0, 2, 7};
    for (uint32_t call = 0; call < 3; ++call) {
        for (uint32_t i = 0; i < 2u * period; ++i) {
            samples[i] = any_i16_between(INT16_MIN, INT16_MAX);
        }
        frf_block_add_i16(&dft, samples, counts[call]);
        frf_block_skip(&dft, gaps[call]);
        frf_block_mark(&dft, any_u32());
        /* Until there is one a period is whatever lies in storage. */
        int64_t real, imaginary;
        (void)frf_block_latest(&dft, &latched);
        frf_block_sums(&dft, &latched, any_between(0, 1), 0, &real, &imaginary);
        //@ slevel merge;
    }
    frf_block_restart(&dft);
}

int main(void)
{
    struct frf_block_table table = {rows, restore, 0, bins, 2, period, period, 0, false, {block, block, 1}, 8};
    for (uint32_t i = 0; i < words_max; ++i) {
        rows[i] = any_i32();
        basis[i] = any_i32();
    }
    for (uint32_t i = 0; i < 4; ++i) {
        /* With any coefficients accumulators fill their 32 bits, where those of a table stay below 2^30: half the
         * factor. */
        restore[i] = any_i32() / 2;
    }
    run(&table, false);
    run(&table, true);
    table.layout.terms = 4;
    table.basis = basis;
    table.gain_shift = 0;
    run(&table, false);
    run(&table, true);
    table.layout.terms = block;
    table.basis = 0;
    table.layout.repeats = 2;
    table.part_samples = period / 2;
    table.alternate = true;
    run(&table, false);
    run(&table, true);
    return 0;
}
