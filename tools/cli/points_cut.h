/* A part of the points: for several runs that share a file. */
#ifndef EBPO_TOOLS_POINTS_CUT_H
#define EBPO_TOOLS_POINTS_CUT_H

#include "cli/points_input.h"

/* Part `number` of `of` (from 0, at most 10^9) is what will be taken, of a file that has been
 * opened and of which nothing was taken; `header` must be set before. The parts are all rows, in
 * order, each once; a part may be empty. Numbers are cut between rows, so that parts differ by one
 * row at most, and lines of text where a part would end within one; no more than these bytes and
 * the file's beginning are read. A PLY has been read as a whole; of a dataset points_open_shard has
 * read this part alone. False: it is no file, or is not what it says, which has been said on
 * stderr. */
bool points_cut(points *p, uint64_t number, uint64_t of);

#endif
