/* The top of a tree: levels 0 .. cut level without faces, and which nodes lie below.
 * Immutable; any thread. */
#ifndef EBPO_QUERY_QUERY_TOP_H
#define EBPO_QUERY_QUERY_TOP_H

#include "format/slice.h"
#include "query/accel.h"

typedef struct ebpo_top_planes {
    uint32_t first;
    uint32_t count;
} ebpo_top_planes;

typedef struct ebpo_top {
    int cut_level;
    /* entries UNIFORM, GRAY (levels above the cut), BELOW (gray nodes of the cut level, leaves down
     * to it, pruned nodes) */
    ebpo_node_table nodes;
    uint32_t *planes;      /* codes */
    ebpo_top_planes *gray; /* which of them are the gray node's whose children are group g */

    uint64_t below_count;
    ebpo_node *below;              /* NULL of envelopes alone */
    ebpo_top_planes *below_planes; /* [below_count]; leaves have none */
    uint64_t bytes;
} ebpo_top;

EBPO_MUST_USE ebpo_status ebpo_top_read(ebpo_top **out, const ebpo_file *file, int cut_level,
                                        unsigned threads, ebpo_error *error);
/* Only envelopes, with room for nothing else: without `below`. */
EBPO_MUST_USE ebpo_status ebpo_top_read_envelopes(ebpo_top **out, const ebpo_file *file,
                                                  int cut_level, unsigned threads,
                                                  ebpo_error *error);
void ebpo_top_free(ebpo_top *top);

/* Bytes that the top will take: from the head alone. */
uint64_t ebpo_top_estimate(const ebpo_info *info, int cut_level);
uint64_t ebpo_top_envelopes_estimate(const ebpo_info *info, int cut_level);

#endif
