/* SPDX-License-Identifier: MIT */
#include "frf/dft.h"
#include "frf/two_level.h"

#define FRF_TABLE  struct frf_two_level_q15
#define FRF_MEMBER two_level_q15
#define FRF_SAMPLE int16_t
#if SERVOSCOPE_FRF_LONG_MULTIPLY
#define FRF_PRODUCT int64_t /* one instruction, sum and all */
#else
#define FRF_PRODUCT int32_t
#endif
#include "frf/dft_made.h"

static inline struct frf_point look_up(const struct frf_two_level_q15 *table, uint32_t index)
{
    uint32_t bits = table->group_bits;
    return frf_two_level_factor_q15(&table->coarse[index >> bits], &table->fine[index & ((1u << bits) - 1u)]);
}

/* Whatever the table holds a factor is at most 2^15, so |sum| <= 2^15 2^15 N: has to stay below 2^63. */
CORE_STATIC_ASSERT((uint64_t)SERVOSCOPE_FRF_PERIOD_MAX <= ((uint64_t)1 << 62) >> (15 + 15),
                   two_level_q15_accumulator_cannot_overflow);

enum core_status frf_dft_init_two_level_q15(struct frf_dft *self, const struct frf_dft_config *config,
                                            const struct frf_two_level_q15 *table)
{
    if (!table || !table->coarse || !table->fine) {
        return core_err_argument;
    }
    if (table->group_bits != frf_group_bits(table->period_samples)) {
        return core_err_frf_period;
    }
    enum core_status status = frf_dft_set_up(self, config, table->period_samples, frf_number_q15, add);
    if (status == core_ok) {
        self->twiddles.two_level_q15 = *table;
    }
    return status;
}
