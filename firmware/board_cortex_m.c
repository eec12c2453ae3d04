/* SPDX-License-Identifier: MIT */
/* Cortex-M under QEMU: SysTick for the samples, semihosting for text and exit status. Instructions are counted by the
 * CMSDK timer of the MPS2 boards: with -icount shift=S an instruction takes 2^S ns of its clock, a tick of 25 MHz 40.
 * */
#include "firmware/board.h"

void board_sample_interrupt(void);
void board_fault(void);

struct sys_tick {
    volatile uint32_t control, reload, value, calibration;
};
struct cmsdk_timer { /* counting down */
    volatile uint32_t control, value, reload;
};
#define SYS_TICK          ((struct sys_tick *)0xE000E010u)
#define CMSDK_TIMER       ((struct cmsdk_timer *)0x40000000u)
#define INTERRUPT_CONTROL ((volatile uint32_t *)0xE000ED04u)

enum { sys_tick_pending_bit = 26, semihosting_write = 0x04, semihosting_exit_extended = 0x20 };

static void (*sample_interrupt)(void);

void board_start_samples(uint32_t rate_hz, void (*interrupt)(void))
{
    sample_interrupt = interrupt;
    SYS_TICK->reload = BOARD_CLOCK_HZ / rate_hz - 1u;
    SYS_TICK->value = 0;
    SYS_TICK->control = 7u; /* of the core's clock, with interrupt, running */
}

void board_sample_interrupt(void)
{
    sample_interrupt();
}

void board_wait(void)
{
    __asm__ volatile("wfi" ::: "memory");
}

bool board_is_late(void)
{
    return (*INTERRUPT_CONTROL >> sys_tick_pending_bit & 1u) != 0;
}

static void semihost(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

void board_print(const char *text)
{
    semihost(semihosting_write, text);
}

void board_exit(int status)
{
    const uint32_t application_exit = 0x20026u;
    const uint32_t block[2] = {application_exit, (uint32_t)status};
    semihost(semihosting_exit_extended, block);
    for (;;) {
    }
}

void board_fault(void)
{
    board_print("fault\n");
    board_exit(3);
}

void board_start_counter(void)
{
    CMSDK_TIMER->reload = UINT32_MAX;
    CMSDK_TIMER->value = UINT32_MAX;
    CMSDK_TIMER->control = 1u;
}

uint32_t board_instructions(void)
{
    uint64_t ticks = UINT32_MAX - CMSDK_TIMER->value;
    return (uint32_t)(ticks * 40u >> BOARD_INSTRUCTION_SHIFT);
}
