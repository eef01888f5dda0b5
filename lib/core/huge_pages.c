/* Asking the system for large pages; that it may decline changes nothing. */
#include "core/huge_pages.h"

#include <stdint.h>
#include <sys/mman.h>

void ebpo_prefer_huge_pages(void *array, size_t bytes)
{
#if defined(EBPO_HAVE_MADVISE) && defined(MADV_HUGEPAGE)
    const uintptr_t page = (uintptr_t)1 << 21;
    uintptr_t from = (uintptr_t)array, to = from + bytes;
    uintptr_t skipped = (page - from % page) % page;
    to -= to % page;
    if (array && bytes > skipped && to > from + skipped)
        madvise((char *)array + skipped, to - from - skipped, MADV_HUGEPAGE);
#else
    (void)array, (void)bytes;
#endif
}
