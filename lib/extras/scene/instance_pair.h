/* Two instances of a scene at a time: boxes in each other's coordinates, relative motion,
 * distance, and what their files omit. Bounds hold for posed coordinates. */
#ifndef EBPO_SCENE_INSTANCE_PAIR_H
#define EBPO_SCENE_INSTANCE_PAIR_H

#include <ebpo/collide.h>

#include "extras/scene/scene_parts.h"

typedef struct ebpo_scene_space {
    double min[3], max[3];
} ebpo_scene_space;

/* One instance in another's coordinates. */
typedef struct ebpo_scene_seen {
    ebpo_scene_space box;
    double rounding; /* how far the box was widened for it */
    double unit;     /* how long one of these coordinates is in the world, at least */
} ebpo_scene_seen;

/* A box in the coordinates of the instance `of` that holds the box of `other` at a time.
 * EBPO_E_ARGUMENT: a pose. */
EBPO_MUST_USE ebpo_status ebpo_scene_seen_from(const ebpo_scene *scene, uint64_t of, uint64_t other,
                                               double time, ebpo_scene_seen *out,
                                               ebpo_error *error);

/* The distance of two boxes, rounded down. */
double ebpo_scene_space_gap(const ebpo_scene_space *a, const ebpo_scene_space *b);

/* Of a pair at a time: no two faces of which one has been left out of its model's file are nearer
 * than this; INFINITY: nothing has been left out. *lacking: an instance whose file lacks some. */
EBPO_MUST_USE ebpo_status ebpo_scene_left_out(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                              double time, double *gap, uint64_t *lacking,
                                              ebpo_error *error);

/* EBPO_E_ABSENT: what this instance's file lacks may come nearer than the question allows; or be
 * around the other one, where solids are asked about. */
ebpo_status ebpo_scene_lacks(const ebpo_scene *scene, const ebpo_scene_pair *pair, uint64_t lacking,
                             double time, bool solids, ebpo_error *error);

/* How far two instances go, seen from each other. */

/* The next time at which a route of theirs has a key; `to` if that comes first. */
double ebpo_scene_pair_next(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from,
                            double to);

/* Pairs of instances that are asked about one after the other, by any thread. */

typedef struct ebpo_scene_pairs_list {
    ebpo_scene_pair *pairs; /* malloc's */
    uint64_t count;
} ebpo_scene_pairs_list;

/* Those of ebpo_scene_pairs. On failure there is nothing to free. */
EBPO_MUST_USE ebpo_status ebpo_scene_keep_pairs(const ebpo_scene *scene, double from, double to,
                                                ebpo_scene_pairs_list *out, ebpo_error *error);
/* Finds a result for one pair; how: the search's. */
typedef ebpo_status (*ebpo_scene_find_fn)(const void *how, const ebpo_scene_pair *pair,
                                          void *result, ebpo_error *error);

/* A search in each pair by itself. */
typedef struct ebpo_scene_search {
    ebpo_scene_find_fn find;
    const void *how;
    size_t result_size;
    uint64_t grain; /* pairs of a piece of work */
    unsigned threads;
    const ebpo_progress *progress;
    const char *stage;
} ebpo_scene_search;

/* Lists the pairs, makes their models, and finds the result of each on all cores. *results,
 * in the order of pairs, are to be freed, also on failure; *count is 0 where there is no list. */
EBPO_MUST_USE ebpo_status ebpo_scene_find_in_pairs(ebpo_scene *scene, double from, double to,
                                                   const ebpo_scene_search *search, void **results,
                                                   uint64_t *count, ebpo_error *error);

/* One after the other: questions then share them. */
EBPO_MUST_USE ebpo_status ebpo_scene_make_models(ebpo_scene *scene, const ebpo_scene_pair *pairs,
                                                 uint64_t count, ebpo_error *error);
/* For one of these pairs. NULL: a file has no mesh; then ebpo_scene_left_out counts all
 * of it. */
EBPO_MUST_USE ebpo_status ebpo_scene_collider(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                              unsigned threads, ebpo_collider **out,
                                              ebpo_error *error);
/* Where both are at a time. */
EBPO_MUST_USE ebpo_status ebpo_scene_pose_pair(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                               double time, ebpo_collide_options *out,
                                               ebpo_error *error);

/* A pair of instances at one time after the other: how far apart, and how far they go. */

typedef struct ebpo_scene_looks {
    const ebpo_scene *scene;
    const ebpo_scene_pair *pair;
    ebpo_collider *collider; /* of ebpo_scene_collider; to be freed */
    double tolerance;        /* of a look */
    bool rides;              /* both follow one route */
    double gap;              /* at the last one, as ebpo_scene_left_out tells it, */
    uint64_t lacking;        /* and of which */
} ebpo_scene_looks;

/* `tolerance`: of what is asked for; looks take a quarter of it, or what rounding leaves. Free the
 * collider, also on failure. */
EBPO_MUST_USE ebpo_status ebpo_scene_looks_begin(ebpo_scene_looks *looks, const ebpo_scene *scene,
                                                 const ebpo_scene_pair *pair, double tolerance,
                                                 ebpo_error *error);

/* How far the pair moves, as pair_motion finds it. */
EBPO_MUST_USE ebpo_status ebpo_scene_looks_motion(const ebpo_scene_looks *looks, double from,
                                                  double to, double *out, ebpo_error *error);

/* Bounds of the distance of their faces at a time, of those that were left out too. */
EBPO_MUST_USE ebpo_status ebpo_scene_look(ebpo_scene_looks *looks, double time, double *lo,
                                          double *hi, ebpo_error *error);

/* Whether `hi` is no more than the tolerance above `lo`, in real numbers. */
bool ebpo_scene_is_within(double hi, double lo, double tolerance);

/* With the usual number of looks. EBPO_E_ARGUMENT: the tolerance is not above 0. */
EBPO_MUST_USE ebpo_status ebpo_scene_take_way_options(ebpo_scene_way_options *own,
                                                      const ebpo_scene_way_options *options,
                                                      ebpo_error *error);

#endif
