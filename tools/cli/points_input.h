/* Between the files that read points: not for others. */
#ifndef EBPO_TOOLS_POINTS_INPUT_H
#define EBPO_TOOLS_POINTS_INPUT_H

#include "cli/points.h"

/* The longest line of text, and what is read at a time; columns that a header may name. */
enum { POINTS_LINE = 1 << 18, POINTS_TEXT = 1 << 17, POINTS_FIELDS = 256 };

/* As `fault_at`: the line behind those of the block. */
#define POINTS_BEHIND UINT64_MAX

/* What is wrong with a block, behind its last row; `at` as in `fault_at`. False. */
__attribute__((format(printf, 3, 4))) bool points_fault(points_block *b, uint64_t at,
                                                        const char *format, ...);

/* Reads on, behind the `rest`, once or to the end; false after an error, which the block tells. */
bool points_fill(points *p, points_block *b);
bool points_fill_all(points *p, points_block *b);
/* Takes bytes from the beginning of `rest`. */
void points_drop(points *p, size_t bytes);

/* By the first bytes: a PLY, a NumPy array, HDF5, text or raw doubles. False: the block tells. */
bool points_recognise(points *p, points_block *b);

/* The same for "FILE.h5:/path" where FILE.h5 is a file. False after an error, which has been said.
 */
bool points_is_dataset(const char *path);
bool points_open_dataset(points *p, const char *path);

/* The line of names, if it is in the block, which begins behind it then; what it tells stands in
 * `p`. False: the block tells. */
bool points_take_header(points *p, points_block *b);
/* The fields of a line that ends at `end` with a zero byte: without blanks and quotes around them,
 * each with a zero byte of its own; their number. */
int points_split(char separator, char *line, char *end, char *field[POINTS_FIELDS]);

#endif
