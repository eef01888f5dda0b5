/* Computes data of two instances of a scene at a time: the box of one instance in the coordinates
 * of the other instance, and the relative motion and the distance of the instances. Also computes
 * the distance of faces that the files omit (a subset file omits a part of the model's faces).
 * Bounds are valid for posed coordinates, which are rounded. */
#ifndef EBPO_SCENE_INSTANCE_PAIR_H
#define EBPO_SCENE_INSTANCE_PAIR_H

#include <ebpo/collide.h>

#include "extras/scene/scene_parts.h"

typedef struct ebpo_scene_bounds {
    double min[3], max[3];
} ebpo_scene_bounds;

/* The box of one instance in the coordinates of another instance's model. */
typedef struct ebpo_scene_relative_box {
    ebpo_scene_bounds box;
    double rounding; /* length by which `box` has been widened on each side because of rounding */
    double unit;     /* least length in the world that a vector of length 1 in these coordinates can
                        have */
} ebpo_scene_relative_box;

/* Computes a box that contains the box of the instance `other` at a time. The computed box is in
 * the coordinates of the model of the instance `self`. Fails with EBPO_E_ARGUMENT if a pose is out
 * of range. */
EBPO_MUST_USE ebpo_status ebpo_scene_make_relative_box(const ebpo_scene *scene, uint64_t self,
                                                       uint64_t other, double time,
                                                       ebpo_scene_relative_box *out,
                                                       ebpo_error *error);

/* Returns the distance of two boxes, rounded down. */
double ebpo_scene_bounds_gap(const ebpo_scene_bounds *a, const ebpo_scene_bounds *b);

/* Considers all pairs of a face of pair->a and a face of pair->b in which at least one face is
 * omitted from its file. Sets *distance to a lower bound of the distances of these pairs at a time;
 * INFINITY if no face is omitted. Sets *omitted_in to an instance whose file omits faces. */
EBPO_MUST_USE ebpo_status ebpo_scene_omitted(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                             double time, double *distance, uint64_t *omitted_in,
                                             ebpo_error *error);

/* Reports that faces which the file of the instance `omitted_in` omits may change the result.
 * Always returns EBPO_E_ABSENT. solids: the reason is that the omitted faces may enclose the other
 * instance. */
ebpo_status ebpo_scene_fail_omitted(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                    uint64_t omitted_in, double time, bool solids,
                                    ebpo_error *error);

/* Returns the next time after `from` at which a route of the pair has a key (a time at which a
 * route gives a pose), or `to` if `to` is earlier. */
double ebpo_scene_pair_next(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from,
                            double to);

/* --- evaluation of many pairs on several threads; one thread evaluates a pair --- */

typedef struct ebpo_scene_pairs_list {
    ebpo_scene_pair *pairs; /* from malloc */
    uint64_t count;
} ebpo_scene_pairs_list;

/* Lists the pairs of ebpo_scene_pairs. On failure there is nothing to free. */
EBPO_MUST_USE ebpo_status ebpo_scene_keep_pairs(const ebpo_scene *scene, double from, double to,
                                                ebpo_scene_pairs_list *out, ebpo_error *error);
/* Computes the result of one pair. context: the context in ebpo_scene_search. */
typedef ebpo_status (*ebpo_scene_find_fn)(const void *context, const ebpo_scene_pair *pair,
                                          void *result, ebpo_error *error);

/* Describes the computation of the results of many pairs. */
typedef struct ebpo_scene_search {
    ebpo_scene_find_fn find;
    const void *context; /* passed to `find` */
    size_t result_size;
    uint64_t grain;   /* number of consecutive pairs that a thread takes */
    unsigned threads; /* 0: one for each core */
    const ebpo_progress *progress;
    const char *stage; /* for the progress function */
} ebpo_scene_search;

/* Lists the pairs, makes their models, and computes the result of each pair. *results is in the
 * order of the pairs; the caller frees it, even on failure. *count is 0 if the pairs could not be
 * listed. */
EBPO_MUST_USE ebpo_status ebpo_scene_find_in_pairs(ebpo_scene *scene, double from, double to,
                                                   const ebpo_scene_search *search, void **results,
                                                   uint64_t *count, ebpo_error *error);

/* Makes the models of all pairs in the calling thread. Queries on several threads may then share
 * the models. */
EBPO_MUST_USE ebpo_status ebpo_scene_make_models(ebpo_scene *scene, const ebpo_scene_pair *pairs,
                                                 uint64_t count, ebpo_error *error);
/* Makes a collider for a pair whose models have been made. *out is NULL if one of the files has no
 * mesh; ebpo_scene_omitted treats all faces of such a file as omitted. */
EBPO_MUST_USE ebpo_status ebpo_scene_collider(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                              unsigned threads, ebpo_collider **out,
                                              ebpo_error *error);
/* Sets pose_a and pose_b of `out` to the poses of both instances at a time. */
EBPO_MUST_USE ebpo_status ebpo_scene_pose_pair(const ebpo_scene *scene, const ebpo_scene_pair *pair,
                                               double time, ebpo_collide_options *out,
                                               ebpo_error *error);

/* Evaluates the distance and the motion of a pair of instances at a sequence of times. */
typedef struct ebpo_scene_evaluations {
    const ebpo_scene *scene;
    const ebpo_scene_pair *pair;
    ebpo_collider *collider; /* from ebpo_scene_collider; must be freed */
    double tolerance;        /* tolerance of one evaluation */
    bool shares_route;       /* both instances follow one route */
    double omitted_distance; /* result of ebpo_scene_omitted at the last evaluation */
    uint64_t omitted_in;     /* instance whose file omits faces, from the same call */
} ebpo_scene_evaluations;

/* Begins evaluations. tolerance: tolerance of the caller's result; each evaluation uses a quarter
 * of this tolerance, or a greater tolerance if the rounding errors of poses require that. The
 * caller frees the collider, even on failure. */
EBPO_MUST_USE ebpo_status ebpo_scene_evaluations_begin(ebpo_scene_evaluations *evaluations,
                                                       const ebpo_scene *scene,
                                                       const ebpo_scene_pair *pair,
                                                       double tolerance, ebpo_error *error);

/* Sets *out to an upper bound of the change of the pair's distance between two times; INFINITY if a
 * route jumps between them. */
EBPO_MUST_USE ebpo_status ebpo_scene_evaluations_motion(const ebpo_scene_evaluations *evaluations,
                                                        double from, double to, double *out,
                                                        ebpo_error *error);

/* Bounds the distance of the pair's faces at a time, including omitted faces. */
EBPO_MUST_USE ebpo_status ebpo_scene_evaluate(ebpo_scene_evaluations *evaluations, double time,
                                              double *lo, double *hi, ebpo_error *error);

/* Returns true if hi - lo is certainly at most the tolerance, in spite of rounding. */
bool ebpo_scene_is_within(double hi, double lo, double tolerance);

/* Copies the options to `checked`, with the default number of evaluations. Fails with
 * EBPO_E_ARGUMENT if the tolerance is not above 0. */
EBPO_MUST_USE ebpo_status
ebpo_scene_take_approach_options(ebpo_scene_approach_options *checked,
                                 const ebpo_scene_approach_options *options, ebpo_error *error);

#endif
