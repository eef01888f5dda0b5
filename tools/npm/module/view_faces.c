/* Reads faces of leaves for drawing, for the WebAssembly module of viewers: corners, and colours
 * from the file's attributes. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/file.h>

#include "format/face_colours.h"
#include "format/file_in.h"
#include "format/pick_rows.h"
#include "format/reader.h"
#include "format/schema.h"
#include "format/subtree_index.h"
#include "geometry/level_nodes.h"
#include "module.h"

enum { LISTS = EBPO_NEEDS_ALWAYS | EBPO_NEEDS_MESH };

/* The position of a leaf in the file. */
typedef struct wanted_leaf {
    double level;
    double group;   /* index of the leaf's group (the eight children of a node) in the level */
    double octant;  /* index of the leaf in the group */
    double subtree; /* index of the leaf's subtree; -1: the file does not store the level by
                     * subtree */
} wanted_leaf;

/* Result arrays of ebpo_js_leaf_faces. */
enum {
    FACE_COUNTS,  /* uint32 for each leaf: number of its faces */
    FACE_NUMBERS, /* uint32: faces (indices in the file), leaf after leaf, ascending in each leaf */
    FACE_CORNERS, /* double or float [9] for each face: its corners */
    FACE_COLOURS, /* uint8 [3][3] for each face: red, green and blue of the corners */
    FACE_ROWS     /* uint32 [3] for each face: indices of its vertices in the file */
};

/* If at most this number of groups is between two leaves, these groups are read too, in one run
 * with the leaves. Two runs would cost more, because for each run the nodes before its first group
 * must be counted. */
enum { GAP_GROUPS = 32 };

/* Compares by level, then by group, for qsort. */
static int compare_leaves(const void *a, const void *b)
{
    const wanted_leaf *x = *(const wanted_leaf *const *)a, *y = *(const wanted_leaf *const *)b;
    double d = x->level != y->level ? x->level - y->level : x->group - y->group;
    return (d > 0) - (d < 0);
}

/* The leaves of one level, in the order of their groups, and the groups that are read for them. */
typedef struct leaf_reading {
    const wanted_leaf **leaf;
    uint32_t count;
    ebpo_run *run; /* [count] */
    uint32_t run_count;
    ebpo_level level;
} leaf_reading;

/* Makes runs of groups that contain all leaves. */
static void make_runs(leaf_reading *r)
{
    r->run_count = 0;
    for (uint32_t i = 0; i < r->count; i++) {
        uint64_t group = (uint64_t)r->leaf[i]->group;
        ebpo_run *last = r->run_count ? &r->run[r->run_count - 1] : NULL;
        if (last && group <= last->group + last->groups + GAP_GROUPS)
            last->groups = group + 1 - last->group;
        else
            r->run[r->run_count++] = (ebpo_run){ .group = group, .groups = 1 };
    }
}

/* Calls visit(user, i, at) for each leaf i of the reading; `at` is the index of the leaf among the
 * leaves of r->level. Returns false if a wanted node is not a leaf. */
static bool visit_leaves(const leaf_reading *r, int level,
                         void (*visit)(void *, uint32_t, uint64_t), void *user)
{
    uint64_t at = 0, before = 0; /* index of the group in r->level; number of leaves before it */
    uint32_t i = 0;
    unsigned octants = level ? 8 : 1;
    for (uint32_t k = 0; k < r->run_count; k++)
        for (uint64_t g = 0; g < r->run[k].groups; g++, at++) {
            uint16_t types = r->level.types[at];
            for (; i < r->count && (uint64_t)r->leaf[i]->group == r->run[k].group + g; i++) {
                unsigned octant = (unsigned)r->leaf[i]->octant & 7;
                if (ebpo_group_type(types, octant) != EBPO_LEAF)
                    return false;
                visit(user, i, before + ebpo_group_count(types, EBPO_LEAF, octant));
            }
            before += ebpo_group_count(types, EBPO_LEAF, octants);
        }
    return true;
}

/* Lists of faces of leaves in the order of the request. */
typedef struct face_lists {
    const wanted_leaf *wanted;
    leaf_reading *reading;
    /* [leaves of the level + 1] index in leaf_refs of a leaf's first reference */
    uint64_t *ref_begin;
    /* The other arrays have an entry for each leaf of the request. References are faces that an
     * earlier leaf lists, too (ebpo_level). */
    uint32_t *first;  /* first new face */
    uint32_t *fresh;  /* number of new faces */
    uint32_t *counts; /* number of references */
    uint32_t **refs;  /* references */
} face_lists;

/* Stores the list of leaf i of the reading, which is leaf `at` of the level. */
static void take_list(void *user, uint32_t i, uint64_t at)
{
    face_lists *f = user;
    const ebpo_level *level = &f->reading->level;
    size_t leaf = (size_t)(f->reading->leaf[i] - f->wanted);
    f->first[leaf] = (uint32_t)level->leaf_first[at];
    f->fresh[leaf] = level->leaf_new[at];
    f->counts[leaf] = level->leaf_ref_count[at];
    f->refs[leaf] = malloc((level->leaf_ref_count[at] + 1) * sizeof **f->refs);
    if (f->refs[leaf] && level->leaf_ref_count[at])
        memcpy(f->refs[leaf], level->leaf_refs + f->ref_begin[at],
               level->leaf_ref_count[at] * sizeof **f->refs);
}

/* Reads the lists of the leaves of one level. */
static ebpo_status read_lists(ebpo_js_object *object, face_lists *f)
{
    leaf_reading *r = f->reading;
    int number = (int)r->leaf[0]->level;
    make_runs(r);
    ebpo_status status = ebpo_pick_level(object->chunks, number, r->run, r->run_count, LISTS,
                                         &r->level, &object->error);
    if (status != EBPO_OK)
        return status;
    f->ref_begin = malloc((size_t)(r->level.leaf_count + 1) * sizeof *f->ref_begin);
    if (!f->ref_begin) {
        ebpo_level_free(&r->level);
        return object->error.status = EBPO_E_MEMORY;
    }
    f->ref_begin[0] = 0;
    for (uint64_t i = 0; i < r->level.leaf_count; i++)
        f->ref_begin[i + 1] = f->ref_begin[i] + r->level.leaf_ref_count[i];
    if (!visit_leaves(r, number, take_list, f))
        status = object->error.status = EBPO_E_ARGUMENT;
    free(f->ref_begin);
    ebpo_level_free(&r->level);
    return status;
}

/* Appends the indices of each leaf's faces: the references, then the new faces. */
static ebpo_status put_lists(ebpo_js_object *object, const face_lists *f, uint32_t count)
{
    bool ok = true;
    for (uint32_t i = 0; i < count && ok; i++) {
        uint32_t faces = f->counts[i] + f->fresh[i];
        uint32_t *to = f->refs[i] && ebpo_js_put(object, FACE_COUNTS, &faces, 4) == EBPO_OK
                           ? ebpo_js_extend(object, FACE_NUMBERS, faces, sizeof *to)
                           : NULL;
        ok = to != NULL;
        for (uint32_t k = 0; k < faces && ok; k++)
            to[k] = k < f->counts[i] ? f->refs[i][k] : f->first[i] + (k - f->counts[i]);
    }
    return ok ? EBPO_OK : EBPO_E_MEMORY;
}

/* Reads the face lists of all wanted leaves, level by level, and appends them to the result arrays.
 */
static ebpo_status find_faces(ebpo_js_object *object, const wanted_leaf *wanted, uint32_t count)
{
    const wanted_leaf **leaf = malloc((count + 1) * sizeof *leaf);
    leaf_reading r = { .run = malloc((count + 1) * sizeof *r.run) };
    face_lists f = { .wanted = wanted,
                     .reading = &r,
                     .first = calloc(3 * (size_t)count + 1, sizeof *f.first),
                     .refs = calloc((size_t)count + 1, sizeof *f.refs) };
    ebpo_status status = EBPO_OK;
    if (!leaf || !r.run || !f.first || !f.refs)
        status = object->error.status = EBPO_E_MEMORY;
    f.fresh = f.first + count;
    f.counts = f.fresh + count;
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++)
        leaf[i] = &wanted[i];
    if (status == EBPO_OK)
        qsort(leaf, count, sizeof *leaf, compare_leaves);
    for (uint32_t i = 0; i < count && (status == EBPO_OK || status == EBPO_E_PENDING);) {
        r.leaf = leaf + i;
        for (r.count = 0; i < count && leaf[i]->level == r.leaf[0]->level; i++)
            r.count++;
        ebpo_status one = read_lists(object, &f);
        status = one == EBPO_OK ? status : one;
    }
    if (status == EBPO_OK)
        status = put_lists(object, &f, count);
    for (uint32_t i = 0; i < count && f.refs; i++)
        free(f.refs[i]);
    free(f.refs);
    free(f.first);
    free(r.run);
    free(leaf);
    return status;
}

/* ---- colours of faces ---- */

/* Returns 1 if faces or vertices have colours. */
int EBPO_JS(ebpo_js_coloured)(ebpo_js_object *object)
{
    ebpo_face_colours colours;
    bool coloured = ebpo_face_colours_find(object->file, &colours, &object->error) == EBPO_OK &&
                    colours.element;
    ebpo_face_colours_free(&colours);
    return coloured;
}

/* Puts the colours of the faces' corners into FACE_COLOURS. `vertices`: [count][3] the vertices of
 * the faces. */
static ebpo_status put_colours(ebpo_js_object *object, const uint32_t *faces,
                               const uint32_t *vertices, uint32_t count)
{
    ebpo_face_colours colours;
    ebpo_status status = ebpo_face_colours_find(object->file, &colours, &object->error);
    if (status == EBPO_OK && colours.element && count) {
        uint8_t *to = ebpo_js_extend(object, FACE_COLOURS, count, 9);
        status = to ? ebpo_face_colours_read(&colours, object->chunks, faces, vertices, count, to,
                                             &object->error)
                    : EBPO_E_MEMORY;
    }
    ebpo_face_colours_free(&colours);
    return status;
}

/* ---- corners ---- */

/* Puts the corners of the faces in FACE_NUMBERS, and the colours of the corners, into the result
 * arrays. */
static ebpo_status put_corners(ebpo_js_object *object)
{
    const ebpo_info *info = ebpo_file_info(object->file);
    uint64_t count = object->array[FACE_NUMBERS].bytes / 4;
    uint32_t *vertices = ebpo_js_fixed(object, FACE_ROWS, count, 12);
    void *corners =
        ebpo_js_fixed(object, FACE_CORNERS, 3 * count, info->double_coordinates ? 24 : 12);
    const uint32_t *faces = (const uint32_t *)object->array[FACE_NUMBERS].data;
    if (!vertices || !corners)
        return EBPO_E_MEMORY;
    if (!count)
        return EBPO_OK;
    ebpo_hints hints = EBPO_HINTS_INIT(object->chunks->file);
    ebpo_faces_hint(object->chunks, &hints, faces, count, 0);
    ebpo_hint_all(&hints);
    ebpo_status status =
        ebpo_pick_rows(object->chunks, EBPO_A_FACES, faces, count, 1, vertices, &object->error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_pick_rows(object->chunks, EBPO_A_VERTICES, vertices, 3 * count, 1, corners,
                            &object->error);
    ebpo_status coloured = put_colours(object, faces, vertices, (uint32_t)count);
    return status == EBPO_OK ? coloured : status;
}

/* Reads the faces of the leaves wanted[count] into the result arrays. */
int EBPO_JS(ebpo_js_leaf_faces)(ebpo_js_object *object, const wanted_leaf *wanted, uint32_t count)
{
    uint64_t *subtrees = malloc((count + 1) * sizeof *subtrees);
    uint32_t subtree_count = 0;
    ebpo_js_clear(object);
    ebpo_status status =
        subtrees ? ebpo_js_need_mesh(object) : (object->error.status = EBPO_E_MEMORY);
    if (status == EBPO_OK)
        status = ebpo_js_need_chunks(object);
    if (status != EBPO_OK) {
        free(subtrees);
        return status;
    }
    for (uint32_t i = 0; i < count; i++)
        if (wanted[i].subtree >= 0 &&
            (!subtree_count || subtrees[subtree_count - 1] != (uint64_t)wanted[i].subtree))
            subtrees[subtree_count++] = (uint64_t)wanted[i].subtree;
    if (subtree_count)
        ebpo_subtree_table_hint(object->chunks, subtrees, subtree_count);
    ebpo_hints hints = EBPO_HINTS_INIT(object->file);
    for (uint32_t i = 0; i < subtree_count; i++)
        ebpo_subtrees_hint(object->chunks, &hints, subtrees[i], 1, LISTS, 0, true);
    ebpo_hint_all(&hints);
    free(subtrees);
    status = find_faces(object, wanted, count);
    return status == EBPO_OK ? put_corners(object) : status;
}
