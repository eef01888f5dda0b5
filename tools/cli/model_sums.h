/* The sums of a model, as --stats prints them. */
#ifndef EBPO_TOOLS_MODEL_SUMS_H
#define EBPO_TOOLS_MODEL_SUMS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/json.h"

/* A line of words. */
void stats_print(FILE *out, const ebpo_model_stats *stats);
/* A row for each with its unit: what it was before and afterwards. */
void stats_table(FILE *out, const ebpo_model_stats *first, const ebpo_model_stats *last);
/* Members of the object that has been begun. */
void stats_json(json *j, const ebpo_model_stats *stats);

#endif
