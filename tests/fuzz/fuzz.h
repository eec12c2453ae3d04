/* SPDX-License-Identifier: MIT */
/// What the fuzz targets share: an input is a row of steps of ten bytes, each one frame or one thing that happens.
/// A target breaks (abort) if an invariant does; the sanitizers see the rest.
#ifndef SERVOSCOPE_TESTS_FUZZ_H
#define SERVOSCOPE_TESTS_FUZZ_H

#include "drivers/can/can_frame.h"

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { fuzz_step_bytes = 10 };

/// One step: what to do, how long the frame is (0..8, mostly 8), its bytes.
struct fuzz_step {
    uint8_t what, length;
    const uint8_t *data;
};

static inline struct fuzz_step fuzz_step(const uint8_t *bytes)
{
    uint8_t length = (uint8_t)(bytes[1] & 0x0F);
    return (struct fuzz_step){bytes[0], length > can_data_max ? can_data_max : length, &bytes[2]};
}

static inline struct can_frame fuzz_frame(uint16_t id, const struct fuzz_step *step)
{
    struct can_frame frame = can_frame_make(id, step->length);
    memcpy(frame.data, step->data, step->length);
    return frame;
}

#define FUZZ_CHECK(condition)                                                                                          \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #condition);                                    \
            abort();                                                                                                   \
        }                                                                                                              \
    } while (0)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#endif
