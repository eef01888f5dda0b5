/* Interprets the head of a server's response: RFC 9110, sections 8.8, 14 and 15. Pure functions. */
#ifndef EBPO_IO_HTTP_RESPONSE_H
#define EBPO_IO_HTTP_RESPONSE_H

#include <stdbool.h>
#include <stddef.h>

#include <ebpo/base.h>

enum { EBPO_HTTP_TAG_BYTES = 200, EBPO_HTTP_TYPE_BYTES = 64, EBPO_HTTP_HEADERS_MAX = 1 << 18 };

/* The version of a file. Texts are "" when the server does not send them. */
typedef struct ebpo_http_version {
    uint64_t size;
    char etag[EBPO_HTTP_TAG_BYTES];     /* ETag, without the mark of a weak tag */
    char modified[EBPO_HTTP_TAG_BYTES]; /* Last-Modified */
} ebpo_http_version;

/* The head of a response. */
typedef struct ebpo_http_response {
    int code;       /* 0: no status line yet */
    bool http2;     /* HTTP/2 or later, which detects a body that was cut off */
    bool has_range; /* Content-Range with a range, [begin, last] of `total` */
    /* Content-Range with a size; it may lack a range: "bytes * / 123", but without blanks */
    bool has_total;
    bool bad_range;  /* an invalid Content-Range, or two different ones */
    bool has_length; /* Content-Length */
    bool chunked;    /* Transfer-Encoding: chunked */
    bool encoded;    /* Content-Encoding, other than identity */
    uint64_t begin, last, total, length;
    char etag[EBPO_HTTP_TAG_BYTES], modified[EBPO_HTTP_TAG_BYTES];
    char type[EBPO_HTTP_TYPE_BYTES]; /* "text/html", in lower case */
    uint64_t header_bytes;
} ebpo_http_response;

/* Reads one unmodified line of the head. A status line clears the response, because the previous
 * lines belong to a redirect or an interim response. */
void ebpo_http_response_line(ebpo_http_response *response, const char *line, size_t size);

/* Returns true for content types of text. Login and error pages have such types, models do not. */
bool ebpo_http_response_is_text(const char *type);

typedef enum ebpo_verdict {
    EBPO_HTTP_PART,   /* the body is the range, or its beginning */
    EBPO_HTTP_WHOLE,  /* the body is the whole file */
    EBPO_HTTP_LATER,  /* the same request may succeed later */
    EBPO_HTTP_REFUSED /* the request fails */
} ebpo_verdict;

typedef struct ebpo_http_request {
    uint64_t begin, end; /* bytes [begin, end) */
    /* version that the response must have. NULL: the first request, which determines the version;
     * the file may end before `end` */
    const ebpo_http_version *pinned;
    uint64_t whole_limit; /* greatest size of a file that is read without ranges */
    bool unversioned;     /* only sizes are compared */
} ebpo_http_request;

enum { EBPO_WHY_BYTES = 240 };

/* Judges a response. For LATER and REFUSED, sets `why` to the text of an error message, which
 * follows the file's name. For REFUSED, *status is set. */
ebpo_verdict ebpo_http_response_judge(const ebpo_http_response *response,
                                      const ebpo_http_request *request, ebpo_status *status,
                                      char why[EBPO_WHY_BYTES]);

#endif
