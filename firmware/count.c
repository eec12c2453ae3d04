/* SPDX-License-Identifier: MIT */
/* Instructions of each call, the most of all calls: inputs that take the longest way through each function are made
 * here on purpose, and where several could be the longest all are tried. A line each: name, instructions. Runs on the
 * MPS2 boards, with -icount shift=6; a core's code may run on a bigger core's model, the instructions are the same. */
#include "core/crc32.h"
#include "firmware/board.h"
#include "firmware/counting.h"
#include "firmware/print.h"
#include "frf/block.h"
#include "frf/dft.h"
#include "guard/guard.h"
#include "msgen/player.h"

#include "excitation-dft.h"
#include "excitation.h"

enum {
    bins_max = 200,
    channels_max = 3,
    block_max = 128,
    part_max = 512,
    small_period = 8,
    exact_bins = 32,
};

// ---- Player

static uint8_t travelling[msgen_header_travel_bytes + 4u + small_period * 3u * 4u];

/* A table that travels, of alternating extremes: every product is as long as it gets. */
static void make_travelling_table(struct msgen_table *out_table)
{
    struct msgen_table header = {.rate_num_hz = 8000,
                                 .rate_den = 1,
                                 .period_samples = small_period,
                                 .bin_count = 1,
                                 .channels = 3,
                                 .format = msgen_format_i32,
                                 .travel_q30 = ((int64_t)12345 << 30) + 7};
    uint8_t *data = travelling + msgen_header_travel_bytes;
    for (uint32_t i = 0; i < 3u; ++i) {
        header.scale_bits[i] = 0x3F800000u;
    }
    data[0] = 1u;
    for (uint32_t i = 0; i < small_period * 3u; ++i) {
        data[4u + 4u * i + 2u] = (uint8_t)(i % 2u == 0 ? 0x7Fu : 0x80u);
        data[4u + 4u * i + 3u] = (uint8_t)(i % 2u == 0 ? 0x00u : 0xFFu);
    }
    header.data_crc32 = core_crc32(0, data, 4u + small_period * 3u * 4u);
    counting_require(msgen_table_encode_header(&header, travelling));
    counting_require(msgen_table_open(travelling, sizeof travelling, out_table));
}

static void count_run(struct msgen_player *player, uint32_t abort_at, uint32_t *io_step, uint32_t *io_abort)
{
    int32_t samples[msgen_channels_max];
    for (uint32_t i = 0; i < 400u && player->phase != msgen_phase_done; ++i) {
        uint32_t begin = board_instructions();
        msgen_player_step(player, samples);
        counting_keep_most(io_step, counting_since(begin));
        if (i == abort_at) {
            begin = board_instructions();
            msgen_player_abort(player);
            counting_keep_most(io_abort, counting_since(begin));
        }
    }
}

static void count_player(void)
{
    struct msgen_table table;
    struct msgen_player player;
    struct msgen_player_config config = {.periods = 3, .abort_samples = 20};
    uint32_t most = 0, most_abort = 0;
    make_travelling_table(&table);
    for (unsigned way = 0; way < 4u; ++way) {
        config.fade_in_samples = way % 2u == 0 ? 30u : 0;
        config.approach_samples = way % 2u == 0 ? 0 : 30u;
        config.dwell_samples = way % 2u == 0 ? 0 : 10u;
        config.fade_out_samples = 30u;
        for (unsigned c = 0; c < msgen_channels_max; ++c) {
            config.gain_q16[c] = way < 2u ? -msgen_gain_one + 1 : 0;
            config.limit[c] = way < 2u ? 100000 : 0;
        }
        for (uint32_t abort_at = 0; abort_at < 90u; abort_at += 15u) {
            if (msgen_player_init(&player, &table, &config) == core_ok) {
                count_run(&player, abort_at, &most, &most_abort);
            }
        }
    }
    counting_print("msgen_player_step", most);
    counting_print("msgen_player_abort", most_abort);

    uint32_t begin = board_instructions();
    enum core_status status = msgen_table_open(excitation_mst, sizeof excitation_mst, &table);
    counting_print("msgen_table_open", counting_since(begin));
    counting_require(status);
    config.fade_in_samples = 30u;
    config.approach_samples = config.dwell_samples = 0;
    counting_require(msgen_player_init(&player, &table, &config));
    int32_t samples[msgen_channels_max];
    for (uint32_t i = 0; i < 40u; ++i) {
        begin = board_instructions();
        msgen_player_step(&player, samples);
        most = counting_since(begin);
    }
    counting_print("msgen_player_step/whole-period", most);
    begin = board_instructions();
    volatile uint32_t crc = core_crc32(0, excitation_mst, 1024u);
    counting_print("core_crc32/1024-bytes", counting_since(begin));
    (void)crc;
}

// ---- Guard

static void count_guard(void)
{
    static const struct guard_limits limits = {-100000, 100000, 20000, 16000, 50, 50, 100};
    static const int32_t extremes[] = {INT32_MIN, -100001, -100000, -1, 0, 1, 99999, 100001, INT32_MAX};
    const unsigned count = sizeof extremes / sizeof *extremes;
    const struct guard_sample inside = {0, 0, 200, true};
    struct guard guard;
    uint32_t most = 0, most_clip = 0;
    for (unsigned i = 0; i < count * count * count; ++i) {
        struct guard_sample sample = {extremes[i % count], extremes[i / count % count], extremes[i / count / count],
                                      i % 7u != 0};
        counting_require(guard_init(&guard, &limits));
        counting_require(guard_arm(&guard, &inside));
        for (unsigned n = 0; n < 3u; ++n) {
            uint32_t begin = board_instructions();
            guard_step(&guard, &sample);
            counting_keep_most(&most, counting_since(begin));
            begin = board_instructions();
            guard_clip_torque(&guard, sample.torque);
            counting_keep_most(&most_clip, counting_since(begin));
            guard_alive(&guard.state);
        }
    }
    for (unsigned way = 0; way < 2u; ++way) { /* the two causes that take time */
        counting_require(guard_arm(&guard, &inside));
        for (unsigned n = 0; n < 60u; ++n) {
            if (way == 0) {
                guard_alive(&guard.state);
            }
            uint32_t begin = board_instructions();
            guard_step(&guard, &inside);
            counting_keep_most(&most, counting_since(begin));
        }
    }
    counting_print("guard_step", most);
    counting_print("guard_clip_torque", most_clip);
}

// ---- DFT

/* What there are lines for: anywhere, in whole blocks and not; well below the sample rate, where they share a basis;
 * odd ones, where the period is folded. */
struct lines {
    const char *name;
    uint32_t period, highest, step;
    struct frf_block_layout layout;
};

static const struct lines any = {"", 640, 319, 1, {32, 32, 1}};
static const struct lines others[] = {{"any-cut/", 650, 324, 1, {32, 32, 1}},
                                      {"below-0.1/", 2048, 204, 1, {64, 24, 1}},
                                      {"below-0.02/", 10240, 204, 1, {128, 12, 1}},
                                      {"odd/", 2 * part_max, 399, 2, {32, 32, 2}}};

static int32_t coefficients[FRF_BLOCK_TABLE_WORDS(bins_max, block_max, 64u)];
static int32_t storage[FRF_BLOCK_STORAGE_WORDS(bins_max, channels_max, 2u, block_max, 64u) +
                       FRF_BLOCK_SPREAD_WORDS(channels_max, block_max)];
static int32_t part[FRF_BLOCK_PART_WORDS(channels_max, 2u * part_max, 2u)];
static uint32_t bins[bins_max];
static union frf_word words[FRF_STORAGE_WORDS(exact_bins, channels_max)];

/* The kernels take the same time whatever they multiply; the limits of the converter are what costs most. */
static void fill(int16_t *out_frame)
{
    for (unsigned c = 0; c < channels_max; ++c) {
        out_frame[c] = INT16_MIN;
    }
}

/* Over two periods. */
static void count_frames(struct frf_block *dft, uint32_t *out_mean, uint32_t *out_longest)
{
    int16_t frame[channels_max];
    uint32_t all = 0, period = dft->table.period_samples;
    fill(frame);
    *out_longest = 0;
    for (uint32_t n = 0; n < 2u * period; ++n) {
        uint32_t begin = board_instructions();
        frf_block_add_i16(dft, frame, 1);
        uint32_t count = counting_since(begin);
        counting_keep_most(out_longest, count);
        all += count;
    }
    *out_mean = all / (2u * period);
}

/* Over two periods, fed a block at a time: what an interrupt that only collects leaves to somebody else. */
static uint32_t count_blocks(struct frf_block *dft)
{
    static int16_t frames[block_max * channels_max];
    uint32_t all = 0, period = dft->table.period_samples, block = dft->table.layout.block_samples;
    for (uint32_t i = 0; i < block; ++i) {
        fill(frames + i * dft->channels);
    }
    for (uint32_t n = 0; n < 2u * period; n += block) {
        uint32_t begin = board_instructions();
        frf_block_add_i16(dft, frames, block);
        all += counting_since(begin);
    }
    return all / (2u * period);
}

static void print_block_count(const char *what, const struct lines *lines, uint32_t bin_count, uint32_t channels,
                              uint32_t value)
{
    board_print("frf_block_add_i16/");
    board_print(what);
    board_print("/");
    board_print(lines->name);
    print_u32(bin_count);
    board_print("-bins/");
    print_u32(channels);
    counting_print(channels == 1u ? "-channel" : "-channels", value);
}

static void set_up_block(struct frf_block *dft, const struct lines *lines, uint32_t bin_count, uint32_t channels,
                         bool spread)
{
    struct frf_block_table table;
    const struct frf_block_config config = {.table = &table,
                                            .channels = channels,
                                            .banks = 2,
                                            .spread = spread,
                                            .storage = storage,
                                            .storage_words = sizeof storage / sizeof *storage,
                                            .part = part,
                                            .part_words = sizeof part / sizeof *part};
    for (uint32_t b = 0; b < bin_count; ++b) {
        bins[b] = 1u + b * ((lines->highest - 1u) / (bin_count - 1u) / lines->step) * lines->step;
    }
    counting_require(frf_block_build(coefficients, sizeof coefficients / sizeof *coefficients, bins, bin_count,
                                     lines->period, &lines->layout, &table));
    counting_require(frf_block_init(dft, &config));
}

/* How even the work is: what the longest call is of the mean one. */
static void count_spread(const struct lines *lines, uint32_t bin_count, uint32_t channels)
{
    struct frf_block dft;
    uint32_t mean, longest;
    set_up_block(&dft, lines, bin_count, channels, true);
    count_frames(&dft, &mean, &longest);
    print_block_count("spread-longest", lines, bin_count, channels, longest);
    print_block_count("spread-mean", lines, bin_count, channels, mean);
    print_block_count("spread-longest-percent-of-mean", lines, bin_count, channels, 100u * longest / mean);
}

static void count_reader(struct frf_block *dft)
{
    struct frf_block_period latched;
    int64_t real, imaginary;
    uint32_t begin = board_instructions();
    bool there = frf_block_latest(dft, &latched);
    counting_print("frf_block_latest", counting_since(begin));
    begin = board_instructions();
    frf_block_sums(dft, &latched, bins_max - 1u, channels_max - 1u, &real, &imaginary);
    counting_print("frf_block_sums", counting_since(begin));
    if (!there) {
        board_exit(1);
    }
}

/* With everything to be done of a block that has just been filled. */
static void count_skip(struct frf_block *dft)
{
    int16_t frame[channels_max];
    fill(frame);
    for (uint32_t n = 0; n < dft->table.layout.block_samples; ++n) {
        frf_block_add_i16(dft, frame, 1);
    }
    uint32_t begin = board_instructions();
    frf_block_skip(dft, 1);
    counting_print("frf_block_skip/1", counting_since(begin));
}

static void count_block(uint32_t bin_count, uint32_t channels)
{
    struct frf_block dft;
    uint32_t mean, longest;
    set_up_block(&dft, &any, bin_count, channels, false);
    count_frames(&dft, &mean, &longest);
    print_block_count("at-once-longest", &any, bin_count, channels, longest);
    print_block_count("at-once-mean", &any, bin_count, channels, mean);
    print_block_count("in-blocks-mean", &any, bin_count, channels, count_blocks(&dft));
    count_spread(&any, bin_count, channels);
    for (unsigned i = 0; SERVOSCOPE_FRF_LONG_MULTIPLY && i < sizeof others / sizeof *others; ++i) {
        count_spread(&others[i], bin_count, channels);
    }
    if (bin_count == bins_max && channels == channels_max) {
        set_up_block(&dft, &any, bin_count, channels, true);
        count_frames(&dft, &mean, &longest);
        count_reader(&dft);
        count_skip(&dft);
    }
}

static uint32_t count_exact(struct frf_dft *dft)
{
    int16_t frame[channels_max];
    uint32_t most = 0;
    fill(frame);
    for (uint32_t n = 0; n < EXCITATION_DFT_PERIOD_SAMPLES; ++n) {
        uint32_t begin = board_instructions();
        frf_dft_add_i16(dft, frame, 1);
        counting_keep_most(&most, counting_since(begin));
    }
    return most;
}

static void count_exact_channels(uint32_t channels)
{
    const struct frf_dft_config config = {excitation_dft_bins,          exact_bins, channels, words,
                                          sizeof words / sizeof *words, 0,          0};
    struct frf_dft dft;
    counting_require(frf_dft_init_q15(&dft, &config, &excitation_dft_twiddles_q15));
    counting_print(channels == 1u ? "frf_dft_add_i16/q15/32-bins/1-channel" : "frf_dft_add_i16/q15/32-bins/2-channels",
                   count_exact(&dft));
    counting_require(frf_dft_init_q31(&dft, &config, &excitation_dft_twiddles_q31));
    counting_print(channels == 1u ? "frf_dft_add_i16/q31/32-bins/1-channel" : "frf_dft_add_i16/q31/32-bins/2-channels",
                   count_exact(&dft));
}

int main(void)
{
    static const uint32_t bin_counts[] = {32, 64, 200};
    board_start_counter();
    counting_calibrate();
    count_guard();
    count_player();
    count_exact_channels(1);
    count_exact_channels(2);
    counting_exact();
    for (unsigned b = 0; b < sizeof bin_counts / sizeof *bin_counts; ++b) {
        for (uint32_t channels = 1; channels <= channels_max; ++channels) {
            count_block(bin_counts[b], channels);
        }
    }
    board_exit(0);
}
