/* SPDX-License-Identifier: MIT */
#include "bench/firmware_port.h"

#include <stdio.h>
#include <stdlib.h>

uint32_t port_instructions(void)
{
    return 0;
}

void port_print(const char *text)
{
    fputs(text, stdout);
}

void port_print_number(uint32_t value)
{
    printf("%u", (unsigned)value);
}

void port_exit(int status)
{
    exit(status);
}
