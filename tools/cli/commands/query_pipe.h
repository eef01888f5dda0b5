/* Reads, evaluates and prints queries on all cores. Each thread takes the next block of input,
 * parses its numbers, evaluates its queries, and prints the results to memory. The results of
 * blocks are written in the order of the input. */
#ifndef EBPO_TOOLS_QUERY_PIPE_H
#define EBPO_TOOLS_QUERY_PIPE_H

#include "cli/progress.h"
#include "cli/commands/query_holding.h"
#include "cli/commands/query_job.h"

/* Evaluates all queries of `in`. threads: maximum number of threads, at least 1; a small input uses
 * fewer threads. Returns an exit code. */
int query_pipe_run(const query_job *job, query_holding *holding, points *in, unsigned threads,
                   progress_line *progress);

#endif
