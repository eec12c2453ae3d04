/* SPDX-License-Identifier: MIT */
#include "lab/page/page.h"
#include "lab/page/text.h"

#include <assert.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

static const char style[] =
    "*{box-sizing:border-box}\n"
    "html{background:var(--paper);color:var(--text);-webkit-text-size-adjust:100%}\n"
    "body{margin:0 auto;padding:34px 24px 40px;max-width:868px;font:15px/1.55 system-ui,-apple-system,\"Segoe UI\","
    "Roboto,\"Helvetica Neue\",Arial,sans-serif;overflow-wrap:anywhere}\n"
    "header{border-top:3px solid var(--text);border-bottom:1px solid var(--grid);padding:10px 0 "
    "14px;margin-bottom:22px}\n"
    ".mark{font-size:11px;letter-spacing:.16em;text-transform:uppercase;color:var(--dim);margin:0 0 10px}\n"
    "h1{font-size:25px;line-height:1.25;font-weight:600;letter-spacing:-.01em;margin:0;overflow-wrap:anywhere}\n"
    ".sub{margin:4px 0 0;color:var(--dim)}\n"
    "h2{font-size:18px;line-height:1.3;font-weight:600;margin:38px 0 10px;padding-bottom:5px;"
    "border-bottom:1px solid var(--grid)}\n"
    "h2 span{display:inline-block;min-width:1.6em;color:var(--dim);font-weight:400}\n"
    "h3{font-size:15px;font-weight:600;margin:24px 0 6px}\n"
    "p{margin:0 0 12px;max-width:46em}\n"
    "figure{margin:18px 0 24px;overflow-x:auto;overflow-y:hidden}\n"
    "figcaption,caption{font-size:13px;line-height:1.45;color:var(--dim);text-align:left}\n"
    "figcaption{margin-top:8px;max-width:58em}\n"
    "figcaption b,caption b{color:var(--text);font-weight:600}\n"
    "table{border-collapse:collapse;font-size:13.5px;line-height:1.4;font-variant-numeric:tabular-nums;"
    "min-width:50%}.tb{margin:16px 0 24px;overflow-x:auto}\n"
    "caption{padding-bottom:6px}\n"
    "th{font-weight:600;text-align:left;border-top:1.5px solid var(--frame);border-bottom:1px solid var(--frame)}\n"
    "th,td{padding:5px 18px 5px 0;vertical-align:baseline}th:last-child,td:last-child{padding-right:2px}\n"
    "td{border-bottom:1px solid var(--grid);overflow-wrap:anywhere}tbody tr:last-child "
    "td{border-bottom-color:var(--frame)}\n"
    "td:first-child{overflow-wrap:normal}.r{text-align:right;overflow-wrap:normal}td.none{color:var(--dim);text-align:"
    "center}\n"
    "dl{display:grid;grid-template-columns:minmax(9em,max-content) 1fr;font-size:13.5px;line-height:1.4;"
    "margin:14px 0 24px;border-top:1.5px solid var(--frame);font-variant-numeric:tabular-nums}\n"
    "dt,dd{margin:0;padding:5px 0;border-bottom:1px solid var(--grid);overflow-wrap:anywhere}"
    "dt{color:var(--dim);padding-right:24px}\n"
    "ul{margin:10px 0 18px;padding:0;list-style:none;max-width:52em}"
    "li{padding:7px 0 7px 16px;border-left:2px solid var(--grid);margin-bottom:6px}\n"
    ".none{color:var(--dim)}\n"
    ".note{display:flex;gap:14px;margin:18px 0 22px;padding:13px 18px 13px 14px;border:1px solid var(--grid);"
    "border-left:4px solid currentColor;break-inside:avoid}\n"
    ".note svg{flex:none;margin-top:2px}.note div{color:var(--text)}.note b{display:block;font-size:16px}"
    ".note p{margin:2px 0 0}\n"
    ".row{display:flex;flex-wrap:wrap;gap:0 24px;align-items:flex-start}.row>*{flex:0 1 398px;min-width:0}\n"
    "footer{margin-top:44px;padding-top:10px;border-top:1px solid var(--grid);font-size:12px;color:var(--dim);"
    "overflow-wrap:anywhere}\n"
    "@media screen and (max-width:700px){figure>.fig{max-width:none}th,td{overflow-wrap:break-word}}\n"
    "@page{size:A4;margin:15mm 15mm 17mm}\n"
    "@media print{body{padding:0;max-width:none;font-size:10.5pt}h1{font-size:18pt}h2{font-size:13pt}"
    "h2,h3{break-after:avoid}figure,tr,li,dl{break-inside:avoid}p{orphans:3;widows:3}figure,.tb{overflow:visible}"
    "thead{display:table-header-group}footer{margin-top:8mm;break-before:avoid}.row{flex-wrap:nowrap}}\n";

/* Sentences that the terminal shows too are plain ASCII; a page has the sign. */
static void write_sentence(FILE *out, const char *text)
{
    static const char plain[] = " +- ";
    for (const char *at = strstr(text, plain); at != NULL; at = strstr(text, plain)) {
        text_write_span(out, (struct text_span){text, (size_t)(at - text)});
        fputs(" \xC2\xB1 ", out);
        text = at + strlen(plain);
    }
    text_write(out, text);
}

#if defined(__GNUC__)
__attribute__((format(printf, 2, 0)))
#endif
static void
write_formatted(FILE *out, const char *format, va_list arguments)
{
    va_list again;
    va_copy(again, arguments);
    char line[512];
    int length = vsnprintf(line, sizeof line, format, arguments);
    char *text = length >= (int)sizeof line ? malloc((size_t)length + 1) : NULL;
    if (text != NULL) {
        vsnprintf(text, (size_t)length + 1, format, again);
    }
    va_end(again);
    if (length >= 0) {
        write_sentence(out, text != NULL ? text : line);
    }
    free(text);
}

static void write_element(FILE *out, const char *tag, const char *text)
{
    fprintf(out, "<%s>", tag);
    text_write(out, text);
    fprintf(out, "</%s>\n", tag);
}

void page_start(struct page *self, FILE *out, const char *title, const char *subtitle)
{
    memset(self, 0, sizeof *self);
    self->out = out;
    fputs("<!DOCTYPE html>\n<html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\">\n<head>\n<meta "
          "charset=\"utf-8\"/>\n"
          "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n",
          out);
    write_element(out, "title", title);
    fputs("<style>\n", out);
    figure_write_style(out);
    fputs(style, out);
    fputs("</style>\n</head>\n<body>\n<header>\n<p class=\"mark\">servoscope</p>\n", out);
    write_element(out, "h1", title);
    if (subtitle != NULL) {
        fputs("<p class=\"sub\">", out);
        text_write(out, subtitle);
        fputs("</p>\n", out);
    }
    fputs("</header>\n<main>\n", out);
}

void page_add_section(struct page *self, const char *heading)
{
    self->sections++;
    fprintf(self->out, "<h2><span>%u</span> ", self->sections);
    text_write(self->out, heading);
    fputs("</h2>\n", self->out);
}

void page_add_subsection(struct page *self, const char *heading)
{
    write_element(self->out, "h3", heading);
}

void page_add_paragraph(struct page *self, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fputs("<p>", self->out);
    write_formatted(self->out, format, arguments);
    fputs("</p>\n", self->out);
    va_end(arguments);
}

void page_add_note(struct page *self, enum page_mood mood, const char *headline, const char *format, ...)
{
    static const struct {
        const char *colour;
        const char *sign;
    } look[] = {
        [page_plain] = {"c1", "M11 10v6M11 6v.1"},
        [page_good] = {"c3", "M6.5 11.5l3 3 6-7"},
        [page_warning] = {"c5", "M11 6v6M11 15.9v.1"},
        [page_bad] = {"c2", "M7.5 7.5l7 7m0-7l-7 7"},
    };
    va_list arguments;
    va_start(arguments, format);
    fprintf(self->out,
            "<div class=\"note %s\"><svg width=\"22\" height=\"22\" viewBox=\"0 0 22 22\" aria-hidden=\"true\" "
            "fill=\"none\" stroke=\"currentColor\" stroke-width=\"1.8\" stroke-linecap=\"round\">"
            "<circle cx=\"11\" cy=\"11\" r=\"9.5\"/><path d=\"%s\"/></svg><div><b>",
            look[mood].colour, look[mood].sign);
    text_write(self->out, headline);
    fputs("</b>", self->out);
    if (format != NULL) {
        fputs("<p>", self->out);
        write_formatted(self->out, format, arguments);
        fputs("</p>", self->out);
    }
    fputs("</div></div>\n", self->out);
    va_end(arguments);
}

void page_start_list(struct page *self)
{
    self->rows = 0;
    fputs("<ul>\n", self->out);
}

void page_add_item(struct page *self, const char *lead, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    self->rows++;
    fputs("<li><b>", self->out);
    text_write(self->out, lead);
    fputs("</b> ", self->out);
    write_formatted(self->out, format, arguments);
    fputs("</li>\n", self->out);
    va_end(arguments);
}

void page_end_list(struct page *self)
{
    fputs(self->rows == 0 ? "<li class=\"none\">none</li></ul>\n" : "</ul>\n", self->out);
}

void page_start_pairs(struct page *self)
{
    self->rows = 0;
    fputs("<dl>\n", self->out);
}

void page_add_pair(struct page *self, const char *name, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    self->rows++;
    fputs("<dt>", self->out);
    text_write(self->out, name);
    fputs("</dt><dd>", self->out);
    write_formatted(self->out, format, arguments);
    fputs("</dd>\n", self->out);
    va_end(arguments);
}

void page_end_pairs(struct page *self)
{
    fputs(self->rows == 0 ? "<dt>no data</dt><dd></dd></dl>\n" : "</dl>\n", self->out);
}

void page_start_table(struct page *self, const char *caption, const char *align, const char *const *heads)
{
    self->columns = strlen(align);
    assert(self->columns >= 1 && self->columns < sizeof self->align);
    text_copy(align, sizeof self->align, self->align);
    self->rows = 0;
    self->tables++;
    fprintf(self->out, "<div class=\"tb\"><table><caption><b>Table %u</b> ", self->tables);
    text_write(self->out, caption);
    fputs("</caption>\n<thead><tr>", self->out);
    for (size_t c = 0; c < self->columns; c++) {
        fputs(self->align[c] == 'r' ? "<th class=\"r\">" : "<th>", self->out);
        text_write(self->out, heads[c]);
        fputs("</th>", self->out);
    }
    fputs("</tr></thead>\n<tbody>\n", self->out);
}

void page_add_row(struct page *self, const char *const *cells)
{
    self->rows++;
    fputs("<tr>", self->out);
    for (size_t c = 0; c < self->columns; c++) {
        fputs(self->align[c] == 'r' ? "<td class=\"r\">" : "<td>", self->out);
        text_write(self->out, cells[c] != NULL ? cells[c] : "\xE2\x80\x93");
        fputs("</td>", self->out);
    }
    fputs("</tr>\n", self->out);
}

void page_end_table(struct page *self)
{
    if (self->rows == 0) {
        fprintf(self->out, "<tr><td class=\"none\" colspan=\"%zu\">no data</td></tr>\n", self->columns);
    }
    fputs("</tbody></table></div>\n", self->out);
}

void page_start_row(struct page *self)
{
    fputs("<div class=\"row\">\n", self->out);
}

void page_end_row(struct page *self)
{
    fputs("</div>\n", self->out);
}

void page_add_figure(struct page *self, const struct figure *figure, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    self->figures++;
    fputs("<figure>\n", self->out);
    figure_write(figure, self->out);
    fprintf(self->out, "<figcaption><b>Figure %u</b> ", self->figures);
    write_formatted(self->out, format, arguments);
    fputs("</figcaption>\n</figure>\n", self->out);
    va_end(arguments);
}

int page_end(struct page *self, const char *footer)
{
    fputs("</main>\n", self->out);
    if (footer != NULL) {
        write_element(self->out, "footer", footer);
    }
    if (self->figures > 0) {
        fputs("<script>\n", self->out);
        figure_write_script(self->out);
        fputs("</script>\n", self->out);
    }
    fputs("</body>\n</html>\n", self->out);
    return fflush(self->out) != 0 || ferror(self->out) ? -1 : 0;
}
