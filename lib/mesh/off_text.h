/* The words of an OFF file. */
#ifndef EBPO_MESH_OFF_TEXT_H
#define EBPO_MESH_OFF_TEXT_H

#include <ebpo/base.h>

typedef struct off_text {
    const char *at, *end;
    uint64_t line; /* of `at`, from 1 */
} off_text;

typedef struct off_word {
    const char *s;
    size_t n;
} off_word;

/* The next word, past comments and ends of lines; false at the end of the file. */
bool ebpo_off_next(off_text *t, off_word *word);

/* The next word of this line; false at its end. */
bool ebpo_off_next_here(off_text *t, off_word *word);

/* Lines that have words, from the next line on. */
uint64_t ebpo_off_lines(const off_text *t);

#endif
