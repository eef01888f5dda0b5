/* Writes results to a file atomically, for all queries or for a shard (one of N parts of the input,
 * --shard). Beside the results of a shard, writes a file with facts of the inputs, called the note.
 * If a later run finds a note with equal facts, it has nothing to do. */
#ifndef EBPO_TOOLS_QUERY_SHARD_H
#define EBPO_TOOLS_QUERY_SHARD_H

#include "cli/commands/query_job.h"

typedef struct query_shard {
    const char *command;
    const query_values *v;
    const char *model, *points; /* paths */
    uint64_t number, shards;    /* shard `number` of `shards` shards; `shards` 0: no shard */
    char *facts;                /* facts of the inputs and options, as in the note */
    char *note;                 /* path of the note */
    ebpo_output *out;           /* file of the results while it is written; NULL: none */
    int saved_stdout; /* original standard output, while the file replaces it; -1: not replaced */
} query_shard;

/* Checks options of outputs and shards; reads the value I/N of --shard. Returns false after an
 * error, reported on stderr; the caller then exits with EXIT_USAGE. Call query_shard_free in any
 * case. */
bool query_shard_fits(query_shard *s, const query_job *job, const char *model,
                      const char *points_path);
/* Examines the inputs. Returns true if the command has nothing more to do: the results exist,
 * which was reported, or *code is an error. */
bool query_shard_done(query_shard *s, const query_job *job, int *code);
/* Redirects standard output to the file of results, if one is requested. */
int query_shard_begin(query_shard *s);
/* Restores standard output. If `code` is EXIT_OK, gives the file of results its final name. Returns
 * the exit code. */
int query_shard_end(query_shard *s, const query_job *job, int code);
void query_shard_free(query_shard *s);

#endif
