#include "report/report_plot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cli/words.h"

enum { WIDTH = 560, HEIGHT = 350, LEFT = 62, RIGHT = 92, TOP = 34, BOTTOM = 46, LABEL_GAP = 14 };

typedef struct axis {
    double low, high; /* of the values shown */
    bool linear;
    plot_unit unit;
    double from, to; /* on the picture */
    double step;     /* between ticks; 0: at 1, 2, 5 times powers of ten */
} axis;

plot_series *plot_add(plot *p, const char *name, int colour)
{
    if (p->count == PLOT_SERIES_MAX)
        return NULL;
    plot_series *s = &p->series[p->count++];
    *s = (plot_series){ .name = name, .colour = colour };
    return s;
}

static bool fits(plot_unit unit, double v)
{
    return isfinite(v) && (unit == PLOT_LEVEL ? v >= 0 : v > 0);
}

void plot_at(const plot *p, plot_series *s, double x, double y, int mark)
{
    if (s && s->count < PLOT_POINTS_MAX && fits(p->x, x) && fits(p->y, y))
        s->point[s->count++] = (plot_point){ x, y, mark };
}

bool plot_has_points(const plot *p)
{
    for (int i = 0; i < p->count; i++)
        if (p->series[i].count && p->series[i].colour >= 0)
            return true;
    return false;
}

/* --- text --- */

void html_text(FILE *out, const char *text)
{
    for (const char *s = text; *s; s++)
        switch (*s) {
        case '&': fputs("&amp;", out); break;
        case '<': fputs("&lt;", out); break;
        case '>': fputs("&gt;", out); break;
        case '"': fputs("&quot;", out); break;
        case '\'': fputs("&#39;", out); break;
        default: putc((unsigned char)*s < 0x20 ? ' ' : *s, out);
        }
}

/* Three digits, no exponent where it can be helped. */
static void number(char *out, size_t room, double v)
{
    double a = fabs(v);
    if (!(a > 0))
        snprintf(out, room, "0");
    else if (a >= 1e6 || a < 1e-5)
        snprintf(out, room, "%.2e", v);
    else if (a >= 99.95)
        snprintf(out, room, "%.0f", v);
    else {
        int digits = 2 - (int)floor(log10(a));
        snprintf(out, room, "%.*f", digits > 0 ? digits : 0, v);
        if (strchr(out, '.'))
            for (char *end = out + strlen(out) - 1; *end == '0' || *end == '.'; end--) {
                bool point = *end == '.';
                *end = 0;
                if (point)
                    break;
            }
    }
}

static void seconds(char *out, size_t room, double v)
{
    static const struct {
        double factor;
        const char *unit;
    } units[] = { { 1, "s" }, { 1e-3, "ms" }, { 1e-6, "µs" }, { 1e-9, "ns" } };
    char text[32];
    int i = 0;
    while (i < 3 && v < 0.9995 * units[i].factor)
        i++;
    number(text, sizeof text, v / units[i].factor);
    snprintf(out, room, "%s %s", text, units[i].unit);
}

char *plot_value(char *out, size_t room, plot_unit unit, double v)
{
    static const char *const byte_units[] = { "B", "KB", "MB", "GB", "TB" };
    char text[32];
    int i = 0;
    switch (unit) {
    case PLOT_LEVEL: snprintf(out, room, "%.0f", v); return out;
    case PLOT_SECONDS: seconds(out, room, v); return out;
    case PLOT_BYTES:
        for (; v >= 999.5 && i < 4; i++)
            v /= 1000;
        number(text, sizeof text, v);
        snprintf(out, room, "%s %s", text, byte_units[i]);
        return out;
    default:
        number(text, sizeof text, v);
        snprintf(out, room, "%s%s", text,
                 unit == PLOT_PERCENT ? " %"
                 : unit == PLOT_TIMES ? " ×"
                                      : "");
        return out;
    }
}

/* --- axes --- */

static double place(const axis *a, double v)
{
    double share =
        a->linear ? (v - a->low) / (a->high - a->low) : log(v / a->low) / log(a->high / a->low);
    return a->from + share * (a->to - a->from);
}

/* The next of 1, 2, 5 times a power of ten, below or above. */
static double rounded(double v, bool up)
{
    static const double steps[] = { 1, 2, 5, 10 };
    double decade = pow(10, floor(log10(v))), best = decade;
    for (int i = 3; i >= 0 && up; i--)
        if (steps[i] * decade >= v * 0.9999)
            best = steps[i] * decade;
    for (int i = 0; i < 4 && !up; i++)
        if (steps[i] * decade <= v * 1.0001)
            best = steps[i] * decade;
    return best;
}

/* Less than a factor of five is divided as a linear axis is, or there would be hardly a number at
 * it. */
static void widen(axis *a)
{
    double margin = pow(a->high / a->low, 0.03); /* points do not stand on the frame */
    a->low /= margin;
    a->high *= margin;
    if (!(a->high > a->low * 1.02)) {
        a->low *= 0.8;
        a->high *= 1.25;
    }
    if (a->high > 5 * a->low) {
        a->low = rounded(a->low, false);
        a->high = rounded(a->high, true);
        return;
    }
    a->step = rounded((a->high - a->low) / 8, true);
}

static axis axis_of(const plot *p, bool vertical)
{
    axis a = { INFINITY,
               -INFINITY,
               false,
               vertical ? p->y : p->x,
               vertical ? HEIGHT - BOTTOM : LEFT,
               vertical ? TOP : WIDTH - RIGHT,
               0 };
    for (int i = 0; i < p->count; i++)
        for (int k = 0; k < p->series[i].count; k++) {
            double v = vertical ? p->series[i].point[k].y : p->series[i].point[k].x;
            a.low = fmin(a.low, v);
            a.high = fmax(a.high, v);
        }
    a.linear = a.unit == PLOT_LEVEL;
    if (a.linear) {
        a.step = 1;
        a.low -= 0.25;
        a.high += 0.25;
        return a;
    }
    widen(&a);
    return a;
}

/* Which of the digits 1 to 9 get a label: so many that there are at least four, and not more than
 * there is room for. */
static bool labelled(const axis *a, int digit)
{
    double decades = log10(a->high / a->low);
    return digit == 1 || (decades < 2.4 && (digit == 2 || digit == 5));
}

static void grid_line(FILE *out, const axis *a, double v, bool strong)
{
    double at = place(a, v);
    bool vertical = a->from > a->to; /* the axis goes upwards */
    if (vertical)
        fprintf(out, "<line class=\"%s\" x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\"/>",
                strong ? "g" : "h", LEFT, WIDTH - RIGHT, at, at);
    else
        fprintf(out, "<line class=\"%s\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%d\" y2=\"%d\"/>",
                strong ? "g" : "h", at, at, TOP, HEIGHT - BOTTOM);
}

static void tick_label(FILE *out, const axis *a, double v)
{
    char text[40];
    double at = place(a, v);
    plot_value(text, sizeof text, a->unit, v);
    if (a->from > a->to)
        fprintf(out, "<text class=\"t\" x=\"%d\" y=\"%.1f\" text-anchor=\"end\">%s</text>\n",
                LEFT - 8, at + 4, text);
    else
        fprintf(out, "<text class=\"t\" x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%s</text>\n", at,
                HEIGHT - BOTTOM + 17, text);
}

static void stepped_ticks(FILE *out, const axis *a)
{
    for (double v = a->step * ceil(a->low / a->step); v <= a->high; v += a->step) {
        grid_line(out, a, v, true);
        tick_label(out, a, fabs(v));
    }
}

static void write_axis(FILE *out, const axis *a)
{
    if (a->step > 0) {
        stepped_ticks(out, a);
        return;
    }
    double decades = log10(a->high / a->low), last = -100;
    for (double decade = pow(10, floor(log10(a->low) + 1e-9)); decade <= a->high * 1.0001;
         decade *= 10)
        for (int digit = 1; digit <= 9; digit++) {
            double v = digit * decade;
            if (v < a->low * 0.9999 || v > a->high * 1.0001)
                continue;
            if (decades < 4.5 || digit == 1)
                grid_line(out, a, v, labelled(a, digit));
            double gap = fabs(place(a, v) - last);
            if (labelled(a, digit) && gap > (a->from > a->to ? 13 : 44)) {
                tick_label(out, a, v);
                last = place(a, v);
            }
        }
}

/* --- series --- */

static void colour_of(FILE *out, int colour)
{
    if (colour < 0)
        fputs("var(--ref)", out);
    else
        fprintf(out, "var(--m%d)", colour % 8);
}

void plot_marker(FILE *out, int colour, double x, double y, double size)
{
    double s = size, t = 1.25 * size;
    fputs("<path class=\"p\" fill=\"", out);
    colour_of(out, colour);
    switch (colour < 0 ? 0 : colour % 4) {
    case 1:
        fprintf(out, "\" d=\"M%.1f %.1fh%.1fv%.1fh%.1fz\"", x - s * 0.9, y - s * 0.9, 1.8 * s,
                1.8 * s, -1.8 * s);
        break;
    case 2:
        fprintf(out, "\" d=\"M%.1f %.1fL%.1f %.1fL%.1f %.1fz\"", x, y - t, x + t, y + 0.8 * t,
                x - t, y + 0.8 * t);
        break;
    case 3:
        fprintf(out, "\" d=\"M%.1f %.1fL%.1f %.1fL%.1f %.1fL%.1f %.1fz\"", x, y - t, x + t, y, x,
                y + t, x - t, y);
        break;
    default:
        fprintf(out, "\" d=\"M%.1f %.1fa%.1f %.1f 0 1 0 %.1f 0a%.1f %.1f 0 1 0 %.1f 0z\"", x - s, y,
                s, s, 2 * s, s, s, -2 * s);
    }
    fputs(">", out); /* left open for a title */
}

static void write_point(FILE *out, const plot *p, const plot_series *s, const plot_point *at,
                        const axis *x, const axis *y)
{
    char text[2][40];
    plot_marker(out, s->colour, place(x, at->x), place(y, at->y),
                s->colour < 0 || s->dashed ? 2.2 : 3.6);
    fputs("<title>", out);
    html_text(out, s->name);
    if (at->mark >= 0 && p->x != PLOT_LEVEL)
        fprintf(out, ", level %d", at->mark);
    fputs(": ", out);
    html_text(out, p->y_name);
    fprintf(out, " %s, ", plot_value(text[0], sizeof text[0], p->y, at->y));
    html_text(out, p->x_name);
    fprintf(out, " %s</title></path>\n", plot_value(text[1], sizeof text[1], p->x, at->x));
}

static void write_series(FILE *out, const plot *p, const plot_series *s, const axis *x,
                         const axis *y)
{
    fputs("<path class=\"", out);
    fputs(s->colour < 0 ? "l ref" : s->dashed ? "l dash" : "l", out);
    fputs("\" stroke=\"", out);
    colour_of(out, s->colour);
    fputs("\" d=\"", out);
    for (int i = 0; i < s->count; i++)
        fprintf(out, "%s%.1f %.1f", i ? "L" : "M", place(x, s->point[i].x),
                place(y, s->point[i].y));
    fputs("\"/>\n", out);
    for (int i = 0; i < s->count; i++)
        write_point(out, p, s, &s->point[i], x, y);
}

/* The first series' numbers, which tell which point is which level; left out where they would stand
 * on each other. */
static void write_marks(FILE *out, const plot_series *s, const axis *x, const axis *y)
{
    double last_x = -100, last_y = -100;
    for (int i = 0; i < s->count; i++) {
        double px = place(x, s->point[i].x), py = place(y, s->point[i].y);
        if (s->point[i].mark < 0 || hypot(px - last_x, py - last_y) < 13)
            continue;
        fprintf(out, "<text class=\"k\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%d</text>\n",
                px, py - 8, s->point[i].mark);
        last_x = px;
        last_y = py;
    }
}

/* --- labels at the ends --- */

typedef struct label {
    const plot_series *series;
    double x, y, at; /* where the line ends, and where the label stands */
} label;

static int compare_labels(const void *a, const void *b)
{
    const label *l = a, *m = b;
    return (l->y > m->y) - (l->y < m->y);
}

/* Pushed apart downwards, then back up from the lower border. */
static void spread(label *l, int count)
{
    for (int i = 0; i < count; i++)
        l[i].at = i && l[i].y < l[i - 1].at + LABEL_GAP ? l[i - 1].at + LABEL_GAP : l[i].y;
    double room = HEIGHT - BOTTOM;
    for (int i = count - 1; i >= 0; i--, room -= LABEL_GAP)
        l[i].at = fmin(l[i].at, room);
}

static void write_labels(FILE *out, const plot *p, const axis *x, const axis *y)
{
    label l[PLOT_SERIES_MAX];
    int count = 0;
    for (int i = 0; i < p->count; i++) {
        const plot_series *s = &p->series[i];
        if (s->count && !s->quiet) {
            const plot_point *end = &s->point[s->count - 1];
            l[count++] = (label){ s, place(x, end->x), place(y, end->y), 0 };
        }
    }
    qsort(l, (size_t)count, sizeof *l, compare_labels);
    spread(l, count);
    for (int i = 0; i < count; i++) {
        fprintf(out, "<path class=\"lead\" stroke=\"");
        colour_of(out, l[i].series->colour);
        fprintf(out, "\" d=\"M%.1f %.1fL%d %.1f\"/><text class=\"n\" fill=\"", l[i].x + 5, l[i].y,
                WIDTH - RIGHT + 6, l[i].at);
        colour_of(out, l[i].series->colour);
        fprintf(out, "\" x=\"%d\" y=\"%.1f\">", WIDTH - RIGHT + 9, l[i].at + 4);
        html_text(out, l[i].series->name);
        fputs("</text>\n", out);
    }
}

/* --- the plot --- */

static void write_frame(FILE *out, const plot *p, const axis *x, const axis *y)
{
    write_axis(out, x);
    write_axis(out, y);
    fputs("<text class=\"a\" x=\"4\" y=\"18\">", out);
    html_text(out, p->y_name);
    fprintf(out, "</text><text class=\"a\" x=\"%d\" y=\"%d\" text-anchor=\"end\">", WIDTH - RIGHT,
            HEIGHT - 8);
    html_text(out, p->x_name);
    fputs("</text>\n", out);
}

static void write_diagonal(FILE *out, const axis *x, const axis *y)
{
    double low = fmax(x->low, y->low), high = fmin(x->high, y->high);
    if (low < high)
        fprintf(out,
                "<path class=\"l ref\" stroke=\"var(--ref)\" d=\"M%.1f %.1fL%.1f %.1f\"><title>the "
                "word kept exactly</title></path>\n",
                place(x, low), place(y, low), place(x, high), place(y, high));
}

void plot_write(FILE *out, const plot *p)
{
    axis x = axis_of(p, false), y = axis_of(p, true);
    fputs("<figure class=\"plot\"><figcaption>", out);
    html_text(out, p->title);
    fprintf(out,
            "</figcaption>\n<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" "
            "role=\"img\" aria-label=\"",
            WIDTH, HEIGHT);
    html_text(out, p->title);
    fputs("\">\n", out);
    write_frame(out, p, &x, &y);
    if (p->diagonal)
        write_diagonal(out, &x, &y);
    for (int i = p->count - 1; i >= 0; i--) /* the first on top */
        if (p->series[i].count)
            write_series(out, p, &p->series[i], &x, &y);
    if (p->count && p->x != PLOT_LEVEL)
        write_marks(out, &p->series[0], &x, &y);
    write_labels(out, p, &x, &y);
    fputs("</svg></figure>\n", out);
}
