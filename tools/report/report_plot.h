/* Line plots as inline SVG: logarithmic axes (or whole numbers along x), a grid that can be read,
 * labels at the lines' ends. Colours are the page's: style sheet variables. */
#ifndef EBPO_TOOLS_REPORT_PLOT_H
#define EBPO_TOOLS_REPORT_PLOT_H

#include <stdbool.h>
#include <stdio.h>

enum { PLOT_SERIES_MAX = 26, PLOT_POINTS_MAX = 24 };

/* How an axis' values are written. */
typedef enum plot_unit {
    PLOT_NUMBER,
    PLOT_PERCENT,
    PLOT_BYTES,
    PLOT_SECONDS,
    PLOT_LEVEL,
    PLOT_TIMES
} plot_unit;

typedef struct plot_point {
    double x, y;
    int mark; /* a small number beside the point, or -1 */
} plot_point;

typedef struct plot_series {
    const char *name;   /* at its end and in hover titles; not escaped yet */
    int colour;         /* of the page's --m0, --m1 ...; -1: the reference's grey */
    bool dashed, quiet; /* quiet: no label at the end */
    plot_point point[PLOT_POINTS_MAX];
    int count;
} plot_series;

typedef struct plot {
    const char *title, *x_name, *y_name;
    plot_unit x, y; /* PLOT_LEVEL: whole numbers, linear */
    bool diagonal;  /* a line y = x, for words that are to be kept */
    plot_series series[PLOT_SERIES_MAX];
    int count;
} plot;

/* A new series of the plot, NULL when there is no room. */
plot_series *plot_add(plot *p, const char *name, int colour);
/* What cannot be on a logarithmic axis, or is not finite, is left out. */
void plot_at(const plot *p, plot_series *s, double x, double y, int mark);
/* False when there is nothing to draw. */
bool plot_has_points(const plot *p);
void plot_write(FILE *out, const plot *p);

/* "12.3 KB", "1.2 µs", "4.5 %", three digits; UTF-8. Returns out. */
char *plot_value(char *out, size_t room, plot_unit unit, double v);
/* A marker of a method as in the plots, for legends. */
void plot_marker(FILE *out, int colour, double x, double y, double size);
/* & < > " ' as entities. */
void html_text(FILE *out, const char *text);

#endif
