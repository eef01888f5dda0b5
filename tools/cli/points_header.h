/* The line of names before points in text. */
#ifndef EBPO_TOOLS_POINTS_HEADER_H
#define EBPO_TOOLS_POINTS_HEADER_H

#include "cli/points_input.h"

/* The line of names, if it is in the block, which begins behind it then; what it tells stands in
 * `p`. False: the block tells. */
bool points_take_header(points *p, points_block *b);
/* The fields of a line that ends at `end` with a zero byte: without blanks and quotes around them,
 * each with a zero byte of its own; their number. */
int points_split(char separator, char *line, char *end, char *field[POINTS_FIELDS]);

#endif
