/* Selects a part of the points, so that several runs of a command can share a file (--shard). */
#ifndef EBPO_TOOLS_POINTS_CUT_H
#define EBPO_TOOLS_POINTS_CUT_H

#include "cli/points_input.h"

/* Selects part `number` of `part_count` parts (number: from 0; part_count: at most 10^9). The input
 * is open, no block has been taken, and p->header has been set.
 *
 * Together the parts have all rows, in order, each row once; a part may be empty. Binary numbers
 * are cut so that the numbers of rows of two parts differ by at most one. Text is cut into parts of
 * equal byte counts; a line belongs to the part in which it begins. If the input is text or binary
 * numbers, only the bytes of the part and the beginning of the file are read. A PLY file is read
 * completely. If the input is an HDF5 dataset, points_open_shard has read only this part.
 *
 * Returns false if the input is not a file, or is invalid; this has been reported on stderr. */
bool points_cut(points *p, uint64_t number, uint64_t part_count);

#endif
