/* SPDX-License-Identifier: MIT */
/// Feeds a fuzz target with random frames: the same ones every time for the same seed, with any compiler.
/// usage: TARGET FRAMES [SEED]     prints how many; a target that breaks has printed the run that does it again
#include "tests/fuzz/fuzz.h"

#include <inttypes.h>
#include <signal.h>

enum { frames_per_run_max = 64 };

static uint64_t state, run_seed;
static const char *program;

/// splitmix64
static uint64_t next(void)
{
    uint64_t z = (state += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static void say_how_to_replay(int signal_number)
{
    (void)signal_number;
    fprintf(stderr, "replay: %s 1 %" PRIu64 "\n", program, run_seed);
    _Exit(1);
}

/// One input; most frames are eight bytes long, as most of the parsers want them.
static unsigned make_input(uint8_t *out_bytes)
{
    unsigned frames = 1 + (unsigned)(next() % frames_per_run_max);
    for (unsigned i = 0; i < frames; i++) {
        uint8_t *step = &out_bytes[i * fuzz_step_bytes];
        uint64_t head = next(), data = next();
        step[0] = (uint8_t)head;
        step[1] = (uint8_t)((head >> 8) & 0x70);
        step[1] |= (head >> 16) % 8 == 0 ? (uint8_t)((head >> 24) % 9) : 8;
        memcpy(&step[2], &data, can_data_max);
        if ((head >> 32) % 4 == 0) // small numbers are what command bytes, counts and sizes are made of
            for (int b = 0; b < can_data_max; b++)
                step[2 + b] &= (uint8_t)(head >> 40);
    }
    return frames;
}

int main(int argc, char **argv)
{
    uint8_t bytes[frames_per_run_max * fuzz_step_bytes];
    uint64_t wanted = argc > 1 ? strtoull(argv[1], NULL, 10) : 0, done = 0;
    uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    if (wanted == 0) {
        fprintf(stderr, "usage: %s FRAMES [SEED]\n", argv[0]);
        return 2;
    }
    program = argv[0];
    signal(SIGABRT, say_how_to_replay);
    for (; done < wanted; seed++) {
        state = run_seed = seed;
        unsigned frames = make_input(bytes);
        LLVMFuzzerTestOneInput(bytes, (size_t)frames * fuzz_step_bytes);
        done += frames;
    }
    printf("%" PRIu64 " frames, seeds up to %" PRIu64 "\n", done, seed - 1);
    return 0;
}
