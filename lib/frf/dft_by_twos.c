/* SPDX-License-Identifier: MIT */
#include "frf/dft_by_twos.h"

#include "frf/kernel.h"

int64_t frf_sum_by_twos_portable(const int16_t *table, const int16_t *samples, struct frf_walk *io_walk, uint32_t pairs)
{
    struct frf_walk walk = *io_walk;
    int64_t sum = 0;
    for (uint32_t i = 0; i < pairs; ++i) {
        int32_t products = samples[0] * table[walk.index];
        walk.index = frf_next_index(walk.index, walk.step, walk.period);
        products += samples[walk.stride] * table[walk.index];
        walk.index = frf_next_index(walk.index, walk.step, walk.period);
        samples += 2u * walk.stride;
        sum += products;
    }
    io_walk->index = walk.index;
    return sum;
}

#if SERVOSCOPE_FRF_ARMV6M
/* r0 table, r1 2 index, r2 samples, r3 r4 products, r5 r6 sum, r7 0 (an address needs two registers here);
 * r8 2 step, r9 2 N, r10 end of samples, r11 2 stride. */
__asm__(".syntax unified\n"
        ".thumb\n"
        ".section .text.frf_sum_by_twos_armv6m,\"ax\",%progbits\n"
        ".balign 4\n"
        ".global frf_sum_by_twos_armv6m\n"
        ".type frf_sum_by_twos_armv6m, %function\n"
        ".thumb_func\n"
        "frf_sum_by_twos_armv6m:\n"
        "  push {r4-r7, lr}\n"
        "  mov r4, r8\n"
        "  mov r5, r9\n"
        "  mov r6, r10\n"
        "  mov r7, r11\n"
        "  push {r2, r4-r7}\n"
        "  mov r12, r1\n"
        "  ldmia r2!, {r1, r4, r5, r6}\n"
        "  lsls r1, r1, #1\n"
        "  lsls r4, r4, #1\n"
        "  lsls r5, r5, #1\n"
        "  lsls r6, r6, #1\n"
        "  mov r8, r4\n"
        "  mov r9, r5\n"
        "  mov r11, r6\n"
        "  mov r2, r12\n"
        "  muls r3, r6\n"
        "  lsls r3, r3, #1\n"
        "  adds r3, r3, r2\n"
        "  mov r10, r3\n"
        "  movs r5, #0\n"
        "  movs r6, #0\n"
        "  movs r7, #0\n"
        "  b 4f\n"
        "1:\n"
        "  ldrsh r3, [r2, r7]\n"
        "  ldrsh r4, [r0, r1]\n"
        "  add r2, r11\n"
        "  add r1, r8\n"
        "  muls r3, r4\n"
        "  cmp r1, r9\n"
        "  blo 2f\n"
        "  mov r4, r9\n"
        "  subs r1, r1, r4\n"
        "2:\n"
        "  ldrsh r4, [r2, r7]\n"
        "  ldrsh r7, [r0, r1]\n"
        "  muls r4, r7\n"
        "  movs r7, #0\n"
        "  add r2, r11\n"
        "  add r1, r8\n"
        "  adds r3, r3, r4\n"
        "  cmp r1, r9\n"
        "  blo 3f\n"
        "  mov r4, r9\n"
        "  subs r1, r1, r4\n"
        "3:\n"
        "  asrs r4, r3, #31\n"
        "  adds r5, r5, r3\n"
        "  adcs r6, r4\n"
        "4:\n"
        "  cmp r2, r10\n"
        "  bne 1b\n"
        "  lsrs r1, r1, #1\n"
        "  movs r0, r5\n"
        "  mov r12, r6\n"
        "  pop {r2, r4-r7}\n"
        "  str r1, [r2]\n"
        "  mov r1, r12\n"
        "  mov r8, r4\n"
        "  mov r9, r5\n"
        "  mov r10, r6\n"
        "  mov r11, r7\n"
        "  pop {r4-r7, pc}\n"
        ".size frf_sum_by_twos_armv6m, . - frf_sum_by_twos_armv6m\n"
        ".text\n");
#endif
