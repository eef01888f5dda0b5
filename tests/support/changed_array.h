/* Changes a value of an uncompressed file in memory, and updates the checksum of the chunk and the
 * list of chunk checksums, so that only the value reveals the change. */
#ifndef EBPO_TESTS_CHANGED_ARRAY_H
#define EBPO_TESTS_CHANGED_ARRAY_H

#include <ebpo/file.h>

#include "format/schema.h"

typedef struct changeable {
    uint8_t *data;
    uint64_t size;
    ebpo_file *file; /* the original file, for the chunk offsets */
} changeable;

/* Loads a file written with EBPO_CODEC_NONE. Aborts if it cannot be opened. */
void changeable_load(changeable *c, const char *path);
void changeable_free(changeable *c);

/* Returns the number of values of an array in the root group; 0: the array is not in the file. */
uint64_t changeable_count(const changeable *c, ebpo_array_id id);
/* Returns a value, or sets a value and returns the original one; values are counted row by row. */
uint64_t changeable_get(const changeable *c, ebpo_array_id id, uint64_t item);
uint64_t changeable_put(changeable *c, ebpo_array_id id, uint64_t item, uint64_t value);

#endif
