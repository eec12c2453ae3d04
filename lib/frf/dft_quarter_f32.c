/* SPDX-License-Identifier: MIT */
#include "frf/dft.h"
#include "frf/quarter.h"

#define FRF_TABLE  struct frf_quarter_f32
#define FRF_MEMBER quarter_f32
#include "frf/dft_float.h"

static inline void look_up(const struct frf_quarter_f32 *table, uint32_t index, float *out_cosine, float *out_sine)
{
    struct frf_quarter_place place = frf_find_quarter(index * table->sample_steps, table->quarter_steps);
    float cosine = table->sine[place.cosine], sine = table->sine[place.sine];
    *out_cosine = place.minus_cosine ? -cosine : cosine;
    *out_sine = place.minus_sine ? -sine : sine;
}

enum core_status frf_dft_init_quarter_f32(struct frf_dft *self, const struct frf_dft_config *config,
                                          const struct frf_quarter_f32 *quarter)
{
    if (!quarter || !quarter->sine) {
        return core_err_argument;
    }
    if (!frf_quarter_fits(quarter->period_samples, quarter->quarter_steps, quarter->sample_steps)) {
        return core_err_frf_period;
    }
    enum core_status status = frf_dft_set_up(self, config, quarter->period_samples, frf_number_f32, add);
    if (status == core_ok) {
        self->twiddles.quarter_f32 = *quarter;
    }
    return status;
}
