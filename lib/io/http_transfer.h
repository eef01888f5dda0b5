/* Sends requests for byte ranges of a file on a server, several at a time, with retries. A separate
 * thread drives libcurl. */
#ifndef EBPO_IO_HTTP_TRANSFER_H
#define EBPO_IO_HTTP_TRANSFER_H

#include <pthread.h>

#include <ebpo/http.h>

#include "io/http_response.h"

/* A requested byte range, and its result. Initialise a request with zeros, fill in the members up
 * to `first`, and do not move the request until it is done. */
typedef struct ebpo_request {
    uint64_t offset, size; /* size > 0 */
    uint8_t *data;         /* [size] */
    /* true for the first request, when the file's size and version are not known. Then the file may
     * be shorter than the range, and the server may send the whole file */
    bool first;
    /* The members from here to `type` are valid when `done` is true. */
    bool done;
    ebpo_status status;
    ebpo_error error;
    uint64_t got; /* bytes received; fewer than `size` only if `first` is true and the file is
                     shorter */
    /* if `first` is true and the server does not support ranges: all version.size bytes of the
     * file, which the caller frees; `data` is then unused */
    uint8_t *whole;
    ebpo_http_version version;       /* version of the file, set if `first` is true */
    char type[EBPO_HTTP_TYPE_BYTES]; /* content type of the response */
    /* Private to http_transfer.c. */
    struct ebpo_request *next; /* next request in the queue, or of the same attempt */
    unsigned failures;         /* number of failed attempts */
    double due;                /* time of the next attempt, in seconds of ebpo_seconds */
    double
        deadline; /* end of the time limit; 0: no reader waits, and the request was not sent yet */
    uint64_t whole_capacity;
} ebpo_request;

typedef struct ebpo_transfers ebpo_transfers;

/* Creates a queue of requests, and starts the thread that sends them. `url`: with user and
 * password, if any. `shown`: the URL for messages. `options`, `url` and `shown` must outlive the
 * transfers. The comment "Lock held" means that the caller of the function must hold `lock`. `done`
 * is broadcast whenever a request ends. */
EBPO_MUST_USE ebpo_status ebpo_transfers_make(ebpo_transfers **out, const char *url,
                                              const char *shown, const ebpo_http_options *options,
                                              pthread_mutex_t *lock, pthread_cond_t *done,
                                              ebpo_error *error);
/* Stops the thread and frees the transfers. Aborts running requests, and does not mark them as
 * done. NULL is allowed. The caller must not hold the lock. */
void ebpo_transfers_free(ebpo_transfers *transfers);

/* Lock held. Queues a request. Urgent requests are sent before all others. */
void ebpo_transfers_add(ebpo_transfers *transfers, ebpo_request *request, bool urgent);
/* Lock held. Marks a request as waited for: the request becomes urgent, and its time limit begins.
 */
void ebpo_transfers_urge(ebpo_transfers *transfers, ebpo_request *request);
/* Lock held. From now on, refuses responses with another version than `version`. */
void ebpo_transfers_pin(ebpo_transfers *transfers, const ebpo_http_version *version);
/* Lock held. Returns true if the server has sent several ranges in one response. */
bool ebpo_transfers_joins(const ebpo_transfers *transfers);
/* Lock held. Adds the numbers of requests, retries, connections and bytes to *stats. */
void ebpo_transfers_add_stats(const ebpo_transfers *transfers, ebpo_http_stats *stats);

#endif
