/* SPDX-License-Identifier: MIT */
#include "lab/design/clipping.h"

#include "lab/design/search.h"

double design_clipping_factor(size_t iteration, size_t iterations)
{
    return iterations > 1 ? 0.5 + 0.5 * (double)iteration / (double)(iterations - 1) : 0.5;
}

void design_clipping_step(const struct design_waveform *waveform, size_t signal, double level, double *packed,
                          double *scratch_y, double *inout_c)
{
    const size_t pair = signal / 2;
    const size_t pair_length = 2 * waveform->grid;
    for (size_t i = 0; i < waveform->packed_length; i++) {
        bool chosen = i / pair_length == pair && i % 2 == signal % 2;
        double value = packed[i] > level ? level : packed[i];
        value = value < -level ? -level : value;
        packed[i] = chosen ? value : 0;
    }
    design_waveform_gather(waveform, packed, scratch_y);
    design_search_keep_directions(waveform->line_count, scratch_y, inout_c);
}
