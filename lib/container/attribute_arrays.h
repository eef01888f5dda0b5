/* The arrays of /attributes in a file: a header, then of each array of attributes its values and,
 * of lists of different lengths, their items. format-spec/README.md, "Attributes". */
#ifndef EBPO_CONTAINER_ATTRIBUTE_ARRAYS_H
#define EBPO_CONTAINER_ATTRIBUTE_ARRAYS_H

#include "attributes/attributes.h"
#include "container/open.h"
#include "container/plan.h"

/* Numbers of arrays, and their paths. */
static inline int ebpo_values_number(uint64_t n) { return 1 + 2 * (int)n; }
static inline int ebpo_items_number(uint64_t n) { return 2 + 2 * (int)n; }
void ebpo_attribute_path(int number, char path[EBPO_PATH_BYTES]);

extern const char ebpo_coding_plain[], ebpo_coding_columns[];

/* --- attribute_open.c --- */

/* The part's arrays, with their head; nothing, if the file does not have the part. */
EBPO_MUST_USE ebpo_status ebpo_attributes_open(ebpo_file *file, ebpo_h5_in *h5, ebpo_error *error);
void ebpo_attributes_close(ebpo_file *file);

/* --- attribute_read.c --- */

/* All values; NULL: the file has no such part. Its workspace is that of the options. */
EBPO_MUST_USE ebpo_status ebpo_attributes_read(const ebpo_file *file, const ebpo_read_options *read,
                                               ebpo_attributes **out, ebpo_error *error);
/* Only the head: arrays without rows, for who fills them in otherwise. */
EBPO_MUST_USE ebpo_status ebpo_attributes_read_head(const ebpo_file *file,
                                                    const ebpo_read_options *read,
                                                    ebpo_attributes **out, ebpo_error *error);
/* A chunk's `rows` rows to values of the machine's byte order. */
void ebpo_attribute_decode(const ebpo_file *file, const ebpo_array_in *array, uint64_t rows,
                           const uint8_t *raw, void *values);
/* Checks the part's checksum; says nothing, if the file does not have it. */
EBPO_MUST_USE ebpo_status ebpo_attributes_check(const ebpo_file *file,
                                                const ebpo_read_options *read, ebpo_error *error);

/* --- attribute_digest.c --- */

/* The part's checksum. */
EBPO_MUST_USE ebpo_status ebpo_attributes_digest(const ebpo_attributes *attributes,
                                                 uint8_t digest[32], ebpo_error *error);

/* --- attribute_plan.c --- */

/* Checks what is to be written (EBPO_E_ARGUMENT), and finds out what stands in its head. */
EBPO_MUST_USE ebpo_status ebpo_attributes_plan(ebpo_plan *plan, const char *shown,
                                               ebpo_error *error);
/* Adds its arrays to the plan, which has room for ebpo_attributes_planned of them. */
uint64_t ebpo_attributes_planned(const ebpo_plan *plan);
void ebpo_attributes_add_arrays(ebpo_plan *plan, ebpo_pipeline pipeline);
void ebpo_attributes_encode(const ebpo_plan *plan, const ebpo_array_out *array, uint64_t row,
                            uint64_t rows, uint8_t *file);
/* The attributes of the group, and those of an array beside `about`. */
EBPO_MUST_USE ebpo_status ebpo_attributes_put_group(ebpo_h5_out *out, const ebpo_plan *plan,
                                                    ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_attributes_put_array(ebpo_h5_out *out, const ebpo_plan *plan,
                                                    const ebpo_array_out *array, ebpo_error *error);

#endif
