/* Different numbers out of a large range, sorted, and the position of each. */
#ifndef EBPO_FORMAT_COMPACT_H
#define EBPO_FORMAT_COMPACT_H

#include <ebpo/base.h>

typedef struct ebpo_compact {
    /* open addressing, at most half full; number UINT32_MAX: free */
    struct {
        uint32_t number, place;
    } * slot;
    uint64_t mask;
    uint32_t *sorted; /* [count] */
    uint64_t count;
} ebpo_compact;

/* What that takes of memory at most, sorting included. */
uint64_t ebpo_compact_bytes(uint64_t capacity);

/* For at most `capacity` calls of add. Numbers are below 2^32 - 1. */
EBPO_MUST_USE ebpo_status ebpo_compact_make(ebpo_compact *out, uint64_t capacity,
                                            ebpo_error *error);
void ebpo_compact_free(ebpo_compact *compact);
void ebpo_compact_add(ebpo_compact *compact, uint32_t number);
/* After the last add: sorts. */
EBPO_MUST_USE ebpo_status ebpo_compact_sort(ebpo_compact *compact, ebpo_error *error);
/* Place of a number that was added. */
uint32_t ebpo_compact_find(const ebpo_compact *compact, uint32_t number);

#endif
