/* Declares the members of models and contexts, and functions that all queries share. A model that
 * is not completely in memory has the top of its tree (levels 0 to the cut level) in memory, and
 * loads the subtrees below the cut level on demand. */
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
#include "query/holes.h"
#include "query/model_parts.h"
#include "query/query_kernels.h"

struct ebpo_model {
    const ebpo_file *file;
    const ebpo_info *info;
    ebpo_locator locator; /* finds cells of the deepest level */
    ebpo_model_options options;
    /* bytes taken from a shared budget: by the whole model or its top, and by its skeletons */
    uint64_t shared_taken, shared_skeletons;
    bool default_memory; /* no budget was given, and the file is remote */
    ebpo_query_kernels kernels;
    ebpo_accel *whole;   /* the whole model in memory; NULL: the model is loaded in parts */
    bool results_inside; /* true: the whole model is in memory with its mesh, and has an inside */
    ebpo_holes *holes;   /* for a surface with its border (the edges of its holes); or NULL */
    /* If the model is loaded in parts: */
    ebpo_top *top;             /* levels 0 .. cut level */
    ebpo_chunks *chunks;       /* decoded chunks */
    ebpo_cache *cache;         /* loaded subtrees, by ebpo_subtree_key */
    ebpo_skeletons *skeletons; /* skeletons (upper nodes of the hierarchies over faces) of subtrees
                                * that were loaded at least once; or NULL */
    _Atomic(ebpo_top *) deep;  /* deep bounds (nearest.h), or NULL */
    /* number of running queries that read source indices of faces for their results only */
    _Atomic unsigned without_maps;
    atomic_bool deep_begun;     /* a thread has begun to read deep bounds */
    _Atomic uint64_t new_loads; /* number of loaded subtrees that had no skeleton before; counted
                                 * until `deep` is set */
    double open_seconds;        /* time that opening the model took */
    /* number of leaves in memory; of them, number of leaves of each kind, if the kind is known; and
     * number of general leaves with a free cell face */
    _Atomic uint64_t leaves, leaves_of_kind[5], leaves_one_cell_face;
    _Atomic uint64_t distances, distance_subtrees, distance_loads; /* as in ebpo_model_stats */
};

/* Adds a subtree's leaves to the model's counts of leaves, or (sign -1) subtracts them.
 * ebpo_model_count_kind counts a leaf whose kind has been found. */
void ebpo_model_count_leaves(ebpo_model *model, const ebpo_accel *subtree, int sign);
void ebpo_model_count_kind(ebpo_model *model, const ebpo_accel_leaf *leaf);

typedef struct ebpo_ranked ebpo_ranked;       /* query/query_node.h */
typedef struct ebpo_ray_found ebpo_ray_found; /* rays.c */
typedef struct ebpo_kept_envelopes ebpo_kept_envelopes;

struct ebpo_context {
    ebpo_model *model;
    ebpo_accel *pinned;  /* the last used subtree, if it came from the cache; it stays in memory */
    uint64_t pinned_key; /* ebpo_subtree_key of `pinned` */
    ebpo_accel_content content; /* what the query needs of subtrees */
    /* for a surface with its border: results get the winding number of the closed mesh of surface
     * and caps, and are not decided by the threshold */
    bool undecided;
    uint32_t *open; /* slots of faces that a filter could not decide */
    uint64_t open_capacity;
    ebpo_ray_hit *hits; /* results of ray queries */
    uint64_t hit_capacity;
    uint64_t *hit_begin; /* [number of rays + 1] index in `hits` of each ray's first hit */
    uint64_t hit_begin_capacity;
    ebpo_ray_found *unsorted_hits; /* hits of one ray, before they are sorted */
    uint64_t found_capacity;
    uint64_t *faces; /* result of ebpo_faces_in_box */
    uint64_t face_capacity;
    ebpo_ranked *queue; /* nodes to be searched (nearest.h) */
    uint64_t queue_count, queue_capacity;
    uint32_t *marks;       /* [subtrees] state in the current query (nearest_subtrees.c) */
    uint32_t query_number; /* of the current query */
    /* numbers of subtrees that distance queries searched, and that all queries loaded */
    uint64_t searched, loaded;
    ebpo_top **envelopes_of; /* [subtrees] envelopes of the first levels of some subtrees, read for
                              * the current query; NULL before the first use (load_ahead.h) */
    unsigned envelope_count; /* number of these subtrees */
    ebpo_kept_envelopes *envelopes; /* envelopes for distances to them; or NULL */
    ebpo_polytope *cutting;         /* [2] temporary envelopes, which are too large for a small
                                     * stack; NULL before the first use */
    /* has_prefetched: some query has prefetched; the next two fields are the point and the search
     * distance of the last such query. */
    bool has_prefetched;
    double prefetched_from[3], prefetched_distance;
    /* The face that the last distance query found, from which the next ebpo_distance starts if its
     * options enable this. */
    bool warm; /* there is such a face */
    double warm_triangle[3][3];
    uint64_t warm_face; /* index of the face in the file */
    /* the face's block in the whole model, and the node above the block; or EBPO_NO_BLOCK */
    uint32_t warm_block, warm_node;
};

static inline ebpo_box ebpo_model_box(const ebpo_model *m) { return ebpo_root_box(m->info); }

/* Returns EBPO_E_ARGUMENT if a point is not finite; the message gives the point's index. */
EBPO_MUST_USE ebpo_status ebpo_check_points(const double *points, uint64_t count,
                                            ebpo_error *error);

/* Returns EBPO_E_ARGUMENT if one of the rays begin .. end - 1 is invalid; the message gives the
 * ray's index. */
EBPO_MUST_USE ebpo_status ebpo_check_ray_rows(const ebpo_ray *rays, uint64_t begin, uint64_t end,
                                              ebpo_error *error);

/* Returns EBPO_E_LIMIT if the budget is too small for this leaf in addition to the top and the
 * chunks. Used for EBPO_LOAD_NODES, which loads one leaf at a time, without the cache. */
EBPO_MUST_USE ebpo_status ebpo_model_has_capacity(const ebpo_model *model, const ebpo_node *leaf,
                                                  ebpo_error *error);

/* Returns the cache key of the subtree top->below[below] with this content. (A subtree is loaded
 * with no more content than a query needs. Few queries need planes, which take separate reads. For
 * pairs of faces, nodes and leaves would take nearly half of the memory and a seventh of the time.)
 */
static inline uint64_t ebpo_subtree_key(uint64_t below, ebpo_accel_content content)
{
    return below << 2 | content;
}
static inline uint32_t ebpo_subtree_of_key(uint64_t key) { return (uint32_t)(key >> 2); }
static inline ebpo_accel_content ebpo_content_of_key(uint64_t key)
{
    return (ebpo_accel_content)(key & 3);
}

/* Returns the data of the file (EBPO_NEEDS_...) that a subtree with this content needs. */
static inline uint32_t ebpo_subtree_needs(ebpo_accel_content content)
{
    return EBPO_NEEDS_ALWAYS | EBPO_NEEDS_MESH |
           (content >= EBPO_ACCEL_NODES ? (uint32_t)EBPO_NEEDS_SOLID_OR_BORDER : 0) |
           (content >= EBPO_ACCEL_PLANES ? (uint32_t)EBPO_NEEDS_PLANES : 0);
}

/* Reads a face's index in the source from the file, which has source indices. */
EBPO_MUST_USE ebpo_status ebpo_model_read_source_face(const ebpo_model *model, uint64_t file_face,
                                                      uint64_t *out, ebpo_error *error);
/* Gets a face's index in the source by its index in the file. If the file has no source indices,
 * this is the index in the file. Subtrees have no source indices: results have few of their faces,
 * so a tenth of the time of a load would be wasted. */
EBPO_MUST_USE static inline ebpo_status ebpo_model_source_face(const ebpo_model *m,
                                                               uint64_t file_face, uint64_t *out,
                                                               ebpo_error *error)
{
    if (!m->whole && m->info->parts & EBPO_PART_MAPS)
        return ebpo_model_read_source_face(m, file_face, out, error);
    *out = m->whole && m->whole->face_source ? m->whole->face_source[file_face] : file_face;
    return EBPO_OK;
}

/* Returns true if the context's pinned subtree is this one, with the content that the query needs.
 */
static inline bool ebpo_context_has_pinned(const ebpo_context *c, uint64_t below)
{
    return c->pinned && ebpo_subtree_of_key(c->pinned_key) == below &&
           ebpo_content_of_key(c->pinned_key) >= c->content;
}

/* Returns the subtree's cache key for the current query, which uses the subtree with more content
 * than it needs if the cache has that. */
static inline uint64_t ebpo_context_key(const ebpo_context *c, uint64_t below)
{
    uint64_t least = ebpo_subtree_key(below, c->content),
             key = ebpo_subtree_key(below, EBPO_ACCEL_PLANES);
    while (key > least && !ebpo_cache_has(c->model->cache, key))
        key--;
    return key;
}

/* Gets the subtree top->below[below], and pins it: the subtree stays in memory until the context
 * requests another subtree or releases this one. */
EBPO_MUST_USE ebpo_status ebpo_context_subtree(ebpo_context *context, uint32_t below,
                                               ebpo_accel **out, ebpo_error *error);
/* Releases the pinned subtree, so that other contexts may use its memory; NULL is allowed. */
void ebpo_context_let_go(ebpo_context *context);

/* Envelopes that a context has computed and keeps for its next queries, because computing an
 * envelope takes ten times as long as finding its nearest point. For one thread. */

/* Finds the envelope of the node with this cell. Returns false if the envelope is not kept. */
bool ebpo_kept_envelopes_get(const ebpo_kept_envelopes *kept, ebpo_cell cell, ebpo_polytope *out);
/* Keeps an envelope, which may replace another kept envelope. *kept is NULL before the first call.
 * When out of memory, nothing is kept. */
void ebpo_kept_envelopes_put(ebpo_kept_envelopes **kept, ebpo_cell cell,
                             const ebpo_polytope *envelope);

/* --- common checks of all queries --- */

/* Returns EBPO_E_ARGUMENT if the level is neither -1 nor from 0 to the deepest level of the format.
 */
EBPO_MUST_USE ebpo_status ebpo_check_query_level(int level, ebpo_error *error);
/* Returns EBPO_E_ARGUMENT with a message: an option has an invalid enum value. */
ebpo_status ebpo_fail_value(ebpo_error *error);
/* Returns EBPO_E_ABSENT when the file has no mesh. */
EBPO_MUST_USE ebpo_status ebpo_check_mesh(const ebpo_model *model, ebpo_error *error);
/* Returns EBPO_E_NOT_SOLID for a surface. */
EBPO_MUST_USE ebpo_status ebpo_check_solid(const ebpo_model *model, ebpo_error *error);

/* Makes the distance of a result negative inside a solid, unless the options request no sign. */
EBPO_MUST_USE ebpo_status ebpo_give_sign(ebpo_context *context, const double p[3],
                                         const ebpo_distance_options *options,
                                         ebpo_distance_result *out, ebpo_error *error);

#endif
