/* Reading, asking and printing at the same time, on all cores: each thread takes the next block of
 * questions, reads its numbers, asks, and prints to memory; blocks leave in their order. */
#ifndef EBPO_TOOLS_QUERY_PIPE_H
#define EBPO_TOOLS_QUERY_PIPE_H

#include "cli/progress.h"
#include "cli/commands/query_holding.h"
#include "cli/commands/query_job.h"

/* Answers all of `in`; returns an exit code. `threads`: at most so many, at least 1; few questions
 * take fewer. */
int query_pipe_run(const query_job *job, query_holding *holding, points *in, unsigned threads,
                   progress_line *progress);

#endif
