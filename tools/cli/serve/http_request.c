/* Parses the head of a request: the first line and the fields, up to an empty line. */
#include "cli/serve/http_request.h"

#include <string.h>
#include <strings.h>

/* A part of the head, without a zero byte at its end. */
typedef struct span {
    const char *text;
    size_t length;
} span;

static bool span_is(span s, const char *text)
{
    return s.length == strlen(text) && memcmp(s.text, text, s.length) == 0;
}

static bool span_is_word(span s, const char *text)
{
    return s.length == strlen(text) && strncasecmp(s.text, text, s.length) == 0;
}

static bool is_digit(char c) { return c >= '0' && c <= '9'; }

/* Returns true if the character may be in a token (RFC 9110, 5.6.2). */
static bool is_token_character(char c)
{
    return is_digit(c) || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
           (c && strchr("!#$%&'*+-.^_`|~", c));
}

static bool is_token(span s)
{
    for (size_t i = 0; i < s.length; i++)
        if (!is_token_character(s.text[i]))
            return false;
    return s.length > 0;
}

/* Copies a value. Returns false if it is too long. */
static bool copy_span(span s, char *out, size_t capacity)
{
    if (s.length >= capacity)
        return false;
    memcpy(out, s.text, s.length);
    out[s.length] = 0;
    return true;
}

/* Takes the next line, without its CR LF. Returns false if there is none, or if it contains a CR,
 * LF or NUL. */
static bool take_line(span *rest, span *line)
{
    const char *end = memchr(rest->text, '\r', rest->length);
    if (!end || (size_t)(end - rest->text) + 1 >= rest->length || end[1] != '\n')
        return false;
    *line = (span){ rest->text, (size_t)(end - rest->text) };
    rest->text = end + 2;
    rest->length -= line->length + 2;
    return !memchr(line->text, '\n', line->length) && !memchr(line->text, 0, line->length);
}

static int hex_digit(char c)
{
    return is_digit(c)            ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

/* Decodes the path of a request's target. The path is only compared with the paths of a table and
 * opens no file, so ".." needs no treatment. */
static int decode_path(span target, http_request *out)
{
    size_t n = 0;
    if (target.length == 0 || target.text[0] != '/')
        return HTTP_BAD_REQUEST;
    for (size_t i = 0; i < target.length; i++) {
        char c = target.text[i];
        if ((unsigned char)c <= ' ' || c == 0x7f || c == '#')
            return HTTP_BAD_REQUEST;
        if (c == '?') {
            out->has_query = true;
            break;
        }
        if (c == '%') {
            int high = i + 2 < target.length ? hex_digit(target.text[i + 1]) : -1,
                low = high < 0 ? -1 : hex_digit(target.text[i + 2]);
            c = (char)(16 * high + low);
            if (low < 0 || !c)
                return HTTP_BAD_REQUEST;
            i += 2;
        }
        if (n + 1 >= sizeof out->path)
            return HTTP_LONG_PATH;
        out->path[n++] = c;
    }
    out->path[n] = 0;
    return HTTP_OK;
}

static int parse_first_line(span line, http_request *out)
{
    const char *blank = memchr(line.text, ' ', line.length);
    if (!blank)
        return HTTP_BAD_REQUEST;
    span method = { line.text, (size_t)(blank - line.text) },
         target = { blank + 1, line.length - method.length - 1 };
    blank = memchr(target.text, ' ', target.length);
    if (!is_token(method) || !blank)
        return HTTP_BAD_REQUEST;
    span version = { blank + 1, target.length - (size_t)(blank - target.text) - 1 };
    target.length -= version.length + 1;
    out->keeps = span_is(version, "HTTP/1.1");
    if (!out->keeps && !span_is(version, "HTTP/1.0"))
        return version.length == 8 && memcmp(version.text, "HTTP/", 5) == 0 ? HTTP_BAD_VERSION
                                                                            : HTTP_BAD_REQUEST;
    out->head_only = span_is(method, "HEAD");
    out->is_post = out->is_post && span_is(method, "POST");
    if (!out->head_only && !out->is_post && !span_is(method, "GET"))
        return HTTP_BAD_METHOD;
    return decode_path(target, out);
}

/* Returns true if the host is a name of this machine. Any port is accepted, because a tunnel may
 * change the port. Another site may have a name that leads to this machine. Requests from its pages
 * contain this name, so they are refused. */
static bool is_own_host(span host)
{
    static const char *const names[] = { "127.0.0.1", "localhost", "[::1]" };
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        size_t n = strlen(names[i]);
        if (host.length < n || strncasecmp(host.text, names[i], n) != 0)
            continue;
        if (host.length == n)
            return true;
        bool port = host.text[n] == ':' && host.length <= n + 6;
        for (size_t k = n + 1; k < host.length && port; k++)
            port = is_digit(host.text[k]);
        return port;
    }
    return false;
}

/* Fields that the head has had so far. */
typedef struct seen_fields {
    bool range, length; /* length: Content-Length */
    span host, origin;  /* without text: not seen */
} seen_fields;

/* Returns true if a page of this server has sent the request. A page of another site cannot change
 * or omit the field Origin of a POST. */
static bool is_own_page(const seen_fields *seen)
{
    static const char scheme[] = "http://";
    size_t n = sizeof scheme - 1;
    return seen->origin.text && seen->origin.length == n + seen->host.length &&
           memcmp(seen->origin.text, scheme, n) == 0 &&
           memcmp(seen->origin.text + n, seen->host.text, seen->host.length) == 0;
}

/* Reads the length of the body. Returns false if it is not a number, or too long. */
static bool read_length(span value, size_t *out)
{
    *out = 0;
    for (size_t i = 0; i < value.length; i++) {
        if (!is_digit(value.text[i]) || *out > HTTP_BODY_MAX)
            return false;
        *out = 10 * *out + (size_t)(value.text[i] - '0');
    }
    return value.length > 0 && *out <= HTTP_BODY_MAX;
}

/* Returns true if a list of words, separated by commas, contains the word "close". */
static bool lists_close(span value)
{
    for (size_t i = 0; i < value.length;) {
        while (i < value.length && strchr(", \t", value.text[i]))
            i++;
        span word = { value.text + i, 0 };
        while (i < value.length && !strchr(", \t", value.text[i]))
            i++;
        word.length = (size_t)(value.text + i - word.text);
        if (span_is_word(word, "close"))
            return true;
    }
    return false;
}

static int take_field(span name, span value, http_request *out, seen_fields *seen)
{
    if (span_is_word(name, "Host")) {
        if (seen->host.text)
            return HTTP_BAD_REQUEST;
        seen->host = value;
        return is_own_host(value) ? HTTP_OK : HTTP_OTHER_HOST;
    }
    if (span_is_word(name, "Origin")) {
        if (seen->origin.text)
            return HTTP_BAD_REQUEST;
        seen->origin = value;
    }
    if (span_is_word(name, "Sec-Fetch-Site"))
        out->is_foreign |= !span_is(value, "same-origin") && !span_is(value, "none");
    /* Other requests with a body are refused. */
    if (span_is_word(name, "Transfer-Encoding") ||
        (span_is_word(name, "Content-Length") &&
         (seen->length || !(out->is_post ? read_length(value, &out->body) : span_is(value, "0")))))
        return HTTP_BAD_REQUEST;
    seen->length |= span_is_word(name, "Content-Length");
    if (span_is_word(name, "Connection") && lists_close(value))
        out->keeps = false;
    if (span_is_word(name, "Range")) {
        if (seen->range)
            return HTTP_BAD_REQUEST;
        seen->range = true;
        if (!copy_span(value, out->range, sizeof out->range))
            out->range[0] = 0; /* a server may ignore ranges */
    }
    /* If the value of If-Range is too long, it is replaced by "?", which equals no tag. */
    if (span_is_word(name, "If-Range") && !copy_span(value, out->if_range, sizeof out->if_range))
        strcpy(out->if_range, "?");
    if (span_is_word(name, "If-None-Match") &&
        !copy_span(value, out->if_none_match, sizeof out->if_none_match))
        out->if_none_match[0] = 0;
    return HTTP_OK;
}

static int parse_field(span line, http_request *out, seen_fields *seen)
{
    const char *colon = memchr(line.text, ':', line.length);
    if (!colon)
        return HTTP_BAD_REQUEST;
    span name = { line.text, (size_t)(colon - line.text) },
         value = { colon + 1, line.length - name.length - 1 };
    while (value.length && (*value.text == ' ' || *value.text == '\t')) {
        value.text++;
        value.length--;
    }
    while (value.length &&
           (value.text[value.length - 1] == ' ' || value.text[value.length - 1] == '\t'))
        value.length--;
    return is_token(name) ? take_field(name, value, out, seen) : HTTP_BAD_REQUEST;
}

int http_request_parse(const char *head, size_t length, bool takes_posts, http_request *out)
{
    span rest = { head, length }, line;
    seen_fields seen = { .range = false };
    memset(out, 0, sizeof *out);
    out->is_post = takes_posts;
    if (!take_line(&rest, &line))
        return HTTP_BAD_REQUEST;
    int status = parse_first_line(line, out);
    while (status == HTTP_OK) {
        if (!take_line(&rest, &line))
            return HTTP_BAD_REQUEST;
        if (line.length == 0)
            break;
        status = parse_field(line, out, &seen);
    }
    if (status == HTTP_OK && (rest.length || !seen.host.text || (out->is_post && !seen.length)))
        return HTTP_BAD_REQUEST;
    return status == HTTP_OK && out->is_post && !is_own_page(&seen) ? HTTP_FORBIDDEN : status;
}

/* Reads a number. Numbers of 2^63 and more become 2^63. Returns false if there is no digit. */
static bool take_number(const char **at, uint64_t *out)
{
    const uint64_t greatest = (uint64_t)1 << 63;
    if (!is_digit(**at))
        return false;
    for (*out = 0; is_digit(**at); (*at)++) {
        uint64_t digit = (uint64_t)(**at - '0');
        *out = *out > (greatest - digit) / 10 ? greatest : 10 * *out + digit;
    }
    return true;
}

int http_request_range(const http_request *request, uint64_t size, const char *tag, uint64_t *first,
                       uint64_t *count)
{
    const char *at = request->range;
    uint64_t last = UINT64_MAX;
    *first = 0;
    *count = size;
    /* RFC 9110 permits that a server ignores a range. This server ignores it if the unit is
     * unknown, the form is wrong, there are several ranges, or If-Range names another version. */
    if (strncasecmp(at, "bytes=", 6) != 0 ||
        (request->if_range[0] && strcmp(request->if_range, tag) != 0))
        return HTTP_OK;
    at += 6;
    if (*at == '-') {
        at++;
        if (!take_number(&at, &last) || *at)
            return HTTP_OK;
        *count = last < size ? last : size;
        *first = size - *count;
        return *count ? HTTP_PARTIAL : HTTP_BAD_RANGE;
    }
    uint64_t begin;
    if (!take_number(&at, &begin) || *at++ != '-' || (*at && !take_number(&at, &last)) || *at ||
        last < begin)
        return HTTP_OK;
    if (begin >= size)
        return HTTP_BAD_RANGE;
    *first = begin;
    *count = (last < size - 1 ? last : size - 1) - begin + 1;
    return HTTP_PARTIAL;
}

bool http_request_has(const http_request *request, const char *tag)
{
    const char *at = request->if_none_match;
    if (!*tag)
        return false;
    for (size_t n = strlen(tag); *at; at += strcspn(at, ","), at += strspn(at, ", \t")) {
        const char *strong = strncmp(at, "W/", 2) == 0 ? at + 2 : at;
        if ((strncmp(strong, tag, n) == 0 && (!strong[n] || strchr(", \t", strong[n]))) ||
            strcmp(at, "*") == 0)
            return true;
    }
    return false;
}
