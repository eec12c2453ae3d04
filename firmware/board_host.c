/* SPDX-License-Identifier: MIT */
/* The host: the interrupt is a call, nothing is ever late, nothing is counted. */
#include "firmware/board.h"

#include <stdio.h>
#include <stdlib.h>

static void (*sample_interrupt)(void);

void board_start_samples(uint32_t rate_hz, void (*interrupt)(void))
{
    (void)rate_hz;
    sample_interrupt = interrupt;
}

void board_wait(void)
{
    sample_interrupt();
}

bool board_is_late(void)
{
    return false;
}

void board_start_counter(void) {}

uint32_t board_instructions(void)
{
    return 0;
}

void board_print(const char *text)
{
    fputs(text, stdout);
}

void board_exit(int status)
{
    exit(status);
}
