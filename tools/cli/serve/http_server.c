/* Runs an HTTP server. Each connection has a thread and a slot. At most CONNECTIONS_MAX connections
 * are open; further connections wait in the queue of the socket. A client has HEAD_SECONDS for a
 * request, and SEND_SECONDS for each block of a response. */
#include "cli/serve/http_server.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/serve/http_request.h"

enum {
    CONNECTIONS_MAX = 32,
    HEAD_SECONDS = 15,
    SEND_SECONDS = 30,
    DRAIN_MILLISECONDS = 1000, /* time in which bytes are still received when a connection ends */
    BLOCK = 1 << 16,           /* bytes that are read from a file at a time */
    FIELDS_MAX = 2048,         /* maximum size of the header fields of a response */
    FULL_MILLISECONDS = 100    /* interval of checks for a free slot */
};

typedef struct http_server http_server;

typedef struct connection {
    http_server *server;
    int socket;      /* -1: the slot is free */
    size_t received; /* number of bytes in `head` */
    char head[HTTP_HEAD_MAX];
    char block[BLOCK];
} connection;

struct http_server {
    http_service service;
    pthread_mutex_t lock;    /* guards sockets and `open` */
    pthread_cond_t released; /* a slot became free */
    int open;                /* number of open connections */
    connection slot[CONNECTIONS_MAX];
};

/* --- sending --- */

static bool send_bytes(const connection *c, const void *bytes, size_t count)
{
    const char *at = bytes;
    while (count) {
        ssize_t n = send(c->socket, at, count, 0);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return false;
        at += n;
        count -= (size_t)n;
    }
    return true;
}

/* Sends a part of an open file. If the file has become shorter, the connection ends, so that the
 * client sees that bytes are missing. */
static bool send_file(connection *c, int file, uint64_t first, uint64_t count)
{
    while (count) {
        size_t wanted = count < sizeof c->block ? (size_t)count : sizeof c->block;
        ssize_t n = pread(file, c->block, wanted, (off_t)first);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0 || !send_bytes(c, c->block, (size_t)n))
            return false;
        first += (uint64_t)n;
        count -= (uint64_t)n;
    }
    return true;
}

struct http_stream {
    const connection *c;
};

bool http_stream_send(http_stream *stream, const void *bytes, size_t count)
{
    return send_bytes(stream->c, bytes, count);
}

static const char *reason_of(int status)
{
    switch (status) {
    case HTTP_OK: return "OK";
    case HTTP_NO_CONTENT: return "No Content";
    case HTTP_PARTIAL: return "Partial Content";
    case HTTP_FOUND: return "Found";
    case HTTP_NOT_MODIFIED: return "Not Modified";
    case HTTP_FORBIDDEN: return "Forbidden";
    case HTTP_NOT_FOUND: return "Not Found";
    case HTTP_BAD_METHOD: return "Method Not Allowed";
    case HTTP_TOO_SLOW: return "Request Timeout";
    case HTTP_GONE: return "Gone: the file was changed or removed after the start of ebpo serve";
    case HTTP_LONG_PATH: return "URI Too Long";
    case HTTP_BAD_RANGE: return "Range Not Satisfiable";
    case HTTP_OTHER_HOST: return "Misdirected Request";
    case HTTP_LONG_HEAD: return "Request Header Fields Too Large";
    case HTTP_FAILED: return "Internal Server Error";
    case HTTP_BAD_VERSION: return "HTTP Version Not Supported";
    default: return "Bad Request";
    }
}

/* Sends the head of a response. `fields`: complete lines. */
static bool send_head(const connection *c, int status, bool keeps, const char *fields)
{
    char text[FIELDS_MAX + 512];
    /* A page that sends messages must not be in a page of another site, which could lead clicks. */
    const char *frames =
        c->server->service.post ? "Content-Security-Policy: frame-ancestors 'self'\r\n" : "";
    int n = snprintf(text, sizeof text,
                     "HTTP/1.1 %d %s\r\n%s%sX-Content-Type-Options: nosniff\r\n"
                     "Cross-Origin-Resource-Policy: same-origin\r\nConnection: %s\r\n\r\n",
                     status, reason_of(status), fields, frames, keeps ? "keep-alive" : "close");
    return n > 0 && (size_t)n < sizeof text && send_bytes(c, text, (size_t)n);
}

/* Sends a response whose content is only the reason of its status. */
static bool send_status(const connection *c, int status, bool keeps, bool head_only,
                        const char *fields)
{
    char text[FIELDS_MAX];
    const char *reason = reason_of(status);
    snprintf(text, sizeof text, "%sContent-Type: text/plain\r\nContent-Length: %zu\r\n", fields,
             strlen(reason) + 1);
    return send_head(c, status, keeps, text) &&
           (head_only || (send_bytes(c, reason, strlen(reason)) && send_bytes(c, "\n", 1)));
}

static bool send_content(connection *c, const http_request *request, const http_content *content)
{
    char fields[FIELDS_MAX], range[96] = "", tag[96] = "";
    uint64_t first, count;
    if (content->tag[0])
        snprintf(tag, sizeof tag, "ETag: %s\r\n", content->tag);
    if (http_request_has(request, content->tag))
        return send_head(c, HTTP_NOT_MODIFIED, request->keeps, tag);
    int status = http_request_range(request, content->size, content->tag, &first, &count);
    if (status == HTTP_BAD_RANGE) {
        snprintf(range, sizeof range, "Content-Range: bytes */%" PRIu64 "\r\n", content->size);
        return send_status(c, status, request->keeps, request->head_only, range);
    }
    if (status == HTTP_PARTIAL)
        snprintf(range, sizeof range,
                 "Content-Range: bytes %" PRIu64 "-%" PRIu64 "/%" PRIu64 "\r\n", first,
                 first + count - 1, content->size);
    snprintf(fields, sizeof fields,
             "Content-Type: %s\r\nContent-Length: %" PRIu64 "\r\n%s%sAccept-Ranges: bytes\r\n"
             "Cache-Control: no-cache, no-transform\r\n",
             content->type, count, range, tag);
    if (!send_head(c, status, request->keeps, fields))
        return false;
    if (request->head_only)
        return true;
    return content->file >= 0 ? send_file(c, content->file, first, count)
                              : send_bytes(c, (const char *)content->bytes + first, (size_t)count);
}

/* Sends a response of unknown length; the end of the connection ends it. */
static bool send_stream(connection *c, const http_content *content)
{
    char fields[FIELDS_MAX];
    http_stream stream = { c };
    snprintf(fields, sizeof fields, "Content-Type: %s\r\nCache-Control: no-store\r\n",
             content->type);
    if (send_head(c, HTTP_OK, false, fields))
        content->stream(c->server->service.user, &stream);
    return false;
}

static bool send_response(connection *c, const http_request *request)
{
    const http_service *service = &c->server->service;
    http_content content = { .file = -1 };
    int status = service->find(service->user, request->path, request->has_query, &content);
    char fields[FIELDS_MAX - 128] = "";
    if (status == HTTP_OK && content.stream && request->is_foreign)
        status = HTTP_FORBIDDEN;
    if (status == HTTP_OK && content.stream && !request->head_only)
        return send_stream(c, &content);
    if (status == HTTP_OK) {
        bool sent = send_content(c, request, &content);
        if (content.file >= 0)
            close(content.file);
        return sent && request->keeps;
    }
    if (status == HTTP_FOUND)
        snprintf(fields, sizeof fields, "Location: %s\r\n", content.location);
    return send_status(c, status, request->keeps, request->head_only, fields) && request->keeps;
}

/* --- receiving --- */

static int64_t milliseconds_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* Returns the number of bytes of the first complete head, or 0. */
static size_t head_length(const connection *c)
{
    for (size_t i = 4; i <= c->received; i++)
        if (c->head[i - 1] == '\n' && memcmp(c->head + i - 4, "\r\n\r\n", 4) == 0)
            return i;
    return 0;
}

/* Receives a head. Returns HTTP_OK and sets *length; or returns a status code to send, or 0 if the
 * client has ended the connection or sends nothing. */
static int receive_head(connection *c, size_t *length)
{
    int64_t end = milliseconds_now() + 1000 * HEAD_SECONDS;
    while ((*length = head_length(c)) == 0) {
        if (c->received == sizeof c->head)
            return HTTP_LONG_HEAD;
        int64_t left = end - milliseconds_now();
        struct pollfd p = { c->socket, POLLIN, 0 };
        int ready = left > 0 ? poll(&p, 1, (int)left) : 0;
        if (ready < 0 && errno == EINTR)
            continue;
        if (ready <= 0)
            return c->received ? HTTP_TOO_SLOW : 0;
        ssize_t n = recv(c->socket, c->head + c->received, sizeof c->head - c->received, 0);
        if (n < 0 && (errno == EINTR || errno == EAGAIN))
            continue;
        if (n <= 0)
            return 0;
        c->received += (size_t)n;
    }
    return HTTP_OK;
}

/* Ends a connection. Bytes that the client still sends are received first, because otherwise the
 * connection could be reset before the client has the response. */
static void end_connection(connection *c)
{
    int64_t end = milliseconds_now() + DRAIN_MILLISECONDS;
    struct pollfd p = { c->socket, POLLIN, 0 };
    shutdown(c->socket, SHUT_WR);
    for (int64_t left; (left = end - milliseconds_now()) > 0 && poll(&p, 1, (int)left) > 0;)
        if (recv(c->socket, c->block, sizeof c->block, 0) <= 0)
            break;
}

/* Receives the rest of the body of a message after its head, and passes it on. Returns the status
 * code of the response. */
static int take_message(connection *c, const http_request *request)
{
    const http_service *service = &c->server->service;
    int64_t end = milliseconds_now() + 1000 * HEAD_SECONDS;
    while (c->received < request->body) {
        int64_t left = end - milliseconds_now();
        struct pollfd p = { c->socket, POLLIN, 0 };
        int ready = left > 0 ? poll(&p, 1, (int)left) : 0;
        if (ready < 0 && errno == EINTR)
            continue;
        ssize_t n =
            ready > 0 ? recv(c->socket, c->head + c->received, request->body - c->received, 0) : 0;
        if (n < 0 && (errno == EINTR || errno == EAGAIN))
            continue;
        if (n <= 0)
            return HTTP_TOO_SLOW;
        c->received += (size_t)n;
    }
    int status = service->post(service->user, request->path, c->head, request->body);
    c->received -= request->body;
    memmove(c->head, c->head + request->body, c->received);
    return status;
}

/* Responds to a message. Returns true if the connection stays open. */
static bool answer_message(connection *c, const http_request *request)
{
    int status = take_message(c, request);
    bool keeps = request->keeps && status != HTTP_TOO_SLOW;
    bool sent = status == HTTP_NO_CONTENT ? send_head(c, status, keeps, "")
                                          : send_status(c, status, keeps, false, "");
    return sent && keeps;
}

static void serve_requests(connection *c)
{
    http_request request;
    size_t length;
    for (bool more = true; more;) {
        int status = receive_head(c, &length);
        if (status == HTTP_OK)
            status = http_request_parse(c->head, length, c->server->service.post, &request);
        if (status == 0)
            return;
        if (status != HTTP_OK) {
            (void)send_status(c, status, false, false,
                              status == HTTP_BAD_METHOD ? "Allow: GET, HEAD\r\n" : "");
            break;
        }
        c->received -= length;
        memmove(c->head, c->head + length, c->received);
        more = request.is_post ? answer_message(c, &request) : send_response(c, &request);
    }
    end_connection(c);
}

static void *serve_connection(void *user)
{
    connection *c = user;
    http_server *server = c->server;
    serve_requests(c);
    pthread_mutex_lock(&server->lock);
    close(c->socket);
    c->socket = -1;
    server->open--;
    pthread_cond_signal(&server->released);
    pthread_mutex_unlock(&server->lock);
    return NULL;
}

/* --- connections --- */

/* Starts a thread for an accepted connection. Takes ownership of the socket. */
static void start_connection(http_server *server, int socket)
{
    struct timeval limit = { SEND_SECONDS, 0 };
    int one = 1;
    pthread_t thread;
    setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    pthread_mutex_lock(&server->lock);
    connection *c = server->slot;
    while (c->socket >= 0) /* the caller has found a free slot */
        c++;
    c->server = server;
    c->received = 0;
    c->socket = socket;
    server->open++;
    if (command_thread(&thread, serve_connection, c) == 0) {
        pthread_detach(thread);
    } else {
        c->socket = -1;
        server->open--;
        close(socket);
    }
    pthread_mutex_unlock(&server->lock);
}

static bool is_full(http_server *server)
{
    pthread_mutex_lock(&server->lock);
    bool full = server->open == CONNECTIONS_MAX;
    pthread_mutex_unlock(&server->lock);
    return full;
}

/* Ends all connections, and waits for their threads. */
static void end_all(http_server *server)
{
    pthread_mutex_lock(&server->lock);
    for (int i = 0; i < CONNECTIONS_MAX; i++)
        if (server->slot[i].socket >= 0)
            shutdown(server->slot[i].socket, SHUT_RDWR);
    while (server->open)
        pthread_cond_wait(&server->released, &server->lock);
    pthread_mutex_unlock(&server->lock);
}

/* Both ends of a pipe. A signal writes a byte to it. */
static int signal_pipe[2];

static void record_signal(int number)
{
    int saved = errno;
    (void)number;
    (void)!write(signal_pipe[1], "", 1);
    errno = saved;
}

int http_server_stop_at_signals(void)
{
    struct sigaction action, before;
    if (pipe(signal_pipe) != 0)
        return -1;
    memset(&action, 0, sizeof action);
    action.sa_handler = record_signal;
    action.sa_flags = (int)SA_RESETHAND; /* a second signal ends the process at once */
    sigemptyset(&action.sa_mask);
    if (sigaction(SIGTERM, &action, NULL) != 0 || sigaction(SIGINT, NULL, &before) != 0 ||
        (before.sa_handler != SIG_IGN && sigaction(SIGINT, &action, NULL) != 0))
        return -1;
    return signal_pipe[0];
}

int http_server_listen(int *port)
{
    struct sockaddr_in at = { .sin_family = AF_INET,
                              .sin_port = htons((uint16_t)*port),
                              .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    socklen_t length = sizeof at;
    int one = 1, listener = socket(AF_INET, SOCK_STREAM, 0);
    if (listener < 0)
        return -1;
    fcntl(listener, F_SETFD, FD_CLOEXEC);
    setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (bind(listener, (struct sockaddr *)&at, sizeof at) != 0 ||
        listen(listener, CONNECTIONS_MAX) != 0 ||
        getsockname(listener, (struct sockaddr *)&at, &length) != 0) {
        int saved = errno;
        close(listener);
        errno = saved;
        return -1;
    }
    *port = ntohs(at.sin_port);
    return listener;
}

/* Accepts connections until `stop` can be read. Returns false, with errno, after a failure. */
static bool accept_all(http_server *server, int listener, int stop)
{
    for (bool refused = false;;) {
        bool full = refused || is_full(server); /* refused: the system lacks resources */
        struct pollfd p[2] = { { stop, POLLIN, 0 }, { full ? -1 : listener, POLLIN, 0 } };
        if (poll(p, 2, full ? FULL_MILLISECONDS : -1) < 0 && errno != EINTR)
            return false;
        if (p[0].revents)
            return true;
        int socket = p[1].revents ? accept(listener, NULL, NULL) : -1;
        refused = socket < 0 && p[1].revents;
        if (socket < 0)
            continue;
        fcntl(socket, F_SETFD, FD_CLOEXEC);
        fcntl(socket, F_SETFL, 0);
        start_connection(server, socket);
    }
}

bool http_server_run(int listener, const http_service *service)
{
    static http_server server; /* threads use it until the end */
    server.service = *service;
    pthread_mutex_init(&server.lock, NULL);
    pthread_cond_init(&server.released, NULL);
    for (int i = 0; i < CONNECTIONS_MAX; i++)
        server.slot[i].socket = -1;
    fcntl(listener, F_SETFL, O_NONBLOCK); /* accept must not wait if the client has left */
    signal(SIGPIPE, SIG_IGN);             /* if a client has left, send returns an error */
    bool accepted = accept_all(&server, listener, service->stop);
    int saved = errno;
    close(listener);
    end_all(&server);
    errno = saved;
    return accepted;
}
