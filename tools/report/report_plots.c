/* Which plots the page has. */
#include "report/report_page.h"

#include <string.h>

/* What a figure is divided by to be shown. */
typedef enum relative { AS_IT_IS, OF_DIAGONAL, SHARE, NANOSECONDS } relative;

static double shown(const comparison *c, double v, relative how)
{
    switch (how) {
    case OF_DIAGONAL: return report_of_diagonal(c, v);
    case SHARE: return 100 * v;
    case NANOSECONDS: return 1e-9 * v;
    default: return v;
    }
}

/* A line for each method: figure y against figure x; x LEVEL_FIGURES: the level. */
static void lines(plot *p, const comparison *c, level_figure x, relative x_how, level_figure y,
                  relative y_how, bool dashed)
{
    for (int i = 0; i < c->count; i++) {
        const method *m = &c->methods[i];
        plot_series *s = plot_add(p, m->name, i);
        if (!s)
            return;
        s->dashed = s->quiet = dashed;
        for (int k = c->first; k <= method_last(c, m); k++)
            plot_at(p, s, x == LEVEL_FIGURES ? k : shown(c, m->level[k][x], x_how),
                    shown(c, m->level[k][y], y_how), k);
    }
}

static double least(const comparison *c, int level, level_figure which)
{
    double best = INFINITY;
    for (int i = 0; i < c->count; i++)
        if (c->methods[i].level[level][which] < best)
            best = c->methods[i].level[level][which];
    return best;
}

/* The limit is a fact of the cells; with methods that end in other leaves, the least. It has no
 * bytes and no time of its own: it stands where the leanest method stands. */
static void limit_line(plot *p, const comparison *c, level_figure x, relative x_how)
{
    plot_series *s = plot_add(p, "limit", -1);
    double at = 0;
    for (int k = c->first; k <= comparison_last(c); k++) {
        /* times are noisy; a deeper level is not there sooner */
        at = fmax(at, x == LEVEL_FIGURES ? k : shown(c, least(c, k, x), x_how));
        plot_at(p, s, at, least(c, k, OF_LIMIT_EXCESS), k);
    }
}

static void write_if_any(FILE *out, const plot *p)
{
    if (plot_has_points(p))
        plot_write(out, p);
}

static const char *const excess_name = "excess of volume, % of the solid",
                         *const far_name = "farthest point, % of the diagonal",
                         *const mean_name = "mean distance, % of the diagonal";

/* A surface has no volume to exceed: the envelopes' own. */
static void excess_plot(FILE *out, const comparison *c, const char *title, const char *x_name,
                        plot_unit unit, level_figure x, relative x_how)
{
    bool solid = any_level_figure(c, OF_EXCESS), alone = x != LEVEL_FIGURES;
    plot p = { .title = title,
               .x_name = x_name,
               .y_name = solid ? excess_name : "volume of the envelopes",
               .x = unit,
               .y = solid ? PLOT_PERCENT : PLOT_NUMBER };
    level_figure y = solid   ? (alone ? OF_LEVELS_EXCESS : OF_EXCESS)
                     : alone ? OF_LEVELS_VOLUME
                             : OF_VOLUME;
    lines(&p, c, x, x_how, y, AS_IT_IS, false);
    if (solid)
        limit_line(&p, c, x, x_how);
    write_if_any(out, &p);
}

static void far_plot(FILE *out, const comparison *c, const char *title, const char *x_name,
                     plot_unit unit, level_figure x, relative x_how)
{
    plot p = { .title = title, .x_name = x_name, .y_name = far_name, .x = unit, .y = PLOT_PERCENT };
    lines(&p, c, x, x_how, OF_FAR_HI, OF_DIAGONAL, false);
    write_if_any(out, &p);
}

void page_plots_by_level(FILE *out, const comparison *c)
{
    page_section(out, "levels", "Level by level",
                 "The limit is the convex hull of the solid in each cell: no convex envelope can "
                 "be smaller.");
    page_legend(out, c);
    fputs("<div class=\"plots\">\n", out);
    excess_plot(out, c, "Excess of volume", "level", PLOT_LEVEL, LEVEL_FIGURES, AS_IT_IS);
    plot ratio = { .title = "Excess against the limit’s",
                   .x_name = "level",
                   .y_name = "times the limit’s excess",
                   .x = PLOT_LEVEL,
                   .y = PLOT_TIMES };
    lines(&ratio, c, LEVEL_FIGURES, AS_IT_IS, OF_EXCESS_TO_LIMIT, AS_IT_IS, false);
    plot_series *one = plot_add(&ratio, "limit", -1);
    for (int k = c->first; k <= comparison_last(c); k++)
        plot_at(&ratio, one, k, 1, k);
    write_if_any(out, &ratio);
    fputs("</div>\n", out);
    page_against_limit(out, c);
    fputs("</section>\n", out);
}

void page_plots_by_bytes(FILE *out, const comparison *c)
{
    page_section(out, "bytes", "Error against bytes",
                 "Bytes of the file up to the end of each level, head included. Small numbers are "
                 "levels. Excess here is that of the levels alone, as they arrive. The limit has "
                 "no bytes of its own; it "
                 "stands where the leanest method stands.");
    page_legend(out, c);
    fputs("<div class=\"plots\">\n", out);
    excess_plot(out, c, "Excess of volume", "bytes so far", PLOT_BYTES, OF_CUMULATIVE_BYTES,
                AS_IT_IS);
    far_plot(out, c, "Farthest point of the envelopes from the model, certified", "bytes so far",
             PLOT_BYTES, OF_CUMULATIVE_BYTES, AS_IT_IS);
    plot mean = { .title = "Mean distance of the surface from the model, sampled",
                  .x_name = "bytes so far",
                  .y_name = mean_name,
                  .x = PLOT_BYTES,
                  .y = PLOT_PERCENT };
    lines(&mean, c, OF_CUMULATIVE_BYTES, AS_IT_IS, OF_FAR_MEAN, OF_DIAGONAL, false);
    write_if_any(out, &mean);
    plot maybe = { .title = "Points near the surface that stay undecided",
                   .x_name = "bytes so far",
                   .y_name = "MAYBE, % of points within 1 % of the diagonal",
                   .x = PLOT_BYTES,
                   .y = PLOT_PERCENT };
    lines(&maybe, c, OF_CUMULATIVE_BYTES, AS_IT_IS, OF_MAYBE_NEAR, SHARE, false);
    write_if_any(out, &maybe);
    fputs("</div></section>\n", out);
}

void page_plots_by_time(FILE *out, const comparison *c)
{
    page_section(
        out, "time", "Error against run time",
        "Time to have a level: opening the file and reading up to the level’s end, after the "
        "system was asked to forget the file. Time of a question: many at a time on one thread, "
        "everything in memory.");
    page_legend(out, c);
    fputs("<div class=\"plots\">\n", out);
    excess_plot(out, c, "Excess of volume", "time to have the level", PLOT_SECONDS, OF_HAVE_SECONDS,
                AS_IT_IS);
    far_plot(out, c, "Farthest point, certified", "time to have the level", PLOT_SECONDS,
             OF_HAVE_SECONDS, AS_IT_IS);
    plot maybe = { .title = "Point in solid, to a level: points that stay undecided",
                   .x_name = "time of a question",
                   .y_name = "MAYBE, % of uniform points",
                   .x = PLOT_SECONDS,
                   .y = PLOT_PERCENT };
    lines(&maybe, c, OF_INSIDE_NS, NANOSECONDS, OF_MAYBE_UNIFORM, SHARE, false);
    write_if_any(out, &maybe);
    plot width = { .title = "Distance, to a level: width of the certain interval, median",
                   .x_name = "time of a question",
                   .y_name = "% of the diagonal",
                   .x = PLOT_SECONDS,
                   .y = PLOT_PERCENT };
    lines(&width, c, OF_DISTANCE_NS, NANOSECONDS, OF_WIDTH_MEDIAN, OF_DIAGONAL, false);
    write_if_any(out, &width);
    fputs("</div></section>\n", out);
}

/* --- deadlines --- */

static void due_lines(plot *p, const comparison *c, deadline_figure which, relative how,
                      bool dashed)
{
    for (int i = 0; i < c->count; i++) {
        plot_series *s = plot_add(p, c->methods[i].name, i);
        if (!s)
            return;
        s->dashed = s->quiet = dashed;
        for (int k = 0; k < DEADLINES; k++)
            plot_at(p, s, 1e-6 * deadlines_us[k], shown(c, c->methods[i].due[k][which], how), -1);
    }
}

static void due_table(FILE *out, const comparison *c)
{
    page_groups(out, c, 4, "", "<th>within</th>",
                "<th class=\"first\">exact</th><th>width, %</th><th>took</th><th>late</th>");
    for (int k = 0; k < DEADLINES; k++) {
        fprintf(out, "<tr><th>%u µs</th>", deadlines_us[k]);
        for (int i = 0; i < c->count; i++) {
            const double *f = c->methods[i].due[k];
            cell_first(out, PLOT_PERCENT, 100 * f[OF_DUE_EXACT]);
            cell(out, PLOT_NUMBER, shown(c, f[OF_DUE_WIDTH_P99], OF_DIAGONAL));
            cell(out, PLOT_SECONDS, 1e-9 * f[OF_DUE_TOOK_P99]);
            cell(out, PLOT_PERCENT, 100 * f[OF_DUE_LATE]);
        }
        fputs("</tr>\n", out);
    }
    fputs("</tbody></table></div>\n", out);
}

void page_deadlines(FILE *out, const comparison *c)
{
    plot width = { .title = "What is certain by then: width of the interval, 99 % of the points",
                   .x_name = "deadline",
                   .y_name = "% of the diagonal",
                   .x = PLOT_SECONDS,
                   .y = PLOT_PERCENT };
    plot took = { .title = "Time really taken, 99 % (line) and half of the points (dots)",
                  .x_name = "deadline",
                  .y_name = "time taken",
                  .x = PLOT_SECONDS,
                  .y = PLOT_SECONDS,
                  .diagonal = true };
    due_lines(&width, c, OF_DUE_WIDTH_P99, OF_DIAGONAL, false);
    due_lines(&took, c, OF_DUE_TOOK_P99, NANOSECONDS, false);
    due_lines(&took, c, OF_DUE_TOOK_MEDIAN, NANOSECONDS, true);
    if (!plot_has_points(&took))
        return;
    page_section(out, "deadlines", "The best distance within T microseconds",
                 "One question at a time on all of the model. The answer is an interval that "
                 "certainly holds the distance; an exact one has width 0, which has no place on a "
                 "logarithmic axis. The grey line "
                 "is a word kept exactly; what is below it is early.");
    page_legend(out, c);
    fputs("<div class=\"plots\">\n", out);
    write_if_any(out, &width);
    write_if_any(out, &took);
    fputs("</div>\n", out);
    fputs("<h3>Exact answers; width of the interval in percent of the diagonal, and time taken (of "
          "99 % of the points); answers later than promised</h3>\n",
          out);
    due_table(out, c);
    fputs("</section>\n", out);
}

/* --- what the theses would send --- */

static void transmission_table(FILE *out, const comparison *c)
{
    page_groups(out, c, 4, "", "<th>level</th>",
                "<th class=\"first\">theirs</th><th>so far</th><th>ours</th><th>so far</th>");
    for (int k = c->first; k <= comparison_last(c); k++) {
        fprintf(out, "<tr><th>%d</th>", k);
        for (int i = 0; i < c->count; i++) {
            const double *f = c->methods[i].level[k];
            cell_first(out, PLOT_BYTES, f[OF_THESIS_BYTES]);
            cell(out, PLOT_BYTES, f[OF_THESIS_CUMULATIVE]);
            cell(out, PLOT_BYTES, f[OF_BYTES]);
            cell(out, PLOT_BYTES, f[OF_CUMULATIVE_BYTES]);
        }
        fputs("</tr>\n", out);
    }
    fputs("</tbody></table></div>\n", out);
}

void page_transmission(FILE *out, const comparison *c)
{
    if (!any_level_figure(c, OF_THESIS_BYTES))
        return;
    plot p = { .title = "Bytes so far: the theses’ model (dots) and this file (line)",
               .x_name = "level",
               .y_name = "bytes so far",
               .x = PLOT_LEVEL,
               .y = PLOT_BYTES };
    lines(&p, c, LEVEL_FIGURES, AS_IT_IS, OF_CUMULATIVE_BYTES, AS_IT_IS, false);
    lines(&p, c, LEVEL_FIGURES, AS_IT_IS, OF_THESIS_CUMULATIVE, AS_IT_IS, true);
    page_section(out, "transmission", "Progressive transmission",
                 "The theses’ cost model (BP 2008, section 4.2), uncompressed, for the same tree: "
                 "a leaf 1 byte for its corners; a plane 16 bytes the first time and 4 after, 4 "
                 "for its offset; a face or "
                 "a vertex 12 bytes the first time, 4 after. Its levels hold the faces and "
                 "vertices of their leaves. Ours are the bytes of the file, compressed, with the "
                 "leaves’ lists of faces, head "
                 "included; faces and vertices come after the last level.");
    page_legend(out, c);
    fputs("<div class=\"plots\">\n", out);
    write_if_any(out, &p);
    plot each = { .title = "Bytes of each level: the theses’ model (dots) and this file (line)",
                  .x_name = "level",
                  .y_name = "bytes of the level",
                  .x = PLOT_LEVEL,
                  .y = PLOT_BYTES };
    lines(&each, c, LEVEL_FIGURES, AS_IT_IS, OF_BYTES, AS_IT_IS, false);
    lines(&each, c, LEVEL_FIGURES, AS_IT_IS, OF_THESIS_BYTES, AS_IT_IS, true);
    write_if_any(out, &each);
    fputs("</div>\n<h3>Bytes of each level, and so far</h3>\n", out);
    transmission_table(out, c);
    fputs("</section>\n", out);
}
