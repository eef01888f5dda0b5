/* Reading attributes of vertices, faces and other elements. */
#ifndef EBPO_FORMAT_READ_ATTRIBUTES_H
#define EBPO_FORMAT_READ_ATTRIBUTES_H

#include "format/file_in.h"

/* All values; NULL: the file has no such part. Its workspace is that of the options. */
EBPO_MUST_USE ebpo_status ebpo_attributes_read(const ebpo_file *file, const ebpo_read_options *read,
                                               ebpo_attributes **out, ebpo_error *error);
/* Only the head: arrays without rows, for who fills them in otherwise. */
EBPO_MUST_USE ebpo_status ebpo_attributes_read_head(const ebpo_file *file,
                                                    const ebpo_read_options *read,
                                                    ebpo_attributes **out, ebpo_error *error);
/* Fills in the arrays of textures. */
EBPO_MUST_USE ebpo_status ebpo_attributes_read_textures(const ebpo_file *file,
                                                        const ebpo_read_options *read,
                                                        ebpo_attributes *to, ebpo_error *error);
/* A chunk's `rows` rows to values of the machine's byte order. */
void ebpo_attribute_decode(const ebpo_file *file, const ebpo_array_in *array, uint64_t rows,
                           const uint8_t *raw, void *values);
/* Checks the part's checksum, and images against theirs; says nothing, if the file does not have
 * it. */
EBPO_MUST_USE ebpo_status ebpo_attributes_check(const ebpo_file *file,
                                                const ebpo_read_options *read, ebpo_error *error);

/* For opening a file: the part's arrays, with their head; nothing, if the file does not have it. */
EBPO_MUST_USE ebpo_status ebpo_attributes_open(ebpo_file *file, ebpo_head *head, ebpo_error *error);
void ebpo_attributes_close(ebpo_file *file);

#endif
