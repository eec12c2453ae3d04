/* SPDX-License-Identifier: MIT */
/// Memory for arrays of many megabytes.
#ifndef SERVOSCOPE_NUMERIC_LARGE_H
#define SERVOSCOPE_NUMERIC_LARGE_H

#include <stddef.h>

/// Like malloc, but asks for huge pages where the system has them and the array is large enough for some: spectra that
/// are passed over line by line touch a page for every period, and looking the pages up takes a tenth of the time.
/// Free it with free(). NULL if memory is short.
void *large_allocate(size_t size);

#endif
