/* Reads single patches of a file's simplified surface through a cache of chunks. A patch is the
 * simplified surface of one node. The table of all patches is in memory; a patch is read when it is
 * needed. Values that are read are checked: wrong values in a file give EBPO_E_FORMAT, never an
 * index out of range. */
#ifndef EBPO_FORMAT_PATCH_TABLE_H
#define EBPO_FORMAT_PATCH_TABLE_H

#include "format/chunks.h"
#include "format/surface_patches.h"

/* All patches of a file, in ascending order of the octcodes (locational codes) of their nodes. The
 * patches of the children of patch i's node are [child[i], child_end[i]). */
typedef struct ebpo_patch_table {
    uint64_t count;
    uint64_t *row;       /* [count][EBPO_PATCH_COLUMNS]; NULL: not read yet */
    uint64_t *vertex;    /* [count + 1] first vertex of each patch in the file */
    uint64_t *code;      /* [count + 1] first byte of each patch's triangle codes in the file */
    uint64_t *child;     /* [count] patch of the first child */
    uint64_t *child_end; /* [count] one past the patch of the last child */
} ebpo_patch_table;

void ebpo_patch_table_free(ebpo_patch_table *table);

/* Reads the table; does nothing if it was read before. The caller initialises the table with zeros.
 * Returns EBPO_E_ABSENT if the file lacks the part `surface`. */
EBPO_MUST_USE ebpo_status ebpo_patch_table_read(ebpo_patch_table *table, ebpo_chunks *chunks,
                                                ebpo_error *error);

/* Returns the error of a patch in the model's unit. */
double ebpo_patch_table_error(const ebpo_patch_table *table, const ebpo_info *info, uint64_t patch);

/* Adds the chunks of a patch that are not in memory to `hints`, as ebpo_chunks_hint does. */
void ebpo_patch_hint(const ebpo_patch_table *table, ebpo_chunks *chunks, ebpo_hints *hints,
                     uint64_t patch);

/* Adds the chunks of a patch that are not in memory to `keys`. */
void ebpo_patch_missing(const ebpo_patch_table *table, ebpo_chunks *chunks, uint64_t patch,
                        ebpo_chunk_keys *keys);

/* Reads and decodes a patch, to be freed by ebpo_patch_free. */
EBPO_MUST_USE ebpo_status ebpo_patch_read(const ebpo_patch_table *table, ebpo_chunks *chunks,
                                          uint64_t patch, ebpo_patch *out, ebpo_error *error);

/* Reads patches without decoding them, to be freed by ebpo_surface_free. `patches`: [count]
 * ascending indices. */
EBPO_MUST_USE ebpo_status ebpo_patches_take(const ebpo_patch_table *table, ebpo_chunks *chunks,
                                            const uint64_t *patches, uint64_t count,
                                            ebpo_surface *out, ebpo_error *error);

#endif
