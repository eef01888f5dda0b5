/* Parts of a file: ranges of arrays through a cache of decoded chunks, nodes, and whole
 * subtrees as one piece. Everything that comes out has been checked: a hostile file gives
 * EBPO_E_FORMAT, never an index out of range. Any thread. */
#ifndef EBPO_CONTAINER_SLICE_H
#define EBPO_CONTAINER_SLICE_H

#include <ebpo/file.h>

#include "cache/cache.h"
#include "container/schema.h"
#include "octree/node_source.h"

/* Decoded chunks under a budget (0: no limit; the smallest that works is a few MiB). */
typedef struct ebpo_chunks ebpo_chunks;
EBPO_MUST_USE ebpo_status ebpo_chunks_make(ebpo_chunks **out, const ebpo_file *file,
                                           uint64_t budget, ebpo_error *error);
/* The same for arrays of levels only, by one thread at a time, and counted: nothing is read or
 * announced but what was asked for, and nothing after which the file would have read more than the
 * limit (ebpo_chunks_limit; none at first). Then EBPO_E_LIMIT, and ebpo_chunks_refused is true. */
EBPO_MUST_USE ebpo_status ebpo_chunks_make_counted(ebpo_chunks **out, const ebpo_file *file,
                                                   uint64_t budget, ebpo_error *error);
void ebpo_chunks_limit(ebpo_chunks *chunks, uint64_t bytes);
bool ebpo_chunks_refused(const ebpo_chunks *chunks);
void ebpo_chunks_free(ebpo_chunks *chunks);
void ebpo_chunks_get_stats(ebpo_chunks *chunks, ebpo_cache_stats *out);

/* Rows [row, row + rows) of a plain integer array that is present, each value widened to `size`
 * bytes. Beyond the array's end: EBPO_E_ARGUMENT. */
EBPO_MUST_USE ebpo_status ebpo_chunks_integers(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                               uint64_t row, uint64_t rows, void *values,
                                               size_t size, ebpo_error *error);

/* The children of a gray node: the group's types, and the rank of the group's first node of each
 * type (indexed by ebpo_node_type) in level + 1. Of a pruned node the types are 0 (and the file's
 * info says `pruned`). */
EBPO_MUST_USE ebpo_status ebpo_chunks_children(ebpo_chunks *chunks, const ebpo_node *gray,
                                               uint16_t *types, uint64_t ranks[4],
                                               ebpo_error *error);

/* Codes of the planes that a gray node adds, or that are stored for a leaf; *count is 0 without the
 * part. */
EBPO_MUST_USE ebpo_status ebpo_chunks_planes(ebpo_chunks *chunks, const ebpo_node *node,
                                             uint32_t codes[EBPO_NODE_PLANES], unsigned *count,
                                             ebpo_error *error);

/* Winding number that the file gives for a white, black or leaf node (leaf: lowest corner). Solids
 * only. */
EBPO_MUST_USE ebpo_status ebpo_chunks_winding(ebpo_chunks *chunks, const ebpo_node *node,
                                              int32_t *winding, ebpo_error *error);

/* For cursors (octree/cursor.h): the root; the holder is an ebpo_chunks. */
EBPO_MUST_USE ebpo_status ebpo_chunks_root(ebpo_chunks *chunks, ebpo_node *root, ebpo_error *error);
extern const ebpo_node_source ebpo_chunks_source;

/* A subtree (or the whole tree) with everything that its leaves list. Levels are counted from its
 * root: level[0] has one group, of which only octant 0 exists and is the root. Faces have local
 * numbers in the order of their numbers in the file: first the `outer_count` faces that its leaves
 * list but that are new in leaves before it, then its own new ones, first_face .. first_face +
 * face_count - 1 in the file. leaf_first and leaf_refs of the levels hold local numbers. No planes
 * of leaves. */
typedef struct ebpo_slice {
    ebpo_node root;
    /* the file is a subset: empty groups are those of pruned nodes, as are gray nodes on the last
     * level */
    bool pruned;
    int level_count;
    ebpo_level level[EBPO_LEVELS_MAX];
    uint32_t outer_count;
    uint32_t *outer; /* [outer_count] numbers in the file, ascending */
    uint64_t first_face;
    uint64_t face_count; /* its own new ones */
    ebpo_mesh mesh;      /* outer_count + face_count faces, vertices numbered in any way */
    /* [outer_count + face_count] numbers in the source, or NULL without maps */
    uint32_t *face_source;
} ebpo_slice;

void ebpo_slice_free(ebpo_slice *slice);

/* Reads the subtree of a gray node, or a single leaf. EBPO_E_ABSENT without mesh. */
EBPO_MUST_USE ebpo_status ebpo_slice_read(ebpo_slice *out, ebpo_chunks *chunks,
                                          const ebpo_node *root, ebpo_error *error);

/* The whole tree, on `threads` threads (0: all cores), without a cache of chunks. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_all(ebpo_slice *out, const ebpo_file *file,
                                              unsigned threads, ebpo_error *error);

/* What ebpo_slice_read of this node will need, without reading its faces: nodes, leaves, listed
 * and new faces. */
typedef struct ebpo_slice_size {
    uint64_t groups, leaves, refs, new_faces;
    uint64_t outer; /* of the faces that are new elsewhere there are at most so many */
} ebpo_slice_size;
EBPO_MUST_USE ebpo_status ebpo_slice_measure(ebpo_chunks *chunks, const ebpo_node *root,
                                             ebpo_slice_size *out, ebpo_error *error);

/* Which file number a local face has. */
static inline uint64_t ebpo_slice_file_face(const ebpo_slice *slice, uint32_t local)
{
    return local < slice->outer_count ? slice->outer[local]
                                      : slice->first_face + (local - slice->outer_count);
}

#endif
