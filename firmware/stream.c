/* SPDX-License-Identifier: MIT */
/* A recording in flash through the whole integer path, from the sampling interrupt: guard, player, the DFT in both
 * exact number formats and in blocks. Prints every integer result; no floating point anywhere. Checks itself against
 * what the host has made of the same recording (expected_stream.h). */
#include "firmware/board.h"
#include "firmware/checksum.h"
#include "firmware/expected.h"
#include "firmware/print.h"
#include "firmware/sample_path.h"
#include "frf/dft.h"

#include "excitation-dft.h"
#include "excitation.h"
#include "recording.h"

enum { stream_rate_hz = 8000, q15_bins = EXCITATION_DFT_BIN_COUNT, q31_bins = 4 };

static struct sample_path path;
static struct frf_dft exact_q15, exact_q31;
static union frf_word storage_q15[FRF_STORAGE_WORDS(EXCITATION_DFT_BIN_COUNT, sample_path_channels)];
static union frf_word storage_q31[FRF_STORAGE_WORDS(q31_bins, sample_path_channels)];
static int32_t storage_block[FRF_BLOCK_STORAGE_WORDS(EXCITATION_DFT_BIN_COUNT, sample_path_channels, 2u,
                                                     EXCITATION_DFT_BLOCK_SAMPLES, EXCITATION_DFT_BLOCK_TERMS) +
                             FRF_BLOCK_SPREAD_WORDS(sample_path_channels, EXCITATION_DFT_BLOCK_SAMPLES)];
static uint32_t played[2];
static volatile uint32_t frame;

static void take_sample(void)
{
    if (frame == RECORDING_FRAMES) {
        return;
    }
    const int16_t *samples = recording_frames + frame * sample_path_channels;
    struct sample_path_input input = {.guard = {.velocity = samples[1], .torque = samples[0], .valid = true}};
    struct sample_path_output output;
    input.channels[0] = samples[0];
    input.channels[1] = samples[1];
    sample_path_step(&path, &input, &output);
    for (unsigned c = 0; c < msgen_channels_max; ++c) {
        checksum_add(played, output.reference[c]);
    }
    frf_dft_add_i16(&exact_q15, samples, 1);
    frf_dft_add_i16(&exact_q31, samples, 1);
    frame = frame + 1u;
}

static enum core_status set_up(struct msgen_table *out_table)
{
    static const struct guard_limits limits = GUARD_LIMITS_NONE;
    const struct msgen_player_config player = {.periods = RECORDING_FRAMES / EXCITATION_DFT_PERIOD_SAMPLES - 1u,
                                               .fade_in_samples = 200,
                                               .fade_out_samples = 200,
                                               .abort_samples = 400};
    const struct frf_block_config block = {.table = &excitation_dft_block_table,
                                           .channels = sample_path_channels,
                                           .banks = 2,
                                           .spread = true,
                                           .storage = storage_block,
                                           .storage_words = sizeof storage_block / sizeof *storage_block};
    const struct frf_dft_config q15 = {excitation_dft_bins,
                                       q15_bins,
                                       sample_path_channels,
                                       storage_q15,
                                       sizeof storage_q15 / sizeof *storage_q15,
                                       0,
                                       0};
    const struct frf_dft_config q31 = {excitation_dft_bins,
                                       q31_bins,
                                       sample_path_channels,
                                       storage_q31,
                                       sizeof storage_q31 / sizeof *storage_q31,
                                       0,
                                       0};
    enum core_status status = msgen_table_open(excitation_mst, sizeof excitation_mst, out_table);
    if (status == core_ok) {
        status = frf_dft_init_q15(&exact_q15, &q15, &excitation_dft_twiddles_q15);
    }
    if (status == core_ok) {
        status = frf_dft_init_q31(&exact_q31, &q31, &excitation_dft_twiddles_q31);
    }
    return status == core_ok ? sample_path_init(&path, &limits, out_table, &player, &block, 0) : status;
}

static void print_sums(const char *name, uint32_t period, uint32_t bin, int64_t real, int64_t imaginary)
{
    board_print(name);
    board_print(" ");
    print_u32(period);
    board_print(" ");
    print_u32(excitation_dft_bins[bin % EXCITATION_DFT_BIN_COUNT]);
    board_print(bin / EXCITATION_DFT_BIN_COUNT == sample_path_torque ? " torque " : " velocity ");
    print_i64(real);
    board_print(" ");
    print_i64(imaginary);
    board_print("\n");
    expected_take(real);
    expected_take(imaginary);
}

/* Returns whether there was a new period. */
static bool read_exact(const char *name, const struct frf_dft *dft, uint32_t *io_sequence)
{
    struct frf_period period;
    if (!frf_dft_latest(dft, &period) || period.sequence == *io_sequence) {
        return false;
    }
    *io_sequence = period.sequence;
    for (uint32_t channel = 0; channel < dft->channels; ++channel) {
        for (uint32_t bin = 0; bin < dft->bin_count; ++bin) {
            print_sums(name, period.sequence, channel * EXCITATION_DFT_BIN_COUNT + bin,
                       frf_period_real(dft, &period, bin, channel), frf_period_imaginary(dft, &period, bin, channel));
        }
    }
    expected_take(frf_dft_is_intact(dft, &period));
    expected_take(period.reasons);
    return true;
}

static bool read_block(uint32_t *io_sequence)
{
    struct frf_block_period period;
    if (!frf_block_latest(&path.dft, &period) || period.sequence == *io_sequence) {
        return false;
    }
    *io_sequence = period.sequence;
    for (uint32_t i = 0; i < sample_path_channels * EXCITATION_DFT_BIN_COUNT; ++i) {
        int64_t real, imaginary;
        frf_block_sums(&path.dft, &period, i % EXCITATION_DFT_BIN_COUNT, i / EXCITATION_DFT_BIN_COUNT, &real,
                       &imaginary);
        print_sums("block", period.sequence, i, real, imaginary);
    }
    expected_take(frf_block_is_intact(&path.dft, &period));
    expected_take(period.reasons);
    return true;
}

int main(void)
{
    struct msgen_table table;
    uint32_t seen_q15 = 0, seen_q31 = 0, seen_block = 0, periods = 0;
    enum core_status status = set_up(&table);
    const struct guard_sample at_rest = {0, 0, 0, true};
    if (status != core_ok || guard_arm(&path.guard, &at_rest) != core_ok) {
        board_print(core_status_str(status));
        board_exit(1);
    }
    played[0] = 1u;
    board_start_samples(stream_rate_hz, take_sample);
    while (frame < RECORDING_FRAMES) {
        board_wait();
        periods += read_exact("q15", &exact_q15, &seen_q15);
        periods += read_exact("q31", &exact_q31, &seen_q31);
        periods += read_block(&seen_block);
    }
    board_print("played ");
    print_hex(played[0]);
    print_hex(played[1]);
    board_print("\nperiods ");
    print_u32(periods);
    board_print("\n");
    expected_take(played[0]);
    expected_take(played[1]);
    board_exit(expected_finish() ? 0 : 2);
}
