/* Parses the head of a server's response line by line, and compares the response with the request.
 * A response may send a part of the file, several parts or the whole file, or may ask to try again
 * later. Each of several parts is judged like a response of its own. All other responses are
 * refused. Ranges, lengths, versions (entity tags or dates) and encodings must
 * match the request. This file reads nothing from the network, so tests and fuzzers can pass any
 * bytes. Source: RFC 9110, sections 8.8, 14 and 15. */
#include <ctype.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/checksum.h"
#include "io/http_response.h"

/* --- header lines --- */

/* Finds the text of the header field `name`, without surrounding blanks. Returns false when the
 * line is another field. */
static bool parse_field(const char *line, size_t size, const char *name, const char **text,
                        size_t *length)
{
    size_t at = strlen(name);
    if (size <= at || strncasecmp(line, name, at) != 0 || line[at] != ':')
        return false;
    at++;
    while (at < size && (line[at] == ' ' || line[at] == '\t'))
        at++;
    while (size > at && isspace((unsigned char)line[size - 1]))
        size--;
    *text = line + at;
    *length = size - at;
    return true;
}

/* Parses digits, and moves *at past them. Returns false if there are no digits, or if the number is
 * about 2^63 or more. */
static bool parse_number(const char **at, const char *end, uint64_t *out)
{
    const char *begin = *at;
    *out = 0;
    for (; *at < end && **at >= '0' && **at <= '9'; (*at)++) {
        if (*out > (UINT64_C(1) << 63) / 10 - 1)
            return false;
        *out = *out * 10 + (uint64_t)(**at - '0');
    }
    return *at > begin;
}

/* Moves *at past the character c. Returns false if another character is there. */
static bool parse_token(const char **at, const char *end, char c)
{
    if (*at >= end || **at != c)
        return false;
    (*at)++;
    return true;
}

/* Parses the field Content-Range: "bytes RANGE/SIZE". RANGE is "0-99", or "*" if there is no range.
 * SIZE is "1000", or "*" if the size is not known. Returns false if the field is invalid or
 * contradicts an earlier field. */
static bool content_range(ebpo_http_response *a, const char *at, const char *end)
{
    uint64_t begin = 0, last = 0, total = 0;
    bool range;
    if (end - at < 6 || strncasecmp(at, "bytes", 5) != 0 || at[5] != ' ')
        return false;
    at += 6;
    range = !parse_token(&at, end, '*');
    if (range && (!parse_number(&at, end, &begin) || !parse_token(&at, end, '-') ||
                  !parse_number(&at, end, &last)))
        return false;
    if (!parse_token(&at, end, '/'))
        return false;
    bool sized = !parse_token(&at, end, '*');
    if ((sized && !parse_number(&at, end, &total)) || at != end || begin > last ||
        (range && sized && last >= total))
        return false;
    if ((a->has_range || a->has_total) &&
        (a->begin != begin || a->last != last || a->total != total))
        return false;
    a->has_range = range;
    a->has_total = sized;
    a->begin = begin;
    a->last = last;
    a->total = total;
    return true;
}

/* Stores the type in lower case and without parameters: "text/html" for "Text/HTML; charset=utf-8".
 */
static void keep_type(char out[EBPO_HTTP_TYPE_BYTES], const char *text, size_t length)
{
    size_t i = 0;
    for (; i < length && i + 1 < EBPO_HTTP_TYPE_BYTES && isgraph((unsigned char)text[i]) &&
           text[i] != ';' && text[i] != ',';
         i++)
        out[i] = (char)tolower((unsigned char)text[i]);
    out[i] = 0;
}

/* Stores the boundary of `multipart/byteranges; boundary="THIS"`. Stores "" if there is none, or if
 * it is too long. */
static void keep_boundary(char out[EBPO_HTTP_BOUNDARY_BYTES], const char *text, size_t length)
{
    static const char name[] = "boundary=";
    const char *at = memchr(text, ';', length), *end = text + length;
    out[0] = 0;
    while (at && at < end && (*at == ';' || *at == ' '))
        at++;
    if (!at || (size_t)(end - at) < sizeof name || strncasecmp(at, name, sizeof name - 1) != 0)
        return;
    at += sizeof name - 1;
    bool quoted = parse_token(&at, end, '"');
    size_t size = 0;
    while (at + size < end && (quoted ? at[size] != '"' : at[size] != ';' && at[size] != ' '))
        size++;
    if (size >= EBPO_HTTP_BOUNDARY_BYTES)
        return;
    memcpy(out, at, size);
    out[size] = 0;
}

bool ebpo_http_response_is_text(const char *type)
{
    size_t length = strlen(type);
    return strncmp(type, "text/", 5) == 0 || strcmp(type, "application/json") == 0 ||
           (length >= 3 && strcmp(type + length - 3, "xml") == 0);
}

/* Stores a text, or its digest if the text is too long. A digest is sufficient, because the text is
 * only compared. */
static void keep_text(char out[EBPO_HTTP_TAG_BYTES], const char *text, size_t length)
{
    if (length < EBPO_HTTP_TAG_BYTES) {
        memcpy(out, text, length);
        out[length] = 0;
        return;
    }
    ebpo_sha256 sha;
    uint8_t digest[32];
    char hex[65];
    ebpo_sha256_begin(&sha);
    ebpo_sha256_add(&sha, text, length);
    ebpo_sha256_end(&sha, digest);
    ebpo_sha256_hex(digest, hex);
    snprintf(out, EBPO_HTTP_TAG_BYTES, "sha256:%s", hex);
}

/* Clears the response, and parses its status line. */
static void status_line(ebpo_http_response *a, const char *line, size_t size)
{
    uint64_t bytes = a->header_bytes;
    *a = (ebpo_http_response){ .header_bytes = bytes, .http2 = size > 5 && line[5] >= '2' };
    const char *at = memchr(line, ' ', size), *end = line + size;
    uint64_t code = 0;
    while (at && at < end && *at == ' ')
        at++;
    if (at && parse_number(&at, end, &code) && code < 1000)
        a->code = (int)code;
}

void ebpo_http_response_line(ebpo_http_response *a, const char *line, size_t size)
{
    const char *text;
    size_t length;
    a->header_bytes += size;
    if (size > 5 && memcmp(line, "HTTP/", 5) == 0) {
        status_line(a, line, size);
    } else if (parse_field(line, size, "content-range", &text, &length)) {
        if (!content_range(a, text, text + length))
            a->bad_range = true;
    } else if (parse_field(line, size, "content-length", &text, &length)) {
        const char *at = text;
        a->has_length = parse_number(&at, text + length, &a->length) && at == text + length;
    } else if (parse_field(line, size, "content-encoding", &text, &length)) {
        a->encoded = length && !(length == 8 && strncasecmp(text, "identity", 8) == 0);
    } else if (parse_field(line, size, "transfer-encoding", &text, &length)) {
        a->chunked = length >= 7 && strncasecmp(text + length - 7, "chunked", 7) == 0;
    } else if (parse_field(line, size, "etag", &text, &length)) {
        size_t weak = length > 2 && text[0] == 'W' && text[1] == '/' ? 2 : 0;
        keep_text(a->etag, text + weak, length - weak);
    } else if (parse_field(line, size, "content-type", &text, &length)) {
        keep_type(a->type, text, length);
        keep_boundary(a->boundary, text, length);
    } else if (parse_field(line, size, "last-modified", &text, &length)) {
        keep_text(a->modified, text, length);
    } else if (parse_field(line, size, "server", &text, &length)) {
        a->joins = (length >= 5 && memcmp(text, "nginx", 5) == 0) ||
                   (length >= 6 && memcmp(text, "Apache", 6) == 0);
    }
}

/* --- the verdict --- */

static ebpo_verdict give_verdict(ebpo_verdict verdict, char why[EBPO_WHY_BYTES], const char *text)
{
    snprintf(why, EBPO_WHY_BYTES, "%s", text);
    return verdict;
}

/* Returns true for a status after which the same request may succeed later. */
static bool is_temporary(int code)
{
    return code == 408 || code == 429 || code == 500 || code == 502 || code == 503 || code == 504;
}

/* Compares the response with the pinned version, that is, the version that the first response had.
 * Returns the message about a change, or NULL. `size`: the file's size in the response. Weak tags
 * are compared like strong tags, because servers and proxies add and drop the mark "W/" although
 * the file is the same. */
static const char *what_changed(const ebpo_http_response *a, const ebpo_http_request *request,
                                uint64_t size)
{
    const ebpo_http_version *pinned = request->pinned;
    if (size != pinned->size)
        return "has changed on the server while it was open (another size); open it again";
    if (request->unversioned)
        return NULL;
    /* Mirrors of one file may report different times, but not different tags. */
    if (strcmp(a->etag, pinned->etag) != 0)
        return "has changed on the server while it was open (another ETag); open it again, or use "
               "--http-unversioned if several servers with different tags serve this address";
    if (!*pinned->etag && strcmp(a->modified, pinned->modified) != 0)
        return "has changed on the server while it was open (another Last-Modified); open it "
               "again, or use --http-unversioned if several servers with different times serve "
               "this address";
    return NULL;
}

/* Judges a response with status 206 (a part). */
static ebpo_verdict judge_part(const ebpo_http_response *a, const ebpo_http_request *request,
                               char why[EBPO_WHY_BYTES])
{
    if (a->bad_range || !a->has_range)
        return give_verdict(
            EBPO_HTTP_REFUSED, why,
            "the server sent a part with a missing or invalid Content-Range; this server or a "
            "proxy on the way is broken");
    if (!a->has_total)
        return give_verdict(
            EBPO_HTTP_REFUSED, why,
            "the server does not report the file's size (Content-Range ends with /*); such files "
            "cannot be read by ranges");
    const char *change = request->pinned ? what_changed(a, request, a->total) : NULL;
    if (change)
        return give_verdict(EBPO_HTTP_REFUSED, why, change);
    if (a->begin != request->begin || a->last >= request->end) {
        snprintf(why, EBPO_WHY_BYTES,
                 "the server sent bytes %" PRIu64 " to %" PRIu64 " for a request of %" PRIu64
                 " to %" PRIu64 "; this server or a proxy on the way is broken",
                 a->begin, a->last, request->begin, request->end - 1);
        return EBPO_HTTP_REFUSED;
    }
    return EBPO_HTTP_PART;
}

/* Judges a response with status 200 (the whole file). */
static ebpo_verdict judge_whole(const ebpo_http_response *a, const ebpo_http_request *request,
                                ebpo_status *status, char why[EBPO_WHY_BYTES])
{
    if (request->pinned && ebpo_http_response_is_text(a->type)) {
        snprintf(
            why, EBPO_WHY_BYTES,
            "the server returned %s instead of a part, after it had sent parts of a model; a login "
            "or the address may have expired, so open it again",
            a->type);
        return EBPO_HTTP_REFUSED;
    }
    const char *change =
        request->pinned && a->has_length ? what_changed(a, request, a->length) : NULL;
    if (change)
        return give_verdict(EBPO_HTTP_REFUSED, why, change);
    if (request->pinned)
        return give_verdict(
            EBPO_HTTP_REFUSED, why,
            "the server sent the whole file instead of a part, after it had sent parts; try "
            "again later");
    *status = EBPO_E_UNSUPPORTED;
    if (a->has_length && a->length > request->whole_limit) {
        snprintf(why, EBPO_WHY_BYTES,
                 "the server does not support byte ranges, and the file's %" PRIu64
                 " bytes are more than the limit of %" PRIu64
                 " for whole files; download the file, or use a server with ranges",
                 a->length, request->whole_limit);
        return EBPO_HTTP_REFUSED;
    }
    if (!a->has_length && !a->chunked && !a->http2)
        return give_verdict(
            EBPO_HTTP_REFUSED, why,
            "the server does not support byte ranges and does not report the size of the file; "
            "download the file, or use a server with ranges");
    return EBPO_HTTP_WHOLE;
}

ebpo_verdict ebpo_http_response_judge(const ebpo_http_response *a, const ebpo_http_request *request,
                                      ebpo_status *status, char why[EBPO_WHY_BYTES])
{
    *status = EBPO_E_IO;
    if (is_temporary(a->code)) {
        snprintf(why, EBPO_WHY_BYTES, "the server returned status %d", a->code);
        return EBPO_HTTP_LATER;
    }
    if (request->several)
        return a->code == 206 && !a->encoded && *a->boundary &&
                       strcmp(a->type, "multipart/byteranges") == 0
                   ? EBPO_HTTP_PARTS
                   : EBPO_HTTP_SINGLY;
    if (a->code == 416 && request->pinned)
        return give_verdict(
            EBPO_HTTP_REFUSED, why,
            "has changed on the server while it was open (it became shorter); open it again");
    if (a->code == 416)
        return give_verdict(
            EBPO_HTTP_REFUSED, why,
            "the server returned status 416 (no such bytes): the file is empty, or this server is "
            "broken");
    if (a->code != 200 && a->code != 206) {
        const char *hint = a->code == 404 || a->code == 410
                               ? ": there is no such file; check the address"
                           : a->code == 401 || a->code == 403 || a->code == 407
                               ? ": not allowed; check name, password and rights"
                               : "";
        snprintf(why, EBPO_WHY_BYTES, "the server returned status %d%s", a->code, hint);
        return EBPO_HTTP_REFUSED;
    }
    if (a->encoded)
        return give_verdict(EBPO_HTTP_REFUSED, why,
                            "the server compressed the file, which was not requested "
                            "(Content-Encoding); switch off this compression on the server");
    return a->code == 206 ? judge_part(a, request, why) : judge_whole(a, request, status, why);
}

/* --- bodies with several ranges --- */

/* Reads a line before a boundary, without its end. Returns false if the line is neither empty nor
 * the boundary. */
static bool take_boundary(ebpo_part_head *h, const ebpo_http_response *whole, size_t length)
{
    size_t mark = strlen(whole->boundary);
    if (length == 0 || h->ended)
        return true;
    if (length < mark + 2 || memcmp(h->line, "--", 2) != 0 ||
        memcmp(h->line + 2, whole->boundary, mark) != 0)
        return false;
    const char *rest = h->line + mark + 2;
    h->ended = length == mark + 4 && memcmp(rest, "--", 2) == 0;
    h->in_head = length == mark + 2;
    h->response = *whole;
    return h->ended || h->in_head;
}

size_t ebpo_part_head_take(ebpo_part_head *h, const ebpo_http_response *whole, const char *bytes,
                           size_t size, bool *complete)
{
    const char *end = memchr(bytes, '\n', size);
    size_t step = end ? (size_t)(end - bytes) + 1 : size;
    *complete = false;
    if (step > sizeof h->line - h->length)
        return 0;
    memcpy(h->line + h->length, bytes, step);
    h->length += step;
    if (!end)
        return step;
    size_t length = h->length - 1;
    if (length && h->line[length - 1] == '\r')
        length--;
    h->length = 0;
    if (!h->in_head)
        return take_boundary(h, whole, length) ? step : 0;
    if (length)
        ebpo_http_response_line(&h->response, h->line, length);
    *complete = length == 0;
    h->in_head = !*complete;
    return step;
}
