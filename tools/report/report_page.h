/* The parts of report.html. */
#ifndef EBPO_TOOLS_REPORT_PAGE_H
#define EBPO_TOOLS_REPORT_PAGE_H

#include "report/report_data.h"
#include "report/report_plot.h"

extern const char report_style[]; /* the style sheet */

/* "Bytes", "run time" and so on: a section with its plots; nothing where no figure is there. */
void page_plots_by_level(FILE *out, const comparison *c);
void page_plots_by_bytes(FILE *out, const comparison *c);
void page_plots_by_time(FILE *out, const comparison *c);
void page_deadlines(FILE *out, const comparison *c);
void page_transmission(FILE *out, const comparison *c);

void page_glance(FILE *out, const comparison *c);
void page_against_limit(FILE *out, const comparison *c);
void page_needs(FILE *out, const comparison *c);
void page_tables(FILE *out, const comparison *c);

/* Names of the methods with their markers. */
void page_legend(FILE *out, const comparison *c);
/* <section id="..."><h2>...</h2><p>...</p>; text is HTML. */
void page_section(FILE *out, const char *id, const char *title, const char *text);

/* Table cells. NAN is a dash. */
void cell(FILE *out, plot_unit unit, double v);
void cell_first(FILE *out, plot_unit unit, double v); /* of a group of columns */
void cell_count(FILE *out, double v);
/* Begins a table with a group of `columns` for each method: `group` heads what stands before them
 * (HTML), `before` and `each` are the columns' heads. */
void page_groups(FILE *out, const comparison *c, int columns, const char *group, const char *before,
                 const char *each);

bool any_level_figure(const comparison *c, level_figure which);

#endif
