#include "core/strict_fp.h"

#include "extras/paint/reach.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "query/query_model.h"
#include "extras/haptic/face_near.h"

enum { FACES_MOST = 1 << 28 };

void ebpo_reach_begin(ebpo_reach *r, ebpo_context *context)
{
    const double *size = context->model->info->box_size;
    *r = (ebpo_reach){ .context = context };
    r->tolerance = sqrt((size[0] * size[0] + size[1] * size[1]) + size[2] * size[2]) * 0x1p-20;
}

void ebpo_reach_end(ebpo_reach *r)
{
    free(r->face);
    free(r->position);
    free(r->edge);
    free(r->slot);
    free(r->root);
    *r = (ebpo_reach){ .context = NULL };
}

/* --- what is around --- */

static bool take(void *user, const ebpo_triangles *t)
{
    ebpo_reach *r = user;
    r->too_many = r->count + t->count > FACES_MOST;
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

/* A little more than the ball, whose bounds are rounded here. */
static ebpo_status gather(ebpo_reach *r, const ebpo_reach_ball *ball, ebpo_error *error)
{
    double min[3], max[3], wide = fmax(ball->radius, r->tolerance) * (1 + 0x1p-40);
    for (int i = 0; i < 3; i++) {
        min[i] = nextafter(ball->place[i] - wide, -INFINITY);
        max[i] = nextafter(ball->place[i] + wide, INFINITY);
    }
    r->count = 0;
    r->too_many = r->short_of_memory = false;
    ebpo_status status = ebpo_triangles_in_box(r->context, min, max, take, r, error);
    if (status == EBPO_OK && r->too_many)
        status = ebpo_fail(error, EBPO_E_LIMIT,
                           "the ball of a point meets more than %d faces; take a smaller radius",
                           FACES_MOST);
    if (status == EBPO_OK && r->short_of_memory)
        status = ebpo_fail_memory(error, (r->count + EBPO_TRIANGLES_MOST) * sizeof *r->face);
    if (status == EBPO_OK && r->count) /* none is there where a place is far from all faces */
        qsort(r->face, r->count, sizeof *r->face, by_number);
    return status;
}

/* --- positions and edges --- */

static uint64_t position_hash(const double p[3])
{
    uint64_t key[3];
    for (int i = 0; i < 3; i++) {
        double v = p[i] + 0.0; /* -0 is 0 */
        memcpy(&key[i], &v, sizeof v);
    }
    return ebpo_hash_three(key);
}

static bool same_position(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* An empty table for `count` keys. */
static bool clear_slots(ebpo_reach *r, uint64_t count)
{
    r->slots = ebpo_hash_slots(2 * count);
    if (!ebpo_grow(&r->slot, &r->slot_capacity, r->slots, sizeof *r->slot))
        return false;
    memset(r->slot, 0, r->slots * sizeof *r->slot);
    return true;
}

static void find_positions(ebpo_reach *r, const ebpo_reach_ball *ball)
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

static uint32_t set_of(ebpo_reach *r, uint32_t i)
{
    while (r->root[i] != i) {
        r->root[i] = r->root[r->root[i]];
        i = r->root[i];
    }
    return i;
}

static void join(ebpo_reach *r, uint64_t a, uint64_t b)
{
    uint32_t x = set_of(r, (uint32_t)a), y = set_of(r, (uint32_t)b);
    if (x < y)
        r->root[y] = x;
    else
        r->root[x] = y;
}

/* Faces come first in the sets, then positions, then edges. */
static void join_at_corners(ebpo_reach *r)
{
    for (uint64_t i = 0; i < 3 * r->count; i++)
        if (r->face[i / 3].within[i % 3])
            join(r, i / 3, r->count + r->face[i / 3].at[i % 3]);
}

/* Edges with an end within join their faces there already. */
static void join_at_edges(ebpo_reach *r, const ebpo_reach_ball *ball)
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
        join(r, i / 3, first + r->slot[at] - 1);
    }
}

static bool make_room(ebpo_reach *r)
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

static void keep_reach(ebpo_reach *r)
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

/* --- all of it --- */

static bool find_own(ebpo_reach *r, uint64_t face)
{
    for (r->own = 0; r->own < r->count; r->own++)
        if (r->face[r->own].face == face)
            return true;
    return false;
}

static ebpo_status fail_place(const ebpo_reach *r, uint64_t face, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_FORMAT, r->context->model->file->in.shown,
                          "a point of the paint is not on face %llu, where it says to be: the "
                          "paint does not fit the model",
                          (unsigned long long)face);
}

/* Gathers what is around, and finds the face among it. *on: the place is on it. */
static ebpo_status find_face(ebpo_reach *r, const ebpo_reach_ball *ball, bool *here, bool *on,
                             ebpo_error *error)
{
    const bool subset = r->context->model->info->pruned;
    ebpo_face_near near;
    ebpo_error cause = EBPO_ERROR_INIT;
    *here = *on = false;
    ebpo_status status = gather(r, ball, &cause);
    if (status == EBPO_E_ABSENT && subset) /* what hangs together is not known there */
        return EBPO_OK;
    if (status != EBPO_OK)
        return ebpo_fail_with(error, &cause);
    bool found = find_own(r, ball->face);
    *here = found || !subset;
    if (!found)
        return EBPO_OK;
    ebpo_face_nearest(ball->place, (const double(*)[3])r->face[r->own].corner, &near);
    *on = near.distance <= r->tolerance;
    return EBPO_OK;
}

ebpo_status ebpo_reach_check(ebpo_reach *r, const double place[3], uint64_t face, bool *fits,
                             ebpo_error *error)
{
    const ebpo_reach_ball ball = { { place[0], place[1], place[2] }, 0, face };
    bool here, on;
    ebpo_status status = find_face(r, &ball, &here, &on, error);
    *fits = on || !here;
    return status;
}

ebpo_status ebpo_reach_find(ebpo_reach *r, const ebpo_reach_ball *ball, bool *here,
                            ebpo_error *error)
{
    bool on;
    ebpo_status status = find_face(r, ball, here, &on, error);
    if (status != EBPO_OK || !*here)
        return status;
    if (!on) {
        *here = false;
        return fail_place(r, ball->face, error);
    }
    if (!make_room(r))
        return ebpo_fail_memory(error, r->count * 150);
    find_positions(r, ball);
    join_at_corners(r);
    memset(r->slot, 0, r->slots * sizeof *r->slot);
    join_at_edges(r, ball);
    keep_reach(r);
    return EBPO_OK;
}
