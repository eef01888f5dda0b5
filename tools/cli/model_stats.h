/* Prints the statistics of a model for --stats. */
#ifndef EBPO_TOOLS_MODEL_STATS_H
#define EBPO_TOOLS_MODEL_STATS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/json.h"

/* Prints all statistics in one line. */
void stats_print(FILE *out, const ebpo_model_stats *stats);
/* Prints a row for each statistic: its value after the first round of queries, its value after the
 * last round, and its unit. */
void stats_table(FILE *out, const ebpo_model_stats *first, const ebpo_model_stats *last);
/* Writes each statistic as a member of the open object. */
void stats_json(json *j, const ebpo_model_stats *stats);

#endif
