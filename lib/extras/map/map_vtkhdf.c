/* VTKHDF 1.0: an image. Source: VTK's documentation, "VTKHDF file format". */
#include "core/strict_fp.h"

#include <math.h>

#include "core/error.h"
#include "hdf5_write/h5.h"
#include "extras/map/map_file.h"

static const char values_path[] = "/VTKHDF/PointData/distance";

static double length_of(const double v[3])
{
    double most = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (most == 0)
        return 0;
    double a = v[0] / most, b = v[1] / most, c = v[2] / most;
    return most * sqrt(a * a + b * b + c * c);
}

/* An image's axes are unit vectors at right angles, and its spacing is theirs. */
static ebpo_status find_axes(const ebpo_lattice *l, double spacing[3], double direction[9],
                             ebpo_error *error)
{
    double axis[3][3];
    for (int i = 0; i < 3; i++) {
        spacing[i] = length_of(l->step[i]);
        if (!(spacing[i] > 0) || !isfinite(spacing[i]))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "VTKHDF needs steps along all three axes; write NRRD");
        for (int c = 0; c < 3; c++)
            axis[i][c] = l->step[i][c] / spacing[i];
    }
    for (int i = 0; i < 3; i++) {
        const double *a = axis[i], *b = axis[(i + 1) % 3];
        if (fabs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) > 1e-9)
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "VTKHDF needs steps at right angles; write NRRD");
        for (int c = 0; c < 3; c++)
            direction[3 * c + i] = axis[i][c]; /* axes are its columns */
    }
    return EBPO_OK;
}

static ebpo_status put_facts(ebpo_map_file *f, ebpo_h5_id id, ebpo_error *error)
{
    static const int64_t version[2] = { 1, 0 };
    const ebpo_lattice *l = f->lattice;
    double spacing[3], direction[9];
    const int64_t extent[6] = { 0, (int64_t)l->count[0] - 1, 0, (int64_t)l->count[1] - 1,
                                0, (int64_t)l->count[2] - 1 };
    ebpo_status status = find_axes(l, spacing, direction, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_ints(&f->out, id, "Version", version, 2, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_ascii(&f->out, id, "Type", "ImageData", error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_ints(&f->out, id, "WholeExtent", extent, 6, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_real(&f->out, id, "Origin", l->origin, 3, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_real(&f->out, id, "Spacing", spacing, 3, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_real(&f->out, id, "Direction", direction, 9, error);
    return status;
}

static ebpo_status put_group(ebpo_map_file *f, const char *path, bool facts, ebpo_error *error)
{
    ebpo_h5_id id = -1;
    ebpo_status status = ebpo_h5_make_plain_group(&f->out, path, &id, error);
    if (status == EBPO_OK && facts)
        status = put_facts(f, id, error);
    ebpo_h5_close_id(&f->out, id);
    return status;
}

static void dims_of(const ebpo_lattice *l, uint64_t dims[3])
{
    for (int i = 0; i < 3; i++)
        dims[i] = l->count[2 - i];
}

ebpo_status ebpo_map_vtkhdf_begin(ebpo_map_file *f, ebpo_error *error)
{
    uint64_t dims[3];
    dims_of(f->lattice, dims);
    ebpo_status status = ebpo_h5_create_plain(&f->out, f->path, f->shown, error);
    if (status == EBPO_OK)
        status = put_group(f, "/VTKHDF", true, error);
    if (status == EBPO_OK)
        status = put_group(f, "/VTKHDF/PointData", false, error);
    if (status == EBPO_OK)
        status = ebpo_h5_make_volume(&f->out, values_path, dims, &f->values, error);
    return status;
}

ebpo_status ebpo_map_vtkhdf_layers(ebpo_map_file *f, const double *values, uint64_t first,
                                   uint64_t layers, ebpo_error *error)
{
    uint64_t dims[3];
    dims_of(f->lattice, dims);
    return ebpo_h5_put_layers(&f->out, values_path, f->values, dims, first, layers, values, error);
}

ebpo_status ebpo_map_vtkhdf_end(ebpo_map_file *f, ebpo_error *error)
{
    ebpo_h5_close_id(&f->out, f->values);
    f->values = -1;
    return ebpo_h5_finish(&f->out, error);
}
