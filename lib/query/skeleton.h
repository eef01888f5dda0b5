/* What is kept in memory of each subtree that has ever been loaded: the upper nodes of its
 * hierarchy over faces (query/accel.h), eight at first, 2 KB where the subtree takes hundreds. They
 * bound the distance to its faces much better than its cell and its envelope do, so that searches
 * load it again only if it may matter. Made when it is loaded, kept when the cache drops it: works
 * for every file, and costs no reading. Whenever a search has loaded it for nothing, nodes are
 * added where it was looked for: memory goes where bounds are too loose.
 *
 * Lower bounds only. Subtrees are searched in the order of certain lower bounds until the next is
 * beyond what has been found (nearest_first.c): those searched are the ones whose bound is at most
 * the answer. No upper bound could save one of them. */
#ifndef EBPO_QUERY_SKELETON_H
#define EBPO_QUERY_SKELETON_H

#include "query/accel.h"
#include "core/cache.h"
#include "query/far_point.h"

/* Any thread; one at a time where it is not const. */
typedef struct ebpo_skeleton ebpo_skeleton;

/* Certain lower bounds of the distance to a subtree's faces, in the model's unit: to its own, which
 * no other subtree has as its own, and to its outer ones. INFINITY: it has none. */
typedef struct ebpo_skeleton_bounds {
    double own, outer;
} ebpo_skeleton_bounds;

/* With at most `nodes` nodes, 1 to 8. NULL: the subtree has no faces, or is of a size that doubles
 * do not square; no memory. */
ebpo_skeleton *ebpo_skeleton_make(const ebpo_accel *subtree, unsigned nodes);
void ebpo_skeleton_free(ebpo_skeleton *skeleton);
/* At most, of memory. */
uint64_t ebpo_skeleton_bytes(unsigned nodes);

/* What is beyond `limit` may be INFINITY, too. */
ebpo_skeleton_bounds ebpo_skeleton_lower_bounds(const ebpo_skeleton *skeleton, const double p[3],
                                                double limit);
/* The same of keys, for a far point. */
ebpo_skeleton_bounds ebpo_skeleton_far_bounds(const ebpo_skeleton *skeleton, const ebpo_far *far,
                                              double limit);

/* As many as there may be after growing. */
enum { EBPO_SKELETON_NODES = 64 };
/* Adds up to eight nodes of the same subtree, those that are nearest to p as far as is known, while
 * that is within `limit`. `take` says whether there is room for more. */
void ebpo_skeleton_grow(ebpo_skeleton *skeleton, const ebpo_accel *subtree, const double p[3],
                        double limit, bool (*take)(void *user, uint64_t bytes), void *user);

/* Boxes, in the model's unit, around the outer faces that may be within `limit` of p; returns how
 * many. Each outer face is another subtree's own, whose cell it meets. */
typedef struct ebpo_outer_box {
    double low[3], high[3];
} ebpo_outer_box;
enum { EBPO_OUTER_BOXES = 64 };
unsigned ebpo_skeleton_outer_boxes(const ebpo_skeleton *skeleton, const double p[3], double limit,
                                   ebpo_outer_box out[EBPO_OUTER_BOXES]);

/* Those of a model's subtrees, by their numbers. Any thread. */
typedef struct ebpo_skeletons ebpo_skeletons;

/* `room`: bytes that they may take at most, all in all, see ebpo_skeletons_room. Of a cache's
 * budget, as they come to be needed, or NULL. NULL without memory. */
ebpo_skeletons *ebpo_skeletons_make(uint64_t count, uint64_t room, ebpo_cache *cache);
/* After all others have done with it; NULL is fine. */
void ebpo_skeletons_free(ebpo_skeletons *all);
/* The part of `room` that `count` skeletons can make use of. */
uint64_t ebpo_skeletons_room(uint64_t count, uint64_t room);
/* Of their room, for what tells of subtrees beside them; false: there is not enough left. And back,
 * what has been taken so. Any thread. */
bool ebpo_skeletons_take(ebpo_skeletons *all, uint64_t bytes);
void ebpo_skeletons_give_back(ebpo_skeletons *all, uint64_t bytes);
/* Of memory, now. */
uint64_t ebpo_skeletons_bytes(const ebpo_skeletons *all);

/* Keeps that of a subtree, unless it is there or there is no room. */
void ebpo_skeletons_keep(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree);
/* Adds to what is kept of it, as ebpo_skeleton_grow does. */
void ebpo_skeletons_grow(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree,
                         const double p[3], double limit);
/* NULL where nothing is known. */
const ebpo_skeleton *ebpo_skeletons_find(const ebpo_skeletons *all, uint64_t number);

#endif
