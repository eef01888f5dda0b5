/* Reading what is asked about: points, rays or boxes, from standard input or a file, in blocks.
 * Blocks are taken one after the other, their numbers may be read on several threads at a time, and
 * then they pass in the order in which they were taken: what is wrong in one is said after the
 * answers before it. */
#ifndef EBPO_TOOLS_POINTS_H
#define EBPO_TOOLS_POINTS_H

#include "cli/points_input.h"

/* `by`: the command. `path` NULL or "-": standard input. False: it cannot be opened (said on
 * stderr). points_close in any case. */
bool points_open(points *p, const char *by, const char *path, points_kind kind, bool raw,
                 double tmax);
/* The same for points_cut(p, number, of), which must follow: of a dataset that part is read. */
bool points_open_shard(points *p, const char *by, const char *path, points_kind kind, bool raw,
                       double tmax, uint64_t number, uint64_t of);
void points_close(points *p);

/* Looks at the first bytes, for which it may wait: whether all is well so far; what is wrong is
 * said on stderr. points_take does so by itself. */
bool points_begin(points *p);
/* The next bytes, as many as are there without waiting, but at least one row's; false at the end,
 * and after what makes going on senseless. Blocks begin as zeros. One thread at a time. */
bool points_take(points *p, points_block *block);
/* After its answers have left, in order. False: the block was cut short by what is wrong, which has
 * been said on stderr. */
bool points_pass(points *p, points_block *block);

/* All of this on one thread: fills rows[POINTS_BATCH][points_width]; their number, 0 at the end or
 * after an error. */
uint64_t points_next(points *p, double *rows);

#endif
