/* Sorting: more records than memory holds, qsort with a context, and heaps. Records are distributed
 * to groups by the leading bits of their keys; each group is a contiguous part of the result and is
 * sorted separately. Arrays are read and written in order, or at as many positions at once as there
 * are groups. */
#ifndef EBPO_CORE_SORT_H
#define EBPO_CORE_SORT_H

#include <stdint.h>
#include <stdlib.h>

#include "core/workspace.h"

enum { EBPO_SORT_BINS = 1 << 18, EBPO_SORT_PASSES = 3, EBPO_SORT_RECORD_MAX = 64 };

typedef struct ebpo_sort {
    ebpo_workspace *workspace;
    unsigned threads;
    const ebpo_progress *progress;
    const char *stage;
    /* for the progress: passes of this stage before the sort, which has EBPO_SORT_PASSES passes */
    uint64_t passes_before;
    uint64_t count;
    size_t record;  /* bytes of a record, at most EBPO_SORT_RECORD_MAX; each begins with its key, 8
                     * bytes */
    unsigned shift; /* key >> shift is below EBPO_SORT_BINS for all keys */
    void *context;
    /* Writes the records of the items [begin, end). Called from any thread. */
    ebpo_status (*make)(void *context, uint64_t begin, uint64_t end, void *records,
                        ebpo_error *error);
    /* Orders two different records with equal keys: less than 0 when `a` comes first. */
    int (*compare)(const void *a, const void *b);
    /* Receives the sorted records of a group. Called from any thread. The first record is number
     * `place` of the whole result. */
    void (*take)(void *context, uint64_t place, const void *records, uint64_t count);
} ebpo_sort;

/* Sorts; the result does not depend on threads or memory. */
EBPO_MUST_USE ebpo_status ebpo_sort_run(const ebpo_sort *sort, ebpo_error *error);

/* Sorts an array of numbers in ascending order; fast for short arrays. */
void ebpo_sort_numbers(uint64_t *numbers, uint64_t count);

/* qsort with a context for the comparison; systems declare such a qsort differently or have none.
 */

typedef int (*ebpo_compare_with)(const void *a, const void *b, void *context);

#ifdef EBPO_HAVE_QSORT_R
static inline void ebpo_sort_with(void *items, size_t count, size_t size, ebpo_compare_with compare,
                                  void *context)
{
    qsort_r(items, count, size, compare, context);
}
#else
/* qsort calls the comparison on the thread that called qsort. */
static _Thread_local struct {
    ebpo_compare_with compare;
    void *context;
} ebpo_sorting;

/* Calls the comparison of the sort that this thread runs. */
static inline int ebpo_compare_now(const void *a, const void *b)
{
    return ebpo_sorting.compare(a, b, ebpo_sorting.context);
}

/* Sorts with a context; must not be called from within a comparison. */
static inline void ebpo_sort_with(void *items, size_t count, size_t size, ebpo_compare_with compare,
                                  void *context)
{
    ebpo_sorting.compare = compare;
    ebpo_sorting.context = context;
    qsort(items, count, size, ebpo_compare_now);
}
#endif

/* Binary heaps in arrays that the caller enlarges; the first item is the one that comes before all
 * others. For one thread. */

/* Defines two functions for items of a type; `before(a, b)` takes const pointers. NAME_add adds an
 * item to a heap of `count` others, which has capacity for it. NAME_take removes the first of
 * `count` items, 1 or more. The order of equal items depends only on the order of calls. */
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
