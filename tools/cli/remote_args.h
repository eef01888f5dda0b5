/* Opens the file of a command by its path or URL. Defines the options for files and URLs that all
 * commands have, and prints the statistics of --stats. */
#ifndef EBPO_TOOLS_REMOTE_ARGS_H
#define EBPO_TOOLS_REMOTE_ARGS_H

#include <ebpo/ebpo.h>

#include "cli/args.h"
#include "cli/json.h"

/* Values of the options; NULL, -1 and an empty list: not given. */
typedef struct remote_values {
    bool stats, unversioned;
    int64_t max_expansion; /* as in ebpo_open_options */
    bool compat;           /* true: also open files that other programs have rewritten (--compat) */
    const char *cache, *cache_size, *user, *ca_file;
    unsigned cache_block; /* bytes; 0: default */
    double timeout, stall;
    int64_t retries, connections;
    arg_list headers;
    /* set by commands, not by options: see ebpo_http_options */
    bool (*stop)(void *user);
    void *stop_user;
} remote_values;
#define REMOTE_VALUES_INIT                                           \
    {                                                                \
        .timeout = -1, .stall = -1, .retries = -1, .connections = -1 \
    }

/* Opens a file by its path or URL (ebpo_open_with; ebpo_open_compat with --compat).
 * EBPO_E_ARGUMENT: also if the value of an option is invalid. */
EBPO_MUST_USE ebpo_status remote_open(ebpo_file **out, const char *name,
                                      const remote_values *values, ebpo_error *error);

/* Opens the file that the command itself has written, without a limit on the decoded size. */
EBPO_MUST_USE ebpo_status remote_open_own(const char *path, ebpo_file **out, ebpo_error *error);

/* Returns the name to print: a URL without password and query. Valid until the next call. */
const char *remote_shown(const char *name);

/* Traffic of a file since it was opened. */
typedef struct traffic {
    uint64_t bytes, reads; /* numbers of bytes, and of reads, that were requested from the source */
    bool remote;           /* true: the file was opened by a URL */
    ebpo_http_stats http;  /* valid if `remote` */
} traffic;
traffic traffic_of(const ebpo_file *file);

/* Print the traffic if --stats was given. remote_report prints a line or JSON on stderr.
 * remote_json writes the member "traffic" of a JSON object. */
void remote_report(const traffic *t, const remote_values *values, bool as_json);
void remote_json(json *j, const traffic *t, const remote_values *values);

#endif
