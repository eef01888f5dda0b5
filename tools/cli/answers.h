/* Answers to questions on standard output, and the sums of a model. */
#ifndef EBPO_TOOLS_ANSWERS_H
#define EBPO_TOOLS_ANSWERS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/json.h"

typedef enum answer_form { ANSWERS_TEXT, ANSWERS_JSON, ANSWERS_RAW } answer_form;

extern const char *const where_words[]; /* OUT, IN, ON, MAYBE */

/* Before the first answer of a command: from then on answers leave the process whole (those longer
 * than 4096 bytes: to files), so that who is interrupted has printed complete lines. */
void answers_begin(const char *command);

void answers_inside(answer_form form, const ebpo_inside_result *results, uint64_t count);
/* `limited`: lo and hi only. */
void answers_distance(answer_form form, bool limited, const ebpo_distance_result *results,
                      uint64_t count);
/* Faces of one point, the nearest first: each as it is found, with what is before it and, for all
 * of them, what is after the last one. */
void answers_near(answer_form form, const ebpo_near_face *face, bool first);
void answers_near_end(answer_form form, bool none);
void answers_ray_first(answer_form form, const ebpo_ray_hit *hits, uint64_t count);
void answers_ray_any(answer_form form, const bool *any, uint64_t count);
/* Of one ray. */
void answers_ray_all(answer_form form, const ebpo_ray_hit *hits, uint64_t count);
void answers_box(answer_form form, const uint64_t *faces, uint64_t count);

/* One line: words, or a JSON object. */
void stats_print(FILE *out, bool as_json, const ebpo_model_stats *stats);
void stats_json(json *j, const char *key, const ebpo_model_stats *stats);

/* Little-endian, as raw answers are. */
void raw_u64(FILE *out, uint64_t v);
void raw_double(FILE *out, double v);

#endif
