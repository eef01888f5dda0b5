/* Requests for byte ranges, several at a time, with retries; a thread of its own drives libcurl. */
#ifndef EBPO_IO_HTTP_TRANSFER_H
#define EBPO_IO_HTTP_TRANSFER_H

#include <pthread.h>

#include <ebpo/http.h>

#include "io/http_answer.h"

/* A byte range that is wanted, and what came of it. Zero-initialise, fill in the first part, keep
 * in place until done. */
typedef struct ebpo_request {
    uint64_t offset, size; /* size > 0 */
    uint8_t *data;         /* [size] */
    /* the file's size and version are not known yet: the file may turn out to be shorter, and may
     * come as a whole */
    bool first;
    /* When done. */
    bool done;
    ebpo_status status;
    ebpo_error error;
    uint64_t got; /* bytes; fewer than `size` at the end of the file, when `first` */
    /* `first`, from a server without ranges: the file, [version.size] bytes, the taker's to free;
     * then `data` is unused */
    uint8_t *whole;
    ebpo_http_version version; /* `first` */
    char type[EBPO_HTTP_TYPE_BYTES];
    /* The transfers' own. */
    struct ebpo_request *next;
    unsigned failures;
    double due, deadline; /* seconds; deadline 0: nobody waits and nothing was sent yet */
    uint64_t whole_capacity;
} ebpo_request;

typedef struct ebpo_transfers ebpo_transfers;

/* The texts of `options` must outlive the transfers. Functions below that say so are called with
 * `lock` held; wait for a request on `done`, which is broadcast whenever one ends. `url`: with user
 * and password, if it has them; `shown`: for messages. */
EBPO_MUST_USE ebpo_status ebpo_transfers_make(ebpo_transfers **out, const char *url,
                                              const char *shown, const ebpo_http_options *options,
                                              pthread_mutex_t *lock, pthread_cond_t *done,
                                              ebpo_error *error);
/* Gives up what is under way, whose requests stay as they are. NULL is fine. Not with the lock
 * held. */
void ebpo_transfers_free(ebpo_transfers *transfers);

/* Lock held. Queues a request: `urgent` before all that are not. */
void ebpo_transfers_add(ebpo_transfers *transfers, ebpo_request *request, bool urgent);
/* Lock held. Somebody waits now: a queued request moves to the front, and its time limit begins. */
void ebpo_transfers_urge(ebpo_transfers *transfers, ebpo_request *request);
/* Lock held. From now on every answer must be of this version. */
void ebpo_transfers_pin(ebpo_transfers *transfers, const ebpo_http_version *version);
/* Lock held. requests, retries, connections, bytes. */
void ebpo_transfers_add_stats(const ebpo_transfers *transfers, ebpo_http_stats *stats);

#endif
