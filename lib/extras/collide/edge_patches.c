/* Each edge is listed at its corner of the lesser number, as the other corner and the face; what
 * stands twice in a sorted list connects. */
#include "core/strict_fp.h"

#include "extras/collide/edge_patches.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/collide/corner_ids.h"
#include "extras/collide/joined_faces.h"
#include "extras/collide/pair_walk.h"
#include "geometry/predicates.h"

#define NO_CORNER UINT32_MAX

typedef struct edges {
    const ebpo_accel *whole;
    uint32_t (*corner)[3]; /* of each face; NO_CORNER: it has no area */
    uint64_t *end;         /* of each corner's list: it begins where that of the one before ends */
    uint64_t *edge;        /* other corner << 32 | face */
    uint32_t *patch;
} edges;

static bool number_corners(edges *e, ebpo_corner_ids *ids, const uint32_t *slots,
                           const ebpo_posing *posing)
{
    for (uint32_t f = 0; f < e->whole->face_count; f++) {
        double t[3][3];
        ebpo_posed_triangle(e->whole, posing, slots[f], t);
        bool area = !ebpo_zero_area(t[0], t[1], t[2]);
        e->patch[f] = f;
        e->corner[f][0] = NO_CORNER;
        for (int i = 0; i < 3 && area; i++)
            if (!ebpo_corner_id(ids, t[i], &e->corner[f][i]))
                return false;
    }
    return true;
}

/* Edge i of a face: its lesser corner and the other one. False: the face has no area. */
static bool edge_of(const edges *e, uint32_t f, int i, uint32_t *lesser, uint32_t *other)
{
    uint32_t a = e->corner[f][i], b = e->corner[f][i == 2 ? 0 : i + 1];
    *lesser = a < b ? a : b;
    *other = a < b ? b : a;
    return e->corner[f][0] != NO_CORNER;
}

/* Counts first, then fills lists from their ends. */
static void list_edges(edges *e, uint64_t corners)
{
    uint32_t at, other;
    for (uint32_t f = 0; f < e->whole->face_count; f++)
        for (int i = 0; i < 3; i++)
            if (edge_of(e, f, i, &at, &other))
                e->end[at + 1]++;
    for (uint64_t c = 0; c < corners; c++)
        e->end[c + 1] += e->end[c];
    for (uint32_t f = 0; f < e->whole->face_count; f++)
        for (int i = 0; i < 3; i++)
            if (edge_of(e, f, i, &at, &other))
                e->edge[e->end[at]++] = (uint64_t)other << 32 | f;
}

static int compare(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

static void join_list(edges *e, uint64_t *list, uint64_t count)
{
    if (count > 1)
        qsort(list, count, sizeof *list, compare);
    for (uint64_t i = 0, next; i < count; i = next) {
        for (next = i + 1; next < count && list[next] >> 32 == list[i] >> 32;)
            next++;
        if (next - i == 2)
            ebpo_join_faces(e->patch, (uint32_t)list[i], (uint32_t)list[i + 1]);
    }
}

static bool join(edges *e, uint64_t corners)
{
    uint64_t faces = e->whole->face_count;
    e->end = ebpo_alloc_zero(corners + 1, sizeof *e->end);
    e->edge = ebpo_alloc(3 * faces, sizeof *e->edge);
    if (!e->end || !e->edge)
        return false;
    list_edges(e, corners);
    for (uint64_t c = 0; c < corners; c++) {
        uint64_t begin = c ? e->end[c - 1] : 0;
        join_list(e, e->edge + begin, e->end[c] - begin);
    }
    for (uint32_t f = 0; f < faces; f++)
        e->patch[f] = ebpo_joined_first(e->patch, f);
    return true;
}

ebpo_status ebpo_edge_patches(const ebpo_accel *whole, const uint32_t *slots,
                              const ebpo_posing *posing, uint32_t **out, ebpo_error *error)
{
    ebpo_corner_ids ids = { 0 };
    edges e = { .whole = whole };
    e.corner = ebpo_alloc(whole->face_count, sizeof *e.corner);
    e.patch = ebpo_alloc(whole->face_count, sizeof *e.patch);
    bool fine = e.corner && e.patch && number_corners(&e, &ids, slots, posing);
    uint64_t corners = ids.count;
    ebpo_corner_ids_free(&ids);
    fine = fine && join(&e, corners);
    free(e.corner);
    free(e.end);
    free(e.edge);
    if (!fine) {
        free(e.patch);
        return ebpo_fail_memory(error, whole->face_count * (uint64_t)60);
    }
    *out = e.patch;
    return EBPO_OK;
}
