/* SPDX-License-Identifier: MIT */
#include "frf/dft.h"
#include "frf/two_level.h"

#define FRF_TABLE  struct frf_two_level_f32
#define FRF_MEMBER two_level_f32
#include "frf/dft_float.h"

static inline void look_up(const struct frf_two_level_f32 *table, uint32_t index, float *out_cosine, float *out_sine)
{
    const struct frf_point_f32 *coarse = &table->coarse[index >> table->group_bits];
    const struct frf_turn_f32 *turn = &table->fine[index & ((1u << table->group_bits) - 1u)];
    *out_cosine = coarse->cosine - (coarse->cosine * turn->less + coarse->sine * turn->sine);
    *out_sine = coarse->sine - (coarse->sine * turn->less - coarse->cosine * turn->sine);
}

enum core_status frf_dft_init_two_level_f32(struct frf_dft *self, const struct frf_dft_config *config,
                                            const struct frf_two_level_f32 *table)
{
    if (!table || !table->coarse || !table->fine) {
        return core_err_argument;
    }
    if (table->group_bits != frf_group_bits(table->period_samples)) {
        return core_err_frf_period;
    }
    enum core_status status = frf_dft_set_up(self, config, table->period_samples, frf_number_f32, add);
    if (status == core_ok) {
        self->twiddles.two_level_f32 = *table;
    }
    return status;
}
