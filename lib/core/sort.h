/* Sorts more records than memory holds. Also provides qsort with a context, and heaps. Records are
 * distributed to groups by the leading bits of their keys; each group is a contiguous part of the
 * result and is sorted separately. An array is read and written either from begin to end, or at one
 * position for each group. */
#ifndef EBPO_CORE_SORT_H
#define EBPO_CORE_SORT_H

#include <stdint.h>
#include <stdlib.h>

#include "core/workspace.h"

enum {
    EBPO_SORT_BINS = 1 << 18, /* number of values that the leading bits of a key may have */
    EBPO_SORT_PASSES = 3,     /* passes of a sort, for the progress */
    EBPO_SORT_RECORD_MAX = 64 /* greatest size of a record in bytes */
};

/* A sort of `count` records. The caller makes the records and receives the sorted records through
 * callbacks. */
typedef struct ebpo_sort {
    ebpo_workspace *workspace; /* allocates the arrays of records; NULL: malloc */
    unsigned threads;
    const ebpo_progress *progress; /* may be NULL */
    const char *stage;             /* name of the stage, for the progress */
    uint64_t
        passes_before; /* number of passes of this stage that precede the sort, for the progress */
    uint64_t count;
    size_t record;  /* bytes of a record; its first 8 bytes are its key, a uint64_t */
    unsigned shift; /* key >> shift is below EBPO_SORT_BINS for all keys */
    void *context;
    /* Makes the records [begin, end) of the unsorted order, and writes them to `records`. Called
     * from any thread, and twice for each record. The keys of both calls must be the same: the
     * first call decides how much memory a group of keys has. */
    ebpo_status (*make)(void *context, uint64_t begin, uint64_t end, void *records,
                        ebpo_error *error);
    /* Compares two different records with equal keys. Returns a number below 0 if `a` comes first,
     * above 0 if `b` comes first. NULL if all keys are different. */
    int (*compare)(const void *a, const void *b);
    /* Receives the sorted records of a group. Called from any thread. `place`: index of the first
     * of these records among all sorted records. */
    void (*take)(void *context, uint64_t place, const void *records, uint64_t count);
} ebpo_sort;

/* Runs the sort. The result does not depend on the number of threads or on memory. */
EBPO_MUST_USE ebpo_status ebpo_sort_run(const ebpo_sort *sort, ebpo_error *error);

/* Sorts an array of numbers in ascending order; fast for short arrays. */
void ebpo_sort_numbers(uint64_t *numbers, uint64_t count);

/* ebpo_sort_with is qsort with a context for the comparison. Some systems have no such function;
 * the others have qsort_r, but with different declarations. */

typedef int (*ebpo_compare_with)(const void *a, const void *b, void *context);

#ifdef EBPO_HAVE_QSORT_R
static inline void ebpo_sort_with(void *items, size_t count, size_t size, ebpo_compare_with compare,
                                  void *context)
{
    qsort_r(items, count, size, compare, context);
}
#else
/* The sort that this thread runs. qsort calls the comparison on the thread that called qsort. */
static _Thread_local struct {
    ebpo_compare_with compare;
    void *context;
} ebpo_sorting;

/* Calls the comparison of the sort that this thread runs. */
static inline int ebpo_compare_now(const void *a, const void *b)
{
    return ebpo_sorting.compare(a, b, ebpo_sorting.context);
}

/* Sorts with a context. A comparison must not call this function. */
static inline void ebpo_sort_with(void *items, size_t count, size_t size, ebpo_compare_with compare,
                                  void *context)
{
    ebpo_sorting.compare = compare;
    ebpo_sorting.context = context;
    qsort(items, count, size, ebpo_compare_now);
}
#endif

/* Binary heaps in arrays, for one thread. The first item of a heap comes before all other items. */

/* Defines two functions for a heap of items of type `type`. `before(a, b)` takes const pointers and
 * returns true if *a comes before *b. NAME_add adds an item to a heap of `count` items; the array
 * must have capacity for this item. NAME_take removes and returns the first item of a heap of
 * `count` items (at least 1). The order of equal items depends only on the order of calls. */
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
