/* What must hold of a tree, whether it comes from a file or from a caller about to write one:
 * format-spec/README.md, "Constraints". */
#ifndef EBPO_FORMAT_ARRAY_CHECK_H
#define EBPO_FORMAT_ARRAY_CHECK_H

#include <ebpo/file.h>

/* Who is being checked: a file (EBPO_E_FORMAT) or a caller's tree (EBPO_E_ARGUMENT). */
typedef struct ebpo_check {
    const char *shown; /* the file's name */
    ebpo_status as;
    ebpo_workspace *workspace; /* what the arrays may be in, or NULL */
} ebpo_check;

/* One array of one level is wrong: "shown: /levels/03/planes: what; next". */
ebpo_status ebpo_check_fail(const ebpo_check *check, int level, const char *array, const char *what,
                            ebpo_error *error);

/* A level's arrays against the head's counts, and against themselves. */
EBPO_MUST_USE ebpo_status ebpo_check_level(const ebpo_check *check, const ebpo_info *info,
                                           int level, const ebpo_level *arrays, ebpo_error *error);

/* Leaves in depth-first order have faces 0 .. face_count - 1 as their new ones, in order. For trees
 * with their face lists. */
EBPO_MUST_USE ebpo_status ebpo_check_order(const ebpo_check *check, const ebpo_tree *tree,
                                           ebpo_error *error);

/* A map's values are distinct and below `limit`. */
EBPO_MUST_USE ebpo_status ebpo_check_map(const ebpo_check *check, const char *array,
                                         const uint32_t *map, uint64_t count, uint64_t limit,
                                         ebpo_error *error);

/* Vertices are finite and faces name vertices that exist, in first-use order. */
EBPO_MUST_USE ebpo_status ebpo_check_finite(const ebpo_check *check, const ebpo_mesh *mesh,
                                            ebpo_error *error);

#endif
