/* SPDX-License-Identifier: MIT */
#include "lab/numeric/fft_lanes.hpp"

const fft_code *fft_code_portable()
{
    return &lanes_code;
}
