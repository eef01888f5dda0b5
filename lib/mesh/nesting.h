/* Which closed components of a mesh are within which, while it is found out. */
#ifndef EBPO_MESH_NESTING_H
#define EBPO_MESH_NESTING_H

#include "mesh/box_tree.h"
#include "mesh/component_parts.h"

/* A component is within another one, its host, if these vertices are: the least and the greatest
 * along each axis. */
enum { SHELL_SAMPLES = 6 };

typedef struct shell {
    double sample[SHELL_SAMPLES][3];
    double min[3], max[3];
    uint32_t component;
    uint32_t depth; /* closed components that it is within */
    bool crowded;   /* a host to many for the faces that it has: rays lead to it */
} shell;

typedef struct nesting {
    ebpo_components *components;
    shell *shells; /* closed, with a volume */
    uint64_t count;
    box_tree tree; /* of shells' boxes; the points are sample[0] */
    unsigned threads;
} nesting;

/* Zeroed to begin with; to be freed on failure as well. */
EBPO_MUST_USE ebpo_status ebpo_nesting_find(nesting *n, const ebpo_mesh *mesh, unsigned threads,
                                            const ebpo_progress *progress, ebpo_error *error);
void ebpo_nesting_free(nesting *n, const ebpo_mesh *mesh);

/* ---- of its parts ---- */

bool ebpo_shell_box_within(const shell *inner, const shell *outer);
/* Whether shells of the node may be within the host: their first samples near it. */
bool ebpo_shell_may_hold(const shell *host, const box_node *node);

/* Whether a line in direction x from somewhere in the box may meet the triangle; if it does, true. */
bool ebpo_face_may_meet_lines(const double t[3][3], const point_box *box);

/* Hosts that are not crowded: each face is shown to the samples that are near it. */
EBPO_MUST_USE ebpo_status ebpo_nesting_probe(nesting *n, ebpo_error *error);
/* Crowded ones: a ray from each sample goes through a tree of all of their faces. */
EBPO_MUST_USE ebpo_status ebpo_nesting_cast(nesting *n, ebpo_error *error);

#endif
