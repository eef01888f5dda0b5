/* Declares the state of a view (view_cut.c): the observer, the delivered part of the tree, and the
 * frontier. A view delivers nodes of the octree to a program, from coarse to fine. The "cut" is the
 * set of the delivered nodes whose children have not been delivered. The "frontier" is the set of
 * the gray nodes of the cut. To refine a node means to replace it in the cut by its children. A
 * pruned node has no children in the file, so it is not refined. */
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

/* A prepared observer. The unit of lengths is a power of two, about as long as the root cell's
 * longest side, so that the squares of lengths neither overflow nor underflow. */
typedef struct ebpo_viewpoint {
    bool has_observer; /* false: there is no observer */
    bool no_frustum;   /* the observer has no frustum, so every cell is visible */
    double eye[3];     /* in the model's unit */
    /* length of this unit in the model's unit; the members below use this unit */
    double unit;
    /* size in pixels of an object whose length is equal to its distance from the eye */
    double focal;
    /* inward normals of the four side planes of the frustum, and of the plane parallel to the
     * picture; all five planes pass through the eye */
    double inward[5][3];
    double diagonal2[EBPO_LEVELS_MAX]; /* squared diagonal of a cell of each level */
} ebpo_viewpoint;

/* Prepares an observer; `observer` may be NULL. Returns EBPO_E_ARGUMENT for an invalid observer. */
EBPO_MUST_USE ebpo_status ebpo_viewpoint_make(ebpo_viewpoint *out, const ebpo_box *box,
                                              const ebpo_observer *observer, ebpo_error *error);

/* The distance and the visibility of a cell. */
typedef struct ebpo_seen {
    double distance2; /* squared distance from the eye to the cell's nearest point, in `unit`^2 */
    bool seen;        /* false: the cell does not intersect the frustum */
} ebpo_seen;
/* Returns the distance and the visibility of a cell. Without an observer, every cell is visible at
 * distance 0. */
ebpo_seen ebpo_viewpoint_see(const ebpo_viewpoint *viewpoint, const ebpo_box *box, ebpo_cell cell);

/* Converts a squared distance of ebpo_viewpoint_see to a distance in the model's unit. Returns NAN
 * without an observer. */
double ebpo_viewpoint_distance(const ebpo_viewpoint *viewpoint, double distance2);
/* Returns the size in pixels of an object of this length (in the model's unit) at a squared
 * distance of ebpo_viewpoint_see. Returns NAN without an observer. */
double ebpo_viewpoint_length(const ebpo_viewpoint *viewpoint, double length, double distance2);
/* Returns the size in pixels of the diagonal of a cell of this level at a squared distance of
 * ebpo_viewpoint_see. Returns NAN without an observer. */
double ebpo_viewpoint_pixels(const ebpo_viewpoint *viewpoint, int level, double distance2);

/* Returns the octant e of the cell that contains the eye or is nearest to the eye. If the children
 * are drawn in ascending order of (octant ^ e), no child hides an earlier one. Reason: a ray from
 * the eye to a child p can pass through a child o only if all bits of o ^ e are also set in p ^ e,
 * so o comes before p. */
unsigned ebpo_viewpoint_octant(const ebpo_viewpoint *viewpoint, const ebpo_box *box,
                               ebpo_cell cell);

/* Returns the priority key of a node. The node with the least key comes first. The keys of two
 * nodes may be compared only if neither of their cells contains the other one. */
uint64_t ebpo_viewpoint_key(const ebpo_viewpoint *viewpoint, const ebpo_box *box,
                            ebpo_priority priority, ebpo_octcode octcode, double distance2);

/* Does the work of ebpo_view_stream_surface. Reads the table of patches if `table` is still empty.
 */
EBPO_MUST_USE ebpo_status ebpo_view_surface(ebpo_patch_table *table, ebpo_chunks *chunks,
                                            const ebpo_viewpoint *viewpoint,
                                            const ebpo_view_options *options,
                                            ebpo_surface_mesh *out, ebpo_error *error);

/* --- the delivered part of a tree --- */

/* A group of siblings. After all nodes of the group have been delivered, the group is linked to its
 * parent: an element of `child` in the parent's group is set. */
typedef struct ebpo_partial_group {
    uint64_t parent;        /* octcode (locational code) of the parent; 0: the root's group */
    uint64_t first_gray;    /* rank in its level of the group's first gray node */
    uint64_t first_code;    /* index in `codes` of the group's first plane code */
    uint32_t child[8];      /* index of the group of each octant's children; 0: not linked */
    uint16_t types;         /* two bits for each octant (geometry/level_nodes.h) */
    uint8_t plane_count[8]; /* number of plane codes of each octant */
} ebpo_partial_group;

typedef struct ebpo_partial {
    ebpo_partial_group *group; /* [group_count] group 0 contains only the root */
    uint32_t *codes;           /* [code_count] plane codes of all groups */
    /* [group_count] winding numbers of the nodes, by octant; see `windings` */
    int32_t (*winding)[8];
    uint64_t group_count, group_capacity, winding_capacity, code_count, code_capacity;
    bool windings; /* false: no winding numbers are requested, and `winding` is NULL */
    /* [level] number of gray nodes added so far; it must not exceed the number in the header */
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

/* Returns the index of the group of a gray node's children among the groups of the next level in
 * the file. */
static inline uint64_t ebpo_partial_children(const ebpo_partial *g, ebpo_partial_node gray)
{
    return g->group[gray.group].first_gray +
           ebpo_group_count(g->group[gray.group].types, EBPO_GRAY, gray.octant);
}

/* Appends the group `read`, whose nodes are the children of the node with octcode `parent`. If
 * `parent` is 0, the group contains the root. Does not link the group to its parent. Returns
 * EBPO_E_FORMAT if the level has more gray nodes than the header states. */
EBPO_MUST_USE ebpo_status ebpo_partial_add(ebpo_partial *partial, const ebpo_info *info,
                                           uint64_t parent, const ebpo_group *read,
                                           ebpo_error *error);

/* Returns the plane codes of a node, and sets *count to their number. Returns NULL if there are
 * none. */
const uint32_t *ebpo_partial_codes(const ebpo_partial *partial, ebpo_partial_node node,
                                   unsigned *count);

/* Returns the envelope of a node in cell coordinates. The groups of the node's ancestors must be
 * linked. The result is valid until the next call with the same `envelopes`. */
const ebpo_polytope *ebpo_partial_envelope(const ebpo_partial *partial, ebpo_partial_node node,
                                           ebpo_envelope_stack *envelopes);

/* --- the frontier: the gray nodes of the cut in a heap; the top is the node to refine next --- */

/* Class of a node in the order of refinement: visible nodes first, then nodes outside the frustum.
 * EBPO_TURN_NEVER: the node is not refined, because a limit of the view's options excludes it, or
 * because it is pruned. */
typedef enum ebpo_turn { EBPO_TURN_SEEN, EBPO_TURN_UNSEEN, EBPO_TURN_NEVER } ebpo_turn;

#define EBPO_PRUNED_GROUP UINT64_MAX

/* A node of the frontier. Nodes are ordered by turn, then by key, then by octcode. */
typedef struct ebpo_waiting {
    uint64_t key, octcode; /* key: ebpo_viewpoint_key */
    /* ebpo_partial_children; EBPO_PRUNED_GROUP: the children are not in the file; view_surface.c:
     * index of a patch */
    uint64_t child_group;
    uint32_t group;       /* `group` and `octant`: the node as an ebpo_partial_node */
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
/* A block consists of `span` neighbouring groups of a level. A node of the frontier belongs to the
 * block that contains the group of the node's children. For each block, finds the node of the
 * frontier that will be refined first. Writes the indices of these nodes in frontier->at to `best`,
 * in the order of refinement, so best[0] is the top. Returns the number of indices, at most
 * EBPO_FRONTIER_BLOCKS. */
enum { EBPO_FRONTIER_BLOCKS = 1024 };
unsigned ebpo_frontier_blocks(const ebpo_frontier *frontier, uint64_t span,
                              uint64_t best[EBPO_FRONTIER_BLOCKS]);

#endif
