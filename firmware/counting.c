/* SPDX-License-Identifier: MIT */
#include "firmware/counting.h"

#include "firmware/board.h"
#include "firmware/print.h"

uint32_t counting_overhead;

void counting_calibrate(void)
{
    uint32_t least = UINT32_MAX;
    for (unsigned i = 0; i < 16u; ++i) {
        uint32_t begin = board_instructions(), all = board_instructions() - begin;
        least = all < least ? all : least;
    }
    counting_overhead = least;
}

void counting_keep_most(uint32_t *io_most, uint32_t value)
{
    *io_most = value > *io_most ? value : *io_most;
}

void counting_print(const char *name, uint32_t value)
{
    board_print(name);
    board_print(" ");
    print_u32(value);
    board_print("\n");
}

void counting_require(enum core_status status)
{
    if (status != core_ok) {
        board_print(core_status_str(status));
        board_exit(1);
    }
}
