#include "cli/render/level_surface.h"

#include <stdlib.h>

ebpo_status level_surface(const ebpo_file *file, int level, ebpo_surface_mesh *out,
                          ebpo_error *error)
{
    ebpo_surface surface = { 0 };
    uint64_t *patches = NULL, count = 0;
    *out = (ebpo_surface_mesh){ 0 };
    ebpo_status status = ebpo_file_read_surface(file, 0, level, &surface, error);
    if (status == EBPO_OK)
        status = ebpo_surface_select(&surface, level, &patches, &count, error);
    if (status == EBPO_OK)
        status = ebpo_surface_join(&surface, ebpo_file_info(file), patches, count, out, error);
    ebpo_surface_free(&surface);
    free(patches);
    return status;
}
