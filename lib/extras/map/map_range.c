/* Computes guaranteed bounds of the greatest distance from a mesh's faces, including their
 * interior, to a model (a one-sided Hausdorff distance).
 *
 * Branch and bound over triangles, which are divided into four. When a point moves, its distance
 * changes by at most the length of the motion. So the distance of each point of a triangle is at
 * most the distance of a corner plus the greatest length from that corner. In each round the
 * triangles with the greatest bounds are divided together, so the result does not depend on
 * threads. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/map/map_lattice.h"

/* Number of faces evaluated together, and maximum number of triangles of a round. Beyond that
 * number, triangles are not divided and keep their bounds. */
enum { FACES_AT_A_TIME = 1 << 17, TRIANGLES_MAX = 1 << 20 };

typedef struct triangle {
    double corner[3][3], away[3]; /* `away`: unsigned distances of the corners */
    double upper;
} triangle;

typedef struct triangles {
    triangle *item;
    uint64_t count, capacity;
} triangles;

typedef struct search {
    ebpo_map_queries queries;
    const ebpo_mesh *mesh;
    const double *distances;
    ebpo_map_range_options o;
    double slack; /* more than the effect of rounding on positions and lengths */
    ebpo_map_range reach;
    uint64_t allowed; /* maximum number of queries until the current faces are done */
    triangles now, next;
    uint64_t cut;                              /* number of triangles, the first ones of `now`, that
                                                * this round divides */
    double (*middle)[3][3], (*middle_away)[3]; /* [cut] middle of the edge after each corner, and
                                                * its distance */
    uint64_t middle_capacity, away_capacity;
} search;

static double distance_above(const double a[3], const double b[3])
{
    double d[3] = { a[0] - b[0], a[1] - b[1], a[2] - b[2] };
    double most = fmax(fabs(d[0]), fmax(fabs(d[1]), fabs(d[2])));
    if (most == 0 || isinf(most)) /* the distance overflows a double */
        return most;
    for (int c = 0; c < 3; c++)
        d[c] /= most;
    return most * sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) * (1 + 0x1p-48);
}

static void reach_bound(const search *s, triangle *t)
{
    double edge[3];
    t->upper = INFINITY;
    for (int k = 0; k < 3; k++)
        edge[k] = distance_above(t->corner[k], t->corner[(k + 1) % 3]);
    for (int k = 0; k < 3; k++)
        t->upper = fmin(t->upper, t->away[k] + fmax(edge[k], edge[(k + 2) % 3]));
    t->upper += s->slack;
}

static bool needs_division(const search *s, double upper)
{
    return upper > s->reach.lo * (1 + s->o.tolerance) && upper > s->reach.hi;
}

/* Keeps a triangle for the next round. If there are too many, its bound is final. */
static ebpo_status keep_triangle(search *s, triangles *list, const triangle *t, ebpo_error *error)
{
    if (!needs_division(s, t->upper))
        return EBPO_OK;
    if (list->count == TRIANGLES_MAX || s->reach.queries >= s->allowed) {
        s->reach.hi = fmax(s->reach.hi, t->upper);
        return EBPO_OK;
    }
    if (!ebpo_grow(&list->item, &list->capacity, list->count + 1, sizeof *list->item))
        return ebpo_fail_memory(error, (list->count + 1) * sizeof *list->item);
    list->item[list->count++] = *t;
    return EBPO_OK;
}

static void raise_lower_bound(search *s, double away, const double location[3])
{
    if (away <= s->reach.lo)
        return;
    s->reach.lo = away;
    memcpy(s->reach.location, location, sizeof s->reach.location);
}

/* --- a round --- */

static ebpo_status query_middles(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    search *s = context;
    ebpo_distance_result results[3 * 256];
    for (uint64_t i = begin; i < end; i++)
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++)
                s->middle[i][k][c] =
                    s->now.item[i].corner[k][c] / 2 + s->now.item[i].corner[(k + 1) % 3][c] / 2;
    ebpo_status status =
        ebpo_map_query(&s->queries, worker, s->middle[begin][0], 3 * (end - begin), results, error);
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        for (int k = 0; k < 3; k++)
            s->middle_away[i][k] = fabs(results[3 * (i - begin) + (uint64_t)k].distance);
    return status;
}

static void child_of(const search *s, uint64_t i, int which, triangle *out)
{
    const triangle *t = &s->now.item[i];
    for (int k = 0; k < 3; k++) {
        bool corner = which < 3 && k == which; /* otherwise it is the middle of an adjacent edge */
        int edge = which == 3 ? k : k == (which + 1) % 3 ? which : (which + 2) % 3;
        memcpy(out->corner[k], corner ? t->corner[k] : s->middle[i][edge], sizeof out->corner[k]);
        out->away[k] = corner ? t->away[k] : s->middle_away[i][edge];
    }
}

/* Moves triangles with bounds of at least half of the greatest one to the front: dividing other
 * triangles does not help yet. */
static void choose_triangles(search *s)
{
    double most = 0;
    uint64_t left = s->allowed > s->reach.queries ? s->allowed - s->reach.queries : 0;
    s->cut = 0;
    for (uint64_t i = 0; i < s->now.count; i++)
        most = fmax(most, s->now.item[i].upper);
    for (uint64_t i = 0; i < s->now.count && 3 * s->cut < left; i++)
        if (s->now.item[i].upper >= most / 2) {
            triangle t = s->now.item[i];
            s->now.item[i] = s->now.item[s->cut];
            s->now.item[s->cut++] = t;
        }
}

static ebpo_status reach_cut(search *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    s->reach.queries += 3 * s->cut;
    for (uint64_t i = 0; i < s->cut; i++)
        for (int k = 0; k < 3; k++)
            raise_lower_bound(s, s->middle_away[i][k] - s->slack, s->middle[i][k]);
    s->next.count = 0;
    for (uint64_t i = 0; i < s->cut && status == EBPO_OK; i++)
        for (int which = 0; which < 4 && status == EBPO_OK; which++) {
            triangle t;
            child_of(s, i, which, &t);
            reach_bound(s, &t);
            status = keep_triangle(s, &s->next, &t, error);
        }
    for (uint64_t i = s->cut; i < s->now.count && status == EBPO_OK; i++)
        status = keep_triangle(s, &s->next, &s->now.item[i], error);
    triangles old = s->now;
    s->now = s->next;
    s->next = old;
    return status;
}

static ebpo_status reach_refine(search *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_progress none = { NULL, NULL };
    while (status == EBPO_OK && s->now.count) {
        choose_triangles(s);
        if (!ebpo_grow(&s->middle, &s->middle_capacity, s->cut, sizeof *s->middle) ||
            !ebpo_grow(&s->middle_away, &s->away_capacity, s->cut, sizeof *s->middle_away))
            return ebpo_fail_memory(error, s->cut * sizeof *s->middle);
        status = ebpo_parallel_for(s->queries.threads, NULL, s->cut, 256, query_middles, s, &none,
                                   "", error);
        if (status == EBPO_OK)
            status = reach_cut(s, error);
    }
    return status;
}

/* --- all faces --- */

static void corner_of(const ebpo_mesh *m, uint32_t vertex, double out[3])
{
    for (uint64_t c = 0; c < 3; c++)
        out[c] = m->xyz32 ? (double)m->xyz32[3 * (uint64_t)vertex + c]
                          : m->xyz64[3 * (uint64_t)vertex + c];
}

static ebpo_status inspect_faces(search *s, uint64_t begin, uint64_t end, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    double share = (double)end / (double)s->mesh->face_count; /* share of the faces that are done
                                                               * after this piece */
    s->allowed =
        end == s->mesh->face_count ? s->o.queries : (uint64_t)((double)s->o.queries * share);
    s->now.count = 0;
    for (uint64_t f = begin; f < end && status == EBPO_OK; f++) {
        triangle t;
        for (int k = 0; k < 3; k++) {
            uint32_t v = s->mesh->faces[3 * f + (uint64_t)k];
            corner_of(s->mesh, v, t.corner[k]);
            t.away[k] = fabs(s->distances[v]);
        }
        reach_bound(s, &t);
        status = keep_triangle(s, &s->now, &t, error);
    }
    return status == EBPO_OK ? reach_refine(s, error) : status;
}

static ebpo_status search_all(search *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    const ebpo_mesh *m = s->mesh;
    for (uint64_t f = 0; f < m->face_count; f += FACES_AT_A_TIME) {
        uint64_t end = f + FACES_AT_A_TIME < m->face_count ? f + FACES_AT_A_TIME : m->face_count;
        if (!ebpo_progress_step(&s->o.progress, "bounding between vertices", f, m->face_count,
                                error))
            return EBPO_E_CANCELLED;
        status = inspect_faces(s, f, end, error);
        if (status != EBPO_OK)
            return status;
    }
    s->reach.hi = fmax(s->reach.hi, s->reach.lo * (1 + s->o.tolerance) + s->slack);
    return EBPO_OK;
}

/* Evaluates the vertices, and sets the rounding margin. */
static ebpo_status reach_begin(search *s, ebpo_error *error)
{
    const ebpo_mesh *m = s->mesh;
    double most = 0;
    for (uint64_t f = 0; f < m->face_count; f++)
        for (int k = 0; k < 3; k++) {
            uint32_t v = m->faces[3 * f + (uint64_t)k];
            double p[3];
            if (v >= m->vertex_count || !isfinite(s->distances[v]))
                return ebpo_fail(error, EBPO_E_ARGUMENT,
                                 "face %" PRIu64
                                 " has a corner that is not a vertex index, or a vertex with a "
                                 "non-finite distance",
                                 f);
            corner_of(m, v, p);
            most = fmax(most, fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2]))));
            raise_lower_bound(s, fabs(s->distances[v]), p);
        }
    s->slack = most * 0x1p-49 + 0x1p-1060;
    return EBPO_OK;
}

static ebpo_status reach_take(search *s, const ebpo_map_range_options *given, ebpo_error *error)
{
    s->o = (ebpo_map_range_options)EBPO_MAP_RANGE_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_map_range_options, &s->o, given, error);
    if (status == EBPO_OK && !(s->o.tolerance > 0 && isfinite(s->o.tolerance)))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the tolerance must be finite and above 0");
    if (s->o.queries == 0)
        s->o.queries = 16 * s->mesh->face_count;
    return status;
}

ebpo_status ebpo_map_find_range(ebpo_model *model, const ebpo_mesh *mesh, const double *distances,
                                const ebpo_map_range_options *options, ebpo_map_range *out,
                                ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_map_options query_options = EBPO_MAP_OPTIONS_INIT;
    search s = { .mesh = mesh, .distances = distances };
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_map_range, out, error);
    if (status == EBPO_OK)
        status = reach_take(&s, options, error);
    if (status == EBPO_OK)
        status = reach_begin(&s, error);
    if (status != EBPO_OK)
        return status;
    query_options.unsigned_distance = true;
    query_options.threads = s.o.threads;
    status = ebpo_map_queries_make(&s.queries, model, &query_options, error);
    if (status == EBPO_OK)
        status = search_all(&s, error);
    ebpo_map_queries_free(&s.queries);
    free(s.now.item);
    free(s.next.item);
    free(s.middle);
    free(s.middle_away);
    return status == EBPO_OK ? EBPO_GIVE(ebpo_map_range, out, &s.reach) : status;
}
