/* Prints the statistics of a model for --stats. */
#ifndef EBPO_TOOLS_MODEL_STATS_H
#define EBPO_TOOLS_MODEL_STATS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/json.h"

/* Prints a line of words. */
void stats_print(FILE *out, const ebpo_model_stats *stats);
/* Prints a row with its unit for each value before and afterwards. */
void stats_table(FILE *out, const ebpo_model_stats *first, const ebpo_model_stats *last);
/* Writes members of the open object. */
void stats_json(json *j, const ebpo_model_stats *stats);

#endif
