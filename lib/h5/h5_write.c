/* Creating files, see h5.h. */
#include <fcntl.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "h5/h5.h"
#include "h5/h5_objects.h"
#include "h5/zstd_filter.h"

/* Everything stays in object headers, wherever HDF5 would otherwise switch to B-trees and heaps. */
enum { COMPACT = 65535 };

uint32_t ebpo_h5_chunk_rows(uint64_t rows, uint32_t cols, uint32_t element_size)
{
    uint32_t row = element_size * (cols ? cols : 1), full = 1;
    while (2 * full * row <= EBPO_CHUNK_BYTES_MAX)
        full *= 2;
    return rows < full ? (uint32_t)rows : full;
}

void ebpo_h5_close_id(ebpo_h5_id id)
{
    if (id < 0)
        return;
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    H5Idec_ref(id);
    ebpo_h5_leave(&scope);
}

static hid_t file_access(bool memory, uint64_t head_bytes)
{
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    bool ok = fapl >= 0 && H5Pset_libver_bounds(fapl, H5F_LIBVER_V110, H5F_LIBVER_V110) >= 0 &&
              H5Pset_fclose_degree(fapl, H5F_CLOSE_STRONG) >= 0 &&
              H5Pset_file_locking(fapl, false, true) >= 0 &&
              H5Pset_meta_block_size(fapl, head_bytes) >= 0 &&
              H5Pset_small_data_block_size(fapl, 0) >= 0 && H5Pset_sieve_buf_size(fapl, 0) >= 0 &&
              H5Pset_cache(fapl, 0, 1, 0, 1.0) >= 0 &&
              (!memory || H5Pset_fapl_core(fapl, 1 << 20, false) >= 0);
    if (!ok && fapl >= 0)
        H5Pclose(fapl);
    return ok ? fapl : -1;
}

static bool set_group(hid_t plist, unsigned links)
{
    return plist >= 0 && H5Pset_obj_track_times(plist, false) >= 0 &&
           H5Pset_attr_phase_change(plist, COMPACT, 0) >= 0 &&
           H5Pset_link_phase_change(plist, COMPACT, 0) >= 0 &&
           H5Pset_est_link_info(plist, links, 12) >= 0;
}

ebpo_status ebpo_h5_create(ebpo_h5_out *out, const char *path, const char *shown,
                           uint64_t head_bytes, unsigned links, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status = EBPO_OK;
    out->shown = shown;
    hid_t fapl = file_access(!path, head_bytes), fcpl = H5Pcreate(H5P_FILE_CREATE);
    if (fapl >= 0 && set_group(fcpl, links) && H5Zregister(&ebpo_zstd_filter) >= 0)
        out->file = H5Fcreate(path ? path : "head", H5F_ACC_TRUNC, fcpl, fapl);
    if (out->file < 0)
        status = ebpo_h5_fail(error, EBPO_E_IO, shown, "", "libhdf5 could not create the file");
    ebpo_h5_close_list(fapl);
    ebpo_h5_close_list(fcpl);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_reopen(ebpo_h5_out *out, const char *path, uint64_t metadata_bytes,
                           ebpo_error *error)
{
    ebpo_status status = ebpo_h5_finish(out, error);
    if (status != EBPO_OK)
        return status;
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t fapl = file_access(false, metadata_bytes);
    if (fapl >= 0)
        out->file = H5Fopen(path, H5F_ACC_RDWR, fapl);
    if (out->file < 0)
        status = ebpo_h5_fail(error, EBPO_E_IO, out->shown, "",
                              "libhdf5 could not open again what it had written");
    ebpo_h5_close_list(fapl);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_root(ebpo_h5_out *out, ebpo_h5_id *id, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    *id = H5Gopen2(out->file, "/", H5P_DEFAULT);
    ebpo_status status = ebpo_h5_written(out, "/", *id >= 0, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_make_group(ebpo_h5_out *out, const char *path, unsigned links, ebpo_h5_id *id,
                               ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t gcpl = H5Pcreate(H5P_GROUP_CREATE);
    ebpo_status status = ebpo_h5_put_group(out, path, gcpl, set_group(gcpl, links), id, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_put_text(ebpo_h5_out *out, ebpo_h5_id id, const char *name, const char *text,
                             ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t type = H5Tcopy(H5T_C_S1);
    size_t size = strlen(text);
    if (H5Tset_size(type, size ? size : 1) < 0 || H5Tset_strpad(type, H5T_STR_NULLPAD) < 0 ||
        H5Tset_cset(type, H5T_CSET_UTF8) < 0) {
        H5Tclose(type);
        type = -1;
    }
    ebpo_status status =
        ebpo_h5_put_attribute(out, id, name, type, H5Screate(H5S_SCALAR), -1, text, error);
    if (type >= 0)
        H5Tclose(type);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_put_int(ebpo_h5_out *out, ebpo_h5_id id, const char *name, int64_t value,
                            ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status = ebpo_h5_put_attribute(out, id, name, H5T_STD_I64LE, H5Screate(H5S_SCALAR),
                                               H5T_NATIVE_INT64, &value, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_put_count(ebpo_h5_out *out, ebpo_h5_id id, const char *name, uint64_t value,
                              ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status = ebpo_h5_put_attribute(out, id, name, H5T_STD_U64LE, H5Screate(H5S_SCALAR),
                                               H5T_NATIVE_UINT64, &value, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_put_real(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                             const double *values, unsigned count, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hsize_t dims = count;
    hid_t space = count ? H5Screate_simple(1, &dims, NULL) : H5Screate(H5S_SCALAR);
    ebpo_status status = ebpo_h5_put_attribute(out, id, name, H5T_IEEE_F64LE, space,
                                               H5T_NATIVE_DOUBLE, values, error);
    ebpo_h5_leave(&scope);
    return status;
}

static bool set_filters(hid_t dcpl, const ebpo_h5_shape *shape, int level)
{
    bool compressed =
        shape->pipeline == EBPO_PIPELINE_ZSTD || shape->pipeline == EBPO_PIPELINE_DEFLATE;
    if (compressed && shape->element_size > 1 && H5Pset_shuffle(dcpl) < 0)
        return false;
    if (shape->pipeline == EBPO_PIPELINE_ZSTD) {
        unsigned value = (unsigned)(level ? level : EBPO_ZSTD_LEVEL);
        return H5Pset_filter(dcpl, EBPO_ZSTD_FILTER_ID, H5Z_FLAG_MANDATORY, 1, &value) >= 0;
    }
    if (shape->pipeline == EBPO_PIPELINE_DEFLATE &&
        H5Pset_deflate(dcpl, (unsigned)(level ? level : EBPO_DEFLATE_LEVEL)) < 0)
        return false;
    return shape->pipeline == EBPO_PIPELINE_BARE || H5Pset_fletcher32(dcpl) >= 0;
}

ebpo_status ebpo_h5_make_array(ebpo_h5_out *out, const char *path, const ebpo_h5_shape *shape,
                               ebpo_h5_id *id, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    int rank = shape->cols ? 2 : 1;
    hsize_t dims[2] = { shape->rows, shape->cols }, chunk[2] = { shape->chunk_rows, shape->cols };
    hid_t space = H5Screate_simple(rank, dims, NULL), dcpl = H5Pcreate(H5P_DATASET_CREATE);
    bool good = space >= 0 && dcpl >= 0 && H5Pset_chunk(dcpl, rank, chunk) >= 0 &&
                H5Pset_obj_track_times(dcpl, false) >= 0 &&
                H5Pset_attr_phase_change(dcpl, COMPACT, 0) >= 0 &&
                H5Pset_fill_time(dcpl, H5D_FILL_TIME_NEVER) >= 0 &&
                set_filters(dcpl, shape, out->codec_level);
    ebpo_status status =
        ebpo_h5_put_dataset(out, path, ebpo_h5_integer_type(shape->element_size, shape->is_signed),
                            space, dcpl, good, id, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_open_array(ebpo_h5_out *out, const char *path, ebpo_h5_id *id,
                               ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    *id = H5Dopen2(out->file, path, H5P_DEFAULT);
    ebpo_status status = ebpo_h5_written(out, path, *id >= 0, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_put_chunk(ebpo_h5_out *out, const char *path, ebpo_h5_id id,
                              const ebpo_h5_shape *shape, uint64_t chunk, const void *data,
                              size_t bytes, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hsize_t at[2] = { chunk * shape->chunk_rows, 0 };
    ebpo_status status =
        ebpo_h5_written(out, path, H5Dwrite_chunk(id, H5P_DEFAULT, 0, at, bytes, data) >= 0, error);
    ebpo_h5_leave(&scope);
    return status;
}

/* Metadata blocks end with a checksum, unused space is zero: the head ends at the last byte that is
 * not zero, up to a few that happen to be. */
ebpo_status ebpo_h5_head_used(ebpo_h5_out *out, uint64_t first_raw, uint64_t *bytes,
                              ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status = EBPO_OK;
    void *image = NULL;
    hsize_t size = 0;
    if (H5Fflush(out->file, H5F_SCOPE_LOCAL) < 0 ||
        H5Fget_vfd_handle(out->file, H5P_DEFAULT, &image) < 0 ||
        H5Fget_filesize(out->file, &size) < 0 || first_raw > size) {
        status =
            ebpo_h5_fail(error, EBPO_E_IO, out->shown, "", "libhdf5 could not lay out the head");
    } else {
        const uint8_t *data = *(uint8_t **)image;
        while (first_raw && data[first_raw - 1] == 0)
            first_raw--;
        *bytes = first_raw;
    }
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_size(ebpo_h5_out *out, uint64_t *bytes, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hsize_t size = 0;
    bool good = H5Fget_filesize(out->file, &size) >= 0;
    *bytes = size;
    ebpo_status status = ebpo_h5_written(out, "", good, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_finish(ebpo_h5_out *out, ebpo_error *error)
{
    if (out->file < 0)
        return EBPO_OK;
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    bool good = H5Fflush(out->file, H5F_SCOPE_LOCAL) >= 0 && H5Fclose(out->file) >= 0;
    ebpo_status status = ebpo_h5_written(out, "", good, error);
    if (good)
        out->file = -1;
    ebpo_h5_leave(&scope);
    return status;
}

/* When the disk is full, closing fails as well, and libhdf5 then keeps an id without a file and
 * crashes at exit. Nobody wants these bytes any more: what is still to be written (a few kilobytes
 * of metadata) goes to memory. */
static void swallow_writes(hid_t file)
{
    void *handle = NULL;
    int sink = memfd_create("ebpo", MFD_CLOEXEC);
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    if (sink >= 0 && H5Fget_vfd_handle(file, H5P_DEFAULT, &handle) >= 0 && handle)
        dup3(sink, *(const int *)handle, O_CLOEXEC);
    ebpo_h5_leave(&scope);
    if (sink >= 0)
        close(sink);
}

void ebpo_h5_discard(ebpo_h5_out *out)
{
    if (out->file >= 0)
        swallow_writes(out->file);
    ebpo_h5_close_id(out->file);
    out->file = -1;
}
