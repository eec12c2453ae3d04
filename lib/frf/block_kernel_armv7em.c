/* SPDX-License-Identifier: MIT */
#include "frf/block_kernel.h"

#if SERVOSCOPE_FRF_ARMV7EM

/* Registers: r0 data, r1 row, r2-r5 four words of data, r6-r9 four factors, r10 r11 first row's accumulators, r12 lr
 * second row's. That is all there are, so what is needed once in a pair of rows lies on the stack. Per group of two
 * pairs of samples, three loads feed eight multiplications. Groups beyond the eight that are written out go round
 * again; the first round enters where as many are left as do not fill one. */
#define GROUP_BYTES "44"
__asm__(".syntax unified\n"
        ".thumb\n"
        ".section .text.frf_block_accumulate_armv7em,\"ax\",%progbits\n"
        ".balign 4\n"
        ".global frf_block_accumulate_armv7em\n"
        ".type frf_block_accumulate_armv7em, %function\n"
        ".thumb_func\n"
        "frf_block_accumulate_armv7em:\n"
        "  push {r4-r11, lr}\n"
        "  sub sp, #20\n"
        "  add r3, r0, r3, lsl #4\n" /* 16 bytes of accumulators a pair */
        "  ldr r4, [sp, #56]\n"      /* groups */
        "  add r5, r2, r4, lsl #4\n" /* 16 bytes of data a group */
        "  subs r4, #1\n"
        "  and r4, #7\n" /* groups of the first round, less one */
        "  rsb r4, #7\n"
        "  mov r6, #" GROUP_BYTES "\n"
        "  mul r4, r6\n"
        "  adr.w r6, 2f\n"
        "  add r4, r6\n"
        "  orr r4, #1\n"
        "  stm sp, {r0, r2, r3, r4, r5}\n" /* accumulators, data, their end, entry, end of data */
        ".balign 4\n"
        "1:\n"
        "  ldr r2, [sp, #0]\n"
        "  ldm r1!, {r6-r9}\n"
        "  ldm r2, {r3, r4, r5, r12}\n"
        "  smmulr r10, r3, r6\n"
        "  smmulr r11, r3, r7\n"
        "  smmlsr r10, r4, r7, r10\n"
        "  smmlar r11, r4, r6, r11\n"
        "  smmulr lr, r5, r9\n"
        "  smmulr r2, r5, r8\n"
        "  smmlar lr, r12, r8, lr\n"
        "  smmlsr r12, r12, r9, r2\n"
        "  ldrd r0, r2, [sp, #4]\n" /* r2: filler, so that both words come in one instruction */
        "  lsl r10, r10, #1\n"
        "  lsl r11, r11, #1\n"
        "  lsl r12, r12, #1\n"
        "  lsl lr, lr, #1\n"
        "  ldr pc, [sp, #12]\n"
        ".balign 4\n"
        "2:\n"
        ".rept 8\n"
        "  ldm.w r0!, {r2-r5}\n"
        "  ldm.w r1!, {r6-r9}\n"
        "  smmlar r10, r2, r6, r10\n"
        "  smmlar r11, r3, r7, r11\n"
        "  smmlar r10, r4, r8, r10\n"
        "  smmlar r11, r5, r9, r11\n"
        "  ldm.w r1!, {r6-r9}\n"
        "  smmlar r12, r2, r6, r12\n"
        "  smmlar lr, r3, r7, lr\n"
        "  smmlar r12, r4, r8, r12\n"
        "  smmlar lr, r5, r9, lr\n"
        ".endr\n"
        "  ldrd r2, r3, [sp, #0]\n" /* accumulators; r3: filler */
        "  ldrd r4, r5, [sp, #12]\n"
        "  cmp r0, r5\n"
        "  bne 2b\n"
        "  ldr r6, [sp, #8]\n"
        "  stm r2!, {r10-r12, lr}\n"
        "  str r2, [sp, #0]\n"
        "  cmp r2, r6\n"
        "  bne 1b\n"
        "  add sp, #20\n"
        "  pop {r4-r11, pc}\n"
        ".size frf_block_accumulate_armv7em, . - frf_block_accumulate_armv7em\n"
        ".text\n");
#else
typedef int frf_block_kernel_armv7em_is_for_another_core;
#endif
