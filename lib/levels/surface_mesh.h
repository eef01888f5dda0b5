/* Joins patches of the simplified surface, and faces of the model, to one mesh. A patch
 * approximates the faces below a node by few triangles (format/surface_patches.h). */
#ifndef EBPO_LEVELS_SURFACE_MESH_H
#define EBPO_LEVELS_SURFACE_MESH_H

#include <ebpo/lod.h>

#include "format/patch_table.h"

/* Reads patches by their indices. */
typedef struct ebpo_patch_reader {
    const ebpo_info *info;
    ebpo_status (*read)(const void *user, uint64_t patch, ebpo_patch *out, ebpo_error *error);
    const void *user;    /* argument of `read` */
    const uint64_t *row; /* [count][EBPO_PATCH_COLUMNS] row of each patch in the table of patches */
    uint64_t count;      /* number of all patches */
    bool coloured;       /* patches have colours */
} ebpo_patch_reader;

/* Joins patches as ebpo_surface_join does. `patches`: [count] indices of patches, ascending.
 * `faces`: faces of the model that replace further patches; they are stored like one patch, whose
 * level and position are ignored. NULL: none. */
EBPO_MUST_USE ebpo_status ebpo_patches_join(const ebpo_patch_reader *reader,
                                            const uint64_t *patches, uint64_t count,
                                            const ebpo_patch *faces, ebpo_surface_mesh *out,
                                            ebpo_error *error);

/* Does the same as ebpo_patches_join for patches that are read from a file. */
EBPO_MUST_USE ebpo_status ebpo_table_join(const ebpo_patch_table *table, ebpo_chunks *chunks,
                                          const uint64_t *patches, uint64_t count,
                                          const ebpo_patch *faces, ebpo_surface_mesh *out,
                                          ebpo_error *error);

/* Reads the faces below the nodes of these patches, with normals, and with colours if the patches
 * have colours. The caller frees the result with ebpo_patch_free. `patches`: [count] indices of
 * patches, ascending. Returns EBPO_E_ABSENT if the file has no mesh. */
EBPO_MUST_USE ebpo_status ebpo_patch_faces_read(const ebpo_patch_table *table, ebpo_chunks *chunks,
                                                const uint64_t *patches, uint64_t count,
                                                ebpo_patch *out, ebpo_error *error);

#endif
