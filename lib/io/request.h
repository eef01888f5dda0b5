/* A byte range that is wanted, and what came of it. */
#ifndef EBPO_IO_REQUEST_H
#define EBPO_IO_REQUEST_H

#include <ebpo/http.h>

#include "io/answer.h"

/* Zero-initialise, fill in the first part, keep in place until done. */
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

#endif
