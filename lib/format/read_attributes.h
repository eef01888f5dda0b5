/* Reads a file's part `attributes`: values of vertices, faces and other elements of the source. */
#ifndef EBPO_FORMAT_READ_ATTRIBUTES_H
#define EBPO_FORMAT_READ_ATTRIBUTES_H

#include "format/file_in.h"

/* Reads all attribute arrays into *out, which is NULL if the file has no attributes. Memory is from
 * the workspace of the options. */
EBPO_MUST_USE ebpo_status ebpo_attributes_read(const ebpo_file *file, const ebpo_read_options *read,
                                               ebpo_attributes **out, ebpo_error *error);
/* Reads only names, types and the header of attributes. The arrays have no values; the caller fills
 * them in. */
EBPO_MUST_USE ebpo_status ebpo_attributes_read_head(const ebpo_file *file,
                                                    const ebpo_read_options *read,
                                                    ebpo_attributes **out, ebpo_error *error);
/* Fills in the arrays of textures, after ebpo_attributes_read_head. */
EBPO_MUST_USE ebpo_status ebpo_attributes_read_textures(const ebpo_file *file,
                                                        const ebpo_read_options *read,
                                                        ebpo_attributes *to, ebpo_error *error);
/* Decodes `rows` rows of a chunk of an attribute array to native values. */
void ebpo_attribute_decode(const ebpo_file *file, const ebpo_array_in *array, uint64_t rows,
                           const uint8_t *raw, void *values);
/* Checks the part's checksum and the digests of images. Succeeds if the file lacks the part. */
EBPO_MUST_USE ebpo_status ebpo_attributes_check(const ebpo_file *file,
                                                const ebpo_read_options *read, ebpo_error *error);

/* Opens the part's arrays and reads their HDF5 attributes. Does nothing if the file lacks the part.
 */
EBPO_MUST_USE ebpo_status ebpo_attributes_open(ebpo_file *file, ebpo_head *head, ebpo_error *error);
void ebpo_attributes_close(ebpo_file *file);

#endif
