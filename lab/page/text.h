/* SPDX-License-Identifier: MIT */
/// Text on a page: escaping for HTML and SVG, and how much room a line of it takes.
/// Input is what people put into file names, keys and labels: any bytes. Output is well-formed UTF-8 without control
/// characters; a byte that is not UTF-8 becomes U+FFFD, so that no file name can break a report.
#ifndef SERVOSCOPE_PAGE_TEXT_H
#define SERVOSCOPE_PAGE_TEXT_H

#include <stddef.h>
#include <stdio.h>

/// A part of a string that somebody else owns.
struct text_span {
    const char *start;
    size_t length; ///< bytes
};

/// Writes a string with & < > " ' escaped, valid in element content and in quoted attributes; NULL writes nothing.
/// Test:      tests/unit/test_page.c
void text_write(FILE *out, const char *text);

/// Writes a part of a string, escaped as by text_write().
void text_write_span(FILE *out, struct text_span span);

/// Estimates the width of one line of text, never less than a browser will need with a common sans-serif font.
/// Units:     em (multiples of the font size)
/// The widths are those of DejaVu Sans, the widest of the usual system fonts; others leave some air.
double text_measure_em(struct text_span span);

/// Breaks a text at spaces into at most `max` lines of at most `width_em`; what does not fit is cut at a character.
/// Shapes:    out_lines: max spans into `text`
/// Returns the number of lines, 0 for an empty text; *out_cut (may be NULL) is 1 if text was left out, for an ellipsis.
size_t text_wrap(const char *text, double width_em, size_t max, struct text_span *out_lines, int *out_cut);

/// Copies a string into a fixed buffer; one that is too long is cut between characters, never inside one.
/// Range:     size >= 1; NULL copies as ""
void text_copy(const char *text, size_t size, char *out);

/// Copies a text of any length; one that is too long keeps its beginning and its end, with three dots in between.
void text_shorten(const char *text, size_t size, char *out);

#endif
