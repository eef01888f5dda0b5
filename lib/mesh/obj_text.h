/* The statements and words of an OBJ file. Source: "Object Files (.obj)", appendix B1 of
 * Wavefront's Advanced Visualizer manual, 3.0. */
#ifndef EBPO_MESH_OBJ_TEXT_H
#define EBPO_MESH_OBJ_TEXT_H

#include <ebpo/base.h>

typedef struct obj_word {
    const char *s;
    size_t n;
} obj_word;

/* Where one is. Lines end with a line feed, a carriage return, or both. */
typedef struct obj_text {
    const char *at, *end;
    uint64_t line; /* from 1 */
    bool begun;    /* the first statement has been found */
} obj_text;

/* At the first statement: behind a mark of the order of bytes, if there is one. */
obj_text ebpo_obj_text(const uint8_t *data, uint64_t size);

/* The next word of the statement. False at its end, which a comment is too. A backslash at the end
 * of a line joins the next one. */
bool ebpo_obj_next_word(obj_text *t, obj_word *word);

/* What is left of the line, without blanks around it: a name. Backslashes are part of it, since
 * names of folders have them, so it joins no line. */
obj_word ebpo_obj_name(obj_text *t);

/* To the next statement that is not empty, past what is left of this one, and its first word. False
 * at the end of the file. */
bool ebpo_obj_next_statement(obj_text *t, obj_word *word);

bool ebpo_obj_word_is(obj_word word, const char *text);

#endif
