/* How many bytes of a file its arrays take. */
#ifndef EBPO_FORMAT_STORED_SIZES_H
#define EBPO_FORMAT_STORED_SIZES_H

#include "format/file_in.h"

/* Of the arrays whose chunks are known; and whether these fit the file. */
ebpo_stored_sizes ebpo_reader_sizes(const ebpo_file *file);
EBPO_MUST_USE ebpo_status ebpo_stored_check(const ebpo_file *file, ebpo_error *error);

/* EBPO_E_LIMIT: decoded they take more than `most` times the file's bytes, and more than
 * EBPO_EXPANSION_FREE. `most` as in ebpo_open_options. */
EBPO_MUST_USE ebpo_status ebpo_stored_check_expansion(const ebpo_file *file, uint64_t most,
                                                      ebpo_error *error);

#endif
