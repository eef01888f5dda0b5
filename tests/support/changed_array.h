/* Files without compression, in memory, of which one number is changed: its chunk's checksum is
 * made to fit, and what the file says of how it ends, so that nothing but the number tells. */
#ifndef EBPO_TESTS_CHANGED_ARRAY_H
#define EBPO_TESTS_CHANGED_ARRAY_H

#include <ebpo/file.h>

#include "format/schema.h"

typedef struct changeable {
    uint8_t *data;
    uint64_t size;
    ebpo_file *file; /* as it was: where its arrays are */
} changeable;

/* Of a file that was written with EBPO_CODEC_NONE. Aborts when it cannot be opened. */
void changeable_load(changeable *c, const char *path);
void changeable_free(changeable *c);

/* Numbers of an array of the root; 0: it is not there. */
uint64_t changeable_count(const changeable *c, ebpo_array_id id);
/* A number, counted row by row; puts another in its place and returns what it was. */
uint64_t changeable_get(const changeable *c, ebpo_array_id id, uint64_t item);
uint64_t changeable_put(changeable *c, ebpo_array_id id, uint64_t item, uint64_t value);

#endif
