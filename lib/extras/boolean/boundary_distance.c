/* Computes the distance of a point to the boundary of the result of a Boolean expression.
 *
 * A point has a *state*: it is in or out of the result. The boundary is a part of the operands'
 * faces, so it is not nearer than the nearest face. If a point just behind the nearest face has
 * another state than the given point, the distance of the nearest face is returned. Otherwise a
 * search over cells of the world, the nearest first, bounds the distance of the points with the
 * other state. A cell whose points all have the other state gives an upper bound. A cell whose
 * points all have the given point's state is dropped. A mixed cell may have points of both states,
 * and is divided.
 *
 * There are two searches. The first search does not divide cells that are small compared with their
 * distance and the tolerance. Otherwise it could reach the maximum number of cells along a near
 * boundary before it finds an upper bound. If the bounds are too wide, the second search divides
 * down to the finest cells. Both searches stop at the maximum number of cells. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/sort.h"
#include "extras/boolean/world_cell.h"

/* Returns the length, correct to some ulp, without overflow. */
static inline double scaled_length(const double x[3])
{
    double most = fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2])));
    if (!(most > 0) || isinf(most))
        return most;
    double a = x[0] / most, b = x[1] / most, c = x[2] / most;
    return most * sqrt(a * a + b * b + c * c);
}

/* The search for the nearest point whose state is not `state`. */
typedef struct boundary_search {
    const ebpo_boolean *boolean;
    const double *point;
    unsigned state; /* EBPO_MAY_IN or EBPO_MAY_OUT: the search drops cells in this state */
    double tolerance;
    double grain;       /* cells smaller than this fraction of their distance are not divided */
    uint64_t max_cells; /* maximum number of cells */
    uint64_t cells;     /* number of cells so far */
    /* Guaranteed bounds of the distance of the nearest point with the other state. hi begins as an
     * upper bound that the caller knows, or INFINITY. lo = hi = INFINITY: there is no such point.
     */
    double lo, hi;
} boundary_search;

/* A cell that waits for its evaluation. */
typedef struct waiting {
    double distance; /* lower bound of the distance of its points */
    ebpo_world_cell cell;
} waiting;

typedef struct queue {
    waiting *list; /* a heap, the nearest first */
    uint64_t count, capacity;
} queue;

static bool is_nearer(const waiting *a, const waiting *b) { return a->distance < b->distance; }

EBPO_HEAP(heap, waiting, is_nearer)

static ebpo_status push_waiting(queue *q, waiting cell, ebpo_error *error)
{
    if (!ebpo_grow(&q->list, &q->capacity, q->count + 1, sizeof *q->list))
        return ebpo_fail_memory(error, (q->count + 1) * sizeof *q->list);
    heap_add(q->list, q->count++, &cell);
    return EBPO_OK;
}

/* Returns the distance from the point to the closed cell, correct to some ulp. */
static double distance_to(const boundary_search *s, const ebpo_world *w, ebpo_cell cell)
{
    double d[3];
    for (int k = 0; k < 3; k++)
        d[k] = fmax(fmax(ebpo_world_cell_face(w, k, cell.level, cell.at[k]) - s->point[k],
                         s->point[k] - ebpo_world_cell_face(w, k, cell.level, cell.at[k] + 1)),
                    0);
    return scaled_length(d);
}

/* Adds a cell to the queue if the cell is nearer than the upper bound. */
static ebpo_status push_cell(const boundary_search *s, const ebpo_world *w, queue *q,
                             const ebpo_world_cell *c, ebpo_error *error)
{
    double distance = distance_to(s, w, c->cell) * (1 - 0x1p-46);
    return distance < s->hi ? push_waiting(q, (waiting){ distance, *c }, error) : EBPO_OK;
}

/* All points outside the root cell are out. So if the search is for a point that is out, lowers the
 * upper bound to the distance of the root cell's sides. */
static void bound_by_root_sides(boundary_search *s, const ebpo_world *w)
{
    for (int k = 0; k < 3 && s->state == EBPO_MAY_IN; k++)
        s->hi = fmin(s->hi, fmin(fabs(s->point[k] - w->origin[k]),
                                 fabs(w->origin[k] + w->edge - s->point[k])) *
                                (1 + 0x1p-46));
}

/* Returns true if a mixed cell is to be divided. */
static bool is_divided(const boundary_search *s, const ebpo_world *w, const waiting *at)
{
    int level = at->cell.cell.level;
    return level < w->level && !(ebpo_world_edge(w, level) < s->grain * at->distance);
}

/* Evaluates a cell: drops it, lowers the upper bound, or divides it. *unclear: least distance of
 * all mixed cells that were not divided. */
static ebpo_status settle_cell(boundary_search *s, const ebpo_world *w, queue *q, waiting *at,
                               double *unclear, ebpo_error *error)
{
    unsigned may;
    uint8_t stages[EBPO_CUBE_STAGES] = { 0 }; /* statistics, not used here */
    ebpo_status status = ebpo_world_cell_query(s->boolean, 0, w, &at->cell, &may, stages, error);
    if (status != EBPO_OK || may == s->state)
        return status;
    if (may != EBPO_MAY_BOTH) {
        s->hi = fmin(s->hi, distance_to(s, w, at->cell.cell) * (1 + 0x1p-46));
        return EBPO_OK;
    }
    if (!is_divided(s, w, at)) {
        *unclear = fmin(*unclear, at->distance);
        return EBPO_OK;
    }
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_world_cell child = ebpo_world_child(&at->cell, octant);
        status = push_cell(s, w, q, &child, error);
    }
    return status;
}

/* Returns true if lo and s->hi are within the tolerance of each other. */
static bool is_close(const boundary_search *s, double lo)
{
    return s->hi < INFINITY && s->hi - lo <= s->tolerance * s->hi;
}

/* Evaluates cells, the nearest first, until the bounds are within the tolerance, no nearer cell
 * waits, or the maximum number of cells is reached. Sets s->lo and s->hi. */
static ebpo_status search_cells(boundary_search *s, const ebpo_world *w, queue *q,
                                ebpo_error *error)
{
    const ebpo_world_cell root = { { 0, { 0, 0, 0 } }, 0, 0 };
    double unclear = INFINITY;
    bound_by_root_sides(s, w);
    q->count = 0;
    ebpo_status status = push_cell(s, w, q, &root, error);
    while (status == EBPO_OK && q->count) {
        double nearest = q->list[0].distance;
        if (nearest >= s->hi || is_close(s, fmin(nearest, unclear)) || s->cells >= s->max_cells)
            break;
        waiting at = heap_take(q->list, q->count--);
        s->cells++;
        status = settle_cell(s, w, q, &at, &unclear, error);
    }
    s->lo = fmin(fmax(s->lo, fmin(q->count ? q->list[0].distance : INFINITY, unclear)), s->hi);
    return status;
}

/* Makes the world with the finest level for which corners of cells are exact doubles. */
static ebpo_status make_world(ebpo_world *w, const ebpo_boolean *b, ebpo_error *error)
{
    /* one less than the maximum, because the finest cells' centres are corners of the next level */
    int level = EBPO_BOOLEAN_LEVEL_MAX - 1;
    while (level > 0 && ebpo_world_make(w, b, level, NULL) != EBPO_OK)
        level--;
    return ebpo_world_make(w, b, level, error);
}

/* Does both searches. In the second search, s->grain is 0. */
static ebpo_status search_boundary(boundary_search *s, ebpo_error *error)
{
    ebpo_world w;
    queue q = { NULL, 0, 0 };
    ebpo_status status = make_world(&w, s->boolean, error);
    s->lo = status == EBPO_OK && w.edge > 0 ? 0 : INFINITY;
    s->grain = fmax(s->tolerance, 0x1p-10) / 4;
    for (int i = 0; i < 2 && status == EBPO_OK && s->lo < s->hi && !is_close(s, s->lo); i++) {
        status = search_cells(s, &w, &q, error);
        s->grain = 0;
    }
    free(q.list);
    return status;
}

/* --- the query --- */

typedef struct measuring {
    const ebpo_boolean *b;
    const double *point;
    ebpo_boundary_distance *out;
} measuring;

/* Evaluates a point q. If the state of q differs from the state of the given point, the boundary is
 * not farther away than q. Then the distance of q becomes the upper bound, if it is less. */
static ebpo_status try_point(const measuring *m, const double q[3], ebpo_error *error)
{
    ebpo_boolean_result result;
    const double offset[3] = { q[0] - m->point[0], q[1] - m->point[1], q[2] - m->point[2] };
    double distance = scaled_length(offset) * (1 + 0x1p-46);
    if (!(distance < m->out->hi))
        return EBPO_OK;
    ebpo_status status = ebpo_boolean_query(m->b, 0, q, &result, error);
    if (status == EBPO_OK && result.where != m->out->inside.where && result.where != EBPO_ON)
        m->out->hi = distance;
    return status;
}

/* Tries points slightly behind y, the nearest point of an operand, on the line from the given point
 * through y. y: in the coordinates of the model. */
static ebpo_status try_behind(const measuring *m, const ebpo_posed_solid *s, const double y[3],
                              ebpo_error *error)
{
    static const double factor[] = { 1 + 0x1p-42, 1 + 0x1p-30, 1 + 0x1p-18 };
    double posed[3], q[3];
    ebpo_status status = EBPO_OK;
    ebpo_posing_apply(&s->posing, y, posed);
    for (int i = 0; i < 3 && status == EBPO_OK; i++) {
        for (int k = 0; k < 3; k++)
            q[k] = m->point[k] + (posed[k] - m->point[k]) * factor[i];
        status = try_point(m, q, error);
    }
    return status;
}

/* Sets *lo to a lower bound of the distance of the operand's posed faces, and tries points behind
 * the nearest point of these faces. */
static ebpo_status inspect_operand(const measuring *m, uint32_t operand, double *lo,
                                   ebpo_error *error)
{
    const ebpo_posed_solid *s = &m->b->solid[operand];
    double p[3], error_bound;
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result nearest;
    *lo = 0;
    ebpo_unpose(s, m->point, p, &error_bound);
    if (!(fabs(p[0]) < 0x1p1000 && fabs(p[1]) < 0x1p1000 && fabs(p[2]) < 0x1p1000))
        return EBPO_OK; /* too far away for the query; no bound is known */
    o.unsigned_distance = true;
    ebpo_status status =
        ebpo_distance(ebpo_boolean_context(m->b, 0, operand), p, &o, &nearest, error);
    if (status != EBPO_OK)
        return status;
    *lo = fmax((nearest.lo - error_bound) * s->posing.scale * (1 - 0x1p-46), 0);
    return try_behind(m, s, nearest.point, error);
}

static ebpo_status inspect_operands(const measuring *m, ebpo_error *error)
{
    double least = INFINITY;
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < m->b->count && status == EBPO_OK; i++) {
        double lo;
        status = inspect_operand(m, i, &lo, error);
        least = fmin(least, lo);
    }
    m->out->lo = fmin(least, m->out->hi);
    return status;
}

/* Searches cells for the nearest point whose state is not `state`. hi: known upper bound of its
 * distance, or INFINITY. s: gets the bounds. */
static ebpo_status inspect_cells(const measuring *m, const ebpo_boundary_options *o, unsigned state,
                                 double hi, boundary_search *s, ebpo_error *error)
{
    *s = (boundary_search){ .boolean = m->b,
                            .point = m->point,
                            .state = state,
                            .tolerance = o->tolerance,
                            .max_cells = o->cells ? o->cells : 100000,
                            .hi = hi };
    ebpo_status status = search_boundary(s, error);
    m->out->cells += s->cells;
    return status;
}

/* Measures the distance for a point that is not on the boundary. */
static ebpo_status measure_away_from_boundary(const measuring *m, const ebpo_boundary_options *o,
                                              ebpo_error *error)
{
    boundary_search s;
    ebpo_boundary_distance *out = m->out;
    out->hi = INFINITY;
    ebpo_status status = inspect_operands(m, error);
    bool enough = out->hi < INFINITY && out->hi - out->lo <= o->tolerance * out->hi;
    if (status != EBPO_OK || enough)
        return status;
    unsigned state = out->inside.where == EBPO_IN ? EBPO_MAY_IN : EBPO_MAY_OUT;
    status = inspect_cells(m, o, state, out->hi, &s, error);
    out->hi = s.hi;
    out->lo = fmin(fmax(out->lo, s.lo), s.hi);
    return status;
}

/* Bounds the distance for a point that may be on the boundary, for example on an edge. The nearest
 * inner point and the nearest outer point have different states, so the boundary is not farther
 * away than the farther of these two points. */
static ebpo_status measure_unsure(const measuring *m, const ebpo_boundary_options *o,
                                  ebpo_error *error)
{
    boundary_search nearest_in, nearest_out;
    ebpo_status status = inspect_cells(m, o, EBPO_MAY_OUT, INFINITY, &nearest_in, error);
    if (status == EBPO_OK)
        status = inspect_cells(m, o, EBPO_MAY_IN, INFINITY, &nearest_out, error);
    if (status == EBPO_OK)
        m->out->hi = fmax(nearest_in.hi, nearest_out.hi);
    return status;
}

ebpo_status ebpo_boolean_distance(ebpo_boolean *boolean, const double point[3],
                                  const ebpo_boundary_options *options, ebpo_boundary_distance *out,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_boundary_options checked = EBPO_BOUNDARY_OPTIONS_INIT;
    measuring m = { boolean, point, out };
    *out = (ebpo_boundary_distance){ 0 };
    ebpo_status status = EBPO_TAKE(ebpo_boundary_options, &checked, options, error);
    if (status == EBPO_OK && !(checked.tolerance >= 0))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "expected a tolerance of 0 or more, got %g",
                         checked.tolerance);
    if (status == EBPO_OK)
        status = ebpo_boolean_inside(boolean, point, &out->inside, error);
    if (status != EBPO_OK)
        return status;
    if (out->inside.where == EBPO_ON)
        return out->inside.certain ? EBPO_OK : measure_unsure(&m, &checked, error);
    return measure_away_from_boundary(&m, &checked, error);
}
