/* SPDX-License-Identifier: MIT */
/* What a project that has taken lib/ in might do with it: a table's check, a tone's coefficient, a limit. C99 and C++.
 * */
#ifdef ONE_PAIR_OF_FILES
#include ONE_PAIR_OF_FILES
#else
#include "core/crc32.h"
#include "frf/block.h"
#include "frf/dft.h"
#include "frf/statistics.h"
#include "guard/guard.h"
#include "guard/guard_real.h"
#include "msgen/player.h"
#endif

#ifdef SERVOSCOPE_MSGEN_TABLE_H
static int damaged_table_is_refused(void)
{
    static const uint8_t bytes[4] = {'M', 'S', 'T', 0x1A};
    struct msgen_table table;
    return core_crc32(0, "123456789", 9) == 0xCBF43926u &&
           msgen_table_open(bytes, sizeof bytes, &table) == core_err_table_truncated;
}
#endif

#ifdef SERVOSCOPE_FRF_DFT_H
/* Of +1000, 0, -1000, 0 the first bin is 2000, exactly. */
static int tone_has_its_coefficient(void)
{
    static const int16_t period[4] = {1000, 0, -1000, 0};
    static const uint32_t bins[1] = {1};
    int16_t sines[FRF_TWIDDLE_WORDS(4u)];
    union frf_word storage[FRF_STORAGE_WORDS(1u, 1u)];
    struct frf_twiddles_q15 twiddles;
    struct frf_dft_config config = {bins, 1, 1, storage, FRF_STORAGE_WORDS(1u, 1u), 0, 0};
    struct frf_dft dft;
    struct frf_period latched;
    if (frf_twiddles_build_q15(sines, FRF_TWIDDLE_WORDS(4u), 4, &twiddles) != core_ok ||
        frf_dft_init_q15(&dft, &config, &twiddles) != core_ok) {
        return 0;
    }
    frf_dft_add_i16(&dft, period, 4);
    return frf_dft_latest(&dft, &latched) && frf_period_real(&dft, &latched, 0, 0) == 2000 * (int64_t)FRF_Q15_ONE &&
           frf_period_imaginary(&dft, &latched, 0, 0) == 0;
}
#endif

#ifdef SERVOSCOPE_GUARD_GUARD_H
static int speed_trips(void)
{
    static const struct guard_limits limits = {-100, 100, 10, 5, 0, 0, 0};
    struct guard guard;
    struct guard_sample sample = {0, 0, 0, true};
    if (guard_init(&guard, &limits) != core_ok || guard_arm(&guard, &sample) != core_ok) {
        return 0;
    }
    sample.velocity = 11;
    return guard_step(&guard, &sample) == guard_ramp_down && guard.state.cause == guard_cause_speed;
}
#endif

int main(void)
{
    int good = core_status_str(core_ok)[0] == 'o';
#ifdef SERVOSCOPE_MSGEN_TABLE_H
    good = good && damaged_table_is_refused();
#endif
#ifdef SERVOSCOPE_FRF_DFT_H
    good = good && tone_has_its_coefficient();
#endif
#ifdef SERVOSCOPE_GUARD_GUARD_H
    good = good && speed_trips();
#endif
    return good ? 0 : 1;
}
