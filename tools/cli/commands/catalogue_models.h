/* Questions to a catalogue: answers are those of the package for Python (docs/guide/clusters.md).
 * Any number of threads may ask. */
#ifndef EBPO_TOOLS_CATALOGUE_MODELS_H
#define EBPO_TOOLS_CATALOGUE_MODELS_H

#include <ebpo/query.h>

#include "cli/commands/catalogue_boxes.h"
#include "cli/commands/holding.h"

typedef struct catalogue_models {
    const catalogue *c;
    held_models *held;
    catalogue_boxes all, seen;      /* of all models; of those that rays and distances see */
    const catalogue_entry *surface; /* the first that has no inside; NULL: all have */
} catalogue_models;

/* As a number of a model in the catalogue, the first is 0: none. */
#define CATALOGUE_NO_MODEL UINT64_MAX

/* False: not enough memory. catalogue_models_free in any case, before the catalogue's. */
bool catalogue_models_make(catalogue_models *m, const catalogue *c, const holding_options *options);
void catalogue_models_free(catalogue_models *m);

/* Each: EBPO_E_MEMORY, and the errors of opening models and of asking them. Points are finite,
 * and rays as ebpo_ray_first_many takes them. Nothing is opened for no questions. */

/* The sum of the winding numbers, and what is inside any model, or, of parts, of the sum.
 * EBPO_E_NOT_SOLID: a model is a surface. */
EBPO_MUST_USE ebpo_status catalogue_inside(catalogue_models *m, const double *points,
                                           uint64_t count, ebpo_inside_result *out,
                                           ebpo_error *error);
/* The nearest face of any model, at most max_distance away, of equal distances the first model's.
 * The sign is that of `inside`, where all models are solids. EBPO_E_ABSENT: caps alone, likewise
 * for rays. */
EBPO_MUST_USE ebpo_status catalogue_distance(catalogue_models *m, const double *points,
                                             uint64_t count, double max_distance,
                                             bool unsigned_distance, ebpo_distance_result *out,
                                             uint64_t *model, ebpo_error *error);
/* The first face that each ray meets, of equal t the first model's. */
EBPO_MUST_USE ebpo_status catalogue_ray(catalogue_models *m, const ebpo_ray *rays, uint64_t count,
                                        ebpo_ray_sides sides, ebpo_ray_hit *out, uint64_t *model,
                                        ebpo_error *error);

/* --- between the files that answer --- */

/* Pairs that are in memory at a time, but for those of one question. */
enum { CATALOGUE_PAIRS = 1 << 21 };

/* What a model is asked: rows[count][width] and of which questions they are, pair[].item. */
typedef struct model_run {
    uint32_t model;
    const box_pair *pair;
    size_t count;
    const double *rows;
    void *user;
} model_run;

/* Asks each model of `pairs` (which are sorted, by model and question) once, about rows[item]. */
EBPO_MUST_USE ebpo_status catalogue_runs(catalogue_models *m, box_pairs *pairs, const double *rows,
                                         size_t width, bool surface, holding_question ask,
                                         void *user, ebpo_error *error);
ebpo_status catalogue_no_memory(ebpo_error *error);
/* EBPO_E_ABSENT: the catalogue tells of caps alone. */
EBPO_MUST_USE ebpo_status catalogue_need_surface(const catalogue_models *m, ebpo_error *error);

/* Of parts: which of points[count] are on faces of the whole; and winding numbers at points that
 * are on none, though on caps. numbers[count]: the points. */
EBPO_MUST_USE ebpo_status catalogue_on_surface(catalogue_models *m, const double *points,
                                               const uint32_t *numbers, size_t count, bool *out,
                                               ebpo_error *error);
EBPO_MUST_USE ebpo_status catalogue_crossings(catalogue_models *m, const double *points,
                                              const uint32_t *numbers, size_t count,
                                              int64_t *winding, ebpo_error *error);

#endif
