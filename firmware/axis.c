/* SPDX-License-Identifier: MIT */
#include "firmware/axis.h"

#include "core/bytes.h"
#include "firmware/board.h"

#include "excitation-dft.h"

struct axis axis;

static int32_t storage[FRF_BLOCK_STORAGE_WORDS(EXCITATION_DFT_BIN_COUNT, sample_path_channels, 2u,
                                               EXCITATION_DFT_BLOCK_SAMPLES, EXCITATION_DFT_BLOCK_TERMS) +
                       FRF_BLOCK_SPREAD_WORDS(sample_path_channels, EXCITATION_DFT_BLOCK_SAMPLES)];

/* What the library costs in the interrupt is counted here, as a drive would with its cycle counter. */
static void play(const struct belt_sample *sample, struct sample_path_output *out_output)
{
    const struct sample_path_input input = {
        .guard = {.position = sample->position, .velocity = sample->velocity, .torque = sample->torque, .valid = true},
        .channels = {sample->torque, sample->velocity}};
    uint32_t begin = board_instructions();
    if (axis.stop_wanted) {
        msgen_player_abort(&axis.path.player);
    }
    sample_path_step(&axis.path, &input, out_output);
    uint32_t instructions = board_instructions() - begin;
    axis.all_instructions += instructions;
    axis.longest_instructions = instructions > axis.longest_instructions ? instructions : axis.longest_instructions;
}

/* What a drive's sampling interrupt does: measure, the library, control, the power stage. */
static void take_sample(void)
{
    axis.samples = axis.samples + 1u;
    if (axis.start_wanted) {
        axis.start_wanted = axis.stop_wanted = false;
        belt_init(&axis.belt);
        axis.state = axis_playing;
    }
    if (axis.state != axis_playing) {
        return;
    }
    struct belt_sample sample = belt_measure(&axis.belt);
    struct sample_path_output output;
    float reference[msgen_channels_max];
    play(&sample, &output);
    for (unsigned c = 0; c < msgen_channels_max; ++c) {
        reference[c] = (float)output.reference[c] * axis.reference_scale[c];
    }
    float torque_Nm = belt_control(&axis.belt, &sample, reference);
    int32_t counts = guard_clip_torque(&axis.path.guard, (int32_t)(torque_Nm * BELT_TORQUE_COUNTS_PER_NM));
    belt_move(&axis.belt, (float)counts * (1.0f / BELT_TORQUE_COUNTS_PER_NM));
    if (output.done) {
        axis.state = axis_done;
    }
    if (board_is_late()) {
        sample_path_mark_late(&axis.path);
    }
}

void axis_power_on(void)
{
    axis.state = axis_resting;
    board_start_counter();
    board_start_samples(axis_rate_hz, take_sample);
}

static bool has_the_lines_of(const struct msgen_table *table)
{
    bool same = table->bin_count == EXCITATION_DFT_BIN_COUNT;
    for (uint32_t i = 0; same && i < table->bin_count; ++i) {
        same = msgen_table_bin(table, i) == excitation_dft_bins[i];
    }
    return same;
}

/* Within 31 bits, and 0 as no limit. */
static int32_t counts_of(float value, float counts_per_unit)
{
    float counts = value * counts_per_unit;
    return counts >= 2147483520.0f ? INT32_MAX : counts <= -2147483520.0f ? -INT32_MAX : (int32_t)counts;
}

static int32_t limit_of(float value, float counts_per_unit)
{
    return value > 0.0f ? counts_of(value, counts_per_unit) : INT32_MAX;
}

enum core_status axis_prepare(const struct msgen_table *table, const struct axis_setup *setup)
{
    if (table->period_samples != EXCITATION_DFT_PERIOD_SAMPLES || table->channels != msgen_channels_max) {
        return core_err_frf_period;
    }
    if (!has_the_lines_of(table)) {
        return core_err_frf_bins;
    }
    const struct guard_limits limits = {
        .position_min = counts_of(setup->position_min_rad, BELT_POSITION_COUNTS_PER_RAD),
        .position_max = counts_of(setup->position_max_rad, BELT_POSITION_COUNTS_PER_RAD),
        .velocity_max = limit_of(setup->velocity_limit_rad_per_s, BELT_VELOCITY_COUNTS_PER_RAD_PER_S),
        .torque_max = limit_of(setup->torque_limit_Nm, BELT_TORQUE_COUNTS_PER_NM),
        .watchdog_samples = setup->watchdog_samples,
        .stuck_samples = axis_rate_hz / 2,
        .stuck_torque = counts_of(0.5f, BELT_TORQUE_COUNTS_PER_NM)};
    const struct msgen_player_config player = {.periods = setup->settle_periods + setup->measure_periods,
                                               .fade_in_samples = setup->fade_samples,
                                               .fade_out_samples = setup->fade_samples,
                                               .abort_samples = setup->abort_samples};
    static const struct frf_block_config block = {.table = &excitation_dft_block_table,
                                                  .channels = sample_path_channels,
                                                  .banks = 2,
                                                  .spread = true,
                                                  .storage = storage,
                                                  .storage_words = sizeof storage / sizeof *storage};
    for (unsigned c = 0; c < msgen_channels_max; ++c) {
        union core_float_bits scale = {.bits = table->scale_bits[c]};
        axis.reference_scale[c] = scale.value;
    }
    enum core_status status = results_init(&axis.results, &excitation_dft_block_table, 1.0f / BELT_TORQUE_COUNTS_PER_NM,
                                           1.0f / BELT_VELOCITY_COUNTS_PER_RAD_PER_S);
    return status == core_ok ? sample_path_init(&axis.path, &limits, table, &player, &block, setup->settle_periods)
                             : status;
}

enum core_status axis_arm(void)
{
    const struct guard_sample at_rest = {0, 0, 0, true};
    enum core_status status = guard_arm(&axis.path.guard, &at_rest);
    axis.state = status == core_ok ? axis_armed : axis_resting;
    return status;
}

void axis_start(void)
{
    axis.start_wanted = true;
}

void axis_stop(void)
{
    if (axis.state == axis_armed) {
        axis.state = axis_resting;
    }
    axis.stop_wanted = true;
}

void axis_rest(void)
{
    axis.state = axis_resting;
}

void axis_collect(void)
{
    if (axis.state == axis_playing || axis.state == axis_done) {
        (void)results_take(&axis.results, &axis.path.dft, sample_path_torque, sample_path_velocity);
    }
}

uint64_t axis_time_us(void)
{
    return (uint64_t)axis.samples * axis_sample_us;
}
