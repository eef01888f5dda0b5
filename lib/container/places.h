/* Where every chunk of a file lies, in one list. format-spec/README.md, section 9, "Places". */
#ifndef EBPO_CONTAINER_PLACES_H
#define EBPO_CONTAINER_PLACES_H

#include <ebpo/base.h>

#include "codec/chunk.h"
#include "container/schema.h"

/* Stands for a gap. */
#define EBPO_PLACE_GAP UINT32_MAX

/* The number of an array in the list. */
uint32_t ebpo_place_number(ebpo_array_id id, int level);
/* EBPO_ARRAYS: none that this library knows. */
ebpo_array_id ebpo_place_array(uint32_t number, int *level);

/* The list as one chunk, however long: pairs of number and bytes. `bytes`: of the encoded list,
 * which the caller frees. */
EBPO_MUST_USE ebpo_status ebpo_places_encode(uint32_t (*pairs)[2], uint64_t count,
                                             ebpo_pipeline pipeline, int codec_level,
                                             uint8_t **stored, size_t *bytes, ebpo_error *error);
/* Of `stored_bytes` that may be anything; *pairs is the caller's. EBPO_E_FORMAT: *why says what is
 * wrong. */
EBPO_MUST_USE ebpo_status ebpo_places_decode(const uint8_t *stored, size_t stored_bytes,
                                             ebpo_pipeline pipeline, uint64_t count,
                                             uint32_t (**pairs)[2], const char **why,
                                             ebpo_error *error);

#endif
