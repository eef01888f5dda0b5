/* Finds the reach of a point: the faces that are connected with the point's own face within the
 * point's ball.
 *
 * Faces in the ball's box are joined into sets: at common corners (equal positions) within the
 * ball, and at common edges that intersect the ball. The set that contains the point's face is the
 * reach. So paint on one side of a thin wall does not reach the other side, although the ball does.
 *
 * Points of a stroke are evaluated in batches on all cores. The reaches of a batch are kept until
 * they are requested. Results do not depend on the number of threads.
 *
 * See format-spec/paint.md, section 4. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/parallel.h"
#include "extras/haptic/face_box.h"
#include "extras/paint/paint_reach.h"
#include "query/query_model.h"

enum { FACES_MAX = 1 << 28 }; /* greatest number of faces around a ball */

void ebpo_reach_begin(ebpo_reach_search *r, ebpo_context *context)
{
    const double *size = context->model->info->box_size;
    *r = (ebpo_reach_search){ .context = context };
    r->tolerance = sqrt((size[0] * size[0] + size[1] * size[1]) + size[2] * size[2]) * 0x1p-20;
}

void ebpo_reach_end(ebpo_reach_search *r)
{
    free(r->face);
    free(r->position);
    free(r->edge);
    free(r->slot);
    free(r->root);
    *r = (ebpo_reach_search){ .context = NULL };
}

/* --- faces around the ball --- */

static bool receive_triangles(void *user, const ebpo_triangles *t)
{
    ebpo_reach_search *r = user;
    r->too_many = r->count + t->count > FACES_MAX;
    r->short_of_memory =
        !r->too_many && !ebpo_grow(&r->face, &r->capacity, r->count + t->count, sizeof *r->face);
    for (uint64_t i = 0; i < t->count && !r->too_many && !r->short_of_memory; i++) {
        ebpo_reach_face *f = &r->face[r->count++];
        memcpy(f->corner, t->corners[i], sizeof f->corner);
        f->face = t->faces[i];
        f->file_face = t->file_faces[i];
    }
    return !r->too_many && !r->short_of_memory;
}

static int by_number(const void *a, const void *b)
{
    const ebpo_reach_face *x = a, *y = b;
    return (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

/* Gathers the faces around the ball, and sorts them in the order of the file. Uses a slightly
 * larger box than the ball's box, because its bounds are rounded. */
static ebpo_status gather_faces(ebpo_reach_search *r, const ebpo_reach_ball *ball,
                                ebpo_error *error)
{
    double min[3], max[3], wide = fmax(ball->radius, r->tolerance) * (1 + 0x1p-40);
    for (int i = 0; i < 3; i++) {
        min[i] = nextafter(ball->place[i] - wide, -INFINITY);
        max[i] = nextafter(ball->place[i] + wide, INFINITY);
    }
    r->count = 0;
    r->too_many = r->short_of_memory = false;
    ebpo_status status = ebpo_triangles_in_box(r->context, min, max, receive_triangles, r, error);
    if (status == EBPO_OK && r->too_many)
        status = ebpo_fail(error, EBPO_E_LIMIT,
                           "the ball of a point intersects more than %d faces; use a smaller "
                           "radius",
                           FACES_MAX);
    if (status == EBPO_OK && r->short_of_memory)
        status = ebpo_fail_memory(error, (r->count + EBPO_TRIANGLES_MAX) * sizeof *r->face);
    if (status == EBPO_OK && r->count)
        qsort(r->face, r->count, sizeof *r->face, by_number);
    return status;
}

/* --- positions and edges --- */

static uint64_t position_hash(const double p[3])
{
    uint64_t key[3];
    for (int i = 0; i < 3; i++) {
        double v = p[i] + 0.0; /* turns -0 into 0 */
        memcpy(&key[i], &v, sizeof v);
    }
    return ebpo_hash_three(key);
}

static bool same_position(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* Makes an empty hash table for `count` keys. Returns false without memory. */
static bool clear_slots(ebpo_reach_search *r, uint64_t count)
{
    r->slots = ebpo_hash_slots(2 * count);
    if (!ebpo_grow(&r->slot, &r->slot_capacity, r->slots, sizeof *r->slot))
        return false;
    memset(r->slot, 0, r->slots * sizeof *r->slot);
    return true;
}

/* Finds the different positions of the faces' corners. */
static void find_positions(ebpo_reach_search *r, const ebpo_reach_ball *ball)
{
    double square = ball->radius * ball->radius;
    uint64_t at;
    r->position_count = 0;
    for (uint64_t i = 0; i < 3 * r->count; i++) {
        ebpo_reach_face *f = &r->face[i / 3];
        const double *p = f->corner[i % 3];
        EBPO_HASH_FIND(at, position_hash(p), r->slots - 1,
                       r->slot[at] == 0 || same_position(r->position[r->slot[at] - 1].p, p));
        if (r->slot[at] == 0) {
            ebpo_reach_position *q = &r->position[r->position_count++];
            memcpy(q->p, p, sizeof q->p);
            q->within = ebpo_ball_holds(ball->place, square, p);
            r->slot[at] = (uint32_t)r->position_count;
        }
        f->at[i % 3] = r->slot[at] - 1;
        f->within[i % 3] = r->position[r->slot[at] - 1].within;
    }
}

static bool comes_first(const double a[3], const double b[3])
{
    for (int i = 0; i < 3; i++)
        if (a[i] != b[i])
            return a[i] < b[i];
    return true;
}

/* Returns true if the segment pq intersects the ball. The result does not depend on the order of p
 * and q. */
static bool segment_within(const ebpo_reach_ball *ball, const double p[3], const double q[3])
{
    const double *a = comes_first(p, q) ? p : q, *b = a == p ? q : p;
    double e[3], d[3], at[3], t = 0;
    for (int i = 0; i < 3; i++) {
        e[i] = b[i] - a[i];
        d[i] = ball->place[i] - a[i];
    }
    double length = (e[0] * e[0] + e[1] * e[1]) + e[2] * e[2];
    if (length != 0) {
        t = ((d[0] * e[0] + d[1] * e[1]) + d[2] * e[2]) / length;
        t = t > 0 ? t < 1 ? t : 1 : 0;
    }
    for (int i = 0; i < 3; i++)
        at[i] = a[i] + t * e[i];
    return ebpo_ball_holds(ball->place, ball->radius * ball->radius, at);
}

/* --- sets --- */

/* Returns the representative of the set that contains i, and shortens the path from i to it. */
static uint32_t set_of(ebpo_reach_search *r, uint32_t i)
{
    while (r->root[i] != i) {
        r->root[i] = r->root[r->root[i]];
        i = r->root[i];
    }
    return i;
}

static void join_sets(ebpo_reach_search *r, uint64_t a, uint64_t b)
{
    uint32_t x = set_of(r, (uint32_t)a), y = set_of(r, (uint32_t)b);
    if (x < y)
        r->root[y] = x;
    else
        r->root[x] = y;
}

/* Joins the sets of faces that share a corner within the ball. */
static void join_at_corners(ebpo_reach_search *r)
{
    for (uint64_t i = 0; i < 3 * r->count; i++)
        if (r->face[i / 3].within[i % 3])
            join_sets(r, i / 3, r->count + r->face[i / 3].at[i % 3]);
}

/* Joins the sets of faces that share an edge that intersects the ball. If an end of the edge is
 * within the ball, join_at_corners has joined the faces already. */
static void join_at_edges(ebpo_reach_search *r, const ebpo_reach_ball *ball)
{
    uint64_t first = r->count + r->position_count, at;
    r->edge_count = 0;
    for (uint64_t i = 0; i < 3 * r->count; i++) {
        const ebpo_reach_face *f = &r->face[i / 3];
        uint64_t k = i % 3, next = (k + 1) % 3;
        if (f->within[k] || f->within[next] || !segment_within(ball, f->corner[k], f->corner[next]))
            continue;
        ebpo_reach_edge e = { f->at[k], f->at[next] };
        if (e.a > e.b)
            e = (ebpo_reach_edge){ e.b, e.a };
        EBPO_HASH_FIND(at, ebpo_hash_number((uint64_t)e.a << 32 | e.b), r->slots - 1,
                       r->slot[at] == 0 || (r->edge[r->slot[at] - 1].a == e.a &&
                                            r->edge[r->slot[at] - 1].b == e.b));
        if (r->slot[at] == 0) {
            r->edge[r->edge_count++] = e;
            r->slot[at] = (uint32_t)r->edge_count;
        }
        join_sets(r, i / 3, first + r->slot[at] - 1);
    }
}

static bool reserve_space(ebpo_reach_search *r)
{
    uint64_t corners = 3 * r->count, all = r->count + 2 * corners;
    if (!ebpo_grow(&r->position, &r->position_capacity, corners, sizeof *r->position) ||
        !ebpo_grow(&r->edge, &r->edge_capacity, corners, sizeof *r->edge) ||
        !ebpo_grow(&r->root, &r->root_capacity, all, sizeof *r->root))
        return false;
    for (uint64_t i = 0; i < all; i++)
        r->root[i] = (uint32_t)i;
    return clear_slots(r, corners);
}

/* Keeps only the faces in the set of the point's face. */
static void keep_reach(ebpo_reach_search *r)
{
    uint32_t set = set_of(r, (uint32_t)r->own);
    uint64_t kept = 0, own = 0;
    for (uint64_t i = 0; i < r->count; i++) {
        if (set_of(r, (uint32_t)i) != set)
            continue;
        if (i == r->own)
            own = kept;
        r->face[kept++] = r->face[i];
    }
    r->count = kept;
    r->own = own;
}

/* --- the whole reach --- */

static bool find_own(ebpo_reach_search *r, uint64_t face)
{
    for (r->own = 0; r->own < r->count; r->own++)
        if (r->face[r->own].face == face)
            return true;
    return false;
}

static ebpo_status fail_place(const ebpo_reach_search *r, uint64_t face, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_FORMAT, r->context->model->file->in.shown,
                          "a point of the paint is not on its face %llu: the paint was made on "
                          "another model; give that model",
                          (unsigned long long)face);
}

/* Gathers the faces around the ball, and finds the ball's face among them. Sets *on to true if the
 * ball's centre is on that face. *complete: as in ebpo_reach_find. */
static ebpo_status find_face(ebpo_reach_search *r, const ebpo_reach_ball *ball, bool *complete,
                             bool *on, ebpo_error *error)
{
    const bool subset = r->context->model->info->pruned;
    ebpo_face_near near;
    ebpo_error cause = EBPO_ERROR_INIT;
    *complete = *on = false;
    ebpo_status status = gather_faces(r, ball, &cause);
    if (status == EBPO_E_ABSENT && subset) /* the connections over omitted faces are unknown */
        return EBPO_OK;
    if (status != EBPO_OK)
        return ebpo_fail_with(error, &cause);
    bool found_own = find_own(r, ball->face);
    *complete = found_own || !subset;
    if (!found_own)
        return EBPO_OK;
    ebpo_face_nearest(ball->place, (const double(*)[3])r->face[r->own].corner, &near);
    *on = near.distance <= r->tolerance;
    return EBPO_OK;
}

ebpo_status ebpo_reach_check(ebpo_reach_search *r, const double place[3], uint64_t face, bool *fits,
                             ebpo_error *error)
{
    const ebpo_reach_ball ball = { { place[0], place[1], place[2] }, 0, face };
    bool complete, on;
    ebpo_status status = find_face(r, &ball, &complete, &on, error);
    *fits = on || !complete;
    return status;
}

ebpo_status ebpo_reach_find(ebpo_reach_search *r, const ebpo_reach_ball *ball, bool *complete,
                            ebpo_error *error)
{
    bool on;
    ebpo_status status = find_face(r, ball, complete, &on, error);
    if (status != EBPO_OK || !*complete)
        return status;
    if (!on) {
        *complete = false;
        return fail_place(r, ball->face, error);
    }
    if (!reserve_space(r))
        return ebpo_fail_memory(error, r->count * 150); /* approximate bytes for each face */
    find_positions(r, ball);
    join_at_corners(r);
    memset(r->slot, 0, r->slots * sizeof *r->slot);
    join_at_edges(r, ball);
    keep_reach(r);
    return EBPO_OK;
}

static uint64_t find_slot(const ebpo_found_faces *found_faces, uint64_t file_face)
{
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_number(file_face), found_faces->slots - 1,
                   found_faces->slot[at] == 0 ||
                       found_faces->face[found_faces->slot[at] - 1].file_face == file_face);
    return at;
}

/* Makes a larger hash table, and inserts all faces again. */
static bool grow_slots(ebpo_found_faces *found_faces)
{
    uint64_t slots = ebpo_hash_slots(4 * (found_faces->count + 1));
    uint32_t *slot = ebpo_alloc_zero(slots, sizeof *slot);
    if (!slot)
        return false;
    free(found_faces->slot);
    found_faces->slot = slot;
    found_faces->slots = slots;
    for (uint64_t i = 0; i < found_faces->count; i++)
        slot[find_slot(found_faces, found_faces->face[i].file_face)] = (uint32_t)i + 1;
    return true;
}

ebpo_status ebpo_found_faces_add(ebpo_found_faces *found_faces, const ebpo_reach_face *face,
                                 uint32_t *number, ebpo_error *error)
{
    if (2 * (found_faces->count + 1) > found_faces->slots && !grow_slots(found_faces))
        return ebpo_fail_memory(error, 4 * found_faces->count * sizeof *found_faces->slot);
    uint64_t at = find_slot(found_faces, face->file_face);
    if (found_faces->slot[at] == 0) {
        if (found_faces->count == UINT32_MAX - 1)
            return ebpo_fail(error, EBPO_E_LIMIT, "strokes reach more than 2^32 - 2 faces");
        if (!ebpo_grow(&found_faces->face, &found_faces->capacity, found_faces->count + 1,
                       sizeof *found_faces->face))
            return ebpo_fail_memory(error, found_faces->count * sizeof *found_faces->face);
        ebpo_found_face *f = &found_faces->face[found_faces->count++];
        *f = (ebpo_found_face){ .face = face->face, .file_face = face->file_face };
        memcpy(f->corner, face->corner, sizeof f->corner);
        found_faces->slot[at] = (uint32_t)found_faces->count;
    }
    *number = found_faces->slot[at] - 1;
    return EBPO_OK;
}

void ebpo_found_faces_free(ebpo_found_faces *found_faces)
{
    free(found_faces->face);
    free(found_faces->slot);
    *found_faces = (ebpo_found_faces){ 0 };
}

/* --- many points --- */

/* A batch has up to BATCH_POINTS points; it ends early if their reaches have more than BATCH_FACES
 * faces. A thread takes GRAIN points at a time. */
enum { BATCH_POINTS = 1024, BATCH_FACES = 1 << 20, GRAIN = 8 };

/* Bytes of the memory budget that each thread needs. With less memory, threads would repeatedly
 * load data that another thread has just dropped. */
enum { THREAD_BYTES = 1 << 20 };

/* The reach of a point of the batch. done: the reach has been found; complete: as in
 * ebpo_reach_result. */
typedef struct found_reach {
    ebpo_reach_result_face *face;
    uint64_t count, capacity;
    bool done, complete;
} found_reach;

struct ebpo_reach_pool {
    const ebpo_paint *p;
    unsigned threads;
    ebpo_reach_search *reach; /* [threads] a search for each thread */
    found_reach found[BATCH_POINTS];
    uint32_t stroke, first, count; /* the points of the current batch */
    atomic_uint_least64_t faces;   /* number of faces in the reaches of the batch */
};

static ebpo_status keep_reached(found_reach *f, const ebpo_reach_search *reach, ebpo_error *error)
{
    f->count = 0;
    if (!f->complete)
        return EBPO_OK;
    if (!ebpo_grow(&f->face, &f->capacity, reach->count, sizeof *f->face))
        return ebpo_fail_memory(error, reach->count * sizeof *f->face);
    for (uint64_t k = 0; k < reach->count; k++) {
        ebpo_reach_result_face *one = &f->face[f->count++];
        one->face = reach->face[k].face;
        memcpy(one->within, reach->face[k].within, sizeof one->within);
    }
    return EBPO_OK;
}

/* Finds the reaches of the points [begin, end) of the batch. If the reaches have too many faces,
 * skips the remaining points, which a later batch evaluates. Never skips the first point. */
static ebpo_status find_batch_reaches(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                      ebpo_error *error)
{
    ebpo_reach_pool *r = context;
    ebpo_reach_search *reach = &r->reach[worker];
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        found_reach *f = &r->found[i];
        if (i > 0 && atomic_load(&r->faces) > BATCH_FACES)
            break;
        status =
            ebpo_paint_reach(reach, r->p, r->stroke, r->first + (uint32_t)i, &f->complete, error);
        if (status == EBPO_OK)
            status = keep_reached(f, reach, error);
        atomic_fetch_add(&r->faces, f->count);
        f->done = status == EBPO_OK;
    }
    /* a thread that waits for work must not hold memory that other threads need */
    ebpo_context_let_go(reach->context);
    return status;
}

/* Begins a batch at point i of a stroke. Frees large reaches first, so that the memory of all
 * reaches is bounded. */
static void begin_batch(ebpo_reach_pool *r, uint32_t stroke, uint32_t i)
{
    uint32_t remaining = r->p->stroke[stroke].count - i;
    r->stroke = stroke;
    r->first = i;
    r->count = remaining < BATCH_POINTS ? remaining : BATCH_POINTS;
    atomic_store(&r->faces, 0);
    for (uint32_t k = 0; k < BATCH_POINTS; k++) {
        found_reach *f = &r->found[k];
        if (f->capacity > BATCH_FACES / BATCH_POINTS) {
            free(f->face);
            f->face = NULL;
            f->capacity = 0;
        }
        f->done = false;
        f->count = 0;
    }
}

ebpo_status ebpo_reach_pool_find(ebpo_reach_pool *r, uint32_t stroke, uint32_t i,
                                 ebpo_reach_result *out, ebpo_error *error)
{
    bool among = stroke == r->stroke && i >= r->first && i - r->first < r->count;
    if (!among || !r->found[i - r->first].done) {
        begin_batch(r, stroke, i);
        ebpo_status status = ebpo_parallel_for(r->threads, NULL, r->count, GRAIN,
                                               find_batch_reaches, r, NULL, "", error);
        if (status != EBPO_OK)
            return status;
    }
    const found_reach *f = &r->found[i - r->first];
    *out = (ebpo_reach_result){ f->face, f->count, f->complete };
    return EBPO_OK;
}

ebpo_status ebpo_reach_pool_new(const ebpo_paint *p, ebpo_context *context, unsigned threads,
                                ebpo_reach_pool **out, ebpo_error *error)
{
    ebpo_reach_pool *r = *out = ebpo_alloc_zero(1, sizeof *r);
    if (!r)
        return ebpo_fail_memory(error, sizeof *r);
    r->p = p;
    uint64_t most = p->point_count / GRAIN + 1, memory = context->model->options.memory;
    if (memory && memory / THREAD_BYTES < most)
        most = memory / THREAD_BYTES + 1;
    r->threads = ebpo_thread_count(threads);
    r->threads = r->threads < most ? r->threads : (unsigned)most;
    ebpo_status status = EBPO_OK;
    r->reach = ebpo_alloc_zero(r->threads, sizeof *r->reach);
    if (!r->reach)
        status = ebpo_fail_memory(error, r->threads * sizeof *r->reach);
    for (unsigned t = 0; t < r->threads && status == EBPO_OK; t++) {
        ebpo_context *own = context;
        if (t > 0)
            status = ebpo_context_new(context->model, &own, error);
        if (status == EBPO_OK)
            ebpo_reach_begin(&r->reach[t], own);
    }
    if (status != EBPO_OK) {
        ebpo_reach_pool_free(r);
        *out = NULL;
    }
    return status;
}

void ebpo_reach_pool_free(ebpo_reach_pool *r)
{
    if (!r)
        return;
    for (unsigned t = 0; r->reach && t < r->threads; t++) {
        ebpo_context *own = r->reach[t].context;
        if (!own)
            break;
        ebpo_reach_end(&r->reach[t]);
        if (t > 0)
            ebpo_context_free(own);
    }
    for (uint32_t k = 0; k < BATCH_POINTS; k++)
        free(r->found[k].face);
    free(r->reach);
    free(r);
}
