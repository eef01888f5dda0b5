/* Keeps disjoint sets of items (union-find) in one array. parent[i] is an item of the set of item
 * i. The root of a set is its lowest item. For the root, parent[i] is i. */
#ifndef EBPO_CORE_DISJOINT_SETS_H
#define EBPO_CORE_DISJOINT_SETS_H

#include <stdint.h>

/* Returns the root of the set of an item. Halves the path to the root, so that later calls are
 * fast.
 */
static inline uint32_t ebpo_set_root(uint32_t *parent, uint32_t item)
{
    while (parent[item] != item)
        item = parent[item] = parent[parent[item]];
    return item;
}

/* Joins the sets of two items. */
static inline void ebpo_set_join(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = ebpo_set_root(parent, a);
    b = ebpo_set_root(parent, b);
    parent[a < b ? b : a] = a < b ? a : b;
}

#endif
