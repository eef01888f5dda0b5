/* Selects a part of the points, so that several runs share a file. */
#ifndef EBPO_TOOLS_POINTS_CUT_H
#define EBPO_TOOLS_POINTS_CUT_H

#include "cli/points_input.h"

/* Selects part `number` of `of` (from 0, at most 10^9) of a file that is open and from which
 * nothing was taken; `header` must be set before. The parts hold all rows, in order, each once; a
 * part may be empty. Numbers are cut between rows, so that parts differ by at most one row. Text is
 * cut by bytes, at the next line. Only these bytes and the beginning of the file are read. A PLY
 * file has been read completely; of a dataset, points_open_shard has read only this part. Returns
 * false when the input is not a file, or is invalid; this has been reported on stderr. */
bool points_cut(points *p, uint64_t number, uint64_t of);

#endif
