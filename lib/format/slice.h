/* Reads a complete subtree of a file into memory: a slice. Values that are read are checked: wrong
 * values in a file give EBPO_E_FORMAT, never an index out of range. Any thread may call these
 * functions. */
#ifndef EBPO_FORMAT_SLICE_H
#define EBPO_FORMAT_SLICE_H

#include <ebpo/base.h>
#include <ebpo/file.h>

#include "core/alloc.h"
#include "format/chunks.h"
#include "format/file_nodes.h"

/* A subtree (or the whole tree) with all faces that its leaves list. Levels are counted from the
 * subtree's root: level[0] has one group with octant 0, the root. Faces have local indices, which
 * ascend with the indices in the file. The first `shared_count` faces are shared: a leaf before the
 * subtree lists them, too. The next face_count faces are owned; in the file, they are first_face ..
 * first_face + face_count
 * - 1. leaf_first and leaf_refs of the levels contain local indices. */
typedef struct ebpo_slice {
    ebpo_node root;
    /* true: the file is a subset. In a subset, a gray node whose children are not in the file is
     * pruned. The types of its children are 0, or the node is on the last level */
    bool pruned;
    int level_count;
    ebpo_level level[EBPO_LEVELS_MAX];
    uint32_t shared_count;
    uint32_t *shared; /* [shared_count] file indices, ascending */
    uint64_t first_face;
    uint64_t face_count; /* number of owned faces */
    ebpo_mesh mesh;      /* shared_count + face_count faces, vertices in any order */
    /* [shared_count + face_count] source indices, or NULL if the file lacks the part `maps` */
    uint32_t *face_source;
} ebpo_slice;

void ebpo_slice_free(ebpo_slice *slice);

/* Reads the subtree of a gray node, or a single leaf, with its faces and the arrays that `needs`
 * requires (EBPO_NEEDS_..., schema.h: windings, planes, stored planes of leaves, source indices).
 * Returns EBPO_E_ABSENT if the file has no mesh. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_parts(ebpo_slice *out, ebpo_chunks *chunks,
                                                const ebpo_node *root, uint32_t needs,
                                                ebpo_error *error);

/* Same as ebpo_slice_read_parts, with a limit of memory. Reserves the bytes of each array in
 * `space` before the array is allocated. The bytes of the slice stay reserved. The bytes of
 * temporary arrays are released. Returns EBPO_E_LIMIT beyond the limit. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_within(ebpo_slice *out, ebpo_chunks *chunks,
                                                 const ebpo_node *root, uint32_t needs,
                                                 ebpo_quota *space, ebpo_error *error);

/* Same as ebpo_slice_read_parts, with all data except stored planes of leaves. */
EBPO_MUST_USE ebpo_status ebpo_slice_read(ebpo_slice *out, ebpo_chunks *chunks,
                                          const ebpo_node *root, ebpo_error *error);

/* Reads only nodes, down to `levels` levels below the root (EBPO_SLICE_ALL: all), with the arrays
 * that `needs` requires (EBPO_NEEDS_..., schema.h). Reads no faces; face lists contain file
 * indices. The file may lack the mesh. */
enum { EBPO_SLICE_ALL = -1 };
EBPO_MUST_USE ebpo_status ebpo_slice_read_nodes(ebpo_slice *out, ebpo_chunks *chunks,
                                                const ebpo_node *root, uint32_t needs, int levels,
                                                ebpo_error *error);

/* Reads the whole tree with `threads` threads (0: all cores), without a cache of chunks. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_all(ebpo_slice *out, const ebpo_file *file,
                                              unsigned threads, ebpo_error *error);

/* Numbers of items of a slice. */
typedef struct ebpo_slice_size {
    uint64_t groups, leaves;
    uint64_t refs;      /* references of leaves to faces that an earlier leaf already lists */
    uint64_t new_faces; /* number of owned faces */
    uint64_t shared;    /* maximum number of shared faces */
    uint64_t planes;    /* planes of gray nodes and of leaves, if these planes are requested */
} ebpo_slice_size;
/* Computes the sizes of the slice that ebpo_slice_read would read for the node `root`. Reads no
 * faces. */
EBPO_MUST_USE ebpo_status ebpo_slice_measure(ebpo_chunks *chunks, const ebpo_node *root,
                                             ebpo_slice_size *out, ebpo_error *error);
/* Same as ebpo_slice_measure, for ebpo_slice_read_nodes. */
EBPO_MUST_USE ebpo_status ebpo_slice_measure_nodes(ebpo_chunks *chunks, const ebpo_node *root,
                                                   uint32_t needs, int levels, ebpo_slice_size *out,
                                                   ebpo_error *error);

/* Returns the file index of a local face. */
static inline uint64_t ebpo_slice_file_face(const ebpo_slice *slice, uint32_t local)
{
    return local < slice->shared_count ? slice->shared[local]
                                       : slice->first_face + (local - slice->shared_count);
}

/* --- set of indices --- */

/* Set of indices below 2^32 - 1. After it has been sorted, the set gives the position of each index
 * in the sorted order. */
typedef struct ebpo_compact {
    /* hash table with open addressing, at most half full; a free slot has number UINT32_MAX */
    struct {
        uint32_t number, position; /* the index, and its position in `sorted` */
    } * slot;
    uint64_t mask;
    uint32_t *sorted; /* [count] */
    uint64_t count;
} ebpo_compact;

/* Returns the maximum number of bytes for `capacity` indices, including memory for sorting. */
uint64_t ebpo_compact_bytes(uint64_t capacity);

/* Creates an empty set with space for `capacity` indices. */
EBPO_MUST_USE ebpo_status ebpo_compact_make(ebpo_compact *out, uint64_t capacity,
                                            ebpo_error *error);

#endif
