/* SPDX-License-Identifier: MIT */
#include "lab/design/design.h"

#include "lab/design/method.h"
#include "lab/design/start.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum {
    fine_points_per_highest_line = 160, ///< cosine margin 1 / cos(pi / 160): 0.02 percent
    fine_oversampling_min = 16,
};

static const double pi = 3.14159265358979323846;
static const double tolerance_max_db = 20; ///< more than a factor of 100 between lines is no design any more

static int check_positive(const char *what, double value, bool may_be_absent, struct error *out_error)
{
    bool absent = may_be_absent && fpclassify(value) == FP_ZERO;
    if (!absent && !(value > 0 && isfinite(value))) {
        return error_set(out_error, error_usage, "%s: %g, expected a positive number", what, value);
    }
    return 0;
}

static int check_limits(const struct design_request *request, struct error *out_error)
{
    const struct design_limits *limits = &request->limits;
    int status = check_positive("position limit", limits->position_rad, true, out_error);
    status = status ? status : check_positive("velocity limit", limits->velocity_rad_per_s, true, out_error);
    status = status ? status : check_positive("acceleration limit", limits->acceleration_rad_per_s2, true, out_error);
    status = status ? status : check_positive("torque limit", limits->torque_Nm, true, out_error);
    status = status ? status : check_positive("inertia", request->inertia_kgm2, false, out_error);
    if (status) {
        return status;
    }
    if (!(limits->position_rad > 0 || limits->velocity_rad_per_s > 0 || limits->acceleration_rad_per_s2 > 0 ||
          limits->torque_Nm > 0)) {
        return error_set(out_error, error_usage,
                         "no limit is given, expected at least one of position, velocity, acceleration, torque");
    }
    return 0;
}

static int check_search(const struct design_request *request, struct error *out_error)
{
    const double tolerance_db = request->amplitude_tolerance_db;
    if (!(tolerance_db >= 0 && tolerance_db <= tolerance_max_db)) {
        return error_set(out_error, error_usage, "amplitude tolerance: %g dB, expected 0 to %g", tolerance_db,
                         tolerance_max_db);
    }
    return check_positive("time budget", request->time_budget_s, true, out_error);
}

static int check_lines(const struct design_request *request, struct error *out_error)
{
    if (request->rate_num_hz == 0 || request->rate_den == 0) {
        return error_set(out_error, error_usage, "rate: %u/%u Hz, expected both to be positive", request->rate_num_hz,
                         request->rate_den);
    }
    if (request->period_samples < 4 || request->period_samples > design_period_samples_max) {
        return error_set(out_error, error_usage, "period: %zu samples, expected 4 to %d", request->period_samples,
                         (int)design_period_samples_max);
    }
    if (request->bin_count == 0 || !request->bins) {
        return error_set(out_error, error_usage, "no lines, expected at least one");
    }
    const size_t highest = (request->period_samples - 1) / 2;
    for (size_t k = 0; k < request->bin_count; k++) {
        uint32_t bin = request->bins[k];
        if (bin < 1 || bin > highest) {
            return error_set(out_error, error_usage, "line %zu: bin %u, expected 1 to %zu (below half the rate)", k + 1,
                             bin, highest);
        }
        if (k > 0 && bin <= request->bins[k - 1]) {
            return error_set(out_error, error_usage, "line %zu: bin %u after bin %u, expected ascending bins", k + 1,
                             bin, request->bins[k - 1]);
        }
    }
    return 0;
}

static int check_shape(const struct design_request *request, struct error *out_error)
{
    for (size_t k = 0; request->torque_shape && k < request->bin_count; k++) {
        if (!(request->torque_shape[k] > 0 && isfinite(request->torque_shape[k]))) {
            return error_set(out_error, error_usage, "line %zu: torque %g in the shape, expected a positive number",
                             k + 1, request->torque_shape[k]);
        }
    }
    return 0;
}

static const struct design_method *find_method(const char *name)
{
    for (size_t i = 0; design_methods[i]; i++) {
        if (strcmp(design_methods[i]->name, name ? name : "fast") == 0) {
            return design_methods[i];
        }
    }
    return NULL;
}

static int refuse_method(const char *name, struct error *out_error)
{
    char known[256] = "";
    for (size_t i = 0; design_methods[i]; i++) {
        strncat(known, i > 0 ? ", " : "", sizeof known - strlen(known) - 1);
        strncat(known, design_methods[i]->name, sizeof known - strlen(known) - 1);
    }
    return error_set(out_error, error_usage, "method: '%s', expected one of %s", name, known);
}

/// All sub-sample shifts of the physical signals, one period of N samples each, so that memory does not grow with them.
struct fine_scan {
    struct design_waveform waveform; ///< design_waveform_physical on N points
    size_t shifts;
    double *c;      ///< 2 line_count
    double *packed; ///< of one shift; of shift 0 after scan()
    double sample_peak[design_signal_count];
    double fine_peak[design_signal_count];
};

static void fine_scan_free(struct fine_scan *self)
{
    design_waveform_free(&self->waveform);
    free(self->c);
    free(self->packed);
}

static bool fine_scan_create(const struct design_request *request, const struct design_spectrum *spectrum,
                             struct fine_scan *out_scan)
{
    const size_t period = request->period_samples;
    const size_t highest = spectrum->bins[spectrum->line_count - 1];
    struct fine_scan scan = {.shifts = (fine_points_per_highest_line * highest + period - 1) / period};
    scan.shifts = scan.shifts < fine_oversampling_min ? fine_oversampling_min : scan.shifts;
    if (!design_waveform_create(spectrum, design_waveform_physical, period, &scan.waveform)) {
        return false;
    }
    scan.c = calloc(2 * spectrum->line_count, sizeof(double));
    scan.packed = calloc(scan.waveform.packed_length, sizeof(double));
    if (!scan.c || !scan.packed) {
        fine_scan_free(&scan);
        return false;
    }
    *out_scan = scan;
    return true;
}

/// Fills in the peaks for phases c; the shift by r / shifts of a sample turns line b by 2 pi b r / (shifts N).
static void fine_scan_run(struct fine_scan *self, const double *c)
{
    const struct design_waveform *waveform = &self->waveform;
    for (size_t r = self->shifts; r-- > 0;) {
        for (size_t k = 0; k < waveform->line_count; k++) {
            double angle =
                2 * pi * (double)waveform->bins[k] * (double)r / ((double)self->shifts * (double)waveform->grid);
            self->c[2 * k] = c[2 * k] * cos(angle) - c[2 * k + 1] * sin(angle);
            self->c[2 * k + 1] = c[2 * k] * sin(angle) + c[2 * k + 1] * cos(angle);
        }
        design_waveform_synthesise(waveform, self->c, self->packed);
        for (size_t s = 0; s < design_signal_count; s++) {
            self->sample_peak[s] = design_waveform_peak(waveform, self->packed, s);
            self->fine_peak[s] = fmax(self->fine_peak[s], self->sample_peak[s]);
        }
    }
}

static double largest_ratio(const double *peak, const double *limit)
{
    double ratio = 0;
    for (int s = 0; s < design_signal_count; s++) {
        ratio = fmax(ratio, peak[s] / limit[s]);
    }
    return ratio;
}

/// c_A: the limits are just reached at the samples, or cannot be exceeded anywhere (Ehlich and Zeller's margin).
static double scale_of(const struct design_request *request, const struct design_spectrum *spectrum,
                       const struct fine_scan *scan)
{
    if (request->grid == design_grid_samples) {
        return 1 / largest_ratio(scan->sample_peak, spectrum->limit);
    }
    double fine_points = (double)scan->shifts * (double)request->period_samples;
    return cos(pi * spectrum->bins[spectrum->line_count - 1] / fine_points) /
           largest_ratio(scan->fine_peak, spectrum->limit);
}

static bool allocate_result(const struct design_request *request, struct design_result *result)
{
    result->period_samples = request->period_samples;
    result->bin_count = request->bin_count;
    result->bins = calloc(request->bin_count, sizeof *result->bins);
    double **line_fields[] = {&result->amplitude_rad, &result->phase_rad};
    double **series[] = {&result->torque_Nm, &result->position_rad, &result->velocity_rad_per_s,
                         &result->acceleration_rad_per_s2};
    bool complete = result->bins != NULL;
    for (size_t i = 0; i < 2; i++) {
        *line_fields[i] = calloc(request->bin_count, sizeof(double));
        complete = complete && *line_fields[i];
    }
    for (size_t i = 0; i < 4; i++) {
        *series[i] = calloc(request->period_samples, sizeof(double));
        complete = complete && *series[i];
    }
    return complete;
}

static void fill_series(const struct design_request *request, const struct fine_scan *scan, double scale,
                        struct design_result *result)
{
    const size_t period = request->period_samples;
    const double *first_pair = scan->packed;
    const double *second_pair = scan->packed + 2 * period;
    for (size_t n = 0; n < period; n++) {
        result->position_rad[n] = scale * first_pair[2 * n];
        result->velocity_rad_per_s[n] = scale * first_pair[2 * n + 1];
        result->acceleration_rad_per_s2[n] = scale * second_pair[2 * n];
        result->torque_Nm[n] = request->inertia_kgm2 * result->acceleration_rad_per_s2[n];
    }
}

static struct design_peaks peaks_of(const double *peak, double scale, double inertia_kgm2)
{
    return (struct design_peaks){
        .position_rad = scale * peak[design_position],
        .velocity_rad_per_s = scale * peak[design_velocity],
        .acceleration_rad_per_s2 = scale * peak[design_acceleration],
        .torque_Nm = scale * peak[design_acceleration] * inertia_kgm2,
    };
}

static void fill_result(const struct design_request *request, const struct design_spectrum *spectrum,
                        const struct design_search *search, const struct fine_scan *scan, struct design_result *result)
{
    const bool at_samples = request->grid == design_grid_samples;
    const double scale = scale_of(request, spectrum, scan);
    const double torque_rms = request->inertia_kgm2 * design_spectrum_rms(spectrum, design_acceleration);
    memcpy(result->bins, request->bins, request->bin_count * sizeof *result->bins);
    for (size_t k = 0; k < request->bin_count; k++) {
        result->amplitude_rad[k] = scale * spectrum->amplitude_rad[k];
        result->phase_rad[k] = atan2(search->best[2 * k + 1], search->best[2 * k]);
    }
    fill_series(request, scan, scale, result);
    result->peak = peaks_of(scan->sample_peak, scale, request->inertia_kgm2);
    result->peak_continuous = peaks_of(scan->fine_peak, scale, request->inertia_kgm2);
    result->effective_torque_Nm = scale * torque_rms;
    result->effective_torque_continuous_Nm =
        result->effective_torque_Nm / fmax(1, scale * largest_ratio(scan->fine_peak, spectrum->limit));
    result->crest_factor =
        (at_samples ? result->peak.torque_Nm : result->peak_continuous.torque_Nm) / result->effective_torque_Nm;
    result->bound_Nm = torque_rms * design_spectrum_scale_bound(spectrum, at_samples ? request->period_samples : 0);
}

/// Of this thread: others of the program are not the optimiser's.
static double cpu_seconds(void)
{
    struct timespec now = {0};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/// Makes the amplitudes that were found the prescribed ones. Rounding is not to leave the tolerance.
static void take_amplitudes(const struct design_search *search, double tolerance_db, struct design_spectrum *spectrum)
{
    const double longest = pow(10, tolerance_db / 20);
    for (size_t k = 0; k < spectrum->line_count; k++) {
        double *c = &search->best[2 * k];
        double length = hypot(c[0], c[1]);
        spectrum->amplitude_rad[k] *= fmax(1 / longest, fmin(length, longest));
        c[0] /= length;
        c[1] /= length;
    }
}

static int run_method(const struct design_request *request, const struct design_method *method,
                      struct design_search *search, struct design_result *result, struct error *out_error)
{
    struct design_watch watch;
    design_watch_begin(request, request->inertia_kgm2 * design_spectrum_rms(search->spectrum, design_acceleration),
                       &watch);
    search->watch = &watch;
    const double begun_s = cpu_seconds();
    int status = method->run(request, search, out_error);
    result->cpu_s = cpu_seconds() - begun_s + watch.cpu_s;
    result->starts = watch.starts;
    result->interrupted = atomic_load(&watch.interrupted);
    search->watch = NULL;
    return status;
}

/// Squares of limits near the ends of what a double holds leave no numbers.
static int check_result(const struct design_result *result, struct error *out_error)
{
    const double effective_torque_Nm = result->effective_torque_Nm;
    if (!(effective_torque_Nm > 0 && isfinite(effective_torque_Nm))) {
        return error_set(out_error, error_refused,
                         "the effective torque comes out as %g, expected a positive number: a limit or the inertia is "
                         "too large or too small to calculate with",
                         fabs(effective_torque_Nm));
    }
    return 0;
}

static int optimise(const struct design_request *request, const struct design_method *method,
                    struct design_spectrum *spectrum, struct design_result *result, struct error *out_error)
{
    struct design_search search;
    struct fine_scan scan;
    if (!design_search_create(request, spectrum, &search)) {
        return design_method_out_of_memory(out_error);
    }
    int status = run_method(request, method, &search, result, out_error);
    if (!status && request->amplitude_tolerance_db > 0) {
        take_amplitudes(&search, request->amplitude_tolerance_db, spectrum);
    }
    if (!status && !fine_scan_create(request, spectrum, &scan)) {
        status = design_method_out_of_memory(out_error);
    }
    if (!status) {
        fine_scan_run(&scan, search.best);
        fill_result(request, spectrum, &search, &scan, result);
        fine_scan_free(&scan);
        status = check_result(result, out_error);
    }
    status = status ? status : design_start_apply(request, result, out_error);
    design_search_free(&search);
    return status;
}

int design_run(const struct design_request *request, struct design_result *out_result, struct error *out_error)
{
    *out_result = (struct design_result){0};
    int status = check_lines(request, out_error);
    status = status ? status : check_shape(request, out_error);
    status = status ? status : check_limits(request, out_error);
    status = status ? status : check_search(request, out_error);
    const struct design_method *method = find_method(request->method);
    if (!status && !method) {
        status = refuse_method(request->method, out_error);
    }
    struct design_spectrum spectrum;
    if (status) {
        return status;
    }
    out_result->method = method->name;
    if (!allocate_result(request, out_result) || !design_spectrum_create(request, &spectrum)) {
        design_result_free(out_result);
        return design_method_out_of_memory(out_error);
    }
    status = optimise(request, method, &spectrum, out_result, out_error);
    design_spectrum_free(&spectrum);
    if (status) {
        design_result_free(out_result);
    }
    return status;
}

void design_result_free(struct design_result *result)
{
    free(result->bins);
    free(result->amplitude_rad);
    free(result->phase_rad);
    free(result->torque_Nm);
    free(result->position_rad);
    free(result->velocity_rad_per_s);
    free(result->acceleration_rad_per_s2);
    *result = (struct design_result){0};
}
