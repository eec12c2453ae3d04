/* SPDX-License-Identifier: MIT */
/// The functions that low lines share within a block; not for applications.
#ifndef SERVOSCOPE_FRF_BLOCK_BASIS_H
#define SERVOSCOPE_FRF_BLOCK_BASIS_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Half of the discrete prolate spheroidal sequence of 2 `half` samples and bandwidth `width` (cycles per sample), even
/// or odd about the centre (sign +1, -1), number `order` of its kind from the best concentrated one; of unit RMS,
/// outwards from the centre. These span the sinusoids below `width` with the fewest functions
/// [Slepian, Prolate spheroidal wave functions V, 1978].
/// Range: 2 <= half <= FRF_BLOCK_SAMPLES_MAX / 2, order < half
void frf_basis_function(uint32_t half, double width, int sign, uint32_t order, double *out_function);

#ifdef __cplusplus
}
#endif

#endif
