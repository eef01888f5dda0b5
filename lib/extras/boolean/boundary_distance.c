/* Computes the distance of a point to the boundary of the result of a boolean expression.
 *
 * The boundary is a part of the operands' faces, so no point of the boundary is nearer than the
 * nearest face. If the result changes just behind that face, the face's distance is the result.
 * Otherwise a search over cells of the world, the nearest first, bounds the distance to the other
 * side. Decided cells end the search. Mixed cells are divided.
 *
 * A first search does not divide cells that are small compared with the tolerance. It finds an
 * upper bound: without this limit, a boundary in front of the nearest decided cell would be divided
 * into too many cells. If the bounds are too wide, a second search divides down to the finest
 * cells. Both searches stop at the maximum number of cells. */
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

typedef struct boundary_search {
    const ebpo_boolean *boolean;
    const double *point;
    unsigned side; /* state of the result at the point: EBPO_MAY_IN or EBPO_MAY_OUT */
    double tolerance;
    double grain;   /* cells smaller than this part of their distance are not divided */
    uint64_t most;  /* maximum number of cells */
    uint64_t cells; /* number of cells so far */
    /* Guaranteed bounds of the distance to the other side. Initially hi is the known bound. Both
     * are INFINITY if there is no other side. */
    double lo, hi;
} boundary_search;

typedef struct waiting {
    double near; /* no point of the cell is nearer */
    ebpo_world_cell cell;
} waiting;

typedef struct queue {
    waiting *list; /* a heap, the nearest first */
    uint64_t count, capacity;
} queue;

static bool is_nearer(const waiting *a, const waiting *b) { return a->near < b->near; }

EBPO_HEAP(heap, waiting, is_nearer)

static ebpo_status push_waiting(queue *q, waiting w, ebpo_error *error)
{
    if (!ebpo_grow(&q->list, &q->capacity, q->count + 1, sizeof *q->list))
        return ebpo_fail_memory(error, (q->count + 1) * sizeof *q->list);
    heap_add(q->list, q->count++, &w);
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

static ebpo_status push_cell(const boundary_search *s, const ebpo_world *w, queue *q,
                             const ebpo_world_cell *c, ebpo_error *error)
{
    double near = distance_to(s, w, c->cell) * (1 - 0x1p-46);
    return near < s->hi ? push_waiting(q, (waiting){ near, *c }, error) : EBPO_OK;
}

/* Takes the region outside the root cell into account, where everything is out. */
static void bound_by_root_sides(boundary_search *s, const ebpo_world *w)
{
    for (int k = 0; k < 3 && s->side == EBPO_MAY_IN; k++)
        s->hi = fmin(s->hi, fmin(fabs(s->point[k] - w->origin[k]),
                                 fabs(w->origin[k] + w->edge - s->point[k])) *
                                (1 + 0x1p-46));
}

static bool is_divided(const boundary_search *s, const ebpo_world *w, const waiting *at)
{
    int level = at->cell.cell.level;
    return level < w->level && !(ebpo_world_edge(w, level) < s->grain * at->near);
}

/* Decides the current cell. *unclear: least distance of mixed cells that are not divided. */
static ebpo_status settle_cell(boundary_search *s, const ebpo_world *w, queue *q, waiting *at,
                               double *unclear, ebpo_error *error)
{
    unsigned may;
    uint8_t stages[EBPO_CUBE_STAGES] = { 0 };
    ebpo_status status = ebpo_world_cell_query(s->boolean, 0, w, &at->cell, &may, stages, error);
    if (status != EBPO_OK || may == s->side)
        return status;
    if (may != EBPO_MAY_BOTH) {
        s->hi = fmin(s->hi, distance_to(s, w, at->cell.cell) * (1 + 0x1p-46));
        return EBPO_OK;
    }
    if (!is_divided(s, w, at)) {
        *unclear = fmin(*unclear, at->near);
        return EBPO_OK;
    }
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_world_cell child = ebpo_world_child(&at->cell, octant);
        status = push_cell(s, w, q, &child, error);
    }
    return status;
}

static bool is_close(const boundary_search *s, double lo)
{
    return s->hi < INFINITY && s->hi - lo <= s->tolerance * s->hi;
}

static ebpo_status search_cells(boundary_search *s, const ebpo_world *w, queue *q,
                                ebpo_error *error)
{
    const ebpo_world_cell root = { { 0, { 0, 0, 0 } }, 0, 0 };
    double unclear = INFINITY;
    bound_by_root_sides(s, w);
    q->count = 0;
    ebpo_status status = push_cell(s, w, q, &root, error);
    while (status == EBPO_OK && q->count) {
        double near = q->list[0].near;
        if (near >= s->hi || is_close(s, fmin(near, unclear)) || s->cells >= s->most)
            break;
        waiting at = heap_take(q->list, q->count--);
        s->cells++;
        status = settle_cell(s, w, q, &at, &unclear, error);
    }
    s->lo = fmin(fmax(s->lo, fmin(q->count ? q->list[0].near : INFINITY, unclear)), s->hi);
    return status;
}

/* Makes the finest world that doubles allow. */
static ebpo_status make_world(ebpo_world *w, const ebpo_boolean *b, ebpo_error *error)
{
    int level = EBPO_BOOLEAN_LEVEL_MAX - 1; /* one level is left for the centres of cells */
    while (level > 0 && ebpo_world_make(w, b, level, NULL) != EBPO_OK)
        level--;
    return ebpo_world_make(w, b, level, error);
}

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
    const double *w;
    ebpo_boundary_distance *out;
} measuring;

/* Tries a point near w: if it is on the other side, the boundary is no farther than this point. */
static ebpo_status try_point(const measuring *m, const double q[3], ebpo_error *error)
{
    ebpo_boolean_result there;
    const double offset[3] = { q[0] - m->w[0], q[1] - m->w[1], q[2] - m->w[2] };
    double away = scaled_length(offset) * (1 + 0x1p-46);
    if (!(away < m->out->hi))
        return EBPO_OK;
    ebpo_status status = ebpo_boolean_query(m->b, 0, q, &there, error);
    if (status == EBPO_OK && there.where != m->out->inside.where && there.where != EBPO_ON)
        m->out->hi = away;
    return status;
}

/* Tries points on the line from w through y, the nearest point of an operand, slightly behind y. */
static ebpo_status try_behind(const measuring *m, const ebpo_posed_solid *s, const double y[3],
                              ebpo_error *error)
{
    static const double part[] = { 1 + 0x1p-42, 1 + 0x1p-30, 1 + 0x1p-18 };
    double posed[3], q[3];
    ebpo_status status = EBPO_OK;
    ebpo_posing_apply(&s->posing, y, posed);
    for (int i = 0; i < 3 && status == EBPO_OK; i++) {
        for (int k = 0; k < 3; k++)
            q[k] = m->w[k] + (posed[k] - m->w[k]) * part[i];
        status = try_point(m, q, error);
    }
    return status;
}

/* Sets *lo to a lower bound of the distance of the operand's posed faces. */
static ebpo_status inspect_operand(const measuring *m, uint32_t operand, double *lo,
                                   ebpo_error *error)
{
    const ebpo_posed_solid *s = &m->b->solid[operand];
    double p[3], doubt;
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result nearest;
    *lo = 0;
    ebpo_unpose(s, m->w, p, &doubt);
    if (!(fabs(p[0]) < 0x1p1000 && fabs(p[1]) < 0x1p1000 && fabs(p[2]) < 0x1p1000))
        return EBPO_OK; /* the point is so far away that its position in the model is not a double
                         */
    o.unsigned_distance = true;
    ebpo_status status =
        ebpo_distance(ebpo_boolean_context(m->b, 0, operand), p, &o, &nearest, error);
    if (status != EBPO_OK)
        return status;
    *lo = fmax((nearest.lo - doubt) * s->posing.scale * (1 - 0x1p-46), 0);
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

static ebpo_status inspect_cells(const measuring *m, const ebpo_boundary_options *o, unsigned side,
                                 double hi, boundary_search *s, ebpo_error *error)
{
    *s = (boundary_search){ .boolean = m->b,
                            .point = m->w,
                            .side = side,
                            .tolerance = o->tolerance,
                            .most = o->cells ? o->cells : 100000,
                            .hi = hi };
    ebpo_status status = search_boundary(s, error);
    m->out->cells += s->cells;
    return status;
}

static ebpo_status measure_off(const measuring *m, const ebpo_boundary_options *o,
                               ebpo_error *error)
{
    boundary_search s;
    ebpo_boundary_distance *out = m->out;
    out->hi = INFINITY;
    ebpo_status status = inspect_operands(m, error);
    bool enough = out->hi < INFINITY && out->hi - out->lo <= o->tolerance * out->hi;
    if (status != EBPO_OK || enough)
        return status;
    unsigned side = out->inside.where == EBPO_IN ? EBPO_MAY_IN : EBPO_MAY_OUT;
    status = inspect_cells(m, o, side, out->hi, &s, error);
    out->hi = s.hi;
    out->lo = fmin(fmax(out->lo, s.lo), s.hi);
    return status;
}

/* Handles a point that may be on the boundary, for example on edges: the boundary is no farther
 * than a point that is in, nor than a point that is out. */
static ebpo_status measure_unsure(const measuring *m, const ebpo_boundary_options *o,
                                  ebpo_error *error)
{
    boundary_search in, out;
    ebpo_status status = inspect_cells(m, o, EBPO_MAY_OUT, INFINITY, &in, error);
    if (status == EBPO_OK)
        status = inspect_cells(m, o, EBPO_MAY_IN, INFINITY, &out, error);
    if (status == EBPO_OK)
        m->out->hi = fmax(in.hi, out.hi);
    return status;
}

ebpo_status ebpo_boolean_distance(ebpo_boolean *boolean, const double point[3],
                                  const ebpo_boundary_options *options, ebpo_boundary_distance *out,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_boundary_options wanted = EBPO_BOUNDARY_OPTIONS_INIT;
    measuring m = { boolean, point, out };
    *out = (ebpo_boundary_distance){ 0 };
    ebpo_status status = EBPO_TAKE(ebpo_boundary_options, &wanted, options, error);
    if (status == EBPO_OK && !(wanted.tolerance >= 0))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "tolerance %g: give 0 or more", wanted.tolerance);
    if (status == EBPO_OK)
        status = ebpo_boolean_inside(boolean, point, &out->inside, error);
    if (status != EBPO_OK)
        return status;
    if (out->inside.where == EBPO_ON)
        return out->inside.certain ? EBPO_OK : measure_unsure(&m, &wanted, error);
    return measure_off(&m, &wanted, error);
}
