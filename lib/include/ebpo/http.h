/* SPDX-License-Identifier: MIT
 * Reads files on web servers and object stores, by HTTP range requests.
 *
 *     ebpo_open("https://example.org/model.ebpo.h5", &file, &error);
 *
 * or with options:
 *
 *     ebpo_http_options options = EBPO_HTTP_OPTIONS_INIT;
 *     options.cache_folder = "/var/cache/models";
 *     ebpo_open_url("https://example.org/model.ebpo.h5", &options, &file, &error);
 *
 * The server must respond to "Range: bytes=a-b" with the status code 206. Opening takes one request
 * for the first 128 KiB, which usually include levels 0 to 4. Later data is fetched in advance in
 * requests of up to 4 MiB, several at a time.
 *
 * Every response is checked: its range, its size, and the version of the file, which must be the
 * version of the opened file. The version is the size with the ETag (weak or not) or, if there is
 * no ETag, with Last-Modified.
 *
 * Without libcurl the functions return EBPO_E_UNSUPPORTED.
 */
#ifndef EBPO_HTTP_H
#define EBPO_HTTP_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Options for URLs (ebpo_open_url, ebpo_source_of_url). */
typedef struct ebpo_http_options {
    size_t struct_size;

    /* Seconds for name resolution, connection and TLS together; above 0. */
    double connect_timeout;

    /*
     * Seconds, at least 1. A response slower than 100 bytes a second for this time is aborted and
     * requested again.
     */
    double stall_timeout;

    /*
     * Seconds for one request with all its retries and pauses; above 0. No single read takes longer
     * than this.
     */
    double time_limit;

    /*
     * Maximum number of retries of a request: after dropped connections, short bodies, stalls, and
     * the codes 408, 429, 500, 502, 503 and 504. Other failures are not retried.
     */
    unsigned retries;

    /*
     * Maximum number of requests at the same time, 1 to 32. At most six of them are for more than 1
     * MiB.
     */
    unsigned connections;

    /*
     * Memory limit in bytes for prefetched and recently read data. While readers wait for responses
     * of up to 4 MiB, the limit may be exceeded. This memory is not part of a model's budget.
     */
    uint64_t memory;

    /*
     * If the server does not support ranges or sends no version, a file of at most this many bytes
     * is read completely into memory.
     */
    uint64_t whole_limit;

    /*
     * True: only the size of the file is compared. For servers that send neither ETag nor
     * Last-Modified, and for addresses of several servers that send different ETags. A change
     * during reading may then not be detected.
     */
    bool unversioned;

    /* True: reads user names and passwords from ~/.netrc. */
    bool netrc;

    /* "name:password" for basic authentication, or NULL. */
    const char *user;

    /* Trusted certificates (PEM) instead of those of the system, or NULL. */
    const char *ca_file;

    /*
     * Proxy, as for CURLOPT_PROXY of libcurl. NULL: from the environment (http_proxy, https_proxy,
     * no_proxy). "": none.
     */
    const char *proxy;

    /* Header User-Agent. NULL: libebpo/VERSION. */
    const char *user_agent;

    /*
     * Headers "Name: value", an array terminated by NULL, sent with every request; or NULL. These
     * headers are not sent after a redirect to another host, port or scheme.
     */
    const char *const *headers;

    /*
     * Cache folder, which keeps fetched bytes for later use. The folder and its parents are made if
     * missing. Any number of processes may share it. NULL: none.
     */
    const char *cache_folder;

    /* Size limit of the cache folder in bytes. The least recently used blocks are removed first. */
    uint64_t cache_bytes;

    /*
     * Called with `stop_user` about ten times a second by another thread. If it returns true,
     * current and later operations fail with EBPO_E_CANCELLED. NULL: operations are never stopped.
     */
    bool (*stop)(void *user);
    void *stop_user;

    /*
     * Block size of the cache folder in bytes, a power of two from 4 KiB to 128 KiB; 0: 32 KiB.
     * Fetched ranges are rounded outward to whole blocks. Smaller blocks reduce the transferred
     * bytes and increase the number of blocks. Blocks of other sizes are not found.
     */
    unsigned cache_block;

    uint32_t reserved;
} ebpo_http_options;

#define EBPO_HTTP_OPTIONS_INIT                                                                   \
    {                                                                                            \
        sizeof(ebpo_http_options), 15, 20, 120, 5, 32, UINT64_C(48) << 20, UINT64_C(64) << 20,   \
            false, true, NULL, NULL, NULL, NULL, NULL, NULL, UINT64_C(1) << 30, NULL, NULL, 0, 0 \
    }

/* Statistics of network transfers since opening. */
typedef struct ebpo_http_stats {
    size_t struct_size;

    /* Number of requests sent, including retries and redirects. */
    uint64_t requests;

    /* Number of requests that were repeated after a failure. */
    uint64_t retries;

    /* Number of connections made. */
    uint64_t connections;

    /* Bytes received in the bodies of responses. */
    uint64_t bytes;

    /*
     * cache_hits: number of requests that the cache folder served completely. cache_bytes: bytes
     * served from the cache folder.
     */
    uint64_t cache_hits, cache_bytes;

    /*
     * Bytes in the cache folder at opening. cache_held: of this version of the file. cache_others:
     * of other files and versions.
     */
    uint64_t cache_held, cache_others;

    /* Seconds that readers waited, summed over threads. */
    double wait_seconds;
} ebpo_http_stats;

#define EBPO_HTTP_STATS_INIT EBPO_SIZED(ebpo_http_stats)

/*
 * Writes a URL for messages to `out`, without user name, password and the part from "?" on. Names
 * that are not URLs are unchanged. Truncates to `space` bytes. Returns `out`.
 *
 * Threads: any.
 */
EBPO_API char *ebpo_url_redact(const char *name, char *out, size_t space);

/*
 * Returns true for names that begin with http:// or https://.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_is_url(const char *name);

/*
 * Makes a source for a URL, after the first response was received. Texts of the options are copied.
 * Initialize `out` with EBPO_SOURCE_INIT. Close it by out->close, or pass it to ebpo_open_source.
 *
 * EBPO_E_IO: the server was not reached, refused the request, or sent wrong responses.
 * EBPO_E_UNSUPPORTED: the server does not support ranges and the file is too large, or the library
 * was built without HTTP. EBPO_E_ARGUMENT: not a URL, options out of range, or a cache folder that
 * cannot be used. EBPO_E_CANCELLED.
 *
 * Reading can return EBPO_E_IO and EBPO_E_CANCELLED. If the file on the server has changed since
 * opening, all reads fail.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_source_of_url(const char *url,
                                                      const ebpo_http_options *options,
                                                      ebpo_source *out, ebpo_error *error);

/*
 * Opens a URL as ebpo_open does, with options.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_url(const char *url, const ebpo_http_options *options,
                                                 ebpo_file **out, ebpo_error *error);

/*
 * Gets statistics of network transfers. EBPO_E_ABSENT: the file was not opened by its URL; the
 * statistics are zeros.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_file_get_http_stats(const ebpo_file *file, ebpo_http_stats *out);

#ifdef __cplusplus
}
#endif
#endif
