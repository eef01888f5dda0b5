/* Walks through the hierarchies of two accels (acceleration structures of subtrees) at poses:
 * ebpo_pair_walk finds the faces that intersect, ebpo_gap_search finds the nearest faces. A node of
 * a hierarchy has up to eight children in lanes 0 to 7; a child is a node or a block of up to eight
 * faces (query/accel.h). A slot is the position of a face in the blocks: 8 * the block's index +
 * the face's lane. Each walk is for one thread at a time. */
#ifndef EBPO_COLLIDE_HIERARCHY_WALK_H
#define EBPO_COLLIDE_HIERARCHY_WALK_H

#include <ebpo/pair.h>

#include "core/cpu.h"
#include "extras/collide/face_pairs.h"
#include "extras/collide/posed_frames.h"

/* A pair of children of nodes, each given as 8 * the node's index + the child's lane. */
typedef struct ebpo_node_pair {
    uint32_t a, b; /* children in the first and in the second accel */
    float key;     /* overlap of both children; the search for the first contact visits greater keys
                    * first */
} ebpo_node_pair;

/* A pair of intersecting faces, by their local indices in the two accels. */
typedef struct ebpo_found_pair {
    uint32_t a, b;
    int32_t kind; /* ebpo_pair_kind, not EBPO_PAIR_APART */
} ebpo_found_pair;

/* A node's children in the frame of the node's model. Members with a 2 in the name describe the
 * children in the axes of the other model's frame; they are rotated, but not translated.
 * Coordinates are relative to the node's origin. */
typedef struct ebpo_turned_node {
    _Alignas(32) float c[3][8], e[3][8]; /* middles and half sides of boxes */
    float c2[3][8], e2[3][8];            /* boxes around these boxes, along the axes of the other
                                          * frame */
    float axis[3][8], axis2[3][8];       /* axes of cylinders, of length 1 */
    float mid[3][8], mid2[3][8];         /* middles of cylinders */
    float half[8], radius[8];            /* half lengths and radii of cylinders */
    float extent[8];                     /* sums of the half sides of boxes */
    double origin[4];                    /* the node's origin in the first model's frame, for nodes
                                          * of both models; origin[3] is 0 */
    float size;                          /* length of the longest side of all boxes */
    uint32_t node;                       /* the node's index */
    uint8_t lanes;                       /* a bit for each lane that has a child */
    uint8_t large;                       /* ebpo_bound_cylinder.large, if `cylinders` */
    bool cylinders;                      /* at least one child has a cylinder */
} ebpo_turned_node;

/* EBPO_TURNED_NODES: number of turned nodes of each model that a walk keeps (a cache).
 * EBPO_TURNED_BITS: its logarithm to the base 2. */
enum { EBPO_TURNED_BITS = 5, EBPO_TURNED_NODES = 1 << EBPO_TURNED_BITS };

typedef struct ebpo_pair_walk ebpo_pair_walk;

/* The functions of a walk, compiled for several processors, with the same results. All return false
 * if memory is short. */
typedef struct ebpo_walk_kernels {
    /* Visits at most `pairs` pairs of the stack. */
    bool (*run)(ebpo_pair_walk *walk, uint64_t pairs);
    /* Pushes the pairs of children of both top nodes. */
    bool (*start)(ebpo_pair_walk *walk);
    /* Divides a pair of nodes, and pushes the new pairs. Pushes a pair of blocks unchanged. */
    bool (*expand)(ebpo_pair_walk *walk, ebpo_node_pair pair);
} ebpo_walk_kernels;

EBPO_KERNELS(ebpo_walk_kernels, ebpo_walk_kernels)

struct ebpo_pair_walk {
    const ebpo_accel_pair *pair;
    const ebpo_walk_kernels *kernels;
    const ebpo_pair_kernels *filter;
    bool first;          /* end with the first intersecting pair; of the pairs that a division makes
                          * (siblings), visit the pair with the greatest overlap first */
    bool self;           /* both accels are the same accel at the same pose: find each pair of faces
                          * once */
    bool neighbours;     /* all faces belong to one mesh: a common corner or edge of two faces is no
                          * contact */
    uint32_t begin, end; /* the walk considers only the faces [begin, end) of the first accel, by
                          * local indices */
    ebpo_node_pair *stack; /* [top] pairs that wait to be visited; the last pair is next */
    uint64_t top, capacity;
    uint64_t group; /* if `first`: index at which the last group of siblings begins on the stack */
    ebpo_found_pair *found_pairs; /* [found_count] */
    uint64_t found_count, found_capacity;
    uint32_t found_slot[2];                  /* slots of the faces of the last pair found */
    uint64_t node_pairs, block_pairs, exact; /* numbers of visited pairs of nodes and of blocks, and
                                              * of pairs of faces decided by the exact test */
    /* [model] the last nodes and blocks that the walk has transformed (caches). turned_node: index
     * of the node in each entry of `turned`; EBPO_NO_CHILD: the entry is empty. */
    uint32_t turned_node[2][EBPO_TURNED_NODES];
    ebpo_turned_node turned[2][EBPO_TURNED_NODES];
    ebpo_posed_cache posed[2];
};

/* Frees the memory of a walk, which may be used again. */
void ebpo_pair_walk_free(ebpo_pair_walk *walk);

/* For kernels: decides the pairs of faces of two blocks that the filter has not excluded, and adds
 * the intersecting pairs to found_pairs. Returns false if memory is short. */
bool ebpo_pair_walk_decide(ebpo_pair_walk *walk, uint32_t block_a, uint32_t block_b,
                           const ebpo_block_pairs *pairs);
/* For kernels: makes space for `more` pairs on the stack. Returns false if memory is short. */
bool ebpo_pair_walk_capacity(ebpo_pair_walk *walk, uint64_t more);

/* Computes the posed corners of the face at a slot. */
void ebpo_posed_triangle(const ebpo_accel *accel, const ebpo_posing *posing, uint32_t slot,
                         double out[3][3]);

/* --- the nearest pair of faces ---
 *
 * All lengths are world lengths times the unit of the posings (ebpo_block_unit). A pair is dropped
 * only if it is certainly not nearer than `limit`. Bounds: docs/develop/collision.md, "Bounds of
 * pairs of nodes". */

/* A pair of children of nodes, each given as 8 * the node's index + the child's lane. */
typedef struct ebpo_gap_visit {
    float key; /* square of a lower bound of the distance; negative if the children may intersect;
                  the more they overlap, the lower the key */
    uint32_t child[2];
    uint32_t direction; /* direction_number of the direction for which the key was computed */
} ebpo_gap_visit;

/* A pair of faces that may be nearer than the limit. */
typedef struct ebpo_gap_candidate {
    float low; /* lower bound of the distance */
    uint32_t slot[2];
} ebpo_gap_candidate;

/* Eight children of a node. Index 0 of [2]: in the frame of the node's model; 1: in the other
 * model's frame. */
typedef struct ebpo_gap_node {
    _Alignas(32) float centre[2][3][8], half[2][3][8]; /* boxes */
    float axis[2][3][8], middle[2][3][8];              /* unit axes and middles of cylinders */
    float thick[8], radius[8];                         /* half lengths and radii of cylinders */
    float extent[8];    /* how far each child extends along the direction of the search, from the
                         * origin of the node's frame */
    uint32_t node;      /* the node's index; EBPO_NO_CHILD: the entry is empty */
    uint32_t direction; /* direction_number of the direction of `extent` */
} ebpo_gap_node;

enum {
    EBPO_GAP_CANDIDATES = 256, /* greatest number of waiting pairs of faces */
    EBPO_GAP_NODES = 16        /* number of nodes of each model that a search keeps (a cache) */
};

typedef struct ebpo_gap_search ebpo_gap_search;
struct ebpo_gap_search {
    const ebpo_accel *accel[2];
    ebpo_block_posing posing[2];
    ebpo_two_frames frames;
    float limit;  /* pairs whose distance is certainly greater than the limit do not matter */
    float square; /* square of the limit, rounded up, for comparisons with squared lower bounds */
    float tolerance; /* a pair that is nearer than `best` by less than the tolerance does not matter
                      */
    float best; /* upper bound of the distance of the faces best_slot (the best pair: the nearest
                 * pair so far); INFINITY: no pair is known */
    uint32_t best_slot[2];
    float direction[3]; /* a direction in the world, from the first model to the second, along which
                         * the gap of the models may be large */
    float along[2][3];  /* the direction in the frame of each model, towards the other model */
    float along_shift;  /* distance of both frames' origins along the direction */
    uint32_t direction_number; /* counts the directions of this search */

    void *user; /* for the functions below */
    /* Decides all waiting pairs of faces. Returns false to end the walk. */
    bool (*decide_waiting)(ebpo_gap_search *search);
    /* Called from time to time; returns false to end the walk. */
    bool (*keep_going)(ebpo_gap_search *search);
    bool ended;     /* the walk ended before all pairs were visited */
    bool no_memory; /* the walk ended because an allocation has failed */

    /* [count] pairs to be visited: a stack until a limit is known, then a heap with the least key
     * first. In a heap, the key of stack[i] is at most the keys of stack[2 i + 1] and
     * stack[2 i + 2]. */
    ebpo_gap_visit *stack;
    uint64_t count, capacity;
    bool is_heap;
    ebpo_gap_candidate
        waiting[EBPO_GAP_CANDIDATES]; /* [waiting_count] pairs of faces to be decided */
    unsigned waiting_count;
    uint64_t node_pairs, block_pairs; /* numbers of visited pairs of nodes and of blocks */

    /* [model] the last nodes and blocks that the search has transformed (caches) */
    ebpo_gap_node node[2][EBPO_GAP_NODES];
    ebpo_posed_cache faces[2];
};

/* Allocates a search. Returns NULL if memory is short. */
ebpo_gap_search *ebpo_gap_new(void);
void ebpo_gap_free(ebpo_gap_search *g);
/* Begins a search without limit and with tolerance 0; sets all members except user, decide_waiting
 * and keep_going. max_coordinate: as for ebpo_block_unit. */
void ebpo_gap_begin(ebpo_gap_search *g, const ebpo_accel *const accel[2],
                    const ebpo_posing posing[2], double max_coordinate);
/* Sets g->limit to `limit` if `limit` is lower. */
void ebpo_gap_set_limit(ebpo_gap_search *g, float limit);
/* Makes a pair of faces the best pair, if the upper bound `best` of its distance is less than
 * g->best. Then also sets the limit. */
void ebpo_gap_set_best(ebpo_gap_search *g, float best, uint32_t slot_a, uint32_t slot_b);
/* Sets the direction of the search, a vector in the world. Changes nothing if its length is 0 or
 * too extreme for the error bounds. */
void ebpo_gap_set_direction(ebpo_gap_search *g, const float direction[3]);

/* Makes space for the pairs of children of two nodes. Returns false if memory is short. */
bool ebpo_gap_capacity(ebpo_gap_search *g);
/* Makes space for all pairs of faces of two blocks among the waiting pairs. If necessary, removes
 * waiting pairs beyond the limit, and then decides the others. Returns false if decide_waiting
 * returned false. */
bool ebpo_gap_wait_capacity(ebpo_gap_search *g);

/* The function of a search, compiled for several processors, with the same results. */
typedef struct ebpo_gap_kernels {
    /* Visits all pairs, beginning with the top nodes. Afterwards the nearest pair may be among the
     * waiting pairs, which have not been decided. If the walk ended early, the stack has the pairs
     * of nodes that were not visited. */
    void (*walk)(ebpo_gap_search *g);
} ebpo_gap_kernels;

EBPO_KERNELS(ebpo_gap_kernels, ebpo_gap_kernels)

#endif
