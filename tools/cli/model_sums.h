/* The sums of a model, as --stats prints them. */
#ifndef EBPO_TOOLS_MODEL_SUMS_H
#define EBPO_TOOLS_MODEL_SUMS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/json.h"

/* One line: words, or a JSON object. */
void stats_print(FILE *out, bool as_json, const ebpo_model_stats *stats);
void stats_json(json *j, const char *key, const ebpo_model_stats *stats);

#endif
