/* Reads selected rows of a file's arrays: runs of sibling groups of a level, and rows of the mesh's
 * arrays and of attributes. Chunks are prefetched together, each is fetched once, and values are
 * checked. */
#ifndef EBPO_FORMAT_PICK_ROWS_H
#define EBPO_FORMAT_PICK_ROWS_H

#include "core/alloc.h"
#include "format/chunks.h"
#include "mesh/attributes.h"

/* A run: groups [group, group + groups) of a level, each with eight siblings; level 0 has only
 * group 0. The rank of a node is its position among the nodes of its type in its level. The run's
 * nodes of type k have the ranks [rank[k], rank[k] + count[k]). */
typedef struct ebpo_run {
    uint64_t group, groups;
    uint64_t rank[4], count[4];
} ebpo_run;

/* Collects the chunks that ebpo_runs_read needs first, for remote sources: those of arrays with a
 * row for each node. */
void ebpo_runs_hint(ebpo_chunks *chunks, ebpo_hints *hints, int level, const ebpo_run *runs,
                    uint64_t run_count, uint32_t needs);

/* Reads the arrays of the nodes of ascending runs into `out`, one run after another, and sets the
 * counts. `out` already has the types. Reads the arrays that any of `needs` (EBPO_NEEDS_...,
 * schema.h) requires. Face indices are indices in the file. Memory is first reserved from `space`
 * (NULL: no limit). */
EBPO_MUST_USE ebpo_status ebpo_runs_read(ebpo_chunks *chunks, int level, const ebpo_run *runs,
                                         uint64_t run_count, uint32_t needs, ebpo_quota *space,
                                         ebpo_level *out, ebpo_error *error);

/* Reads all nodes of ascending runs that do not overlap, as one level. Fills in the ranks and
 * counts of the runs. The level's group_count is the sum over the runs, and its volumes are 0. The
 * level has the types, and the arrays that any of `needs` requires (EBPO_NEEDS_..., schema.h). The
 * face lists and leaf_first contain indices in the file. The caller frees the level with
 * ebpo_level_free. */
EBPO_MUST_USE ebpo_status ebpo_pick_level(ebpo_chunks *chunks, int level, ebpo_run *runs,
                                          uint64_t run_count, uint32_t needs, ebpo_level *out,
                                          ebpo_error *error);

/* Reads rows, in any order, of an array of the mesh, or of source indices (positions in the source
 * mesh). A row is three corners for faces, three floats or doubles for vertices, and one source
 * index. Returns EBPO_E_FORMAT for a row that does not exist. */
EBPO_MUST_USE ebpo_status ebpo_pick_rows(ebpo_chunks *chunks, ebpo_array_id id,
                                         const uint32_t *rows, uint64_t count, unsigned threads,
                                         void *out, ebpo_error *error);

/* Reads rows of all attributes of an element (such as "vertex" or "face") into `to`. `to` has the
 * file's attribute arrays without values, and no workspace. */
EBPO_MUST_USE ebpo_status ebpo_pick_attributes(ebpo_chunks *chunks, ebpo_attributes *to,
                                               const char *element, const uint32_t *rows,
                                               uint64_t count, unsigned threads, ebpo_error *error);

/* For remote files: adds to the hints the chunks of these faces of the mesh, and of the vertices
 * that these chunks use first, because most vertices of the faces are among them. If `parts` has
 * EBPO_PART_MAPS, also adds the source indices of faces and vertices. */
void ebpo_faces_hint(ebpo_chunks *chunks, ebpo_hints *hints, const uint32_t *faces, uint64_t count,
                     uint32_t parts);

/* Sends prefetch hints for reading these vertices of the mesh and, if `parts` has EBPO_PART_MAPS,
 * their source indices. */
void ebpo_vertices_hint(ebpo_chunks *chunks, const uint32_t *vertices, uint64_t count,
                        uint32_t parts);

#endif
