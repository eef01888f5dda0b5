/* Defines the state of the search for the nesting of closed components (shells): how many other
 * closed components contain each component. */
#ifndef EBPO_MESH_SHELL_NESTING_H
#define EBPO_MESH_SHELL_NESTING_H

#include <math.h>

#include "mesh/box_tree.h"
#include "mesh/component_parts.h"

/* Number of samples of a shell: its least and its greatest vertex along each axis. A shell is
 * within another shell, its host, if all its samples are within the host. */
enum { EBPO_SHELL_SAMPLES = 6 };

typedef struct ebpo_shell {
    double sample[EBPO_SHELL_SAMPLES][3];
    double min[3], max[3]; /* bounding box */
    uint32_t component;    /* index of the component */
    uint32_t depth;        /* number of shells that contain this shell */
    int32_t around;        /* sum of the winding numbers of these shells at sample[0] */
    /* the box of this shell contains too many samples of other shells for the number of this
     * shell's faces, so rays are used (shell_nesting.c) */
    bool crowded;
} ebpo_shell;

typedef struct ebpo_nesting {
    ebpo_components *components;
    ebpo_shell *shells; /* the components that are closed and whose volume is not 0 */
    uint64_t count;
    ebpo_box_tree tree; /* boxes of the shells; the point of a shell is its sample[0] */
    unsigned threads;
} ebpo_nesting;

static inline bool ebpo_shell_faces_inwards(const ebpo_nesting *n, const ebpo_shell *shell)
{
    return n->components->list[shell->component].volume < 0;
}

/* Returns true if the shell should face inwards. */
static inline bool ebpo_shell_is_cavity(const ebpo_shell *shell) { return shell->depth % 2 != 0; }

/* Writes the positions of a face's corners. */
static inline void ebpo_face_corners(const ebpo_mesh *mesh, uint64_t face, double t[3][3])
{
    for (uint64_t k = 0; k < 3; k++)
        ebpo_mesh_position(mesh, mesh->faces[3 * face + k], t[k]);
}

/* Computes the box of a face for a box tree over faces of the mesh `user`. */
static inline void ebpo_face_box(const void *user, const ebpo_tree_point *p, ebpo_point_box *out)
{
    double t[3][3];
    ebpo_face_corners(user, p->number, t);
    for (int k = 0; k < 3; k++) {
        out->min[k] = fmin(fmin(t[0][k], t[1][k]), t[2][k]);
        out->max[k] = fmax(fmax(t[0][k], t[1][k]), t[2][k]);
    }
}

/* Adds a face to a box tree over faces. Returns false when out of memory. */
static inline bool ebpo_face_add(ebpo_box_tree *tree, const ebpo_mesh *mesh, uint32_t face,
                                 int32_t value)
{
    ebpo_point_box box;
    ebpo_tree_point *p = ebpo_box_tree_add(tree);
    if (!p)
        return false;
    *p = (ebpo_tree_point){ .number = face, .value = value };
    ebpo_face_box(mesh, p, &box);
    for (int k = 0; k < 3; k++)
        p->at[k] = box.min[k] / 2 + box.max[k] / 2;
    return true;
}

/* Returns true if the box of `inner` is within the box of `outer`. */
static inline bool ebpo_shell_box_within(const ebpo_shell *inner, const ebpo_shell *outer)
{
    for (int k = 0; k < 3; k++)
        if (inner->min[k] < outer->min[k] || inner->max[k] > outer->max[k])
            return false;
    return true;
}

/* Returns false only if no shell of the node is within the host, because the box of their first
 * samples is outside the host's box. */
static inline bool ebpo_shell_may_hold(const ebpo_shell *host, const ebpo_box_node *node)
{
    for (int k = 0; k < 3; k++)
        if (node->points->min[k] > host->max[k] || node->points->max[k] < host->min[k])
            return false;
    return true;
}

/* Finds the nesting: the number of closed components that contain each component. Initialise `n`
 * with zeros, and free it also on failure. `closed`: result of ebpo_mesh_find_shells, which this
 * function modifies, and which must exist until `n` is freed. */
EBPO_MUST_USE ebpo_status ebpo_nesting_find(ebpo_nesting *n, const ebpo_mesh *mesh,
                                            uint32_t *closed, unsigned threads,
                                            const ebpo_progress *progress, ebpo_error *error);
void ebpo_nesting_free(ebpo_nesting *n, const ebpo_mesh *mesh);

#endif
