/* Selected rows of a file's arrays: runs of sibling groups of a level, and rows of the mesh's
 * arrays and of attributes. Chunks are announced together, and each is fetched once; values are
 * checked. */
#ifndef EBPO_FORMAT_PICK_ROWS_H
#define EBPO_FORMAT_PICK_ROWS_H

#include "core/alloc.h"
#include "format/chunks.h"
#include "mesh/attributes.h"

/* Groups [group, group + groups) of a level; level 0 has group 0. Its nodes by type: those of type
 * k are [rank[k], rank[k] + count[k]). */
typedef struct ebpo_run {
    uint64_t group, groups;
    uint64_t rank[4], count[4];
} ebpo_run;

/* Collects what ebpo_runs_read begins with, for sources far away. */
void ebpo_runs_expect(ebpo_chunks *chunks, ebpo_expected *expected, int level, const ebpo_run *runs,
                      uint64_t run_count, uint32_t needs);

/* Arrays of the nodes of ascending runs, one behind the other, and their counts into `out`, which
 * has the types already. Those that are there for any of `needs`; faces have the numbers of the
 * file. What they take is taken of `room` (NULL: no limit) first. */
EBPO_MUST_USE ebpo_status ebpo_runs_read(ebpo_chunks *chunks, int level, const ebpo_run *runs,
                                         uint64_t run_count, uint32_t needs, ebpo_room *room,
                                         ebpo_level *out, ebpo_error *error);

/* All nodes of ascending runs that do not overlap, as one level: group_count is the sum of the
 * runs', whose ranks and counts are filled in. Every array that is there for one of `parts` (face
 * lists with the file's numbers, leaf_first too) or for none. Volumes are left 0. The caller frees
 * it with ebpo_level_free. */
EBPO_MUST_USE ebpo_status ebpo_pick_level(ebpo_chunks *chunks, int level, ebpo_run *runs,
                                          uint64_t run_count, uint32_t parts, ebpo_level *out,
                                          ebpo_error *error);

/* Rows of a decoded array without level (faces: three corners; vertices: three floats or doubles;
 * maps: a number), in any order. EBPO_E_FORMAT for a row that is not there. */
EBPO_MUST_USE ebpo_status ebpo_pick_rows(ebpo_chunks *chunks, ebpo_array_id id,
                                         const uint32_t *rows, uint64_t count, unsigned threads,
                                         void *out, ebpo_error *error);

/* Rows of all attributes of an element into `to`, which has the file's arrays without values and
 * no workspace. */
EBPO_MUST_USE ebpo_status ebpo_pick_attributes(ebpo_chunks *chunks, ebpo_attributes *to,
                                               const char *element, const uint32_t *rows,
                                               uint64_t count, unsigned threads, ebpo_error *error);

/* Announces what picking these faces takes (parts: mesh, maps), and the vertices that come first
 * with the chunks that hold them: most that the faces use. */
void ebpo_faces_expect(ebpo_chunks *chunks, const uint32_t *faces, uint64_t count, uint32_t parts);
/* The same of vertices. */
void ebpo_vertices_expect(ebpo_chunks *chunks, const uint32_t *vertices, uint64_t count,
                          uint32_t parts);

#endif
