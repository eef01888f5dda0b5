/* Divides segments in one plane at the points where they intersect.
 *
 * Segments are sorted by the lower end of their boxes on the first axis of the projection. Pairs of
 * segments with overlapping boxes are compared by exact orientation tests of three points (turns).
 * For each segment, the points in its interior are recorded: ends of other segments, and points
 * where other segments cross it. The recorded points, sorted along the segment, divide it. Rounding
 * keeps the order of coordinates, so if two segments intersect, their boxes of rounded coordinates
 * overlap. */
#include "core/strict_fp.h"

#include "extras/boolean/plane_arrangement.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/sort.h"

void ebpo_arrangement_2d_init(ebpo_arrangement_2d *a)
{
    *a = (ebpo_arrangement_2d){ 0 };
    ebpo_exact_point_init(&a->crossing);
    ebpo_exact_plane_init(&a->line);
}

void ebpo_arrangement_2d_free(ebpo_arrangement_2d *a)
{
    ebpo_exact_point_clear(&a->crossing);
    ebpo_exact_plane_clear(&a->line);
    ebpo_point_set_free(&a->set);
    free(a->segment);
    free(a->recorded);
    free(a->edge);
}

void ebpo_arrangement_2d_begin(ebpo_arrangement_2d *a, int axis, int unit)
{
    a->axis = axis;
    a->unit = unit;
    a->segments = a->recorded_count = a->edges = 0;
    ebpo_point_set_empty(&a->set);
}

bool ebpo_arrangement_2d_add(ebpo_arrangement_2d *a, uint32_t from, uint32_t to)
{
    if (!ebpo_grow(&a->segment, &a->segment_capacity, a->segments + 1, sizeof *a->segment))
        return false;
    ebpo_plane_segment *s = &a->segment[a->segments++];
    const double *p = a->set.point[from].at, *q = a->set.point[to].at;
    const int axes[2] = { a->axis == 2 ? 0 : a->axis + 1, a->axis == 0 ? 2 : a->axis - 1 };
    s->from = from;
    s->to = to;
    for (int k = 0; k < 2; k++) {
        s->low[k] = fmin(p[axes[k]], q[axes[k]]);
        s->high[k] = fmax(p[axes[k]], q[axes[k]]);
    }
    return true;
}

static int order_segments(const void *x, const void *y)
{
    const ebpo_plane_segment *s = x, *t = y;
    if (s->low[0] != t->low[0])
        return s->low[0] < t->low[0] ? -1 : 1;
    if (s->from != t->from)
        return s->from < t->from ? -1 : 1;
    return (s->to > t->to) - (s->to < t->to);
}

static int turn_of(const ebpo_arrangement_2d *a, uint32_t p, uint32_t q, uint32_t r)
{
    const ebpo_exact_point *point = a->set.point;
    if (p == q || r == p || r == q)
        return 0;
    return ebpo_exact_turn(a->axis, &point[p], &point[q], &point[r]);
}

static bool record_point(ebpo_arrangement_2d *a, uint64_t segment, uint32_t point)
{
    if (!ebpo_grow(&a->recorded, &a->recorded_capacity, a->recorded_count + 1, sizeof *a->recorded))
        return false;
    a->recorded[a->recorded_count++] = (ebpo_point_on_segment){ (uint32_t)segment, point };
    return true;
}

/* Records the point p, which is on the segment's line, if p is in the interior of the segment. */
static bool record_if_inside(ebpo_arrangement_2d *a, uint64_t segment, uint32_t p)
{
    const ebpo_plane_segment *s = &a->segment[segment];
    const ebpo_exact_point *point = a->set.point;
    if (p == s->from || p == s->to || s->from == s->to)
        return true;
    int first = ebpo_exact_order(&point[s->from], &point[p]);
    return first != ebpo_exact_order(&point[p], &point[s->to]) || record_point(a, segment, p);
}

/* Adds the point where two segments cross to the set, and records it for both segments. */
static bool cross_segments(ebpo_arrangement_2d *a, uint64_t i, uint64_t j)
{
    const ebpo_plane_segment *s = &a->segment[i], *t = &a->segment[j];
    const ebpo_exact_point *point = a->set.point;
    uint32_t number;
    ebpo_exact_plane_along(&a->line, a->axis, &point[t->from], &point[t->to]);
    ebpo_exact_intersect(&a->crossing, &a->line, &point[s->from], &point[s->to], a->unit);
    return ebpo_point_set_add(&a->set, &a->crossing, &number) && record_point(a, i, number) &&
           record_point(a, j, number);
}

/* Records the point where segments i and j cross, and each end of one segment that is in the
 * interior of the other segment. */
static bool compare_segments(ebpo_arrangement_2d *a, uint64_t i, uint64_t j)
{
    const ebpo_plane_segment s = a->segment[i], t = a->segment[j];
    if ((s.from == t.from && s.to == t.to) || (s.from == t.to && s.to == t.from))
        return true;
    /* sides of s on which the ends of t are; 0: an end is on the line of s */
    int from_t = turn_of(a, s.from, s.to, t.from), to_t = turn_of(a, s.from, s.to, t.to);
    if (from_t * to_t > 0)
        return true;
    int from_s = turn_of(a, t.from, t.to, s.from), to_s = turn_of(a, t.from, t.to, s.to);
    if (from_s * to_s > 0)
        return true;
    if (from_t * to_t < 0 && from_s * to_s < 0)
        return cross_segments(a, i, j);
    return (from_t != 0 || record_if_inside(a, i, t.from)) &&
           (to_t != 0 || record_if_inside(a, i, t.to)) &&
           (from_s != 0 || record_if_inside(a, j, s.from)) &&
           (to_s != 0 || record_if_inside(a, j, s.to));
}

/* Sorts the segments, and keeps one of several equal segments. Each face around a vertex adds the
 * vertex as a single point to the faces of another operand that have the same vertex. */
static void sort_segments(ebpo_arrangement_2d *a)
{
    uint64_t kept = 0;
    qsort(a->segment, a->segments, sizeof *a->segment, order_segments);
    for (uint64_t i = 0; i < a->segments; i++)
        if (kept == 0 || a->segment[kept - 1].from != a->segment[i].from ||
            a->segment[kept - 1].to != a->segment[i].to)
            a->segment[kept++] = a->segment[i];
    a->segments = kept;
}

static bool compare_all(ebpo_arrangement_2d *a)
{
    sort_segments(a);
    for (uint64_t i = 0; i < a->segments; i++)
        for (uint64_t j = i + 1; j < a->segments && a->segment[j].low[0] <= a->segment[i].high[0];
             j++)
            if (a->segment[j].low[1] <= a->segment[i].high[1] &&
                a->segment[i].low[1] <= a->segment[j].high[1] && !compare_segments(a, i, j))
                return false;
    return true;
}

static int order_recorded(const void *x, const void *y, void *context)
{
    const ebpo_point_on_segment *p = x, *q = y;
    const ebpo_arrangement_2d *a = context;
    if (p->segment != q->segment)
        return p->segment < q->segment ? -1 : 1;
    if (p->point == q->point)
        return 0;
    return ebpo_exact_order(&a->set.point[p->point], &a->set.point[q->point]);
}

static bool add_edge(ebpo_arrangement_2d *a, uint32_t from, uint32_t to)
{
    if (from == to)
        return true;
    if (!ebpo_grow(&a->edge, &a->edge_capacity, a->edges + 1, sizeof *a->edge))
        return false;
    a->edge[a->edges++] = (ebpo_plane_edge){ from, to };
    return true;
}

bool ebpo_arrangement_2d_divide(ebpo_arrangement_2d *a)
{
    if (a->segments > UINT32_MAX || !compare_all(a))
        return false;
    for (uint64_t i = 0; i < a->segments; i++)
        if (!record_point(a, i, a->segment[i].from) || !record_point(a, i, a->segment[i].to))
            return false;
    ebpo_sort_with(a->recorded, a->recorded_count, sizeof *a->recorded, order_recorded, a);
    for (uint64_t i = 0; i + 1 < a->recorded_count; i++)
        if (a->recorded[i].segment == a->recorded[i + 1].segment &&
            !add_edge(a, a->recorded[i].point, a->recorded[i + 1].point))
            return false;
    return true;
}
