/* qsort with a context for the comparison, which systems have in different forms or not at all. */
#ifndef EBPO_CORE_SORT_WITH_H
#define EBPO_CORE_SORT_WITH_H

#include <stdlib.h>

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

#endif
