/* Inside an ebpo_subtree, and the stages of making one. */
#ifndef EBPO_QUERY_SUBTREE_PARTS_H
#define EBPO_QUERY_SUBTREE_PARTS_H

#include <ebpo/subtree.h>

#include "format/slice.h"
#include "geometry/cell.h"

typedef struct ebpo_subtree_scratch ebpo_subtree_scratch; /* what describing a node takes */

struct ebpo_subtree {
    ebpo_box box;
    bool solid;
    ebpo_rule rule;
    ebpo_node root;
    int level_count;
    uint64_t level_first[EBPO_LEVELS_MAX + 1];
    uint64_t node_count;
    uint64_t *octcodes;
    uint8_t *types;
    int32_t *windings;
    uint32_t *children;
    bool has_planes;       /* any were read: the three below are there */
    bool has_leaf_planes;  /* stored ones */
    uint32_t *plane_first; /* [node_count + 1] */
    uint32_t *planes;
    uint32_t above_first[EBPO_LEVELS_MAX + 1];
    uint32_t *above_planes;
    /* Faces; without: why. */
    const char *no_faces;
    uint32_t outer_count;
    ebpo_mesh mesh;
    float *corners32;
    double *corners64;
    uint32_t *numbers, *source, *list_first, *list;
    uint64_t memory;
    ebpo_subtree_scratch *scratch; /* with the first node that is asked for */
};

/* From the slice, whose arrays it takes where it can: nodes, windings, planes. */
EBPO_MUST_USE ebpo_status ebpo_subtree_take_nodes(ebpo_subtree *subtree, const ebpo_slice *slice,
                                                  ebpo_error *error);
/* Then faces and lists. */
EBPO_MUST_USE ebpo_status ebpo_subtree_take_faces(ebpo_subtree *subtree, ebpo_slice *slice,
                                                  const ebpo_subtree_options *options,
                                                  ebpo_error *error);

void ebpo_subtree_free_scratch(ebpo_subtree_scratch *scratch);

#endif
