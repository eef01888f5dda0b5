/* A mesh with the places of findings in colours. */
#ifndef EBPO_MESH_PLACES_PLY_H
#define EBPO_MESH_PLACES_PLY_H

#include "io/publish.h"
#include "mesh/mesh_check_parts.h"

typedef struct ebpo_places_picture {
    const ebpo_mesh *mesh;
    uint8_t *face; /* the kind that each shows, as the mesh has them now */
    ebpo_publish target;
} ebpo_places_picture;

#define EBPO_PLACES_PICTURE_INIT      \
    {                                 \
        NULL, NULL, EBPO_PUBLISH_INIT \
    }

EBPO_MUST_USE ebpo_status ebpo_places_picture_begin(ebpo_places_picture *picture,
                                                    const ebpo_mesh *mesh, const char *path,
                                                    ebpo_error *error);
/* faces   of the mesh as it is now */
void ebpo_places_picture_note(ebpo_places_picture *picture, const ebpo_found *found,
                              const uint64_t *faces, uint64_t count);
/* report   for the legend */
EBPO_MUST_USE ebpo_status ebpo_places_picture_write(ebpo_places_picture *picture,
                                                    const ebpo_mesh_report *report,
                                                    ebpo_error *error);
void ebpo_places_picture_end(ebpo_places_picture *picture);

#endif
