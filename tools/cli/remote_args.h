/* Opening a FILE of a command, which may be a URL: options that all such commands share, and
 * --stats. */
#ifndef EBPO_TOOLS_REMOTE_ARGS_H
#define EBPO_TOOLS_REMOTE_ARGS_H

#include <ebpo/ebpo.h>

#include "cli/args.h"
#include "cli/json.h"

typedef struct remote_values {
    bool stats, unversioned;
    const char *cache, *cache_size, *user, *ca_file;
    unsigned cache_block; /* bytes; 0: as usual */
    double timeout, stall;
    int64_t retries, connections;
    arg_list headers;
    bool (*stop)(void *user); /* not options: as in ebpo_http_options */
    void *stop_user;
} remote_values;
#define REMOTE_VALUES_INIT                                           \
    {                                                                \
        .timeout = -1, .stall = -1, .retries = -1, .connections = -1 \
    }

/* Rows for the tables of options; `member` is the remote_values in the struct `type`. */
#define REMOTE_OPTIONS(type, member)                                                            \
    OPTION_FLAG("stats", 0, type, member.stats,                                                 \
                "print what was read on standard error at the end: reads and bytes; for a URL " \
                "requests, bytes, retries, seconds"),                                           \
        REMOTE_HTTP_OPTIONS(type, member)

/* Without --stats, for commands that have their own. */
#define REMOTE_HTTP_OPTIONS(type, member)                                                \
    OPTION_TEXT("http-cache", 0, type, member.cache, "DIR",                              \
                "keep what is fetched from a URL in this folder"),                       \
        OPTION_TEXT("http-cache-size", 0, type, member.cache_size, "SIZE",               \
                    "how much the folder may hold: 512M, 4G; default: 1GiB"),            \
        OPTION_REAL("http-timeout", 0, type, member.timeout, "SECONDS", 0.001, 1e6,      \
                    "time limit for one request with its retries; default: 120"),        \
        OPTION_REAL("http-stall", 0, type, member.stall, "SECONDS", 1, 1e6,              \
                    "give up an answer that brings nothing for this long; default: 20"), \
        OPTION_INT("http-retries", 0, type, member.retries, "N", 0, 1000,                \
                   "retries of a failed request; default: 5"),                           \
        OPTION_INT("http-connections", 0, type, member.connections, "N", 1, 32,          \
                   "requests at a time, of large ones at most six; default: 32"),        \
        OPTION_LIST("http-header", 0, type, member.headers, "LINE",                      \
                    "also send 'Name: value'; may be repeated"),                         \
        OPTION_TEXT("http-user", 0, type, member.user, "NAME:PASSWORD",                  \
                    "for servers that ask for it; ~/.netrc is a better place"),          \
        OPTION_TEXT("http-ca", 0, type, member.ca_file, "FILE",                          \
                    "certificates to trust instead of the system's"),                    \
        OPTION_FLAG("http-unversioned", 0, type, member.unversioned,                     \
                    "also read large files from servers that give no version")

/* ebpo_open, by path or by URL with these options. EBPO_E_ARGUMENT also for an option that makes no
 * sense. */
EBPO_MUST_USE ebpo_status remote_open(ebpo_file **out, const char *name,
                                      const remote_values *values, ebpo_error *error);

/* The name as output shows it: of a URL without password and query. Valid until the next call. */
const char *remote_shown(const char *name);

/* What was read of a file since it was opened. */
typedef struct traffic {
    uint64_t bytes, reads; /* asked of the source */
    bool far;              /* the file is a URL */
    ebpo_http_stats http;
} traffic;
traffic traffic_of(const ebpo_file *file);

/* With --stats: a line on stderr, or JSON there; as a member "traffic" of a JSON object. Nothing
 * without. */
void remote_tell(const traffic *t, const remote_values *values, bool as_json);
void remote_json(json *j, const traffic *t, const remote_values *values);

#endif
