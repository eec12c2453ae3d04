/* SPDX-License-Identifier: MIT */
/// How the linear algebra library behaves.
#ifndef SERVOSCOPE_NUMERIC_BLAS_H
#define SERVOSCOPE_NUMERIC_BLAS_H

/// Keeps linear algebra on the calling thread: for searches that have threads of their own, for systems so small that
/// threads only get in each other's way, and so that sums come out the same on every machine. Call it before threads
/// are started. Without OpenBLAS it does nothing.
void blas_use_one_thread(void);

#endif
