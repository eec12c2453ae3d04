/* SPDX-License-Identifier: MIT */
/// Design of a multisine that uses as much of the drive as its limits allow.
/// Model: one inertia J (or mass m); q(t) = c_A sum_k A_k cos(2 pi f_k t + phi_k), torque = J q''. The relative
/// amplitudes A_k follow from the limits (each line alone just reaches one), the method chooses phi_k, and c_A is then
/// as large as the limits allow. Every method is one file; none knows the others. Units: rad, rad/s, rad/s2, Nm, kg m2;
/// with `linear` set the same fields hold m, m/s, m/s2, N, kg.
#ifndef SERVOSCOPE_DESIGN_DESIGN_H
#define SERVOSCOPE_DESIGN_DESIGN_H

#include "lab/record/error.h"

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct sim_model;

enum {
    design_period_samples_max = 1 << 20,
};

/// Where the limits hold.
enum design_grid {
    design_grid_continuous, ///< for every t, with guarantee (cosine margin on a grid of >= 160 points per highest line)
    design_grid_samples,    ///< at the samples of the table; between them the signals may be some percent higher
};

/// Which iterate standard clipping keeps.
enum design_keep {
    design_keep_all,          ///< the one with the largest effective value within all limits
    design_keep_acceleration, ///< the one with the smallest acceleration crest factor
};

/// Where in its period the table begins.
enum design_start {
    design_start_paper, ///< the velocity's zero crossing with the least acceleration (first paper, 3.3)
    design_start_none,  ///< sample 0 of equation (1)
    design_start_bank,  ///< least expected transient over a bank of nominal two-mass drives (start_phase.h)
    design_start_model, ///< least transient of the drive that request.start_model describes
};

/// Largest absolute values; 0: does not limit.
struct design_limits {
    double position_rad;
    double velocity_rad_per_s;
    double acceleration_rad_per_s2;
    double torque_Nm;
};

struct design_request {
    uint32_t rate_num_hz; ///< sample rate = numerator / denominator
    uint32_t rate_den;
    size_t period_samples; ///< 4 .. design_period_samples_max
    size_t bin_count;
    const uint32_t *bins; ///< excited lines in units of rate / period_samples, ascending, 1 .. (N - 1) / 2
    struct design_limits limits;
    double inertia_kgm2; ///< > 0: torque is inertia times acceleration
    bool linear;
    /// Torque amplitudes of the lines relative to each other (bin_count numbers > 0); NULL: by the limits (spectrum.h).
    const double *torque_shape;
    /// 0 .. 20, for "fast": each amplitude may differ from the prescribed ratio by this much, up or down, and a common
    /// factor.
    double amplitude_tolerance_db;
    const char *method;    ///< a name from design_methods[]; NULL: "fast"
    enum design_keep keep; ///< for "clip"
    enum design_grid grid;
    enum design_start start;
    size_t iterations;                   ///< 0: the method's own
    const struct sim_model *start_model; ///< with design_start_model
    bool torque_mode;                    ///< the table will drive the torque alone (open loop), not the cascade
    size_t starts; ///< of "fast": 1 is the deterministic start alone, more add seeded ones; 0: by the problem's size
    double time_budget_s; ///< > 0, of "fast": further seeded starts until so much wall-clock time has gone
    size_t threads;       ///< 0: as many as there are processors
    uint64_t seed;
    /// Set to non-zero from a signal handler or another thread: the best so far is the result. NULL: nobody asks.
    const volatile sig_atomic_t *stop_requested;
    /// Called now and then from the thread that called design_run(): share of the work done, 0 .. 1, and the best
    /// effective torque so far on the grid of the search. NULL: nobody looks.
    void (*progress)(void *context, double share_done, double effective_torque_Nm);
    void *progress_context;
};

struct design_peaks {
    double position_rad;
    double velocity_rad_per_s;
    double acceleration_rad_per_s2;
    double torque_Nm;
};

struct design_result {
    const char *method;
    size_t period_samples;
    size_t bin_count;
    uint32_t *bins;
    double *amplitude_rad; ///< c_A A_k: amplitude of the position, bin_count values
    double *phase_rad;     ///< phi_k of the position at sample 0 of the series below
    /// One period each, period_samples values, around zero; sample `start_index` is where playing begins.
    double *torque_Nm;
    double *position_rad;
    double *velocity_rad_per_s;
    double *acceleration_rad_per_s2;
    size_t start_index;
    /// Energy of the motor's velocity that is start transient in the first period, as a share of the steady state's,
    /// for a drive that begins at rest (start_phase.h); below 0: not known.
    double expected_transient;
    double travel_per_period_rad; ///< what the position gains beside its series; 0 without a bias velocity (offset.h)
    struct design_peaks peak;     ///< at the samples
    struct design_peaks peak_continuous; ///< on at least 16 times as many points
    double effective_torque_Nm;
    double effective_torque_continuous_Nm; ///< the same scaled down until the limits hold between the samples too
    double crest_factor;                   ///< torque peak (where the grid asks for it) over effective torque
    double bound_Nm;  ///< no phases give more at the amplitude ratios of this result on this grid (docs/theory.md)
    double cpu_s;     ///< processor time of the method, all threads added
    size_t starts;    ///< of "fast": how many were finished
    bool interrupted; ///< stop_requested was seen before the method was through
};

struct design_search;

/// A way of choosing the phases.
struct design_method {
    const char *name;
    const char *summary;
    size_t iterations; ///< if the request says 0; 0: nothing is iterated
    int (*run)(const struct design_request *request, struct design_search *search, struct error *out_error);
};

/// NULL-terminated.
extern const struct design_method *const design_methods[];

/// Chooses the phases and fills in one period of every signal.
/// Errors: error_usage with value and expectation for a request that makes no sense (no lines, lines at or above half
/// the rate or not ascending, no limit, a limit, inertia or torque of the shape that is not a positive number, unknown
/// method); error_refused if memory is short, for numbers so large or small that no finite design comes out, and what
/// design_start_apply() refuses (start.h). *out_result is empty then.
int design_run(const struct design_request *request, struct design_result *out_result, struct error *out_error);

void design_result_free(struct design_result *result);

#endif
