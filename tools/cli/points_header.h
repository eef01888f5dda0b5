/* Reads the first line of text input, which names the columns (--header). */
#ifndef EBPO_TOOLS_POINTS_HEADER_H
#define EBPO_TOOLS_POINTS_HEADER_H

#include "cli/points_input.h"

/* Reads the line of names if this line is in the block. The block then begins after the line, and
 * p->field, p->fields and p->separator are set. Returns false after an error, which is in the
 * block. */
bool points_take_header(points *p, points_block *b);
/* Splits a line into fields. Removes blanks and quotes around each field, and writes a zero byte
 * after it. `separator`: 0 means blanks. `end`: end of the line; *end must be 0. Returns the number
 * of fields. */
int points_split(char separator, char *line, char *end, char *field[POINTS_FIELDS]);

#endif
