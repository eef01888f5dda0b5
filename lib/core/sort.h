/* Sorting: records in far larger numbers than memory holds, qsort with a context, and heaps.
 * Records are distributed to groups by the leading bits of their keys, and each group, a
 * contiguous part of the result, is sorted by itself. Arrays are read and written in order, or at
 * as many positions at a time as there are groups. */
#ifndef EBPO_CORE_SORT_H
#define EBPO_CORE_SORT_H

#include <stdint.h>
#include <stdlib.h>

#include "core/workspace.h"

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

/* qsort with a context for the comparison, which systems have in different forms or not at all. */

typedef int (*ebpo_compare_with)(const void *a, const void *b, void *context);

#ifdef EBPO_HAVE_QSORT_R
static inline void ebpo_sort_with(void *items, size_t count, size_t size, ebpo_compare_with compare,
                                  void *context)
{
    qsort_r(items, count, size, compare, context);
}
#else
/* qsort compares on the thread that called it. */
static _Thread_local struct {
    ebpo_compare_with compare;
    void *context;
} ebpo_sorting;

static inline int ebpo_compare_now(const void *a, const void *b)
{
    return ebpo_sorting.compare(a, b, ebpo_sorting.context);
}

/* Never from within a comparison. */
static inline void ebpo_sort_with(void *items, size_t count, size_t size, ebpo_compare_with compare,
                                  void *context)
{
    ebpo_sorting.compare = compare;
    ebpo_sorting.context = context;
    qsort(items, count, size, ebpo_compare_now);
}
#endif

/* Binary heaps in arrays that the caller lets grow: the item that comes before all others stands
 * first. One thread. */

/* Two functions for items of a type, `before(a, b)` told of const pointers: NAME_add puts an item
 * into a heap of `count` others, which has room for it; NAME_take takes out the first one of
 * `count`, 1 or more. Of equal ones, which comes first depends on nothing but the order of calls.
 */
#define EBPO_HEAP(name, type, before)                                                 \
    static void name##_add(type *heap, uint64_t count, const type *added)             \
    {                                                                                 \
        uint64_t at = count;                                                          \
        for (uint64_t up; at > 0 && before(added, &heap[up = (at - 1) / 2]); at = up) \
            heap[at] = heap[up];                                                      \
        heap[at] = *added;                                                            \
    }                                                                                 \
    static type name##_take(type *heap, uint64_t count)                               \
    {                                                                                 \
        type first = heap[0], last = heap[--count];                                   \
        uint64_t at = 0;                                                              \
        for (uint64_t next; (next = 2 * at + 1) < count; at = next) {                 \
            next += next + 1 < count && before(&heap[next + 1], &heap[next]);         \
            if (!before(&heap[next], &last))                                          \
                break;                                                                \
            heap[at] = heap[next];                                                    \
        }                                                                             \
        heap[at] = last;                                                              \
        return first;                                                                 \
    }

#endif
