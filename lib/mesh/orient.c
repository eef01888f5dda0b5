#include "geom/strict_fp.h"

#include <pthread.h>
#include <stdlib.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/parallel.h"
#include "base/arrays.h"
#include "mesh/mesh_frame.h"
#include "mesh/mesh_parts.h"
#include "mesh/stars.h"
#include "mesh/sum.h"

enum { FACE_GRAIN = 1 << 14, VERTEX_GRAIN = 1 << 13 };

/* What is found at faces, and in the end of their patch. */
enum { OPEN = 1, INCONSISTENT = 2, TWISTED = 4 };

/* A patch, faces connected by edges that are used exactly twice, that is to be made consistent. */
typedef struct patch {
    uint32_t root;
    uint32_t seed;          /* its first face in the source, which decides when nothing else does */
    bool closed;            /* every edge has a face on its other side */
    bool seed_turned;       /* it runs against the root */
    bool turn_others;       /* the faces that run as the seed does are the ones to turn */
    uint64_t count, turned; /* faces; those that run against the root */
    ebpo_sum volume;        /* six times, with all faces running as the root does */
} patch;

typedef struct orienting {
    ebpo_mesh *mesh;
    ebpo_mesh_frame frame; /* of volumes, of which signs count */
    ebpo_stars stars;
    ebpo_star *star; /* one for each thread */
    /* [face_count] a lower face of the patch, or itself: number << 1 | 1 when the two run against
     * each other */
    uint64_t *above;
    uint8_t *flags; /* [face_count] */
    patch *patches; /* by root */
    uint64_t patch_count, patch_capacity;
    uint64_t flipped, unorientable;
    pthread_mutex_t lock; /* of the patches' volumes */
} orienting;

/* --- joining faces to patches --- */

/* Root of f << 1 | 1 when f runs against it. Paths are halved on the way; any thread may do so. */
static uint64_t find_root(uint64_t *above, uint32_t f)
{
    for (uint64_t turned = 0;;) {
        uint64_t up = __atomic_load_n(&above[f], __ATOMIC_RELAXED);
        if (up >> 1 == f)
            return (uint64_t)f << 1 | turned;
        uint64_t next = __atomic_load_n(&above[up >> 1], __ATOMIC_RELAXED), grand = next ^ (up & 1);
        if (next >> 1 != up >> 1)
            __atomic_compare_exchange_n(&above[f], &up, grand, true, __ATOMIC_RELAXED,
                                        __ATOMIC_RELAXED);
        turned ^= grand & 1;
        f = (uint32_t)(grand >> 1);
    }
}

/* The higher root goes below the lower one, so that the roots are the same in any order. False when
 * the faces are in one patch already, the other way round. */
static bool join(uint64_t *above, uint32_t a, uint32_t b, uint64_t turned)
{
    for (;;) {
        uint64_t ra = find_root(above, a), rb = find_root(above, b);
        if (ra >> 1 == rb >> 1)
            return ((ra ^ rb ^ turned) & 1) == 0;
        uint64_t low = ra < rb ? ra : rb, high = ra < rb ? rb : ra, expected = high & ~UINT64_C(1);
        if (__atomic_compare_exchange_n(&above[high >> 1], &expected,
                                        (low & ~UINT64_C(1)) | ((ra ^ rb ^ turned) & 1), false,
                                        __ATOMIC_RELAXED, __ATOMIC_RELAXED))
            return true;
    }
}

static void flag(orienting *o, uint32_t face, uint8_t flags)
{
    __atomic_fetch_or(&o->flags[face], flags, __ATOMIC_RELAXED);
}

/* The uses of one edge. */
static void visit_edge(orienting *o, const ebpo_link *links, uint64_t uses)
{
    uint32_t a = ebpo_link_face(&links[0]), b = ebpo_link_face(&links[uses - 1]);
    if (uses != 2 || a == b) {
        for (uint64_t i = 0; i < uses; i++)
            flag(o, ebpo_link_face(&links[i]), OPEN);
        return;
    }
    uint64_t turned = links[0].out == links[1].out;
    if (turned)
        flag(o, a, INCONSISTENT);
    if (!join(o->above, a, b, turned))
        flag(o, a, TWISTED);
}

static ebpo_status begin_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    orienting *o = context;
    (void)worker, (void)error;
    for (uint64_t f = begin; f < end; f++) {
        o->above[f] = f << 1;
        o->flags[f] = ebpo_face_repeats_index(o->mesh->faces + 3 * f) ? OPEN : 0;
    }
    return EBPO_OK;
}

static ebpo_status visit_vertices(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    orienting *o = context;
    ebpo_star *star = &o->star[worker];
    EBPO_FOR_ITEMS_SCATTERED(o->mesh->workspace, v, begin, end) {
        if (!ebpo_star_gather(star, &o->stars, o->mesh, (uint32_t)v))
            return ebpo_fail_memory(error, star->capacity * 2 * sizeof *star->links);
        for (uint64_t i = 0, next; i < star->count; i = next) {
            next = ebpo_star_run_end(star, i);
            if (ebpo_link_neighbour(&star->links[i]) > v)
                visit_edge(o, star->links + i, next - i);
        }
    }
    return EBPO_OK;
}

static ebpo_status join_faces(orienting *o, ebpo_error *error)
{
    unsigned threads = ebpo_thread_count(0);
    ebpo_status status = ebpo_stars_build(&o->stars, o->mesh, threads, NULL, error);
    o->star = ebpo_alloc_zero(threads, sizeof *o->star);
    if (status == EBPO_OK && !o->star)
        status = ebpo_fail_memory(error, threads * sizeof *o->star);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, o->mesh->workspace, o->mesh->face_count, FACE_GRAIN,
                                   begin_faces, o, NULL, "", error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, NULL, o->mesh->vertex_count, VERTEX_GRAIN,
                                   visit_vertices, o, NULL, "", error);
    for (unsigned t = 0; o->star && t < threads; t++)
        ebpo_star_free(&o->star[t]);
    free(o->star);
    ebpo_stars_free(&o->stars);
    return status;
}

/* Each face is put below its root directly, which learns what was found at it. Roots come before
 * what is below them. */
static void gather_flags(orienting *o)
{
    EBPO_FOR_ITEMS_SCATTERED(o->mesh->workspace, f, 0, o->mesh->face_count) {
        uint64_t up = o->above[f], root = o->above[up >> 1] ^ (up & 1);
        o->above[f] = root;
        o->flags[root >> 1] |= o->flags[f];
    }
}

/* --- deciding --- */

static bool list_patches(orienting *o)
{
    EBPO_FOR_ITEMS(o->mesh->workspace, f, 0, o->mesh->face_count) {
        if (o->above[f] >> 1 != f)
            continue;
        o->unorientable += (o->flags[f] & TWISTED) != 0;
        if ((o->flags[f] & (TWISTED | INCONSISTENT)) != INCONSISTENT)
            continue;
        if (!ebpo_array_grow(o->mesh->workspace, &o->patches, &o->patch_capacity,
                             o->patch_count + 1, sizeof *o->patches))
            return false;
        o->patches[o->patch_count++] =
            (patch){ .root = (uint32_t)f, .seed = (uint32_t)f, .closed = !(o->flags[f] & OPEN) };
    }
    return true;
}

/* NULL for a face that stays as it is. `last`: the one found before, which is often the one. */
static patch *patch_of(orienting *o, uint64_t f, patch *last)
{
    uint32_t root = (uint32_t)(o->above[f] >> 1);
    if (last && last->root == root)
        return last;
    if ((o->flags[root] & (TWISTED | INCONSISTENT)) != INCONSISTENT)
        return NULL;
    uint64_t low = 0, high = o->patch_count - 1;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (o->patches[middle].root < root)
            low = middle + 1;
        else
            high = middle;
    }
    return &o->patches[low];
}

static void count_faces(orienting *o)
{
    patch *p = NULL;
    EBPO_FOR_ITEMS_SCATTERED(o->mesh->workspace, f, 0, o->mesh->face_count) {
        p = patch_of(o, f, p);
        if (!p)
            continue;
        p->count++;
        p->turned += o->above[f] & 1;
        if (ebpo_mesh_source_face(o->mesh, f) < ebpo_mesh_source_face(o->mesh, p->seed))
            p->seed = (uint32_t)f;
    }
    for (uint64_t i = 0; i < o->patch_count; i++)
        o->patches[i].seed_turned = o->above[o->patches[i].seed] & 1;
}

static void add_volume(orienting *o, patch *p, const ebpo_sum *sum)
{
    pthread_mutex_lock(&o->lock);
    ebpo_sum_merge(&p->volume, sum);
    pthread_mutex_unlock(&o->lock);
}

/* The sum is exact, so it does not matter which thread adds what. */
static ebpo_status measure(void *context, uint64_t begin, uint64_t end, unsigned worker,
                           ebpo_error *error)
{
    orienting *o = context;
    const ebpo_mesh *mesh = o->mesh;
    (void)worker, (void)error;
    ebpo_sum sum = { .adds = 0 };
    patch *last = NULL;
    double base[3] = { 0, 0, 0 };
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, begin, end) {
        patch *p = patch_of(o, f, last);
        if (!p || !p->closed)
            continue;
        if (p != last) {
            if (last)
                add_volume(o, last, &sum);
            sum = (ebpo_sum){ .adds = 0 };
            last = p;
            ebpo_frame_position(&o->frame, mesh, mesh->faces[3 * (uint64_t)p->seed], base);
        }
        const uint32_t *v = mesh->faces + 3 * f;
        double a[3], b[3], c[3], cross[3];
        ebpo_frame_position(&o->frame, mesh, v[0], a);
        ebpo_frame_position(&o->frame, mesh, v[1], b);
        ebpo_frame_position(&o->frame, mesh, v[2], c);
        ebpo_face_cross(a, b, c, cross);
        double term =
            (a[0] - base[0]) * cross[0] + (a[1] - base[1]) * cross[1] + (a[2] - base[2]) * cross[2];
        ebpo_sum_add(&sum, o->above[f] & 1 ? -term : term);
    }
    if (last)
        add_volume(o, last, &sum);
    return EBPO_OK;
}

static void decide(patch *p)
{
    double volume = p->closed ? ebpo_sum_value(&p->volume) : 0;
    volume = p->seed_turned ? -volume : volume;
    uint64_t against_seed = p->seed_turned ? p->count - p->turned : p->turned;
    p->turn_others = volume < 0 || (!(volume > 0) && against_seed > p->count - against_seed);
}

static ebpo_status flip(void *context, uint64_t begin, uint64_t end, unsigned worker,
                        ebpo_error *error)
{
    orienting *o = context;
    (void)worker, (void)error;
    uint64_t flipped = 0;
    patch *p = NULL;
    EBPO_FOR_ITEMS_SCATTERED(o->mesh->workspace, f, begin, end) {
        p = patch_of(o, f, p);
        if (!p || ((o->above[f] & 1) != p->seed_turned) == p->turn_others)
            continue;
        ebpo_face_turn(o->mesh->faces + 3 * f);
        flipped++;
    }
    __atomic_fetch_add(&o->flipped, flipped, __ATOMIC_RELAXED);
    return EBPO_OK;
}

static ebpo_status run(orienting *o, ebpo_error *error)
{
    ebpo_mesh *mesh = o->mesh;
    uint64_t count = mesh->face_count;
    o->above = ebpo_array_alloc(mesh->workspace, count, sizeof *o->above);
    o->flags = ebpo_array_alloc(mesh->workspace, count, 1);
    if (!o->above || !o->flags)
        return ebpo_workspace_fail(mesh->workspace, count * 9, error);
    ebpo_status status = join_faces(o, error);
    if (status != EBPO_OK)
        return status;
    gather_flags(o);
    if (!list_patches(o))
        return ebpo_workspace_fail(mesh->workspace, o->patch_count * sizeof *o->patches, error);
    if (o->patch_count == 0)
        return EBPO_OK;
    count_faces(o);
    o->frame = ebpo_mesh_frame_of(mesh);
    status = ebpo_parallel_for(0, NULL, count, FACE_GRAIN, measure, o, NULL, "", error);
    for (uint64_t i = 0; i < o->patch_count; i++)
        decide(&o->patches[i]);
    return status == EBPO_OK
               ? ebpo_parallel_for(0, NULL, count, FACE_GRAIN, flip, o, NULL, "", error)
               : status;
}

ebpo_status ebpo_mesh_make_consistent(ebpo_mesh *mesh, ebpo_mend_record *record, ebpo_error *error)
{
    orienting o = { .mesh = mesh, .lock = PTHREAD_MUTEX_INITIALIZER };
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    status = run(&o, error);
    if (status == EBPO_OK && record) {
        record->orient = true;
        record->flipped_faces += o.flipped;
        record->unorientable_components += o.unorientable;
    }
    pthread_mutex_destroy(&o.lock);
    ebpo_array_free(mesh->workspace, o.above);
    ebpo_array_free(mesh->workspace, o.flags);
    ebpo_array_free(mesh->workspace, o.patches);
    return status;
}

ebpo_status ebpo_mesh_orient(ebpo_mesh *mesh, ebpo_mend_record *record, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_status status = ebpo_mesh_make_consistent(mesh, record, error);
    return status == EBPO_OK ? ebpo_mesh_turn_closed(mesh, record, error) : status;
}
