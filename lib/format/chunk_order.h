/* For writing: the order of chunks in the file.
 * format-spec/README.md, section 9. */
#ifndef EBPO_FORMAT_CHUNK_ORDER_H
#define EBPO_FORMAT_CHUNK_ORDER_H

#include "format/plan.h"

typedef struct ebpo_ordered_chunk {
    uint32_t array; /* of the plan */
    uint32_t chunk;
    uint64_t subtree; /* of its first row, where chunks are sorted by it */
} ebpo_ordered_chunk;

typedef struct ebpo_chunk_order {
    ebpo_ordered_chunk *chunk; /* [count]; all but /subtrees/places */
    uint64_t count;
    uint64_t top; /* so many are of what looking up a subtree takes */
} ebpo_chunk_order;

EBPO_MUST_USE ebpo_status ebpo_chunk_order_make(ebpo_chunk_order *out, const ebpo_plan *plan,
                                                ebpo_error *error);
void ebpo_chunk_order_free(ebpo_chunk_order *order);

#endif
