/* Sends requests for byte ranges through libcurl, which one thread drives. Requests wait in a
 * queue. A request is urgent if a reader waits for it; urgent requests are first in the queue. At
 * most EBPO_SLOTS_MAX requests run at once, each in a slot with a reusable handle of libcurl. A
 * response is judged by its head (http_response.c) before its body is accepted. If a body breaks
 * off, the received bytes are kept, and the next attempt requests the missing bytes, after a pause
 * that grows with each attempt. At most five redirects are followed, never from https to http, and
 * the caller's credentials are not sent to another server. The lock belongs to the caller
 * (http_transfer.h).
 *
 * Small requests share an attempt, which asks for several ranges (`Range: bytes=0-9,50-59`), if the
 * server names itself as a program that supports this. (Other servers, such as object stores, would
 * begin to send the whole file.) The first such attempt also asks for the first byte of the file.
 * After any other response than the requested parts, each range is requested alone. */
#include <curl/curl.h>
#include <errno.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/os.h"
#include "core/parallel.h"
#include "ebpo_config.h"
#include "io/http_response.h"
#include "io/http_transfer.h"

/* --- redirects: finds out when a redirect leads to another server --- */

/* The redirects of one attempt to send a request. All members are 0 if there was no redirect so
 * far. */
typedef struct ebpo_redirect {
    CURLU *at;      /* the latest address; NULL: the original address */
    char *target;   /* target that the current head names, or NULL */
    bool elsewhere; /* true: the latest scheme, host or port differs from the original, or is not
                       known */
} ebpo_redirect;

/* Clears the redirects, for another attempt or at the end. */
static void clear_redirect(ebpo_redirect *r)
{
    curl_url_cleanup(r->at);
    free(r->target);
    *r = (ebpo_redirect){ .at = NULL };
}

/* Returns true if both URLs have the same part, such as the host. */
static bool same_part(CURLU *a, CURLU *b, CURLUPart part)
{
    char *x = NULL, *y = NULL;
    bool same = curl_url_get(a, part, &x, CURLU_DEFAULT_PORT) == CURLUE_OK &&
                curl_url_get(b, part, &y, CURLU_DEFAULT_PORT) == CURLUE_OK && strcasecmp(x, y) == 0;
    curl_free(x);
    curl_free(y);
    return same;
}

static bool same_server(CURLU *a, CURLU *b)
{
    return same_part(a, b, CURLUPART_SCHEME) && same_part(a, b, CURLUPART_HOST) &&
           same_part(a, b, CURLUPART_PORT);
}

/* Moves r->at to r->target. Returns false if the target is on another server than `url`, or if the
 * server of the target is not known. */
static bool stays_on_server(ebpo_redirect *r, const char *url)
{
    CURLU *first = curl_url();
    if (!r->at) {
        r->at = curl_url();
        if (r->at && curl_url_set(r->at, CURLUPART_URL, url, 0) != CURLUE_OK)
            r->elsewhere = true;
    }
    /* the target may be relative to the latest address */
    bool stays = first && r->at && curl_url_set(first, CURLUPART_URL, url, 0) == CURLUE_OK &&
                 curl_url_set(r->at, CURLUPART_URL, r->target, CURLU_URLENCODE) == CURLUE_OK &&
                 same_server(first, r->at);
    curl_url_cleanup(first);
    return stays;
}

/* Stores the target of a redirect, without surrounding blanks. */
static void keep_target(ebpo_redirect *r, const char *from, size_t size)
{
    while (size && (*from == ' ' || *from == '\t')) {
        from++;
        size--;
    }
    while (size && strchr(" \t\r\n", from[size - 1]))
        size--;
    free(r->target);
    r->target = strndup(from, size);
    r->elsewhere = r->elsewhere || !r->target;
}

/* Reads one line of a head, as the server sent it. `code`: status of the response. Returns true if
 * this line redirects the request to another server, and the request was on the original server
 * before. */
static bool take_redirect_line(ebpo_redirect *r, const char *url, int code, const char *line,
                               size_t size)
{
    static const char name[] = "location:";
    bool is_last = size <= 2 && (size == 0 || line[0] == '\r' || line[0] == '\n'),
         was_elsewhere = r->elsewhere;
    if (size >= sizeof name && strncasecmp(line, name, sizeof name - 1) == 0)
        keep_target(r, line + sizeof name - 1, size - (sizeof name - 1));
    if (!is_last || !r->target)
        return r->elsewhere && !was_elsewhere;
    if (code / 100 == 3 && !stays_on_server(r, url))
        r->elsewhere = true;
    free(r->target);
    r->target = NULL;
    return r->elsewhere && !was_elsewhere;
}

/* --- slots for running requests --- */

enum { EBPO_SLOTS_MAX = 32 };

enum {
    JOINED_MAX = 64,           /* most requests that share an attempt */
    JOINED_BYTES = 128 << 10,  /* most bytes of these requests */
    PART_OVERHEAD_BYTES = 1024 /* most bytes between two parts, on average */
};

typedef struct ebpo_transfers ebpo_transfers;

/* A slot for running requests, with a reusable handle. */
typedef struct ebpo_slot {
    ebpo_transfers *owner;
    CURL *easy;
    ebpo_request *request;    /* NULL: free; else the first of a list, by offset */
    ebpo_http_version pinned; /* the required version, copied for this attempt */
    bool is_pinned;
    ebpo_http_response response;
    ebpo_redirect redirect;
    bool joined;      /* the attempt asks for several ranges */
    double variation; /* of the pause after the attempt, 0 to 1 */
    /* has_verdict: `verdict` is set. stopped: a callback below has ended the transfer. stalled:
     * check_stall has ended the transfer, because no bytes arrived */
    bool has_verdict, stopped, stalled;
    bool sent;    /* connected, and the request was sent */
    double moved; /* time when the last bytes arrived */
    ebpo_verdict verdict;
    ebpo_status status;
    char why[EBPO_WHY_BYTES];
    uint64_t begin, end;                /* range of this attempt */
    uint64_t received, taken, unwanted; /* bytes of the body: all, accepted, ignored */
    /* of several ranges: the head of the current part, its request, and its missing bytes */
    ebpo_part_head head;
    ebpo_request *part;
    uint64_t part_left, between; /* between: bytes that are not part of a range */
    ebpo_request extra;          /* of the first byte of the file */
    uint8_t first_byte;
    char trouble[CURL_ERROR_SIZE]; /* libcurl's error message */
} ebpo_slot;

struct ebpo_transfers {
    const char *url, *shown; /* shown: the URL for messages, without login data */
    const ebpo_http_options *options;
    pthread_mutex_t *lock;
    pthread_cond_t *done; /* signalled when a request ends */
    CURLM *multi;
    struct curl_slist *headers, *bare_headers; /* bare_headers: without the caller's headers */
    pthread_t thread;
    bool running; /* the thread was started */
    ebpo_slot slots[EBPO_SLOTS_MAX];
    unsigned slot_count, active; /* usable slots; slots with a request */
    /* protected by the lock */
    bool quit, cancelled;
    ebpo_request *queue; /* urgent requests first */
    ebpo_http_version pinned;
    bool is_pinned;
    enum {
        JOINING_FAILS,    /* each attempt is for one range */
        JOINING_EXPECTED, /* by the name of the server */
        JOINING_WORKS
    } joining;
    ebpo_http_stats stats;
    uint64_t random; /* state of random numbers, used only by the thread */
};

enum {
    REDIRECTS_MAX = 5,
    STALL_BYTES = 100, /* libcurl reports a stall below this number of bytes per second */
    /* an unwanted body up to this size is read to its end, so that the connection can be used again
     */
    DRAIN_BYTES = 65536
};

/* --- callbacks of libcurl --- */

/* Called by libcurl about ten times a second during a request. Returns 1 to stop the request if no
 * bytes have arrived for stall_timeout seconds, else 0. libcurl's own test for stalls is less
 * exact, because it uses the average speed of several seconds. */
static int check_stall(void *user, curl_off_t total, curl_off_t done, curl_off_t upload_total,
                       curl_off_t uploaded)
{
    ebpo_slot *s = user;
    curl_off_t connected = 0;
    double now = ebpo_seconds();
    (void)total;
    (void)done;
    (void)upload_total;
    (void)uploaded;
    if (!s->sent &&
        curl_easy_getinfo(s->easy, CURLINFO_PRETRANSFER_TIME_T, &connected) == CURLE_OK &&
        connected > 0) {
        s->sent = true;
        s->moved = now;
    }
    s->stalled = s->sent && now - s->moved > s->owner->options->stall_timeout;
    return s->stalled;
}

/* Called by libcurl with each line of the head. Returns 0 to end the transfer, otherwise the number
 * of bytes. */
static size_t receive_header(char *line, size_t size, size_t count, void *user)
{
    ebpo_slot *s = user;
    s->moved = ebpo_seconds();
    ebpo_http_response_line(&s->response, line, size * count);
    /* the caller's headers are for the original server only, but libcurl would send them to any
     * server */
    if (take_redirect_line(&s->redirect, s->owner->url, s->response.code, line, size * count))
        curl_easy_setopt(s->easy, CURLOPT_HTTPHEADER, s->owner->bare_headers);
    if (s->response.header_bytes <= EBPO_HTTP_HEADERS_MAX)
        return size * count;
    s->has_verdict = true;
    s->stopped = true;
    s->verdict = EBPO_HTTP_REFUSED;
    s->status = EBPO_E_IO;
    strcpy(s->why, "the head of the server's response is too long; this server is broken");
    return 0;
}

/* Judges the response by its head. Further calls for the same attempt do nothing. */
static void judge_slot(ebpo_slot *s)
{
    ebpo_http_request http_request = { s->begin,
                                       s->end,
                                       s->is_pinned ? &s->pinned : NULL,
                                       s->owner->options->whole_limit,
                                       s->owner->options->unversioned,
                                       s->joined };
    if (!s->has_verdict)
        s->verdict = ebpo_http_response_judge(&s->response, &http_request, &s->status, s->why);
    s->has_verdict = true;
}

/* Ends the transfer with an error. Returns 0, which receive_body returns to stop libcurl. */
static size_t refuse_body(ebpo_slot *s, ebpo_status status, const char *why)
{
    s->verdict = EBPO_HTTP_REFUSED;
    s->status = status;
    s->stopped = true;
    snprintf(s->why, sizeof s->why, "%s", why);
    return 0;
}

/* Stores bytes of the requested range. Returns `size`, or 0 after an error. */
static size_t receive_part(ebpo_slot *s, const char *bytes, size_t size)
{
    uint64_t capacity = s->response.last + 1 - s->begin - s->taken;
    if (size > capacity)
        return refuse_body(
            s, EBPO_E_IO,
            "the server sent more bytes than its Content-Range states; this server or a proxy on "
            "the way is broken");
    memcpy(s->request->data + (s->begin - s->request->offset) + s->taken, bytes, size);
    s->taken += size;
    return size;
}

/* Begins the part whose head is complete. Returns false if no request needs this part next. */
static bool begin_part(ebpo_slot *s)
{
    const ebpo_http_response *head = &s->head.response;
    ebpo_status status;
    char why[EBPO_WHY_BYTES];
    ebpo_request *r = s->request;
    while (r && (r->got == r->size || r->offset + r->got != head->begin))
        r = r->next;
    if (!r)
        return false;
    ebpo_http_request wanted = { .begin = r->offset + r->got,
                                 .end = r->offset + r->size,
                                 .pinned = &s->pinned,
                                 .unversioned = s->owner->options->unversioned };
    s->part = r;
    s->part_left = head->last - head->begin + 1;
    return ebpo_http_response_judge(head, &wanted, &status, why) == EBPO_HTTP_PART;
}

/* Stores bytes of several ranges. Returns `size`, or 0 if the body has other parts. */
static size_t receive_parts(ebpo_slot *s, const char *bytes, size_t size)
{
    for (size_t at = 0, step; at < size; at += step) {
        bool complete = false;
        step = size - at < s->part_left ? size - at : (size_t)s->part_left;
        if (step) {
            memcpy(s->part->data + s->part->got, bytes + at, step);
            s->part->got += step;
            s->part_left -= step;
            continue;
        }
        step = ebpo_part_head_take(&s->head, &s->response, bytes + at, size - at, &complete);
        s->between += step;
        s->stopped = step == 0 || s->between > (JOINED_MAX + 1) * PART_OVERHEAD_BYTES ||
                     (complete && !begin_part(s));
        if (s->stopped) {
            s->verdict = EBPO_HTTP_SINGLY;
            return 0;
        }
    }
    return size;
}

/* Stores bytes of the whole file. Returns `size`, or 0 after an error. */
static size_t receive_whole(ebpo_slot *s, const char *bytes, size_t size)
{
    ebpo_request *r = s->request;
    if (s->taken + size > s->owner->options->whole_limit)
        return refuse_body(
            s, EBPO_E_UNSUPPORTED,
            "the server does not support byte ranges, and the file is larger than the limit for "
            "whole files; download the file, or use a server with ranges");
    if (!ebpo_grow(&r->whole, &r->whole_capacity, s->taken + size, 1))
        return refuse_body(s, EBPO_E_MEMORY, "out of memory");
    memcpy(r->whole + s->taken, bytes, size);
    s->taken += size;
    return size;
}

/* Called by libcurl with bytes of the body. Returns 0 to end the transfer, otherwise the number of
 * bytes. */
static size_t receive_body(char *bytes, size_t size, size_t count, void *user)
{
    ebpo_slot *s = user;
    size *= count;
    s->moved = ebpo_seconds();
    judge_slot(s);
    s->received += size;
    if (s->verdict == EBPO_HTTP_PART)
        return receive_part(s, bytes, size);
    if (s->verdict == EBPO_HTTP_WHOLE)
        return receive_whole(s, bytes, size);
    if (s->verdict == EBPO_HTTP_PARTS)
        return receive_parts(s, bytes, size);
    s->unwanted += size;
    s->stopped = s->unwanted > DRAIN_BYTES || s->verdict == EBPO_HTTP_REFUSED ||
                 s->verdict == EBPO_HTTP_SINGLY;
    return s->stopped ? 0 : size;
}

/* --- setting up slots --- */

static bool is_https(const char *url) { return url[4] == 's' || url[4] == 'S'; }

/* Sets the options that are the same for all requests. The url, options and headers of s->owner
 * must be set. */
static bool set_up_slot(ebpo_slot *s)
{
    const ebpo_transfers *t = s->owner;
    const ebpo_http_options *o = t->options;
    CURL *e = s->easy;
    bool good = curl_easy_setopt(e, CURLOPT_URL, t->url) == CURLE_OK &&
                curl_easy_setopt(e, CURLOPT_HTTPHEADER, t->headers) == CURLE_OK;
#if LIBCURL_VERSION_NUM >= 0x075500
    good = good && curl_easy_setopt(e, CURLOPT_PROTOCOLS_STR, "http,https") == CURLE_OK;
    good = good && curl_easy_setopt(e, CURLOPT_REDIR_PROTOCOLS_STR,
                                    is_https(t->url) ? "https" : "http,https") == CURLE_OK;
#else
    good = good &&
           curl_easy_setopt(e, CURLOPT_PROTOCOLS, CURLPROTO_HTTP | CURLPROTO_HTTPS) == CURLE_OK;
    good =
        good && curl_easy_setopt(e, CURLOPT_REDIR_PROTOCOLS,
                                 is_https(t->url) ? CURLPROTO_HTTPS
                                                  : CURLPROTO_HTTP | CURLPROTO_HTTPS) == CURLE_OK;
#endif
    curl_easy_setopt(e, CURLOPT_FOLLOWLOCATION, 1L);
    curl_easy_setopt(e, CURLOPT_MAXREDIRS, (long)REDIRECTS_MAX);
    curl_easy_setopt(e, CURLOPT_HTTP_VERSION, (long)CURL_HTTP_VERSION_2TLS);
    curl_easy_setopt(e, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(e, CURLOPT_SUPPRESS_CONNECT_HEADERS, 1L);
    curl_easy_setopt(e, CURLOPT_TCP_KEEPALIVE, 1L);
    curl_easy_setopt(e, CURLOPT_BUFFERSIZE, 262144L);
    curl_easy_setopt(e, CURLOPT_CONNECTTIMEOUT_MS, (long)(o->connect_timeout * 1000) + 1);
    curl_easy_setopt(e, CURLOPT_LOW_SPEED_LIMIT, (long)STALL_BYTES);
    curl_easy_setopt(e, CURLOPT_LOW_SPEED_TIME, (long)(o->stall_timeout + 0.999));
    curl_easy_setopt(e, CURLOPT_NETRC, (long)(o->netrc ? CURL_NETRC_OPTIONAL : CURL_NETRC_IGNORED));
    good = good &&
           curl_easy_setopt(e, CURLOPT_USERAGENT,
                            o->user_agent ? o->user_agent : "libebpo/" EBPO_VERSION) == CURLE_OK;
    good = good && (!o->user || curl_easy_setopt(e, CURLOPT_USERPWD, o->user) == CURLE_OK);
    good = good && (!o->ca_file || curl_easy_setopt(e, CURLOPT_CAINFO, o->ca_file) == CURLE_OK);
    good = good && (!o->proxy || curl_easy_setopt(e, CURLOPT_PROXY, o->proxy) == CURLE_OK);
    curl_easy_setopt(e, CURLOPT_NOPROGRESS, 0L);
    curl_easy_setopt(e, CURLOPT_XFERINFOFUNCTION, check_stall);
    curl_easy_setopt(e, CURLOPT_XFERINFODATA, s);
    curl_easy_setopt(e, CURLOPT_ERRORBUFFER, s->trouble);
    curl_easy_setopt(e, CURLOPT_HEADERFUNCTION, receive_header);
    curl_easy_setopt(e, CURLOPT_HEADERDATA, s);
    curl_easy_setopt(e, CURLOPT_WRITEFUNCTION, receive_body);
    curl_easy_setopt(e, CURLOPT_WRITEDATA, s);
    curl_easy_setopt(e, CURLOPT_PRIVATE, s);
    return good;
}

enum {
    CHECK_MS = 100, /* milliseconds between checks of `stop`, and between checks for stalls */
    IDLE_MS = 60000 /* greatest waiting time without running requests */
};
static const double PAUSE_FIRST = 0.2, PAUSE_MAX = 8, PAUSE_BY_SERVER_MAX = 60; /* seconds */

static pthread_once_t curl_once = PTHREAD_ONCE_INIT;
static CURLcode curl_state;

static void start_curl(void) { curl_state = curl_global_init(CURL_GLOBAL_DEFAULT); }

/* --- setting up transfers --- */

static bool add_header(struct curl_slist **list, const char *text)
{
    struct curl_slist *more = curl_slist_append(*list, text);
    if (more)
        *list = more;
    return more != NULL;
}

static void *drive_transfers(void *transfers);

static bool set_up_transfers(ebpo_transfers *t)
{
    bool good = add_header(&t->headers, "Accept-Encoding: identity") &&
                add_header(&t->bare_headers, "Accept-Encoding: identity");
    for (const char *const *h = t->options->headers; h && *h; h++)
        good = good && add_header(&t->headers, *h);
    t->multi = curl_multi_init();
    if (!t->multi || !good)
        return false;
    curl_multi_setopt(t->multi, CURLMOPT_MAX_HOST_CONNECTIONS, (long)t->slot_count);
    curl_multi_setopt(t->multi, CURLMOPT_MAXCONNECTS, (long)t->slot_count);
    for (unsigned i = 0; i < t->slot_count; i++) {
        t->slots[i].owner = t;
        t->slots[i].easy = curl_easy_init();
        if (!t->slots[i].easy || !set_up_slot(&t->slots[i]))
            return false;
    }
    t->running = ebpo_thread_start(&t->thread, drive_transfers, t) == 0;
    return t->running;
}

ebpo_status ebpo_transfers_make(ebpo_transfers **out, const char *url, const char *shown,
                                const ebpo_http_options *options, pthread_mutex_t *lock,
                                pthread_cond_t *done, ebpo_error *error)
{
    *out = NULL;
    pthread_once(&curl_once, start_curl);
    if (curl_state != CURLE_OK)
        return ebpo_fail_file(error, EBPO_E_IO, shown, "libcurl cannot be started: %s",
                              curl_easy_strerror(curl_state));
    ebpo_transfers *t = ebpo_alloc_zero(1, sizeof *t);
    if (!t)
        return ebpo_fail_memory(error, sizeof *t);
    t->url = url;
    t->shown = shown;
    t->options = options;
    t->lock = lock;
    t->done = done;
    t->slot_count = options->connections < EBPO_SLOTS_MAX ? options->connections : EBPO_SLOTS_MAX;
    t->random = (uint64_t)(ebpo_seconds() * 1e9) ^ (uint64_t)(uintptr_t)t;
    if (set_up_transfers(t)) {
        *out = t;
        return EBPO_OK;
    }
    ebpo_transfers_free(t);
    return ebpo_fail_file(
        error, EBPO_E_IO, shown,
        "libcurl cannot be set up: memory or threads are short, or options are not supported");
}

void ebpo_transfers_free(ebpo_transfers *t)
{
    if (!t)
        return;
    if (t->running) {
        pthread_mutex_lock(t->lock);
        t->quit = true;
        pthread_mutex_unlock(t->lock);
        curl_multi_wakeup(t->multi);
        pthread_join(t->thread, NULL);
    }
    for (unsigned i = 0; i < t->slot_count; i++) {
        if (t->slots[i].request)
            curl_multi_remove_handle(t->multi, t->slots[i].easy);
        curl_easy_cleanup(t->slots[i].easy);
        clear_redirect(&t->slots[i].redirect);
    }
    if (t->multi)
        curl_multi_cleanup(t->multi);
    curl_slist_free_all(t->headers);
    curl_slist_free_all(t->bare_headers);
    free(t);
}

/* --- the queue; callers hold the lock --- */

/* Adds a request to the queue. An urgent request (one with a deadline) is added behind all urgent
 * requests, another request at the end. */
static void enqueue_request(ebpo_transfers *t, ebpo_request *r)
{
    ebpo_request **at = &t->queue;
    if (r->deadline > 0)
        while (*at && (*at)->deadline > 0)
            at = &(*at)->next;
    else
        while (*at)
            at = &(*at)->next;
    r->next = *at;
    *at = r;
}

/* Removes a request from the queue. Returns false if the request is not in the queue. */
static bool dequeue_request(ebpo_transfers *t, ebpo_request *r)
{
    for (ebpo_request **at = &t->queue; *at; at = &(*at)->next)
        if (*at == r) {
            *at = r->next;
            return true;
        }
    return false;
}

void ebpo_transfers_add(ebpo_transfers *t, ebpo_request *r, bool urgent)
{
    if (urgent)
        r->deadline = ebpo_seconds() + t->options->time_limit;
    enqueue_request(t, r);
    curl_multi_wakeup(t->multi);
}

void ebpo_transfers_urge(ebpo_transfers *t, ebpo_request *r)
{
    if (r->deadline > 0)
        return;
    r->deadline = ebpo_seconds() + t->options->time_limit;
    if (dequeue_request(t, r))
        enqueue_request(t, r);
    curl_multi_wakeup(t->multi);
}

void ebpo_transfers_pin(ebpo_transfers *t, const ebpo_http_version *version)
{
    t->pinned = *version;
    t->is_pinned = true;
}

bool ebpo_transfers_joins(const ebpo_transfers *t) { return t->joining == JOINING_WORKS; }

void ebpo_transfers_add_stats(const ebpo_transfers *t, ebpo_http_stats *stats)
{
    stats->requests += t->stats.requests;
    stats->retries += t->stats.retries;
    stats->connections += t->stats.connections;
    stats->bytes += t->stats.bytes;
}

/* Ends a request. `why`: text of the error, if `status` is not EBPO_OK. */
static void finish_request(ebpo_transfers *t, ebpo_request *r, ebpo_status status, const char *why)
{
    r->status = status;
    if (status != EBPO_OK)
        ebpo_fail_file(&r->error, status, t->shown, "%s", why);
    r->done = true;
    pthread_cond_broadcast(t->done);
}

/* --- attempts; only the thread calls the functions below --- */

/* Returns the seconds until the next attempt. The pause doubles with each failure. It is varied at
 * random, so that many readers do not repeat their requests at the same time, but equal for
 * requests that shared an attempt, so that they can share the next one. If the server requires a
 * longer pause, returns the server's pause, and *by_server is true. */
static double pause_after(const ebpo_slot *s, bool *by_server)
{
    curl_off_t retry_after = 0;
    double pause = PAUSE_FIRST;
    for (unsigned i = 1; i < s->request->failures && pause < PAUSE_MAX; i++)
        pause *= 2;
    pause = (pause < PAUSE_MAX ? pause : PAUSE_MAX) * (0.5 + 0.5 * s->variation);
    if (s->has_verdict && s->verdict == EBPO_HTTP_LATER)
        curl_easy_getinfo(s->easy, CURLINFO_RETRY_AFTER, &retry_after);
    *by_server = (double)retry_after > pause;
    return *by_server ? (double)retry_after : pause;
}

/* Returns true if the bytes of a further response may complete the received bytes. Returns false if
 * the file's version is not known, because the two responses might be of different versions. */
static bool may_join(const ebpo_transfers *t, const ebpo_request *r)
{
    const ebpo_http_version *v = r->first ? &r->version : &t->pinned;
    return *v->etag || *v->modified || t->options->unversioned;
}

/* Returns true if a request may share an attempt with others. After two failures, it may not.
 * Neither may it late in its time limit, because the attempt ends with the first limit of its
 * requests. */
static bool can_share(const ebpo_transfers *t, const ebpo_request *r, double now)
{
    bool late = r->deadline > 0 && r->deadline - now < t->options->time_limit / 2;
    return t->joining != JOINING_FAILS && t->is_pinned && may_join(t, r) && r->failures < 2 &&
           !r->got && r->due <= now && !late;
}

/* The caller holds the lock. Moves requests from the queue to the attempt of the request r. Their
 * offsets ascend, as some servers demand. */
static void join_requests(ebpo_transfers *t, ebpo_request *r, double now)
{
    ebpo_request *last = r;
    uint64_t bytes = r->size;
    unsigned count = 1;
    r->next = NULL;
    for (ebpo_request **at = &t->queue; can_share(t, r, now) && *at && count < JOINED_MAX;) {
        ebpo_request *q = *at;
        if (!can_share(t, q, now) || q->offset < last->offset + last->size ||
            bytes + q->size > JOINED_BYTES) {
            at = &q->next;
            continue;
        }
        *at = q->next;
        q->next = NULL;
        last = last->next = q;
        bytes += q->size;
        count++;
    }
}

/* Writes the ranges of a list of requests for the header field Range. */
static void write_ranges(const ebpo_request *r, char *range, size_t capacity)
{
    size_t length = 0;
    for (const char *comma = ""; r; r = r->next, comma = ",") {
        snprintf(range + length, capacity - length, "%s%" PRIu64 "-%" PRIu64, comma,
                 r->offset + (r->whole ? 0 : r->got), r->offset + r->size - 1);
        length += strlen(range + length);
    }
}

/* Prepares a slot for the next attempt of a request, or of a list of requests. The attempt requests
 * only the bytes that are still missing. */
static void begin_attempt(ebpo_transfers *t, ebpo_slot *s, ebpo_request *r, double now)
{
    char range[(JOINED_MAX + 1) * 42];
    bool has_version = r->first && r->got > 0;
    s->request = r;
    s->is_pinned = t->is_pinned || has_version;
    s->pinned = has_version ? r->version : t->pinned;
    s->response = (ebpo_http_response){ .code = 0 };
    s->has_verdict = s->stopped = s->stalled = s->sent = false;
    s->status = EBPO_E_IO;
    s->why[0] = s->trouble[0] = 0;
    s->begin = r->offset + (r->whole ? 0 : r->got);
    s->end = r->offset + r->size;
    s->received = s->taken = s->unwanted = s->part_left = s->between = 0;
    s->head = (ebpo_part_head){ .in_head = false };
    double deadline = now + t->options->time_limit;
    for (ebpo_request *q = r; q; q = q->next) {
        if (q->deadline <= 0)
            q->deadline = now + t->options->time_limit;
        deadline = q->deadline < deadline ? q->deadline : deadline;
    }
    double remaining_ms = (deadline - now) * 1000;
    if (t->joining == JOINING_EXPECTED && can_share(t, r, now)) {
        s->extra = (ebpo_request){ .size = 1, .data = &s->first_byte, .next = r };
        s->request = &s->extra;
    }
    s->joined = s->request->next != NULL;
    s->variation = ebpo_random_unit(ebpo_random_next(&t->random));
    write_ranges(s->request, range, sizeof range);
    curl_easy_setopt(s->easy, CURLOPT_RANGE, range);
    if (s->redirect.at || s->redirect.elsewhere) /* the previous attempt was redirected */
        curl_easy_setopt(s->easy, CURLOPT_HTTPHEADER, t->headers);
    clear_redirect(&s->redirect);
    curl_easy_setopt(s->easy, CURLOPT_TIMEOUT_MS, (long)(remaining_ms > 1 ? remaining_ms : 1));
    t->stats.requests++;
    t->stats.retries += r->failures > 0;
    t->active++;
}

/* Returns true for errors after which the same request may succeed. */
static bool is_temporary(CURLcode code)
{
    switch (code) {
    case CURLE_COULDNT_RESOLVE_HOST:
    case CURLE_COULDNT_RESOLVE_PROXY:
    case CURLE_COULDNT_CONNECT:
    case CURLE_OPERATION_TIMEDOUT:
    case CURLE_SEND_ERROR:
    case CURLE_RECV_ERROR:
    case CURLE_GOT_NOTHING:
    case CURLE_PARTIAL_FILE:
    case CURLE_HTTP2:
    case CURLE_HTTP2_STREAM:
    case CURLE_SSL_CONNECT_ERROR:
    case CURLE_AGAIN: return true;
    default: return false;
    }
}

/* Records the received bytes in the request, so that the next attempt requests only the missing
 * bytes. Returns true if the request is complete. */
static bool keep_arrived(ebpo_slot *s, CURLcode code)
{
    ebpo_request *r = s->request;
    memcpy(r->type, s->response.type, sizeof r->type);
    if (s->verdict == EBPO_HTTP_WHOLE) {
        if (code == CURLE_OK) {
            r->version = (ebpo_http_version){ .size = s->taken };
            r->got = s->taken;
        }
        return code == CURLE_OK;
    }
    if (r->first) {
        s->owner->joining = s->response.joins ? JOINING_EXPECTED : JOINING_FAILS;
        r->version.size = s->response.total;
        if (s->response.total < r->offset + r->size)
            r->size = s->response.total - r->offset;
        memcpy(r->version.etag, s->response.etag, sizeof r->version.etag);
        memcpy(r->version.modified, s->response.modified, sizeof r->version.modified);
    }
    free(r->whole); /* data of an earlier response that began to send the whole file */
    r->whole = NULL;
    r->whole_capacity = 0;
    r->got = s->begin - r->offset + s->taken;
    return r->got == r->size;
}

/* Returns the text of libcurl's error. If a header line is too long, libcurl also reports a lack of
 * memory. */
static const char *error_text(const ebpo_slot *s, CURLcode code)
{
    if (code == CURLE_OUT_OF_MEMORY && !s->received)
        return "the head of the server's response, such as the address of a redirect, is too "
               "long for libcurl, or memory is short; check the address";
    return *s->trouble ? s->trouble : curl_easy_strerror(code);
}

static void describe_error(const ebpo_slot *s, CURLcode code, char *out, size_t capacity)
{
    const char *trouble = error_text(s, code);
    if (s->has_verdict && s->verdict == EBPO_HTTP_LATER)
        snprintf(out, capacity, "%s", s->why);
    else if (s->stalled)
        snprintf(out, capacity, "the server sent nothing for %g s",
                 s->owner->options->stall_timeout);
    else if (code == CURLE_OK)
        snprintf(out, capacity, "the server sent %" PRIu64 " bytes of %" PRIu64, s->taken,
                 s->end - s->begin);
    else
        snprintf(out, capacity, "%s", trouble);
}

/* Schedules another attempt, or ends the request. */
static void try_again(ebpo_transfers *t, ebpo_slot *s, CURLcode code, double now)
{
    ebpo_request *r = s->request;
    char what[CURL_ERROR_SIZE], why[CURL_ERROR_SIZE + 160];
    if (code == CURLE_OK && s->has_verdict && s->verdict == EBPO_HTTP_PART && s->taken &&
        s->taken == s->response.last - s->response.begin + 1 && may_join(t, r) &&
        now < r->deadline) {
        r->due = now; /* the server sent a smaller part than requested; this does not count as a
                         failure */
        enqueue_request(t, r);
        return;
    }
    describe_error(s, code, what, sizeof what);
    r->failures++;
    bool by_server;
    double pause = pause_after(s, &by_server);
    if (now >= r->deadline - 0.01 || (!by_server && now + pause >= r->deadline))
        snprintf(why, sizeof why,
                 "bytes %" PRIu64 " to %" PRIu64
                 " were not read within %g s (%s); try again later, or use a longer time limit",
                 r->offset, r->offset + r->size - 1, t->options->time_limit, what);
    else if (r->failures > t->options->retries)
        snprintf(why, sizeof why,
                 "bytes %" PRIu64 " to %" PRIu64
                 ": %s; given up after %u attempt%s; try again later",
                 r->offset, r->offset + r->size - 1, what, r->failures,
                 r->failures == 1 ? "" : "s");
    else if (pause > PAUSE_BY_SERVER_MAX || now + pause >= r->deadline)
        snprintf(why, sizeof why,
                 "bytes %" PRIu64 " to %" PRIu64
                 ": %s and requires a pause of %.0f s; try again after this pause",
                 r->offset, r->offset + r->size - 1, what, pause);
    else {
        if (!may_join(t, r))
            r->got = 0;
        r->due = now + pause;
        enqueue_request(t, r);
        return;
    }
    finish_request(t, r, EBPO_E_IO, why);
}

/* Ends an attempt for the request s->request: finishes the request, or schedules another attempt.
 * `code`: libcurl's result. */
static void end_request(ebpo_transfers *t, ebpo_slot *s, CURLcode code, double now)
{
    ebpo_request *r = s->request;
    bool usable = s->has_verdict && !s->stopped &&
                  (s->verdict == EBPO_HTTP_PART || s->verdict == EBPO_HTTP_WHOLE);
    if (s->has_verdict && s->verdict == EBPO_HTTP_REFUSED) {
        finish_request(t, r, s->status, s->why);
        if (s->response.code == 404 || s->response.code == 410)
            r->error.system_error = ENOENT;
    } else if (s->joined ? r->got == r->size : usable && keep_arrived(s, code)) {
        finish_request(t, r, EBPO_OK, NULL);
    } else if (s->has_verdict && s->verdict == EBPO_HTTP_SINGLY) {
        r->got = 0;
        enqueue_request(t, r);
    } else if (code == CURLE_OK || s->stalled || is_temporary(code) ||
               (s->has_verdict && s->verdict == EBPO_HTTP_LATER)) {
        try_again(t, s, code, now);
    } else {
        finish_request(t, r, EBPO_E_IO, error_text(s, code));
    }
}

/* Sets t->joining after an attempt for several ranges. If parts are missing although the response
 * is complete, the verdict becomes EBPO_HTTP_SINGLY. */
static void judge_joining(ebpo_transfers *t, ebpo_slot *s, CURLcode code)
{
    bool parts = s->has_verdict && s->verdict == EBPO_HTTP_PARTS;
    const ebpo_request *r = s->request;
    while (r && r->got == r->size)
        r = r->next;
    if (parts && r && code == CURLE_OK) {
        s->verdict = EBPO_HTTP_SINGLY;
        parts = false;
    }
    bool refused = s->has_verdict && s->verdict == EBPO_HTTP_SINGLY;
    if (parts && t->joining == JOINING_EXPECTED)
        t->joining = JOINING_WORKS;
    else if (refused || (!parts && t->joining == JOINING_EXPECTED))
        t->joining = JOINING_FAILS;
}

/* Ends an attempt. `code`: libcurl's result. */
static void end_attempt(ebpo_transfers *t, ebpo_slot *s, CURLcode code)
{
    long connections = 0, redirects = 0;
    ebpo_request *r = s->request;
    double now = ebpo_seconds();
    curl_easy_getinfo(s->easy, CURLINFO_NUM_CONNECTS, &connections);
    curl_easy_getinfo(s->easy, CURLINFO_REDIRECT_COUNT, &redirects);
    curl_multi_remove_handle(t->multi, s->easy);
    if (code == CURLE_OK)
        judge_slot(s);
    pthread_mutex_lock(t->lock);
    t->active--;
    t->stats.bytes += s->received;
    t->stats.connections += (uint64_t)(connections > 0 ? connections : 0);
    t->stats.requests += (uint64_t)(redirects > 0 ? redirects : 0);
    if (s->joined)
        judge_joining(t, s, code);
    for (ebpo_request *next; r; r = next) {
        next = r->next;
        s->request = r;
        if (r != &s->extra)
            end_request(t, s, code, now);
    }
    s->request = NULL;
    pthread_mutex_unlock(t->lock);
}

static void cancel_queue(ebpo_transfers *t)
{
    while (t->queue) {
        ebpo_request *r = t->queue;
        t->queue = r->next;
        finish_request(t, r, EBPO_E_CANCELLED, "reading was stopped on request");
    }
}

/* Returns how many slots may be in use before this request may start no more. The number is lower
 * for large requests: if many large requests shared the bandwidth, the first of them would end
 * late. */
static unsigned slots_for(const ebpo_transfers *t, const ebpo_request *r)
{
    enum { LARGE_BYTES = 1 << 20, LARGE_AT_A_TIME = 6 };
    return r->size > LARGE_BYTES && t->slot_count > LARGE_AT_A_TIME ? LARGE_AT_A_TIME
                                                                    : t->slot_count;
}

/* The caller holds the lock. Removes the next request that can start from the queue and returns it.
 * Returns NULL if no request can start. Ends requests that have waited too long. Reduces *wait to
 * the seconds until the next request is due or reaches its deadline. */
static ebpo_request *next_due(ebpo_transfers *t, double now, double *wait)
{
    for (ebpo_request **at = &t->queue; *at;) {
        ebpo_request *r = *at;
        if (r->deadline > 0 && now >= r->deadline) {
            *at = r->next;
            char why[160];
            snprintf(why, sizeof why,
                     "bytes %" PRIu64 " to %" PRIu64
                     " were not read within %g s; try again later, or use a longer time limit",
                     r->offset, r->offset + r->size - 1, t->options->time_limit);
            finish_request(t, r, EBPO_E_IO, why);
            continue;
        }
        if (r->due <= now && t->active < slots_for(t, r)) {
            *at = r->next;
            return r;
        }
        if (r->due > now && r->due - now < *wait)
            *wait = r->due - now;
        if (r->deadline > 0 && r->deadline - now < *wait)
            *wait = r->deadline - now;
        at = &r->next;
    }
    return NULL;
}

static ebpo_slot *free_slot(ebpo_transfers *t)
{
    for (unsigned i = 0; i < t->slot_count; i++)
        if (!t->slots[i].request)
            return &t->slots[i];
    return NULL;
}

/* Ends all requests of a slot that is not running. */
static void finish_slot(ebpo_transfers *t, ebpo_slot *s, ebpo_status status, const char *why)
{
    for (ebpo_request *r = s->request, *next; r; r = next) {
        next = r->next;
        finish_request(t, r, status, why);
    }
    s->request = NULL;
    t->active--;
}

/* Starts the requests that are due. Returns false when the thread must end. Reduces *wait as
 * next_due does. */
static bool start_due(ebpo_transfers *t, double *wait)
{
    ebpo_request *r;
    pthread_mutex_lock(t->lock);
    bool quit = t->quit;
    if (t->cancelled)
        cancel_queue(t);
    while (!quit && (r = next_due(t, ebpo_seconds(), wait)) != NULL) {
        ebpo_slot *s = free_slot(t);
        join_requests(t, r, ebpo_seconds());
        begin_attempt(t, s, r, ebpo_seconds());
        if (curl_multi_add_handle(t->multi, s->easy) != CURLM_OK)
            finish_slot(t, s, EBPO_E_IO, "libcurl cannot take another request");
    }
    pthread_mutex_unlock(t->lock);
    return !quit;
}

/* Cancels all requests if the caller's `stop` function returns true. */
static void check_stop(ebpo_transfers *t)
{
    const ebpo_http_options *o = t->options;
    if (!o->stop || t->cancelled || !o->stop(o->stop_user))
        return;
    for (unsigned i = 0; i < t->slot_count; i++)
        if (t->slots[i].request)
            curl_multi_remove_handle(t->multi, t->slots[i].easy);
    pthread_mutex_lock(t->lock);
    t->cancelled = true;
    cancel_queue(t);
    for (unsigned i = 0; i < t->slot_count; i++)
        if (t->slots[i].request)
            finish_slot(t, &t->slots[i], EBPO_E_CANCELLED, "reading was stopped on request");
    pthread_mutex_unlock(t->lock);
}

/* Drives libcurl: the function of the thread. */
static void *drive_transfers(void *transfers)
{
    ebpo_transfers *t = transfers;
    for (;;) {
        int running = 0, message_count = 0;
        double wait = IDLE_MS * 0.001;
        if (!start_due(t, &wait))
            return NULL;
        curl_multi_perform(t->multi, &running);
        bool ended = false;
        for (CURLMsg *m; (m = curl_multi_info_read(t->multi, &message_count)) != NULL;) {
            char *private = NULL;
            if (m->msg != CURLMSG_DONE)
                continue;
            CURLcode code =
                m->data.result; /* read now, because end_attempt makes the message invalid */
            curl_easy_getinfo(m->easy_handle, CURLINFO_PRIVATE, &private);
            end_attempt(t, (ebpo_slot *)(void *)private, code);
            ended = true;
        }
        if (ended)
            continue;
        bool busy = running || wait * 1000 < IDLE_MS;
        int ms = (int)(wait * 1000) + 1;
        curl_multi_poll(t->multi, NULL, 0, busy && ms > CHECK_MS ? CHECK_MS : ms, NULL);
        check_stop(t);
    }
}
