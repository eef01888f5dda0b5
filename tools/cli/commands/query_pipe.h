/* Reads, evaluates and prints concurrently on all cores: each thread takes the next block of
 * queries, parses its numbers, evaluates, and prints to memory; blocks are written in order. */
#ifndef EBPO_TOOLS_QUERY_PIPE_H
#define EBPO_TOOLS_QUERY_PIPE_H

#include "cli/progress.h"
#include "cli/commands/query_holding.h"
#include "cli/commands/query_job.h"

/* Evaluates all queries of `in`. Returns an exit code. threads: maximum number of threads, at least
 * 1; few queries use fewer threads. */
int query_pipe_run(const query_job *job, query_holding *holding, points *in, unsigned threads,
                   progress_line *progress);

#endif
