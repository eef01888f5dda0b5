/* Binary heaps in arrays that the caller lets grow: the item that comes before all others stands
 * first. One thread. */
#ifndef EBPO_CORE_HEAP_H
#define EBPO_CORE_HEAP_H

#include <stdint.h>

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
