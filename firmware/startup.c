/* SPDX-License-Identifier: MIT */
/* From reset to main(): vectors, .data, .bss, the FPU where there is one. The linker script names the places. */
#include <stdint.h>

int main(void);
void startup_reset(void);
void startup_fault(void);
void board_sample_interrupt(void);
void board_fault(void);

extern uint32_t link_stack_top[], link_data_load[], link_data_begin[], link_data_end[], link_bss_begin[],
    link_bss_end[];

struct vectors {
    uint32_t *stack;
    void (*handlers[15])(void);
};
extern const struct vectors startup_vectors;
/* Reset, NMI, four kinds of fault, four reserved, SVC, debug monitor, reserved, PendSV, SysTick. */
__attribute__((section(".vectors"), used)) const struct vectors startup_vectors = {
    link_stack_top,
    {startup_reset, startup_fault, startup_fault, startup_fault, startup_fault, startup_fault, 0, 0, 0, 0,
     startup_fault, startup_fault, 0, startup_fault, board_sample_interrupt}};

void startup_reset(void)
{
    const uint32_t *load = link_data_load;
    for (uint32_t *word = link_data_begin; word != link_data_end; ++word) {
        *word = *load++;
    }
    for (uint32_t *word = link_bss_begin; word != link_bss_end; ++word) {
        *word = 0;
    }
#if defined(__ARM_FP)
    volatile uint32_t *coprocessor_access = (volatile uint32_t *)0xE000ED88u;
    *coprocessor_access |= 0xFu << 20;
    __asm__ volatile("dsb\n isb" ::: "memory");
#endif
    main();
    startup_fault();
}

void startup_fault(void)
{
    board_fault();
}
