/* Planes that were chosen from the leaves up, and what nodes hand to their parents on the way. */
#ifndef EBPO_CONSTRUCT_PROPOSALS_H
#define EBPO_CONSTRUCT_PROPOSALS_H

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

/* Without any planes yet. False: out of memory. */
bool ebpo_proposals_make(ebpo_branch *s);
/* The planes of a node; NULL when the selection works from the root. */
const uint32_t *ebpo_proposed(const ebpo_branch *s, uint32_t detail, int *count);
void ebpo_proposals_free(ebpo_proposals *p);

void ebpo_handover_free(ebpo_handover *h);
/* False: out of memory. */
bool ebpo_handover_add(ebpo_handover *h, uint32_t normal, double origin);
/* Adds what a child hands over, from its coordinates to its parent's. */
bool ebpo_handover_gather(ebpo_handover *given, const ebpo_handover *child, unsigned octant);

#endif
