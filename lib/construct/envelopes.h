/* The planes of a gray node. */
#ifndef EBPO_CONSTRUCT_ENVELOPES_H
#define EBPO_CONSTRUCT_ENVELOPES_H

#include "construct/builder.h"

typedef struct ebpo_envelope_scratch ebpo_envelope_scratch;
ebpo_status ebpo_scratch_make(ebpo_envelope_scratch **out, ebpo_error *error);
void ebpo_scratch_free(ebpo_envelope_scratch *scratch);

/* The own planes of a gray node, chosen now or proposed before; `envelope` is its parent's cut to
 * its cell, then its own. Returns their number, -1: out of memory. */
int ebpo_gray_planes(const ebpo_builder *b, ebpo_envelope_scratch *scratch, const ebpo_branch *s,
                     uint32_t detail, ebpo_cell cell, int32_t winding, ebpo_polytope *envelope,
                     uint32_t codes[EBPO_PLANES_STORED]);

/* What the top's gray nodes keep until the levels are joined. */

typedef struct ebpo_top_envelope {
    uint32_t codes[EBPO_PLANES_STORED];
    int count;
    double volume;
} ebpo_top_envelope;

/* The nodes above the subtrees. */
ebpo_status ebpo_build_top(ebpo_builder *b, ebpo_error *error);

#endif
