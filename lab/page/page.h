/* SPDX-License-Identifier: MIT */
/// One self-contained HTML page: headings, sentences, tables, notes and figures, in the order they are added.
///
///     struct page page;
///     page_start(&page, out, "Diagnosis of run.csv", "Two-mass belt drive, 11 periods of 2 s at 1 kHz");
///     page_add_note(&page, page_good, "Explained", "The model misses %s.", cause);
///     page_add_section(&page, "Frequency response");
///     page_add_figure(&page, &figure, "Motor torque to motor speed.");
///     int failed = page_end(&page, "servoscope 0.1.0");
///
/// - Every text is escaped; no argument is taken as HTML. The page is UTF-8, well-formed as XML too, loads nothing, and
///   reads the same without its script.
/// - The writer holds no memory. Write errors are kept by the FILE and reported once, by page_end().
/// - No function here may be called between the start and the end of a table, list or row other than those for it;
///   a row may hold figures, tables and paragraphs.
#ifndef SERVOSCOPE_PAGE_PAGE_H
#define SERVOSCOPE_PAGE_PAGE_H

#include "lab/page/figure.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#if defined(__GNUC__)
#define PAGE_FORMAT(format_index) __attribute__((format(printf, format_index, format_index + 1)))
#else
#define PAGE_FORMAT(format_index)
#endif

/// The sign and colour of a note; the sign (tick, exclamation mark, cross, i) says the same as the colour.
enum page_mood { page_plain, page_good, page_warning, page_bad };

struct page {
    FILE *out;
    unsigned sections, figures, tables; ///< numbers given so far
    size_t columns;                     ///< of the table being written
    size_t rows;
    char align[16]; ///< 'l' or 'r' for each column
};

/// Writes head, style sheet and title block; `subtitle` may be NULL.
void page_start(struct page *self, FILE *out, const char *title, const char *subtitle);

/// Adds a numbered heading.
void page_add_section(struct page *self, const char *heading);

/// Adds a heading below a section, without number.
void page_add_subsection(struct page *self, const char *heading);

/// Adds a paragraph.
PAGE_FORMAT(2) void page_add_paragraph(struct page *self, const char *format, ...);

/// Adds a box with a sign, a bold headline and a sentence; for the verdict and for what the reader must not miss.
/// `format` may be NULL, for a headline alone.
PAGE_FORMAT(4)
void page_add_note(struct page *self, enum page_mood mood, const char *headline, const char *format, ...);

/// Starts a list of sentences, each with a bold lead (a cause's name); an empty list says "none".
void page_start_list(struct page *self);
PAGE_FORMAT(3) void page_add_item(struct page *self, const char *lead, const char *format, ...);
void page_end_list(struct page *self);

/// Starts a block of names and values in two columns, for what was measured with what settings.
void page_start_pairs(struct page *self);
PAGE_FORMAT(3) void page_add_pair(struct page *self, const char *name, const char *format, ...);
void page_end_pairs(struct page *self);

/// Starts a numbered table. `align` has a letter per column: 'l' for text, 'r' for numbers; heads has as many strings.
/// Range:     1 to 15 columns (asserted). A table without rows says "no data".
void page_start_table(struct page *self, const char *caption, const char *align, const char *const *heads);

/// Adds a row with one cell per column; a NULL cell is shown as a dash.
void page_add_row(struct page *self, const char *const *cells);
void page_end_table(struct page *self);

/// Puts what is added until page_end_row() side by side where the window is wide enough: two figures of
/// figure_width_half.
void page_start_row(struct page *self);
void page_end_row(struct page *self);

/// Adds a figure with its numbered caption.
PAGE_FORMAT(3) void page_add_figure(struct page *self, const struct figure *figure, const char *format, ...);

/// Ends the page; `footer` (may be NULL) says what made it. Returns 0, or -1 if anything could not be written.
int page_end(struct page *self, const char *footer);

#endif
