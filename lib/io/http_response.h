/* Interprets the head (status line and headers) of a server's response, and the heads of the parts
 * of a response with several ranges. Source: RFC 9110, sections 8.8, 14 and 15. Any thread may call
 * these functions. */
#ifndef EBPO_IO_HTTP_RESPONSE_H
#define EBPO_IO_HTTP_RESPONSE_H

#include <stdbool.h>
#include <stddef.h>

#include <ebpo/base.h>

enum {
    EBPO_HTTP_TAG_BYTES = 200,      /* size of a stored tag or time, with its zero byte */
    EBPO_HTTP_TYPE_BYTES = 64,      /* size of a stored content type, with its zero byte */
    EBPO_HTTP_BOUNDARY_BYTES = 71,  /* size of a boundary, with its zero byte (RFC 2046) */
    EBPO_HTTP_HEADERS_MAX = 1 << 18 /* greatest size of a head */
};

/* The version of a file. Texts are "" when the server does not send them. */
typedef struct ebpo_http_version {
    uint64_t size;
    char etag[EBPO_HTTP_TAG_BYTES];     /* ETag, without the mark "W/" of a weak tag */
    char modified[EBPO_HTTP_TAG_BYTES]; /* Last-Modified */
} ebpo_http_version;

/* The head of a response. */
typedef struct ebpo_http_response {
    int code;        /* 0: no status line yet */
    bool http2;      /* true: HTTP/2 or later; these versions detect a body that was cut off */
    bool has_range;  /* Content-Range has a range: bytes `begin` to `last` */
    bool has_total;  /* Content-Range has the file's size, `total` */
    bool bad_range;  /* the head has an invalid Content-Range, or two different fields Content-Range
                      */
    bool has_length; /* Content-Length exists: `length` */
    bool chunked;    /* Transfer-Encoding: chunked */
    bool encoded;    /* Content-Encoding, other than identity */
    bool joins;      /* Server names a program that sends several ranges in one response */
    uint64_t begin, last, total, length;
    char etag[EBPO_HTTP_TAG_BYTES], modified[EBPO_HTTP_TAG_BYTES];
    char type[EBPO_HTTP_TYPE_BYTES];         /* content type in lower case: "text/html" */
    char boundary[EBPO_HTTP_BOUNDARY_BYTES]; /* of the parts of a body with several ranges */
    uint64_t header_bytes; /* size of all heads, including the heads of redirects */
} ebpo_http_response;

/* Reads one line of the head, as the server sent it. A status line clears the response, because the
 * previous lines belong to a redirect or an interim response. */
void ebpo_http_response_line(ebpo_http_response *response, const char *line, size_t size);

/* Returns true for content types of text. Login and error pages have such types, but models have
 * other types. */
bool ebpo_http_response_is_text(const char *type);

/* How a response is to be used. */
typedef enum ebpo_verdict {
    EBPO_HTTP_PART,   /* the body is the range, or its beginning */
    EBPO_HTTP_WHOLE,  /* the body is the whole file */
    EBPO_HTTP_PARTS,  /* the body has a part for each of several ranges (ebpo_part_head_take) */
    EBPO_HTTP_SINGLY, /* the server must be asked for one range at a time */
    EBPO_HTTP_LATER,  /* the same request may succeed later */
    EBPO_HTTP_REFUSED /* the request fails */
} ebpo_verdict;

/* The request with which a response is compared. */
typedef struct ebpo_http_request {
    uint64_t begin, end; /* bytes [begin, end) */
    /* The version that the response must have. NULL: this is the first request, whose response
     * determines the version; the file may end before `end`. */
    const ebpo_http_version *pinned;
    uint64_t whole_limit; /* greatest size of a file that is read without ranges */
    bool unversioned;     /* only sizes are compared */
    bool several;         /* several ranges are requested; the other members are unused */
} ebpo_http_request;

enum { EBPO_WHY_BYTES = 240 }; /* size of the text of an error message */

/* Judges a response. For EBPO_HTTP_LATER and EBPO_HTTP_REFUSED, sets `why` to the text of an error
 * message, which follows the file's name. For EBPO_HTTP_REFUSED, sets *status. */
ebpo_verdict ebpo_http_response_judge(const ebpo_http_response *response,
                                      const ebpo_http_request *request, ebpo_status *status,
                                      char why[EBPO_WHY_BYTES]);

/* --- bodies with several ranges --- */

enum { EBPO_PART_LINE_BYTES = 256 }; /* greatest size of a line between parts */

/* The lines before the bytes of a part. Initialise with zeros. */
typedef struct ebpo_part_head {
    ebpo_http_response response; /* head of the part, as if it were a response of its own */
    bool in_head;                /* the boundary before the head was read */
    bool ended;                  /* the boundary after the last part was read */
    size_t length;               /* bytes of the unfinished line */
    char line[EBPO_PART_LINE_BYTES];
} ebpo_part_head;

/* Reads bytes of the body, at most up to the end of a line. `whole`: head of the response. Returns
 * the number of bytes that were read, or 0 if they are no valid lines between parts. *complete: the
 * head of a part is complete, and its bytes follow. */
size_t ebpo_part_head_take(ebpo_part_head *head, const ebpo_http_response *whole, const char *bytes,
                           size_t size, bool *complete);

#endif
