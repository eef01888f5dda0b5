/* The states of the walks through the hierarchies of two accels at poses: ebpo_pair_walk goes to
 * the faces that intersect, ebpo_gap_search to the nearest ones. Kernels walk; what they leave
 * open is decided elsewhere. One thread each. */
#ifndef EBPO_COLLIDE_HIERARCHY_WALK_H
#define EBPO_COLLIDE_HIERARCHY_WALK_H

#include <ebpo/pair.h>

#include "core/cpu.h"
#include "extras/collide/face_pairs.h"
#include "extras/collide/posed_frames.h"

/* Children of nodes: the node's number << 3 | lane. */
typedef struct ebpo_node_pair {
    uint32_t a, b;
    float key; /* the first contact looks at greater ones first */
} ebpo_node_pair;

/* Faces that meet, by their local numbers. */
typedef struct ebpo_met_pair {
    uint32_t a, b;
    int32_t kind; /* ebpo_pair_kind, not EBPO_PAIR_APART */
} ebpo_met_pair;

/* A node's children in both frames: seen from the node's origin, not moved to the other's. */
typedef struct ebpo_turned_node {
    _Alignas(32) float c[3][8], e[3][8]; /* middles and half sides of boxes */
    float c2[3][8], e2[3][8];            /* of the boxes around these along the other's axes */
    float axis[3][8], axis2[3][8];       /* of slabs, of length 1 */
    float mid[3][8], mid2[3][8];         /* of slabs */
    float half[8], radius[8], extent[8]; /* extent: the sum of the half sides */
    double origin[3];                    /* in the first's frame, both of them */
    float size;                          /* no box is longer */
    uint32_t node;                       /* EBPO_NO_CHILD: none is here */
    uint8_t lanes;
    bool slabs; /* a child has one */
} ebpo_turned_node;

enum { EBPO_TURNED_BITS = 4, EBPO_TURNED_NODES = 1 << EBPO_TURNED_BITS };

typedef struct ebpo_pair_walk ebpo_pair_walk;

/* Compiled for several processors, with the same results. */
typedef struct ebpo_walk_kernels {
    /* Takes so many pairs from the stack at most. False: no memory. */
    bool (*run)(ebpo_pair_walk *walk, uint64_t pairs);
    /* Pushes the children of both tops, or of one pair. False: no memory. */
    bool (*start)(ebpo_pair_walk *walk);
    bool (*expand)(ebpo_pair_walk *walk, ebpo_node_pair pair);
} ebpo_walk_kernels;

EBPO_KERNELS(ebpo_walk_kernels, ebpo_walk_kernels)

struct ebpo_pair_walk {
    const ebpo_accel_pair *pair;
    const ebpo_walk_kernels *kernels;
    const ebpo_pair_kernels *filter;
    bool first;          /* ends with the first pair that meets; siblings by least overlap */
    bool self;           /* both are one accel at one pose: each pair of faces once */
    bool neighbours;     /* faces are of one mesh: what these have in common is no meeting */
    uint32_t begin, end; /* faces of the first accel that matter */
    ebpo_node_pair *stack;
    uint64_t top, capacity;
    uint64_t group; /* of the first contact: where the last group of the stack begins */
    ebpo_met_pair *met;
    uint64_t met_count, met_capacity;
    uint32_t met_slot[2];                    /* of the pair that was found last */
    uint64_t node_pairs, block_pairs, exact; /* looked at; of faces, left to the exact test */
    ebpo_turned_node turned[2][EBPO_TURNED_NODES];
    ebpo_posed_faces posed[2][EBPO_POSED_FACES];
};

void ebpo_pair_walk_free(ebpo_pair_walk *walk);

/* For kernels: decides what the filter has left of two blocks. False: no memory. */
bool ebpo_pair_walk_decide(ebpo_pair_walk *walk, uint32_t block_a, uint32_t block_b,
                           const ebpo_block_pairs *pairs);
/* For kernels: room for more of the stack. */
bool ebpo_pair_walk_room(ebpo_pair_walk *walk, uint64_t more);

/* A face's posed coordinates. */
void ebpo_posed_triangle(const ebpo_accel *accel, const ebpo_posing *posing, uint32_t slot,
                         double out[3][3]);

/* --- the nearest pair of faces ---
 *
 * Lengths are those of the world times the posings' unit. Nothing that the walk drops is nearer
 * than `limit`. Bounds: docs/develop/collision.md, "Bounds of pairs of nodes". */

/* A pair of children: node * 8 + lane of each. */
typedef struct ebpo_gap_visit {
    float key; /* squared lower bound; where nodes meet, less than 0: how little they overlap */
    uint32_t child[2];
    uint32_t way; /* the direction that the key knows of */
} ebpo_gap_visit;

/* A pair of faces, by slots, which is not certainly farther than `low`. */
typedef struct ebpo_gap_candidate {
    float low;
    uint32_t slot[2];
} ebpo_gap_candidate;

/* What eight children of a node are in their own frame, and seen from the other one. */
typedef struct ebpo_gap_node {
    _Alignas(32) float centre[2][3][8], half[2][3][8]; /* of boxes */
    float axis[2][3][8], middle[2][3][8];              /* of slabs, unit axes */
    float thick[8], radius[8];                         /* half-widths along and aside */
    float reach[8]; /* along the direction of the search, in its frame */
    uint32_t node, way;
} ebpo_gap_node;

enum { EBPO_GAP_CANDIDATES = 256, EBPO_GAP_NODES = 16 };

typedef struct ebpo_gap_search ebpo_gap_search;
struct ebpo_gap_search {
    const ebpo_accel *accel[2];
    ebpo_block_posing posing[2];
    ebpo_two_frames frames;
    float limit;     /* pairs certainly farther do not matter */
    float square;    /* what squared lower bounds are compared with */
    float tolerance; /* what is not nearer by so much does not matter */
    float best;      /* the pair best_slot is certainly not farther; INFINITY: none is known */
    uint32_t best_slot[2];
    float way[3]; /* a direction in the world, from A to B: along it they may be far apart */
    float along[2][3], along_shift; /* the same in both frames, each towards the other model */
    uint32_t way_number;

    void *user;
    bool (*judge)(ebpo_gap_search *search); /* decides about all that waits; false: enough */
    bool (*go_on)(ebpo_gap_search *search); /* asked now and then */
    bool ended;                             /* before all was seen */
    bool no_memory;

    /* What is to be visited. Until a limit is known the last one comes next, then the least key,
     * and it is a heap: stack[i] has no greater key than stack[2 i + 1] and stack[2 i + 2]. */
    ebpo_gap_visit *stack;
    uint64_t count, capacity;
    bool is_heap;
    ebpo_gap_candidate waiting[EBPO_GAP_CANDIDATES];
    unsigned waits;
    uint64_t node_pairs, block_pairs;

    ebpo_gap_node node[2][EBPO_GAP_NODES];
    ebpo_posed_faces faces[2][EBPO_POSED_FACES];
};

/* NULL: no memory. */
ebpo_gap_search *ebpo_gap_new(void);
void ebpo_gap_free(ebpo_gap_search *g);
/* Sets all but user, judge, go_on; nothing is known of the distance, the tolerance is 0. `reach` as
 * for ebpo_block_unit. */
void ebpo_gap_begin(ebpo_gap_search *g, const ebpo_accel *const accel[2],
                    const ebpo_posing posing[2], double reach);
/* Of things that are certainly farther nobody wants to know. Never raised. */
void ebpo_gap_set_limit(ebpo_gap_search *g, float limit);
/* A pair of faces is certainly not farther. */
void ebpo_gap_set_best(ebpo_gap_search *g, float best, uint32_t slot_a, uint32_t slot_b);
/* Of any length, in the world; 0 changes nothing. */
void ebpo_gap_set_way(ebpo_gap_search *g, const float way[3]);

/* Room for a node's pairs. */
bool ebpo_gap_room(ebpo_gap_search *g);
/* Room for a block's pairs among those that wait; false: judge said that it is enough. */
bool ebpo_gap_wait_room(ebpo_gap_search *g);

/* The walk through all pairs from the tops on; what then waits may be nearest. When it has been
 * ended early the stack has what was not seen. Compiled twice, with the same results. */
typedef struct ebpo_gap_kernels {
    void (*walk)(ebpo_gap_search *g);
} ebpo_gap_kernels;

EBPO_KERNELS(ebpo_gap_kernels, ebpo_gap_kernels)

#endif
