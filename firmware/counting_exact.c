/* SPDX-License-Identifier: MIT */
/* Tables are made at start-up here, of whatever period the excitation has; what a call costs does not depend on where
 * they are. The longest of all frames of a period, and the mean of a sample that comes in a block. */
#include "firmware/board.h"
#include "firmware/counting.h"
#include "firmware/print.h"
#include "frf/dft.h"

#include "excitation-dft.h"

enum { period = EXCITATION_DFT_PERIOD_SAMPLES, bin_count = 32, channels_max = 2, block = 32, singles = 256 };

static union frf_word words[FRF_STORAGE_WORDS(bin_count, channels_max)];
static union {
    int16_t q15[FRF_TWIDDLE_WORDS(EXCITATION_DFT_PERIOD_SAMPLES)];
    int32_t q31[FRF_TWIDDLE_WORDS(EXCITATION_DFT_PERIOD_SAMPLES)];
    float f32[FRF_TWIDDLE_WORDS(EXCITATION_DFT_PERIOD_SAMPLES)];
} table;
static struct frf_point coarse[FRF_COARSE_POINTS(EXCITATION_DFT_PERIOD_SAMPLES)];
static struct frf_turn fine[FRF_FINE_TURNS(EXCITATION_DFT_PERIOD_SAMPLES)];
static struct frf_turn_q15 fine_q15[FRF_FINE_TURNS(EXCITATION_DFT_PERIOD_SAMPLES)];
static struct frf_point_f32 coarse_f32[FRF_COARSE_POINTS(EXCITATION_DFT_PERIOD_SAMPLES)];
static struct frf_turn_f32 fine_f32[FRF_FINE_TURNS(EXCITATION_DFT_PERIOD_SAMPLES)];

typedef enum core_status set_up(struct frf_dft *dft, const struct frf_dft_config *config);

static enum core_status full_q15(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_twiddles_q15 twiddles;
    counting_require(frf_twiddles_build_q15(table.q15, FRF_TWIDDLE_WORDS(period), period, &twiddles));
    return frf_dft_init_q15(dft, config, &twiddles);
}

static enum core_status full_q23(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_twiddles_q23 twiddles;
    counting_require(frf_twiddles_build_q23(table.q31, FRF_TWIDDLE_WORDS(period), period, &twiddles));
    return frf_dft_init_q23(dft, config, &twiddles);
}

static enum core_status full_q31(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_twiddles_q31 twiddles;
    counting_require(frf_twiddles_build_q31(table.q31, FRF_TWIDDLE_WORDS(period), period, &twiddles));
    return frf_dft_init_q31(dft, config, &twiddles);
}

static enum core_status full_f32(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_twiddles_f32 twiddles;
    counting_require(frf_twiddles_build_f32(table.f32, FRF_TWIDDLE_WORDS(period), period, &twiddles));
    return frf_dft_init_f32(dft, config, &twiddles);
}

static enum core_status quarter_q15(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_quarter_q15 quarter;
    counting_require(frf_quarter_build_q15(table.q15, FRF_QUARTER_WORDS(period), period, &quarter));
    return frf_dft_init_quarter_q15(dft, config, &quarter);
}

static enum core_status quarter_q23(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_quarter_q23 quarter;
    counting_require(frf_quarter_build_q23(table.q31, FRF_QUARTER_WORDS(period), period, &quarter));
    return frf_dft_init_quarter_q23(dft, config, &quarter);
}

static enum core_status quarter_q31(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_quarter_q31 quarter;
    counting_require(frf_quarter_build_q31(table.q31, FRF_QUARTER_WORDS(period), period, &quarter));
    return frf_dft_init_quarter_q31(dft, config, &quarter);
}

static enum core_status quarter_f32(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_quarter_f32 quarter;
    counting_require(frf_quarter_build_f32(table.f32, FRF_QUARTER_WORDS(period), period, &quarter));
    return frf_dft_init_quarter_f32(dft, config, &quarter);
}

static enum core_status two_level_q15(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_two_level_q15 levels;
    counting_require(
        frf_two_level_build_q15(coarse, FRF_COARSE_POINTS(period), fine_q15, FRF_FINE_TURNS(period), period, &levels));
    return frf_dft_init_two_level_q15(dft, config, &levels);
}

static enum core_status two_level_q23(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_two_level_q23 levels;
    counting_require(
        frf_two_level_build_q23(coarse, FRF_COARSE_POINTS(period), fine, FRF_FINE_TURNS(period), period, &levels));
    return frf_dft_init_two_level_q23(dft, config, &levels);
}

static enum core_status two_level_q31(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_two_level_q31 levels;
    counting_require(
        frf_two_level_build_q31(coarse, FRF_COARSE_POINTS(period), fine, FRF_FINE_TURNS(period), period, &levels));
    return frf_dft_init_two_level_q31(dft, config, &levels);
}

static enum core_status two_level_f32(struct frf_dft *dft, const struct frf_dft_config *config)
{
    struct frf_two_level_f32 levels;
    counting_require(frf_two_level_build_f32(coarse_f32, FRF_COARSE_POINTS(period), fine_f32, FRF_FINE_TURNS(period),
                                             period, &levels));
    return frf_dft_init_two_level_f32(dft, config, &levels);
}

/* The kernels take the same time whatever they multiply; the limits of the converter are what costs most. */
static void add(struct frf_dft *dft, uint32_t count)
{
    static const int16_t frames_i16[block * channels_max] = {INT16_MIN, INT16_MIN, INT16_MIN, INT16_MIN};
    static const int32_t frames_i24[block * channels_max] = {FRF_I24_MIN, FRF_I24_MIN, FRF_I24_MIN, FRF_I24_MIN};
    static const float frames_f32[block * channels_max] = {-1.0f, -1.0f, -1.0f, -1.0f};
    if (dft->number == frf_number_f32) {
        frf_dft_add_f32(dft, frames_f32, count);
    } else if (dft->number == frf_number_q23) {
        frf_dft_add_i24(dft, frames_i24, count);
    } else {
        frf_dft_add_i16(dft, frames_i16, count);
    }
}

static void count(const char *name, set_up *set)
{
    const struct frf_dft_config config = {
        excitation_dft_bins, bin_count, channels_max, words, sizeof words / sizeof *words, 0, 0};
    struct frf_dft dft;
    uint32_t all = 0, most = 0, blocks = period / block;
    counting_require(set(&dft, &config));
    for (uint32_t b = 0; b < blocks; ++b) {
        uint32_t begin = board_instructions();
        add(&dft, block);
        all += counting_since(begin);
    }
    for (uint32_t n = 0; n < singles; ++n) {
        uint32_t begin = board_instructions();
        add(&dft, 1);
        counting_keep_most(&most, counting_since(begin));
    }
    board_print("frf_dft_add/");
    board_print(name);
    counting_print("/in-blocks-mean/32-bins/2-channels", all / (blocks * block));
    board_print("frf_dft_add/");
    board_print(name);
    counting_print("/a-frame/32-bins/2-channels", most);
}

void counting_exact(void)
{
    count("q15/full", full_q15);
    count("q15/quarter", quarter_q15);
    count("q15/two-level", two_level_q15);
    count("q23/full", full_q23);
    count("q23/quarter", quarter_q23);
    count("q23/two-level", two_level_q23);
    count("q31/full", full_q31);
    count("q31/quarter", quarter_q31);
    count("q31/two-level", two_level_q31);
    count("f32/full", full_f32);
    count("f32/quarter", quarter_f32);
    count("f32/two-level", two_level_f32);
}
