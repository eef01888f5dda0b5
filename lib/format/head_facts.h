/* Writes and reads the HDF5 attributes of the root and of the level groups. The attributes contain
 * ebpo_info, except values that the reader finds when it opens the file (file_bytes, head_bytes,
 * codec). */
#ifndef EBPO_FORMAT_HEAD_FACTS_H
#define EBPO_FORMAT_HEAD_FACTS_H

#include <stddef.h>

#include <ebpo/file.h>

#include "hdf5_read/head.h"
#include "hdf5_write/h5.h"

/* Writes the root's attributes. Some values are known only after the arrays have been written: the
 * checksums, chunk_index_offset, chunk_index_bytes and top_bytes. The functions _put_..._digest,
 * _put_index and _put_top then overwrite these attributes. */
EBPO_MUST_USE ebpo_status ebpo_facts_put(ebpo_h5_out *out, ebpo_h5_id root, const ebpo_info *info,
                                         ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_digest(ebpo_h5_out *out, ebpo_h5_id root,
                                                const uint8_t digest[32], ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_colours_digest(ebpo_h5_out *out, ebpo_h5_id root,
                                                        const uint8_t digest[32],
                                                        ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_surface_digest(ebpo_h5_out *out, ebpo_h5_id root,
                                                        const uint8_t digest[32],
                                                        ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_border_digest(ebpo_h5_out *out, ebpo_h5_id root,
                                                       const uint8_t digest[32], ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_index(ebpo_h5_out *out, ebpo_h5_id root, uint64_t offset,
                                               uint64_t bytes, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_top(ebpo_h5_out *out, ebpo_h5_id root, uint64_t bytes,
                                             ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_put_level(ebpo_h5_out *out, ebpo_h5_id group,
                                               const ebpo_level_summary *level, ebpo_error *error);

/* Reads the root's attributes. Reads the version and the required parts first. So, for a file of a
 * newer version, the error names this version, and not an unknown attribute. */
EBPO_MUST_USE ebpo_status ebpo_facts_get(ebpo_head *in, ebpo_head_object root, ebpo_info *info,
                                         ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_facts_get_level(ebpo_head *in, ebpo_head_object group,
                                               const char *path, ebpo_level_summary *level,
                                               ebpo_error *error);

/* Reads one digest from an attribute of any object. */
EBPO_MUST_USE ebpo_status ebpo_facts_get_digest(ebpo_head *in, ebpo_head_object id,
                                                const char *object, const char *name,
                                                uint8_t digest[32], ebpo_error *error);

/* Checks that the values are in range and that the counts of the levels agree with each other and
 * with the counts of the mesh. `shown`: the file's name for messages. `as`: status of an error,
 * EBPO_E_FORMAT for files and EBPO_E_ARGUMENT for callers' trees. */
EBPO_MUST_USE ebpo_status ebpo_facts_check(const ebpo_info *info, const char *shown, ebpo_status as,
                                           ebpo_error *error);

#endif
