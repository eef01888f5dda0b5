/* Children that a search has still to visit, on a stack: the nearest one on top. */
#ifndef EBPO_QUERY_VISITS_H
#define EBPO_QUERY_VISITS_H

#include <stdint.h>
#include <string.h>

#include "query/accel.h"

/* The bits of a key that is not negative (so of the same order as integers), then the child's
 * number. */
typedef uint64_t ebpo_visit;

/* An octree level adds at most one level to the hierarchy, a long list of one leaf eleven. */
enum { EBPO_VISITS_MOST = 64 * 8 };

static inline ebpo_visit ebpo_visit_make(float key, uint32_t child)
{
    uint32_t bits;
    memcpy(&bits, &key, sizeof bits);
    return (uint64_t)bits << 32 | child;
}

static inline float ebpo_visit_key(ebpo_visit v)
{
    uint32_t bits = (uint32_t)(v >> 32);
    float key;
    memcpy(&key, &bits, sizeof key);
    return key;
}

/* The first cache lines of what will be read. */
static inline void ebpo_visit_fetch(const ebpo_accel *s, uint32_t child)
{
    const char *at = (const char *)&s->bound[child & ~EBPO_IS_BLOCK];
    unsigned lines = 2;
    if (child & EBPO_IS_BLOCK) {
        at = (const char *)ebpo_accel_meshlet(s, child & ~EBPO_IS_BLOCK);
        lines = s->wide ? 4 : 2;
    }
    for (unsigned i = 0; i < lines; i++)
        __builtin_prefetch(at + 64 * i);
}

static inline void ebpo_visit_fetch_slab(const ebpo_accel *s, uint32_t node)
{
    const char *at = (const char *)&s->slab[node];
    __builtin_prefetch(at);
    __builtin_prefetch(at + 64);
}

/* Pushes the children of `lanes`, farthest first; returns the new top. */
static inline uint32_t ebpo_visit_push(ebpo_visit *stack, uint32_t top, const ebpo_bound *bound,
                                       unsigned lanes, const float key[8])
{
    uint32_t base = top;
    for (; lanes; lanes &= lanes - 1) {
        unsigned lane = (unsigned)__builtin_ctz(lanes);
        ebpo_visit v = ebpo_visit_make(key[lane], bound->child[lane]);
        uint32_t at = top++;
        for (; at > base && stack[at - 1] < v; at--)
            stack[at] = stack[at - 1];
        stack[at] = v;
    }
    return top;
}

#endif
