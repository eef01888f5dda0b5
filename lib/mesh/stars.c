#include "mesh/stars.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"

enum { FACE_GRAIN = 1 << 15, INSERTION_LIMIT = 48 };

typedef struct build {
    const ebpo_mesh *mesh;
    ebpo_stars *stars;
} build;

static ebpo_status bad_index(const ebpo_mesh *mesh, uint64_t face, uint32_t vertex,
                             ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(mesh),
                          "face %llu names vertex %lu, but there are %llu vertices; "
                          "repair the file or drop the face",
                          (unsigned long long)ebpo_mesh_source_face(mesh, face),
                          (unsigned long)vertex, (unsigned long long)mesh->vertex_count);
}

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

/* first[v] holds the row's end before, and counts down to its begin. */
static inline void put(ebpo_stars *stars, uint32_t v, uint64_t f)
{
    stars->face[__atomic_fetch_sub(&stars->first[v], 1, __ATOMIC_RELAXED) - 1] = (uint32_t)f;
}

static ebpo_status place_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    (void)worker, (void)error;
    build *b = context;
    EBPO_FOR_ITEMS_SCATTERED(b->mesh->workspace, f, begin, end) {
        const uint32_t *v = b->mesh->faces + 3 * f;
        put(b->stars, v[0], f);
        if (v[1] != v[0])
            put(b->stars, v[1], f);
        if (v[2] != v[0] && v[2] != v[1])
            put(b->stars, v[2], f);
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
