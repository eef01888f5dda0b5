/* Models and contexts: their members, and what all queries share. */
#ifndef EBPO_QUERY_QUERY_MODEL_H
#define EBPO_QUERY_QUERY_MODEL_H

#include <pthread.h>
#include <stdatomic.h>

#include <ebpo/query.h>

#include "core/cache.h"
#include "format/reader.h"
#include "format/slice.h"
#include "geometry/cells.h"
#include "geometry/polytope.h"
#include "geometry/level_nodes.h"
#include "query/accel.h"
#include "query/model_parts.h"
#include "query/query_kernels.h"

struct ebpo_model {
    const ebpo_file *file;
    const ebpo_info *info;
    ebpo_locator locator; /* of the deepest level's cells */
    ebpo_model_options options;
    uint64_t shared_taken, shared_skeletons; /* of a budget that is shared: for good */
    bool default_memory; /* nobody asked for a budget, but the file is far away */
    ebpo_query_kernels kernels;
    ebpo_accel *whole;   /* everything, or NULL: */
    bool answers_inside; /* of a solid and with the mesh, whole */
    ebpo_top *top;       /* levels 0 .. cut level */
    ebpo_chunks *chunks;
    ebpo_cache *cache;         /* subtrees by their number in the top */
    ebpo_skeletons *skeletons; /* of those that have been loaded; or NULL */
    _Atomic(ebpo_top *) deep;  /* levels below the cut: nearest_subtrees.c; or NULL */
    atomic_bool deep_begun;
    _Atomic uint64_t new_loads; /* that may have been for nothing, until then */
    double open_seconds;
    /* in the subtrees that are in memory; kinds of those that were asked about */
    _Atomic uint64_t leaves, leaves_of_kind[5], leaves_one_wall;
    _Atomic uint64_t distances, distance_subtrees, distance_loads; /* as in ebpo_model_stats */
};

/* Adds a subtree's leaves to what is in memory, or (sign -1) takes them away; a leaf whose kind has
 * been found out. */
void ebpo_model_count_leaves(ebpo_model *model, const ebpo_accel *subtree, int sign);
void ebpo_model_count_kind(ebpo_model *model, const ebpo_accel_leaf *leaf);

typedef struct ebpo_ranked ebpo_ranked; /* query/query_node.h */
typedef struct ebpo_met ebpo_met;       /* rays.c */
typedef struct ebpo_kept_envelopes ebpo_kept_envelopes;

struct ebpo_context {
    ebpo_model *model;
    ebpo_accel *pinned; /* the subtree last used, when it came from the cache */
    uint64_t pinned_key;
    bool planes;    /* the question needs envelopes below the cut level */
    uint32_t *open; /* slots that a filter left open */
    uint64_t open_capacity;
    ebpo_ray_hit *hits;
    uint64_t hit_capacity;
    uint64_t *hit_begin; /* of many rays */
    uint64_t hit_begin_capacity;
    ebpo_met *met; /* of one ray, before they are sorted */
    uint64_t met_capacity;
    uint64_t *faces;
    uint64_t face_capacity;
    ebpo_ranked *queue; /* of nodes to be searched: nearest_subtrees.c */
    uint64_t queue_count, queue_capacity;
    uint32_t *seen; /* of subtrees, and the number of the question: nearest_subtrees.c */
    uint32_t question;
    uint64_t searched, loaded; /* subtrees, by distances; that were not there, by all questions */
    ebpo_kept_envelopes *envelopes; /* of distances to them; or NULL */
    ebpo_polytope *cutting;         /* [2] too large for a small stack; NULL before it is needed */
    bool has_prefetched;            /* from here, by a query that reached so far */
    double prefetched_from[3], prefetched_reach;
    /* The last nearest face: where ebpo_distance begins, if asked to. */
    bool warm;
    double warm_triangle[3][3];
    uint64_t warm_face,
        warm_source_face; /* its number in the file, and the one that callers are told */
    /* it is there in the whole model, and the node above; or EBPO_NO_BLOCK */
    uint32_t warm_block, warm_node;
};

static inline ebpo_box ebpo_model_box(const ebpo_model *m) { return ebpo_root_box(m->info); }

/* EBPO_E_ARGUMENT for a point that is not finite; `number` is for the message. */
EBPO_MUST_USE ebpo_status ebpo_check_points(const double *points, uint64_t count,
                                            ebpo_error *error);

/* EBPO_E_ARGUMENT for a ray that is none, with its number. */
EBPO_MUST_USE ebpo_status ebpo_check_ray_rows(const ebpo_ray *rays, uint64_t count,
                                              ebpo_error *error);

/* EBPO_E_LIMIT when the budget does not hold the leaf alone, for one context;
 * EBPO_LOAD_NODES loads it past the cache. */
EBPO_MUST_USE ebpo_status ebpo_model_has_room(const ebpo_model *model, const ebpo_node *leaf,
                                              ebpo_error *error);

/* Subtrees are kept with the planes of their nodes, which few questions need and which take reads
 * of their own, or without. */
static inline uint64_t ebpo_subtree_key(uint64_t below, bool planes) { return below << 1 | planes; }

/* Of the file, what such a subtree takes. */
static inline uint32_t ebpo_subtree_needs(bool planes)
{
    return EBPO_NEEDS_ALWAYS | EBPO_NEEDS_MESH | EBPO_NEEDS_MAPS | EBPO_NEEDS_SOLID |
           (planes ? (uint32_t)EBPO_NEEDS_PLANES : 0);
}

static inline bool ebpo_context_has_pinned(const ebpo_context *c, uint64_t below)
{
    return c->pinned && c->pinned_key >> 1 == below && (c->pinned_key & 1 || !c->planes);
}

/* Under which key the question finds it: one that is there with planes does for all. */
static inline uint64_t ebpo_context_key(const ebpo_context *c, uint64_t below)
{
    uint64_t full = ebpo_subtree_key(below, true);
    return c->planes || ebpo_cache_has(c->model->cache, full) ? full
                                                              : ebpo_subtree_key(below, false);
}

/* The subtree with this number, in memory until the context asks for another one, or lets go of it.
 */
EBPO_MUST_USE ebpo_status ebpo_context_subtree(ebpo_context *context, uint32_t below,
                                               ebpo_accel **out, ebpo_error *error);
/* Others may have its room; NULL is fine. */
void ebpo_context_let_go(ebpo_context *context);

/* Envelopes that a context has cut, kept for its next questions: cutting one takes ten times what
 * looking for its nearest point does. One thread. */

/* The envelope of the node with this cell, if it is there. */
bool ebpo_kept_envelopes_get(const ebpo_kept_envelopes *kept, ebpo_cell cell, ebpo_polytope *out);
/* Keeps it, in the place of another. *kept begins as NULL; without memory nothing is kept. */
void ebpo_kept_envelopes_put(ebpo_kept_envelopes **kept, ebpo_cell cell,
                             const ebpo_polytope *envelope);

/* --- checks that all queries begin with --- */

EBPO_MUST_USE ebpo_status ebpo_check_query_level(int level, ebpo_error *error);
/* EBPO_E_ARGUMENT: an option is none of its kind. */
ebpo_status ebpo_fail_value(ebpo_error *error);
/* EBPO_E_ABSENT when the file has no mesh. */
EBPO_MUST_USE ebpo_status ebpo_check_mesh(const ebpo_model *model, ebpo_error *error);
/* EBPO_E_NOT_SOLID for a surface. */
EBPO_MUST_USE ebpo_status ebpo_check_solid(const ebpo_model *model, ebpo_error *error);

/* Makes an answer's distance negative inside: solids, unless unsigned. */
EBPO_MUST_USE ebpo_status ebpo_give_sign(ebpo_context *context, const double p[3],
                                         const ebpo_distance_options *options,
                                         ebpo_distance_result *out, ebpo_error *error);

#endif
