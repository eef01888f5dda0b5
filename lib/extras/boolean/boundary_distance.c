/* The boundary is a part of the operands' faces: no point of it is nearer than the nearest face. If
 * the result changes just behind that face, no more is needed. */
#include "core/strict_fp.h"

#include <math.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "extras/boolean/boundary_search.h"

typedef struct measuring {
    const ebpo_boolean *b;
    const double *w;
    ebpo_boundary_distance *out;
} measuring;

/* A point beside w, if it is on the other side: the boundary is no farther. */
static ebpo_status try_point(const measuring *m, const double q[3], ebpo_error *error)
{
    ebpo_boolean_result there;
    const double way[3] = { q[0] - m->w[0], q[1] - m->w[1], q[2] - m->w[2] };
    double away = ebpo_length(way) * (1 + 0x1p-46);
    if (!(away < m->out->hi))
        return EBPO_OK;
    ebpo_status status = ebpo_boolean_ask(m->b, 0, q, &there, error);
    if (status == EBPO_OK && there.where != m->out->inside.where && there.where != EBPO_ON)
        m->out->hi = away;
    return status;
}

/* Through the nearest point y of an operand and a little farther. */
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

/* *lo: no posed face of the operand is nearer. */
static ebpo_status look_at_operand(const measuring *m, uint32_t operand, double *lo,
                                   ebpo_error *error)
{
    const ebpo_posed_solid *s = &m->b->solid[operand];
    double p[3], doubt;
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result nearest;
    *lo = 0;
    ebpo_unpose(s, m->w, p, &doubt);
    if (!(fabs(p[0]) < 0x1p1000 && fabs(p[1]) < 0x1p1000 && fabs(p[2]) < 0x1p1000))
        return EBPO_OK; /* so far away that its place in the model is no double */
    o.unsigned_distance = true;
    ebpo_status status =
        ebpo_distance(ebpo_boolean_context(m->b, 0, operand), p, &o, &nearest, error);
    if (status != EBPO_OK)
        return status;
    *lo = fmax((nearest.lo - doubt) * s->posing.scale * (1 - 0x1p-46), 0);
    return try_behind(m, s, nearest.point, error);
}

static ebpo_status look_at_operands(const measuring *m, ebpo_error *error)
{
    double least = INFINITY;
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < m->b->count && status == EBPO_OK; i++) {
        double lo;
        status = look_at_operand(m, i, &lo, error);
        least = fmin(least, lo);
    }
    m->out->lo = fmin(least, m->out->hi);
    return status;
}

static ebpo_status look_at_cells(const measuring *m, const ebpo_boundary_options *o, unsigned side,
                                 double hi, ebpo_boundary_search *s, ebpo_error *error)
{
    *s = (ebpo_boundary_search){ .boolean = m->b,
                                 .point = m->w,
                                 .side = side,
                                 .tolerance = o->tolerance,
                                 .most = o->cells ? o->cells : 100000,
                                 .hi = hi };
    ebpo_status status = ebpo_boundary_search_run(s, error);
    m->out->cells += s->cells;
    return status;
}

static ebpo_status measure_off(const measuring *m, const ebpo_boundary_options *o,
                               ebpo_error *error)
{
    ebpo_boundary_search s;
    ebpo_boundary_distance *out = m->out;
    out->hi = INFINITY;
    ebpo_status status = look_at_operands(m, error);
    bool enough = out->hi < INFINITY && out->hi - out->lo <= o->tolerance * out->hi;
    if (status != EBPO_OK || enough)
        return status;
    unsigned side = out->inside.where == EBPO_IN ? EBPO_MAY_IN : EBPO_MAY_OUT;
    status = look_at_cells(m, o, side, out->hi, &s, error);
    out->hi = s.hi;
    out->lo = fmin(fmax(out->lo, s.lo), s.hi);
    return status;
}

/* On edges, perhaps: the boundary is no farther than what is in, nor than what is out. */
static ebpo_status measure_unsure(const measuring *m, const ebpo_boundary_options *o,
                                  ebpo_error *error)
{
    ebpo_boundary_search in, out;
    ebpo_status status = look_at_cells(m, o, EBPO_MAY_OUT, INFINITY, &in, error);
    if (status == EBPO_OK)
        status = look_at_cells(m, o, EBPO_MAY_IN, INFINITY, &out, error);
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
