/* Declares a collider (two models, options, and data that a query keeps for the next query), and
 * functions that all queries of a collider use. Every query begins with ebpo_collision_begin. */
#ifndef EBPO_COLLIDE_COLLIDER_H
#define EBPO_COLLIDE_COLLIDER_H

#include <math.h>

#include <ebpo/collide.h>

#include "extras/collide/hierarchy_walk.h"
#include "query/query_model.h"

/* Makes a collider as ebpo_collider_new does, but accepts subsets of models; results then consider
 * only the faces in the files. */
EBPO_MUST_USE ebpo_status ebpo_collider_of_parts(ebpo_model *a, ebpo_model *b,
                                                 const ebpo_collider_options *options,
                                                 ebpo_collider **out, ebpo_error *error);

struct ebpo_collider {
    ebpo_model *model[2]; /* in the caller's order */
    ebpo_collider_options options;
    ebpo_pair_walk walk;   /* walk of the calling thread */
    ebpo_pair_walk *walks; /* [walk_count] walks of other threads, kept for the next query that
                            * finds all pairs; or NULL */
    unsigned walk_count;
    uint64_t node_pairs, block_pairs, exact; /* as in ebpo_collider_stats */
    uint64_t subtree_pairs, subtrees, loads,
        bytes_read; /* as in ebpo_collider_stats; only for partly loaded models */
    bool backward;  /* the next query for all pairs of partly loaded models visits the pairs of
                     * subtrees in the reverse order, because the last subtrees of the previous query
                     * are still in memory */
    struct ebpo_gap_search *gap;   /* state of distance queries; NULL before the first query */
    struct ebpo_face_two *nearest; /* nearest pair of the last distance query, in the caller's
                                    * order of the models; NULL: no query has found a pair */
    ebpo_context *context[2];      /* contexts of depth queries; NULL before the first query */
    uint32_t *slots[2]; /* results of ebpo_face_slots for models that are entirely in memory; NULL
                           before the first query that needs the array */
};

/* A query with checked options. Its models are in the query's order, which stays the same when the
 * caller swaps the models. */
typedef struct ebpo_collision {
    ebpo_collider *collider;
    ebpo_collide_options options; /* pose_a and pose_b are poses of the caller's A and B */
    bool swapped;                 /* model[0] is the caller's B */
    ebpo_model *model[2];         /* in the query's order */
    ebpo_block_posing posing[2];  /* in the query's order */
    double max_coordinate;        /* upper bound of the absolute values of all posed coordinates */
    uint64_t deadline;            /* deadline, a time of ebpo_clock; UINT64_MAX: none */
} ebpo_collision;

/* Checks the options and prepares a query. Fails with EBPO_E_ARGUMENT (options, poses). */
EBPO_MUST_USE ebpo_status ebpo_collision_begin(ebpo_collision *out, ebpo_collider *collider,
                                               const ebpo_collide_options *options,
                                               ebpo_error *error);

/* Returns true if the deadline has passed. */
bool ebpo_collision_is_late(const ebpo_collision *collision);

/* Finds a contact of two hierarchies of the query's models. Sets *found as ebpo_collide_first does.
 * If *found is 1, the contact is in found_pairs[0] and found_slot of the collider's walk. stage:
 * the text that the progress function receives. */
EBPO_MUST_USE ebpo_status ebpo_collision_first(const ebpo_collision *collision,
                                               const ebpo_accel *const accel[2], const char *stage,
                                               int32_t *found, ebpo_error *error);

/* Returns the number of bytes that have been read from both files. */
uint64_t ebpo_collision_bytes_read(const ebpo_collision *collision);

/* Returns true if a model is not entirely in memory. */
bool ebpo_collision_is_in_parts(const ebpo_collision *collision);

/* Begins a walk. `walk` is zero, or has been used before, and then its memory is used again. `pair`
 * must exist as long as the walk is used. */
void ebpo_pair_walk_begin(ebpo_pair_walk *walk, const ebpo_accel_pair *pair);

/* Adds a walk's counts to the collider's counts, and sets the walk's counts to 0. */
void ebpo_collider_count(ebpo_collider *collider, ebpo_pair_walk *walk);

/* Converts a pair of local face indices of two accels (acceleration structures of subtrees) to the
 * pair that the caller receives, without the indices in the sources. */
ebpo_face_pair ebpo_collision_pair(const ebpo_collision *collision, const ebpo_accel *first,
                                   const ebpo_accel *second, const ebpo_found_pair *pair);
/* Sets the indices of the faces in the sources, by the indices in the files. */
EBPO_MUST_USE ebpo_status ebpo_collision_find_sources(const ebpo_collision *collision,
                                                      ebpo_face_pair *pairs, uint64_t count,
                                                      ebpo_error *error);

/* Finds the same pairs as ebpo_collide_self, but for the model at a pose: pose_a and pose_b of the
 * options, which must be equal. */
EBPO_MUST_USE ebpo_status ebpo_collide_self_posed(ebpo_collider *collider,
                                                  const ebpo_collide_options *options,
                                                  ebpo_pairs_fn take, void *user,
                                                  ebpo_error *error);

/* Returns lo and hi with their kind: exact if lo = hi, a bound if lo is 0 or hi is infinite,
 * otherwise an interval. */
static inline ebpo_value_bounds ebpo_value_bounds_of(double lo, double hi)
{
    bool bound = lo != hi && (lo == 0 || isinf(hi));
    return (ebpo_value_bounds){ lo, hi,
                                lo == hi ? EBPO_VALUE_EXACT
                                : bound  ? EBPO_VALUE_BOUND
                                         : EBPO_VALUE_INTERVAL,
                                0 };
}

/* Number of pairs of nodes that a walk visits between checks of the clock. */
enum { EBPO_WALK_PAIRS = 1024 };

#endif
