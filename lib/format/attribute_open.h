/* The arrays of attributes of a file that is being opened. */
#ifndef EBPO_FORMAT_ATTRIBUTE_OPEN_H
#define EBPO_FORMAT_ATTRIBUTE_OPEN_H

#include "format/file_in.h"

/* The part's arrays, with their head; nothing, if the file does not have the part. */
EBPO_MUST_USE ebpo_status ebpo_attributes_open(ebpo_file *file, ebpo_head *head, ebpo_error *error);
void ebpo_attributes_close(ebpo_file *file);

#endif
