/* Reads points, rays or boxes from standard input or a file, in blocks. Blocks are taken one after
 * the other. Several threads may parse blocks. points_pass is called for blocks in the order in
 * which they were taken, so that an error is reported after the results before it. */
#ifndef EBPO_TOOLS_POINTS_H
#define EBPO_TOOLS_POINTS_H

#include "cli/points_input.h"

/* `by`: the command. `path` NULL or "-": standard input. Returns false when it cannot be opened
 * (reported on stderr). Call points_close in any case. */
bool points_open(points *p, const char *by, const char *path, points_kind kind, bool raw,
                 double tmax);
/* Does the same for points_cut(p, number, of), which must follow: of a dataset, only that part is
 * read. */
bool points_open_shard(points *p, const char *by, const char *path, points_kind kind, bool raw,
                       double tmax, uint64_t number, uint64_t of);
void points_close(points *p);

/* Reads the first bytes, and may wait for them. Returns true while there is no error; errors are
 * reported on stderr. points_take calls this itself. */
bool points_begin(points *p);
/* Takes the next bytes: all that are available without waiting, but at least one row. Returns false
 * at the end and after a fatal error. Initialize blocks with zeros. Only one thread at a time may
 * call this. */
bool points_take(points *p, points_block *block);
/* Called in order, after the results of the block were written. Returns false when an error cut the
 * block short, which has been reported on stderr. */
bool points_pass(points *p, points_block *block);

/* Takes, parses and passes blocks on one thread: fills rows[POINTS_BATCH][points_width]. Returns
 * the number of rows; 0 at the end or after an error. */
uint64_t points_next(points *p, double *rows);

#endif
