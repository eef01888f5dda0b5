/* Writes query results as text, JSON or raw numbers. */
#ifndef EBPO_TOOLS_RESULTS_H
#define EBPO_TOOLS_RESULTS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/result_text.h"

/* Form of the results. In a line of RESULTS_TEXT, blanks separate the values; in a line of
 * RESULTS_CSV, commas. */
typedef enum result_form { RESULTS_TEXT, RESULTS_JSON, RESULTS_RAW, RESULTS_CSV } result_form;

extern const char *const where_words[]; /* OUT, IN, ON, MAYBE */

void results_inside(result_text *t, result_form form, const ebpo_inside_result *results,
                    uint64_t count);
/* Parameters of all functions with these names: `sampler`: attributes to write after the face;
 * NULL: none. `model`: [count] index of the model in the catalogue for each result, UINT64_MAX for
 * no model; NULL: there is no catalogue. */

/* Writes distances. If `intervals`, writes only lo and hi. */
void results_distance(result_text *t, result_form form, bool intervals,
                      const ebpo_distance_result *results, uint64_t count,
                      const ebpo_sampler *sampler, const uint64_t *model);
/* results_near writes one face of the list of nearest faces, with the text before it. `first`: the
 * face is the first one of the list. results_near_end writes the text that ends the list. `none`:
 * the list is empty. */
void results_near(result_text *t, result_form form, const ebpo_near_face *face, bool first,
                  const ebpo_sampler *sampler);
void results_near_end(result_text *t, result_form form, bool none, const ebpo_sampler *sampler);
void results_ray_first(result_text *t, result_form form, const ebpo_ray *rays,
                       const ebpo_ray_hit *hits, uint64_t count, const ebpo_sampler *sampler,
                       const uint64_t *model);
void results_ray_any(result_text *t, result_form form, const bool *any, uint64_t count);
/* Writes the results of one ray. */
void results_ray_all(result_text *t, result_form form, const ebpo_ray *ray,
                     const ebpo_ray_hit *hits, uint64_t count, const ebpo_sampler *sampler);
void results_box(result_text *t, result_form form, const uint64_t *faces, uint64_t count);

/* Writes the line with the names of columns. `names`: names separated by commas. `attributes`:
 * names of the attributes, separated by commas, at most RESULT_NAMES bytes; NULL: none. */
enum { RESULT_NAMES = 400 };
void results_header(result_text *t, result_form form, const char *names, const char *attributes);

/* Writes a little-endian number, as in all raw results. */
void raw_u64(FILE *out, uint64_t v);
void raw_double(FILE *out, double v);

#endif
