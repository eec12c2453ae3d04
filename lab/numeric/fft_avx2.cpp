/* SPDX-License-Identifier: MIT */
#include "lab/numeric/fft_code.hpp"

// These stay outside the pragma: what they define inline may be shared with the rest of the program.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <new>
#include <utility>
#include <vector>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)

#pragma GCC push_options
#pragma GCC target("avx2")
#include "lab/numeric/fft_lanes.hpp"
#pragma GCC pop_options

const fft_code *fft_code_avx2()
{
    return __builtin_cpu_supports("avx2") ? &lanes_code : nullptr;
}

#else

const fft_code *fft_code_avx2()
{
    return nullptr;
}

#endif
