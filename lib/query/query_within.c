/* Returns the faces within a distance of a point, one after the other, the nearest first. The order
 * is exact: by distance, then by index in the file.
 *
 * Faces are found in bands. A band has a limited number of faces: the next faces in this order,
 * after the last face of the previous band. So a stream of any length needs little memory. The
 * first band is small, for callers that need few faces. The search for a band is depth first, the
 * nearest child first. The search skips nodes and faces that are certainly beyond the band's limit,
 * or certainly in an earlier band. Subtrees that are not in memory are loaded in the order of
 * guaranteed lower bounds of their distance, until the next bound is beyond the band. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "query/accel.h"
#include "query/load_ahead.h"
#include "query/nearest.h"
#include "query/query_model.h"
#include "query/query_node.h"

/* --- bands --- */

/* A face, and bounds of its distance from p. */
typedef struct near_face {
    const double *p; /* the query point */
    ebpo_distance_bounds bounds;
    uint64_t file_face; /* index in the file */
    double triangle[3][3];
} near_face;

typedef struct near_band {
    double p[3];
    double radius;      /* faces at a greater distance are in no band; compared exactly */
    double limit;       /* faces that are certainly farther are not in this band */
    uint64_t faces_max; /* maximum number of faces in the band, at least 1 */
    bool has_after;     /* faces up to and including `after` were in earlier bands */
    near_face after;
    near_face *near; /* [count] candidates; after near_band_settle, the band's faces in order */
    uint64_t count, capacity;
    bool cut; /* there may be faces within the radius after the band's last face */
    bool no_memory;
} near_band;

/* Returns true if all faces at a distance of at most `far` were in earlier bands. */
static inline bool near_band_is_past(const near_band *band, double far)
{
    return band->has_after && far < band->after.bounds.lo;
}

/* Prepares the search for a band; keeps `after` and the allocated memory. */
static void near_band_begin(near_band *band, uint64_t faces_max)
{
    band->limit = band->radius;
    band->faces_max = faces_max;
    band->count = 0;
    band->cut = false;
}

/* --- order --- */

/* Compares by exact distance, then by index in the file. */
static int compare_faces(const void *x, const void *y)
{
    const near_face *a = x, *b = y;
    if (a->file_face == b->file_face)
        return 0;
    int sign = ebpo_near_compare(a->p, (const double(*)[3])a->triangle, &a->bounds,
                                 (const double(*)[3])b->triangle, &b->bounds);
    return sign ? sign : a->file_face < b->file_face ? -1 : 1;
}

/* Sorts the candidates, removes duplicates, and keeps the nearest band->faces_max candidates. If
 * there are band->faces_max candidates, lowers the limit to the distance of the last candidate. */
static void near_band_settle(near_band *band)
{
    uint64_t kept = 0;
    if (band->count)
        qsort(band->near, band->count, sizeof *band->near, compare_faces);
    for (uint64_t i = 0; i < band->count; i++)
        if (kept == 0 || band->near[i].file_face != band->near[kept - 1].file_face)
            band->near[kept++] = band->near[i];
    band->count = kept < band->faces_max ? kept : band->faces_max;
    if (band->count < band->faces_max)
        return;
    band->limit = fmin(band->limit, band->near[band->count - 1].bounds.hi);
    band->cut = true;
}

/* --- faces --- */

/* Adds a face to the candidates. When there are about twice as many candidates as the band can
 * have, calls near_band_settle. */
static void add_face(near_band *band, const near_face *face)
{
    enum { SPARE_LEAST = 64 };
    uint64_t spare = band->faces_max < SPARE_LEAST ? SPARE_LEAST : band->faces_max;
    if (band->count == band->faces_max + spare)
        near_band_settle(band);
    if (!ebpo_grow(&band->near, &band->capacity, band->count + 1, sizeof *band->near))
        band->no_memory = true;
    else
        band->near[band->count++] = *face;
}

/* Adds the face of a slot to the candidates, unless the slot is empty, or the face is beyond the
 * limit or in an earlier band. */
static void try_face(near_band *band, const ebpo_accel *s, uint32_t slot)
{
    near_face face;
    uint32_t local = ebpo_accel_slot_face(s, slot);
    if (local == EBPO_NO_SLOT || band->no_memory)
        return;
    ebpo_accel_triangle(s, slot, face.triangle);
    ebpo_triangle_distance_bounds(band->p, (const double(*)[3])face.triangle, &face.bounds);
    if (face.bounds.lo > band->limit || near_band_is_past(band, face.bounds.hi))
        return;
    face.p = band->p;
    face.file_face = ebpo_accel_file_face(s, local);
    if (band->has_after && compare_faces(&face, &band->after) <= 0)
        return;
    if (face.bounds.hi > band->radius &&
        ebpo_triangle_distance_compare_to(band->p, (const double(*)[3])face.triangle,
                                          band->radius) > 0)
        return;
    add_face(band, &face);
}

/* --- the hierarchy --- */

typedef struct searching {
    near_band *band;
    const ebpo_accel *s;
    double error; /* bound of the rounding error of distances to the hierarchy's boxes */
} searching;

/* Returns the length of a vector with coordinates >= 0, without overflow of squares. */
static double length_of_positive(const double x[3])
{
    double greatest = fmax(x[0], fmax(x[1], x[2]));
    if (!(greatest > 0))
        return 0;
    double a = x[0] / greatest, b = x[1] / greatest, c = x[2] / greatest;
    return greatest * sqrt(a * a + b * b + c * c);
}

/* Computes guaranteed bounds of the distances of the points of a child's box. */
static void box_bounds(const searching *g, const ebpo_bound *b, int lane, double *lower,
                       double *upper)
{
    const double *p = g->band->p;
    double near[3], far[3];
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides sides = ebpo_bound_side(b, lane, k);
        double low = g->s->centre[k] + sides.low / g->s->scale,
               high = g->s->centre[k] + sides.high / g->s->scale;
        near[k] = fmax(fmax(low - p[k], p[k] - high), 0);
        far[k] = fmax(fabs(low - p[k]), fabs(p[k] - high));
    }
    /* If a difference overflows, the exact value may still be finite. */
    *lower = fmin(fmax(length_of_positive(near) - g->error, 0), 0x1p1022);
    *upper = length_of_positive(far) + g->error;
}

/* Searches the faces below a child (a node of the hierarchy or a block). */
static void search_child(const searching *g, uint32_t child)
{
    near_band *band = g->band;
    if (child & EBPO_IS_BLOCK) {
        for (uint32_t lane = 0; lane < EBPO_BLOCK; lane++)
            try_face(band, g->s, (child & ~EBPO_IS_BLOCK) * EBPO_BLOCK + lane);
        return;
    }
    const ebpo_bound *b = &g->s->bound[child];
    double lower[8], upper;
    int order[8], count = 0;
    for (int lane = 0; lane < b->count; lane++) {
        box_bounds(g, b, lane, &lower[lane], &upper);
        if (lower[lane] > band->limit || near_band_is_past(band, upper))
            continue;
        int at = count++;
        for (; at > 0 && lower[order[at - 1]] > lower[lane]; at--)
            order[at] = order[at - 1];
        order[at] = lane;
    }
    for (int i = 0; i < count && lower[order[i]] <= band->limit; i++)
        search_child(g, b->child[order[i]]);
}

/* Adds those faces of the subtree that may be in the band. Another subtree may add the same faces
 * again. */
static void near_band_search(near_band *band, const ebpo_accel *s)
{
    searching g = { band, s, 0 };
    double size = s->largest_coordinate / s->scale * 0x1p-46;
    /* box_bounds has a few rounding errors, relative to numbers of this size */
    for (int k = 0; k < 3; k++)
        size += fabs(band->p[k]) * 0x1p-46 + fabs(s->centre[k]) * 0x1p-46;
    g.error = size;
    if (s->bound_count)
        search_child(&g, s->root_bound);
}

/* --- the stream --- */

/* Sizes of bands, in faces. The first band is small, for callers that need few faces. Each next
 * band is BAND_GROWTH times larger, up to BAND_MAX, because every band is searched from the root,
 * so few large bands take less time. */
enum { FIRST_BAND = 256, BAND_GROWTH = 8, BAND_MAX = 1 << 16 };

typedef struct within {
    ebpo_context *context;
    const ebpo_within_options *options;
    near_band band;
    uint64_t given;    /* number of faces passed to the caller */
    bool ahead;        /* all subtrees are listed before the first is entered (lists_ahead) */
    uint64_t hinted;   /* number of subtrees with a prefetch hint that have not been entered */
    ebpo_near_fn take; /* the caller's function, called with `user` and each face */
    void *user;
} within;

/* --- a model that is loaded in parts: searches the nearest remaining subtree, until its bound is
 * beyond the limit --- */

/* Returns true if the file is remote and the query has a radius. Then all subtrees within the
 * radius will be entered, so they are listed at once and requested together. (If the query is for a
 * number of nearest faces, the needed subtrees are not known in advance.) */
static bool lists_ahead(const within *w)
{
    const ebpo_model *m = w->context->model;
    return !w->options->most && isfinite(w->band.radius) && !m->whole &&
           m->options.loading == EBPO_LOAD_CACHE && ebpo_input_prefetches(&m->file->in);
}

static ebpo_status put_children(within *w, const ebpo_box *box, const ebpo_ranked *r,
                                ebpo_error *error);

/* Returns a lower bound of the distance to a subtree's faces from its skeleton (upper nodes of its
 * hierarchy over faces), or 0 if the subtree has no skeleton. */
static double known_bound(const within *w, uint32_t below)
{
    const ebpo_skeleton *k = ebpo_skeletons_find(w->context->model->skeletons, below);
    if (!k)
        return 0;
    ebpo_skeleton_bounds b = ebpo_skeleton_lower_bounds(k, w->band.p, w->band.limit);
    return fmin(b.owned, b.shared);
}

/* Adds a node to the queue; if w->ahead, adds the subtrees at or below the node instead. Pruned
 * nodes are checked when the band is known (search_band). */
static ebpo_status put_node(within *w, const ebpo_box *box, const ebpo_ranked *r, ebpo_error *error)
{
    if (ebpo_node_is_uniform(&r->node) || r->node.pruned || r->lower > w->band.limit ||
        near_band_is_past(&w->band, ebpo_cell_far(box, r->node.cell, w->band.p)))
        return EBPO_OK;
    if (!ebpo_node_is_subtree_root(&r->node))
        return w->ahead ? put_children(w, box, r, error) : ebpo_queue_push(w->context, r, error);
    ebpo_ranked below = *r;
    below.lower = fmax(r->lower, known_bound(w, ebpo_entry_value(r->node.entry)));
    return below.lower > w->band.limit ? EBPO_OK : ebpo_queue_push(w->context, &below, error);
}

/* Sends prefetch hints for the subtree that is entered next and for some of the subtrees after it,
 * unless an earlier call has sent the hint for this subtree. */
static void hint_window(within *w, const ebpo_ranked *next)
{
    const ebpo_context *c = w->context;
    uint32_t below[EBPO_HINTED_MAX];
    uint64_t count = 0;
    if (!w->ahead || w->hinted) {
        w->hinted -= w->hinted > 0;
        return;
    }
    below[count++] = ebpo_entry_value(next->node.entry);
    for (uint64_t i = 0; i < c->queue_count && count < EBPO_HINTED_MAX; i++)
        if (c->queue[i].lower <= w->band.limit)
            below[count++] = ebpo_entry_value(c->queue[i].node.entry);
    ebpo_context_hint(c, below, count);
    w->hinted = count - 1;
}

/* Enters and searches a subtree, unless it is beyond the limit. */
static ebpo_status search_below(within *w, ebpo_ranked *r, ebpo_error *error)
{
    if (w->band.count > w->band.faces_max) /* a lower limit may exclude the subtree */
        near_band_settle(&w->band);
    if (r->lower > w->band.limit)
        return EBPO_OK;
    hint_window(w, r);
    ebpo_status status = ebpo_model_enter(w->context, &r->node, error);
    if (status == EBPO_OK)
        near_band_search(&w->band, r->node.subtree);
    return status;
}

/* Adds the children of a node of the top, as put_node does. */
static ebpo_status put_children(within *w, const ebpo_box *box, const ebpo_ranked *r,
                                ebpo_error *error)
{
    ebpo_ranked child[8];
    ebpo_ranking ranking = ebpo_ranking_of(w->context->model, w->band.p, NULL);
    int count = ebpo_rank_children(&ranking, &r->node, r->lower, w->band.limit, child);
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < count && status == EBPO_OK; i++)
        status = put_node(w, box, &child[i], error);
    return status;
}

/* Searches a band in a model that is loaded in parts. */
static ebpo_status search_parts(within *w, ebpo_error *error)
{
    ebpo_context *c = w->context;
    ebpo_box box = ebpo_model_box(c->model);
    ebpo_ranked root = { ebpo_model_root(c->model), 0, 0 };
    c->queue_count = 0;
    ebpo_status status = put_node(w, &box, &root, error);
    while (status == EBPO_OK && c->queue_count) {
        ebpo_ranked r = ebpo_queue_pop(c);
        if (r.lower > w->band.limit)
            break;
        status = ebpo_node_is_subtree_root(&r.node) ? search_below(w, &r, error)
                                                    : put_children(w, &box, &r, error);
    }
    return status;
}

/* --- band by band --- */

/* Returns true if the node may have a face of the band (ebpo_matters_fn). */
static bool node_matters(void *user, const ebpo_box *box, const ebpo_node *node)
{
    const within *w = user;
    ebpo_ranking ranking = ebpo_ranking_of(w->context->model, w->band.p, NULL);
    (void)box;
    return ebpo_rank_node(&ranking, node, 0) <= w->band.limit;
}

/* Finds the next band, of at most faces_max faces. */
static ebpo_status search_band(within *w, uint64_t faces_max, ebpo_error *error)
{
    const ebpo_model *m = w->context->model;
    ebpo_status status = EBPO_OK;
    near_band_begin(&w->band, faces_max);
    if (m->whole)
        near_band_search(&w->band, m->whole);
    else
        status = search_parts(w, error);
    if (status == EBPO_OK && w->band.no_memory)
        status = ebpo_fail_memory(error, (w->band.count + 1) * sizeof *w->band.near);
    if (status != EBPO_OK)
        return status;
    near_band_settle(&w->band);
    return ebpo_check_pruned(w->context, node_matters, w, error);
}

/* Passes a face to the caller. Sets *more to false if the caller wants no more faces. */
static ebpo_status give_face(within *w, const near_face *n, bool *more, ebpo_error *error)
{
    ebpo_triangle_nearest exact;
    ebpo_near_face out = { .normal = { NAN, NAN, NAN }, .file_face = n->file_face };
    ebpo_status status = ebpo_model_source_face(w->context->model, n->file_face, &out.face, error);
    if (status != EBPO_OK)
        return status;
    ebpo_triangle_nearest_exact(n->p, (const double(*)[3])n->triangle, &n->bounds,
                                w->options->normals ? out.normal : NULL, &exact);
    out.distance = exact.distance;
    memcpy(out.point, exact.point, sizeof out.point);
    w->given++;
    *more = w->take(w->user, &out);
    return EBPO_OK;
}

/* Passes the band's faces to the caller. Sets *more to true if there may be another band that the
 * caller wants. */
static ebpo_status give_band(within *w, bool *more, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    *more = true;
    for (uint64_t i = 0; i < w->band.count && *more && status == EBPO_OK; i++)
        status = give_face(w, &w->band.near[i], more, error);
    *more = *more && w->band.cut;
    w->band.has_after = *more;
    if (*more)
        w->band.after = w->band.near[w->band.count - 1];
    return status;
}

static ebpo_status stream_faces(within *w, ebpo_error *error)
{
    uint64_t wanted = w->options->most ? w->options->most : UINT64_MAX,
             band_size = w->options->most ? BAND_MAX : FIRST_BAND;
    bool more = true;
    ebpo_status status = EBPO_OK;
    while (more && w->given < wanted && status == EBPO_OK) {
        uint64_t missing = wanted - w->given;
        status = search_band(w, missing < band_size ? missing : band_size, error);
        if (status == EBPO_OK)
            status = give_band(w, &more, error);
        band_size = band_size < BAND_MAX / BAND_GROWTH ? band_size * BAND_GROWTH : BAND_MAX;
    }
    return status;
}

ebpo_status ebpo_distance_within(ebpo_context *context, const double point[3],
                                 const ebpo_within_options *options, ebpo_near_fn take, void *user,
                                 ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_within_options wanted = EBPO_WITHIN_OPTIONS_INIT;
    within w = { .context = context, .options = &wanted, .take = take, .user = user };
    ebpo_status status = EBPO_TAKE(ebpo_within_options, &wanted, options, error);
    if (status == EBPO_OK && !(wanted.radius >= 0))
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "radius %g is invalid; give 0 or more",
                           wanted.radius);
    if (status == EBPO_OK)
        status = ebpo_check_points(point, 1, error);
    if (status == EBPO_OK)
        status = ebpo_check_mesh(context->model, error);
    if (status != EBPO_OK)
        return status;
    /* In a subset, planes improve the bounds of omitted parts (as in ebpo_distance_many). */
    context->content = context->model->info->pruned ? EBPO_ACCEL_PLANES : EBPO_ACCEL_NODES;
    memcpy(w.band.p, point, sizeof w.band.p);
    w.band.radius = wanted.radius;
    w.ahead = lists_ahead(&w);
    status = stream_faces(&w, error);
    free(w.band.near);
    return status;
}
