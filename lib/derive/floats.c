#include "core/strict_fp.h"

#include "derive/floats.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"

ebpo_status ebpo_mesh_floats(float **out, const ebpo_mesh *mesh, const double origin[3],
                             double *largest_change, ebpo_error *error)
{
    float *xyz = *out = ebpo_alloc(mesh->vertex_count, 3 * sizeof *xyz);
    if (!xyz)
        return ebpo_fail_memory(error, mesh->vertex_count * 3 * sizeof *xyz);
    for (uint64_t i = 0; i < 3 * mesh->vertex_count; i++) {
        double at = mesh->xyz32 ? (double)mesh->xyz32[i] : mesh->xyz64[i];
        xyz[i] = (float)(at - origin[i % 3]);
        *largest_change = fmax(*largest_change, fabs((double)xyz[i] + origin[i % 3] - at));
        if (!isfinite(xyz[i])) {
            free(xyz);
            *out = NULL;
            return ebpo_fail(error, EBPO_E_LIMIT,
                             "a coordinate of %g is beyond what a float32 holds; export XDMF or "
                             "VTKHDF, or scale the model",
                             at);
        }
    }
    return EBPO_OK;
}
