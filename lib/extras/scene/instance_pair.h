/* Two instances of a scene at a time: boxes in each other's coordinates, relative motion, distance,
 * and the parts that their files omit. Bounds hold for posed coordinates. */
#ifndef EBPO_SCENE_INSTANCE_PAIR_H
#define EBPO_SCENE_INSTANCE_PAIR_H

#include <ebpo/collide.h>

#include "extras/scene/scene_parts.h"

typedef struct ebpo_scene_space {
    double min[3], max[3];
} ebpo_scene_space;

/* One instance in another's coordinates. */
typedef struct ebpo_scene_relative {
    ebpo_scene_space box;
    double rounding; /* widening of the box for rounding */
    double unit;     /* least length in the world of a length of 1 in these coordinates */
} ebpo_scene_relative;

/* Returns a box in the coordinates of the instance `of` that contains the box of `other` at a time.
 * Fails with EBPO_E_ARGUMENT if a pose is out of range. */
EBPO_MUST_USE ebpo_status ebpo_scene_relative_to(const ebpo_scene *scene, uint64_t of,
                                                 uint64_t other, double time,
                                                 ebpo_scene_relative *out, ebpo_error *error);

/* Returns the distance of two boxes, rounded down. */
double ebpo_scene_space_gap(const ebpo_scene_space *a, const ebpo_scene_space *b);

/* Bounds the distance of omitted faces of a pair at a time. If one of two faces is omitted from its
 * model's file, the faces are not nearer than *gap; INFINITY: nothing is omitted. *lacking: an
 * instance whose file omits faces. */
EBPO_MUST_USE ebpo_status ebpo_scene_omitted(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                             double time, double *gap, uint64_t *lacking,
                                             ebpo_error *error);

/* Returns EBPO_E_ABSENT with a message: an omitted part of this instance's file may be nearer than
 * the query allows; or, with `solids`, may be around the other instance. */
ebpo_status ebpo_scene_lacks(const ebpo_scene *scene, const ebpo_scene_pair *pair, uint64_t lacking,
                             double time, bool solids, ebpo_error *error);

/* Relative motion of two instances. */

/* Returns the next time at which a route of the pair has a key; `to` if that comes first. */
double ebpo_scene_pair_next(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from,
                            double to);

/* Pairs of instances, each evaluated by any thread. */

typedef struct ebpo_scene_pairs_list {
    ebpo_scene_pair *pairs; /* from malloc */
    uint64_t count;
} ebpo_scene_pairs_list;

/* Lists the pairs of ebpo_scene_pairs. On failure there is nothing to free. */
EBPO_MUST_USE ebpo_status ebpo_scene_keep_pairs(const ebpo_scene *scene, double from, double to,
                                                ebpo_scene_pairs_list *out, ebpo_error *error);
/* Finds a result for one pair. how: data of the search. */
typedef ebpo_status (*ebpo_scene_find_fn)(const void *how, const ebpo_scene_pair *pair,
                                          void *result, ebpo_error *error);

/* A search in each pair separately. */
typedef struct ebpo_scene_search {
    ebpo_scene_find_fn find;
    const void *how;
    size_t result_size;
    uint64_t grain; /* number of pairs in a piece of work */
    unsigned threads;
    const ebpo_progress *progress;
    const char *stage;
} ebpo_scene_search;

/* Lists the pairs, makes their models, and finds the result of each pair on all cores. *results has
 * the order of the pairs; free it, also on failure. *count is 0 without a list. */
EBPO_MUST_USE ebpo_status ebpo_scene_find_in_pairs(ebpo_scene *scene, double from, double to,
                                                   const ebpo_scene_search *search, void **results,
                                                   uint64_t *count, ebpo_error *error);

/* Makes models in sequence; queries then share them. */
EBPO_MUST_USE ebpo_status ebpo_scene_make_models(ebpo_scene *scene, const ebpo_scene_pair *pairs,
                                                 uint64_t count, ebpo_error *error);
/* Makes a collider for one of these pairs. NULL: a file has no mesh; then ebpo_scene_omitted treats
 * the whole file as omitted. */
EBPO_MUST_USE ebpo_status ebpo_scene_collider(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                              unsigned threads, ebpo_collider **out,
                                              ebpo_error *error);
/* Sets the poses of both instances at a time. */
EBPO_MUST_USE ebpo_status ebpo_scene_pose_pair(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                               double time, ebpo_collide_options *out,
                                               ebpo_error *error);

/* A pair of instances at a sequence of times: distance and motion. */

typedef struct ebpo_scene_evaluations {
    const ebpo_scene *scene;
    const ebpo_scene_pair *pair;
    ebpo_collider *collider; /* from ebpo_scene_collider; must be freed */
    double tolerance;        /* tolerance of one evaluation */
    bool same_route;         /* both follow one route */
    double gap;              /* result of ebpo_scene_omitted at the last evaluation */
    uint64_t lacking;        /* instance whose file omits faces, from the same call */
} ebpo_scene_evaluations;

/* Begins evaluations. `tolerance`: tolerance of the result; an evaluation uses a quarter of it, or
 * the limit of rounding. Free the collider, also on failure. */
EBPO_MUST_USE ebpo_status ebpo_scene_evaluations_begin(ebpo_scene_evaluations *evaluations,
                                                       const ebpo_scene *scene,
                                                       const ebpo_scene_pair *pair,
                                                       double tolerance, ebpo_error *error);

/* Bounds the motion of the pair, as pair_motion does. */
EBPO_MUST_USE ebpo_status ebpo_scene_evaluations_motion(const ebpo_scene_evaluations *evaluations,
                                                        double from, double to, double *out,
                                                        ebpo_error *error);

/* Bounds the distance of the pair's faces at a time, including omitted faces. */
EBPO_MUST_USE ebpo_status ebpo_scene_evaluate(ebpo_scene_evaluations *evaluations, double time,
                                              double *lo, double *hi, ebpo_error *error);

/* Returns true if `hi` is at most the tolerance above `lo`, in real numbers. */
bool ebpo_scene_is_within(double hi, double lo, double tolerance);

/* Reads the options, with the default number of evaluations. Fails with EBPO_E_ARGUMENT if the
 * tolerance is not above 0. */
EBPO_MUST_USE ebpo_status
ebpo_scene_take_approach_options(ebpo_scene_approach_options *own,
                                 const ebpo_scene_approach_options *options, ebpo_error *error);

#endif
