/* A catalogue where a command for questions takes a model. */
#ifndef EBPO_TOOLS_QUERY_CATALOGUE_H
#define EBPO_TOOLS_QUERY_CATALOGUE_H

#include "cli/commands/query_job.h"

/* Whether a MODEL is taken for a catalogue: by its name, that of a file that ends in .json. */
bool query_catalogue_named(const char *name);

/* Whether the question can be asked of one. False: said on stderr (exit with EXIT_USAGE). */
bool query_catalogue_fits(const query_job *job);
/* Opens the catalogue, no model; job->catalogue is then what is asked. The options' memory, where
 * the command was told any, is for all models. Returns an exit code; query_catalogue_close in any
 * case. */
int query_catalogue_open(query_job *job, const char *path, const ebpo_model_options *options);
void query_catalogue_close(query_job *job);
/* As the job wants it, with one thread. */
ebpo_catalogue_ask_options query_catalogue_options(const query_job *job);
/* With --stats. */
void query_catalogue_tell(const query_job *job);

/* What answers depend on of the catalogue, as members of the note of a shard: the file, and the
 * sizes and times of files with numbers. Returns an exit code. */
int query_catalogue_facts(json *j, const char *command, const char *path);

#endif
