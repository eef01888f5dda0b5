/* Planes from the leaves up, of the nodes of a piece. */
#ifndef EBPO_CONSTRUCT_PROPOSE_NODES_H
#define EBPO_CONSTRUCT_PROPOSE_NODES_H

#include "construct/proposals.h"

/* A task over the builder's pieces: partitions each, chooses for its nodes and forgets the nodes.
 */
EBPO_MUST_USE ebpo_status ebpo_propose_pieces(void *builder, uint64_t first, uint64_t last,
                                              unsigned worker, ebpo_error *error);

/* One gray node, from what its children gave. False: out of memory. */
bool ebpo_propose_alone(const ebpo_builder *b, ebpo_branch *s, uint32_t detail, ebpo_cell cell,
                        int32_t winding, ebpo_handover *given, ebpo_handover *out);

#endif
