/* Selections from the leaves up (the theses'): what they chose for each node, before the walk from
 * the root down writes it. */
#ifndef EBPO_BUILD_PROPOSE_H
#define EBPO_BUILD_PROPOSE_H

#include "construct/builder.h"

/* A plane that a node's parent may choose from: its normal, and n . xi of the face that it comes
 * from. */
typedef struct ebpo_offer {
    uint32_t normal;
    double origin;
} ebpo_offer;

/* What a node hands to its parent, in its own cell's coordinates: its planes and the corners of its
 * envelope's polygons (EBP 2017, 3.4.1). */
typedef struct ebpo_handover {
    ebpo_offer *offers;
    double (*corner)[3];
    uint64_t offer_count, offer_capacity, corner_count, corner_capacity;
} ebpo_handover;

/* Chosen planes of a branch's gray nodes and leaves, by detail. */
typedef struct ebpo_proposals {
    uint64_t *first; /* [detail_count] in `codes` */
    uint8_t *count;  /* [detail_count] */
    uint32_t *codes;
    uint64_t code_count, code_capacity;
    bool packed;        /* the arrays are in the builder's store */
    ebpo_handover root; /* a subtree's, until the top has used it */
} ebpo_proposals;

/* All branches; nothing to do for a selection from the root. After labels (which tell windings).
 * Pieces are partitioned for it, and forgotten again. */
EBPO_MUST_USE ebpo_status ebpo_build_propose(ebpo_builder *b, ebpo_error *error);

/* The planes of a node; NULL when the selection works from the root. */
const uint32_t *ebpo_proposed(const ebpo_branch *s, uint32_t detail, int *count);

void ebpo_proposals_free(ebpo_proposals *p);

#endif
