/* Selects a part of the points, so that several runs share a file. */
#ifndef EBPO_TOOLS_POINTS_CUT_H
#define EBPO_TOOLS_POINTS_CUT_H

#include "cli/points_input.h"

/* Selects part `number` of `part_count` (from 0, at most 10^9) of a file that is open and from
 * which no block has been taken; `header` must be set before. Together the parts have all rows, in
 * order, each row once; a part may be empty. Binary numbers are cut so that the numbers of rows of
 * two parts differ by at most one. Text is cut into parts of equal byte counts, at the next line.
 * Only the bytes of the part and the beginning of the file are read. A PLY file has been read
 * completely; of a dataset, points_open_shard has read only this part. Returns false if the input
 * is not a file, or is invalid; this has been reported on stderr. */
bool points_cut(points *p, uint64_t number, uint64_t part_count);

#endif
