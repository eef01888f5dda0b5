/* The tables of the page. */
#include "report/report_page.h"

#include <string.h>

bool any_level_figure(const comparison *c, level_figure which)
{
    for (int i = 0; i < c->count; i++)
        for (int k = c->first; k <= method_last(c, &c->methods[i]); k++)
            if (!isnan(c->methods[i].level[k][which]))
                return true;
    return false;
}

/* --- cells --- */

static void cell_text(FILE *out, const char *class, const char *text)
{
    if (class)
        fprintf(out, "<td class=\"%s\">%s</td>", class, text);
    else
        fprintf(out, "<td>%s</td>", text);
}

static void cell_marked(FILE *out, const char *class, plot_unit unit, double v)
{
    char text[40];
    if (isnan(v))
        cell_text(out, class && strncmp(class, "first", 5) == 0 ? "first none" : "none", "–");
    else if (isinf(v))
        cell_text(out, class, "∞");
    else
        cell_text(out, class, plot_value(text, sizeof text, unit, v));
}

void cell(FILE *out, plot_unit unit, double v) { cell_marked(out, NULL, unit, v); }

void cell_first(FILE *out, plot_unit unit, double v)
{
    cell_marked(out, isnan(v) ? "first none" : "first", unit, v);
}

void cell_count(FILE *out, double v)
{
    char digits[32], text[48];
    int length = snprintf(digits, sizeof digits, "%.0f", v), at = 0;
    if (!isfinite(v)) {
        cell_text(out, "none", "–");
        return;
    }
    for (int i = 0; i < length; i++) {
        if (i && (length - i) % 3 == 0)
            text[at++] = ',';
        text[at++] = digits[i];
    }
    text[at] = 0;
    cell_text(out, NULL, text);
}

/* --- methods side by side --- */

void page_groups(FILE *out, const comparison *c, int columns, const char *group, const char *before,
                 const char *each)
{
    fprintf(out, "<div class=\"scroll\"><table><thead><tr class=\"groups\"><th></th>%s", group);
    for (int i = 0; i < c->count; i++) {
        fprintf(out, "<th colspan=\"%d\">", columns);
        html_text(out, c->methods[i].name);
        fputs("</th>", out);
    }
    fprintf(out, "</tr><tr>%s", before);
    for (int i = 0; i < c->count; i++)
        fputs(each, out);
    fputs("</tr></thead><tbody>\n", out);
}

/* Bytes of the first level that is good enough. */
static double bytes_until(const comparison *c, const method *m, double goal)
{
    for (int k = c->first; k <= method_last(c, m); k++)
        if (m->level[k][OF_LEVELS_EXCESS] <= goal)
            return m->level[k][OF_CUMULATIVE_BYTES];
    return NAN;
}

void page_glance(FILE *out, const comparison *c)
{
    static const double goals[] = { 10, 3, 1 };
    page_section(out, "glance", "At a glance",
                 "Bytes until the levels alone exceed the solid’s volume by no more than 10, 3 and "
                 "1 percent; the build; exact questions.");
    fputs("<div "
          "class=\"scroll\"><table><thead><tr><th>method</th><th>file</th><th>levels</"
          "th><th>planes</th><th>≤ 10 %</th><th>≤ 3 %</th><th>≤ 1 %</th><th>build</th>"
          "<th>into memory</th><th>memory</th><th>point in "
          "solid,<br/>exact</th><th>distance,<br/>exact</th></tr></thead><tbody>\n",
          out);
    for (int i = 0; i < c->count; i++) {
        const method *m = &c->methods[i];
        fputs("<tr><th>", out);
        html_text(out, m->name);
        fputs("</th>", out);
        cell(out, PLOT_BYTES, m->whole[OF_FILE_BYTES]);
        cell(out, PLOT_LEVEL, m->levels);
        cell_count(out, m->whole[OF_ALL_PLANES]);
        for (int k = 0; k < 3; k++)
            cell(out, PLOT_BYTES, bytes_until(c, m, goals[k]));
        cell(out, PLOT_SECONDS, m->whole[OF_BUILD_SECONDS]);
        cell(out, PLOT_SECONDS, m->whole[OF_OPEN_SECONDS]);
        cell(out, PLOT_BYTES, m->whole[OF_MEMORY_BYTES]);
        cell(out, PLOT_SECONDS, 1e-9 * m->whole[OF_EXACT_INSIDE_NS]);
        cell(out, PLOT_SECONDS, 1e-9 * m->whole[OF_EXACT_DISTANCE_NS]);
        fputs("</tr>\n", out);
    }
    fputs("</tbody></table></div></section>\n", out);
}

static void limit_row(FILE *out, const comparison *c, int level)
{
    double best[2] = { INFINITY, INFINITY }, limit = NAN;
    for (int i = 0; i < c->count; i++) {
        const double *f = c->methods[i].level[level];
        best[0] = f[OF_EXCESS] < best[0] ? f[OF_EXCESS] : best[0];
        best[1] = f[OF_CUMULATIVE_BYTES] < best[1] ? f[OF_CUMULATIVE_BYTES] : best[1];
        limit = isnan(limit) || f[OF_LIMIT_EXCESS] < limit ? f[OF_LIMIT_EXCESS] : limit;
    }
    fprintf(out, "<tr><th>%d</th>", level);
    cell(out, PLOT_NUMBER, limit);
    for (int i = 0; i < c->count; i++) {
        const double *f = c->methods[i].level[level];
        cell_marked(out, f[OF_EXCESS] <= best[0] && c->count > 1 ? "first best" : "first",
                    PLOT_NUMBER, f[OF_EXCESS]);
        cell(out, PLOT_NUMBER, f[OF_EXCESS_TO_LIMIT]);
        cell_marked(out, f[OF_CUMULATIVE_BYTES] <= best[1] && c->count > 1 ? "best" : NULL,
                    PLOT_BYTES, f[OF_CUMULATIVE_BYTES]);
    }
    fputs("</tr>\n", out);
}

void page_against_limit(FILE *out, const comparison *c)
{
    if (!any_level_figure(c, OF_EXCESS))
        return;
    fputs("<h3>Excess of volume in percent of the solid’s, times the limit’s, and bytes so "
          "far</h3>\n",
          out);
    page_groups(out, c, 3, "<th>limit</th>", "<th>level</th><th class=\"first\">%</th>",
                "<th class=\"first\">%</th><th>× limit</th><th>bytes</th>");
    for (int k = c->first; k <= comparison_last(c); k++)
        limit_row(out, c, k);
    fputs("</tbody></table></div>\n", out);
}

/* --- needs --- */

static const need_result *need_of(const method *m, const need_result *wanted)
{
    for (int i = 0; i < m->need_count; i++)
        if (m->need[i].kind == wanted->kind && fabs(m->need[i].asked - wanted->asked) <= 0)
            return &m->need[i];
    return NULL;
}

static void need_row(FILE *out, const comparison *c, const need_result *wanted)
{
    static const double nothing[NEED_FIGURES] = { NAN, NAN, NAN, NAN, NAN };
    char text[48];
    if (wanted->kind == NEED_ERROR)
        fprintf(out, "<tr><th>error ≤ %s</th>",
                plot_value(text, sizeof text, PLOT_PERCENT, report_of_diagonal(c, wanted->asked)));
    else
        fprintf(out, "<tr><th>size ≤ %s</th>",
                plot_value(text, sizeof text, PLOT_BYTES, wanted->asked));
    for (int i = 0; i < c->count; i++) {
        const need_result *n = need_of(&c->methods[i], wanted);
        const double *f = n ? n->figure : nothing;
        cell_first(out, PLOT_BYTES, f[OF_NEED_BYTES]);
        cell(out, PLOT_NUMBER, report_of_diagonal(c, f[OF_NEED_FAR_LO]));
        cell(out, PLOT_NUMBER, report_of_diagonal(c, f[OF_NEED_FAR_HI]));
        cell(out, PLOT_NUMBER, f[OF_NEED_RATIO]);
    }
    fputs("</tr>\n", out);
}

/* Rows are needs; each method's results of them. */
void page_needs(FILE *out, const comparison *c)
{
    const method *most = c->methods;
    for (int i = 0; i < c->count; i++)
        most = c->methods[i].need_count > most->need_count ? &c->methods[i] : most;
    if (!most->need_count)
        return;
    page_section(out, "needs", "Choosing by need",
                 "Files without mesh, cut to an error (in percent of the diagonal) or to a size. "
                 "Reaches: how far the envelopes reach beyond the model, at least and certainly at "
                 "most, in percent of the "
                 "diagonal. Kept: that bound divided by the error that was asked for, or by what "
                 "the whole file reaches where that is more (leaves cannot be refined); bytes "
                 "divided by the size. 1 or less "
                 "keeps the word.");
    page_groups(out, c, 4, "", "<th>asked for</th>",
                "<th class=\"first\">bytes</th><th>reaches ≥</th><th>≤</th><th>kept</th>");
    for (int i = 0; i < most->need_count; i++)
        need_row(out, c, &most->need[i]);
    fputs("</tbody></table></div></section>\n", out);
}

/* --- one method's levels --- */

/* Bytes, volumes and distances of one level. */
static void shape_row(FILE *out, const comparison *c, int level, const double *f, bool alone)
{
    fprintf(out, "<tr><th>%d</th>", level);
    cell_first(out, PLOT_BYTES, f[OF_BYTES]);
    cell(out, PLOT_BYTES, f[OF_CUMULATIVE_BYTES]);
    cell_count(out, f[OF_GRAY]);
    cell_count(out, f[OF_LEAVES]);
    cell_count(out, f[OF_PLANES]);
    cell_count(out, f[OF_LEAF_PLANES]);
    cell_first(out, PLOT_NUMBER, f[OF_VOLUME]);
    cell(out, PLOT_NUMBER, f[OF_EXCESS]);
    if (alone)
        cell(out, PLOT_NUMBER, f[OF_LEVELS_EXCESS]);
    cell(out, PLOT_NUMBER, f[OF_LIMIT_EXCESS]);
    cell(out, PLOT_NUMBER, f[OF_EXCESS_TO_LIMIT]);
    cell_first(out, PLOT_NUMBER, report_of_diagonal(c, f[OF_FAR_LO]));
    cell(out, PLOT_NUMBER, report_of_diagonal(c, f[OF_FAR_HI]));
    cell(out, PLOT_NUMBER, report_of_diagonal(c, f[OF_FAR_MEAN]));
    cell(out, PLOT_NUMBER, report_of_diagonal(c, f[OF_FAR_RMS]));
    fputs("</tr>\n", out);
}

static void shape_table(FILE *out, const comparison *c, const method *m)
{
    bool alone = !(m->info.parts & EBPO_PART_LEAF_PLANES);
    fprintf(out,
            "<div class=\"scroll\"><table><thead><tr class=\"groups\"><th></th><th "
            "colspan=\"6\">in the file</th><th colspan=\"%d\">volume</th><th "
            "colspan=\"4\">distance to the model, %%</th></tr>\n"
            "<tr><th>level</th><th class=\"first\">bytes</th><th>so "
            "far</th><th>gray</th><th>leaves</th><th>planes</th><th>of leaves</th><th "
            "class=\"first\">envelopes</th><th>excess, %%</th>%s"
            "<th>limit’s, %%</th><th>× limit</th><th class=\"first\">farthest "
            "≥</th><th>≤</th><th>mean</th><th>rms</th></tr></thead><tbody>\n",
            alone ? 5 : 4, alone ? "<th>levels alone, %</th>" : "");
    for (int k = c->first; k <= method_last(c, m); k++)
        shape_row(out, c, k, m->level[k], alone);
    fputs("</tbody></table></div>\n", out);
}

/* Questions to one level, and having it. */
static void answer_row(FILE *out, const comparison *c, int level, const double *f)
{
    fprintf(out, "<tr><th>%d</th>", level);
    cell_first(out, PLOT_NUMBER, 100 * f[OF_MAYBE_UNIFORM]);
    cell(out, PLOT_NUMBER, 100 * f[OF_MAYBE_NEAR]);
    cell(out, PLOT_SECONDS, 1e-9 * f[OF_INSIDE_NS]);
    cell_first(out, PLOT_NUMBER, report_of_diagonal(c, f[OF_WIDTH_MEAN]));
    cell(out, PLOT_NUMBER, report_of_diagonal(c, f[OF_WIDTH_MEDIAN]));
    cell(out, PLOT_NUMBER, report_of_diagonal(c, f[OF_WIDTH_P99]));
    cell(out, PLOT_SECONDS, 1e-9 * f[OF_DISTANCE_NS]);
    cell_first(out, PLOT_SECONDS, f[OF_HAVE_SECONDS]);
    cell(out, PLOT_BYTES, f[OF_READ_BYTES]);
    cell_count(out, f[OF_READS]);
    fputs("</tr>\n", out);
}

static void answer_table(FILE *out, const comparison *c, const method *m)
{
    fputs("<div class=\"scroll\"><table><thead><tr class=\"groups\"><th></th><th "
          "colspan=\"3\">point in solid, to the level</th><th colspan=\"4\">distance, to the "
          "level: width of the interval, %</th>"
          "<th colspan=\"3\">to have the level</th></tr>\n<tr><th>level</th><th "
          "class=\"first\">MAYBE, uniform, %</th><th>near the surface, %</th><th>time</th>"
          "<th class=\"first\">mean</th><th>median</th><th>99 %</th><th>time</th><th "
          "class=\"first\">time</th><th>read</th><th>reads</th></tr></thead><tbody>\n",
          out);
    for (int k = c->first; k <= method_last(c, m); k++)
        answer_row(out, c, k, m->level[k]);
    fputs("</tbody></table></div>\n", out);
}

static void method_table(FILE *out, const comparison *c, const method *m)
{
    fputs("<h3>", out);
    html_text(out, m->name);
    fputs("</h3>\n", out);
    shape_table(out, c, m);
    answer_table(out, c, m);
}

void page_tables(FILE *out, const comparison *c)
{
    page_section(out, "tables", "All figures by level",
                 "Distances and widths in percent of the diagonal of the model’s box. Exact "
                 "values, in the model’s unit, are in report.csv and report.json.");
    for (int i = 0; i < c->count; i++)
        method_table(out, c, &c->methods[i]);
    fputs("</section>\n", out);
}
