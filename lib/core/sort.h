/* Sorts far more records than memory holds. They are distributed to groups by the leading bits of
 * their keys, and each group, a contiguous part of the result, is sorted by itself. Arrays are read
 * and written in order, or at as many positions at a time as there are groups. */
#ifndef EBPO_CORE_SORT_H
#define EBPO_CORE_SORT_H

#include "core/arrays.h"

enum { EBPO_SORT_BINS = 1 << 18, EBPO_SORT_PASSES = 3, EBPO_SORT_RECORD_MOST = 64 };

typedef struct ebpo_sort {
    ebpo_workspace *workspace;
    unsigned threads;
    const ebpo_progress *progress;
    const char *stage;
    /* of this stage, that its caller has done; sorting takes EBPO_SORT_PASSES */
    uint64_t passes_before;
    uint64_t count;
    size_t record;  /* bytes, at most EBPO_SORT_RECORD_MOST; each begins with its key, 8 bytes */
    unsigned shift; /* key >> shift is below EBPO_SORT_BINS, for all keys */
    void *context;
    /* Writes the records of items [begin, end). From any thread. */
    ebpo_status (*make)(void *context, uint64_t begin, uint64_t end, void *records,
                        ebpo_error *error);
    /* Decides between records of one key, which must differ: less than 0 when `a` comes first. */
    int (*compare)(const void *a, const void *b);
    /* Receives the sorted records, group by group, from any thread; the first has position `place`.
     */
    void (*take)(void *context, uint64_t place, const void *records, uint64_t count);
} ebpo_sort;

/* The result does not depend on threads or memory. */
EBPO_MUST_USE ebpo_status ebpo_sort_run(const ebpo_sort *sort, ebpo_error *error);

#endif
