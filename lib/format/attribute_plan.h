/* Attributes on their way into a file. */
#ifndef EBPO_FORMAT_ATTRIBUTE_PLAN_H
#define EBPO_FORMAT_ATTRIBUTE_PLAN_H

#include "format/planned.h"

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
