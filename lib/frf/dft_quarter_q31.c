/* SPDX-License-Identifier: MIT */
#include "frf/dft.h"
#include "frf/quarter.h"

#define FRF_TABLE   struct frf_quarter_q31
#define FRF_MEMBER  quarter_q31
#define FRF_SAMPLE  int16_t
#define FRF_PRODUCT int64_t
#include "frf/dft_made.h"

static inline struct frf_point look_up(const struct frf_quarter_q31 *table, uint32_t index)
{
    struct frf_quarter_place place = frf_find_quarter(index * table->sample_steps, table->quarter_steps);
    struct frf_point factor = {table->sine[place.cosine], table->sine[place.sine]};
    factor.cosine = place.minus_cosine ? -factor.cosine : factor.cosine;
    factor.sine = place.minus_sine ? -factor.sine : factor.sine;
    return factor;
}

/* The same factors, so the same bound. */
CORE_STATIC_ASSERT((uint64_t)SERVOSCOPE_FRF_PERIOD_MAX <= ((uint64_t)1 << 62) >> (15 + 31),
                   quarter_q31_accumulator_cannot_overflow);

enum core_status frf_dft_init_quarter_q31(struct frf_dft *self, const struct frf_dft_config *config,
                                          const struct frf_quarter_q31 *quarter)
{
    if (!quarter || !quarter->sine) {
        return core_err_argument;
    }
    if (!frf_quarter_fits(quarter->period_samples, quarter->quarter_steps, quarter->sample_steps)) {
        return core_err_frf_period;
    }
    enum core_status status = frf_dft_set_up(self, config, quarter->period_samples, frf_number_q31, add);
    if (status == core_ok) {
        self->twiddles.quarter_q31 = *quarter;
    }
    return status;
}
