/* The cut of a view (view_cut.c): the observer, the part of the tree that has been delivered, and
 * the frontier. */
#ifndef EBPO_LEVELS_VIEW_CUT_H
#define EBPO_LEVELS_VIEW_CUT_H

#include <ebpo/base.h>
#include <ebpo/view.h>

#include "format/file_nodes.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"
#include "levels/stream.h"

/* --- the observer: distance and size of cells, whether they are seen, their order --- */

/* Made ready. Lengths are in units of about the root cell's longest side (a power of two of the
 * model's unit), so that squares neither overflow nor vanish. */
typedef struct ebpo_viewpoint {
    bool given, everywhere;
    double eye[3]; /* the model's unit */
    double unit;   /* of the model's units in one */
    double focal;  /* pixels of the length 1 at the distance 1 */
    /* normals of the frustum's walls, all through the eye, and of the plane through the eye that
     * faces the picture */
    double inward[5][3];
    double diagonal2[EBPO_LEVELS_MAX]; /* squared, of a level's cells */
} ebpo_viewpoint;

/* `observer` may be NULL. EBPO_E_ARGUMENT: one that makes no sense. */
EBPO_MUST_USE ebpo_status ebpo_viewpoint_make(ebpo_viewpoint *out, const ebpo_box *box,
                                              const ebpo_observer *observer, ebpo_error *error);

typedef struct ebpo_seen {
    double distance2; /* squared, from the eye to the cell's nearest point */
    bool seen;
} ebpo_seen;
ebpo_seen ebpo_viewpoint_see(const ebpo_viewpoint *viewpoint, const ebpo_box *box, ebpo_cell cell);

/* In the model's unit; in pixels. */
double ebpo_viewpoint_distance(const ebpo_viewpoint *viewpoint, double distance2);
double ebpo_viewpoint_pixels(const ebpo_viewpoint *viewpoint, int level, double distance2);

/* The octant of the cell in which the eye is, or beyond which it is. A child o is in no ray's way
 * to a child p when o ^ this has a bit that p ^ this has not. */
unsigned ebpo_viewpoint_octant(const ebpo_viewpoint *viewpoint, const ebpo_box *box,
                               ebpo_cell cell);

/* Place in the order of the priority: the least comes first. For two cells of which none contains
 * the other. */
uint64_t ebpo_viewpoint_key(const ebpo_viewpoint *viewpoint, const ebpo_box *box,
                            ebpo_priority priority, ebpo_octcode octcode, double distance2);

/* --- the part of a tree that has been delivered --- */

/* A group of siblings, linked to its parent once it is complete. */
typedef struct ebpo_partial_group {
    uint64_t parent;     /* octcode; 0: the root's group */
    uint64_t first_gray; /* rank in its level of the group's first gray node */
    uint64_t first_code; /* into codes */
    uint32_t child[8];   /* number of the children's group; 0: not there */
    uint16_t types;
    uint8_t plane_count[8];
} ebpo_partial_group;

typedef struct ebpo_partial {
    ebpo_partial_group *group; /* group 0 is the root's */
    uint32_t *codes;
    int32_t (*winding)[8]; /* NULL: not wanted */
    uint64_t group_count, group_capacity, winding_capacity, code_count, code_capacity;
    bool windings;
    /* gray nodes seen of each level; more than the head tells: the file is damaged */
    uint64_t grays[EBPO_LEVELS_MAX];
} ebpo_partial;

void ebpo_partial_free(ebpo_partial *partial);

/* A node by its group and octant. */
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

/* The group in which a gray node's children stand, in the next level of the file. */
static inline uint64_t ebpo_partial_children(const ebpo_partial *g, ebpo_partial_node gray)
{
    return g->group[gray.group].first_gray +
           ebpo_group_count(g->group[gray.group].types, EBPO_GRAY, gray.octant);
}

/* Adds a group behind the last one; not linked yet. */
EBPO_MUST_USE ebpo_status ebpo_partial_add(ebpo_partial *partial, const ebpo_info *info,
                                           uint64_t parent, const ebpo_group *read,
                                           ebpo_error *error);

/* A node's own plane codes. */
const uint32_t *ebpo_partial_codes(const ebpo_partial *partial, ebpo_partial_node node,
                                   unsigned *count);

/* Its envelope in coordinates of its cell; the nodes above it are linked. Lent until the next call
 * with these envelopes. */
const ebpo_polytope *ebpo_partial_envelope(const ebpo_partial *partial, ebpo_partial_node node,
                                           ebpo_envelope_stack *envelopes);

/* --- the frontier: the gray nodes of the cut in a heap, the next one to be refined on top --- */

/* Whether a node's turn comes at all. */
typedef enum ebpo_turn { EBPO_TURN_SEEN, EBPO_TURN_UNSEEN, EBPO_TURN_NEVER } ebpo_turn;

typedef struct ebpo_waiting {
    uint64_t key, octcode; /* the least key first, then the least octcode */
    uint64_t below;        /* number of its children's group in their level */
    uint32_t group;
    uint8_t octant, turn;
} ebpo_waiting;

typedef struct ebpo_frontier {
    ebpo_waiting *at; /* [count], a binary heap */
    uint64_t count, capacity;
} ebpo_frontier;

void ebpo_frontier_free(ebpo_frontier *frontier);
/* After this, so many pushes cannot fail. */
EBPO_MUST_USE ebpo_status ebpo_frontier_reserve(ebpo_frontier *frontier, uint64_t more,
                                                ebpo_error *error);
void ebpo_frontier_push(ebpo_frontier *frontier, ebpo_waiting node);
/* Takes the top away. */
ebpo_waiting ebpo_frontier_pop(ebpo_frontier *frontier);
/* After keys or turns have been changed. */
void ebpo_frontier_sort(ebpo_frontier *frontier);
/* Of the nodes whose turn comes, the first one of each block of `span` children's groups of a
 * level: their places in `at`, in order. The top is the first. At most EBPO_FRONTIER_BLOCKS;
 * returns how many. */
enum { EBPO_FRONTIER_BLOCKS = 1024 };
unsigned ebpo_frontier_blocks(const ebpo_frontier *frontier, uint64_t span,
                              uint64_t places[EBPO_FRONTIER_BLOCKS]);

#endif
