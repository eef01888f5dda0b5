/* Runs query commands on a catalogue instead of a model. */
#ifndef EBPO_TOOLS_QUERY_CATALOGUE_H
#define EBPO_TOOLS_QUERY_CATALOGUE_H

#include "cli/commands/query_job.h"

/* Returns true if MODEL is a catalogue: the name of a file that ends in .json. */
bool query_catalogue_named(const char *name);

/* Returns true if a catalogue supports the query. Otherwise reports the reason on stderr; the
 * caller then exits with EXIT_USAGE. */
bool query_catalogue_fits(const query_job *job);
/* Opens the catalogue as job->catalogue; opens no models. With --memory, options->memory is the
 * limit for all models together. Returns an exit code. Call query_catalogue_close in any case. */
int query_catalogue_open(query_job *job, const char *path, const ebpo_model_options *options);
void query_catalogue_close(query_job *job);
/* Returns the options of the job for a query on one thread. */
ebpo_catalogue_query_options query_catalogue_options(const query_job *job);
/* Prints statistics for --stats. */
void query_catalogue_report(const query_job *job);

/* Writes the facts of the catalogue on which results depend, as members of the note of a shard (see
 * query_shard.h). These are the size and hash of the catalogue file, and the sizes and times of the
 * files of source indices that the catalogue names ("numbers"). Returns an exit code. */
int query_catalogue_facts(json *j, const char *command, const char *path);

#endif
