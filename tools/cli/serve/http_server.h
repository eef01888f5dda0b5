/* Serves contents over HTTP on the loopback interface, each connection on a separate thread. */
#ifndef EBPO_TOOLS_HTTP_SERVER_H
#define EBPO_TOOLS_HTTP_SERVER_H

#include <stdbool.h>
#include <stdint.h>

/* The content of a path. */
typedef struct http_content {
    const char *type;     /* media type of the bytes */
    const char *location; /* with HTTP_FOUND: address to which the client is sent; else NULL */
    int file; /* open file with the content; the server closes it. -1: `bytes` is the content */
    const void *bytes; /* must stay valid until the server ends */
    uint64_t size;
    char tag[64]; /* version, in quotes; "": none */
} http_content;

/* Finds the content of a decoded path. Called by several threads. Returns the status code of the
 * response: HTTP_OK, HTTP_FOUND with a location, HTTP_NOT_FOUND, HTTP_GONE or HTTP_FAILED. */
typedef int (*http_find_fn)(void *user, const char *path, bool has_query, http_content *out);

/* Listens on 127.0.0.1. *port: 0 for any free port; set to the port that is used. From now on,
 * SIGINT and SIGTERM end the server, or prevent its start, and no longer end the process. Returns
 * the socket, or -1 with errno. */
int http_server_listen(int *port);

/* Serves until SIGINT or SIGTERM arrives, then ends all connections. Closes the socket. Returns
 * false, with errno, if the server cannot wait for clients. */
bool http_server_run(int listener, http_find_fn find, void *user);

#endif
