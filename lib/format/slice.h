/* Reads parts of a file: whole subtrees as one piece. Results are checked: untrusted input gives
 * EBPO_E_FORMAT, never an index out of range. Any thread. */
#ifndef EBPO_FORMAT_SLICE_H
#define EBPO_FORMAT_SLICE_H

#include <ebpo/base.h>
#include <ebpo/file.h>

#include "core/alloc.h"
#include "format/chunks.h"
#include "format/file_nodes.h"

/* A subtree (or the whole tree) with all faces that its leaves list. Levels are counted from its
 * root: level[0] has one group with octant 0, the root. Faces have local indices in file order:
 * first the `shared_count` shared faces, which its leaves list but which are new in leaves before
 * it; then its owned faces, first_face .. first_face + face_count - 1 in the file. leaf_first and
 * leaf_refs of the levels hold local indices. */
typedef struct ebpo_slice {
    ebpo_node root;
    /* the file is a subset: empty groups belong to pruned nodes, and gray nodes on the last level
     * are pruned */
    bool pruned;
    int level_count;
    ebpo_level level[EBPO_LEVELS_MAX];
    uint32_t shared_count;
    uint32_t *outer; /* [shared_count] file indices, ascending */
    uint64_t first_face;
    uint64_t face_count; /* owned faces */
    ebpo_mesh mesh;      /* shared_count + face_count faces, vertices in any order */
    /* [shared_count + face_count] source indices, or NULL without maps */
    uint32_t *face_source;
} ebpo_slice;

void ebpo_slice_free(ebpo_slice *slice);

/* Reads the subtree of a gray node, or a single leaf, with its faces and the data in `needs`
 * (EBPO_NEEDS_..., schema.h: windings, planes, stored planes of leaves, maps). EBPO_E_ABSENT
 * without mesh. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_parts(ebpo_slice *out, ebpo_chunks *chunks,
                                                const ebpo_node *root, uint32_t needs,
                                                ebpo_error *error);

/* Does the same within `space`: each array is reserved before it is allocated, and stays reserved;
 * temporary memory is given back. EBPO_E_LIMIT beyond it. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_within(ebpo_slice *out, ebpo_chunks *chunks,
                                                 const ebpo_node *root, uint32_t needs,
                                                 ebpo_quota *space, ebpo_error *error);

/* Reads everything except stored planes of leaves. */
EBPO_MUST_USE ebpo_status ebpo_slice_read(ebpo_slice *out, ebpo_chunks *chunks,
                                          const ebpo_node *root, ebpo_error *error);

/* Reads only the nodes, of at most `levels` levels below the root (EBPO_SLICE_ALL: all), with their
 * arrays in `needs` (EBPO_NEEDS_..., schema.h). Reads no faces; lists contain file indices. Works
 * for files without mesh. */
enum { EBPO_SLICE_ALL = -1 };
EBPO_MUST_USE ebpo_status ebpo_slice_read_nodes(ebpo_slice *out, ebpo_chunks *chunks,
                                                const ebpo_node *root, uint32_t needs, int levels,
                                                ebpo_error *error);

/* Reads the whole tree with `threads` threads (0: all cores), without a cache of chunks. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_all(ebpo_slice *out, const ebpo_file *file,
                                              unsigned threads, ebpo_error *error);

/* Computes the sizes that ebpo_slice_read of this node needs, without reading its faces: nodes,
 * leaves, listed and new faces. */
typedef struct ebpo_slice_size {
    uint64_t groups, leaves, refs, new_faces;
    uint64_t outer;  /* maximum number of shared faces */
    uint64_t planes; /* if planes are requested */
} ebpo_slice_size;
EBPO_MUST_USE ebpo_status ebpo_slice_measure(ebpo_chunks *chunks, const ebpo_node *root,
                                             ebpo_slice_size *out, ebpo_error *error);
/* Does the same for ebpo_slice_read_nodes. */
EBPO_MUST_USE ebpo_status ebpo_slice_measure_nodes(ebpo_chunks *chunks, const ebpo_node *root,
                                                   uint32_t needs, int levels, ebpo_slice_size *out,
                                                   ebpo_error *error);

/* Returns the file index of a local face. */
static inline uint64_t ebpo_slice_file_face(const ebpo_slice *slice, uint32_t local)
{
    return local < slice->shared_count ? slice->outer[local]
                                       : slice->first_face + (local - slice->shared_count);
}

/* --- distinct numbers from a large range, sorted, and the position of each --- */

typedef struct ebpo_compact {
    /* open addressing, at most half full; number UINT32_MAX: free */
    struct {
        uint32_t number, place;
    } * slot;
    uint64_t mask;
    uint32_t *sorted; /* [count] */
    uint64_t count;
} ebpo_compact;

/* Returns the maximum memory, including sorting. */
uint64_t ebpo_compact_bytes(uint64_t capacity);

/* Makes space for at most `capacity` calls of add. Numbers are below 2^32 - 1. */
EBPO_MUST_USE ebpo_status ebpo_compact_make(ebpo_compact *out, uint64_t capacity,
                                            ebpo_error *error);

#endif
