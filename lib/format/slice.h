/* Parts of a file: whole subtrees as one piece. Everything that comes out has been checked: a
 * hostile file gives EBPO_E_FORMAT, never an index out of range. Any thread. */
#ifndef EBPO_FORMAT_SLICE_H
#define EBPO_FORMAT_SLICE_H

#include <ebpo/base.h>
#include <ebpo/file.h>

#include "core/alloc.h"
#include "format/chunks.h"
#include "format/file_nodes.h"

/* A subtree (or the whole tree) with everything that its leaves list. Levels are counted from its
 * root: level[0] has one group, of which only octant 0 exists and is the root. Faces have local
 * numbers in the order of their numbers in the file: first the `outer_count` faces that its leaves
 * list but that are new in leaves before it, then its own new ones, first_face .. first_face +
 * face_count - 1 in the file. leaf_first and leaf_refs of the levels hold local numbers. */
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

/* Reads the subtree of a gray node, or a single leaf, with its faces, and what `needs` names beside
 * them (EBPO_NEEDS_..., schema.h: windings, planes, stored planes of leaves, maps). EBPO_E_ABSENT
 * without mesh. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_parts(ebpo_slice *out, ebpo_chunks *chunks,
                                                const ebpo_node *root, uint32_t needs,
                                                ebpo_error *error);

/* The same of what has room: each array is taken of it before it is made, and stays taken; what is
 * given back is only what reading needs on the way. EBPO_E_LIMIT beyond it. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_within(ebpo_slice *out, ebpo_chunks *chunks,
                                                 const ebpo_node *root, uint32_t needs,
                                                 ebpo_room *room, ebpo_error *error);

/* All but stored planes of leaves. */
EBPO_MUST_USE ebpo_status ebpo_slice_read(ebpo_slice *out, ebpo_chunks *chunks,
                                          const ebpo_node *root, ebpo_error *error);

/* The nodes alone, of at most `levels` levels below the root (EBPO_SLICE_ALL: all), and what
 * `needs` (EBPO_NEEDS_..., schema.h) names of their arrays: no faces, and faces in lists have the
 * numbers of the file. Also of a file without mesh. */
enum { EBPO_SLICE_ALL = -1 };
EBPO_MUST_USE ebpo_status ebpo_slice_read_nodes(ebpo_slice *out, ebpo_chunks *chunks,
                                                const ebpo_node *root, uint32_t needs, int levels,
                                                ebpo_error *error);

/* The whole tree, on `threads` threads (0: all cores), without a cache of chunks. */
EBPO_MUST_USE ebpo_status ebpo_slice_read_all(ebpo_slice *out, const ebpo_file *file,
                                              unsigned threads, ebpo_error *error);

/* What ebpo_slice_read of this node will need, without reading its faces: nodes, leaves, listed
 * and new faces. */
typedef struct ebpo_slice_size {
    uint64_t groups, leaves, refs, new_faces;
    uint64_t outer;  /* of the faces that are new elsewhere there are at most so many */
    uint64_t planes; /* where planes are asked for */
} ebpo_slice_size;
EBPO_MUST_USE ebpo_status ebpo_slice_measure(ebpo_chunks *chunks, const ebpo_node *root,
                                             ebpo_slice_size *out, ebpo_error *error);
/* The same for ebpo_slice_read_nodes. */
EBPO_MUST_USE ebpo_status ebpo_slice_measure_nodes(ebpo_chunks *chunks, const ebpo_node *root,
                                                   uint32_t needs, int levels, ebpo_slice_size *out,
                                                   ebpo_error *error);

/* Which file number a local face has. */
static inline uint64_t ebpo_slice_file_face(const ebpo_slice *slice, uint32_t local)
{
    return local < slice->outer_count ? slice->outer[local]
                                      : slice->first_face + (local - slice->outer_count);
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

/* What that takes of memory at most, sorting included. */
uint64_t ebpo_compact_bytes(uint64_t capacity);

/* For at most `capacity` calls of add. Numbers are below 2^32 - 1. */
EBPO_MUST_USE ebpo_status ebpo_compact_make(ebpo_compact *out, uint64_t capacity,
                                            ebpo_error *error);

#endif
