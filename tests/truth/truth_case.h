/* SPDX-License-Identifier: MIT */
#ifndef TRUTH_CASE_H
#define TRUTH_CASE_H

#include "tests/truth/truth_kind.h"

enum truth_protocol { truth_protocol_any, truth_protocol_multisine, truth_protocol_stroke };

/// How plain the effects are: expected evidence of about 1e4, 1e3, 1e2 nats for each.
enum truth_size { truth_size_clear, truth_size_moderate, truth_size_faint, truth_size_count };

enum { TRUTH_CAUSES_MAX = 3 };

/// What is hidden, and how: enough to make the case again.
struct truth_wish {
    uint64_t seed;
    enum truth_size size;
    enum truth_protocol protocol;
    int causes; ///< 0: clean
    enum truth_kind kind[TRUTH_CAUSES_MAX];
};

/// A drive, a nominal model of it that lacks the hidden effects (and is off by a few percent besides), a run to fit and
/// a run to validate, and the answer.
struct truth_case {
    struct truth_wish wish;
    enum truth_protocol protocol;
    int periods;
    struct truth_hidden hidden[TRUTH_CAUSES_MAX];
    double evidence_nats[TRUTH_CAUSES_MAX]; ///< expected: truth over the model that lacks this effect, refitted
    double share[TRUTH_CAUSES_MAX];         ///< RMS of the torque that this effect makes, over the torque's
    double unlike;                          ///< share of an effect's evidence that the others cannot take up, the least
    int reached;                            ///< whether the size was, within a factor of 1.6
    struct truth_setting setting;
    struct truth_drive base;         ///< the drive before anything is hidden in it
    struct truth_drive truth;        ///< with all effects
    struct truth_random errors;      ///< by how much the given model's own numbers are off is drawn from here
    struct truth_plant_spec without; ///< what is believed: without them
    struct truth_plant_spec nominal; ///< what is given to the diagnosis: `without`, a few percent off
    struct truth_controller controller;
    double position_gain_per_s;
    struct truth_excitation fit, validation;
};

const char *truth_size_name(enum truth_size size);
enum truth_size truth_size_find(const char *name);
double truth_size_nats(enum truth_size size);

/// The kinds joined by "+", or "clean".
void truth_wish_name(const struct truth_wish *wish, char *out, int length);
/// Read what truth_wish_name writes. Returns 0, or -1.
int truth_wish_read(struct truth_wish *self, const char *name);

/// Draw a case: same wish, same case, bit for bit. Drawn again until each effect has the evidence that its size asks
/// for (at most 40 times; `reached` tells).
void truth_case_make(struct truth_case *self, const struct truth_wish *wish);
/// The drive of a case with the effects whose bit is in `known`; the others as they are believed to be.
struct truth_drive truth_case_drive(const struct truth_case *self, unsigned known);
/// Expected evidence, in the fit run, of the truth over another drive, the given model's numbers of which are refitted.
double truth_case_left_nats(const struct truth_case *self, const struct truth_drive *other);
/// Seed of the noise of the fit run; the validation run's is one more.
uint64_t truth_case_noise_seed(const struct truth_case *self);
/// Write run1.csv, run2.csv and nominal.json into `directory`, which is made if missing.
/// Returns 0, or -1 with a line on stderr.
int truth_case_write(const struct truth_case *self, const char *directory);
/// Write truth.json, the answer, into `directory`. Returns 0, or -1 with a line on stderr.
int truth_case_write_answer(const struct truth_case *self, const char *directory);

#endif
