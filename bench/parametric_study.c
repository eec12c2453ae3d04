/* SPDX-License-Identifier: MIT */
#include "bench/parametric_study.h"

#include "lab/estimate/method.h"
#include "lab/numeric/statistics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925;
static char study_path[] = "drawn";

/// Response with the hold, exact.
static double complex response_of(const struct study_plant *plant, double frequency_hz)
{
    double step = 1.0 / plant->sample_rate_hz;
    double whole = floor(plant->delay_samples);
    double part = plant->delay_samples - whole; // of a sample that the held input comes late
    double complex z = cexp(I * two_pi * frequency_hz * step);
    double complex sum = 0.0;
    for (size_t i = 0; i < plant->poles; i++) {
        double complex s = plant->pole_rad_per_s[i];
        double complex all = cexp(s * step);
        double complex rest = cexp(s * (1.0 - part) * step);
        sum += plant->residue[i] / s * ((rest - 1.0) + (all - rest) / z) / (z - all);
    }
    return sum * cexp(-I * two_pi * frequency_hz * step * whole);
}

static double uniform(struct random *random, double low, double high)
{
    return low + (high - low) * random_uniform(random);
}

static double log_uniform(struct random *random, double low, double high)
{
    return exp(uniform(random, log(low), log(high)));
}

static size_t whole(struct random *random, size_t low, size_t high)
{
    return low + (size_t)(random_uniform(random) * (double)(high - low + 1));
}

/// gain s / (s^2 + 2 damping w s + w^2)
static void add_mode(struct study_plant *io_plant, double frequency_hz, double damping, double gain)
{
    double complex pole = two_pi * frequency_hz * (-damping + I * sqrt(1.0 - damping * damping));
    double complex residue = gain * pole / (pole - conj(pole));
    size_t i = io_plant->poles;
    io_plant->pole_rad_per_s[i] = pole;
    io_plant->residue[i] = residue;
    io_plant->pole_rad_per_s[i + 1] = conj(pole);
    io_plant->residue[i + 1] = conj(residue);
    io_plant->poles += 2;
}

/// Modes from the first tenth of the band to its upper end; seen at the motor all have the sign of the rigid body, at
/// the last mass every other one has the opposite sign.
static void draw_plant(size_t kind, bool delay, double low_hz, double high_hz, struct random *random,
                       struct study_plant *io_plant)
{
    bool at_motor = kind == 0 || random_uniform(random) < 0.5;
    double gain = log_uniform(random, 1.0, 100.0);
    io_plant->kind = kind;
    io_plant->poles = 1;
    io_plant->pole_rad_per_s[0] = -two_pi * log_uniform(random, 0.1, 10.0) * low_hz;
    io_plant->residue[0] = gain;
    double first_hz = uniform(random, 0.15, 0.45) * high_hz;
    double second_hz = uniform(random, 1.5, 2.0) * first_hz;
    if (kind >= 1) {
        double size = at_motor ? log_uniform(random, 0.3, 3.0) : -log_uniform(random, 0.7, 1.5);
        add_mode(io_plant, first_hz, log_uniform(random, 0.02, 0.1), gain * size);
    }
    if (kind >= 2) {
        add_mode(io_plant, second_hz, log_uniform(random, 0.02, 0.1), gain * log_uniform(random, 0.3, 3.0));
    }
    io_plant->delay_samples = delay ? uniform(random, 0.1, 3.0) : 0.0;
}

/// Linear or spaced by a ratio; ascending.
static size_t draw_lines(struct random *random, size_t period_samples, uint32_t *out_bins)
{
    double highest = uniform(random, 0.1, 0.4) * (double)period_samples;
    bool linear = random_uniform(random) < 0.5;
    size_t count = whole(random, 60, 200);
    double step = fmax(1.0, floor(highest / (double)count));
    double ratio = pow(highest / 4.0, 1.0 / (double)count);
    double bin = linear ? step : 4.0;
    size_t used = 0;
    for (; bin <= highest && used < study_lines_max; used++) {
        out_bins[used] = (uint32_t)bin;
        bin = linear ? bin + step : fmax(bin + 1.0, floor(bin * ratio + 0.5));
    }
    return used;
}

static double complex circular(struct random *random, double std)
{
    double real = random_normal(random);
    return std * sqrt(0.5) * (real + I * random_normal(random));
}

static void draw_periods(struct study_recording *io_self, struct random *random)
{
    size_t lines = io_self->recording.bin_count;
    double complex clean_input[study_lines_max], clean_output[study_lines_max];
    double power = 0.0;
    for (size_t k = 0; k < lines; k++) {
        double frequency_hz =
            io_self->bins[k] * io_self->run.sample_rate_hz / (double)io_self->recording.period_samples;
        clean_input[k] = cexp(I * two_pi * random_uniform(random));
        clean_output[k] = response_of(&io_self->plant, frequency_hz) * clean_input[k];
        power += creal(clean_output[k] * conj(clean_output[k])) / (double)lines;
    }
    double noise = sqrt(power) * pow(10.0, -io_self->snr_db / 20.0);
    double input_noise = io_self->input_noise ? pow(10.0, -(io_self->snr_db + 10.0) / 20.0) : 0.0;
    double tilt = uniform(random, 0.0, 1.0); // the noise's slope over frequency
    for (size_t p = 0; p < io_self->periods; p++) {
        for (size_t k = 0; k < lines; k++) {
            double colour = 1.0 / (1.0 + tilt * 4.0 * (double)io_self->bins[k] / (double)io_self->bins[lines - 1]);
            io_self->input[p * lines + k] = clean_input[k] + circular(random, input_noise);
            io_self->output[p * lines + k] = clean_output[k] + circular(random, noise * colour);
        }
    }
}

void study_draw(size_t kind, bool delay, uint64_t seed, struct study_recording *out_self)
{
    struct random random;
    random_seed(&random, seed);
    memset(out_self, 0, sizeof *out_self);
    size_t samples = whole(&random, 1000, 4000);
    out_self->run = (struct run){.path = study_path, .sample_rate_hz = log_uniform(&random, 500.0, 16000.0)};
    out_self->run.period_samples = samples;
    out_self->periods = whole(&random, 2, study_periods_max);
    out_self->snr_db = uniform(&random, 20.0, 60.0);
    out_self->input_noise = random_uniform(&random) < 0.5;
    out_self->recording = (struct periodic){.run = &out_self->run,
                                            .input = "torque_Nm",
                                            .output = "velocity_rad_per_s",
                                            .period_samples = samples,
                                            .bins = out_self->bins,
                                            .total = out_self->periods,
                                            .used = out_self->periods,
                                            .input_spectra = out_self->input,
                                            .output_spectra = out_self->output};
    size_t lines = draw_lines(&random, samples, out_self->bins);
    out_self->recording.bin_count = lines;
    double step_hz = out_self->run.sample_rate_hz / (double)samples;
    out_self->plant.sample_rate_hz = out_self->run.sample_rate_hz;
    draw_plant(kind, delay, out_self->bins[0] * step_hz, out_self->bins[lines - 1] * step_hz, &random,
               &out_self->plant);
    draw_periods(out_self, &random);
}

/// A true pole that a model's root may be: the nearest one in the upper half plane, by distance over its size.
static size_t nearest(const struct study_plant *plant, double complex s)
{
    size_t best = 0;
    double least = INFINITY;
    for (size_t i = 0; i < plant->poles; i++) {
        double distance = cabs(s - plant->pole_rad_per_s[i]) / cabs(plant->pole_rad_per_s[i]);
        if (distance < least) {
            least = distance;
            best = i;
        }
    }
    return best;
}

static void count_poles(const struct study_plant *plant, const struct parametric_model *model,
                        struct study_tally *io_tally)
{
    const double factor = 1.96;
    for (size_t i = 0; i < model->pole_count; i++) {
        const struct parametric_root *root = &model->poles[i];
        double complex truth = plant->pole_rad_per_s[nearest(plant, root->s_rad_per_s)];
        double frequency_hz = root->pair ? cabs(truth) / two_pi : -creal(truth) / two_pi;
        double found_hz = root->pair ? root->frequency_hz : -creal(root->s_rad_per_s) / two_pi;
        io_tally->frequencies++;
        io_tally->frequencies_covered += fabs(found_hz - frequency_hz) <= factor * root->frequency_std_hz;
        if (root->pair) {
            double damping = -creal(truth) / cabs(truth);
            io_tally->dampings++;
            io_tally->dampings_covered += fabs(root->damping - damping) <= factor * root->damping_std;
        }
    }
}

static double count_lines(const struct study_recording *recording, const struct frf *frf, struct study_tally *io_tally)
{
    double factor = strtod(estimate_key(frf, "confidence_95_factor"), NULL);
    size_t inside = 0;
    for (size_t k = 0; k < frf->count; k++) {
        double complex truth = response_of(&recording->plant, frf->frequency_hz[k]);
        inside += cabs(frf->real[k] + I * frf->imag[k] - truth) <= factor * frf->std[k];
    }
    double share = (double)inside / (double)frf->count;
    io_tally->covered += share;
    io_tally->covered_squares += share * share;
    return share;
}

static void list_one(const struct study_recording *recording, const struct parametric_outcome *outcome, double share,
                     FILE *list)
{
    const struct parametric_structure *structure = &outcome->model.structure;
    fprintf(list,
            "%zu poles, delay %.2f samples, %zu periods, %zu lines to %.3f fs, %.0f dB: %zu/%zu-%zu, %.0f samples, "
            "%.0f %% inside, cost %.0f of %.0f, misfit %.2f, pooled %zu\n    %s\n",
            recording->plant.poles, recording->plant.delay_samples, recording->periods, recording->recording.bin_count,
            recording->bins[recording->recording.bin_count - 1] / (double)recording->recording.period_samples,
            recording->snr_db, structure->denominator_order, structure->numerator_lowest, structure->numerator_order,
            outcome->model.delay_s * recording->run.sample_rate_hz, 100.0 * share, outcome->model.cost,
            outcome->model.cost_expected, outcome->misfit, outcome->pooled_lines, outcome->orders.why);
    for (size_t i = 0; i < outcome->model.pole_count; i++) {
        const struct parametric_root *pole = &outcome->model.poles[i];
        fprintf(list, "    %.5g +- %.2g Hz, damping %.4g +- %.2g%s\n", pole->frequency_hz, pole->frequency_std_hz,
                pole->damping, pole->damping_std, pole->cancels ? ", cancels" : "");
    }
    for (size_t i = 0; i < recording->plant.poles; i++) {
        double complex s = recording->plant.pole_rad_per_s[i];
        if (cimag(s) >= 0.0) {
            fprintf(list, "    true: %.5g Hz, damping %.4g\n", cabs(s) / two_pi, -creal(s) / cabs(s));
        }
    }
}

bool study_count(const struct study_recording *recording, struct study_tally *io_tally, FILE *list)
{
    static struct parametric_outcome outcome;
    const struct estimate_options options = {.order = estimate_order_auto, .parametric = &outcome};
    struct frf frf;
    struct error error = {0};
    io_tally->drawn++;
    if (frf_parametric_estimate(&recording->recording, &options, &frf, &error) != 0) {
        io_tally->refused++;
        if (list) {
            fprintf(list, "%zu periods: refused: %s\n", recording->periods, error.message);
        }
        return false;
    }
    size_t order = outcome.model.structure.denominator_order;
    io_tally->right += order == recording->plant.poles;
    io_tally->lower += order < recording->plant.poles;
    io_tally->higher += order > recording->plant.poles;
    if (order == recording->plant.poles) {
        count_poles(&recording->plant, &outcome.model, io_tally);
    }
    double share = count_lines(recording, &frf, io_tally);
    if (list) {
        list_one(recording, &outcome, share, list);
    }
    frf_free(&frf);
    return true;
}

void study_add(const struct study_tally *tally, struct study_tally *io_sum)
{
    io_sum->drawn += tally->drawn;
    io_sum->refused += tally->refused;
    io_sum->right += tally->right;
    io_sum->lower += tally->lower;
    io_sum->higher += tally->higher;
    io_sum->covered += tally->covered;
    io_sum->covered_squares += tally->covered_squares;
    io_sum->frequencies += tally->frequencies;
    io_sum->frequencies_covered += tally->frequencies_covered;
    io_sum->dampings += tally->dampings;
    io_sum->dampings_covered += tally->dampings_covered;
}

double study_coverage(const struct study_tally *tally, double *out_error)
{
    double fits = (double)(tally->drawn - tally->refused);
    double mean = tally->covered / fits;
    *out_error = sqrt(fmax(tally->covered_squares / fits - mean * mean, 0.0) / (fits - 1.0));
    return mean;
}
