/* SPDX-License-Identifier: MIT */
/// The plant of a loop as it was measured: the valid lines of a frequency response at the controller's sample rate.
#ifndef SERVOSCOPE_TUNE_PLANT_H
#define SERVOSCOPE_TUNE_PLANT_H

#include "lab/record/frf_file.h"

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

enum { tune_unit_size = 32, tune_doubt_size = 200 };

/// What the controller is fed back with; decides units and which phase is believed at the lowest line.
enum tune_output { tune_output_velocity, tune_output_position };

struct tune_plant {
    size_t count;
    double rate_hz;           ///< of the controller
    double response_rate_hz;  ///< that the response was measured at; 0: the file does not say
    bool band_limited;        ///< the file's response has no hold
    bool carried;             ///< the file's response has another hold than the controller: lab/tune/hold.h
    double *frequency_hz;     ///< ascending, above 0, below half the rate
    double complex *response; ///< behind the controller's hold, with the loop's delay that the file does not contain
    double *std;              ///< of the complex value; 0 where the file does not say
    double *doubt;            ///< what else the complex value may be off by, at most; `doubt_from` says why
    double complex *delay;    ///< exp(-j w Ts), one sample of delay
    bool std_known;           ///< on any line
    size_t std_unknown;       ///< lines without one
    double confidence_factor; ///< 95 % of errors lie within this many std
    size_t skipped;           ///< lines not valid, at 0 Hz or from half the rate on
    double *left_out_hz;      ///< those of them that are not valid below half the rate, ascending
    size_t left_out;
    char doubt_from[tune_doubt_size]; ///< "" where there is no doubt
    double loop_delay_s;              ///< known delay in `response`: the caller's and what was put back
    double delay_removed_s;           ///< what was put back
    enum tune_output output;
    const char *effort_unit; ///< of the controller's output: Nm, N, A, V
    const char *length_unit; ///< rad or m
};

/// Takes the valid lines of a response. The rate is `rate_hz`, or if that is 0 the key sample_rate_hz of the file; a
/// response that was measured with another hold than the controller's is carried over (lab/tune/hold.h). `loop_delay_s`
/// is delay of the loop that is not in the response (a bus, a computing sample); what `frf --delay` took out (key
/// delay_removed_s) is put back, because the loop has it. What the file's own warnings put a figure to
/// (other_inputs_db, repetition_level) becomes doubt.
/// Errors: error_usage without a rate; error_refused if input and output are not torque, force, current or voltage to
///         velocity or position, a key is no number, a frequency is above half the recording's rate, or fewer than 8
///         lines can be used. *out_plant is empty then. `path` begins messages.
/// Test:   tests/unit/test_tune_plant.c
int tune_plant_take(const char *path, const struct frf *frf, double rate_hz, double loop_delay_s,
                    struct tune_plant *out_plant, struct error *out_error);

/// Returns by how far the known delay turns the response from one frequency to another, in radians, below 0 for a lag:
/// exact, where neighbouring lines show it but for full turns.
/// Equation:  -2 pi (to - from) loop_delay_s
double tune_plant_known_turn(const struct tune_plant *self, double from_hz, double to_hz);

/// Frees what tune_plant_take() gave; harmless on a zeroed struct.
void tune_plant_free(struct tune_plant *self);

/// Writes which lines between two frequencies were left out as not valid: "3 lines at 49..51 Hz", up to four stretches
/// without a valid line in between; "" if there is none.
void tune_plant_name_left_out(const struct tune_plant *self, double above_hz, double below_hz, size_t size,
                              char *out_text);

/// Writes the unit of a gain that has s to the power `power` in it beside effort over velocity (-1: integral, 0:
/// proportional, 1: derivative): for file names of values "Nms_per_rad", for people "Nm s/rad".
void tune_plant_gain_unit(const struct tune_plant *self, int power, char out_suffix[tune_unit_size],
                          char out_readable[tune_unit_size]);

#endif
