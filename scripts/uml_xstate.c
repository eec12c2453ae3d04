/* SPDX-License-Identifier: MIT */
/// Preloaded into User-Mode Linux by scripts/with-vcan on processors with AMX.
/// Its kernel keeps the floating-point state of its processes in a buffer of 2696 bytes and writes it back with
/// PTRACE_SETREGSET. A processor with AMX has a larger state, and the host refuses a short buffer for it. Here the
/// short state is laid over the full one that the process has now, and the AMX parts are marked as unused.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

#ifndef NT_X86_XSTATE
#define NT_X86_XSTATE 0x202
#endif

enum {
    state_bytes_max = 32768,
    used_parts_word = 512 / 8,  ///< of the state: bit mask of the parts that are in use
    first_amx_part = 17,
};

typedef long (*ptrace_function)(enum __ptrace_request request, ...);

static long set_state(ptrace_function next, pid_t pid, struct iovec *given)
{
    static __thread uint64_t full[state_bytes_max / 8];
    struct iovec whole = {.iov_base = full, .iov_len = sizeof full};
    void *kind = (void *)(uintptr_t)NT_X86_XSTATE;
    if (next(PTRACE_GETREGSET, pid, kind, &whole) < 0) {
        return -1;
    }
    if (whole.iov_len <= given->iov_len) {
        return next(PTRACE_SETREGSET, pid, kind, given);
    }
    memcpy(full, given->iov_base, given->iov_len);
    full[used_parts_word] &= (UINT64_C(1) << first_amx_part) - 1;
    return next(PTRACE_SETREGSET, pid, kind, &whole);
}

long ptrace(enum __ptrace_request request, ...)
{
    static ptrace_function next;
    va_list arguments;
    va_start(arguments, request);
    pid_t pid = va_arg(arguments, pid_t);
    void *address = va_arg(arguments, void *);
    void *data = va_arg(arguments, void *);
    va_end(arguments);
    if (!next) {
        void *symbol = dlsym(RTLD_NEXT, "ptrace");
        memcpy(&next, &symbol, sizeof next);
    }
    if (request == PTRACE_SETREGSET && (uintptr_t)address == NT_X86_XSTATE) {
        return set_state(next, pid, data);
    }
    return next(request, pid, address, data);
}
