/* report.html: one page that needs nothing else. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "report/report_page.h"
#include "cli/words.h"

void page_section(FILE *out, const char *id, const char *title, const char *text)
{
    fprintf(out, "<section id=\"%s\"><h2>%s</h2>\n<p>%s</p>\n", id, title, text);
}

void page_legend(FILE *out, const comparison *c)
{
    if (c->count < 2)
        return;
    fputs("<ul class=\"legend\">", out);
    for (int i = 0; i < c->count; i++) {
        fputs("<li><svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 14 14\">", out);
        plot_marker(out, i, 7, 7, 5);
        fputs("</path></svg>", out);
        html_text(out, c->methods[i].name);
        fputs("</li>", out);
    }
    fputs("</ul>\n", out);
}

/* --- the head: what it is about --- */

static void fact(FILE *out, const char *name, const char *text, const char *more)
{
    fprintf(out, "<div%s><dt>%s</dt><dd>", strlen(text) > 24 ? " class=\"wide\"" : "", name);
    html_text(out, text);
    if (more && more[0]) {
        fputs(" <small>", out);
        html_text(out, more);
        fputs("</small>", out);
    }
    fputs("</dd></div>\n", out);
}

static void grouped(char *out, size_t room, uint64_t v)
{
    char digits[32];
    int length = snprintf(digits, sizeof digits, "%" PRIu64, v);
    size_t at = 0;
    for (int i = 0; i < length && at + 2 < room; i++) {
        if (i && (length - i) % 3 == 0)
            out[at++] = ',';
        out[at++] = digits[i];
    }
    out[at] = 0;
}

static const char *real(char *out, size_t room, double v)
{
    snprintf(out, room, "%.4g", v);
    return out;
}

static void facts(FILE *out, const comparison *c)
{
    const ebpo_info *info = &c->methods->info;
    const ebpo_mesh_report *r = &info->report;
    char text[256], more[256];
    fputs("<dl>\n", out);
    grouped(text, sizeof text, info->face_count);
    fact(out, "faces", text, NULL);
    grouped(text, sizeof text, info->vertex_count);
    fact(out, "vertices", text, info->double_coordinates ? "double" : "float");
    fact(out, "kind", info->solid ? "solid" : "surface",
         info->solid ? words_rule(info->rule) : "no inside");
    if (info->solid)
        fact(out, "volume", real(text, sizeof text, r->volume), info->unit[0] ? info->unit : NULL);
    fact(out, "area", real(text, sizeof text, r->area), NULL);
    snprintf(text, sizeof text, "%.4g × %.4g × %.4g", r->max[0] - r->min[0], r->max[1] - r->min[1],
             r->max[2] - r->min[2]);
    snprintf(more, sizeof more, "diagonal %.4g", c->diagonal);
    fact(out, "size", text, more);
    if (info->source_name[0])
        fact(out, "source", info->source_name, words_bytes(more, sizeof more, info->source_size));
    snprintf(text, sizeof text, "%d to %d", c->first, comparison_last(c));
    fact(out, "levels", text, NULL);
    grouped(text, sizeof text, c->points);
    snprintf(more, sizeof more, "seed %" PRId64, c->v->seed);
    fact(out, "points asked", text, more);
    snprintf(more, sizeof more, "%u core%s", machine_cores(), machine_cores() == 1 ? "" : "s");
    fact(out, "machine", machine_processor()[0] ? machine_processor() : "unknown", more);
    fputs("</dl>\n", out);
}

static void head(FILE *out, const comparison *c)
{
    fprintf(out,
            "<header%s><div>\n<p class=\"over\">Envelopes level by level: bytes, error, run "
            "time</p>\n<h1>",
            c->portrait ? "" : " class=\"bare\"");
    html_text(out, c->model);
    fputs("</h1>\n", out);
    facts(out, c);
    fputs("</div>\n", out);
    if (c->portrait) {
        fprintf(out, "<img src=\"%s\" alt=\"The model ", c->portrait);
        html_text(out, c->model);
        fputs("\"/>\n", out);
    }
    fputs("</header>\n", out);
}

/* --- pictures --- */

static int pictured(const comparison *c, int last)
{
    int most = -1;
    for (int i = 0; i < c->count; i++)
        for (int k = c->first; k <= last; k++)
            if (c->methods[i].picture[k] && k > most)
                most = k;
    return most;
}

static void tile(FILE *out, const method *m, int level)
{
    char bytes[40], percent[40] = "";
    const double *f = m->level[level];
    fputs("<figure>", out);
    if (m->picture[level]) {
        fprintf(out, "<img src=\"%s\" alt=\"", m->picture[level]);
        html_text(out, m->name);
        fprintf(out, ", level %d\"/>", level);
    }
    if (isfinite(f[OF_EXCESS]))
        plot_value(percent, sizeof percent, PLOT_PERCENT, f[OF_EXCESS]);
    if (isfinite(f[OF_CUMULATIVE_BYTES]))
        fprintf(out, "<figcaption>%s%s%s%s</figcaption>", percent[0] ? "<b>+" : "", percent,
                percent[0] ? "</b> · " : "",
                plot_value(bytes, sizeof bytes, PLOT_BYTES, f[OF_CUMULATIVE_BYTES]));
    fputs("</figure>\n", out);
}

/* Levels first to last, a row for each method. */
static void strip(FILE *out, const comparison *c, int first, int last, int columns)
{
    fprintf(out, "<div class=\"strip\" style=\"--n:%d\"><span></span>", columns);
    for (int k = first; k <= last; k++)
        fprintf(out, "<div class=\"head\">level %d</div>", k);
    fputc('\n', out);
    for (int i = 0; i < c->count; i++) {
        fprintf(out, "<div class=\"who\" style=\"color:var(--m%d)\">", i % 8);
        html_text(out, c->methods[i].name);
        fputs("</div>", out);
        for (int k = first; k <= last; k++)
            tile(out, &c->methods[i], k);
    }
    fputs("</div>\n", out);
}

static void pictures(FILE *out, const comparison *c)
{
    enum { ROW = 6 };
    int last = pictured(c, comparison_last(c));
    if (last < 0)
        return;
    page_section(out, "pictures", "The levels",
                 "Excess of volume, and bytes of the file up to the level’s end.");
    for (int k = c->first; k <= last; k += ROW)
        strip(out, c, k, last < k + ROW ? last : k + ROW - 1,
              last - c->first < ROW ? last - c->first + 1 : ROW);
    fputs("</section>\n", out);
}

/* --- the end --- */

static void meanings(FILE *out, const figure_name *q, int count)
{
    for (int i = 0; i < count; i++) {
        fprintf(out, "<dt>%s, %s</dt><dd>", q[i].name, q[i].unit);
        html_text(out, q[i].meaning);
        fputs("</dd>\n", out);
    }
}

static void notes(FILE *out, const comparison *c)
{
    int count = c->without_pictures != NULL;
    for (int i = 0; i < c->count; i++)
        count += c->methods[i].note_count;
    fputs("<section id=\"notes\"><h2>What the figures mean</h2>\n", out);
    if (count) {
        fputs("<p>A dash stands for what could not be had:</p><ul class=\"notes\">\n", out);
        if (c->without_pictures)
            fprintf(out, "<li>no pictures: %s</li>\n", c->without_pictures);
        for (int i = 0; i < c->count; i++)
            for (int k = 0; k < c->methods[i].note_count; k++) {
                fputs("<li>", out);
                html_text(out, c->methods[i].name);
                fputs(": ", out);
                html_text(out, c->methods[i].note[k]);
                fputs("</li>\n", out);
            }
        fputs("</ul>\n", out);
    }
    fputs(
        "<details><summary>All quantities, as report.csv and report.json name them</summary><dl>\n",
        out);
    meanings(out, whole_figures, WHOLE_FIGURES);
    meanings(out, level_figures, LEVEL_FIGURES);
    meanings(out, deadline_figures, DEADLINE_FIGURES);
    meanings(out, need_figures, NEED_FIGURES);
    fputs("</dl></details></section>\n", out);
}

void report_page(FILE *out, const comparison *c)
{
    fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><meta "
          "name=\"viewport\" content=\"width=device-width,initial-scale=1\"/><title>",
          out);
    html_text(out, c->model);
    fprintf(out, ": bytes, error, run time</title>\n<style>\n%s</style></head>\n<body><main>\n",
            report_style);
    head(out, c);
    pictures(out, c);
    page_glance(out, c);
    page_plots_by_level(out, c);
    page_plots_by_bytes(out, c);
    page_plots_by_time(out, c);
    page_deadlines(out, c);
    page_needs(out, c);
    page_transmission(out, c);
    page_tables(out, c);
    notes(out, c);
    fprintf(out,
            "<footer>Made by <code>ebpo report</code>, version %s, in %.0f "
            "s.</footer>\n</main></body></html>\n",
            ebpo_version(), c->seconds);
}
