/* Which closed components of a mesh are within which, while it is found out. */
#ifndef EBPO_MESH_SHELLS_H
#define EBPO_MESH_SHELLS_H

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

static inline bool ebpo_shell_box_within(const shell *inner, const shell *outer)
{
    for (int k = 0; k < 3; k++)
        if (inner->min[k] < outer->min[k] || inner->max[k] > outer->max[k])
            return false;
    return true;
}

/* Whether shells of the node may be within the host: their first samples near it. */
static inline bool ebpo_shell_may_hold(const shell *host, const box_node *node)
{
    for (int k = 0; k < 3; k++)
        if (node->points->min[k] > host->max[k] || node->points->max[k] < host->min[k])
            return false;
    return true;
}

#endif
