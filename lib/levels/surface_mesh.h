/* Joins patches of the simplified surface, and faces of the model, to one mesh. */
#ifndef EBPO_LEVELS_SURFACE_MESH_H
#define EBPO_LEVELS_SURFACE_MESH_H

#include <ebpo/lod.h>

#include "format/patch_table.h"

/* Reads patches by their indices. `row`: [EBPO_PATCH_COLUMNS] of each patch. */
typedef struct ebpo_patch_reader {
    const ebpo_info *info;
    ebpo_status (*read)(const void *user, uint64_t patch, ebpo_patch *out, ebpo_error *error);
    const void *user;
    const uint64_t *row;
    uint64_t count;
    bool coloured;
} ebpo_patch_reader;

/* Does what ebpo_surface_join does. `faces`: faces that replace other patches, or NULL; its level
 * and position are ignored. */
EBPO_MUST_USE ebpo_status ebpo_patches_join(const ebpo_patch_reader *reader,
                                            const uint64_t *patches, uint64_t count,
                                            const ebpo_patch *faces, ebpo_surface_mesh *out,
                                            ebpo_error *error);

/* The same for patches of a file. */
EBPO_MUST_USE ebpo_status ebpo_table_join(const ebpo_patch_table *table, ebpo_chunks *chunks,
                                          const uint64_t *patches, uint64_t count,
                                          const ebpo_patch *faces, ebpo_surface_mesh *out,
                                          ebpo_error *error);

/* Reads the faces that patches replace, with normals, and with colours if the patches have colours.
 * Free the result with ebpo_patch_free. `patches`: [count] ascending indices. Returns EBPO_E_ABSENT
 * if the file has no mesh. */
EBPO_MUST_USE ebpo_status ebpo_patch_faces_read(const ebpo_patch_table *table, ebpo_chunks *chunks,
                                                const uint64_t *patches, uint64_t count,
                                                ebpo_patch *out, ebpo_error *error);

#endif
