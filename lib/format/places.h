/* Where every chunk of a file lies, in one list. format-spec/README.md, section 9, "Places". */
#ifndef EBPO_FORMAT_PLACES_H
#define EBPO_FORMAT_PLACES_H

#include <ebpo/base.h>

#include "hdf5_read/chunk.h"
#include "format/schema.h"

/* Stands for a gap. */
#define EBPO_PLACE_GAP UINT32_MAX

/* The number of an array in the list. */
uint32_t ebpo_place_number(ebpo_array_id id, int level);
/* EBPO_ARRAYS: none that this library knows. */
ebpo_array_id ebpo_place_array(uint32_t number, int *level); /* of attributes: any number */

/* A row of the list. */
static inline uint64_t ebpo_place(uint32_t number, uint64_t bytes)
{
    return (uint64_t)number << 32 | (uint32_t)bytes;
}
static inline uint32_t ebpo_place_number_of(uint64_t place) { return (uint32_t)(place >> 32); }
static inline uint32_t ebpo_place_bytes_of(uint64_t place) { return (uint32_t)place; }

#endif
