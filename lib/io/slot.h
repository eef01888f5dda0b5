/* Inside lib/io: places for requests under way. */
#ifndef EBPO_IO_SLOT_H
#define EBPO_IO_SLOT_H

#include <curl/curl.h>

#include <pthread.h>

#include "io/redirect.h"
#include "io/request.h"

enum { EBPO_SLOTS_MAX = 32 };

typedef struct ebpo_transfers ebpo_transfers;

/* One of the places for requests under way, with a handle that is used again and again. */
typedef struct ebpo_slot {
    ebpo_transfers *owner;
    CURL *easy;
    ebpo_request *request;    /* NULL: free */
    ebpo_http_version pinned; /* a copy for this attempt */
    bool is_pinned;
    ebpo_answer answer;
    ebpo_redirect redirect;
    bool judged, stopped, stalled; /* stopped, stalled: we ended the transfer ourselves */
    bool sent;                     /* connected, and the request is out */
    double moved;                  /* time of the last bytes */
    ebpo_verdict verdict;
    ebpo_status status;
    char why[EBPO_WHY_BYTES];
    uint64_t begin, end;                /* requested in this attempt */
    uint64_t received, taken, unwanted; /* bytes of its body */
    char trouble[CURL_ERROR_SIZE];
} ebpo_slot;

struct ebpo_transfers {
    const char *url, *shown;
    const ebpo_http_options *options;
    pthread_mutex_t *lock;
    pthread_cond_t *done;
    CURLM *multi;
    struct curl_slist *headers, *bare_headers; /* with the caller's, and without */
    pthread_t thread;
    bool running;
    ebpo_slot slots[EBPO_SLOTS_MAX];
    unsigned slot_count, active;
    /* Guarded by the lock. */
    bool quit, cancelled;
    ebpo_request *queue; /* urgent ones first */
    ebpo_http_version pinned;
    bool is_pinned;
    ebpo_http_stats stats;
    /* The thread's own. */
    uint64_t random;
};

/* Options that stay the same for all requests. The owner's url, options and headers are set. */
EBPO_MUST_USE bool ebpo_slot_set_up(ebpo_slot *slot);
/* Decides what the answer is, from its head; once for each attempt. */
void ebpo_slot_judge(ebpo_slot *slot);

#endif
