/* Parses requests of HTTP/1.1 (RFC 9110, RFC 9112) for files, and short messages of the server's
 * own pages (POST). Refuses everything that the server does not need: other methods, bodies of
 * other requests, absolute addresses, other host names. */
#ifndef EBPO_TOOLS_HTTP_REQUEST_H
#define EBPO_TOOLS_HTTP_REQUEST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { HTTP_HEAD_MAX = 16384, HTTP_PATH_MAX = 4096, HTTP_BODY_MAX = 1024 };

/* Status codes of responses. */
enum {
    HTTP_OK = 200,
    HTTP_NO_CONTENT = 204,
    HTTP_PARTIAL = 206,
    HTTP_FOUND = 302,
    HTTP_NOT_MODIFIED = 304,
    HTTP_BAD_REQUEST = 400,
    HTTP_FORBIDDEN = 403,
    HTTP_NOT_FOUND = 404,
    HTTP_BAD_METHOD = 405,
    HTTP_TOO_SLOW = 408,
    HTTP_GONE = 410,
    HTTP_LONG_PATH = 414,
    HTTP_BAD_RANGE = 416,
    HTTP_OTHER_HOST = 421,
    HTTP_LONG_HEAD = 431,
    HTTP_FAILED = 500,
    HTTP_BAD_VERSION = 505
};

typedef struct http_request {
    bool head_only;  /* method HEAD */
    bool is_post;    /* method POST, from a page of this server */
    size_t body;     /* number of bytes of the body; 0 for other methods */
    bool keeps;      /* the connection stays open after the response */
    bool is_foreign; /* the browser says that a page of another site or port has sent it */
    bool has_query;
    char path[HTTP_PATH_MAX]; /* decoded, without the query; begins with '/' */
    char range[64];           /* value of Range; "": none, or too long */
    char if_range[96];        /* value of If-Range; "": none; "?": too long */
    char if_none_match[256];  /* value of If-None-Match; "": none, or too long */
} http_request;

/* Parses a head of `length` bytes that ends with an empty line. takes_posts: the method POST is
 * allowed. Returns HTTP_OK, or the status code of an error, after which the connection must be
 * closed. */
int http_request_parse(const char *head, size_t length, bool takes_posts, http_request *out);

/* Finds which bytes of a content of `size` bytes a request selects. `tag`: version of the content.
 * Returns HTTP_OK for all bytes, HTTP_PARTIAL for [*first, *first + *count), or HTTP_BAD_RANGE. */
int http_request_range(const http_request *request, uint64_t size, const char *tag, uint64_t *first,
                       uint64_t *count);

/* Returns true if the client has the version `tag` already. */
bool http_request_has(const http_request *request, const char *tag);

#endif
