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
 * for the first 128 KiB, which usually include levels 0 to 4. Data that is needed later is
 * prefetched in requests of up to 4 MiB, several at a time. If the server's first response names
 * nginx or Apache (Server), one request asks for up to 64 ranges.
 *
 * Every response is checked: its range, its size, and the version of the file, which must be equal
 * to the version at opening. The version consists of the file size and the ETag (weak or strong).
 * If there is no ETag, it consists of the file size and Last-Modified.
 *
 * If the library was built without libcurl, the functions return EBPO_E_UNSUPPORTED.
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

    /* Maximum time of name resolution, connection and TLS together, in seconds; above 0. */
    double connect_timeout;

    /*
     * Time in seconds, at least 1. A response that is slower than 100 bytes a second for this time
     * is aborted and requested again.
     */
    double stall_timeout;

    /*
     * Maximum time of one request with all its retries and pauses, in seconds; above 0. A read
     * takes at most this time.
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
     * Maximum memory in bytes for prefetched and recently read data. The maximum may be exceeded
     * while readers wait for responses, which have up to 4 MiB each. This memory is not part of a
     * model's budget.
     */
    uint64_t memory;

    /*
     * If the server does not support ranges or sends no version, a file of at most this many bytes
     * is read completely into memory.
     */
    uint64_t whole_limit;

    /*
     * True: the version is only the file size, so a change of the file may not be detected. Use
     * this for servers that send neither ETag nor Last-Modified, and for an address that several
     * servers with different ETags share.
     */
    bool unversioned;

    /* True: the library reads user names and passwords from ~/.netrc. */
    bool netrc;

    /* "name:password" for basic authentication. NULL: no basic authentication. */
    const char *user;

    /* Path of a file of trusted certificates (PEM). NULL: the certificates of the system. */
    const char *ca_file;

    /*
     * Proxy, as for CURLOPT_PROXY of libcurl. NULL: the proxy that the environment names
     * (http_proxy, https_proxy, no_proxy). "": no proxy.
     */
    const char *proxy;

    /* Value of the header User-Agent. NULL: libebpo/VERSION. */
    const char *user_agent;

    /*
     * Array of headers "Name: value", terminated by NULL, which are sent with every request. NULL:
     * no headers. They are not sent after a redirect to another host, port or scheme.
     */
    const char *const *headers;

    /*
     * Path of the cache folder, which keeps fetched bytes for later use. The folder and its parents
     * are made if missing. Any number of processes may share it. NULL: no cache folder.
     */
    const char *cache_folder;

    /* Maximum size of the cache folder in bytes. The least recently used blocks are removed. */
    uint64_t cache_bytes;

    /*
     * Function that another thread calls with `stop_user` about ten times a second. If it returns
     * true, current and later operations fail with EBPO_E_CANCELLED. NULL: operations are never
     * stopped.
     */
    bool (*stop)(void *user);
    void *stop_user;

    /*
     * Block size of the cache folder in bytes, a power of two from 4 KiB to 128 KiB; 0: 32 KiB.
     * Fetched ranges are extended to whole blocks. Smaller blocks reduce the transferred bytes and
     * increase the number of blocks. Blocks of another size that are in the folder are not used.
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
     * Number of bytes in the cache folder at opening. cache_held: bytes of this version of the
     * file. cache_others: bytes of other files and versions.
     */
    uint64_t cache_held, cache_others;

    /* Time that readers waited, in seconds, summed over threads. */
    double wait_seconds;
} ebpo_http_stats;

#define EBPO_HTTP_STATS_INIT EBPO_SIZED(ebpo_http_stats)

/*
 * Copies a URL to `out` for use in messages, without the user name, the password, and the text from
 * "?" on. A name that is not a URL is copied unchanged. The result is truncated to `space` bytes.
 * Returns `out`.
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
 * Sends the first request for a URL, and makes a source when the response has been received. Texts
 * of the options are copied. Initialize `out` with EBPO_SOURCE_INIT. Close the source by
 * out->close, or pass it to ebpo_open_source.
 *
 * EBPO_E_IO: the server was not reached, refused the request, or sent wrong responses.
 * EBPO_E_UNSUPPORTED: the server does not support ranges and the file is larger than whole_limit,
 * or the library was built without libcurl. EBPO_E_ARGUMENT: `url` is not a URL, an option is out
 * of range, or the cache folder cannot be used. EBPO_E_CANCELLED.
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
 * Gets statistics of network transfers. EBPO_E_ABSENT: the file was not opened by a URL; in this
 * case all members of `out` are 0.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_file_get_http_stats(const ebpo_file *file, ebpo_http_stats *out);

#ifdef __cplusplus
}
#endif
#endif
