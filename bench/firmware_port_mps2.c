/* SPDX-License-Identifier: MIT */
/* QEMU's mps2-an386, run with -icount shift=6: an instruction takes 64 ns of its clock, a tick of the 25 MHz timer 40.
 * QEMU loads data and clears what is to be zero, so that the reset handler is main(). */
#include "bench/firmware_port.h"

int main(void);

struct timer { /* CMSDK APB timer, counting down */
    volatile uint32_t control, value, reload;
};
#define TIMER ((struct timer *)0x40000000u)

void port_reset(void);

void port_reset(void)
{
    TIMER->reload = 0xFFFFFFFFu;
    TIMER->value = 0xFFFFFFFFu;
    TIMER->control = 1u;
    main();
}

/* Initial stack pointer, the end of 4 MiB of RAM; then where to begin. */
struct vectors {
    uint32_t stack;
    void (*reset)(void);
};
extern const struct vectors port_vectors;
__attribute__((section(".vectors"))) const struct vectors port_vectors = {0x20400000u, port_reset};

uint32_t port_instructions(void)
{
    uint64_t ticks = 0xFFFFFFFFu - TIMER->value;
    return (uint32_t)(ticks * 40u / 64u);
}

static int32_t semihosting(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return (int32_t)r0;
}

void port_print(const char *text)
{
    semihosting(0x04, text); /* SYS_WRITE0 */
}

void port_print_number(uint32_t value)
{
    char digits[11];
    unsigned at = sizeof digits - 1u;
    digits[at] = '\0';
    do {
        digits[--at] = (char)('0' + value % 10u);
        value /= 10u;
    } while (value > 0);
    port_print(digits + at);
}

void port_exit(int status)
{
    const uint32_t application_exit = 0x20026u;
    const uint32_t block[2] = {application_exit, (uint32_t)status};
    semihosting(0x20, block); /* SYS_EXIT_EXTENDED */
    for (;;) {
    }
}
