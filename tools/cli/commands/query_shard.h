/* Writes results to a file atomically, for all queries or a shard of them. Beside the results of a
 * shard it writes a file with facts of their inputs, the note: a later run that finds the note of
 * the same inputs has nothing to do. */
#ifndef EBPO_TOOLS_QUERY_SHARD_H
#define EBPO_TOOLS_QUERY_SHARD_H

#include "cli/commands/query_job.h"

typedef struct query_shard {
    const char *command;
    const query_values *v;
    const char *model, *points; /* paths */
    uint64_t number, of;        /* shard `number` of `of` shards; `of` 0: no shard */
    char *facts;                /* all inputs of the results, as in the note */
    char *note;                 /* path of the note */
    ebpo_output *out;
    int saved_stdout; /* original standard output, while the file replaces it; -1: not replaced */
} query_shard;

/* Checks options of outputs and shards; reads I/N. Returns false after an error, reported on stderr
 * (exit with EXIT_USAGE). Call query_shard_free in any case. */
bool query_shard_fits(query_shard *s, const query_job *job, const char *model,
                      const char *points_path);
/* Examines the inputs. Returns true if the command has nothing more to do: the results exist,
 * which was reported, or *code is an error. */
bool query_shard_done(query_shard *s, const query_job *job, int *code);
/* Redirects standard output to the file of results, if one is requested. */
int query_shard_begin(query_shard *s);
/* Restores standard output and, after EXIT_OK, moves the file to its place; returns the exit
 * code. */
int query_shard_end(query_shard *s, const query_job *job, int code);
void query_shard_free(query_shard *s);

#endif
