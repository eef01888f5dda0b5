/* Answers that go to a file, whole; of all questions or of a shard of them. Beside the answers of a
 * shard a note is left of what they were made of: who finds it there has nothing to do. */
#ifndef EBPO_TOOLS_QUERY_SHARD_H
#define EBPO_TOOLS_QUERY_SHARD_H

#include "cli/commands/query_job.h"

typedef struct query_shard {
    const char *command;
    const query_values *v;
    const char *model, *points; /* paths */
    uint64_t number, of;        /* of 0: no shard */
    char *facts;                /* of all that answers are made of, as the note has them */
    char *note;                 /* its path */
    ebpo_output *out;
    int kept; /* standard output, while the file is in its place; -1: it is not */
} query_shard;

/* Whether options of outputs and shards fit; takes I/N. False: said on stderr (exit with
 * EXIT_USAGE). query_shard_free in any case. */
bool query_shard_fits(query_shard *s, const query_job *job, const char *model, const char *asked);
/* Looks at the inputs. True: the answers are there, which has been said, or *code is not EXIT_FINE.
 */
bool query_shard_done(query_shard *s, const query_job *job, int *code);
/* Puts the file of answers in the place of standard output; nothing where none is asked for. */
int query_shard_begin(query_shard *s);
/* Puts standard output back and, after EXIT_FINE, the file in its place; returns the exit code. */
int query_shard_end(query_shard *s, const query_job *job, int code);
void query_shard_free(query_shard *s);

#endif
