/* What tables for people have in common: words for types of nodes, cells without a number, and
 * numbers beyond the range of a double. */
#ifndef EBPO_TOOLS_TABLES_H
#define EBPO_TOOLS_TABLES_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "cli/json.h"

enum { TABLE_CELL = 40 };

/* Which nodes are gray, leaf, white and black; below a table that counts them. */
void table_legend(FILE *out);

/* printf's `format` of x, which has one conversion of a double; "-" where x is not finite. */
const char *table_cell(char out[TABLE_CELL], const char *format, double x);

/* As above; where x is not finite, words that follow "volume". */
const char *table_volume(char out[TABLE_CELL], const char *format, double x);

/* What "-" means in columns of volumes; below a table that has some. */
void table_beyond(FILE *out);

/* x * 2^exponent with so many significant digits, 1 to 17, as %g has them; beyond the range of a
 * double with at most 9, such as 4.2e+901. */
const char *table_scaled(char out[TABLE_CELL], int digits, double x, int64_t exponent);

/* Writes x * 2^exponent as a number; beyond the range of a double the same text. */
void table_json(json *j, const char *key, double x, int64_t exponent);

/* Whether a double holds x * 2^exponent, neither infinite nor rounded to 0 or near it. */
bool table_in_range(double x, int64_t exponent);

/* "mm^3"; without a unit nothing. With a blank before. */
const char *table_unit(char out[TABLE_CELL], const char *unit, int power);

#endif
