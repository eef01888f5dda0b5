/* Makes neighbouring faces consistent, so that two neighbours use their common edge in opposite
 * directions. Faces joined by edges with two faces form patches, whose faces get one orientation.
 * At *crowded* edges, which have more than two faces, patches are joined in the order of the angles
 * around the edge. Decisions are exact and do not depend on threads. (shell_nesting.c then turns
 * each closed patch outwards, or inwards if it bounds a cavity.)
 *
 * A face *runs against* another face of its patch if the orientations of the two faces are not
 * consistent. The root of a patch is its face with the lowest index. */
#include "core/strict_fp.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "mesh/adjacency.h"
#include "mesh/mesh_parts.h"
#include "mesh/sum.h"

enum { FACE_GRAIN = 1 << 14, VERTEX_GRAIN = 1 << 13 };

/* Flags of faces, collected at the root of their patch.
 * - OPEN: there is a crowded edge that the patch does not use equally often in both directions.
 * - INCONSISTENT: two adjacent faces have opposite orientations.
 * - TWISTED: no orientation of the faces is consistent.
 * - BOUNDARY: the patch has an edge with one face.
 *
 * The other flags are for patches that were joined around crowded edges.
 * - ROOT: the face was the root of a patch before the joining.
 * - CONTRADICTED: the faces around the patch's crowded edges cannot alternate in direction.
 * - UNBALANCED: as OPEN, but for the joined patch.
 * - SEPARATE: the patch of this root becomes a separate patch again. */
enum {
    OPEN = 1,
    INCONSISTENT = 2,
    TWISTED = 4,
    BOUNDARY = 8,
    ROOT = 16,
    CONTRADICTED = 32,
    UNBALANCED = 64,
    SEPARATE = 128
};

/* A patch to make consistent: faces connected by edges that are used exactly twice, or around
 * crowded edges if that closes the patch (join_crowded). */
typedef struct patch {
    uint32_t root;
    uint32_t seed; /* first face in the source; keeps its orientation if neither the volume nor the
                      number of turned faces decides */
    bool closed;   /* the patch is a closed surface */
    bool seed_turned; /* the seed runs against the root */
    /* true: turn the seed and the faces that do not run against it; false: turn the other faces */
    bool turn_seed;
    uint64_t count, turned; /* number of faces, and of faces that run against the root */
    ebpo_sum volume;        /* six times the volume, with all faces oriented as the root is */
    double most;            /* largest absolute term of this sum */
} patch;

typedef struct orienting orienting;
/* Visits an edge at its lower vertex v. links: [uses] the uses of the edge. */
typedef ebpo_status (*edge_fn)(orienting *o, const ebpo_link *links, uint64_t uses, uint32_t v,
                               unsigned worker, ebpo_error *error);

struct orienting {
    const ebpo_mesh *mesh; /* the mesh whose faces are turned */
    unsigned threads;
    edge_fn visit;
    bool crowded_only;     /* true: `visit` is called only for crowded edges */
    ebpo_mesh_frame frame; /* frame for volumes, of which only the signs are used */
    ebpo_stars stars;
    ebpo_star *star;         /* one for each thread */
    ebpo_edge_faces *around; /* one for each thread: the faces around a crowded edge */
    bool crowded;            /* the mesh has crowded edges */
    /* [face_count] disjoint sets of faces: twice the index of a lower face of the patch, or of the
     * face itself, plus 1 if the two faces run against each other */
    uint64_t *above;
    uint8_t *flags; /* [face_count] */
    patch *patches; /* the patches with faces to turn, sorted by root */
    uint64_t patch_count, patch_capacity;
    uint64_t flipped;      /* number of faces that were turned */
    uint64_t unorientable; /* number of patches without a consistent orientation */
    pthread_mutex_t lock;  /* for the volumes of the patches */
};

/* --- joining faces to patches --- */

/* Returns 2 r for the root r of face f, plus 1 if f runs against r. Halves the path to the root;
 * any thread may do so at any time. */
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

/* Joins the patches of faces a and b. turned: 1 if a runs against b, else 0. Links the higher root
 * to the lower root, so the roots do not depend on the order of calls. Returns false if the faces
 * are already in one patch and `turned` contradicts their orientations in this patch. */
static bool join_patches(uint64_t *above, uint32_t a, uint32_t b, uint64_t turned)
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

static void set_flags(orienting *o, uint32_t face, uint8_t flags)
{
    __atomic_fetch_or(&o->flags[face], flags, __ATOMIC_RELAXED);
}

/* Joins the patches of an edge's two faces. At an edge with one face or more than two faces, only
 * sets a flag. */
static void visit_edge(orienting *o, const ebpo_link *links, uint64_t uses)
{
    uint32_t a = ebpo_link_face(&links[0]), b = ebpo_link_face(&links[uses - 1]);
    if (uses > 2) {
        __atomic_store_n(&o->crowded, true, __ATOMIC_RELAXED);
        return;
    }
    if (uses != 2 || a == b) {
        set_flags(o, a, BOUNDARY);
        return;
    }
    uint64_t turned = links[0].out == links[1].out;
    if (turned)
        set_flags(o, a, INCONSISTENT);
    if (!join_patches(o->above, a, b, turned))
        set_flags(o, a, TWISTED);
}

static ebpo_status begin_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    orienting *o = context;
    (void)worker, (void)error;
    for (uint64_t f = begin; f < end; f++) {
        o->above[f] = f << 1;
        o->flags[f] = ebpo_face_repeats_index(o->mesh->faces + 3 * f) ? BOUNDARY : 0;
    }
    return EBPO_OK;
}

static ebpo_status join_edge(orienting *o, const ebpo_link *links, uint64_t uses, uint32_t v,
                             unsigned worker, ebpo_error *error)
{
    (void)v, (void)worker, (void)error;
    visit_edge(o, links, uses);
    return EBPO_OK;
}

static ebpo_status visit_vertices(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    orienting *o = context;
    ebpo_star *star = &o->star[worker];
    ebpo_status status = EBPO_OK;
    EBPO_FOR_ITEMS_SCATTERED(o->mesh->workspace, v, begin, end) {
        if (!ebpo_star_gather(star, &o->stars, o->mesh, (uint32_t)v))
            return ebpo_fail_memory(error, star->capacity * 2 * sizeof *star->links);
        for (uint64_t i = 0, next; i < star->count && status == EBPO_OK; i = next) {
            next = ebpo_star_run_end(star, i);
            if (ebpo_link_neighbour(&star->links[i]) > v && (!o->crowded_only || next - i > 2))
                status = o->visit(o, star->links + i, next - i, (uint32_t)v, worker, error);
        }
        if (status != EBPO_OK)
            return status;
    }
    return status;
}

static ebpo_status visit_edges(orienting *o, edge_fn visit, bool crowded_only, ebpo_error *error)
{
    o->visit = visit;
    o->crowded_only = crowded_only;
    return ebpo_parallel_for(o->threads, NULL, o->mesh->vertex_count, VERTEX_GRAIN, visit_vertices,
                             o, NULL, "", error);
}

static ebpo_status join_faces(orienting *o, ebpo_error *error)
{
    ebpo_status status = ebpo_stars_build(&o->stars, o->mesh, o->threads, NULL, error);
    o->star = ebpo_alloc_zero(o->threads, sizeof *o->star);
    if (status == EBPO_OK && !o->star)
        status = ebpo_fail_memory(error, o->threads * sizeof *o->star);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(o->threads, o->mesh->workspace, o->mesh->face_count, FACE_GRAIN,
                                   begin_faces, o, NULL, "", error);
    return status == EBPO_OK ? visit_edges(o, join_edge, false, error) : status;
}

static void free_stars(orienting *o)
{
    for (unsigned t = 0; o->star && t < o->threads; t++)
        ebpo_star_free(&o->star[t]);
    free(o->star);
    ebpo_stars_free(&o->stars);
}

/* Links each face directly to its root, and collects the flags at the roots. Faces are visited in
 * ascending order, so the lower face above[f] is already linked to its root. */
static void gather_flags(orienting *o)
{
    EBPO_FOR_ITEMS_SCATTERED(o->mesh->workspace, f, 0, o->mesh->face_count) {
        uint64_t up = o->above[f], root = o->above[up >> 1] ^ (up & 1);
        o->above[f] = root;
        o->flags[root >> 1] |= o->flags[f];
    }
}

/* --- crowded edges --- */

/* Returns 2 r for the root r of the face's patch before the joining, plus 1 if the face runs
 * against r. */
static uint64_t patch_at(const orienting *o, uint32_t face)
{
    return __atomic_load_n(&o->flags[face], __ATOMIC_RELAXED) & ROOT
               ? (uint64_t)face << 1
               : __atomic_load_n(&o->above[face], __ATOMIC_RELAXED);
}

/* Lists the faces at an edge with their patches before the joining, or, if `joined`, with their
 * joined patches. Returns false when out of memory. */
static bool list_around(orienting *o, const ebpo_link *links, uint64_t uses, bool joined,
                        ebpo_edge_faces *e)
{
    e->count = 0;
    for (uint64_t i = 0; i < uses; i++) {
        uint32_t face = ebpo_link_face(&links[i]);
        uint64_t up = patch_at(o, face);
        if (joined)
            up = find_root(o->above, (uint32_t)(up >> 1)) ^ (up & 1);
        if (!ebpo_edge_faces_add(e, face, links[i].out, up))
            return false;
    }
    return true;
}

/* Sets flags at the roots of the patches that do not use the edge equally often in both directions
 * when all their faces are oriented as the root. */
static void flag_unbalanced(orienting *o, ebpo_edge_faces *e, uint8_t flags)
{
    ebpo_edge_faces_sort(e);
    for (uint64_t i = 0, next; i < e->count; i = next) {
        int64_t sum = 0;
        for (next = i; next < e->count && e->face[next].patch >> 1 == e->face[i].patch >> 1; next++)
            sum += (e->face[next].out ^ (e->face[next].patch & 1)) ? 1 : -1;
        if (sum)
            set_flags(o, (uint32_t)(e->face[i].patch >> 1), flags);
    }
}

/* Sets the flag OPEN of the patches that do not use the edge equally often in both directions. */
static ebpo_status find_open(orienting *o, const ebpo_link *links, uint64_t uses, uint32_t v,
                             unsigned worker, ebpo_error *error)
{
    ebpo_edge_faces *e = &o->around[worker];
    (void)v;
    if (!list_around(o, links, uses, false, e))
        return ebpo_fail_memory(error, uses * sizeof *e->face);
    flag_unbalanced(o, e, OPEN);
    return EBPO_OK;
}

/* Sets the flag UNBALANCED of the joined patches that do not use the edge equally often in both
 * directions. */
static ebpo_status find_unbalanced(orienting *o, const ebpo_link *links, uint64_t uses, uint32_t v,
                                   unsigned worker, ebpo_error *error)
{
    ebpo_edge_faces *e = &o->around[worker];
    (void)v;
    if (!list_around(o, links, uses, true, e))
        return ebpo_fail_memory(error, uses * sizeof *e->face);
    flag_unbalanced(o, e, UNBALANCED);
    return EBPO_OK;
}

/* Joins faces of patches that are OPEN, so that the inside and the outside of a solid alternate
 * around the edge. */
static ebpo_status join_around(orienting *o, const ebpo_link *links, uint64_t uses, uint32_t v,
                               unsigned worker, ebpo_error *error)
{
    ebpo_edge_faces *e = &o->around[worker];
    uint64_t kept = 0;
    if (!list_around(o, links, uses, false, e))
        return ebpo_fail_memory(error, uses * sizeof *e->face);
    for (uint64_t i = 0; i < e->count; i++) {
        uint8_t flags = __atomic_load_n(&o->flags[e->face[i].patch >> 1], __ATOMIC_RELAXED);
        if (flags & OPEN && !(flags & (BOUNDARY | TWISTED)))
            e->face[kept++] = e->face[i];
    }
    e->count = kept;
    bool turns = kept % 2 == 0 && ebpo_edge_faces_turn(e, o->mesh, v, ebpo_link_neighbour(links));
    if (!turns || !ebpo_edge_faces_alternate(e))
        for (uint64_t i = 0; i < kept; i++)
            set_flags(o, (uint32_t)(e->face[i].patch >> 1), INCONSISTENT);
    for (uint64_t i = 0; turns && i + 1 < kept; i++) {
        const ebpo_edge_face *a = &e->face[i], *b = a + 1;
        uint64_t turned = a->out == b->out;
        if (!join_patches(o->above, (uint32_t)(a->patch >> 1), (uint32_t)(b->patch >> 1),
                          (turned ^ a->patch ^ b->patch) & 1))
            set_flags(o, (uint32_t)(a->patch >> 1), CONTRADICTED);
    }
    return EBPO_OK;
}

/* Separates the parts of a joined patch that is not closed, or whose crowded edges demand
 * contradictory orientations. Exception: a joined patch without the flag INCONSISTENT stays joined.
 * Its faces were consistent and alternated in direction around every crowded edge before the
 * joining, for some order of coplanar faces. */
static void separate_patches(orienting *o)
{
    const uint8_t bad = CONTRADICTED | UNBALANCED;
    ebpo_workspace *workspace = o->mesh->workspace;
    EBPO_FOR_ITEMS_SCATTERED(workspace, f, 0, o->mesh->face_count) {
        if (o->flags[f] & ROOT)
            o->flags[find_root(o->above, (uint32_t)f) >> 1] |= o->flags[f] & (bad | INCONSISTENT);
    }
    EBPO_FOR_ITEMS_SCATTERED(workspace, f, 0, o->mesh->face_count) {
        if (!(o->flags[f] & ROOT))
            continue;
        uint32_t root = (uint32_t)(find_root(o->above, (uint32_t)f) >> 1);
        bool separate = o->flags[root] & INCONSISTENT && o->flags[root] & bad;
        o->flags[f] |= separate ? SEPARATE : 0;
        o->unorientable += separate && root == f && o->flags[f] & CONTRADICTED;
    }
    EBPO_FOR_ITEMS(workspace, f, 0, o->mesh->face_count) {
        if (o->flags[f] & SEPARATE)
            o->above[f] = f << 1;
        else if (o->flags[f] & ROOT)
            o->flags[f] &= (uint8_t)~OPEN;
    }
}

/* Joins patches around crowded edges if the joined patches are then closed. A patch that is closed
 * without the joining, such as a cube that shares an edge with another cube, stays separate. */
static ebpo_status join_crowded(orienting *o, ebpo_error *error)
{
    EBPO_FOR_ITEMS(o->mesh->workspace, f, 0, o->mesh->face_count)
        o->flags[f] |= o->above[f] >> 1 == f ? ROOT : 0;
    o->around = ebpo_alloc_zero(o->threads, sizeof *o->around);
    if (!o->around)
        return ebpo_fail_memory(error, o->threads * sizeof *o->around);
    ebpo_status status = visit_edges(o, find_open, true, error);
    if (status == EBPO_OK)
        status = visit_edges(o, join_around, true, error);
    if (status == EBPO_OK)
        status = visit_edges(o, find_unbalanced, true, error);
    for (unsigned t = 0; t < o->threads; t++)
        free(o->around[t].face);
    free(o->around);
    if (status != EBPO_OK)
        return status;
    separate_patches(o);
    EBPO_FOR_ITEMS_SCATTERED(o->mesh->workspace, f, 0, o->mesh->face_count) {
        uint64_t root = find_root(o->above, (uint32_t)f);
        /* in a patch without INCONSISTENT, no face is turned */
        o->above[f] = o->flags[root >> 1] & INCONSISTENT ? root : root & ~UINT64_C(1);
        o->flags[root >> 1] |= o->flags[f] & (INCONSISTENT | BOUNDARY | TWISTED);
    }
    return EBPO_OK;
}

/* --- the faces to turn --- */

/* Lists the patches with faces to turn. Returns false when out of memory. */
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
        o->patches[o->patch_count++] = (patch){ .root = (uint32_t)f,
                                                .seed = (uint32_t)f,
                                                .closed = !(o->flags[f] & (OPEN | BOUNDARY)) };
    }
    return true;
}

/* Returns the patch to turn that contains the face, or NULL. `last`: the previous result, which is
 * often the same. */
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

/* Counts the faces of each patch, and finds its seed. */
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

/* Adds a thread's part of a patch's volume. */
static void add_volume(orienting *o, patch *p, const ebpo_sum *sum, double most)
{
    pthread_mutex_lock(&o->lock);
    ebpo_sum_merge(&p->volume, sum);
    p->most = fmax(p->most, most);
    pthread_mutex_unlock(&o->lock);
}

/* Adds up the volumes of closed patches. The sum is exact, so the order in which threads add terms
 * does not matter. */
static ebpo_status measure_patches(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                   ebpo_error *error)
{
    orienting *o = context;
    const ebpo_mesh *mesh = o->mesh;
    (void)worker, (void)error;
    ebpo_sum sum = { .adds = 0 };
    patch *last = NULL;
    double base[3] = { 0, 0, 0 }, most = 0;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, begin, end) {
        patch *p = patch_of(o, f, last);
        if (!p || !p->closed)
            continue;
        if (p != last) {
            if (last)
                add_volume(o, last, &sum, most);
            sum = (ebpo_sum){ .adds = 0 };
            most = 0;
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
        most = fmax(most, fabs(term));
        ebpo_sum_add(&sum, o->above[f] & 1 ? -term : term);
    }
    if (last)
        add_volume(o, last, &sum, most);
    return EBPO_OK;
}

/* Decides which faces of a patch are turned, so that the patch has a positive volume. If the patch
 * has no volume, as few faces as possible are turned. */
static void decide_direction(patch *p)
{
    double volume = p->closed ? ebpo_sum_value(&p->volume) : 0;
    volume = ebpo_volume_is_noise(volume, p->count, p->most) ? 0 : volume;
    volume = p->seed_turned ? -volume : volume;
    uint64_t against_seed = p->seed_turned ? p->count - p->turned : p->turned;
    p->turn_seed = volume < 0 || (!(volume > 0) && against_seed > p->count - against_seed);
}

static ebpo_status flip_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    orienting *o = context;
    (void)worker, (void)error;
    uint64_t flipped = 0;
    patch *p = NULL;
    EBPO_FOR_ITEMS_SCATTERED(o->mesh->workspace, f, begin, end) {
        p = patch_of(o, f, p);
        if (!p || ((o->above[f] & 1) != p->seed_turned) == p->turn_seed)
            continue;
        ebpo_face_turn(o->mesh->faces + 3 * f);
        flipped++;
    }
    __atomic_fetch_add(&o->flipped, flipped, __ATOMIC_RELAXED);
    return EBPO_OK;
}

/* Finds the patches. Afterwards o->above has the root of each face, and o->flags the flags of each
 * root. */
static ebpo_status find_patches(orienting *o, ebpo_error *error)
{
    const ebpo_mesh *mesh = o->mesh;
    uint64_t count = mesh->face_count;
    o->threads = ebpo_thread_count(o->threads);
    o->above = ebpo_array_alloc(mesh->workspace, count, sizeof *o->above);
    o->flags = ebpo_array_alloc(mesh->workspace, count, 1);
    if (!o->above || !o->flags)
        return ebpo_workspace_fail(mesh->workspace, count * (sizeof *o->above + 1), error);
    ebpo_status status = join_faces(o, error);
    if (status == EBPO_OK)
        gather_flags(o);
    if (status == EBPO_OK && o->crowded)
        status = join_crowded(o, error);
    free_stars(o);
    return status;
}

static ebpo_status turn_patches(orienting *o, ebpo_error *error)
{
    uint64_t count = o->mesh->face_count;
    if (!list_patches(o))
        return ebpo_workspace_fail(o->mesh->workspace, o->patch_count * sizeof *o->patches, error);
    if (o->patch_count == 0)
        return EBPO_OK;
    count_faces(o);
    o->frame = ebpo_mesh_frame_of(o->mesh);
    ebpo_status status =
        ebpo_parallel_for(0, NULL, count, FACE_GRAIN, measure_patches, o, NULL, "", error);
    for (uint64_t i = 0; i < o->patch_count; i++)
        decide_direction(&o->patches[i]);
    return status == EBPO_OK
               ? ebpo_parallel_for(0, NULL, count, FACE_GRAIN, flip_faces, o, NULL, "", error)
               : status;
}

/* Lists for each face the root of its patch if the patch is closed, otherwise EBPO_NO_INDEX. */
static ebpo_status list_closed(const orienting *o, uint32_t **closed, ebpo_error *error)
{
    const ebpo_mesh *mesh = o->mesh;
    *closed = ebpo_array_alloc(mesh->workspace, mesh->face_count, sizeof **closed);
    if (!*closed)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * sizeof **closed, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, 0, mesh->face_count) {
        uint64_t root = o->above[f] >> 1;
        bool open = o->flags[root] & (OPEN | BOUNDARY | TWISTED);
        (*closed)[f] = open ? EBPO_NO_INDEX : (uint32_t)root;
    }
    return EBPO_OK;
}

static void free_all(orienting *o)
{
    pthread_mutex_destroy(&o->lock);
    ebpo_array_free(o->mesh->workspace, o->above);
    ebpo_array_free(o->mesh->workspace, o->flags);
    ebpo_array_free(o->mesh->workspace, o->patches);
}

ebpo_status ebpo_mesh_find_shells(const ebpo_mesh *mesh, unsigned threads, uint32_t **closed,
                                  ebpo_error *error)
{
    orienting o = { .mesh = mesh, .threads = threads, .lock = PTHREAD_MUTEX_INITIALIZER };
    *closed = NULL;
    ebpo_status status = find_patches(&o, error);
    if (status == EBPO_OK)
        status = list_closed(&o, closed, error);
    free_all(&o);
    return status;
}

ebpo_status ebpo_mesh_make_consistent(ebpo_mesh *mesh, ebpo_repair_record *record,
                                      uint32_t **closed, ebpo_error *error)
{
    orienting o = { .mesh = mesh, .lock = PTHREAD_MUTEX_INITIALIZER };
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status == EBPO_OK)
        status = find_patches(&o, error);
    if (status == EBPO_OK && closed)
        status = list_closed(&o, closed, error);
    if (status == EBPO_OK)
        status = turn_patches(&o, error);
    if (status == EBPO_OK && record) {
        record->orient = true;
        record->flipped_faces += o.flipped;
        record->unorientable_components += o.unorientable;
    }
    free_all(&o);
    return status;
}
