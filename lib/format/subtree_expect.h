/* Telling the source all that subtrees take, at once. */
#ifndef EBPO_FORMAT_SUBTREE_EXPECT_H
#define EBPO_FORMAT_SUBTREE_EXPECT_H

#include "format/chunks.h"

/* All chunks of the subtrees [first, first + count) that are not in memory: nodes below their
 * roots, of the arrays that are there for `needs`; with EBPO_NEEDS_MESH the faces that their leaves
 * list, with EBPO_NEEDS_MAPS these faces' numbers in the source. Without `faces`, nodes
 * down to `last_level` only. Needs the table's rows, which it
 * reads. What cannot be announced is read without. Only files far away care. */
void ebpo_subtrees_expect(ebpo_chunks *chunks, ebpo_expected *expected, uint64_t first,
                          uint64_t count, uint32_t needs, int last_level, bool faces);

#endif
