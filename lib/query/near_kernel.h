/* A search for the nearest face of one accel, as the kernels see it. */
#ifndef EBPO_QUERY_NEAR_KERNEL_H
#define EBPO_QUERY_NEAR_KERNEL_H

#include "query/visits.h"

/* A point as the kernels want it. */
typedef struct ebpo_probe {
    double p[3];
    float high[3], low[3]; /* p = high + low up to 2^-48 of |p| (blocks of floats) */
    float local[3];        /* in the subtree's frame */
    float scale;           /* of the frame */
    double scale64;
    /* bound on what it does to a distance that `local` is rounded, in the frame */
    float error;
} ebpo_probe;

/* Faces that may be nearest wait until the end: by then nearly all are known to be farther. */
typedef struct ebpo_near_candidate {
    float low;
    uint32_t slot, node; /* that has its block as a child */
} ebpo_near_candidate;
enum { EBPO_NEAR_CANDIDATES = 64 };
#define EBPO_NO_BLOCK UINT32_MAX

typedef struct ebpo_near_search ebpo_near_search;
struct ebpo_near_search {
    const ebpo_accel *s;
    ebpo_probe probe;
    void *user;
    void (*judge)(ebpo_near_search *search); /* decides about all that waits */
    bool (*late)(ebpo_near_search *search);  /* NULL: there is time */
    /* looked at before all others, and the node above it; EBPO_NO_BLOCK: none */
    uint32_t first_block, first_node;
    float best;   /* some face is certainly not farther, or what is does not matter: in the frame */
    float limit2; /* what squared lower bounds are compared with */
    int count;
    ebpo_near_candidate waiting[EBPO_NEAR_CANDIDATES];
    uint32_t top; /* visits that were left when it was late */
    ebpo_visit stack[EBPO_VISITS_MOST];
    uint32_t from[EBPO_VISITS_MOST]; /* the nodes that have the stack's visits as children */
};

/* What underflow of squares does to a distance is far less: sqrt(2^-149) and some. */
#define EBPO_NEAR_UNDERFLOW 0x1p-56f

static inline void ebpo_near_set_best(ebpo_near_search *g, float best)
{
    float limit = best * (1 + 0x1p-18f) + g->probe.error + EBPO_NEAR_UNDERFLOW;
    g->best = best;
    g->limit2 = limit * limit;
}

static inline void ebpo_near_drop_far(ebpo_near_search *g)
{
    int kept = 0;
    for (int i = 0; i < g->count; i++)
        if (g->waiting[i].low <= g->best)
            g->waiting[kept++] = g->waiting[i];
    g->count = kept;
}

#endif
