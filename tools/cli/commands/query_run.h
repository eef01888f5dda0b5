/* Runs the commands inside, distance, ray and box: reads blocks of queries and writes their
 * results. */
#ifndef EBPO_TOOLS_QUERY_RUN_H
#define EBPO_TOOLS_QUERY_RUN_H

#include "cli/commands/query_job.h"

/* Runs the command. model: path of a model or a catalogue. points: path of a file of points; NULL:
 * standard input. Returns an exit code. */
int query_run(query_job *job, const char *model, const char *points);

#endif
