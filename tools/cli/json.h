/* Writes JSON (RFC 8259): indented objects and arrays, exact numbers. */
#ifndef EBPO_TOOLS_JSON_H
#define EBPO_TOOLS_JSON_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

enum { JSON_DEPTH = 16 };

typedef struct json {
    FILE *out;
    int depth; /* number of open objects and arrays */
    /* true: '<' is written as \u003c, so that no text ends an HTML script element */
    bool in_page;
    bool filled[JSON_DEPTH]; /* [depth] true: the open object or array has a value already */
    char close[JSON_DEPTH];  /* [depth] the character that ends the open object or array */
} json;

/* Begins JSON text. */
void json_begin(json *j, FILE *out);
/* json_object and json_array begin an object or an array. In all functions, `key` is the key of the
 * new member; it is NULL inside arrays and for the outermost value. An outermost object on standard
 * output or error gets the first member "ebpo", the version of the library. */
void json_object(json *j, const char *key);
void json_array(json *j, const char *key);
void json_end(json *j);    /* ends the innermost object or array */
void json_finish(json *j); /* ends all open objects and arrays, and the last line */
/* Returns the number of bytes of the UTF-8 character at `text`; 0: the bytes are not valid UTF-8.
 */
int json_utf8_length(const char *text);

/* Writes a string. Bytes that are not UTF-8 become U+FFFD. */
void json_text(json *j, const char *key, const char *text);
void json_uint(json *j, const char *key, uint64_t v);
void json_int(json *j, const char *key, int64_t v);
/* Writes the fewest digits that identify the double; null if the double is not finite. */
void json_real(json *j, const char *key, double v);
void json_bool(json *j, const char *key, bool v);
void json_null(json *j, const char *key);
void json_reals(json *j, const char *key, const double *v, int count);

/* Writes a JSON number with the fewest digits that identify the double, or "null" if the double is
 * not finite. Returns `text`, for use with printf. */
const char *json_number(double x, char text[32]);

#endif
