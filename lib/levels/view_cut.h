/* Declares the state of a view (view_cut.c): the observer, the delivered part of the tree, and the
 * frontier. The cut consists of the delivered nodes whose children are not delivered; the frontier
 * consists of the gray nodes of the cut. */
#ifndef EBPO_LEVELS_VIEW_CUT_H
#define EBPO_LEVELS_VIEW_CUT_H

#include <ebpo/base.h>
#include <ebpo/view.h>

#include "format/file_nodes.h"
#include "format/patch_table.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"
#include "levels/stream.h"

/* --- the observer: distance, size, visibility and order of cells --- */

/* A prepared observer. Lengths are measured in a unit that is about the root cell's longest side (a
 * power of two of the model's unit), so that their squares neither overflow nor underflow. */
typedef struct ebpo_viewpoint {
    bool has_observer; /* false: there is no observer */
    bool no_frustum;   /* the observer has no frustum, so every cell is visible */
    double eye[3];     /* in the model's unit */
    double unit;       /* size of the unit of length, in the model's unit */
    double focal;      /* size in pixels of a length of 1 at a distance of 1 */
    /* normals of the four side planes of the frustum, and of the plane parallel to the picture; all
     * five planes pass through the eye */
    double inward[5][3];
    double diagonal2[EBPO_LEVELS_MAX]; /* squared diagonal of the cells of each level */
} ebpo_viewpoint;

/* Prepares an observer; `observer` may be NULL. Returns EBPO_E_ARGUMENT for an invalid observer. */
EBPO_MUST_USE ebpo_status ebpo_viewpoint_make(ebpo_viewpoint *out, const ebpo_box *box,
                                              const ebpo_observer *observer, ebpo_error *error);

typedef struct ebpo_seen {
    double distance2; /* squared distance from the eye to the cell's nearest point */
    bool seen;        /* false: the cell does not intersect the frustum */
} ebpo_seen;
ebpo_seen ebpo_viewpoint_see(const ebpo_viewpoint *viewpoint, const ebpo_box *box, ebpo_cell cell);

/* Converts a squared distance of ebpo_viewpoint_see to a distance in the model's unit. Returns NAN
 * without an observer. */
double ebpo_viewpoint_distance(const ebpo_viewpoint *viewpoint, double distance2);
/* Returns the size in pixels of a length at a distance. Returns NAN without an observer. */
double ebpo_viewpoint_length(const ebpo_viewpoint *viewpoint, double length, double distance2);
/* Returns the size in pixels of a cell's diagonal at the cell's distance. Returns NAN without an
 * observer. */
double ebpo_viewpoint_pixels(const ebpo_viewpoint *viewpoint, int level, double distance2);

/* Returns the octant e of the cell that contains the eye or is nearest to it. No ray from the eye
 * to a child p passes through a child o if o ^ e has a bit that p ^ e lacks. */
unsigned ebpo_viewpoint_octant(const ebpo_viewpoint *viewpoint, const ebpo_box *box,
                               ebpo_cell cell);

/* Returns the priority key of a node: the node with the least key comes first. Only the keys of
 * cells that do not contain each other may be compared. */
uint64_t ebpo_viewpoint_key(const ebpo_viewpoint *viewpoint, const ebpo_box *box,
                            ebpo_priority priority, ebpo_octcode octcode, double distance2);

/* Makes the mesh of ebpo_view_stream_surface. Reads the table of patches when it is needed. */
EBPO_MUST_USE ebpo_status ebpo_view_surface(ebpo_patch_table *table, ebpo_chunks *chunks,
                                            const ebpo_viewpoint *viewpoint,
                                            const ebpo_view_options *options,
                                            ebpo_surface_mesh *out, ebpo_error *error);

/* --- the delivered part of a tree --- */

/* A group of siblings. The group is linked to its parent (`child` of the parent's group) after all
 * nodes of the group have been delivered. */
typedef struct ebpo_partial_group {
    uint64_t parent;     /* octcode (locational code); 0: the root's group */
    uint64_t first_gray; /* rank in its level of the group's first gray node */
    uint64_t first_code; /* index into codes */
    uint32_t child[8];   /* index of the group of each octant's children; 0: not delivered */
    uint16_t types;
    uint8_t plane_count[8];
} ebpo_partial_group;

typedef struct ebpo_partial {
    ebpo_partial_group *group; /* group 0 is the root's */
    uint32_t *codes;
    int32_t (*winding)[8]; /* winding numbers of each group; NULL: not requested */
    uint64_t group_count, group_capacity, winding_capacity, code_count, code_capacity;
    bool windings;
    /* number of delivered gray nodes of each level; in a damaged file, it could exceed the number
     * in the header */
    uint64_t grays[EBPO_LEVELS_MAX];
} ebpo_partial;

void ebpo_partial_free(ebpo_partial *partial);

/* A node, given by group and octant. */
typedef struct ebpo_partial_node {
    uint32_t group;
    uint8_t octant;
} ebpo_partial_node;

static inline ebpo_node_type ebpo_partial_type(const ebpo_partial *g, ebpo_partial_node node)
{
    return ebpo_group_type(g->group[node.group].types, node.octant);
}

static inline uint64_t ebpo_partial_octcode(const ebpo_partial *g, ebpo_partial_node node)
{
    uint64_t parent = g->group[node.group].parent;
    return parent ? ebpo_octcode_child(parent, node.octant) : 1;
}

/* Returns the group of a gray node's children in the next level of the file. */
static inline uint64_t ebpo_partial_children(const ebpo_partial *g, ebpo_partial_node gray)
{
    return g->group[gray.group].first_gray +
           ebpo_group_count(g->group[gray.group].types, EBPO_GRAY, gray.octant);
}

/* Appends a group, without linking it. */
EBPO_MUST_USE ebpo_status ebpo_partial_add(ebpo_partial *partial, const ebpo_info *info,
                                           uint64_t parent, const ebpo_group *read,
                                           ebpo_error *error);

/* Returns the plane codes of a node. */
const uint32_t *ebpo_partial_codes(const ebpo_partial *partial, ebpo_partial_node node,
                                   unsigned *count);

/* Returns the envelope of a node in cell coordinates; its ancestors must be linked. Valid until the
 * next call with these envelopes. */
const ebpo_polytope *ebpo_partial_envelope(const ebpo_partial *partial, ebpo_partial_node node,
                                           ebpo_envelope_stack *envelopes);

/* --- the frontier: the gray nodes of the cut in a heap, the next one to refine on top --- */

/* Class of a node in the order of refinement. */
typedef enum ebpo_turn { EBPO_TURN_SEEN, EBPO_TURN_UNSEEN, EBPO_TURN_NEVER } ebpo_turn;

typedef struct ebpo_waiting {
    uint64_t key, octcode; /* nodes are ordered by turn, then by key, then by octcode */
    uint64_t child_group;  /* index of the children's group in the children's level */
    uint32_t group;
    uint8_t octant, turn; /* turn: ebpo_turn */
} ebpo_waiting;

typedef struct ebpo_frontier {
    ebpo_waiting *at; /* [count], a binary heap */
    uint64_t count, capacity;
} ebpo_frontier;

void ebpo_frontier_free(ebpo_frontier *frontier);
/* Reserves space for `more` nodes. Until this space is used up, ebpo_frontier_push cannot fail. */
EBPO_MUST_USE ebpo_status ebpo_frontier_reserve(ebpo_frontier *frontier, uint64_t more,
                                                ebpo_error *error);
void ebpo_frontier_push(ebpo_frontier *frontier, ebpo_waiting node);
/* Removes and returns the top, which is the node to refine next. */
ebpo_waiting ebpo_frontier_pop(ebpo_frontier *frontier);
/* Restores the heap after keys or turns have changed. */
void ebpo_frontier_restore(ebpo_frontier *frontier);
/* A block is `span` neighbouring groups of a level. A node of the frontier belongs to the block of
 * its children's group. For each block, finds the node that will be refined first. Writes the
 * indices of these nodes in frontier->at to `best`, in the order of refinement, beginning with the
 * top. Returns the number of indices, at most EBPO_FRONTIER_BLOCKS. */
enum { EBPO_FRONTIER_BLOCKS = 1024 };
unsigned ebpo_frontier_blocks(const ebpo_frontier *frontier, uint64_t span,
                              uint64_t best[EBPO_FRONTIER_BLOCKS]);

#endif
