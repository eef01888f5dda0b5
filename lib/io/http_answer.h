/* What a server's answer says of itself, and what that means: RFC 9110, sections 8.8, 14 and 15.
 * Pure functions. */
#ifndef EBPO_IO_HTTP_ANSWER_H
#define EBPO_IO_HTTP_ANSWER_H

#include <stdbool.h>
#include <stddef.h>

#include <ebpo/base.h>

enum { EBPO_HTTP_TAG_BYTES = 200, EBPO_HTTP_TYPE_BYTES = 64, EBPO_HTTP_HEADERS_MAX = 1 << 18 };

/* The version of a file. Texts are "" when the server does not send them. */
typedef struct ebpo_http_version {
    uint64_t size;
    char etag[EBPO_HTTP_TAG_BYTES]; /* without the mark of a weak one */
    char modified[EBPO_HTTP_TAG_BYTES];
} ebpo_http_version;

typedef struct ebpo_answer {
    int code;       /* 0: no status line yet */
    bool http2;     /* or later: the end of a body is certain */
    bool has_range; /* Content-Range with a range, [begin, last] of `total` */
    /* a size in it: also without a range, "bytes * / 123" without the blanks */
    bool has_total;
    bool bad_range; /* one that makes no sense, or two different ones */
    bool has_length, chunked, encoded;
    uint64_t begin, last, total, length;
    char etag[EBPO_HTTP_TAG_BYTES], modified[EBPO_HTTP_TAG_BYTES];
    char type[EBPO_HTTP_TYPE_BYTES]; /* "text/html", in small letters */
    uint64_t header_bytes;
} ebpo_answer;

/* One line of the head, as it came. A status line begins anew: what came before was a redirect or
 * an interim answer. */
void ebpo_answer_line(ebpo_answer *answer, const char *line, size_t size);

/* Returns true for types of text, which pages about a login or an error have and no model has. */
bool ebpo_answer_is_text(const char *type);

typedef enum ebpo_verdict {
    EBPO_ANSWER_PART,  /* the body is the range, or its beginning */
    EBPO_ANSWER_WHOLE, /* the body is the whole file */
    EBPO_ANSWER_LATER, /* try again */
    EBPO_ANSWER_REFUSED
} ebpo_verdict;

typedef struct ebpo_asked {
    uint64_t begin, end; /* bytes [begin, end) */
    /* NULL: the first request, which learns the version; the file may end before `end` */
    const ebpo_http_version *pinned;
    uint64_t whole_limit;
    bool unversioned; /* only sizes are compared */
} ebpo_asked;

enum { EBPO_WHY_BYTES = 240 };

/* `why` is set for LATER and REFUSED: the rest of a sentence that begins with the file's name.
 * *status: of REFUSED. */
ebpo_verdict ebpo_answer_judge(const ebpo_answer *answer, const ebpo_asked *asked,
                               ebpo_status *status, char why[EBPO_WHY_BYTES]);

#endif
