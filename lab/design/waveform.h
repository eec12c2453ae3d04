/* SPDX-License-Identifier: MIT */
/// From phases to signals on a grid and back: the two transforms that every method lives on.
/// Signals are real, so two series share one complex FFT. With fold D every signal is D interleaved series, every D-th
/// point from point r on, each of grid / D points: transforms of that length are cheaper where most lines are empty,
/// and one signal alone can fill real and imaginary parts too.
/// A "packed" buffer is pair after pair of grid / D complex numbers: series i = r signal_count + s lies in pair i / 2,
/// in the real parts if i is even, in the imaginary ones if it is odd (zero if there is none). With fold 1, which is
/// what design_waveform_create() makes, the series are the signals.
#ifndef SERVOSCOPE_DESIGN_WAVEFORM_H
#define SERVOSCOPE_DESIGN_WAVEFORM_H

#include "lab/design/spectrum.h"

struct fft_plan;

struct design_waveform {
    size_t line_count;
    const uint32_t *bins;
    size_t grid;         ///< points per period, > 2 times the highest bin
    size_t fold;         ///< divides grid
    size_t length;       ///< grid / fold
    size_t signal_count; ///< 1 .. 3
    enum design_signal signals[design_signal_count];
    double *gain[design_signal_count]; ///< per signal: line_count amplitudes, > 0
    size_t pair_count;
    size_t packed_length; ///< doubles of a packed buffer
    struct fft_plan *plan;
    double *factor; ///< per series 2 line_count doubles: gain / 2, quarter turns of the order, turn to the first point
    uint32_t *up;   ///< line_count: 2 times the index of bin b in a transform
    uint32_t *down; ///< line_count: of bin -b
    double *spectrum; ///< 2 length doubles of scratch
};

/// Which signals a waveform carries.
enum design_waveform_kind {
    design_waveform_limited,      ///< amplitude over limit, of the signals that can reach their limit first
    design_waveform_acceleration, ///< acceleration alone, over its own rms
    design_waveform_physical,     ///< position, velocity, acceleration in their units, without c_A
};

/// A signal whose amplitudes add up to less than another's rms stays below that one's peak for any phases; it is left
/// out of design_waveform_limited. Returns false if memory is short (nothing is held then).
bool design_waveform_create(const struct design_spectrum *spectrum, enum design_waveform_kind kind, size_t grid,
                            struct design_waveform *out_waveform);
/// The same in `fold` interleaved series; fold must divide grid, 0: what is fastest.
bool design_waveform_create_folded(const struct design_spectrum *spectrum, enum design_waveform_kind kind, size_t grid,
                                   size_t fold, struct design_waveform *out_waveform);
void design_waveform_free(struct design_waveform *self);

/// u_s[n] = Re sum_k G_sk j^order(s) c_k exp(j 2 pi b_k n / grid), c: line_count complex numbers; out: packed.
void design_waveform_synthesise(const struct design_waveform *self, const double *c, double *out_packed);

/// The adjoint: y_k = sum_s conj(G_sk j^order(s)) sum_n x_s[n] exp(-j 2 pi b_k n / grid); out: line_count complex
/// numbers.
void design_waveform_gather(const struct design_waveform *self, const double *packed, double *out_y);

/// X_s[b] = sum_n x_s[n] exp(-j 2 pi b n / grid), b = 0 .. bin_count - 1, of each signal, one after the other.
/// Shapes: out: signal_count x bin_count complex numbers
void design_waveform_transform(const struct design_waveform *self, const double *packed, size_t bin_count,
                               double *out_transform);

/// Largest absolute value of one signal (index into signals[]) of a packed buffer.
double design_waveform_peak(const struct design_waveform *self, const double *packed, size_t signal);
/// Largest absolute value of all signals.
double design_waveform_peak_all(const struct design_waveform *self, const double *packed);

/// Least number 2^a 3^b 5^c that is not below `least`: a length the FFT is fast at.
size_t design_waveform_smooth_length(size_t least);

#endif
