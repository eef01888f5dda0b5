/* Faces are halved across their longest edge until it is clear to which stroke a part belongs, or
 * the part is small. In each layer the last stroke decides: where a ball of it holds the part, it
 * does; where one only meets it, those before may have what it does not cover. */
#include "core/strict_fp.h"

#include "extras/paint/area_cut.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "extras/paint/reach.h"
#include "extras/haptic/face_near.h"

enum { DEEPEST = 900 };

typedef struct triangle {
    double p[3][3], area;
} triangle;

bool ebpo_area_cut_begin(ebpo_area_cut *c, const ebpo_area_keys *keys, double fineness)
{
    *c = (ebpo_area_cut){ .keys = keys, .fineness = fineness };
    c->seen = ebpo_alloc_zero(keys->colours, sizeof *c->seen);
    return c->seen != NULL;
}

void ebpo_area_cut_end(ebpo_area_cut *c)
{
    free(c->seen);
    free(c->ball);
}

static double square_of_edge(const double a[3], const double b[3])
{
    double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    return (x * x + y * y) + z * z;
}

static double area_of(const double p[3][3])
{
    double e[3], f[3], n[3];
    for (int i = 0; i < 3; i++) {
        e[i] = p[1][i] - p[0][i];
        f[i] = p[2][i] - p[0][i];
    }
    for (int i = 0; i < 3; i++)
        n[i] = e[(i + 1) % 3] * f[(i + 2) % 3] - e[(i + 2) % 3] * f[(i + 1) % 3];
    return sqrt((n[0] * n[0] + n[1] * n[1]) + n[2] * n[2]) / 2;
}

static bool holds(const ebpo_area_ball *ball, const triangle *t)
{
    double square = ball->radius * ball->radius;
    return ebpo_ball_holds(ball->centre, square, t->p[0]) &&
           ebpo_ball_holds(ball->centre, square, t->p[1]) &&
           ebpo_ball_holds(ball->centre, square, t->p[2]);
}

static bool meets(const ebpo_area_ball *ball, const triangle *t)
{
    ebpo_face_near near;
    ebpo_face_nearest(ball->centre, t->p, &near);
    return near.distance <= ball->radius;
}

/* --- which balls a part meets --- */

/* From a layer's balls at [from, end) those that may have a part of it go to `to`: up to the first
 * stroke of which one holds it, of which that one says it all. Their number; *sure: nothing is left
 * to be decided. */
static uint64_t sift_layer(ebpo_area_cut *c, const triangle *t, uint64_t from, uint64_t end,
                           uint64_t to, bool *sure)
{
    uint64_t kept = 0, first = 0; /* first: of the stroke at hand */
    *sure = false;
    for (uint64_t i = from; i < end; i++) {
        const ebpo_area_ball *b = &c->ball[i];
        if (i > from && b->stroke != c->ball[i - 1].stroke)
            first = kept;
        if (holds(b, t)) {
            c->ball[to + first] = *b;
            *sure = first == 0;
            return first + 1;
        }
        if (meets(b, t))
            c->ball[to + kept++] = *b;
    }
    *sure = kept == 0;
    return kept;
}

/* The same of all layers at [from, from + count), to behind them. */
static uint64_t sift(ebpo_area_cut *c, const triangle *t, uint64_t from, uint64_t count, bool *sure)
{
    uint64_t kept = 0;
    *sure = true;
    for (uint64_t i = from, end; i < from + count; i = end) {
        bool layer_sure;
        for (end = i; end < from + count && c->ball[end].layer == c->ball[i].layer; end++)
            continue;
        kept += sift_layer(c, t, i, end, from + count + kept, &layer_sure);
        *sure = *sure && layer_sure;
    }
    return kept;
}

static double least_radius(const ebpo_area_cut *c, uint64_t from, uint64_t count)
{
    double least = INFINITY;
    for (uint64_t i = from; i < from + count; i++)
        least = fmin(least, c->ball[i].radius);
    return least;
}

/* --- sums --- */

static void add(ebpo_paint_area *to, double area, bool certain, bool valued)
{
    to->lo += certain ? area : 0;
    to->value += valued ? area : 0;
    to->hi += area;
}

/* A layer's part of a small or decided triangle. */
typedef struct verdict {
    bool painted, unpainted; /* may be so */
    uint32_t at_centre;      /* the stroke that has the middle; UINT32_MAX: none */
    uint32_t colour;         /* of what may be painted, the first; */
    bool one_colour;         /* and the only one */
} verdict;

static bool paints(const ebpo_area_cut *c, uint32_t stroke)
{
    return c->keys->p->stroke[stroke].kind == EBPO_PAINT_PAINTS;
}

/* Looks at a layer's balls [from, end), each stroke in turn. */
static verdict judge_layer(const ebpo_area_cut *c, const triangle *t, const double centre[3],
                           uint64_t from, uint64_t end)
{
    verdict v = { .at_centre = UINT32_MAX, .one_colour = true, .unpainted = true };
    bool first = true;
    for (uint64_t i = from; i < end; i++) {
        const ebpo_area_ball *b = &c->ball[i];
        uint32_t colour = c->keys->colour[b->stroke];
        if (v.at_centre == UINT32_MAX && ebpo_ball_holds(b->centre, b->radius * b->radius, centre))
            v.at_centre = b->stroke;
        if (paints(c, b->stroke)) {
            v.one_colour = v.one_colour && (first || v.colour == colour);
            v.colour = first ? colour : v.colour;
            v.painted = true;
            first = false;
        }
    }
    if (end > from && holds(&c->ball[end - 1], t)) { /* the last one leaves nothing over */
        v.unpainted = false;
        for (uint64_t i = from; i < end; i++)
            v.unpainted = v.unpainted || !paints(c, c->ball[i].stroke);
    }
    return v;
}

static void add_layer(ebpo_area_cut *c, const triangle *t, const verdict *v, uint64_t from,
                      uint64_t end)
{
    ebpo_paint_area *strokes = c->area, *colours = strokes + c->keys->p->stroke_count,
                    *layers = colours + c->keys->colours;
    bool certain = v->painted && !v->unpainted,
         valued = v->at_centre != UINT32_MAX && paints(c, v->at_centre);
    if (!v->painted)
        return;
    add(&layers[c->ball[from].layer], t->area, certain, valued);
    c->part++;
    for (uint64_t i = from; i < end; i++) {
        uint32_t stroke = c->ball[i].stroke, colour = c->keys->colour[stroke];
        bool again = i > from && c->ball[i - 1].stroke == stroke;
        if (again || !paints(c, stroke))
            continue;
        add(&strokes[stroke], t->area,
            certain && c->ball[from].stroke == stroke && c->ball[end - 1].stroke == stroke,
            v->at_centre == stroke);
        if (c->seen[colour] == c->part)
            continue;
        c->seen[colour] = c->part;
        add(&colours[colour], t->area, certain && v->one_colour,
            valued && c->keys->colour[v->at_centre] == colour);
    }
}

static void account(ebpo_area_cut *c, const triangle *t, uint64_t from, uint64_t count)
{
    double centre[3];
    bool may = false, certain = false, valued = false;
    for (int i = 0; i < 3; i++)
        centre[i] = (t->p[0][i] + t->p[1][i] + t->p[2][i]) / 3;
    for (uint64_t i = from, end; i < from + count; i = end) {
        for (end = i; end < from + count && c->ball[end].layer == c->ball[i].layer; end++)
            continue;
        verdict v = judge_layer(c, t, (const double *)centre, i, end);
        may = may || v.painted;
        certain = certain || (v.painted && !v.unpainted);
        valued = valued || (v.at_centre != UINT32_MAX && paints(c, v.at_centre));
        add_layer(c, t, &v, i, end);
    }
    if (may)
        add(&c->area[ebpo_area_key_count(c->keys) - 1], t->area, certain, valued);
}

/* --- cutting --- */

static double longest_edge(const triangle *t, int *which)
{
    double longest = -1;
    for (int k = 0; k < 3; k++) {
        double square = square_of_edge(t->p[k], t->p[(k + 1) % 3]);
        if (square > longest) {
            longest = square;
            *which = k;
        }
    }
    return sqrt(longest);
}

/* The middle of an edge; false: it is one of its ends, as doubles are no finer. */
static bool find_middle(const double a[3], const double b[3], double middle[3])
{
    for (int i = 0; i < 3; i++)
        middle[i] = a[i] + (b[i] - a[i]) / 2;
    return memcmp(middle, a, 3 * sizeof *a) != 0 && memcmp(middle, b, 3 * sizeof *b) != 0;
}

/* Balls are at [from, from + count); deeper parts use what is behind. */
static bool cut(ebpo_area_cut *c, const triangle *t, uint64_t from, uint64_t count, int depth)
{
    bool sure;
    int edge = 0;
    if (!ebpo_grow(&c->ball, &c->ball_capacity, from + 2 * count, sizeof *c->ball))
        return false;
    uint64_t kept = sift(c, t, from, count, &sure), at = from + count;
    if (kept == 0)
        return true;
    double longest = longest_edge(t, &edge), middle[3];
    const double *a = t->p[edge], *b = t->p[(edge + 1) % 3];
    if (sure || depth == DEEPEST || longest * c->fineness <= least_radius(c, at, kept) ||
        !find_middle(a, b, middle)) {
        account(c, t, at, kept);
        return true;
    }
    triangle half = *t;
    half.area = t->area / 2;
    memcpy(half.p[edge], middle, sizeof middle);
    if (!cut(c, &half, at, kept, depth + 1))
        return false;
    memcpy(half.p[edge], a, sizeof middle);
    memcpy(half.p[(edge + 1) % 3], middle, sizeof middle);
    return cut(c, &half, at, kept, depth + 1);
}

bool ebpo_area_cut_face(ebpo_area_cut *c, const double corner[3][3], uint64_t count)
{
    triangle t;
    memcpy(t.p, corner, sizeof t.p);
    t.area = area_of(corner);
    return t.area > 0 ? cut(c, &t, 0, count, 0) : true;
}
