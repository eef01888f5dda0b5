/* Where the points of a plane or grid are. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/commands/map_job.h"

enum { LONGER_EDGE = 1000, GRID_MOST = 1 << 20 };

/* `count` finite numbers with commas between them, and nothing else. */
static bool read_reals(const char *text, int count, double *out)
{
    for (int i = 0; i < count; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (end == text || !isfinite(out[i]) || *end != (i + 1 < count ? ',' : 0))
            return false;
        text = end + 1;
    }
    return true;
}

static int wrong(const char *option, const char *value, const char *expected)
{
    return command_usage("map", "%s '%s': expected %s", option, value, expected);
}

bool map_read_size(const char *text, int *width, int *height)
{
    char rest;
    if (sscanf(text, "%5dx%5d%c", width, height, &rest) == 2 && *width >= 2 && *width <= 8192 &&
        *height >= 2 && *height <= 8192)
        return true;
    wrong("--size", text, "a width, an x and a height, each from 2 to 8192");
    return false;
}

static int find_box(const map_job *j, double low[3], double high[3])
{
    const ebpo_info *info = ebpo_file_info(j->file);
    double all[6], longest = 0;
    if (j->v->box) {
        if (!read_reals(j->v->box, 6, all) || !(all[0] < all[3]) || !(all[1] < all[4]) ||
            !(all[2] < all[5]))
            return wrong("--box", j->v->box, "six numbers, the low corner below the high one");
        memcpy(low, all, 3 * sizeof *low);
        memcpy(high, all + 3, 3 * sizeof *high);
    }
    for (int c = 0; c < 3; c++)
        longest = fmax(longest, info->box_size[c]);
    for (int c = 0; c < 3; c++) {
        if (!j->v->box) {
            low[c] = info->box_origin[c] - j->v->margin * longest;
            high[c] = info->box_origin[c] + info->box_size[c] + j->v->margin * longest;
        }
        if (!isfinite(high[c] - low[c])) /* what is computed of it would be no number */
            return command_usage("map", "a box whose edges are longer than a double tells");
    }
    return EXIT_FINE;
}

/* --- planes --- */

static double length_of(const double v[3]) { return hypot(hypot(v[0], v[1]), v[2]); }

typedef struct rectangle {
    double corner[3], edge[2][3];
} rectangle;

/* "z=0.5" or "z=50%": the coordinate, by the model's box. */
static bool read_place(const map_job *j, const char *text, int *axis, double *at)
{
    const ebpo_info *info = ebpo_file_info(j->file);
    char *end;
    if (text[0] < 'x' || text[0] > 'z' || text[1] != '=')
        return false;
    *axis = text[0] - 'x';
    *at = strtod(text + 2, &end);
    if (end == text + 2 || !isfinite(*at))
        return false;
    if (strcmp(end, "%") == 0)
        *at = info->box_origin[*axis] + *at / 100 * info->box_size[*axis];
    else if (*end)
        return false;
    return isfinite(*at);
}

/* Right and up as one looks at it: x and y, x and z, or y and z. */
static int find_rectangle(const map_job *j, rectangle *r)
{
    double all[9], low[3], high[3], at;
    int axis;
    *r = (rectangle){ 0 };
    if (read_place(j, j->v->plane, &axis, &at)) {
        int code = find_box(j, low, high), right = axis == 0, up = axis == 2 ? 1 : 2;
        if (code != EXIT_FINE)
            return code;
        memcpy(r->corner, low, sizeof r->corner);
        r->corner[axis] = at;
        r->edge[0][right] = high[right] - low[right];
        r->edge[1][up] = high[up] - low[up];
        return EXIT_FINE;
    }
    if (!read_reals(j->v->plane, 9, all))
        return wrong("--plane", j->v->plane,
                     "x=V, y=V or z=V with a number or a share such as 50%, or nine numbers: a "
                     "corner and two edges");
    if (j->v->box)
        return command_usage("map", "--box belongs to --grid and to planes across an axis");
    if (j->v->margin != MAP_MARGIN)
        return command_usage("map", "--margin belongs to --grid and to planes across an axis");
    memcpy(r, all, sizeof *r);
    double a = length_of(r->edge[0]), b = length_of(r->edge[1]), dot = 0;
    for (int c = 0; c < 3; c++)
        dot += r->edge[0][c] / a * (r->edge[1][c] / b);
    if (!(a > 0) || !(b > 0) || !isfinite(a) || !isfinite(b) || fabs(dot) > 1e-9)
        return wrong("--plane", j->v->plane, "two edges with a length, at right angles");
    return EXIT_FINE;
}

static void find_points(const map_job *j, double a, double b, uint64_t count[3])
{
    double longer = fmax(a, b);
    double shares[2] = { a / longer, b / longer };
    count[2] = 1;
    for (int i = 0; i < 2; i++) {
        double n = round(LONGER_EDGE * shares[i]);
        count[i] = n < 2 ? 2 : (uint64_t)n;
    }
    if (j->width) {
        count[0] = (uint64_t)j->width;
        count[1] = (uint64_t)j->height;
    }
}

static int lattice_of_plane(map_job *j)
{
    rectangle r;
    int code = find_rectangle(j, &r);
    if (code != EXIT_FINE)
        return code;
    ebpo_lattice *l = &j->lattice;
    double a = length_of(r.edge[0]), b = length_of(r.edge[1]), step = 0;
    find_points(j, a, b, l->count);
    memcpy(l->origin, r.corner, sizeof l->origin);
    for (int i = 0; i < 2; i++)
        for (int c = 0; c < 3; c++)
            l->step[i][c] = r.edge[i][c] / (double)(l->count[i] - 1);
    step = length_of(l->step[0]);
    for (int c = 0; c < 3; c++) { /* across, for formats that want one */
        int d = (c + 1) % 3, e = (c + 2) % 3;
        l->step[2][c] =
            step * (r.edge[0][d] / a * (r.edge[1][e] / b) - r.edge[0][e] / a * (r.edge[1][d] / b));
    }
    return EXIT_FINE;
}

static int lattice_of_grid(map_job *j)
{
    double numbers[3], low[3], high[3];
    uint64_t count[3];
    ebpo_error error = EBPO_ERROR_INIT;
    bool good = read_reals(j->v->grid, 3, numbers);
    for (int c = 0; c < 3 && good; c++) {
        good = numbers[c] >= 1 && numbers[c] <= GRID_MOST && numbers[c] == floor(numbers[c]);
        count[c] = good ? (uint64_t)numbers[c] : 0;
    }
    if (!good)
        return wrong("--grid", j->v->grid, "three whole numbers, each from 1 to 1048576");
    int code = find_box(j, low, high);
    if (code != EXIT_FINE)
        return code;
    if (ebpo_lattice_of_box(low, high, count, &j->lattice, &error) != EBPO_OK)
        return command_failed("map", &error);
    return EXIT_FINE;
}

int map_find_lattice(map_job *j)
{
    j->plane = j->v->plane != NULL;
    return j->plane ? lattice_of_plane(j) : lattice_of_grid(j);
}
