/* SPDX-License-Identifier: MIT */
#include "firmware/expected.h"

#include "firmware/board.h"
#include "firmware/print.h"

#include "expected_values.h"

static uint32_t taken, different;

void expected_take(int64_t value)
{
    if (taken < EXPECTED_COUNT) {
        const uint32_t *words = expected_values + 2u * taken;
        different += (uint64_t)value != ((uint64_t)words[1] << 32 | words[0]);
    }
    ++taken;
}

bool expected_finish(void)
{
    board_print("compared with the host: ");
    print_u32(taken);
    board_print(" of ");
    print_u32(EXPECTED_COUNT);
    board_print(" results, ");
    print_u32(different);
    board_print(" different\n");
    return taken == EXPECTED_COUNT && different == 0;
}
