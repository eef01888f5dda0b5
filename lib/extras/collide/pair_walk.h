/* Two accels at their poses, each in its own frame, made ready for going down both hierarchies
 * together. Immutable; any thread.
 *
 * Frames are measured in one unit: the first's, or the second's if that is the larger one. What is
 * known of each is linear in the frame of the other, whatever the poses' matrices are like; only
 * slabs rest upon lengths (docs/develop/collision.md, "Going down two hierarchies"). */
#ifndef EBPO_COLLIDE_PAIR_WALK_H
#define EBPO_COLLIDE_PAIR_WALK_H

#include <ebpo/pair.h>

#include "core/cpu.h"
#include "extras/collide/pair_filter.h"
#include "extras/collide/posed_block.h"
#include "extras/collide/posed_faces.h"
#include "query/accel.h"

typedef struct ebpo_accel_pair {
    const ebpo_accel *accel[2];
    const ebpo_block_posing *posing[2];
    float unit[2];     /* what a length of a frame is multiplied by */
    double turn[3][3]; /* a vector of the second's frame to the first's */
    double place[3];   /* the second's origin in the first's frame */
    /* The same in floats: a vector of the other's frame to frame i; and the sizes of the entries,
     * rounded up. */
    float into[2][3][3], size[2][3][3];
    float doubt;      /* what posing and these numbers are off, in the unit */
    float slab_share; /* of the sizes of nodes, for what slabs lose */
    float sine_room;  /* added to the squared sine of two slabs' axes */
    bool slabs;       /* they may be asked */
    bool apart;       /* the boxes around all faces have no common point */
} ebpo_accel_pair;

/* reach: at least every posed coordinate of both models. The posings must live as long. */
void ebpo_accel_pair_make(ebpo_accel_pair *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing *const posing[2], double reach);

/* Going down the hierarchies of two accels together to the pairs of faces that meet, with a stack
 * of its own. One thread each. */

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

/* `walk` is zero or has been used before: its memory stays. The pair must outlive what follows. */
void ebpo_pair_walk_begin(ebpo_pair_walk *walk, const ebpo_accel_pair *pair);
void ebpo_pair_walk_free(ebpo_pair_walk *walk);

/* For kernels: decides what the filter has left of two blocks. False: no memory. */
bool ebpo_pair_walk_decide(ebpo_pair_walk *walk, uint32_t block_a, uint32_t block_b,
                           const ebpo_block_pairs *pairs);
/* For kernels: room for more of the stack. */
bool ebpo_pair_walk_room(ebpo_pair_walk *walk, uint64_t more);

/* A face's posed coordinates. */
void ebpo_posed_triangle(const ebpo_accel *accel, const ebpo_posing *posing, uint32_t slot,
                         double out[3][3]);

#endif
