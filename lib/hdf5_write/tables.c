/* Writes HDF5 files for other programs (VTKHDF, Python): arrays that grow by rows, and volumes that
 * are written layer by layer. The arrays use the filters shuffle and deflate, which every build of
 * HDF5 has. Deflate uses its fastest level, because such files are read once or twice, and indices
 * of nodes and corners compress well even at this level. */
#include <stdio.h>
#include <string.h>

#include "hdf5_write/h5.h"
#include "hdf5_write/h5_parts.h"

enum { ROWS_OF_A_CHUNK = 8192, DEFLATE = 1 /* level */ };

/* Returns the type of the numbers in the file. */
static hid_t stored_type(ebpo_h5_number number)
{
    switch (number) {
    case EBPO_H5_U8: return H5T_STD_U8LE;
    case EBPO_H5_I32: return H5T_STD_I32LE;
    case EBPO_H5_I64: return H5T_STD_I64LE;
    case EBPO_H5_F32: return H5T_IEEE_F32LE;
    case EBPO_H5_F64: return H5T_IEEE_F64LE;
    }
    return -1;
}

/* Returns the type of the numbers in memory. */
static hid_t memory_type(ebpo_h5_number number)
{
    switch (number) {
    case EBPO_H5_U8: return H5T_NATIVE_UINT8;
    case EBPO_H5_I32: return H5T_NATIVE_INT32;
    case EBPO_H5_I64: return H5T_NATIVE_INT64;
    case EBPO_H5_F32: return H5T_NATIVE_FLOAT;
    case EBPO_H5_F64: return H5T_NATIVE_DOUBLE;
    }
    return -1;
}

ebpo_status ebpo_h5_create_plain(ebpo_h5_out *out, const char *path, const char *shown,
                                 ebpo_error *error)
{
    ebpo_status status = ebpo_h5_sink_open(&out->sink, path, shown, error);
    if (status != EBPO_OK)
        return status;
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    out->shown = shown;
    hid_t fapl = ebpo_h5_write_access(out->sink, H5F_LIBVER_V18), fcpl = H5Pcreate(H5P_FILE_CREATE);
    if (fapl >= 0 && fcpl >= 0 && H5Pset_obj_track_times(fcpl, false) >= 0)
        out->file = H5Fcreate(shown, H5F_ACC_TRUNC, fcpl, fapl);
    status = ebpo_h5_created(out, error);
    ebpo_h5_close_list(fapl);
    ebpo_h5_close_list(fcpl);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_make_plain_group(ebpo_h5_out *out, const char *path, ebpo_h5_id *id,
                                     ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t gcpl = H5Pcreate(H5P_GROUP_CREATE);
    bool good = gcpl >= 0 && H5Pset_obj_track_times(gcpl, false) >= 0;
    ebpo_status status = ebpo_h5_put_group(out, path, gcpl, good, id, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_make_table(ebpo_h5_out *out, const char *path, ebpo_h5_number number,
                               uint32_t cols, ebpo_h5_table *table, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    int rank = cols ? 2 : 1;
    hsize_t dims[2] = { 0, cols }, most[2] = { H5S_UNLIMITED, cols },
            chunk[2] = { ROWS_OF_A_CHUNK, cols };
    hid_t space = H5Screate_simple(rank, dims, most), dcpl = H5Pcreate(H5P_DATASET_CREATE);
    *table = (ebpo_h5_table){ .id = -1, .number = number, .cols = cols };
    snprintf(table->path, sizeof table->path, "%s", path);
    bool good = space >= 0 && dcpl >= 0 && H5Pset_chunk(dcpl, rank, chunk) >= 0 &&
                H5Pset_obj_track_times(dcpl, false) >= 0 && H5Pset_shuffle(dcpl) >= 0 &&
                H5Pset_deflate(dcpl, DEFLATE) >= 0;
    ebpo_status status =
        ebpo_h5_put_dataset(out, path, stored_type(number), space, dcpl, good, &table->id, error);
    ebpo_h5_leave(&scope);
    return status;
}

/* Enlarges the table and writes the new rows. */
static bool append_rows(ebpo_h5_table *table, const void *data, uint64_t rows)
{
    int rank = table->cols ? 2 : 1;
    hsize_t start[2] = { table->rows, 0 }, count[2] = { rows, table->cols },
            dims[2] = { table->rows + rows, table->cols };
    if (H5Dset_extent(table->id, dims) < 0)
        return false;
    hid_t space = H5Dget_space(table->id), memory = H5Screate_simple(rank, count, NULL);
    bool ok =
        space >= 0 && memory >= 0 &&
        H5Sselect_hyperslab(space, H5S_SELECT_SET, start, NULL, count, NULL) >= 0 &&
        H5Dwrite(table->id, memory_type(table->number), memory, space, H5P_DEFAULT, data) >= 0;
    ebpo_h5_close_space(space);
    ebpo_h5_close_space(memory);
    return ok;
}

ebpo_status ebpo_h5_append(ebpo_h5_out *out, ebpo_h5_table *table, const void *data, uint64_t rows,
                           ebpo_error *error)
{
    if (rows == 0)
        return EBPO_OK;
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status = ebpo_h5_written(out, table->path, append_rows(table, data, rows), error);
    table->rows += status == EBPO_OK ? rows : 0;
    ebpo_h5_leave(&scope);
    return status;
}

void ebpo_h5_close_table(const ebpo_h5_out *out, ebpo_h5_table *table)
{
    ebpo_h5_close_id(out, table->id);
    table->id = -1;
}

ebpo_status ebpo_h5_put_table(ebpo_h5_out *out, const char *path, ebpo_h5_number number,
                              uint32_t cols, const void *data, uint64_t rows, ebpo_error *error)
{
    ebpo_h5_table table = EBPO_H5_TABLE_INIT;
    ebpo_status status = ebpo_h5_make_table(out, path, number, cols, &table, error);
    if (status == EBPO_OK)
        status = ebpo_h5_append(out, &table, data, rows, error);
    ebpo_h5_close_table(out, &table);
    return status;
}

/* Size of a chunk of a volume: number of layers, and number of values along each of the other two
 * axes. */
enum { LAYERS_OF_A_CHUNK = 16, SIDE_OF_A_CHUNK = 64 };

static hsize_t smaller_of(uint64_t a, uint64_t b) { return a < b ? a : b; }

ebpo_status ebpo_h5_make_volume(ebpo_h5_out *out, const char *path, const uint64_t dims[3],
                                ebpo_h5_id *id, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hsize_t size[3] = { dims[0], dims[1], dims[2] },
            chunk[3] = { smaller_of(dims[0], LAYERS_OF_A_CHUNK),
                         smaller_of(dims[1], SIDE_OF_A_CHUNK),
                         smaller_of(dims[2], SIDE_OF_A_CHUNK) };
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
