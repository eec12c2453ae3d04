/* SPDX-License-Identifier: MIT */
#include "lab/numeric/fft_code.hpp"

// These stay outside the pragma: what they define inline may be shared with the rest of the program. <complex> is
// inside: its functions are only used on a type of this file, and have to be inlined.
#include <cmath>
#include <cstddef>
#include <new>
#include <sstream>
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
