/* SPDX-License-Identifier: MIT */
#include "frf/block_kernel.h"

#if SERVOSCOPE_FRF_ARMV7EM

/* Registers: r0 data, r1 rows, r2-r5 four words of data, r6-r8 lr four factors, r9 r10 the first row's sums, r11 r12
 * the second row's. That is all there are: what is needed once in two rows lies on the stack, where one load fetches
 * the data's address, the sums' first values and the place to begin; the accumulators are rotated after the sums. In a
 * group of two pairs of samples three loads feed eight multiplications. Groups beyond the eight that are written out go
 * round again; the first round enters where as many are left as do not fill one. */
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
        "  sub sp, #36\n"
        "  add r3, r0, r3, lsl #4\n" /* 16 bytes of accumulators a pair of rows */
        "  ldr r4, [sp, #72]\n"      /* groups */
        "  add r5, r2, r4, lsl #4\n" /* 16 bytes of data a group */
        "  subs r4, #1\n"
        "  and r4, #7\n" /* groups of the first round, less one */
        "  rsb r4, #7\n"
        "  mov r6, #" GROUP_BYTES "\n"
        "  mul r4, r6\n"
        "  adr.w r6, 2f\n"
        "  add r4, r6\n"
        "  orr r12, r4, #1\n"
        "  mov r8, #8\n"
        "  mov r9, r8\n"
        "  mov r10, r8\n"
        "  mov r11, r8\n"
        "  stm sp, {r2, r8-r12}\n"   /* data, first values, entry */
        "  strd r5, r0, [sp, #24]\n" /* end of data, accumulators */
        "  str r3, [sp, #32]\n"      /* their end */
        "1:\n"
        "  ldm sp, {r0, r9-r12, pc}\n"
        ".balign 4\n"
        "2:\n"
        ".rept 8\n"
        "  ldm.w r0!, {r2-r5}\n"
        "  ldm.w r1!, {r6-r8, lr}\n"
        "  smmlar r9, r2, r6, r9\n"
        "  smmlar r10, r3, r7, r10\n"
        "  smmlar r9, r4, r8, r9\n"
        "  smmlar r10, r5, lr, r10\n"
        "  ldm.w r1!, {r6-r8, lr}\n"
        "  smmlar r11, r2, r6, r11\n"
        "  smmlar r12, r3, r7, r12\n"
        "  smmlar r11, r4, r8, r11\n"
        "  smmlar r12, r5, lr, r12\n"
        ".endr\n"
        "  ldr r5, [sp, #24]\n"
        "  cmp r0, r5\n"
        "  bne 2b\n"
        "  ldr r0, [sp, #28]\n"
        "  ldm r1!, {r6-r8, lr}\n"
        "  ldm r0, {r2-r5}\n"
        "  asr r9, r9, #4\n"
        "  asr r10, r10, #4\n"
        "  asr r11, r11, #4\n"
        "  asr r12, r12, #4\n"
        "  lsl r2, r2, #1\n"
        "  lsl r3, r3, #1\n"
        "  lsl r4, r4, #1\n"
        "  lsl r5, r5, #1\n"
        "  smmlar r9, r2, r6, r9\n"
        "  smmlar r10, r2, r7, r10\n"
        "  smmlsr r9, r3, r7, r9\n"
        "  smmlar r10, r3, r6, r10\n"
        "  smmlar r11, r4, r8, r11\n"
        "  smmlar r12, r4, lr, r12\n"
        "  smmlsr r11, r5, lr, r11\n"
        "  smmlar r12, r5, r8, r12\n"
        "  ldr r6, [sp, #32]\n"
        "  stm r0!, {r9-r12}\n"
        "  str r0, [sp, #28]\n"
        "  cmp r0, r6\n"
        "  bne 1b\n"
        "  add sp, #36\n"
        "  pop {r4-r11, pc}\n"
        ".size frf_block_accumulate_armv7em, . - frf_block_accumulate_armv7em\n"
        ".text\n");
#else
typedef int frf_block_kernel_armv7em_is_for_another_core;
#endif
