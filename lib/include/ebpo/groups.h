/* SPDX-License-Identifier: MIT
 * Reads the named groups of faces of an OBJ file.
 *
 *   ebpo_mesh_read_groups      a mesh and its groups
 *   ebpo_mesh_groups_count, ebpo_mesh_groups_get, ebpo_mesh_groups_free
 *   ebpo_components_of_groups  each group as a separate mesh
 */
#ifndef EBPO_GROUPS_H
#define EBPO_GROUPS_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Named groups of an OBJ file. A group contains the faces that follow a line `g` or `o`, up to the
 * next line `g` or `o`. The name of the group is the text after `g` or `o`, without surrounding
 * spaces. Groups of equal name are one group. Faces before the first line `g` or `o`, and faces
 * after a line `g` or `o` without a name, are in the group "default".
 */
typedef struct ebpo_mesh_groups ebpo_mesh_groups;

/* Description of a group. */
typedef struct ebpo_mesh_group {
    size_t struct_size;

    /*
     * Name as in the file: any number of bytes, of any value except 0 and line ends. It is valid
     * until ebpo_mesh_groups_free.
     */
    const char *name;

    /* Number of faces. 0: the file contains the name, but the group has no faces. */
    uint64_t face_count;

    /* Lowest source index of the group's faces. */
    uint64_t first_face;
} ebpo_mesh_group;

#define EBPO_MESH_GROUP_INIT EBPO_SIZED(ebpo_mesh_group)

/*
 * Reads a mesh as ebpo_mesh_read does, and its groups.
 *
 * groups   freed by ebpo_mesh_groups_free; NULL if the file has no names or is not an OBJ file
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
 * Frees the groups.
 *
 * Threads: one at a time per object.
 */
EBPO_API void ebpo_mesh_groups_free(ebpo_mesh_groups *groups);

/*
 * Returns the number of groups; 0 for NULL. Groups with faces come first, in the order of their
 * first faces.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_mesh_groups_count(const ebpo_mesh_groups *groups);

/*
 * Gets group `number`, 0 to ebpo_mesh_groups_count - 1.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_groups_get(const ebpo_mesh_groups *groups,
                                                        uint64_t number, ebpo_mesh_group *out,
                                                        ebpo_error *error);

/*
 * Makes a component (ebpo_components_new) from each group that has faces. The component has the
 * same index as the group. A vertex may be in several groups. Components made from groups are never
 * cavities, and their member `closed` is not computed: use ebpo_mesh_check for their meshes.
 *
 * mesh   the mesh that was read with the groups. Orienting and welding it before this call is
 *        allowed, but filling holes is not. Mesh and groups are borrowed until ebpo_components_free
 * out    freed by ebpo_components_free
 *
 * EBPO_E_ARGUMENT: `groups` is NULL, or was not read with this mesh. EBPO_E_FORMAT, EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_components_of_groups(const ebpo_mesh *mesh,
                                                             const ebpo_mesh_groups *groups,
                                                             ebpo_components **out,
                                                             ebpo_error *error);

#ifdef __cplusplus
}
#endif

#endif
