/* SPDX-License-Identifier: MIT */
#include "lab/tune/nyquist.h"

#include "lab/tune/gap.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

static const double pi = 3.141592653589793;
static const double degrees = 180.0 / 3.141592653589793;
static const double first_gain_least = 2.0, last_gain_most = 0.5;

/// Where the loop can still matter: 20 dB below 1.
static const double gain_that_matters = 0.1;

#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
static void
give_up(struct nyquist *io_nyquist, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(io_nyquist->reason, sizeof io_nyquist->reason, format, arguments);
    va_end(arguments);
    io_nyquist->verdict = nyquist_undecided;
}

static double decibel(double magnitude)
{
    return 20.0 * log10(magnitude);
}

/// The plant's phase at the lowest line on the branch that leads back to 0 Hz: around 0 for a velocity, around -90
/// degrees for a position, which covers a free inertia, friction, a spring and a delay.
static double first_phase(const struct tune_plant *plant, double complex response)
{
    const double centre = plant->output == tune_output_velocity ? 0.0 : -0.5 * pi;
    const double phase = carg(response);
    return phase - 2.0 * pi * round((phase - centre) / (2.0 * pi));
}

/// Whether the lowest lines lead although the response falls: an inertia measured with the wrong sign. (What leads and
/// rises is a spring, as friction is before it slides.)
static bool leads_and_falls(const struct tune_plant *plant, const double complex *response)
{
    const double lead_least = 0.25 * pi, apart = 1.5, slope_most = -0.5;
    const double centre = plant->output == tune_output_velocity ? 0.0 : -0.5 * pi;
    size_t k = 1;
    while (k + 1 < plant->count && plant->frequency_hz[k] < apart * plant->frequency_hz[0]) {
        k++;
    }
    const double slope = log(cabs(response[k] / response[0])) / log(plant->frequency_hz[k] / plant->frequency_hz[0]);
    return first_phase(plant, response[0]) - centre > lead_least && slope < slope_most;
}

/// Whether the controller answers an error that stays: a derivative alone lets position or velocity drift.
static bool check_hold(const struct tune_plant *plant, const struct tune_controller *controller,
                       struct nyquist *io_nyquist)
{
    for (size_t i = 0; i < controller->structure->gains; i++) {
        if (tune_term_power(controller->structure->terms[i]) <= 0 && controller->gain[i] > 0.0) {
            return true;
        }
    }
    give_up(io_nyquist, "nothing holds the %s: the gains are 0 but for the derivative's",
            plant->output == tune_output_velocity ? "velocity" : "position");
    return false;
}

static bool check_ends(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                       struct nyquist *io_nyquist)
{
    const double centre = plant->output == tune_output_velocity ? 0.0 : -0.5 * pi;
    const double reach = 130.0 / degrees;
    const size_t last = plant->count - 1;
    const double phase = first_phase(plant, response[0]);
    if (!(fabs(phase - centre) < reach) || leads_and_falls(plant, response)) {
        give_up(io_nyquist,
                "at the lowest line, %.4g Hz, the response has a phase of %.0f degrees, expected %.0f to %.0f (a wrong "
                "sign of the %s?)",
                plant->frequency_hz[0], phase * degrees, centre * degrees - 90.0, centre * degrees,
                plant->output == tune_output_velocity ? "velocity" : "position");
    } else if (!(cabs(loop[0]) >= first_gain_least)) {
        give_up(io_nyquist,
                "the open loop's gain at the lowest line, %.4g Hz, is %.1f dB, expected at least %.1f dB: lines below "
                "the crossover are missing",
                plant->frequency_hz[0], decibel(cabs(loop[0])), decibel(first_gain_least));
    } else if (!(cabs(loop[last]) <= last_gain_most)) {
        give_up(io_nyquist,
                "the open loop's gain at the highest line, %.4g Hz, is %.1f dB, expected at most %.1f dB: lines above "
                "the crossover are missing",
                plant->frequency_hz[last], decibel(cabs(loop[last])), decibel(last_gain_most));
    } else {
        return true;
    }
    return false;
}

/// Whether the lines show the turns of the known delay: delay times spacing stays at half of what would be ambiguous.
static bool check_delay(const struct tune_plant *plant, const double complex *loop, struct nyquist *io_nyquist)
{
    const double turns_most = 0.25, delay_s = fabs(plant->loop_delay_s);
    double below_hz = 0.0, below = INFINITY;
    for (size_t k = 0; k < plant->count; k++) {
        const double step_hz = plant->frequency_hz[k] - below_hz, larger = fmax(below, cabs(loop[k]));
        if (!(step_hz * delay_s <= turns_most) && larger > gain_that_matters) {
            give_up(io_nyquist,
                    "the loop's known delay of %.4g s turns the open loop by %.2f turns from %.6g to %.6g Hz, where it "
                    "is at %.1f dB, and lines that far apart do not show them: expected lines at most %.3g Hz apart "
                    "up to where it is below %.0f dB%s, or less delay",
                    delay_s, step_hz * delay_s, below_hz, plant->frequency_hz[k], decibel(cabs(loop[k])),
                    turns_most / delay_s, decibel(gain_that_matters), k == 0 ? " and from 0 Hz on" : "");
            return false;
        }
        below_hz = plant->frequency_hz[k];
        below = cabs(loop[k]);
    }
    return true;
}

static bool is_noisy(const struct tune_plant *plant, const double complex *response, size_t k)
{
    return plant->confidence_factor *
               fmax(plant->std[k] / cabs(response[k]), plant->std[k + 1] / cabs(response[k + 1])) >
           0.5;
}

/// The step of L's phase to the next line, on the branch that the known delay says.
static double find_step(const struct tune_plant *plant, const double complex *curve, size_t k)
{
    const double turn = tune_plant_known_turn(plant, plant->frequency_hz[k], plant->frequency_hz[k + 1]);
    return carg(curve[k + 1] / curve[k] * cexp(-I * turn)) + turn;
}

/// A drive's phase rises by 180 degrees at most before it falls again. A delay that turns by more than half a turn from
/// line to line seems to lead, on and on.
static bool check_rise(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                       struct nyquist *io_nyquist)
{
    const double rise_most = 1.5 * pi;
    double rise = 0.0, from_hz = plant->frequency_hz[0];
    for (size_t k = 0; k + 1 < plant->count; k++) {
        const bool seen = fmin(cabs(loop[k]), cabs(loop[k + 1])) > gain_that_matters && !is_noisy(plant, response, k);
        rise = seen ? rise + find_step(plant, response, k) : 0.0;
        if (!(rise > 0.0)) {
            rise = 0.0;
            from_hz = plant->frequency_hz[k + 1];
        }
        if (rise > rise_most) {
            give_up(io_nyquist,
                    "from %.6g to %.6g Hz the response's phase rises by %.0f degrees, as no drive's does (180 at "
                    "most): it turns the other way round by more than half a turn from line to line, as with a delay "
                    "above %.3g s; expected denser lines (a longer period)",
                    from_hz, plant->frequency_hz[k + 1], rise * degrees,
                    0.5 / (plant->frequency_hz[k + 1] - plant->frequency_hz[k]));
            return false;
        }
    }
    return true;
}

/// Whether the curve between two lines is known well enough to count its turns.
static bool check_step(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                       size_t k, struct nyquist *io_nyquist)
{
    const double turn = carg((1.0 + loop[k + 1]) / (1.0 + loop[k]));
    const double step = find_step(plant, loop, k), gain_that_leads = 0.5;
    const double larger = fmax(cabs(loop[k]), cabs(loop[k + 1])), smaller = fmin(cabs(loop[k]), cabs(loop[k + 1]));
    const bool lags = step < -0.5 * pi && larger > gain_that_matters;
    const bool leads = step > 0.5 * pi && smaller > gain_that_leads; // or lags by 180 to 270 degrees
    if (fabs(turn) <= 0.5 * pi && !((lags || leads) && !is_noisy(plant, response, k))) {
        return true;
    }
    give_up(io_nyquist,
            "between the lines at %.6g and %.6g Hz the open loop turns by %.0f degrees (seen from -1 by %.0f): a "
            "resonance or delay may hide there, expected denser lines",
            plant->frequency_hz[k], plant->frequency_hz[k + 1], step * degrees, turn * degrees);
    return false;
}

static bool check_noise(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                        struct nyquist *io_nyquist)
{
    for (size_t k = 0; k < plant->count; k++) {
        const double gain = cabs(loop[k] / response[k]);
        const double noise = plant->confidence_factor * plant->std[k] * gain, doubt = plant->doubt[k] * gain;
        if (cabs(1.0 + loop[k]) > noise + doubt) {
            continue;
        }
        if (doubt > noise) {
            give_up(io_nyquist, "at %.6g Hz the open loop is %.3g away from -1 and known to +-%.3g only: %s",
                    plant->frequency_hz[k], cabs(1.0 + loop[k]), noise + doubt, plant->doubt_from);
        } else {
            give_up(io_nyquist,
                    "at %.6g Hz the open loop is %.3g away from -1 and known to +-%.3g only (95 %%): noise decides, "
                    "expected more periods or a larger excitation there",
                    plant->frequency_hz[k], cabs(1.0 + loop[k]), noise + doubt);
        }
        return false;
    }
    return true;
}

/// Whether every resonance that no line shows would leave the count of turns as it is.
static bool check_gaps(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                       struct nyquist *io_nyquist)
{
    struct gap gap;
    char left_out[120], others[48] = "";
    const size_t count = gap_find_worst(plant, response, loop, &gap);
    if (count == 0) {
        return true;
    }
    const double low_hz = plant->frequency_hz[gap.line], high_hz = plant->frequency_hz[gap.line + 1];
    tune_plant_name_left_out(plant, low_hz, high_hz, sizeof left_out, left_out);
    if (count > 1) {
        snprintf(others, sizeof others, "; %zu more gap%s like it", count - 1, count > 2 ? "s" : "");
    }
    give_up(io_nyquist,
            "between the lines at %.6g and %.6g Hz, where the open loop is at %.1f and %.1f dB, a resonance may hide "
            "there that raises it by %.2g dB, and from %.2g dB on it may reach -1: expected lines between %.6g and "
            "%.6g Hz%s%s%s%s",
            low_hz, high_hz, decibel(cabs(loop[gap.line])), decibel(cabs(loop[gap.line + 1])), decibel(1.0 + gap.rise),
            decibel(1.0 + gap.reach), low_hz, high_hz, left_out[0] ? " (" : "", left_out,
            left_out[0] ? " not valid)" : "", others);
    return false;
}

static void find_worst(const struct tune_plant *plant, const double complex *loop, struct nyquist *io_nyquist)
{
    io_nyquist->worst_distance = INFINITY;
    for (size_t k = 0; k < plant->count; k++) {
        if (cabs(1.0 + loop[k]) < io_nyquist->worst_distance) {
            io_nyquist->worst_distance = cabs(1.0 + loop[k]);
            io_nyquist->worst_hz = plant->frequency_hz[k];
        }
    }
    io_nyquist->first_gain_db = decibel(cabs(loop[0]));
    io_nyquist->last_gain_db = decibel(cabs(loop[plant->count - 1]));
}

static void state_assumptions(const struct tune_plant *plant, struct nyquist *io_nyquist)
{
    const size_t size = sizeof io_nyquist->assumptions[0];
    snprintf(io_nyquist->assumptions[0], size, "the drive alone is stable, but for the integration of a free inertia");
    snprintf(io_nyquist->assumptions[1], size,
             "below %.4g Hz, the lowest line, the open loop's gain (%.1f dB there) does not fall below 0 dB",
             plant->frequency_hz[0], io_nyquist->first_gain_db);
    snprintf(io_nyquist->assumptions[2], size,
             "above %.4g Hz, the highest line, the open loop's gain (%.1f dB there) does not rise above 0 dB",
             plant->frequency_hz[plant->count - 1], io_nyquist->last_gain_db);
    double spacing_hz = INFINITY;
    for (size_t k = 0; k + 1 < plant->count; k++) {
        spacing_hz = fmin(spacing_hz, plant->frequency_hz[k + 1] - plant->frequency_hz[k]);
    }
    snprintf(io_nyquist->assumptions[4], size,
             "the measured response has no delay near %.3g s or more, 1 over the spacing of its lines: they would not "
             "show its turns",
             1.0 / spacing_hz);
    const double lower_end_hz = gap_lower_end_hz(plant);
    const int used =
        snprintf(io_nyquist->assumptions[3], size,
                 "no resonance between two lines has less damping than 0.01 or raises the open loop by more "
                 "than 30 dB");
    if (lower_end_hz > plant->frequency_hz[0]) {
        snprintf(io_nyquist->assumptions[3] + used, size - (size_t)used,
                 "; below %.4g Hz, where lines are sparse, it comes behind its antiresonance", lower_end_hz);
    }
}

void nyquist_judge(const struct tune_plant *plant, const double complex *response, const double complex *loop,
                   const struct tune_controller *controller, bool measured, struct nyquist *out_nyquist)
{
    *out_nyquist = (struct nyquist){.verdict = nyquist_undecided};
    find_worst(plant, loop, out_nyquist);
    state_assumptions(plant, out_nyquist);
    if (!check_hold(plant, controller, out_nyquist) || !check_delay(plant, loop, out_nyquist) ||
        !check_ends(plant, response, loop, out_nyquist)) {
        return;
    }
    // Terms with gains >= 0 stay within 90 degrees of each other, and a biquad's phase within 180, so the controller's
    // principal phase is the one that is followed from 0 Hz. With |L| > 1 the phases of 1 + L and L differ by less than
    // 90 degrees.
    const double controller_phase = carg(tune_controller_at(controller, plant->delay[0]));
    double phase = controller_phase + first_phase(plant, response[0]) + carg(1.0 + 1.0 / loop[0]);
    if (measured && !check_gaps(plant, response, loop, out_nyquist)) {
        return;
    }
    for (size_t k = 0; k + 1 < plant->count; k++) {
        if (!check_step(plant, response, loop, k, out_nyquist)) {
            return;
        }
        phase += carg((1.0 + loop[k + 1]) / (1.0 + loop[k]));
    }
    if (!check_rise(plant, response, loop, out_nyquist)) {
        return;
    }
    if (measured && !check_noise(plant, response, loop, out_nyquist)) {
        return;
    }
    const long turns = lround((phase - carg(1.0 + loop[plant->count - 1])) / (2.0 * pi));
    if (turns > 0) {
        give_up(out_nyquist, "the open loop turns %ld times round -1 against the clock: the drive alone is unstable",
                turns);
        return;
    }
    out_nyquist->unstable_poles = (int)(-2 * turns);
    out_nyquist->verdict = turns == 0 ? nyquist_stable : nyquist_unstable;
}
