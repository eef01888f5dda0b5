/* Formats and parses numbers, sizes, levels and names of options for people. */
#ifndef EBPO_TOOLS_WORDS_H
#define EBPO_TOOLS_WORDS_H

#include <stddef.h>
#include <stdint.h>

#include <ebpo/build.h>

/* Fills selection_words from the library; call first in main. */
void words_init(void);

/* Writes 999, 12.3 k, 4.56 M. */
char *words_count(char *out, size_t capacity, double v);
/* Writes 999 B, 12.3 kB, 4.56 MB: powers of 1000. */
char *words_bytes(char *out, size_t capacity, uint64_t bytes);
/* Writes the fewest digits from which the double can be restored, as number_write does. */
char *words_real(double x, char out[32]);
/* Prints `count` numbers on standard output, with the text `between` between them. */
void words_print_reals(const double *v, int count, const char *between);
/* Writes "1 hole", "3 holes". */
char *words_plural(char *out, size_t capacity, uint64_t count, const char *one, const char *many);
/* Writes the names of the ebpo_part bits with commas: "planes, mesh, maps". */
char *words_parts(char *out, size_t capacity, uint32_t parts);
/* Writes "1.0". */
char *words_format(char *out, size_t capacity, int major, int minor);
/* Writes "#ff8000" for the colour red + 256 green + 65,536 blue. */
char *words_colour(char out[8], uint32_t colour);
/* Reads "RRGGBB" or "RRGGBBAA" as 0xRRGGBBAA. Returns false for other text. */
bool words_read_colour(const char *text, uint32_t *out);
const char *words_node_type(ebpo_node_type type);
const char *words_rule(ebpo_rule rule);
const char *words_codec(ebpo_codec codec);
/* Reads digits and a unit. Sets *out to the number times the factor of the unit. `units`: names of
 * the units, NULL-terminated; the name "" permits numbers without a unit. `factors`: factor of each
 * unit. Returns false for other text. */
bool words_read_unit(const char *text, const char *const *units, const uint64_t *factors,
                     uint64_t *out);
/* Reads 64M, 1GB, 0.5G, 512k, 1000000 (powers of 1000) and 64MiB, 1Gi (of 1024). */
bool words_read_size(const char *text, uint64_t *out);

/* The levels that a text names: "3", "0-5", "3-" (to the deepest level), or a list of these,
 * separated by commas. */
typedef struct word_levels {
    uint32_t set;    /* bit i is set if level i is named */
    int first, last; /* least and greatest level of `set` */
    /* true: a range is open ("3-"); then the deepest level of a file may be less than `last` */
    bool to_end;
    bool is_contiguous; /* true: no level between `first` and `last` is missing */
} word_levels;

bool words_read_levels(const char *text, word_levels *out);

/* Expected form, for texts that ebpo_is_date refuses. */
#define WORDS_DATE_EXPECTED \
    "a date as in ISO 8601 and in the calendar, such as 2026-11-26 or 2026-11-26T21:43:05Z"

/* Expected forms, for texts that words_read_size and words_read_levels refuse. */
#define WORDS_COLOUR_EXPECTED "RRGGBB or RRGGBBAA in hexadecimal"
#define WORDS_SIZE_EXPECTED   "a size such as 512M, 0.5G or 1GiB"
#define WORDS_LEVELS_EXPECTED "levels such as 3, 0-5, 3- or 0,2,4; the deepest possible is 20"
bool words_end_with(const char *text, const char *end);
void words_hex(const uint8_t digest[32], char out[65]);

/* Lists of words for option tables, NULL-terminated. The words of a list have the order of an enum.
 */
extern const char *const rule_words[];
extern const char *selection_words[];     /* by ebpo_selection; words_init fills it in */
extern const char *const normals_words[]; /* by ebpo_normal_distance */
extern const char *const codec_words[];
extern const char *const part_words[]; /* word i is bit i */

/* Returns the part of a path after the last separator ('/', on Windows also '\\'). */
const char *words_file_name(const char *path);

#endif
