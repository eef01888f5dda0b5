/* Creates files in this library's layout. The HDF5 headers are one contiguous range at the start.
 * Links and attributes are in the object headers. Chunks are written as the caller has encoded
 * them. The functions close HDF5 spaces and property lists even after an earlier failure. All calls
 * after a failed write return the first failure (sink.c). This file also writes the attributes of
 * tables for other programs (tables.c). */
#include <string.h>

#include "core/error.h"
#include "hdf5_write/h5.h"
#include "hdf5_write/h5_parts.h"
#include "hdf5_write/zstd_filter.h"

/* Greatest number of links or attributes of an object that HDF5 stores in the object's header.
 * Beyond this number HDF5 would use B-trees and heaps, which readers of this format do not read. */
enum { COMPACT = 65535 };

void ebpo_h5_close_id(const ebpo_h5_out *out, ebpo_h5_id id)
{
    if (id < 0)
        return;
    ebpo_h5_scope scope;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_h5_enter(&scope);
    if (ebpo_h5_written(out, "", H5Idec_ref(id) >= 0, &error) != EBPO_OK && out->sink)
        ebpo_h5_sink_fail(out->sink, &error);
    ebpo_h5_leave(&scope);
}

/* Makes libhdf5 keep all metadata in memory, so that it never reads metadata again. If such a read
 * failed, libhdf5 could not close the file. */
static bool keep_metadata(hid_t fapl)
{
    H5AC_cache_config_t config = { .version = H5AC__CURR_CACHE_CONFIG_VERSION };
    if (H5Pget_mdc_config(fapl, &config) < 0)
        return false;
    config.evictions_enabled = false;
    config.incr_mode = H5C_incr__off;
    config.decr_mode = H5C_decr__off;
    config.flash_incr_mode = H5C_flash_incr__off;
    return H5Pset_mdc_config(fapl, &config) >= 0;
}

hid_t ebpo_h5_write_access(ebpo_h5_sink *sink, H5F_libver_t version)
{
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    bool ok = fapl >= 0 && H5Pset_libver_bounds(fapl, version, version) >= 0 &&
              H5Pset_fclose_degree(fapl, H5F_CLOSE_STRONG) >= 0 &&
              H5Pset_file_locking(fapl, false, true) >= 0 && keep_metadata(fapl) &&
              ebpo_h5_sink_use(sink, fapl);
    if (!ok)
        ebpo_h5_close_list(fapl);
    return ok ? fapl : -1;
}

/* Returns the access properties of a file in this library's layout, or -1. `head_bytes`: size of
 * the blocks of metadata. */
static hid_t file_access(ebpo_h5_sink *sink, uint64_t head_bytes)
{
    hid_t fapl = ebpo_h5_write_access(sink, H5F_LIBVER_V110);
    bool ok = fapl >= 0 && H5Pset_meta_block_size(fapl, head_bytes) >= 0 &&
              H5Pset_small_data_block_size(fapl, 0) >= 0 && H5Pset_sieve_buf_size(fapl, 0) >= 0 &&
              H5Pset_cache(fapl, 0, 1, 0, 1.0) >= 0;
    if (!ok)
        ebpo_h5_close_list(fapl);
    return ok ? fapl : -1;
}

/* Sets the properties of a group with `links` links. */
static bool set_group(hid_t plist, unsigned links)
{
    return plist >= 0 && H5Pset_obj_track_times(plist, false) >= 0 &&
           H5Pset_attr_phase_change(plist, COMPACT, 0) >= 0 &&
           H5Pset_link_phase_change(plist, COMPACT, 0) >= 0 &&
           H5Pset_est_link_info(plist, links, 12) >= 0; /* 12: typical length of a name */
}

ebpo_status ebpo_h5_create(ebpo_h5_out *out, const char *path, const char *shown,
                           uint64_t head_bytes, unsigned links, ebpo_error *error)
{
    ebpo_status status = ebpo_h5_sink_open(&out->sink, path, shown, error);
    if (status != EBPO_OK)
        return status;
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    out->shown = shown;
    hid_t fapl = file_access(out->sink, head_bytes), fcpl = H5Pcreate(H5P_FILE_CREATE);
    if (fapl >= 0 && set_group(fcpl, links) && H5Zregister(&ebpo_zstd_filter) >= 0)
        out->file = H5Fcreate(shown, H5F_ACC_TRUNC, fcpl, fapl);
    status = ebpo_h5_created(out, error);
    ebpo_h5_close_list(fapl);
    ebpo_h5_close_list(fcpl);
    ebpo_h5_leave(&scope);
    return status;
}

/* Closes the file. Sets out->file to -1 even if closing fails, because libhdf5 releases the id even
 * then. */
static ebpo_status close_file(ebpo_h5_out *out, ebpo_error *error)
{
    bool flushed = H5Fflush(out->file, H5F_SCOPE_LOCAL) >= 0;
    ebpo_status status = ebpo_h5_written(out, "", flushed, error);
    if (status != EBPO_OK)
        return status;
    bool closed = H5Fclose(out->file) >= 0;
    out->file = -1;
    status = ebpo_h5_written(out, "", closed, error);
    if (!closed) {
        ebpo_h5_sink_abandon(out->sink);
        out->sink = NULL;
    }
    return status;
}

ebpo_status ebpo_h5_reopen(ebpo_h5_out *out, uint64_t metadata_bytes, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status = close_file(out, error);
    hid_t fapl = status == EBPO_OK ? file_access(out->sink, metadata_bytes) : -1;
    if (fapl >= 0)
        out->file = H5Fopen(out->shown, H5F_ACC_RDWR, fapl);
    if (status == EBPO_OK && out->file < 0)
        status = ebpo_h5_written(out, "", false, error);
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

/* --- attributes; libhdf5 converts values from the machine's byte order to little-endian --- */

/* Writes an attribute of `count` numbers; if `count` is 0, a scalar. */
static ebpo_status put_numbers(ebpo_h5_out *out, ebpo_h5_id id, const char *name, hid_t stored,
                               hid_t memory, const void *values, unsigned count, ebpo_error *error)
{
    hsize_t dims = count;
    hid_t space = count ? H5Screate_simple(1, &dims, NULL) : H5Screate(H5S_SCALAR);
    return ebpo_h5_put_attribute(out, id, name, stored, space, memory, values, error);
}

ebpo_status ebpo_h5_put_int(ebpo_h5_out *out, ebpo_h5_id id, const char *name, int64_t value,
                            ebpo_error *error)
{
    return ebpo_h5_put_ints(out, id, name, &value, 0, error); /* a scalar */
}

ebpo_status ebpo_h5_put_ints(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                             const int64_t *values, unsigned count, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status =
        put_numbers(out, id, name, H5T_STD_I64LE, H5T_NATIVE_INT64, values, count, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_put_count(ebpo_h5_out *out, ebpo_h5_id id, const char *name, uint64_t value,
                              ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status =
        put_numbers(out, id, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, &value, 0, error);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_put_real(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                             const double *values, unsigned count, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status =
        put_numbers(out, id, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values, count, error);
    ebpo_h5_leave(&scope);
    return status;
}

/* Writes a text of fixed length, without a terminating zero byte. */
static ebpo_status put_string(ebpo_h5_out *out, ebpo_h5_id id, const char *name, const char *text,
                              size_t size, bool utf8, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t type = H5Tcopy(H5T_C_S1);
    bool good = type >= 0 && H5Tset_size(type, size) >= 0 &&
                H5Tset_strpad(type, H5T_STR_NULLPAD) >= 0 &&
                (!utf8 || H5Tset_cset(type, H5T_CSET_UTF8) >= 0);
    ebpo_status status = ebpo_h5_put_attribute(out, id, name, good ? type : -1,
                                               H5Screate(H5S_SCALAR), type, text, error);
    if (type >= 0)
        H5Tclose(type);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_put_text(ebpo_h5_out *out, ebpo_h5_id id, const char *name, const char *text,
                             ebpo_error *error)
{
    size_t size = strlen(text);
    return put_string(out, id, name, text, size ? size : 1, true, error);
}

ebpo_status ebpo_h5_put_ascii(ebpo_h5_out *out, ebpo_h5_id id, const char *name, const char *text,
                              ebpo_error *error)
{
    return put_string(out, id, name, text, strlen(text), false, error);
}

/* --- arrays --- */

static bool set_filter(hid_t dcpl, unsigned filter, unsigned level)
{
    switch (filter) {
    case EBPO_FILTER_DEFLATE: return H5Pset_deflate(dcpl, level) >= 0;
    case EBPO_FILTER_FLETCHER: return H5Pset_fletcher32(dcpl) >= 0;
    default: return H5Pset_filter(dcpl, (H5Z_filter_t)filter, H5Z_FLAG_MANDATORY, 1, &level) >= 0;
    }
}

static bool set_filters(hid_t dcpl, const ebpo_shape *shape, int level)
{
    const ebpo_pipeline_facts *row = ebpo_pipeline_facts_of(shape->pipeline);
    if (row->compresses && shape->element_size > 1 && H5Pset_shuffle(dcpl) < 0)
        return false;
    for (int i = 0; i < row->filter_count; i++)
        if (!set_filter(dcpl, row->filter[i], (unsigned)(level ? level : row->level)))
            return false;
    return true;
}

ebpo_status ebpo_h5_make_array(ebpo_h5_out *out, const char *path, const ebpo_shape *shape,
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
                              const ebpo_shape *shape, uint64_t chunk, const void *data,
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

/* Unused bytes are zero, and blocks of metadata end with a checksum. So the metadata end after the
 * last byte that is not zero, or a few bytes later if the last checksum ends with zero bytes. */
ebpo_status ebpo_h5_head_used(ebpo_h5_out *out, uint64_t first_raw, uint64_t *bytes,
                              ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    bool flushed = H5Fflush(out->file, H5F_SCOPE_LOCAL) >= 0;
    ebpo_status status = ebpo_h5_written(out, "", flushed, error);
    const ebpo_h5_sink *sink = out->sink;
    if (status == EBPO_OK) {
        uint64_t end = first_raw < sink->size ? first_raw : sink->size;
        while (end && sink->memory[end - 1] == 0)
            end--;
        *bytes = end;
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
    ebpo_status status = close_file(out, error);
    if (status == EBPO_OK) {
        status = ebpo_h5_sink_close(out->sink, error);
        out->sink = NULL;
    }
    ebpo_h5_leave(&scope);
    return status;
}

void ebpo_h5_discard(ebpo_h5_out *out)
{
    ebpo_error unwanted;
    if (!out->sink)
        return;
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    /* after a failure, the sink ignores all further writes, so that closing writes nothing */
    (void)ebpo_fail(&unwanted, EBPO_E_CANCELLED, "given up");
    ebpo_h5_sink_fail(out->sink, &unwanted);
    if (out->file >= 0 && H5Fclose(out->file) < 0)
        ebpo_h5_sink_abandon(out->sink);
    else
        (void)!ebpo_h5_sink_close(out->sink, NULL);
    out->sink = NULL;
    out->file = -1;
    ebpo_h5_leave(&scope);
}

/* If a write of the sink has failed, returns the first failure. Otherwise, if `good` is false,
 * returns the failure of the last call of libhdf5. Otherwise returns EBPO_OK. */
static ebpo_status report_outcome(const ebpo_h5_out *out, const char *object, bool good,
                                  const char *what, ebpo_error *error)
{
    ebpo_error cause = EBPO_ERROR_INIT;
    if (out->sink && ebpo_h5_sink_status(out->sink, error) != EBPO_OK)
        return out->sink->status;
    if (good)
        return EBPO_OK;
    (void)ebpo_h5_fail(&cause, ebpo_h5_short_of_memory() ? EBPO_E_MEMORY : EBPO_E_IO, out->shown,
                       object, what);
    if (out->sink)
        ebpo_h5_sink_fail(out->sink, &cause);
    return ebpo_fail_with(error, &cause);
}

ebpo_status ebpo_h5_created(const ebpo_h5_out *out, ebpo_error *error)
{
    return report_outcome(out, "", out->file >= 0, "libhdf5 could not create the file", error);
}

ebpo_status ebpo_h5_written(const ebpo_h5_out *out, const char *what, bool good, ebpo_error *error)
{
    return report_outcome(out, what, good, "libhdf5 could not write", error);
}

void ebpo_h5_close_list(hid_t list)
{
    if (list >= 0)
        H5Pclose(list);
}

void ebpo_h5_close_space(hid_t space)
{
    if (space >= 0)
        H5Sclose(space);
}

ebpo_status ebpo_h5_put_group(const ebpo_h5_out *out, const char *path, hid_t gcpl, bool good,
                              ebpo_h5_id *id, ebpo_error *error)
{
    *id = good ? H5Gcreate2(out->file, path, H5P_DEFAULT, gcpl, H5P_DEFAULT) : -1;
    ebpo_status status = ebpo_h5_written(out, path, *id >= 0, error);
    ebpo_h5_close_list(gcpl);
    return status;
}

ebpo_status ebpo_h5_put_dataset(const ebpo_h5_out *out, const char *path, hid_t type, hid_t space,
                                hid_t dcpl, bool good, ebpo_h5_id *id, ebpo_error *error)
{
    *id = good ? H5Dcreate2(out->file, path, type, space, H5P_DEFAULT, dcpl, H5P_DEFAULT) : -1;
    ebpo_status status = ebpo_h5_written(out, path, *id >= 0, error);
    ebpo_h5_close_space(space);
    ebpo_h5_close_list(dcpl);
    return status;
}

ebpo_status ebpo_h5_put_attribute(const ebpo_h5_out *out, hid_t object, const char *name,
                                  hid_t type, hid_t space, hid_t memory, const void *value,
                                  ebpo_error *error)
{
    hid_t attribute = -1;
    if (type >= 0 && space >= 0) {
        if (H5Aexists(object, name) > 0)
            attribute = H5Aopen(object, name, H5P_DEFAULT);
        else
            attribute = H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    }
    bool good = attribute >= 0 && H5Awrite(attribute, memory < 0 ? type : memory, value) >= 0;
    ebpo_status status = ebpo_h5_written(out, name, good, error);
    if (attribute >= 0 && H5Aclose(attribute) < 0 && status == EBPO_OK)
        status = ebpo_h5_written(out, name, false, error);
    ebpo_h5_close_space(space);
    return status;
}
