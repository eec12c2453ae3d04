/* SPDX-License-Identifier: MIT */
/// Compile-time options of lib/, all of them. Define one on the compiler's command line to change it; a value out of
/// range does not compile. Every translation unit of one program has to see the same values.
#ifndef SERVOSCOPE_CORE_CONFIG_H
#define SERVOSCOPE_CORE_CONFIG_H

/// Longest table that is accepted, in samples of one period. Range 4 .. 2^20 (the byte format's own limit).
#ifndef SERVOSCOPE_TABLE_SAMPLES_MAX
#define SERVOSCOPE_TABLE_SAMPLES_MAX 1048576
#endif
#if SERVOSCOPE_TABLE_SAMPLES_MAX < 4 || SERVOSCOPE_TABLE_SAMPLES_MAX > 1048576
#error "SERVOSCOPE_TABLE_SAMPLES_MAX: 4 .. 1048576 samples"
#endif

/// Longest period of the DFT, in samples. Range 4 .. 65536: an index of the twiddle table is 16 bit wide, and
/// 16-bit data with Q31 twiddles fill 62 of the accumulator's 63 bits at 65536 samples.
#ifndef SERVOSCOPE_FRF_PERIOD_MAX
#define SERVOSCOPE_FRF_PERIOD_MAX 65536
#endif
#if SERVOSCOPE_FRF_PERIOD_MAX < 4 || SERVOSCOPE_FRF_PERIOD_MAX > 65536
#error "SERVOSCOPE_FRF_PERIOD_MAX: 4 .. 65536 samples"
#endif

/// Most bins of one DFT object. Range 1 .. 32767; costs nothing, storage is the caller's.
#ifndef SERVOSCOPE_FRF_BINS_MAX
#define SERVOSCOPE_FRF_BINS_MAX 32767
#endif
#if SERVOSCOPE_FRF_BINS_MAX < 1 || SERVOSCOPE_FRF_BINS_MAX > 32767
#error "SERVOSCOPE_FRF_BINS_MAX: 1 .. 32767 bins"
#endif

/// Most channels of one DFT object. Range 1 .. 8; each costs 16 bytes of stack in the kernels.
#ifndef SERVOSCOPE_FRF_CHANNELS_MAX
#define SERVOSCOPE_FRF_CHANNELS_MAX 4
#endif
#if SERVOSCOPE_FRF_CHANNELS_MAX < 1 || SERVOSCOPE_FRF_CHANNELS_MAX > 8
#error "SERVOSCOPE_FRF_CHANNELS_MAX: 1 .. 8 channels"
#endif

/// Length of the partial sums of the float DFT, in samples. Range 8 .. 1024; 64 is near the best of all N in use,
/// because rounding grows with the length of a block and with the number of blocks.
#ifndef SERVOSCOPE_FRF_BLOCK
#define SERVOSCOPE_FRF_BLOCK 64
#endif
#if SERVOSCOPE_FRF_BLOCK < 8 || SERVOSCOPE_FRF_BLOCK > 1024
#error "SERVOSCOPE_FRF_BLOCK: 8 .. 1024 samples"
#endif

/// Whether the core multiplies 32 by 32 bits to 64 in one instruction. 0 (Cortex-M0, M0+, M23): the exact DFT with Q15
/// factors goes another way to the same sums, and frf_block_choose() keeps to it.
#ifndef SERVOSCOPE_FRF_LONG_MULTIPLY
#if defined(__ARM_ARCH_6M__) || defined(__ARM_ARCH_8M_BASE__)
#define SERVOSCOPE_FRF_LONG_MULTIPLY 0
#else
#define SERVOSCOPE_FRF_LONG_MULTIPLY 1
#endif
#endif
#if SERVOSCOPE_FRF_LONG_MULTIPLY != 0 && SERVOSCOPE_FRF_LONG_MULTIPLY != 1
#error "SERVOSCOPE_FRF_LONG_MULTIPLY: 0 or 1"
#endif

/// Whether the exact DFT with Q15 factors uses the loop written for ARMv6-M, or portable C with the same results.
#ifndef SERVOSCOPE_FRF_ARMV6M
#if defined(__ARM_ARCH_6M__) && defined(__GNUC__)
#define SERVOSCOPE_FRF_ARMV6M 1
#else
#define SERVOSCOPE_FRF_ARMV6M 0
#endif
#endif
#if SERVOSCOPE_FRF_ARMV6M != 0 && SERVOSCOPE_FRF_ARMV6M != 1
#error "SERVOSCOPE_FRF_ARMV6M: 0 or 1"
#endif

/// Whether the block DFT uses the kernel of cores with ARMv7E-M's rounding high multiplies (Cortex-M4, M7), or portable
/// C with the same results. Off by itself where the core or the compiler is another one.
#ifndef SERVOSCOPE_FRF_ARMV7EM
#if defined(__ARM_ARCH_7EM__) && defined(__GNUC__)
#define SERVOSCOPE_FRF_ARMV7EM 1
#else
#define SERVOSCOPE_FRF_ARMV7EM 0
#endif
#endif
#if SERVOSCOPE_FRF_ARMV7EM != 0 && SERVOSCOPE_FRF_ARMV7EM != 1
#error "SERVOSCOPE_FRF_ARMV7EM: 0 or 1"
#endif

/// Width of the floating-point type of everything outside the sample path (period statistics, FRF, the guard in SI
/// units): 64 is double, 32 is float for parts with a single-precision FPU.
#ifndef SERVOSCOPE_REAL_BITS
#define SERVOSCOPE_REAL_BITS 64
#endif
#if SERVOSCOPE_REAL_BITS != 32 && SERVOSCOPE_REAL_BITS != 64
#error "SERVOSCOPE_REAL_BITS: 32 or 64"
#endif

/// Keeps the compiler from moving memory accesses across it: between an interrupt that writes and a main loop that
/// reads on the same core nothing more is needed. On several cores define it as the part's data memory barrier.
#ifndef SERVOSCOPE_MEMORY_BARRIER
#if defined(__GNUC__)
#define SERVOSCOPE_MEMORY_BARRIER() __asm__ volatile("" ::: "memory")
#else
#error "SERVOSCOPE_MEMORY_BARRIER: define it for this compiler"
#endif
#endif

/// Compile-time check of C99: `name` says in the compiler's message what does not hold.
#define CORE_STATIC_ASSERT(condition, name) typedef char core_static_assert_##name[(condition) ? 1 : -1]

#endif
