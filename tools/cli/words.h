/* Numbers and flags as people read them. */
#ifndef EBPO_TOOLS_WORDS_H
#define EBPO_TOOLS_WORDS_H

#include <stddef.h>
#include <stdint.h>

#include <ebpo/build.h>

/* Before all else in main: words that the library tells. */
void words_init(void);

/* 999, 12.3 k, 4.56 M. */
char *words_count(char *out, size_t capacity, double v);
/* 999 B, 12.3 kB, 4.56 MB: powers of 1000. */
char *words_bytes(char *out, size_t capacity, uint64_t bytes);
/* The fewest digits that read as the same double, as number_write prints them. */
char *words_real(double x, char out[32]);
/* To standard output. */
void words_print_reals(const double *v, int count, const char *between);
/* "1 hole", "3 holes". */
char *words_plural(char *out, size_t capacity, uint64_t count, const char *one, const char *many);
/* Names of the ebpo_part bits with commas: "planes, mesh, maps". */
char *words_parts(char *out, size_t capacity, uint32_t parts);
/* "1.0" */
char *words_format(char *out, size_t capacity, int major, int minor);
/* "#ff8000" of red + 256 green + 65,536 blue. */
char *words_colour(char out[8], uint32_t colour);
const char *words_node_type(ebpo_node_type type);
const char *words_rule(ebpo_rule rule);
const char *words_codec(ebpo_codec codec);
/* Digits, then nothing or one of the units (NULL-terminated); the number times its factor. */
bool words_read_unit(const char *text, const char *const *units, const uint64_t *factors,
                     uint64_t *out);
/* 64M, 1GB, 0.5G, 512k, 1000000: powers of 1000; 64MiB, 1Gi: of 1024. */
bool words_read_size(const char *text, uint64_t *out);

/* Levels as "3", "0-5", "3-" (to the deepest) and lists of such with commas name them. */
typedef struct word_levels {
    uint32_t set; /* a bit for each */
    int first, last;
    bool to_end; /* those beyond the deepest were not asked for by number */
    bool is_run; /* none is missing between the first and the last */
} word_levels;

bool words_read_levels(const char *text, word_levels *out);

/* What is said of texts that ebpo_is_date refuses. */
#define WORDS_DATE_EXPECTED \
    "a date as in ISO 8601 and in the calendar, such as 2026-11-26 or 2026-11-26T21:43:05Z"

/* What is said of texts that the two refuse. */
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
