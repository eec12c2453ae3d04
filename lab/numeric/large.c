/* SPDX-License-Identifier: MIT */
/* madvise() is not in POSIX. */
#define _DEFAULT_SOURCE
#include "lab/numeric/large.h"

#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>

enum { huge_page = 1 << 21 };

void *large_allocate(size_t size)
{
    char *memory = malloc(size);
#ifdef MADV_HUGEPAGE
    if (memory && size >= 2 * huge_page) {
        /* A wish; where it is not granted the memory is as good as any. */
        size_t before = (huge_page - (uintptr_t)memory % huge_page) % huge_page;
        (void)madvise(memory + before, (size - before) / huge_page * huge_page, MADV_HUGEPAGE);
    }
#endif
    return memory;
}
