/* Reads points, rays or boxes from standard input or a file, in blocks.
 *
 * Blocks are taken (points_take) one after the other; several threads may parse blocks
 * (points_parse). Blocks must be finished (points_finish_block) in the order in which they were
 * taken, so that an error is reported after the results of all earlier rows. */
#ifndef EBPO_TOOLS_POINTS_H
#define EBPO_TOOLS_POINTS_H

#include "cli/points_input.h"

/* Opens the input. `command`: name of the command, for messages. `path`: NULL or "-" for standard
 * input. `raw`: the input is doubles. `tmax`: default for rays without tmax. Returns false, after
 * an error message, if the input cannot be opened. Call points_close in any case. */
bool points_open(points *p, const char *command, const char *path, points_kind kind, bool raw,
                 double tmax);
/* Opens the input as points_open does. If the input is an HDF5 dataset, reads only part `number` of
 * `part_count` parts. Call points_cut(p, number, part_count) next. */
bool points_open_shard(points *p, const char *command, const char *path, points_kind kind, bool raw,
                       double tmax, uint64_t number, uint64_t part_count);
void points_close(points *p);

/* Reads the first bytes, and may wait for them, to recognise the format. Returns false after an
 * error, which is reported on stderr. points_take calls this function if the caller has not. */
bool points_begin(points *p);
/* Reads the next bytes into a block: all bytes that are available without waiting, but at least one
 * row. Returns false at the end and after a fatal error. The caller initializes new blocks with
 * zeros. Only one thread at a time may call this. */
bool points_take(points *p, points_block *block);
/* Counts the rows of a block after their results were written, and reports the error of the block,
 * if any, on stderr. Call this in the order in which blocks were taken. Returns false if the block
 * has an error. */
bool points_finish_block(points *p, points_block *block);

/* Reads, parses and finishes blocks on one thread: fills rows[POINTS_BATCH][points_width]. Returns
 * the number of rows; 0 at the end or after an error. */
uint64_t points_next(points *p, double *rows);

#endif
