/* A search for the nearest pair of faces of two accels at poses, as the kernels see it: which pairs
 * of nodes and of blocks may matter. Lengths are the world's times the posings' unit; nothing that
 * the walk drops is nearer than `limit`, and what it keeps is decided elsewhere. Bounds:
 * docs/develop/collision.md, "Bounds of pairs of nodes". */
#ifndef EBPO_COLLIDE_GAP_SEARCH_H
#define EBPO_COLLIDE_GAP_SEARCH_H

#include "core/cpu.h"
#include "extras/collide/posed_faces.h"
#include "extras/collide/posed_block.h"

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
