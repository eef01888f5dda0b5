/* Serves contents over HTTP on the loopback interface, each connection on a separate thread. */
#ifndef EBPO_TOOLS_HTTP_SERVER_H
#define EBPO_TOOLS_HTTP_SERVER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A response that is sent while it is made. */
typedef struct http_stream http_stream;

/* Sends bytes. Returns false if the client has left, or the server ends. */
bool http_stream_send(http_stream *stream, const void *bytes, size_t count);

/* Sends a response, until http_stream_send returns false. Called on the thread of its connection.
 */
typedef void (*http_stream_fn)(void *user, http_stream *stream);

/* What a path leads to. */
typedef struct http_content {
    const char *type;     /* media type of the bytes */
    const char *location; /* with HTTP_FOUND: address to which the client is sent; else NULL */
    int file; /* open file with the content; the server closes it. -1: `bytes` is the content */
    const void *bytes; /* must stay valid until the server ends */
    uint64_t size;
    char tag[64];          /* version, in quotes; "": none */
    http_stream_fn stream; /* not NULL: makes the bytes, only for pages of this server; `user` of
                            * the service is its argument */
} http_content;

/* Finds the content of a decoded path. Called by several threads. Returns the status code of the
 * response: HTTP_OK, HTTP_FOUND with a location, HTTP_NOT_FOUND, HTTP_GONE or HTTP_FAILED. */
typedef int (*http_find_fn)(void *user, const char *path, bool has_query, http_content *out);

/* Takes a message of a page of this server: `length` bytes, at most HTTP_BODY_MAX. Called by
 * several threads. Returns the status code of the response: HTTP_NO_CONTENT, HTTP_BAD_REQUEST, or
 * HTTP_NOT_FOUND. */
typedef int (*http_post_fn)(void *user, const char *path, const char *bytes, size_t length);

typedef struct http_service {
    http_find_fn find;
    http_post_fn post; /* NULL: messages are refused */
    void *user;        /* first argument of these functions */
    int stop;          /* the server ends when this descriptor can be read */
} http_service;

/* Listens on 127.0.0.1. *port: 0 for any free port; set to the port that is used. Returns
 * the socket, or -1 with errno. */
int http_server_listen(int *port);

/* Returns a descriptor that can be read when SIGINT or SIGTERM has arrived, for http_service.stop;
 * -1, with errno, after a failure. From now on, these signals do not end the process. */
int http_server_stop_at_signals(void);

/* Serves until service->stop can be read, then ends all connections. Closes the socket. Only one
 * server runs in a process. Returns false, with errno, if the server cannot wait for clients. */
bool http_server_run(int listener, const http_service *service);

#endif
