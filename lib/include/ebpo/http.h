/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: files on web servers and object stores, read by ranges.
 *
 *     ebpo_open("https://example.org/model.ebpo.h5", &file, &error);
 *
 * or with options:
 *
 *     ebpo_http_options options = EBPO_HTTP_OPTIONS_INIT;
 *     options.cache_folder = "/var/cache/models";
 *     ebpo_open_url("https://example.org/model.ebpo.h5", &options, &file, &error);
 *
 * Any server will do that answers "Range: bytes=a-b" with 206. Opening costs one
 * request, for the first 128 KiB, which mostly hold levels 0 to 4 too. What is
 * read later is fetched ahead in requests of up to 4 MiB, several at a time.
 *
 * Every answer is checked: its range, its size, and that it is of the version of
 * the file that was opened (by ETag, weak or not, else Last-Modified, and size).
 *
 * Without libcurl the library answers EBPO_E_UNSUPPORTED.
 */
#ifndef EBPO_HTTP_H
#define EBPO_HTTP_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_http_options {
    size_t struct_size; /* EBPO_HTTP_OPTIONS_INIT sets it */

    /* Seconds for name, connection and TLS together; above 0. */
    double connect_timeout;

    /*
     * An answer that brings fewer than 100 bytes a second for so many seconds is
     * given up, and asked for again; at least 1.
     */
    double stall_timeout;

    /*
     * Seconds for one request with all its retries and pauses; above 0. Reading a
     * piece never takes longer.
     */
    double time_limit;

    /*
     * How often a request is sent again: after dropped connections, short bodies,
     * stalls, and the codes 408, 429, 500, 502, 503 and 504. Never after others.
     */
    unsigned retries;

    /* Requests at a time, 1 to 32; of those above 1 MiB at most six. */
    unsigned connections;

    /*
     * Bytes that may be held of what was read ahead and what was read last; more
     * while readers wait for pieces of 4 MiB. Not part of a model's budget.
     */
    uint64_t memory;

    /*
     * From a server that has no ranges or tells no version, a file of up to so
     * many bytes is read as a whole into memory.
     */
    uint64_t whole_limit;

    /*
     * Of a file's version compare the size alone: for servers that send neither
     * ETag nor Last-Modified, and for addresses where several servers answer, each
     * with its ETag. A change under way may then go unnoticed.
     */
    bool unversioned;

    /* Take names and passwords from ~/.netrc. */
    bool netrc;

    /* "name:password" for basic authentication, or NULL. */
    const char *user;

    /* Certificates to trust (PEM) instead of the system's, or NULL. */
    const char *ca_file;

    /*
     * As libcurl takes it. NULL: from the environment (http_proxy, https_proxy,
     * no_proxy). "": none.
     */
    const char *proxy;

    /* NULL: libebpo/VERSION. */
    const char *user_agent;

    /*
     * "Name: value", NULL at the end, sent with every request; or NULL. Not to another
     * host, port or scheme to which a redirect leads, nor to any behind it.
     */
    const char *const *headers;

    /*
     * A folder where bytes that were fetched are kept for the next time; it and
     * those above it are made if they are missing. Any number of processes may share it. NULL:
     * none.
     */
    const char *cache_folder;

    /* Bytes that the folder may hold. The least recently used go first. */
    uint64_t cache_bytes;

    /*
     * Asked some ten times a second, by another thread. True: what is under way,
     * and all that comes later, ends with EBPO_E_CANCELLED. NULL: never.
     */
    bool (*stop)(void *user);
    void *stop_user;

    /*
     * Bytes of a block in the folder, a power of two from 4 KiB to 128 KiB: what is
     * fetched is rounded outward to whole blocks, which small ones make cheaper and
     * many. Blocks of other sizes are not found. 0: 32 KiB.
     */
    unsigned cache_block;

    uint32_t reserved;
} ebpo_http_options;

#define EBPO_HTTP_OPTIONS_INIT                                                                   \
    {                                                                                            \
        sizeof(ebpo_http_options), 15, 20, 120, 5, 32, UINT64_C(48) << 20, UINT64_C(64) << 20,   \
            false, true, NULL, NULL, NULL, NULL, NULL, NULL, UINT64_C(1) << 30, NULL, NULL, 0, 0 \
    }

/* Sums since opening. */
typedef struct ebpo_http_stats {
    size_t struct_size; /* EBPO_HTTP_STATS_INIT sets it */

    /* Requests sent, with retries and redirects. */
    uint64_t requests;

    /* Of these, requests that were repeated after a failure. */
    uint64_t retries;

    /* Connections made. */
    uint64_t connections;

    /* Bytes received in bodies. */
    uint64_t bytes;

    /* Requests that the cache folder answered, and bytes taken from it. */
    uint64_t cache_hits, cache_bytes;

    /*
     * Bytes that the folder held at opening: of this version of the file, and of
     * other files and versions.
     */
    uint64_t cache_held, cache_others;

    /* Seconds that readers waited, summed over threads. */
    double wait_seconds;
} ebpo_http_stats;

#define EBPO_HTTP_STATS_INIT EBPO_SIZED(ebpo_http_stats)

/*
 * A URL as messages show it: without user and password, and without what follows
 * "?". Any other name stays as it is. Into `room` bytes at `out`, cut off if need
 * be. Returns `out`.
 *
 * Threads: any.
 */
EBPO_API char *ebpo_url_redact(const char *name, char *out, size_t room);

/*
 * True for names that begin with http:// or https://.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_is_url(const char *name);

/*
 * A source of the bytes of a URL. The first request has been answered when it
 * returns. Texts in the options are copied. Begin `out` with EBPO_SOURCE_INIT;
 * close it by out->close, or hand it to ebpo_open_source.
 *
 * EBPO_E_IO: the server was not reached, refused, or gave wrong answers.
 * EBPO_E_UNSUPPORTED: it has no ranges and the file is too large, or the library
 * was built without HTTP. EBPO_E_ARGUMENT: no URL, options out of range, or a cache
 * folder that cannot be used. EBPO_E_CANCELLED, EBPO_E_MEMORY.
 *
 * Reading gives EBPO_E_IO and EBPO_E_CANCELLED. If the file on the server has
 * changed since it was opened, that is the answer to all reads.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_source_of_url(const char *url,
                                                      const ebpo_http_options *options,
                                                      ebpo_source *out, ebpo_error *error);

/*
 * ebpo_open with options.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_url(const char *url, const ebpo_http_options *options,
                                                 ebpo_file **out, ebpo_error *error);

/*
 * What went over the net. EBPO_E_ABSENT, and zeros, if the file was not opened by
 * its URL. EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_file_get_http_stats(const ebpo_file *file, ebpo_http_stats *out);

#ifdef __cplusplus
}
#endif
#endif
