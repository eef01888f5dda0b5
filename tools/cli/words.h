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
/* Writes the fewest digits that read as the same double, as number_write does. */
char *words_real(double x, char out[32]);
/* Prints to standard output. */
void words_print_reals(const double *v, int count, const char *between);
/* Writes "1 hole", "3 holes". */
char *words_plural(char *out, size_t capacity, uint64_t count, const char *one, const char *many);
/* Writes the names of the ebpo_part bits with commas: "planes, mesh, maps". */
char *words_parts(char *out, size_t capacity, uint32_t parts);
/* Writes "1.0". */
char *words_format(char *out, size_t capacity, int major, int minor);
/* Writes "#ff8000" for the colour red + 256 green + 65,536 blue. */
char *words_colour(char out[8], uint32_t colour);
const char *words_node_type(ebpo_node_type type);
const char *words_rule(ebpo_rule rule);
const char *words_codec(ebpo_codec codec);
/* Reads digits, then nothing or one of the units. Sets *out to the number times the factor of its
 * unit. units: NULL-terminated; "" for no unit. factors: [unit]. Returns false for other text. */
bool words_read_unit(const char *text, const char *const *units, const uint64_t *factors,
                     uint64_t *out);
/* Reads 64M, 1GB, 0.5G, 512k, 1000000 (powers of 1000) and 64MiB, 1Gi (of 1024). */
bool words_read_size(const char *text, uint64_t *out);

/* Levels named by "3", "0-5", "3-" (to the deepest) and comma-separated lists of these. */
typedef struct word_levels {
    uint32_t set; /* one bit for each level */
    int first, last;
    bool
        to_end; /* a range is open ("3-"), so the deepest level of a file may be less than `last` */
    bool is_contiguous; /* no level between the first and the last is missing */
} word_levels;

bool words_read_levels(const char *text, word_levels *out);

/* Expected form, for texts that ebpo_is_date refuses. */
#define WORDS_DATE_EXPECTED \
    "a date as in ISO 8601 and in the calendar, such as 2026-11-26 or 2026-11-26T21:43:05Z"

/* Expected forms, for texts that words_read_size and words_read_levels refuse. */
#define WORDS_SIZE_EXPECTED   "a size such as 512M, 0.5G or 1GiB"
#define WORDS_LEVELS_EXPECTED "levels such as 3, 0-5, 3- or 0,2,4; the deepest possible is 20"
bool words_end_with(const char *text, const char *end);
void words_hex(const uint8_t digest[32], char out[65]);

/* NULL-terminated, in the order of the enums; for option tables. */
extern const char *const rule_words[];
extern const char *selection_words[];     /* by ebpo_selection; words_init fills it in */
extern const char *const normals_words[]; /* by ebpo_normal_distance */
extern const char *const codec_words[];
extern const char *const part_words[]; /* word i is bit i */

#endif
