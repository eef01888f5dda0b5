/* Candidate normals of a gray node, from the faces below it. */
#ifndef EBPO_CONSTRUCT_CANDIDATES_H
#define EBPO_CONSTRUCT_CANDIDATES_H

#include "construct/builder.h"

/* At most `most` of them; returns how many. */
int ebpo_build_candidates(const ebpo_builder *b, const ebpo_branch *s,
                          const ebpo_build_detail *detail, int most, ebpo_candidate *out);

#endif
