#include "io/transfer.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"
#include "io/slot.h"

enum {
    LOOK_MS = 100, /* between checks of `stop` and for stalls */
    IDLE_MS = 60000
};
static const double PAUSE_FIRST = 0.2, PAUSE_MOST = 8, PAUSE_ASKED_MOST = 60; /* seconds */

static pthread_once_t curl_once = PTHREAD_ONCE_INIT;
static CURLcode curl_state;

static void start_curl(void) { curl_state = curl_global_init(CURL_GLOBAL_DEFAULT); }

/* --- setting up --- */

static bool add_header(struct curl_slist **list, const char *text)
{
    struct curl_slist *more = curl_slist_append(*list, text);
    if (more)
        *list = more;
    return more != NULL;
}

static void *drive(void *transfers);

static bool set_up(ebpo_transfers *t)
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
        if (!t->slots[i].easy || !ebpo_slot_set_up(&t->slots[i]))
            return false;
    }
    t->running = ebpo_thread_start(&t->thread, drive, t) == 0;
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
    if (set_up(t)) {
        *out = t;
        return EBPO_OK;
    }
    ebpo_transfers_free(t);
    return ebpo_fail_file(
        error, EBPO_E_IO, shown,
        "libcurl cannot be set up: no memory, no threads, or options that it does not take");
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
        ebpo_redirect_clear(&t->slots[i].redirect);
    }
    if (t->multi)
        curl_multi_cleanup(t->multi);
    curl_slist_free_all(t->headers);
    curl_slist_free_all(t->bare_headers);
    free(t);
}

/* --- the queue; lock held --- */

static void enqueue(ebpo_transfers *t, ebpo_request *r)
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

static bool dequeue(ebpo_transfers *t, ebpo_request *r)
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
    enqueue(t, r);
    curl_multi_wakeup(t->multi);
}

void ebpo_transfers_urge(ebpo_transfers *t, ebpo_request *r)
{
    if (r->deadline > 0)
        return;
    r->deadline = ebpo_seconds() + t->options->time_limit;
    if (dequeue(t, r))
        enqueue(t, r);
    curl_multi_wakeup(t->multi);
}

void ebpo_transfers_pin(ebpo_transfers *t, const ebpo_http_version *version)
{
    t->pinned = *version;
    t->is_pinned = true;
}

void ebpo_transfers_add_stats(const ebpo_transfers *t, ebpo_http_stats *stats)
{
    stats->requests += t->stats.requests;
    stats->retries += t->stats.retries;
    stats->connections += t->stats.connections;
    stats->bytes += t->stats.bytes;
}

static void finish(ebpo_transfers *t, ebpo_request *r, ebpo_status status, const char *why)
{
    r->status = status;
    if (status != EBPO_OK)
        ebpo_fail_file(&r->error, status, t->shown, "%s", why);
    r->done = true;
    pthread_cond_broadcast(t->done);
}

/* --- attempts, by the thread --- */

/* Seconds until the next attempt: doubling, and jitter so that many readers do not come back at
 * once. What the server asks for counts when it is more. */
static double pause_after(ebpo_transfers *t, const ebpo_slot *s, bool *asked_for)
{
    curl_off_t asked = 0;
    double pause = PAUSE_FIRST;
    for (unsigned i = 1; i < s->request->failures && pause < PAUSE_MOST; i++)
        pause *= 2;
    pause = (pause < PAUSE_MOST ? pause : PAUSE_MOST) *
            (0.5 + 0.5 * ebpo_random_unit(ebpo_random_next(&t->random)));
    if (s->judged && s->verdict == EBPO_ANSWER_LATER)
        curl_easy_getinfo(s->easy, CURLINFO_RETRY_AFTER, &asked);
    *asked_for = (double)asked > pause;
    return *asked_for ? (double)asked : pause;
}

static void begin_attempt(ebpo_transfers *t, ebpo_slot *s, ebpo_request *r, double now)
{
    char range[64];
    bool begun = r->first && r->got > 0;
    s->request = r;
    s->is_pinned = t->is_pinned || begun;
    s->pinned = begun ? r->version : t->pinned;
    s->answer = (ebpo_answer){ .code = 0 };
    s->judged = s->stopped = s->stalled = s->sent = false;
    s->status = EBPO_E_IO;
    s->why[0] = s->trouble[0] = 0;
    s->begin = r->offset + (r->whole ? 0 : r->got);
    s->end = r->offset + r->size;
    s->received = s->taken = s->unwanted = 0;
    if (r->deadline <= 0)
        r->deadline = now + t->options->time_limit;
    double left = (r->deadline - now) * 1000;
    snprintf(range, sizeof range, "%" PRIu64 "-%" PRIu64, s->begin, s->end - 1);
    curl_easy_setopt(s->easy, CURLOPT_RANGE, range);
    if (s->redirect.at || s->redirect.elsewhere) /* the one before was led somewhere */
        curl_easy_setopt(s->easy, CURLOPT_HTTPHEADER, t->headers);
    ebpo_redirect_clear(&s->redirect);
    curl_easy_setopt(s->easy, CURLOPT_TIMEOUT_MS, (long)(left > 1 ? left : 1));
    t->stats.requests++;
    t->stats.retries += r->failures > 0;
    t->active++;
}

/* Errors after which the same request may well succeed. */
static bool passing(CURLcode code)
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

/* Keeps what arrived, so that the next attempt requests only the rest. */
static bool keep(ebpo_slot *s, CURLcode code)
{
    ebpo_request *r = s->request;
    memcpy(r->type, s->answer.type, sizeof r->type);
    if (s->verdict == EBPO_ANSWER_WHOLE) {
        if (code == CURLE_OK) {
            r->version = (ebpo_http_version){ .size = s->taken };
            r->got = s->taken;
        }
        return code == CURLE_OK;
    }
    if (r->first) {
        r->version.size = s->answer.total;
        if (s->answer.total < r->offset + r->size)
            r->size = s->answer.total - r->offset;
        memcpy(r->version.etag, s->answer.etag, sizeof r->version.etag);
        memcpy(r->version.modified, s->answer.modified, sizeof r->version.modified);
    }
    free(r->whole); /* an earlier answer began to send everything */
    r->whole = NULL;
    r->whole_capacity = 0;
    r->got = s->begin - r->offset + s->taken;
    return r->got == r->size;
}

/* Returns what went wrong in libcurl, which says that memory is short of lines that are too long
 * for it. */
static const char *trouble_of(const ebpo_slot *s, CURLcode code)
{
    if (code == CURLE_OUT_OF_MEMORY && !s->received)
        return "the head of the server's answer, such as the address of a redirect, is too long "
               "for libcurl, or memory is short; check the address";
    return *s->trouble ? s->trouble : curl_easy_strerror(code);
}

static void describe(const ebpo_slot *s, CURLcode code, char *out, size_t capacity)
{
    const char *trouble = trouble_of(s, code);
    if (s->judged && s->verdict == EBPO_ANSWER_LATER)
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

/* Whether the rest may come in another answer: not if a change of version would go unnoticed. */
static bool may_join(const ebpo_transfers *t, const ebpo_request *r)
{
    const ebpo_http_version *v = r->first ? &r->version : &t->pinned;
    return *v->etag || *v->modified || t->options->unversioned;
}

/* Again later, or the end of it. */
static void try_again(ebpo_transfers *t, ebpo_slot *s, CURLcode code, double now)
{
    ebpo_request *r = s->request;
    char what[CURL_ERROR_SIZE], why[CURL_ERROR_SIZE + 160];
    if (code == CURLE_OK && s->judged && s->verdict == EBPO_ANSWER_PART && s->taken &&
        s->taken == s->answer.last - s->answer.begin + 1 && may_join(t, r) && now < r->deadline) {
        r->due = now; /* a server that answers in smaller parts: no failure */
        enqueue(t, r);
        return;
    }
    describe(s, code, what, sizeof what);
    r->failures++;
    bool asked_for;
    double pause = pause_after(t, s, &asked_for);
    if (now >= r->deadline - 0.01 || (!asked_for && now + pause >= r->deadline))
        snprintf(why, sizeof why,
                 "bytes %" PRIu64 " to %" PRIu64
                 ": not read within %g s (%s); try again later, or with a longer time limit",
                 r->offset, r->offset + r->size - 1, t->options->time_limit, what);
    else if (r->failures > t->options->retries)
        snprintf(why, sizeof why,
                 "bytes %" PRIu64 " to %" PRIu64
                 ": %s; given up after %u attempt%s, try again later",
                 r->offset, r->offset + r->size - 1, what, r->failures,
                 r->failures == 1 ? "" : "s");
    else if (pause > PAUSE_ASKED_MOST || now + pause >= r->deadline)
        snprintf(why, sizeof why,
                 "bytes %" PRIu64 " to %" PRIu64
                 ": %s and is to be asked again in %.0f s; try again then",
                 r->offset, r->offset + r->size - 1, what, pause);
    else {
        if (!may_join(t, r))
            r->got = 0;
        r->due = now + pause;
        enqueue(t, r);
        return;
    }
    finish(t, r, EBPO_E_IO, why);
}

static void end_attempt(ebpo_transfers *t, ebpo_slot *s, CURLcode code)
{
    long connections = 0, redirects = 0;
    ebpo_request *r = s->request;
    double now = ebpo_seconds();
    curl_easy_getinfo(s->easy, CURLINFO_NUM_CONNECTS, &connections);
    curl_easy_getinfo(s->easy, CURLINFO_REDIRECT_COUNT, &redirects);
    curl_multi_remove_handle(t->multi, s->easy);
    if (code == CURLE_OK)
        ebpo_slot_judge(s);
    pthread_mutex_lock(t->lock);
    t->active--;
    t->stats.bytes += s->received;
    t->stats.connections += (uint64_t)(connections > 0 ? connections : 0);
    t->stats.requests += (uint64_t)(redirects > 0 ? redirects : 0);
    bool usable = s->judged && !s->stopped &&
                  (s->verdict == EBPO_ANSWER_PART || s->verdict == EBPO_ANSWER_WHOLE);
    if (s->judged && s->verdict == EBPO_ANSWER_REFUSED)
        finish(t, r, s->status, s->why);
    else if (usable && keep(s, code))
        finish(t, r, EBPO_OK, NULL);
    else if (code == CURLE_OK || s->stalled || passing(code) ||
             (s->judged && s->verdict == EBPO_ANSWER_LATER))
        try_again(t, s, code, now);
    else
        finish(t, r, EBPO_E_IO, trouble_of(s, code));
    s->request = NULL;
    pthread_mutex_unlock(t->lock);
}

static void cancel_queue(ebpo_transfers *t)
{
    while (t->queue) {
        ebpo_request *r = t->queue;
        t->queue = r->next;
        finish(t, r, EBPO_E_CANCELLED, "stopped on request");
    }
}

/* Of large requests fewer: together they would only share the line, and the first one come last. */
static unsigned slots_for(const ebpo_transfers *t, const ebpo_request *r)
{
    enum { LARGE_BYTES = 1 << 20, LARGE_AT_A_TIME = 6 };
    return r->size > LARGE_BYTES && t->slot_count > LARGE_AT_A_TIME ? LARGE_AT_A_TIME
                                                                    : t->slot_count;
}

/* Lock held. Requests that have waited too long for a slot end; *wait: seconds until something is
 * due. */
static ebpo_request *next_due(ebpo_transfers *t, double now, double *wait)
{
    for (ebpo_request **at = &t->queue; *at;) {
        ebpo_request *r = *at;
        if (r->deadline > 0 && now >= r->deadline) {
            *at = r->next;
            char why[160];
            snprintf(why, sizeof why,
                     "bytes %" PRIu64 " to %" PRIu64
                     ": not read within %g s; try again later, or with a longer time limit",
                     r->offset, r->offset + r->size - 1, t->options->time_limit);
            finish(t, r, EBPO_E_IO, why);
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

/* Starts what is due. False: the end. */
static bool start_due(ebpo_transfers *t, double *wait)
{
    ebpo_request *r;
    pthread_mutex_lock(t->lock);
    bool quit = t->quit;
    if (t->cancelled)
        cancel_queue(t);
    while (!quit && (r = next_due(t, ebpo_seconds(), wait)) != NULL) {
        ebpo_slot *s = free_slot(t);
        begin_attempt(t, s, r, ebpo_seconds());
        if (curl_multi_add_handle(t->multi, s->easy) != CURLM_OK) {
            t->active--;
            s->request = NULL;
            finish(t, r, EBPO_E_IO, "libcurl cannot take another request");
        }
    }
    pthread_mutex_unlock(t->lock);
    return !quit;
}

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
        if (t->slots[i].request) {
            finish(t, t->slots[i].request, EBPO_E_CANCELLED, "stopped on request");
            t->slots[i].request = NULL;
            t->active--;
        }
    pthread_mutex_unlock(t->lock);
}

static void *drive(void *transfers)
{
    ebpo_transfers *t = transfers;
    for (;;) {
        int running = 0, left = 0;
        double wait = IDLE_MS * 0.001;
        if (!start_due(t, &wait))
            return NULL;
        curl_multi_perform(t->multi, &running);
        bool ended = false;
        for (CURLMsg *m; (m = curl_multi_info_read(t->multi, &left)) != NULL;) {
            char *private = NULL;
            if (m->msg != CURLMSG_DONE)
                continue;
            CURLcode code = m->data.result; /* the message goes with the handle */
            curl_easy_getinfo(m->easy_handle, CURLINFO_PRIVATE, &private);
            end_attempt(t, (ebpo_slot *)(void *)private, code);
            ended = true;
        }
        if (ended)
            continue;
        bool busy = running || wait * 1000 < IDLE_MS;
        int ms = (int)(wait * 1000) + 1;
        curl_multi_poll(t->multi, NULL, 0, busy && ms > LOOK_MS ? LOOK_MS : ms, NULL);
        check_stop(t);
    }
}
