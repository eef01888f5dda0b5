/* Writes JSON (RFC 8259): indented objects and arrays, exact numbers. */
#ifndef EBPO_TOOLS_JSON_H
#define EBPO_TOOLS_JSON_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

enum { JSON_DEPTH = 16 };

typedef struct json {
    FILE *out;
    int depth;
    bool in_page; /* '<' is written as \u003c, so that no text ends an HTML script element */
    bool filled[JSON_DEPTH]; /* true if a value precedes at this depth */
    char close[JSON_DEPTH];
} json;

/* `key` is NULL inside arrays and for the outermost value. An outermost object on standard output
 * or error begins with "ebpo", the version of the library. */
void json_begin(json *j, FILE *out);
void json_object(json *j, const char *key);
void json_array(json *j, const char *key);
void json_end(json *j);    /* ends the innermost object or array */
void json_finish(json *j); /* ends all open objects and arrays, and the last line */
/* Returns the length of the UTF-8 sequence at `text` (no surrogates, nothing overlong, up to
 * U+10FFFF), 0 if there is none. */
int json_utf8_length(const char *text);

/* Bytes that are not UTF-8 become U+FFFD. */
void json_text(json *j, const char *key, const char *text);
void json_uint(json *j, const char *key, uint64_t v);
void json_int(json *j, const char *key, int64_t v);
/* Writes the fewest digits that identify the double. Not finite: null. */
void json_real(json *j, const char *key, double v);
void json_bool(json *j, const char *key, bool v);
void json_null(json *j, const char *key);
void json_reals(json *j, const char *key, const double *v, int count);

/* Returns a JSON number with the fewest digits that identify the double, for use with printf; null
 * when it is not finite. */
const char *json_number(double x, char text[32]);

#endif
