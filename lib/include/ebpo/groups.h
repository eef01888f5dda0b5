/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: groups of faces that a file has names for.
 *
 *   ebpo_mesh_read_groups      a mesh and its groups
 *   ebpo_mesh_groups_count, ebpo_mesh_groups_get, ebpo_mesh_groups_free
 *   ebpo_components_of_groups  each as a mesh of its own
 */
#ifndef EBPO_GROUPS_H
#define EBPO_GROUPS_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * The groups that an OBJ file has names for: the faces that follow a line `g` or
 * `o`, up to the next of them, whichever of the two it is. The name is the rest of
 * the line, without spaces around it. Groups of one name are one. Faces before the
 * first name, and under an empty one, are in the group "default".
 */
typedef struct ebpo_mesh_groups ebpo_mesh_groups;

typedef struct ebpo_mesh_group {
    size_t struct_size; /* EBPO_MESH_GROUP_INIT sets it */

    /*
     * As the file has it: any bytes but 0 and ends of lines, in any number.
     * Valid until ebpo_mesh_groups_free.
     */
    const char *name;

    /* 0: the file names it, but it has no faces. */
    uint64_t face_count;

    /* Least number of its faces in the source. */
    uint64_t first_face;
} ebpo_mesh_group;

#define EBPO_MESH_GROUP_INIT EBPO_SIZED(ebpo_mesh_group)

/*
 * Reads a mesh as ebpo_mesh_read does, and its groups.
 *
 * groups   freed by ebpo_mesh_groups_free; NULL where the file has no names or is
 *          no OBJ file, and on failure
 *
 * Errors are those of ebpo_mesh_read. On failure `out` is cleared.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_read_groups(const char *path,
                                                         const ebpo_mesh_read_options *options,
                                                         ebpo_mesh *out, ebpo_mesh_groups **groups,
                                                         ebpo_error *error);

/*
 * NULL is fine.
 *
 * Threads: one per object.
 */
EBPO_API void ebpo_mesh_groups_free(ebpo_mesh_groups *groups);

/*
 * How many; 0 for NULL. Those with faces come first, in the order of their first
 * faces, then those without.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_mesh_groups_count(const ebpo_mesh_groups *groups);

/*
 * One of them, from 0.
 *
 * EBPO_E_ARGUMENT: there is none of that number, or `out` has no size.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_groups_get(const ebpo_mesh_groups *groups,
                                                        uint64_t number, ebpo_mesh_group *out,
                                                        ebpo_error *error);

/*
 * What ebpo_components_new gives, of groups: each with faces is one, of the group's
 * number. A vertex may be in several of them. Whether one is closed is not looked
 * at (ebpo_mesh_check of its mesh tells), and nothing is a cavity.
 *
 * mesh     what was read with the groups; faces may have been turned and vertices
 *          welded, but no holes filled. Borrowed, as the groups, until
 *          ebpo_components_free; neither may change.
 * out      freed by ebpo_components_free. On failure NULL.
 *
 * EBPO_E_ARGUMENT: the groups are NULL or not of this mesh. EBPO_E_FORMAT,
 * EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: any, while nobody changes the mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_components_of_groups(const ebpo_mesh *mesh,
                                                             const ebpo_mesh_groups *groups,
                                                             ebpo_components **out,
                                                             ebpo_error *error);

#ifdef __cplusplus
}
#endif

#endif
