/* SPDX-License-Identifier: MIT */
/// A measurement: plays a table through any drive, keeps every sample, stops gently whatever happens.
///
/// Fade in or approach, settling periods, counted periods, fade out. Row 0 of the run is the first sample of the first
/// settling period (of the first counted one without any): fades and approach are played but not kept, so that a
/// complete run has exactly (settle_periods + periods) * N rows. A measurement that ends early keeps what it has up to
/// the moment it was told to stop: its `periods` are the whole ones among them, and the ramp down is not kept.
///
/// A run has the columns time_s, torque_ref_Nm, torque_Nm, position_rad, velocity_rad_per_s, in cascade mode also
/// position_ref_rad and velocity_ref_rad_per_s (what was sent with the same SYNC), and `valid` only if samples were
/// lost; a linear table gives the linear twins. Keys beside those of struct run: mode, samples_lost, samples_late, and
/// where they apply torque_clipped, interrupted, stopped_by.
#ifndef SERVOSCOPE_MEASURE_MEASURE_H
#define SERVOSCOPE_MEASURE_MEASURE_H

#include "drivers/drive.h"
#include "guard/guard_real.h"
#include "lab/measure/live.h"
#include "lab/record/error.h"
#include "lab/record/run.h"
#include "msgen/table.h"

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct measure_plan {
    const struct msgen_table *table; ///< torque, velocity and position for the cascade, at least torque in torque mode
    enum drive_mode mode;
    uint32_t settle_periods;
    uint32_t periods;      ///< >= 1
    uint32_t fade_samples; ///< length of the fade in and of the fade out; 0: measure_ramp_samples
    /// Begin at full amplitude at the table's start index. A cascade first travels to the position there, as long as
    /// the fade in would last, and stands there for measure_dwell_s (msgen/player.h, approach): the first period then
    /// has the transient that the designer expects. In torque mode there is nothing to travel to.
    bool without_fade_in;
    uint32_t abort_samples;     ///< length of the ramp down on a stop; 0: measure_ramp_samples
    uint32_t lost_in_a_row_max; ///< more lost samples than this one after the other stop the measurement; 0: 20
    double lost_for_s; ///< the same as a time, where that is more samples: a bus in real time stumbles now and then
    /// GUARD_REAL_LIMITS_NONE where none are wanted; watchdog_samples is overwritten. Torque and speed limits are set
    /// in the drive too; without a torque limit the drive gets 3 times the table's largest torque.
    struct guard_real_limits limits;
    double following_error_rad; ///< > 0: set in the drive
    /// Set to non-zero from a signal handler or another thread: ramp down and stop. NULL: nobody asks.
    const volatile sig_atomic_t *stop_requested;
    struct measure_live *live; ///< told of each sample, for another thread to look at; NULL: nobody looks
};

enum measure_end {
    measure_complete,
    measure_interrupted, ///< stop_requested
    measure_tripped,     ///< a limit of the guard, or too many samples lost in a row
    measure_failed,      ///< the drive: fault, bus, no answer
};

enum { measure_parts = 100 };

struct measure_report {
    enum measure_end end;
    char stopped_by[256]; ///< one line for a person; empty if complete
    size_t rows;          ///< kept
    size_t rows_planned;
    size_t rows_lost;        ///< of those kept, marked valid = 0
    uint32_t torque_clipped; ///< set-points clipped to the torque limit
    uint32_t
        late_in_part[measure_parts]; ///< late samples in each hundredth of the planned rows; not those of the fades
    double end_position_rad;         ///< of the last sample, after the fade out, from where the axis stood at arm
    struct drive_counters counters;
};

/// Time to come to rest in after an approach. The default cascade's slowest time constant is 56 ms, but a belt goes on
/// swinging: with an antiresonance of 11 Hz, hardly damped, the first period's transient is the designer's within 8 %
/// after 0.5 s, to 0.4 % after 1 s (tests/api/test_measure_approach.c).
extern const double measure_dwell_s;

/// Length of a ramp that is gentle for this table, in samples.
/// Equation:  max(0.05 s, in cascade mode 1.5 max|position| / max|velocity|), at most 10 s: a cascade has to travel
///            back by the position it holds, and this ramp adds at most the table's own top speed (msgen/player.h,
///            trap).
///            A table that travels at V: at least 1.5 |V| / max|acceleration| too, so that setting off asks for no more
///            than the table's own top acceleration
uint32_t measure_ramp_samples(const struct msgen_table *table, enum drive_mode mode);

/// Which hundredth of a run a row belongs to. Range: row < rows_planned
size_t measure_part_of(size_t row, size_t rows_planned);

/// Checks a plan against its table without touching a drive.
/// Errors: error_usage or error_refused: no periods, channels that the mode needs are missing, more rows than memory
///         holds, limits that are none, table samples beyond the torque limit; of a table that travels: torque mode
///         (nothing would hold the speed), a position limit that all its periods together pass, more periods than its
///         counts hold
int measure_check(const struct measure_plan *plan, struct error *out_error);

/// Opens the drive (drive->operations->open), measures, stops it. Does not close it.
/// Bound:  the set-points never step by more than the table does plus 1.5 max|x| / (length of the ramp), the stop
///         included, but for torque and velocity at the first sample without a fade in; the last one sent is rest at
///         the position reached: torque and velocity 0, position 0 or where a table that travels has got to, without
///         going back. A drive that fails is not sent set-points any more: it is told to stop.
/// Returns 0 if complete; else an error. *out_run then holds what was measured; it is empty, with nothing to free, if
/// out_run->rows is 0.
/// Test:   tests/unit/test_measure.c
int measure_run(const struct drive *drive, const struct measure_plan *plan, struct run *out_run,
                struct measure_report *out_report, struct error *out_error);

#endif
