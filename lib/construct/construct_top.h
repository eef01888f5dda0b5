/* What the top's gray nodes keep until the levels are joined. */
#ifndef EBPO_CONSTRUCT_CONSTRUCT_TOP_H
#define EBPO_CONSTRUCT_CONSTRUCT_TOP_H

#include "construct/builder.h"

typedef struct ebpo_top_envelope {
    uint32_t codes[EBPO_PLANES_STORED];
    int count;
    double volume;
} ebpo_top_envelope;

/* The nodes above the subtrees. */
ebpo_status ebpo_build_top(ebpo_builder *b, ebpo_error *error);

#endif
