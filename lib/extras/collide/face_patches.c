/* Finds patches of faces: the connected components of a mesh.
 *
 * ebpo_face_patches connects faces by corners with equal coordinates, ebpo_edge_patches by edges
 * that exactly two faces share. Connected faces are joined in a disjoint-set forest, in which the
 * root of a tree is the first face of the patch. A hash table gives corners with equal coordinates
 * the same index (0 and -0 are equal).
 *
 * If no face of a patch intersects another model, the whole patch is inside or outside the other
 * model. The relation of two models and the exact volumes of Boolean operations rely on this fact.
 */
#include "core/strict_fp.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "extras/collide/face_patches.h"
#include "extras/collide/hierarchy_walk.h"
#include "geometry/predicates.h"

/* --- joined faces --- */

/* Returns the root of the tree of `face` in the forest: the face with the least index among all
 * faces that have been joined with `face`. parent[face]: parent of a face in its tree; the root is
 * its own parent. Shortens the paths to the root. */
static inline uint32_t first_joined(uint32_t *parent, uint32_t face)
{
    while (parent[face] != face) {
        parent[face] = parent[parent[face]];
        face = parent[face];
    }
    return face;
}

/* Joins the trees of two faces. */
static inline void join_faces(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = first_joined(parent, a);
    b = first_joined(parent, b);
    parent[a > b ? a : b] = a > b ? b : a;
}

/* Returns a hash of a corner's coordinates. */
static uint64_t hash_of(const double x[3])
{
    uint64_t bits[3], h = 0;
    memcpy(bits, x, sizeof bits);
    for (int k = 0; k < 3; k++) {
        h = (h ^ bits[k]) * UINT64_C(0x9e3779b97f4a7c15);
        h ^= h >> 32;
    }
    return h;
}

/* Returns true if two corners have equal coordinates. */
static bool same_corner(const double p[3], const double q[3])
{
    return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
}

/* Returns the entry of the table that has the corner x, or, if no entry has it, the free entry for
 * the corner. */
static uint32_t *find_corner(const ebpo_corner_ids *ids, const double x[3])
{
    uint64_t i = hash_of(x) & (ids->table_size - 1);
    while (ids->table[i] && !same_corner(ids->at[ids->table[i] - 1], x))
        i = (i + 1) & (ids->table_size - 1);
    return &ids->table[i];
}

/* Replaces the table by a table with `size` entries, a power of two. Returns false if memory is
 * short. */
static bool enlarge_table(ebpo_corner_ids *ids, uint64_t size)
{
    uint32_t *table = ebpo_alloc_zero(size, sizeof *table);
    if (!table)
        return false;
    free(ids->table);
    ids->table = table;
    ids->table_size = size;
    for (uint64_t i = 0; i < ids->count; i++)
        *find_corner(ids, ids->at[i]) = (uint32_t)i + 1;
    return true;
}

bool ebpo_corner_id(ebpo_corner_ids *ids, const double x[3], uint32_t *id)
{
    const double corner[3] = { x[0] + 0.0, x[1] + 0.0, x[2] + 0.0 }; /* turns -0 into 0 */
    if ((2 * ids->count >= ids->table_size &&
         !enlarge_table(ids, ids->table_size ? 2 * ids->table_size : 1024)) ||
        ids->count >= UINT32_MAX - 1)
        return false;
    uint32_t *at = find_corner(ids, corner);
    if (*at == 0) {
        if (!ebpo_grow(&ids->at, &ids->capacity, ids->count + 1, sizeof *ids->at))
            return false;
        memcpy(ids->at[ids->count++], corner, sizeof corner);
        *at = (uint32_t)ids->count;
    }
    *id = *at - 1;
    return true;
}

bool ebpo_corner_ids_reserve(ebpo_corner_ids *ids, uint64_t count)
{
    uint64_t size = ebpo_hash_slots(2 * count);
    return size <= ids->table_size || enlarge_table(ids, size);
}

void ebpo_corner_ids_free(ebpo_corner_ids *ids)
{
    free(ids->at);
    free(ids->table);
    *ids = (ebpo_corner_ids){ 0 };
}

/* --- patches over corners --- */

typedef struct corner_joining {
    ebpo_corner_ids corners;
    uint32_t *face; /* [corner] the first face that has this corner */
    uint64_t face_capacity;
} corner_joining;

/* Joins a face with the faces that have one of its corners. Returns false if memory is short. */
static bool join_face(corner_joining *j, uint32_t *patch, uint32_t face, const double t[3][3])
{
    for (int i = 0; i < 3; i++) {
        uint32_t id;
        uint64_t known = j->corners.count;
        if (!ebpo_corner_id(&j->corners, t[i], &id) ||
            !ebpo_grow(&j->face, &j->face_capacity, j->corners.count, sizeof *j->face))
            return false;
        if (id < known)
            join_faces(patch, j->face[id], face);
        else
            j->face[id] = face;
    }
    return true;
}

ebpo_status ebpo_face_patches(const ebpo_accel *subtree, const uint32_t *slots,
                              const uint64_t *omitted, uint32_t **out, ebpo_error *error)
{
    corner_joining j = { 0 };
    uint32_t count = subtree->face_count - subtree->shared_count;
    uint32_t *patch = ebpo_alloc(count, sizeof *patch);
    bool ok = patch != NULL;
    for (uint32_t f = 0; f < count && ok; f++)
        patch[f] = f;
    for (uint32_t f = 0; f < count && ok; f++) {
        double t[3][3];
        uint64_t number = subtree->first_face + f;
        if (omitted[number / 64] >> number % 64 & 1)
            continue;
        ebpo_accel_triangle(subtree, slots[subtree->shared_count + f], t);
        ok = join_face(&j, patch, f, (const double(*)[3])t);
    }
    for (uint32_t f = 0; f < count && ok; f++)
        patch[f] = first_joined(patch, f);
    ebpo_corner_ids_free(&j.corners);
    free(j.face);
    if (!ok) {
        free(patch);
        return ebpo_fail_memory(error, count * sizeof *patch);
    }
    *out = patch;
    return EBPO_OK;
}

/* --- patches over edges --- */

/* Each edge of each face is an entry in the list of the edge's lesser corner (the corner with the
 * lesser index). The entry has the edge's greater corner and the face. If exactly two entries of a
 * list have the same greater corner, two faces share the edge, and are joined. */

#define NO_CORNER UINT32_MAX

typedef struct edge_lists {
    const ebpo_accel *whole;
    uint32_t (*corner)[3]; /* [face] corners of the face; NO_CORNER: the face has no area */
    uint64_t *end;   /* [corner] end of the corner's list, which begins at the end of the previous
                      * list */
    uint64_t *edge;  /* the lists; an entry is greater corner << 32 | face */
    uint32_t *patch; /* [face] the forest of joined faces */
} edge_lists;

/* Sets the corners of all faces, and makes each face a patch. Returns false if memory is short. */
static bool number_corners(edge_lists *e, ebpo_corner_ids *ids, const uint32_t *slots,
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

/* Sets *lesser and *greater to the corners of edge i of face f. Returns false if the face has no
 * area. */
static bool edge_of(const edge_lists *e, uint32_t f, int i, uint32_t *lesser, uint32_t *greater)
{
    uint32_t a = e->corner[f][i], b = e->corner[f][i == 2 ? 0 : i + 1];
    *lesser = a < b ? a : b;
    *greater = a < b ? b : a;
    return e->corner[f][0] != NO_CORNER;
}

/* Counts the entries of all lists, then fills the lists. */
static void list_edges(edge_lists *e, uint64_t corners)
{
    uint32_t lesser, greater;
    for (uint32_t f = 0; f < e->whole->face_count; f++)
        for (int i = 0; i < 3; i++)
            if (edge_of(e, f, i, &lesser, &greater))
                e->end[lesser + 1]++;
    for (uint64_t c = 0; c < corners; c++)
        e->end[c + 1] += e->end[c];
    for (uint32_t f = 0; f < e->whole->face_count; f++)
        for (int i = 0; i < 3; i++)
            if (edge_of(e, f, i, &lesser, &greater))
                e->edge[e->end[lesser]++] = (uint64_t)greater << 32 | f;
}

/* Compares two entries for qsort. */
static int compare_edges(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Sorts the list of a corner, and joins the faces of each edge that exactly two faces share. */
static void join_list(edge_lists *e, uint64_t *list, uint64_t count)
{
    if (count > 1)
        qsort(list, count, sizeof *list, compare_edges);
    for (uint64_t i = 0, next; i < count; i = next) {
        for (next = i + 1; next < count && list[next] >> 32 == list[i] >> 32;)
            next++;
        if (next - i == 2)
            join_faces(e->patch, (uint32_t)list[i], (uint32_t)list[i + 1]);
    }
}

/* Makes the lists, and sets e->patch to the result. Returns false if memory is short. */
static bool join_edges(edge_lists *e, uint64_t corners)
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
        e->patch[f] = first_joined(e->patch, f);
    return true;
}

ebpo_status ebpo_edge_patches(const ebpo_accel *whole, const uint32_t *slots,
                              const ebpo_posing *posing, uint32_t **out, ebpo_error *error)
{
    ebpo_corner_ids ids = { 0 };
    edge_lists e = { .whole = whole };
    e.corner = ebpo_alloc(whole->face_count, sizeof *e.corner);
    e.patch = ebpo_alloc(whole->face_count, sizeof *e.patch);
    bool ok = e.corner && e.patch && number_corners(&e, &ids, slots, posing);
    uint64_t corners = ids.count;
    ebpo_corner_ids_free(&ids);
    ok = ok && join_edges(&e, corners);
    free(e.corner);
    free(e.end);
    free(e.edge);
    if (!ok) {
        free(e.patch);
        /* the arrays have approximately 60 bytes for each face */
        return ebpo_fail_memory(error, whole->face_count * (uint64_t)60);
    }
    *out = e.patch;
    return EBPO_OK;
}
