/* Where a request is led, and whether that is still the server that it was meant for. */
#ifndef EBPO_IO_REDIRECT_H
#define EBPO_IO_REDIRECT_H

#include <curl/curl.h>
#include <stdbool.h>
#include <stddef.h>

/* One for each attempt; zeroed, nothing has been led anywhere. */
typedef struct ebpo_redirect {
    CURLU *at;      /* the latest address, or NULL: the first one */
    char *target;   /* of the head that is being read, or NULL */
    bool elsewhere; /* another scheme, host or port has been come to, or it is not known */
} ebpo_redirect;

/* For another attempt, or for good. */
void ebpo_redirect_clear(ebpo_redirect *redirect);

/* One line of a head, as it came; `code` is the answer's. True when it is the one by which the
 * request begins to go elsewhere. */
bool ebpo_redirect_line(ebpo_redirect *redirect, const char *url, int code, const char *line,
                        size_t size);

#endif
