#include "hdf5_write/volumes.h"

#include "hdf5_write/h5_objects.h"

/* Neighbouring distances differ in their last bytes only, which deflate gains little from. */
enum { LAYERS_OF_A_CHUNK = 16, SIDE_OF_A_CHUNK = 64, DEFLATE = 1 };

static hsize_t least(uint64_t a, uint64_t b) { return a < b ? a : b; }

ebpo_status ebpo_h5_make_volume(ebpo_h5_out *out, const char *path, const uint64_t dims[3],
                                ebpo_h5_id *id, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hsize_t size[3] = { dims[0], dims[1], dims[2] },
            chunk[3] = { least(dims[0], LAYERS_OF_A_CHUNK), least(dims[1], SIDE_OF_A_CHUNK),
                         least(dims[2], SIDE_OF_A_CHUNK) };
    hid_t space = H5Screate_simple(3, size, NULL), dcpl = H5Pcreate(H5P_DATASET_CREATE);
    bool good = space >= 0 && dcpl >= 0 && H5Pset_chunk(dcpl, 3, chunk) >= 0 &&
                H5Pset_obj_track_times(dcpl, false) >= 0 && H5Pset_shuffle(dcpl) >= 0 &&
                H5Pset_deflate(dcpl, DEFLATE) >= 0;
    ebpo_status status =
        ebpo_h5_put_dataset(out, path, H5T_IEEE_F64LE, space, dcpl, good, id, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_put_layers(ebpo_h5_out *out, const char *path, ebpo_h5_id id,
                               const uint64_t dims[3], uint64_t first, uint64_t layers,
                               const double *data, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hsize_t start[3] = { first, 0, 0 }, count[3] = { layers, dims[1], dims[2] };
    hid_t space = H5Dget_space(id), memory = H5Screate_simple(3, count, NULL);
    bool good = space >= 0 && memory >= 0 &&
                H5Sselect_hyperslab(space, H5S_SELECT_SET, start, NULL, count, NULL) >= 0 &&
                H5Dwrite(id, H5T_NATIVE_DOUBLE, memory, space, H5P_DEFAULT, data) >= 0;
    ebpo_status status = ebpo_h5_written(out, path, good, error);
    ebpo_h5_close_space(space);
    ebpo_h5_close_space(memory);
    ebpo_h5_leave(&scope);
    return status;
}
