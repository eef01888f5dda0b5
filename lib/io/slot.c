/* libcurl's callbacks while an answer arrives, and the options of its handles. */
#include "io/slot.h"

#include <string.h>

#include "core/alloc.h"
#include "core/clock.h"
#include "ebpo_config.h"

enum {
    REDIRECTS_MAX = 5,
    STALL_BYTES = 100, /* a second */
    /* of a body that is not wanted: reading it to its end keeps the connection */
    DRAIN_BYTES = 65536
};

/* --- what libcurl calls --- */

/* Some ten times a second while a request is under way. libcurl's own measure of speed is an
 * average over several seconds. */
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

static size_t take_header(char *line, size_t size, size_t count, void *user)
{
    ebpo_slot *s = user;
    s->moved = ebpo_seconds();
    ebpo_answer_line(&s->answer, line, size * count);
    /* what was given for one server is not for others: libcurl would send it along */
    if (ebpo_redirect_line(&s->redirect, s->owner->url, s->answer.code, line, size * count))
        curl_easy_setopt(s->easy, CURLOPT_HTTPHEADER, s->owner->bare_headers);
    if (s->answer.header_bytes <= EBPO_HTTP_HEADERS_MAX)
        return size * count;
    s->judged = true;
    s->stopped = true;
    s->verdict = EBPO_ANSWER_REFUSED;
    s->status = EBPO_E_IO;
    strcpy(s->why, "the head of the server's answer is too long; this server is broken");
    return 0;
}

void ebpo_slot_judge(ebpo_slot *s)
{
    ebpo_asked asked = { s->begin, s->end, s->is_pinned ? &s->pinned : NULL,
                         s->owner->options->whole_limit, s->owner->options->unversioned };
    if (!s->judged)
        s->verdict = ebpo_answer_judge(&s->answer, &asked, &s->status, s->why);
    s->judged = true;
}

static size_t refuse(ebpo_slot *s, ebpo_status status, const char *why)
{
    s->verdict = EBPO_ANSWER_REFUSED;
    s->status = status;
    s->stopped = true;
    snprintf(s->why, sizeof s->why, "%s", why);
    return 0;
}

static size_t take_part(ebpo_slot *s, const char *bytes, size_t size)
{
    uint64_t capacity = s->answer.last + 1 - s->begin - s->taken;
    if (size > capacity)
        return refuse(s, EBPO_E_IO,
                      "the server sent more bytes than it was asked for and than it said; this "
                      "server or a proxy on the way is broken");
    memcpy(s->request->data + (s->begin - s->request->offset) + s->taken, bytes, size);
    s->taken += size;
    return size;
}

static size_t take_whole(ebpo_slot *s, const char *bytes, size_t size)
{
    ebpo_request *r = s->request;
    if (s->taken + size > s->owner->options->whole_limit)
        return refuse(s, EBPO_E_UNSUPPORTED,
                      "the server has no byte ranges, and the file is larger than what would be "
                      "read as a whole; download the file, or use a server with ranges");
    if (!ebpo_grow(&r->whole, &r->whole_capacity, s->taken + size, 1))
        return refuse(s, EBPO_E_MEMORY, "out of memory");
    memcpy(r->whole + s->taken, bytes, size);
    s->taken += size;
    return size;
}

static size_t take_body(char *bytes, size_t size, size_t count, void *user)
{
    ebpo_slot *s = user;
    size *= count;
    s->moved = ebpo_seconds();
    ebpo_slot_judge(s);
    s->received += size;
    if (s->verdict == EBPO_ANSWER_PART)
        return take_part(s, bytes, size);
    if (s->verdict == EBPO_ANSWER_WHOLE)
        return take_whole(s, bytes, size);
    s->unwanted += size;
    s->stopped = s->unwanted > DRAIN_BYTES || s->verdict == EBPO_ANSWER_REFUSED;
    return s->stopped ? 0 : size;
}

/* --- setting up --- */

static bool https(const char *url) { return url[4] == 's' || url[4] == 'S'; }

bool ebpo_slot_set_up(ebpo_slot *s)
{
    const ebpo_transfers *t = s->owner;
    const ebpo_http_options *o = t->options;
    CURL *e = s->easy;
    bool good = curl_easy_setopt(e, CURLOPT_URL, t->url) == CURLE_OK &&
                curl_easy_setopt(e, CURLOPT_HTTPHEADER, t->headers) == CURLE_OK;
#if LIBCURL_VERSION_NUM >= 0x075500
    good = good && curl_easy_setopt(e, CURLOPT_PROTOCOLS_STR, "http,https") == CURLE_OK;
    good = good && curl_easy_setopt(e, CURLOPT_REDIR_PROTOCOLS_STR,
                                    https(t->url) ? "https" : "http,https") == CURLE_OK;
#else
    good = good &&
           curl_easy_setopt(e, CURLOPT_PROTOCOLS, CURLPROTO_HTTP | CURLPROTO_HTTPS) == CURLE_OK;
    good = good && curl_easy_setopt(e, CURLOPT_REDIR_PROTOCOLS,
                                    https(t->url) ? CURLPROTO_HTTPS
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
    curl_easy_setopt(e, CURLOPT_HEADERFUNCTION, take_header);
    curl_easy_setopt(e, CURLOPT_HEADERDATA, s);
    curl_easy_setopt(e, CURLOPT_WRITEFUNCTION, take_body);
    curl_easy_setopt(e, CURLOPT_WRITEDATA, s);
    curl_easy_setopt(e, CURLOPT_PRIVATE, s);
    return good;
}
