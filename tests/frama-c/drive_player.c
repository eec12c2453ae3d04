/* SPDX-License-Identifier: MIT */
/* A table in range with any samples, played with any settings that the player takes, aborted at any time. */
#include "tests/frama-c/any.h"

#include "msgen/player.h"

enum { period = 4 };

/* Lengths are numbers, so that Eva follows ramps and periods one by one; samples, gains, limits and travel are any. */
static void run(struct msgen_table *table, uint32_t fade_in, uint32_t approach, uint32_t abort_at)
{
    struct msgen_player player;
    struct msgen_player_config config = {2, fade_in, approach, 1, 3, 2, {0, 0, 0}, {0, 0, 0}};
    int32_t out[msgen_channels_max];
    for (uint32_t c = 0; c < msgen_channels_max; ++c) {
        config.gain_q16[c] = any_i32();
        config.limit[c] = any_i32();
    }
    if (msgen_player_init(&player, table, &config) != core_ok) {
        return;
    }
    for (uint32_t n = 0; n < 18; ++n) {
        msgen_player_step(&player, out);
        if (n == abort_at) {
            msgen_player_abort(&player);
        }
    }
}

int main(void)
{
    static uint8_t samples[period * msgen_channels_max * 4];
    struct msgen_table table = {0};
    for (uint32_t i = 0; i < sizeof samples; ++i) {
        samples[i] = any_u8();
    }
    table.samples = samples;
    table.rate_num_hz = 1000;
    table.rate_den = 1;
    table.period_samples = period;
    table.start_index = 3;
    table.channels = msgen_channels_max;
    for (uint32_t kind = 0; kind < 8; ++kind) {
        table.format = kind % 2u == 0 ? msgen_format_i16 : msgen_format_i32;
        run(&table, kind < 2u ? 5 : 0, kind > 3u ? 4 : 0, kind % 3u == 0 ? 6 : 100);
    }
    return 0;
}
