/* EBP-Octree in HDF5: files on web servers and object stores, read by ranges.
 *
 *     ebpo_open("https://example.org/model.ebpo.h5", &file, &error);                       with the
 * usual options
 *
 *     ebpo_http_options options = EBPO_HTTP_OPTIONS_INIT;
 *     options.cache_folder = "/var/cache/models";
 *     ebpo_open_url("https://example.org/model.ebpo.h5", &options, &file, &error);
 *
 * Any server that answers "Range: bytes=a-b" with 206 will do. Opening costs one request, for the
 * first 128 KiB, which mostly bring levels 0 to 4 too. What is read later is announced by the
 * reader and fetched in requests of up to 4 MiB, several at once. Every answer is checked: its
 * range, its size, and that it is of the version that was opened (ETag, else Last-Modified, and
 * size). docs/guide/remote.md. A library built without libcurl answers EBPO_E_UNSUPPORTED.
 */
#ifndef EBPO_HTTP_H
#define EBPO_HTTP_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_http_options {
    size_t struct_size;     /* EBPO_HTTP_OPTIONS_INIT sets it */
    double connect_timeout; /* seconds for name, connection and TLS together; > 0 */
    /* an answer that brings fewer than 100 bytes a second for so many seconds is given up and asked
     * for again; >= 1 */
    double stall_timeout;
    /* seconds for one request with all its retries and pauses: reading a piece never takes longer;
     * > 0 */
    double time_limit;
    /* of a request, after dropped connections, short bodies, stalls, and 408, 429, 500, 502, 503,
     * 504; never after other codes */
    unsigned retries;
    unsigned connections; /* requests at a time, 1 to 32 */
    /* bytes that may be held, of what is read ahead and what was read last; more when readers wait
     * for pieces of 4 MiB. Not part of a model's budget */
    uint64_t memory;
    /* a file up to so many bytes is read as a whole, into memory, from a server that has no ranges
     * or tells no version */
    uint64_t whole_limit;
    /* read larger files from servers that send neither ETag nor Last-Modified as well: a change
     * under way may then go unnoticed */
    bool unversioned;
    bool netrc;          /* take names and passwords from ~/.netrc */
    const char *user;    /* "name:password" for basic authentication, or NULL */
    const char *ca_file; /* certificates to trust (PEM) instead of the system's, or NULL */
    /* as libcurl takes it; NULL: from the environment (http_proxy, https_proxy, no_proxy), "": none
     */
    const char *proxy;
    const char *user_agent; /* NULL: libebpo/VERSION */
    /* "Name: value", NULL at the end, sent with every request; or NULL */
    const char *const *headers;
    /* bytes that were fetched are kept here from one session to the next; NULL: they are not. Made
     * when missing. Any number of processes may share it */
    const char *cache_folder;
    uint64_t cache_bytes; /* that the folder may hold; the least recently used go first */
    /* asked some ten times a second, by another thread; true: what is under way and comes later
     * ends with EBPO_E_CANCELLED. NULL: never */
    bool (*stop)(void *user);
    void *stop_user;
} ebpo_http_options;
#define EBPO_HTTP_OPTIONS_INIT                                                                \
    {                                                                                         \
        sizeof(ebpo_http_options), 15, 20, 120, 5, 6, UINT64_C(48) << 20, UINT64_C(64) << 20, \
            false, true, NULL, NULL, NULL, NULL, NULL, NULL, UINT64_C(1) << 30, NULL, NULL    \
    }

/* Sums since opening. */
typedef struct ebpo_http_stats {
    size_t struct_size;               /* EBPO_HTTP_STATS_INIT sets it */
    uint64_t requests;                /* sent, with retries and redirects */
    uint64_t retries;                 /* of these, repeated after a failure */
    uint64_t connections;             /* made */
    uint64_t bytes;                   /* received in bodies */
    uint64_t cache_hits, cache_bytes; /* requests that the folder answered, bytes taken from it */
    /* bytes that the folder held at opening: of this version of the file, and of other files and
     * versions */
    uint64_t cache_held, cache_others;
    double wait_seconds; /* that readers waited, summed over threads */
} ebpo_http_stats;
#define EBPO_HTTP_STATS_INIT EBPO_SIZED(ebpo_http_stats)

/* A URL as messages show it, without user and password and without what follows "?"; any other name
 * as it is. Into out[room], cut off if need be; returns out. */
EBPO_API char *ebpo_url_redact(const char *name, char *out, size_t room);

/* True for names that begin with http:// or https://. */
EBPO_API bool ebpo_is_url(const char *name);

/* A source of the bytes of a URL; the first request has been answered when it returns. `options`
 * may be NULL; its texts are copied. Close it with out->close, or hand it to ebpo_open_source.
 * EBPO_E_IO: not reached, refused, wrong answers; EBPO_E_UNSUPPORTED: the server has no ranges and
 * the file is too large, or the library was built without HTTP; EBPO_E_ARGUMENT: not a URL, options
 * out of range, or a cache folder that cannot be used. Reading: EBPO_E_IO, also when the file on
 * the server has changed since it was opened, which then is the answer to all reads;
 * EBPO_E_CANCELLED. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_source_of_url(const char *url,
                                                      const ebpo_http_options *options,
                                                      ebpo_source *out, ebpo_error *error);

/* ebpo_open with options. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_url(const char *url, const ebpo_http_options *options,
                                                 ebpo_file **out, ebpo_error *error);

/* EBPO_E_ABSENT, with zeros, when the file was not opened by its URL. Any time, any thread. */
EBPO_API ebpo_status ebpo_file_get_http_stats(const ebpo_file *file, ebpo_http_stats *out);

#ifdef __cplusplus
}
#endif
#endif
