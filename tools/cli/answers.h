/* What answers to questions look like. */
#ifndef EBPO_TOOLS_ANSWERS_H
#define EBPO_TOOLS_ANSWERS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/answer_text.h"

/* Numbers of a line: between blanks or commas. */
typedef enum answer_form { ANSWERS_TEXT, ANSWERS_JSON, ANSWERS_RAW, ANSWERS_CSV } answer_form;

extern const char *const where_words[]; /* OUT, IN, ON, MAYBE */

void answers_inside(answer_text *t, answer_form form, const ebpo_inside_result *results,
                    uint64_t count);
/* `limited`: lo and hi only. `sampler`, here and below: attributes stand behind the face; or NULL.
 * `model`, likewise: [count] of the model in the catalogue, UINT64_MAX for none; or NULL. */
void answers_distance(answer_text *t, answer_form form, bool limited,
                      const ebpo_distance_result *results, uint64_t count,
                      const ebpo_sampler *sampler, const uint64_t *model);
/* Faces of one point, the nearest first: each as it is found, with what is before it and, for all
 * of them, what is after the last one. */
void answers_near(answer_text *t, answer_form form, const ebpo_near_face *face, bool first,
                  const ebpo_sampler *sampler);
void answers_near_end(answer_text *t, answer_form form, bool none, const ebpo_sampler *sampler);
void answers_ray_first(answer_text *t, answer_form form, const ebpo_ray *rays,
                       const ebpo_ray_hit *hits, uint64_t count, const ebpo_sampler *sampler,
                       const uint64_t *model);
void answers_ray_any(answer_text *t, answer_form form, const bool *any, uint64_t count);
/* Of one ray. */
void answers_ray_all(answer_text *t, answer_form form, const ebpo_ray *ray,
                     const ebpo_ray_hit *hits, uint64_t count, const ebpo_sampler *sampler);
void answers_box(answer_text *t, answer_form form, const uint64_t *faces, uint64_t count);

/* A line of names, which are given with commas; `attributes`: at most ANSWER_NAMES bytes of them,
 * or NULL. */
enum { ANSWER_NAMES = 400 };
void answers_header(answer_text *t, answer_form form, const char *names, const char *attributes);

/* Little-endian, as raw answers are. */
void raw_u64(FILE *out, uint64_t v);
void raw_double(FILE *out, double v);

#endif
