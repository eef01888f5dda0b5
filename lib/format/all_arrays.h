/* All arrays that a file can have, by one number, in the order of the numbers that the format gives
 * them (places.h). */
#ifndef EBPO_FORMAT_ALL_ARRAYS_H
#define EBPO_FORMAT_ALL_ARRAYS_H

#include "format/file_in.h"

enum {
    EBPO_ARRAYS_OF_LEVELS = EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS,
    EBPO_ARRAYS_OF_FORMAT = EBPO_ARRAYS_OF_LEVELS + EBPO_ARRAYS - EBPO_LEVEL_ARRAYS
    /* then come attributes */
};

static inline int ebpo_all_arrays(const ebpo_file *file)
{
    return EBPO_ARRAYS_OF_FORMAT + file->attributes.arrays;
}

/* Number i of these, present or not. */
static inline ebpo_array_in *ebpo_array_number(ebpo_file *file, int i)
{
    return i < EBPO_ARRAYS_OF_LEVELS
               ? &file->level_array[i / EBPO_LEVEL_ARRAYS][i % EBPO_LEVEL_ARRAYS]
           : i < EBPO_ARRAYS_OF_FORMAT
               ? &file->root_array[EBPO_LEVEL_ARRAYS + i - EBPO_ARRAYS_OF_LEVELS]
               : &file->attributes.array[i - EBPO_ARRAYS_OF_FORMAT];
}

#endif
