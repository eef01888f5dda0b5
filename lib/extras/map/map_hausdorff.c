/* Computes guaranteed bounds of the greatest distance from a mesh's faces, including their
 * interior, to a model (a one-sided Hausdorff distance).
 *
 * The method is branch and bound over triangles, which are divided into four quarters at the
 * middles of their edges. If a point moves, its distance from the model changes by at most the
 * length of the move. So the distance of each point of a triangle is at most the distance of a
 * corner plus the length of the longer edge at this corner. This sum is the triangle's bound. Faces
 * are searched in batches, and a batch in rounds. A round divides all triangles whose bounds are
 * large. The choice of these triangles does not depend on the number of threads, so the result does
 * not depend on this number, either. */
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

enum {
    BATCH_FACES = 1 << 17,   /* number of faces that are searched together (a batch) */
    TRIANGLES_MAX = 1 << 20, /* greatest number of triangles in the list of a round; triangles
                                beyond this number are not divided, and their bounds are final */
    PIECE_TRIANGLES = 256    /* number of triangles that a thread divides at a time */
};

/* A face, or a part of a face that divisions have made. */
typedef struct triangle {
    double corner[3][3]; /* positions */
    double distance[3];  /* unsigned distance of each corner from the model */
    double upper;        /* upper bound of the distance of the triangle's points */
} triangle;

typedef struct triangles {
    triangle *item;
    uint64_t count, capacity;
} triangles;

typedef struct search {
    ebpo_map_queries queries;
    const ebpo_mesh *mesh;
    const double *distances; /* [mesh->vertex_count] signed or unsigned distance of each vertex */
    ebpo_map_hausdorff_options options; /* the caller's options, or the defaults */
    double slack;             /* upper bound of the rounding errors of positions and lengths */
    ebpo_map_hausdorff range; /* bounds of the result found so far */
    uint64_t allowed; /* no division begins in the current batch when range.queries has reached this
                         value */
    triangles current, next; /* triangles of this round and of the next round */
    uint64_t divided; /* number of triangles that this round divides; they are the first triangles
                         of `current` */
    double (*middle)[3][3];       /* [divided] middles of the edges from each corner to the next */
    double (*middle_distance)[3]; /* [divided] distances of the middles from the model */
    uint64_t middle_capacity, distance_capacity; /* of middle and middle_distance, in triangles */
} search;

/* Returns an upper bound of the distance of two points: the factor 1 + 2^-48 covers rounding. */
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

/* Sets the upper bound of a triangle. */
static void set_upper_bound(const search *s, triangle *t)
{
    double edge[3];
    t->upper = INFINITY;
    for (int k = 0; k < 3; k++)
        edge[k] = distance_above(t->corner[k], t->corner[(k + 1) % 3]);
    for (int k = 0; k < 3; k++)
        t->upper = fmin(t->upper, t->distance[k] + fmax(edge[k], edge[(k + 2) % 3]));
    t->upper += s->slack;
}

/* Returns true if a triangle with this upper bound must be divided. The upper bound is then greater
 * than the result's lower bound by more than the tolerance, and greater than all bounds that are
 * final. */
static bool needs_division(const search *s, double upper)
{
    return upper > s->range.lo * (1 + s->options.tolerance) && upper > s->range.hi;
}

/* Adds a triangle to a list of triangles, if the triangle must be divided. If the list is full or
 * no more queries are allowed, makes the triangle's bound final and does not add the triangle. */
static ebpo_status keep_triangle(search *s, triangles *list, const triangle *t, ebpo_error *error)
{
    if (!needs_division(s, t->upper))
        return EBPO_OK;
    if (list->count == TRIANGLES_MAX || s->range.queries >= s->allowed) {
        s->range.hi = fmax(s->range.hi, t->upper);
        return EBPO_OK;
    }
    if (!ebpo_grow(&list->item, &list->capacity, list->count + 1, sizeof *list->item))
        return ebpo_fail_memory(error, (list->count + 1) * sizeof *list->item);
    list->item[list->count++] = *t;
    return EBPO_OK;
}

/* Raises the lower bound of the result to the distance of a point, if this distance is greater. */
static void raise_lower_bound(search *s, double distance, const double location[3])
{
    if (distance <= s->range.lo)
        return;
    s->range.lo = distance;
    memcpy(s->range.location, location, sizeof s->range.location);
}

/* --- a round --- */

/* Computes the middles of the edges of triangles begin .. end - 1, and the middles' distances. */
static ebpo_status query_middles(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    search *s = context;
    ebpo_distance_result results[3 * PIECE_TRIANGLES];
    for (uint64_t i = begin; i < end; i++)
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++)
                s->middle[i][k][c] = s->current.item[i].corner[k][c] / 2 +
                                     s->current.item[i].corner[(k + 1) % 3][c] / 2;
    ebpo_status status =
        ebpo_map_query(&s->queries, worker, s->middle[begin][0], 3 * (end - begin), results, error);
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        for (int k = 0; k < 3; k++)
            s->middle_distance[i][k] = fabs(results[3 * (i - begin) + (uint64_t)k].distance);
    return status;
}

/* Makes a quarter of triangle i. which: 0 to 2 for the quarter at this corner, or 3 for the quarter
 * in the middle. Edge e leads from corner e to the next corner. */
static void quarter_of(const search *s, uint64_t i, int which, triangle *out)
{
    const triangle *t = &s->current.item[i];
    for (int k = 0; k < 3; k++) {
        bool is_corner = k == which; /* false: the quarter's corner k is the middle of an edge */
        int edge = which == 3 ? k : k == (which + 1) % 3 ? which : (which + 2) % 3;
        memcpy(out->corner[k], is_corner ? t->corner[k] : s->middle[i][edge],
               sizeof out->corner[k]);
        out->distance[k] = is_corner ? t->distance[k] : s->middle_distance[i][edge];
    }
}

/* Chooses the triangles that this round divides, moves them to the front of s->current, and sets
 * s->divided to their number. These are triangles whose bounds are at least half of the greatest
 * bound, because dividing triangles with smaller bounds does not lower the greatest bound. A
 * division needs three queries, and the remaining number of queries limits the number of
 * divisions. */
static void choose_triangles(search *s)
{
    double most = 0;
    uint64_t remaining = s->allowed > s->range.queries ? s->allowed - s->range.queries : 0;
    s->divided = 0;
    for (uint64_t i = 0; i < s->current.count; i++)
        most = fmax(most, s->current.item[i].upper);
    for (uint64_t i = 0; i < s->current.count && 3 * s->divided < remaining; i++)
        if (s->current.item[i].upper >= most / 2) {
            triangle t = s->current.item[i];
            s->current.item[i] = s->current.item[s->divided];
            s->current.item[s->divided++] = t;
        }
}

/* Replaces the triangles that this round divides by their quarters, and omits each triangle that
 * need not be divided any more. */
static ebpo_status divide_triangles(search *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    s->range.queries += 3 * s->divided;
    for (uint64_t i = 0; i < s->divided; i++)
        for (int k = 0; k < 3; k++)
            raise_lower_bound(s, s->middle_distance[i][k] - s->slack, s->middle[i][k]);
    s->next.count = 0;
    for (uint64_t i = 0; i < s->divided && status == EBPO_OK; i++)
        for (int which = 0; which < 4 && status == EBPO_OK; which++) {
            triangle t;
            quarter_of(s, i, which, &t);
            set_upper_bound(s, &t);
            status = keep_triangle(s, &s->next, &t, error);
        }
    for (uint64_t i = s->divided; i < s->current.count && status == EBPO_OK; i++)
        status = keep_triangle(s, &s->next, &s->current.item[i], error);
    triangles old = s->current;
    s->current = s->next;
    s->next = old;
    return status;
}

/* Divides the triangles of s->current in rounds, until no triangle must be divided. */
static ebpo_status refine_triangles(search *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_progress none = { NULL, NULL };
    while (status == EBPO_OK && s->current.count) {
        choose_triangles(s);
        if (!ebpo_grow(&s->middle, &s->middle_capacity, s->divided, sizeof *s->middle) ||
            !ebpo_grow(&s->middle_distance, &s->distance_capacity, s->divided,
                       sizeof *s->middle_distance))
            return ebpo_fail_memory(error, s->divided * sizeof *s->middle);
        status = ebpo_parallel_for(s->queries.threads, NULL, s->divided, PIECE_TRIANGLES,
                                   query_middles, s, &none, "", error);
        if (status == EBPO_OK)
            status = divide_triangles(s, error);
    }
    return status;
}

/* --- all faces --- */

/* Gets the position of a vertex. */
static void corner_of(const ebpo_mesh *m, uint32_t vertex, double out[3])
{
    for (uint64_t c = 0; c < 3; c++)
        out[c] = m->xyz32 ? (double)m->xyz32[3 * (uint64_t)vertex + c]
                          : m->xyz64[3 * (uint64_t)vertex + c];
}

/* Searches a batch: faces begin .. end - 1. Each batch may use a share of the allowed queries in
 * proportion to its number of faces. */
static ebpo_status search_batch(search *s, uint64_t begin, uint64_t end, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    /* share of the faces that have been searched at the end of this batch */
    double share = (double)end / (double)s->mesh->face_count;
    s->allowed = end == s->mesh->face_count ? s->options.queries
                                            : (uint64_t)((double)s->options.queries * share);
    s->current.count = 0;
    for (uint64_t f = begin; f < end && status == EBPO_OK; f++) {
        triangle t;
        for (int k = 0; k < 3; k++) {
            uint32_t v = s->mesh->faces[3 * f + (uint64_t)k];
            corner_of(s->mesh, v, t.corner[k]);
            t.distance[k] = fabs(s->distances[v]);
        }
        set_upper_bound(s, &t);
        status = keep_triangle(s, &s->current, &t, error);
    }
    return status == EBPO_OK ? refine_triangles(s, error) : status;
}

/* Searches all faces in batches, and completes the bounds in s->range. */
static ebpo_status search_all(search *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    const ebpo_mesh *m = s->mesh;
    for (uint64_t f = 0; f < m->face_count; f += BATCH_FACES) {
        uint64_t end = f + BATCH_FACES < m->face_count ? f + BATCH_FACES : m->face_count;
        if (!ebpo_progress_step(&s->options.progress, "searching faces", f, m->face_count, error))
            return EBPO_E_CANCELLED;
        status = search_batch(s, f, end, error);
        if (status != EBPO_OK)
            return status;
    }
    /* triangles that were not divided because of the tolerance have at most this bound */
    s->range.hi = fmax(s->range.hi, s->range.lo * (1 + s->options.tolerance) + s->slack);
    return EBPO_OK;
}

/* Checks the faces, sets the result's lower bound to the greatest distance of a vertex, and sets
 * s->slack. */
static ebpo_status begin_search(search *s, ebpo_error *error)
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
                                 " has a vertex index that is out of range, or a vertex with a "
                                 "distance that is not finite",
                                 f);
            corner_of(m, v, p);
            most = fmax(most, fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2]))));
            raise_lower_bound(s, fabs(s->distances[v]), p);
        }
    s->slack = most * 0x1p-49 + 0x1p-1060; /* the second number covers subnormal numbers */
    return EBPO_OK;
}

/* Sets s->options to the caller's options, or to the defaults if `given` is NULL, and checks them.
 */
static ebpo_status check_hausdorff_options(search *s, const ebpo_map_hausdorff_options *given,
                                           ebpo_error *error)
{
    s->options = (ebpo_map_hausdorff_options)EBPO_MAP_HAUSDORFF_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_map_hausdorff_options, &s->options, given, error);
    if (status == EBPO_OK && !(s->options.tolerance > 0 && isfinite(s->options.tolerance)))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "expected a tolerance that is finite and above 0");
    if (s->options.queries == 0)
        s->options.queries = 16 * s->mesh->face_count;
    return status;
}

ebpo_status ebpo_map_bound_hausdorff(ebpo_model *model, const ebpo_mesh *mesh,
                                     const double *distances,
                                     const ebpo_map_hausdorff_options *options,
                                     ebpo_map_hausdorff *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_map_options query_options = EBPO_MAP_OPTIONS_INIT;
    search s = { .mesh = mesh, .distances = distances };
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_map_hausdorff, out, error);
    if (status == EBPO_OK)
        status = check_hausdorff_options(&s, options, error);
    if (status == EBPO_OK)
        status = begin_search(&s, error);
    if (status != EBPO_OK)
        return status;
    query_options.unsigned_distance = true;
    query_options.threads = s.options.threads;
    status = ebpo_map_queries_make(&s.queries, model, &query_options, error);
    if (status == EBPO_OK)
        status = search_all(&s, error);
    ebpo_map_queries_free(&s.queries);
    free(s.current.item);
    free(s.next.item);
    free(s.middle);
    free(s.middle_distance);
    return status == EBPO_OK ? EBPO_GIVE(ebpo_map_hausdorff, out, &s.range) : status;
}
