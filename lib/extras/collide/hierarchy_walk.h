/* Walks through the hierarchies of two accels (acceleration structures of subtrees) at poses:
 * ebpo_pair_walk finds the faces that intersect, ebpo_gap_search finds the nearest faces. A node of
 * a hierarchy has up to eight children in lanes 0 to 7; a child is a node or a block of up to eight
 * faces (query/accel.h). Each walk is for one thread at a time. */
#ifndef EBPO_COLLIDE_HIERARCHY_WALK_H
#define EBPO_COLLIDE_HIERARCHY_WALK_H

#include <ebpo/pair.h>

#include "core/cpu.h"
#include "extras/collide/face_pairs.h"
#include "extras/collide/posed_frames.h"

/* A pair of children of nodes, each given as 8 * the node's index + the child's lane. */
typedef struct ebpo_node_pair {
    uint32_t a, b;
    float key; /* overlap of both nodes; the search for the first contact visits greater keys
                * first */
} ebpo_node_pair;

/* A pair of intersecting faces, by their local indices in the two accels. */
typedef struct ebpo_found_pair {
    uint32_t a, b;
    int32_t kind; /* ebpo_pair_kind, not EBPO_PAIR_APART */
} ebpo_found_pair;

/* A node's children in its model's frame, and (members with a 2 in the name) in the other model's
 * frame: rotated, but not translated. Coordinates are relative to the node's origin. */
typedef struct ebpo_turned_node {
    _Alignas(32) float c[3][8], e[3][8]; /* middles and half sides of boxes */
    float c2[3][8], e2[3][8];            /* boxes around these boxes, along the axes of the other
                                          * frame */
    float axis[3][8], axis2[3][8];       /* axes of cylinders, of length 1 */
    float mid[3][8], mid2[3][8];         /* middles of cylinders */
    float half[8], radius[8];            /* half lengths and radii of cylinders */
    float extent[8];                     /* sums of the half sides of boxes */
    double origin[3];                    /* the node's origin in the first model's frame, for nodes
                                          * of both models */
    float size;                          /* length of the longest side of all boxes */
    uint32_t node;                       /* the node's index; EBPO_NO_CHILD: the entry is empty */
    uint8_t lanes;                       /* a bit for each lane that has a child */
    bool cylinders;                      /* at least one child has a cylinder */
} ebpo_turned_node;

/* Number of turned nodes of each model that a walk keeps (a cache). */
enum { EBPO_TURNED_BITS = 4, EBPO_TURNED_NODES = 1 << EBPO_TURNED_BITS };

typedef struct ebpo_pair_walk ebpo_pair_walk;

/* The functions of a walk, compiled for several processors, with the same results. All return false
 * without memory. */
typedef struct ebpo_walk_kernels {
    /* Visits at most `pairs` pairs of the stack. */
    bool (*run)(ebpo_pair_walk *walk, uint64_t pairs);
    /* Push the pairs of children of both top nodes, or of one pair of nodes. */
    bool (*start)(ebpo_pair_walk *walk);
    bool (*expand)(ebpo_pair_walk *walk, ebpo_node_pair pair);
} ebpo_walk_kernels;

EBPO_KERNELS(ebpo_walk_kernels, ebpo_walk_kernels)

struct ebpo_pair_walk {
    const ebpo_accel_pair *pair;
    const ebpo_walk_kernels *kernels;
    const ebpo_pair_kernels *filter;
    bool first;      /* end with the first intersecting pair, and visit siblings by greatest overlap
                      */
    bool self;       /* both accels are one accel at one pose: find each pair of faces once */
    bool neighbours; /* the faces are of one mesh: a common corner or edge of neighbours is no
                      * contact */
    uint32_t begin, end; /* the walk considers only the faces [begin, end) of the first accel: local
                          * indices */
    ebpo_node_pair *stack;
    uint64_t top, capacity;
    uint64_t group; /* if `first`: index at which the last group of siblings begins on the stack */
    ebpo_found_pair *found_pairs;
    uint64_t found_count, found_capacity;
    uint32_t found_slot[2];                  /* slots of the last pair found */
    uint64_t node_pairs, block_pairs, exact; /* numbers of visited pairs of nodes and of blocks, and
                                              * of pairs of faces decided by the exact test */
    ebpo_turned_node turned[2][EBPO_TURNED_NODES];
    ebpo_posed_faces posed[2][EBPO_POSED_FACES];
};

void ebpo_pair_walk_free(ebpo_pair_walk *walk);

/* For kernels: decides the pairs of faces of two blocks that the filter has not excluded. Returns
 * false without memory. */
bool ebpo_pair_walk_decide(ebpo_pair_walk *walk, uint32_t block_a, uint32_t block_b,
                           const ebpo_block_pairs *pairs);
/* For kernels: makes space for `more` pairs on the stack. Returns false without memory. */
bool ebpo_pair_walk_capacity(ebpo_pair_walk *walk, uint64_t more);

/* Computes the posed corners of the face at a slot of the accel's blocks. */
void ebpo_posed_triangle(const ebpo_accel *accel, const ebpo_posing *posing, uint32_t slot,
                         double out[3][3]);

/* --- the nearest pair of faces ---
 *
 * All lengths are world lengths times the unit of the posings (ebpo_block_unit). A pair is dropped
 * only if it is certainly not nearer than `limit`. Bounds: docs/develop/collision.md, "Bounds of
 * pairs of nodes". */

/* A pair of children of nodes, each given as 8 * the node's index + the child's lane. */
typedef struct ebpo_gap_visit {
    float key; /* square of a lower bound of the distance; negative if the nodes intersect: nearer
                * to 0 if they overlap less */
    uint32_t child[2];
    uint32_t direction; /* direction_number of the direction for which the key was computed */
} ebpo_gap_visit;

/* A pair of faces, by slots, whose distance is at least `low`. */
typedef struct ebpo_gap_candidate {
    float low;
    uint32_t slot[2];
} ebpo_gap_candidate;

/* Eight children of a node, in the node's frame and in the other model's frame. */
typedef struct ebpo_gap_node {
    _Alignas(32) float centre[2][3][8], half[2][3][8]; /* boxes */
    float axis[2][3][8], middle[2][3][8];              /* unit axes and middles of cylinders */
    float thick[8], radius[8];                         /* half lengths and radii of cylinders */
    float extent[8];    /* how far each child extends along the direction of the search, from the
                         * origin of the node's frame */
    uint32_t node;      /* the node's index; EBPO_NO_CHILD: the entry is empty */
    uint32_t direction; /* direction_number of the direction of `extent` */
} ebpo_gap_node;

enum { EBPO_GAP_CANDIDATES = 256, EBPO_GAP_NODES = 16 };

typedef struct ebpo_gap_search ebpo_gap_search;
struct ebpo_gap_search {
    const ebpo_accel *accel[2];
    ebpo_block_posing posing[2];
    ebpo_two_frames frames;
    float limit;  /* pairs whose distance is certainly greater do not matter */
    float square; /* square of the limit, rounded up: squared lower bounds are compared with it */
    float tolerance; /* a pair that is nearer than `best` by less than this does not matter */
    float best; /* upper bound of the distance of the faces best_slot; INFINITY: no pair is known */
    uint32_t best_slot[2];
    float direction[3]; /* a direction in the world, from A to B, along which the gap of the models
                         * may be large */
    float along[2][3], along_shift; /* along: the same direction in both frames, towards the other
                                     * model; along_shift: distance of both frames' origins along
                                     * it */
    uint32_t direction_number;      /* counts the directions of this search */

    void *user;
    /* Decides all waiting pairs of faces. Returns false to end the walk, if further pairs cannot
     * change the result. */
    bool (*decide_waiting)(ebpo_gap_search *search);
    /* Called from time to time; returns false to end the walk. */
    bool (*keep_going)(ebpo_gap_search *search);
    bool ended; /* the walk ended before all pairs were visited */
    bool no_memory;

    /* Pairs to be visited. Until a limit is known this is a stack; then a heap with the least key
     * first: the key of stack[i] is at most the keys of stack[2 i + 1] and stack[2 i + 2]. */
    ebpo_gap_visit *stack;
    uint64_t count, capacity;
    bool is_heap;
    ebpo_gap_candidate
        waiting[EBPO_GAP_CANDIDATES]; /* [waiting_count] pairs of faces to be decided */
    unsigned waiting_count;
    uint64_t node_pairs, block_pairs; /* numbers of visited pairs of nodes and of blocks */

    ebpo_gap_node node[2][EBPO_GAP_NODES];
    ebpo_posed_faces faces[2][EBPO_POSED_FACES];
};

/* Allocates a search. Returns NULL without memory. */
ebpo_gap_search *ebpo_gap_new(void);
void ebpo_gap_free(ebpo_gap_search *g);
/* Begins a search without limit and with tolerance 0; sets all members except user, decide_waiting
 * and keep_going. max_coordinate: as for ebpo_block_unit. */
void ebpo_gap_begin(ebpo_gap_search *g, const ebpo_accel *const accel[2],
                    const ebpo_posing posing[2], double max_coordinate);
/* Lowers the limit; a greater limit than the current one changes nothing. */
void ebpo_gap_set_limit(ebpo_gap_search *g, float limit);
/* Records a pair of faces and an upper bound of its distance. */
void ebpo_gap_set_best(ebpo_gap_search *g, float best, uint32_t slot_a, uint32_t slot_b);
/* Sets the direction of the search, in the world, of any length; a direction of 0, 0, 0 changes
 * nothing. */
void ebpo_gap_set_direction(ebpo_gap_search *g, const float direction[3]);

/* Makes space for the pairs of children of two nodes. Returns false without memory. */
bool ebpo_gap_capacity(ebpo_gap_search *g);
/* Makes space for the pairs of two blocks among the waiting pairs, if necessary by deciding those.
 * Returns false if decide_waiting returned false. */
bool ebpo_gap_wait_capacity(ebpo_gap_search *g);

/* The walk through all pairs, which begins with the top nodes. Afterwards the nearest pair may be
 * among the waiting pairs, which have not been decided. If the walk ended early, the stack has the
 * pairs of nodes that were not visited. Compiled for several processors, with the same results. */
typedef struct ebpo_gap_kernels {
    void (*walk)(ebpo_gap_search *g);
} ebpo_gap_kernels;

EBPO_KERNELS(ebpo_gap_kernels, ebpo_gap_kernels)

#endif
