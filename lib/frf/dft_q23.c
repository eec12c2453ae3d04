/* SPDX-License-Identifier: MIT */
#include "frf/dft.h"

#define FRF_TABLE  struct frf_twiddles_q23
#define FRF_MEMBER q23
#define FRF_SAMPLE int32_t
#define FRF_FACTOR int64_t
#include "frf/dft_integer.h"

static inline void look_up(const struct frf_twiddles_q23 *table, uint32_t index, int64_t *out_cosine, int64_t *out_sine)
{
    *out_cosine = table->cosine[index];
    *out_sine = table->sine[index];
}

/* |sum| <= 2^23 * (2^23 - 1) * N: has to stay below 2^63. */
CORE_STATIC_ASSERT((uint64_t)SERVOSCOPE_FRF_PERIOD_MAX <= ((uint64_t)1 << 62) >> (23 + 23),
                   q23_accumulator_cannot_overflow);

enum core_status frf_dft_init_q23(struct frf_dft *self, const struct frf_dft_config *config,
                                  const struct frf_twiddles_q23 *twiddles)
{
    if (!twiddles || !twiddles->sine || !twiddles->cosine) {
        return core_err_argument;
    }
    enum core_status status = frf_dft_set_up(self, config, twiddles->period_samples, frf_number_q23, add);
    if (status == core_ok) {
        self->twiddles.q23 = *twiddles;
    }
    return status;
}
