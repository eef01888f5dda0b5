/* Computes the adjacency of faces: the faces at each vertex (stars), faces that have the same three
 * vertices, and the faces at an edge, sorted around the edge by exact predicates. */
#include "core/strict_fp.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "geometry/predicates.h"
#include "mesh/adjacency.h"

enum {
    FACE_GRAIN = 1 << 15, /* number of faces for each call of a thread's function */
    INSERTION_LIMIT = 48  /* longer lists are sorted by qsort, shorter lists by insertion */
};

/* Arguments of the threads that build the stars. */
typedef struct build {
    const ebpo_mesh *mesh;
    ebpo_stars *stars;
} build;

/* Fails because a face has a vertex index that is out of range. */
static ebpo_status bad_index(const ebpo_mesh *mesh, uint64_t face, uint32_t vertex,
                             ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(mesh),
                          "face %llu names vertex %lu, but there are %llu vertices; "
                          "repair the file or drop the face",
                          (unsigned long long)ebpo_mesh_source_face(mesh, face),
                          (unsigned long)vertex, (unsigned long long)mesh->vertex_count);
}

/* Counts, for faces begin .. end - 1, the faces in the star of each vertex, and checks their vertex
 * indices. A face that repeats a vertex is counted once at this vertex. */
static ebpo_status count_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    (void)worker;
    build *b = context;
    EBPO_FOR_ITEMS_SCATTERED(b->mesh->workspace, f, begin, end) {
        const uint32_t *v = b->mesh->faces + 3 * f;
        for (int k = 0; k < 3; k++)
            if (v[k] >= b->mesh->vertex_count)
                return bad_index(b->mesh, f, v[k], error);
        __atomic_fetch_add(&b->stars->first[v[0]], 1, __ATOMIC_RELAXED);
        if (v[1] != v[0])
            __atomic_fetch_add(&b->stars->first[v[1]], 1, __ATOMIC_RELAXED);
        if (v[2] != v[0] && v[2] != v[1])
            __atomic_fetch_add(&b->stars->first[v[2]], 1, __ATOMIC_RELAXED);
    }
    return EBPO_OK;
}

/* Stores a face in the star of vertex v. first[v] is initially the end of the star in stars->face,
 * and counts down to the beginning of the star. */
static inline void put_face(ebpo_stars *stars, uint32_t v, uint64_t f)
{
    stars->face[__atomic_fetch_sub(&stars->first[v], 1, __ATOMIC_RELAXED) - 1] = (uint32_t)f;
}

/* Stores faces begin .. end - 1 in the stars of their vertices. */
static ebpo_status place_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    (void)worker, (void)error;
    build *b = context;
    EBPO_FOR_ITEMS_SCATTERED(b->mesh->workspace, f, begin, end) {
        const uint32_t *v = b->mesh->faces + 3 * f;
        put_face(b->stars, v[0], f);
        if (v[1] != v[0])
            put_face(b->stars, v[1], f);
        if (v[2] != v[0] && v[2] != v[1])
            put_face(b->stars, v[2], f);
    }
    return EBPO_OK;
}

ebpo_status ebpo_stars_build(ebpo_stars *out, const ebpo_mesh *mesh, unsigned threads,
                             const ebpo_progress *progress, ebpo_error *error)
{
    *out = (ebpo_stars){ .workspace = mesh->workspace };
    build b = { mesh, out };
    out->first = ebpo_array_zero(mesh->workspace, mesh->vertex_count + 1, sizeof *out->first);
    if (!out->first)
        return ebpo_workspace_fail(mesh->workspace, (mesh->vertex_count + 1) * sizeof *out->first,
                                   error);
    ebpo_status status = ebpo_parallel_for(threads, NULL, mesh->face_count, FACE_GRAIN, count_faces,
                                           &b, progress, "counting faces at vertices", error);
    if (status != EBPO_OK)
        goto done;
    uint64_t total = 0;
    EBPO_FOR_ITEMS(mesh->workspace, v, 0, mesh->vertex_count)
        out->first[v] = total += out->first[v];
    out->first[mesh->vertex_count] = total;
    out->face = ebpo_array_alloc(mesh->workspace, total, sizeof *out->face);
    if (!out->face) {
        status = ebpo_workspace_fail(mesh->workspace, total * sizeof *out->face, error);
        goto done;
    }
    status = ebpo_parallel_for(threads, NULL, mesh->face_count, FACE_GRAIN, place_faces, &b,
                               progress, "linking faces to vertices", error);
done:
    if (status != EBPO_OK)
        ebpo_stars_free(out);
    return status;
}

void ebpo_stars_free(ebpo_stars *stars)
{
    ebpo_array_free(stars->workspace, stars->first);
    ebpo_array_free(stars->workspace, stars->face);
    *stars = (ebpo_stars){ .first = NULL };
}

static int compare_links(const void *a, const void *b)
{
    const ebpo_link *x = a, *y = b;
    if (x->key != y->key)
        return x->key < y->key ? -1 : 1;
    return (int)x->corner - (int)y->corner;
}

static void sort_links(ebpo_link *links, uint64_t count)
{
    if (count > INSERTION_LIMIT) {
        qsort(links, count, sizeof *links, compare_links);
        return;
    }
    for (uint64_t i = 1; i < count; i++) {
        ebpo_link x = links[i];
        uint64_t j = i;
        for (; j > 0 && compare_links(&links[j - 1], &x) > 0; j--)
            links[j] = links[j - 1];
        links[j] = x;
    }
}

static inline void add_link(ebpo_star *star, uint32_t neighbour, uint32_t face, uint32_t entry,
                            int out, int corner)
{
    star->links[star->count++] = (ebpo_link){ .key = (uint64_t)neighbour << 32 | face,
                                              .entry = entry,
                                              .out = (uint8_t)out,
                                              .corner = (uint8_t)corner };
}

bool ebpo_star_gather(ebpo_star *star, const ebpo_stars *stars, const ebpo_mesh *mesh, uint32_t v)
{
    uint64_t degree = ebpo_stars_degree(stars, v);
    star->count = star->faces = 0;
    star->workspace = mesh->workspace;
    if (!ebpo_array_grow_late(mesh->workspace, &star->links, &star->capacity, 2 * degree,
                              sizeof *star->links))
        return false;
    const uint32_t *faces = stars->face + stars->first[v];
    for (uint64_t i = 0; i < degree; i++) {
        const uint32_t *c = mesh->faces + 3 * (uint64_t)faces[i];
        uint32_t entry = ebpo_face_repeats_index(c) ? EBPO_NO_INDEX : (uint32_t)star->faces++;
        for (int k = 0; k < 3; k++) {
            uint32_t from = c[k], to = c[k == 2 ? 0 : k + 1];
            if (from != to && from == v)
                add_link(star, to, faces[i], entry, 1, k);
            else if (from != to && to == v)
                add_link(star, from, faces[i], entry, 0, k);
        }
    }
    sort_links(star->links, star->count);
    return true;
}

void ebpo_star_free(ebpo_star *star)
{
    ebpo_array_free(star->workspace, star->links);
    *star = (ebpo_star){ .links = NULL };
}

uint64_t ebpo_star_find(const ebpo_star *star, uint32_t neighbour)
{
    uint64_t low = 0, high = star->count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (ebpo_link_neighbour(&star->links[middle]) < neighbour)
            low = middle + 1;
        else
            high = middle;
    }
    return low < star->count && ebpo_link_neighbour(&star->links[low]) == neighbour ? low
                                                                                    : star->count;
}

static int compare_faces(const void *a, const void *b)
{
    const ebpo_same_face *x = a, *y = b;
    if (x->corners != y->corners)
        return x->corners < y->corners ? -1 : 1;
    return x->source < y->source ? -1 : x->source > y->source;
}

static void sort_faces(ebpo_same_face *item, uint64_t count)
{
    if (count > INSERTION_LIMIT) {
        qsort(item, count, sizeof *item, compare_faces);
        return;
    }
    for (uint64_t i = 1; i < count; i++) {
        ebpo_same_face x = item[i];
        uint64_t j = i;
        for (; j > 0 && compare_faces(&item[j - 1], &x) > 0; j--)
            item[j] = item[j - 1];
        item[j] = x;
    }
}

bool ebpo_same_faces_gather(ebpo_same_faces *out, const ebpo_stars *stars, const ebpo_mesh *mesh,
                            uint32_t v)
{
    uint64_t begin = stars->first[v], end = stars->first[v + (uint64_t)1];
    out->workspace = mesh->workspace;
    out->count = 0;
    if (!ebpo_array_grow_late(mesh->workspace, &out->item, &out->capacity, end - begin,
                              sizeof *out->item))
        return false;
    for (uint64_t i = begin; i < end; i++) {
        uint32_t f = stars->face[i];
        const uint32_t *c = mesh->faces + 3 * (uint64_t)f;
        if (c[0] < v || c[1] < v || c[2] < v || ebpo_face_repeats_index(c))
            continue;
        uint32_t p = c[0] == v ? c[1] : c[0], q = c[2] == v ? c[1] : c[2];
        out->item[out->count++] =
            (ebpo_same_face){ p < q ? (uint64_t)p << 32 | q : (uint64_t)q << 32 | p,
                              (uint32_t)ebpo_mesh_source_face(mesh, f), f };
    }
    sort_faces(out->item, out->count);
    return true;
}

void ebpo_same_faces_free(ebpo_same_faces *faces)
{
    ebpo_array_free(faces->workspace, faces->item);
}

typedef struct edge {
    double v[3], w[3];
} edge;

bool ebpo_edge_faces_add(ebpo_edge_faces *e, uint32_t face, uint8_t out, uint64_t patch)
{
    if (!ebpo_grow(&e->face, &e->capacity, e->count + 1, sizeof *e->face))
        return false;
    e->face[e->count++] = (ebpo_edge_face){ .patch = patch, .face = face, .out = out };
    return true;
}

static int compare_patches(const void *x, const void *y)
{
    const ebpo_edge_face *a = x, *b = y;
    return a->patch < b->patch ? -1 : a->patch > b->patch;
}

void ebpo_edge_faces_sort(ebpo_edge_faces *e)
{
    if (e->count > 1)
        qsort(e->face, e->count, sizeof *e->face, compare_patches);
}

/* Returns the sign of the first nonzero component of the normal of the face v, w, p, and sets *axis
 * to the axis of that component. */
static int normal_sign(const edge *e, const double p[3], int *axis)
{
    for (*axis = 0; *axis < 3; ++*axis) {
        int sign = ebpo_normal_sign(*axis, e->v, e->w, p);
        if (sign)
            return sign;
    }
    return 0;
}

/* Compares the angles of two faces around the edge. Returns less than 0 if a comes first, 0 if both
 * have the same angle. Quarter 0 is the angle zero and quarter 2 is a half turn, so two faces in
 * quarter 0, or two faces in quarter 2, have the same angle. */
static int compare_angles(const ebpo_edge_face *a, const ebpo_edge_face *b, const edge *e)
{
    if (a->quarter != b->quarter)
        return a->quarter < b->quarter ? -1 : 1;
    return a->quarter % 2 ? -ebpo_orient3d(e->v, e->w, a->at, b->at) : 0;
}

/* Compares two faces by angle. Compares coplanar faces by their source indices. */
static int compare_turn(const void *x, const void *y, void *context)
{
    const ebpo_edge_face *a = x, *b = y;
    int by_angle = compare_angles(a, b, context);
    if (by_angle)
        return by_angle;
    int by_source = a->source < b->source ? -1 : a->source > b->source;
    return a->reversed ? -by_source : by_source;
}

bool ebpo_edge_faces_turn(ebpo_edge_faces *e, const ebpo_mesh *mesh, uint32_t v, uint32_t w)
{
    edge ends;
    int first_sign = 0, first_axis = 0;
    ebpo_mesh_position(mesh, v, ends.v);
    ebpo_mesh_position(mesh, w, ends.w);
    for (uint64_t i = 0; i < e->count; i++) {
        ebpo_edge_face *f = &e->face[i];
        const uint32_t *corner = mesh->faces + 3 * (uint64_t)f->face;
        int k = 0, axis;
        while (corner[k] == v || corner[k] == w)
            k++;
        ebpo_mesh_position(mesh, corner[k], f->at);
        int sign = normal_sign(&ends, f->at, &axis);
        if (!sign)
            return false;
        if (i == 0)
            first_sign = sign, first_axis = axis;
        int side = ebpo_orient3d(ends.v, ends.w, e->face[0].at, f->at);
        bool same_side = ebpo_normal_sign(first_axis, ends.v, ends.w, f->at) == first_sign;
        f->quarter = side > 0 ? 1 : side < 0 ? 3 : same_side ? 0 : 2;
        f->reversed = sign < 0;
        f->source = ebpo_mesh_source_face(mesh, f->face);
    }
    if (e->count > 1)
        ebpo_sort_with(e->face, e->count, sizeof *e->face, compare_turn, &ends);
    for (uint64_t i = 1; i < e->count; i++)
        e->face[i].layered = compare_angles(&e->face[i - 1], &e->face[i], &ends) == 0;
    return true;
}

/* Returns true if the faces can alternate in direction when faces at the same angle may change
 * places. Alternation requires a direction at each position of the list. So among the faces at one
 * angle, the number of faces that run along the edge must equal the number that their positions
 * require. `first` is 1 if the face at the first position must run along the edge. */
static bool alternate_from(const ebpo_edge_faces *e, unsigned first)
{
    int64_t surplus = 0;
    for (uint64_t i = 0; i < e->count; i++) {
        if (!e->face[i].layered && surplus)
            return false;
        surplus += (int64_t)e->face[i].out - (int64_t)((i + first) % 2);
    }
    return surplus == 0;
}

bool ebpo_edge_faces_alternate(const ebpo_edge_faces *e)
{
    return alternate_from(e, 0) || alternate_from(e, 1);
}
