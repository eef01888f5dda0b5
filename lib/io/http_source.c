/* Provides the source for a URL. Opening checks and copies the options; its first request returns
 * the file's size, version and first bytes (the head). Reads use the cache of ranges
 * (http_cache.c). If the server does not support ranges, it sends the whole file. In this case the
 * whole file stays in memory; a file above a size limit is refused. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "io/http_cache.h"
#include "io/byte_source.h"

enum { HEAD_BYTES = EBPO_HTTP_HEAD, CONNECTIONS_MAX = 32 };

/* A file on a server. */
typedef struct http_source {
    char *url;                        /* with user and password, if any */
    char shown_url[EBPO_SHOWN_BYTES]; /* for messages: without passwords */
    ebpo_http_options options;        /* owns its texts */
    ebpo_range_cache cache;           /* also contains the lock and the transfers */
    bool has_lock;                    /* the lock and the condition of `cache` exist */
    ebpo_http_version version;
    uint8_t *head; /* [head_bytes] the first bytes, or the whole file */
    uint64_t head_bytes;
} http_source;

/* --- options --- */

static bool copy_text(const char **text)
{
    char *copy = *text ? strdup(*text) : NULL;
    bool good = copy || !*text;
    *text = copy;
    return good;
}

static bool copy_headers(ebpo_http_options *o)
{
    const char *const *from = o->headers;
    size_t count = 0;
    o->headers = NULL;
    if (!from)
        return true;
    while (from[count])
        count++;
    const char **to = ebpo_alloc_zero(count + 1, sizeof *to);
    if (!to)
        return false;
    o->headers = to;
    for (size_t i = 0; i < count; i++) {
        to[i] = from[i];
        if (!copy_text(&to[i]))
            return false;
    }
    return true;
}

/* Replaces all texts by copies. After a failure, each text is a copy or NULL, so that
 * free_options can free all texts. */
static bool copy_options(ebpo_http_options *o)
{
    bool good = copy_text(&o->user);
    good = copy_text(&o->ca_file) && good;
    good = copy_text(&o->proxy) && good;
    good = copy_text(&o->user_agent) && good;
    good = copy_text(&o->cache_folder) && good;
    return copy_headers(o) && good;
}

static void free_options(ebpo_http_options *o)
{
    const char *texts[] = { o->user, o->ca_file, o->proxy, o->user_agent, o->cache_folder };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        free((char *)(uintptr_t)texts[i]);
    for (const char *const *h = o->headers; h && *h; h++)
        free((char *)(uintptr_t)*h);
    free((void *)(uintptr_t)o->headers);
}

/* Returns true for a single line "Name: value". A line break is refused, because it could inject
 * another header. */
static bool header_ok(const char *line)
{
    const char *colon = strchr(line, ':');
    for (const char *c = line; *c; c++)
        if ((unsigned char)*c < 0x20 && *c != '\t')
            return false;
    return colon && colon > line && !strchr(" \t", colon[-1]);
}

static ebpo_status check_options(const ebpo_http_options *o, const char *shown, ebpo_error *error)
{
    static const double most = 1e6; /* seconds; libcurl counts milliseconds in a long */
    if (!(o->connect_timeout > 0 && o->connect_timeout <= most) ||
        !(o->stall_timeout >= 1 && o->stall_timeout <= most) ||
        !(o->time_limit > 0 && o->time_limit <= most))
        return ebpo_fail_file(
            error, EBPO_E_ARGUMENT, shown,
            "a time-out must be above 0 (for stalls: at least 1) and at most 1000000 seconds");
    if (o->connections < 1 || o->connections > CONNECTIONS_MAX)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                              "%u connections at a time were requested; use 1 to %d",
                              o->connections, CONNECTIONS_MAX);
    if (o->cache_block &&
        (o->cache_block < EBPO_DISK_BLOCK_LEAST || o->cache_block > EBPO_HTTP_HEAD ||
         o->cache_block & (o->cache_block - 1)))
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                              "blocks of %u bytes in the cache folder were requested; use a power "
                              "of two from %d to %d, or 0",
                              o->cache_block, EBPO_DISK_BLOCK_LEAST, EBPO_HTTP_HEAD);
    for (const char *const *h = o->headers; h && *h; h++)
        if (!header_ok(*h))
            return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                                  "a header that is to be sent is not 'Name: value' on one line");
    return EBPO_OK;
}

/* --- reading --- */

static ebpo_status source_read(void *user, uint64_t offset, uint64_t size, void *data,
                               ebpo_error *error)
{
    http_source *s = user;
    uint8_t *to = data;
    if (offset < s->head_bytes) {
        uint64_t step = s->head_bytes - offset < size ? s->head_bytes - offset : size;
        memcpy(to, s->head + offset, (size_t)step);
        to += step;
        offset += step;
        size -= step;
    }
    return size ? ebpo_range_cache_read(&s->cache, offset, size, to, error) : EBPO_OK;
}

static void source_prefetch(void *user, const ebpo_range *ranges, size_t count)
{
    http_source *s = user;
    if (s->head_bytes < s->version.size)
        ebpo_range_cache_hint(&s->cache, ranges, count);
}

static void source_close(void *user)
{
    http_source *s = user;
    ebpo_transfers_free(s->cache.transfers);
    ebpo_range_cache_clear(&s->cache);
    ebpo_disk_close(s->cache.disk);
    if (s->has_lock) {
        pthread_mutex_destroy(&s->cache.lock);
        pthread_cond_destroy(&s->cache.done);
    }
    free_options(&s->options);
    free(s->head);
    free(s->url);
    free(s);
}

bool ebpo_source_http_stats(const ebpo_source *source, ebpo_http_stats *out)
{
    *out = (ebpo_http_stats)EBPO_HTTP_STATS_INIT;
    if (source->read != source_read)
        return false;
    http_source *s = source->user;
    pthread_mutex_lock(&s->cache.lock);
    ebpo_transfers_add_stats(s->cache.transfers, out);
    out->cache_hits = s->cache.disk_hits;
    out->cache_bytes = s->cache.disk_bytes;
    if (s->cache.disk)
        ebpo_disk_held(s->cache.disk, &out->cache_held, &out->cache_others);
    out->wait_seconds = s->cache.wait_seconds;
    pthread_mutex_unlock(&s->cache.lock);
    return true;
}

/* --- opening --- */

/* Sends a request and waits for its end. */
static ebpo_status request_range(http_source *s, ebpo_request *r, ebpo_error *error)
{
    pthread_mutex_lock(&s->cache.lock);
    double since = ebpo_seconds();
    ebpo_transfers_add(s->cache.transfers, r, true);
    while (!r->done)
        pthread_cond_wait(&s->cache.done, &s->cache.lock);
    s->cache.wait_seconds += ebpo_seconds() - since;
    pthread_mutex_unlock(&s->cache.lock);
    if (r->status != EBPO_OK && error)
        *error = r->error;
    return r->status;
}

/* Makes all later requests require the file's version. */
static void pin_version(http_source *s)
{
    pthread_mutex_lock(&s->cache.lock);
    ebpo_transfers_pin(s->cache.transfers, &s->version);
    pthread_mutex_unlock(&s->cache.lock);
}

/* Rejects an HTML or XML page. Servers send such a page with a success status if a login is
 * required. */
static ebpo_status check_type(const http_source *s, const ebpo_request *r, ebpo_error *error)
{
    static const char signature[] = "\211HDF", blanks[] = " \t\r\n\357\273\277";
    uint64_t at = 0;
    while (at < s->head_bytes && s->head[at] && strchr(blanks, s->head[at]))
        at++;
    bool is_page = at < s->head_bytes && s->head[at] == '<';
    if (!is_page && (!ebpo_http_response_is_text(r->type) ||
                     (s->head_bytes >= 4 && memcmp(s->head, signature, 4) == 0)))
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_IO, s->shown_url,
                          "the server returned %s, not a model; check the address, and whether the "
                          "server requires a login",
                          *r->type ? r->type : "a page of HTML or XML");
}

/* Reads the first bytes, the size and the version. A server that does not support ranges sends the
 * whole file. */
static ebpo_status read_head(http_source *s, ebpo_error *error)
{
    s->head = ebpo_alloc(HEAD_BYTES, 1);
    if (!s->head)
        return ebpo_fail_memory(error, HEAD_BYTES);
    ebpo_request r = { .size = HEAD_BYTES, .data = s->head, .first = true };
    ebpo_status status = request_range(s, &r, error);
    if (status != EBPO_OK) {
        free(r.whole);
        return status;
    }
    s->version = r.version;
    s->head_bytes = r.got;
    if (r.whole) {
        free(s->head);
        s->head = r.whole;
    }
    pin_version(s);
    return check_type(s, &r, error);
}

/* Reads the whole file with one request. This is necessary if the server sends neither ETag nor
 * Last-Modified, because then two responses may belong to different versions. */
static ebpo_status read_whole(http_source *s, ebpo_error *error)
{
    if (s->version.size > s->options.whole_limit)
        return ebpo_fail_file(
            error, EBPO_E_UNSUPPORTED, s->shown_url,
            "the server sends neither ETag nor Last-Modified, so a change of the file could not be "
            "noticed, and the file's %llu bytes are too many for one request; download the file, "
            "or read it with --http-unversioned",
            (unsigned long long)s->version.size);
    uint8_t *all = ebpo_alloc(s->version.size, 1);
    if (!all)
        return ebpo_fail_memory(error, s->version.size);
    free(s->head);
    s->head = all;
    s->head_bytes = s->version.size;
    ebpo_request r = { .size = s->version.size, .data = all };
    return request_range(s, &r, error);
}

static ebpo_status open_source(http_source *s, ebpo_error *error)
{
    const ebpo_http_options *o = &s->options;
    ebpo_status status = check_options(o, s->shown_url, error);
    if (status == EBPO_OK)
        status = ebpo_transfers_make(&s->cache.transfers, s->url, s->shown_url, o, &s->cache.lock,
                                     &s->cache.done, error);
    if (status == EBPO_OK)
        status = read_head(s, error);
    bool versioned = *s->version.etag || *s->version.modified;
    if (status == EBPO_OK && s->head_bytes < s->version.size && !versioned && !o->unversioned)
        status = read_whole(s, error);
    /* The folder is opened last, because the names of its blocks depend on the file's version. A
     * file without a version is not cached on disk, but the folder is opened also in this case, so
     * that an unusable folder is always reported. */
    s->cache.block = o->cache_block ? o->cache_block : EBPO_DISK_BLOCK;
    if (status == EBPO_OK && o->cache_folder)
        status = ebpo_disk_open(&s->cache.disk, o->cache_folder, o->cache_bytes, s->cache.block,
                                s->url, &s->version, error);
    if (status == EBPO_OK && !versioned) {
        ebpo_disk_close(s->cache.disk);
        s->cache.disk = NULL;
    }
    s->cache.begin = s->head_bytes;
    s->cache.size = s->version.size;
    s->cache.held_limit = o->memory;
    return status;
}

ebpo_status ebpo_source_of_url(const char *url, const ebpo_http_options *options, ebpo_source *out,
                               ebpo_error *error)
{
    ebpo_http_options wanted = EBPO_HTTP_OPTIONS_INIT;
    ebpo_source made = EBPO_SOURCE_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_source, out, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_http_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    EBPO_GIVE(ebpo_source, out, &made);
    if (!ebpo_is_url(url))
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, url, "is not a URL with http:// or https://");
    http_source *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    s->options = wanted;
    bool copied = copy_options(&s->options);
    s->url = strdup(url);
    ebpo_url_redact(url, s->shown_url, sizeof s->shown_url);
    s->has_lock = pthread_mutex_init(&s->cache.lock, NULL) == 0;
    if (s->has_lock && pthread_cond_init(&s->cache.done, NULL) != 0) {
        pthread_mutex_destroy(&s->cache.lock);
        s->has_lock = false;
    }
    status = copied && s->url && s->has_lock ? open_source(s, error)
                                             : ebpo_fail_memory(error, strlen(url));
    if (status != EBPO_OK) {
        source_close(s);
        return status;
    }
    made.user = s;
    made.size = s->version.size;
    made.read = source_read;
    made.close = source_close;
    made.prefetch = source_prefetch;
    made.prefetched = s->head_bytes;
    return EBPO_GIVE(ebpo_source, out, &made);
}
