/* Replaces all other files of lib/hdf5_write if the library is built without libhdf5
 * (-Dhdf5=disabled). The library then still reads files of this format. The functions in this file
 * that close or finish a file or object do nothing, because no file is ever open. All other
 * functions in this file fail. */
#include <ebpo/rows.h>

#include "core/error.h"
#include "hdf5_write/h5.h"

static ebpo_status is_unsupported(const char *shown, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, shown,
                          "this library was built without libhdf5, and can only read .ebpo.h5 "
                          "files; use a library that was built with -Dhdf5=enabled");
}

ebpo_status ebpo_h5_register(ebpo_error *error) { return is_unsupported("HDF5", error); }

void ebpo_h5_close_id(const ebpo_h5_out *out, ebpo_h5_id id) { (void)out, (void)id; }

ebpo_status ebpo_h5_create(ebpo_h5_out *out, const char *path, const char *shown,
                           uint64_t head_bytes, unsigned links, ebpo_error *error)
{
    (void)out, (void)path, (void)head_bytes, (void)links;
    return is_unsupported(shown, error);
}

ebpo_status ebpo_h5_reopen(ebpo_h5_out *out, uint64_t metadata_bytes, ebpo_error *error)
{
    (void)metadata_bytes;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_root(ebpo_h5_out *out, ebpo_h5_id *id, ebpo_error *error)
{
    (void)id;
    *id = -1;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_make_group(ebpo_h5_out *out, const char *path, unsigned links, ebpo_h5_id *id,
                               ebpo_error *error)
{
    (void)path, (void)links, (void)id;
    *id = -1;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_put_text(ebpo_h5_out *out, ebpo_h5_id id, const char *name, const char *text,
                             ebpo_error *error)
{
    (void)id, (void)name, (void)text;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_put_int(ebpo_h5_out *out, ebpo_h5_id id, const char *name, int64_t value,
                            ebpo_error *error)
{
    (void)id, (void)name, (void)value;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_put_count(ebpo_h5_out *out, ebpo_h5_id id, const char *name, uint64_t value,
                              ebpo_error *error)
{
    (void)id, (void)name, (void)value;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_put_real(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                             const double *values, unsigned count, ebpo_error *error)
{
    (void)id, (void)name, (void)values, (void)count;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_open_array(ebpo_h5_out *out, const char *path, ebpo_h5_id *id,
                               ebpo_error *error)
{
    (void)path, (void)id;
    *id = -1;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_make_array(ebpo_h5_out *out, const char *path, const ebpo_shape *shape,
                               ebpo_h5_id *id, ebpo_error *error)
{
    (void)path, (void)shape, (void)id;
    *id = -1;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_put_chunk(ebpo_h5_out *out, const char *path, ebpo_h5_id id,
                              const ebpo_shape *shape, uint64_t chunk, const void *data,
                              size_t bytes, ebpo_error *error)
{
    (void)path, (void)id, (void)shape, (void)chunk, (void)data, (void)bytes;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_head_used(ebpo_h5_out *out, uint64_t first_raw, uint64_t *bytes,
                              ebpo_error *error)
{
    (void)first_raw, (void)bytes;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_size(ebpo_h5_out *out, uint64_t *bytes, ebpo_error *error)
{
    (void)bytes;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_finish(ebpo_h5_out *out, ebpo_error *error)
{
    (void)out, (void)error;
    return EBPO_OK;
}

void ebpo_h5_discard(ebpo_h5_out *out) { (void)out; }

ebpo_status ebpo_h5_create_plain(ebpo_h5_out *out, const char *path, const char *shown,
                                 ebpo_error *error)
{
    (void)out, (void)path;
    return is_unsupported(shown, error);
}

ebpo_status ebpo_h5_make_plain_group(ebpo_h5_out *out, const char *path, ebpo_h5_id *id,
                                     ebpo_error *error)
{
    (void)path, (void)id;
    *id = -1;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_put_ints(ebpo_h5_out *out, ebpo_h5_id id, const char *name,
                             const int64_t *values, unsigned count, ebpo_error *error)
{
    (void)id, (void)name, (void)values, (void)count;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_put_ascii(ebpo_h5_out *out, ebpo_h5_id id, const char *name, const char *text,
                              ebpo_error *error)
{
    (void)id, (void)name, (void)text;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_make_table(ebpo_h5_out *out, const char *path, ebpo_h5_number number,
                               uint32_t cols, ebpo_h5_table *table, ebpo_error *error)
{
    (void)path, (void)number, (void)cols, (void)table;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_append(ebpo_h5_out *out, ebpo_h5_table *table, const void *data, uint64_t rows,
                           ebpo_error *error)
{
    (void)table, (void)data, (void)rows;
    return is_unsupported(out->shown, error);
}

void ebpo_h5_close_table(const ebpo_h5_out *out, ebpo_h5_table *table) { (void)out, (void)table; }

ebpo_status ebpo_h5_put_table(ebpo_h5_out *out, const char *path, ebpo_h5_number number,
                              uint32_t cols, const void *data, uint64_t rows, ebpo_error *error)
{
    (void)path, (void)number, (void)cols, (void)data, (void)rows;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_clean_copy(const char *from, bool from_goes, const char *to, const char *shown,
                               ebpo_h5_chunk_rows_fn chunk_rows, const ebpo_process_limits *limits,
                               ebpo_error *omitted, ebpo_error *error)
{
    (void)from, (void)from_goes, (void)to, (void)chunk_rows, (void)limits, (void)omitted;
    return is_unsupported(shown, error);
}

ebpo_status ebpo_rows_read(const char *path, const char *name, unsigned least, unsigned most,
                           double fill, double **rows, uint64_t *count, ebpo_error *error)
{
    (void)name, (void)least, (void)most, (void)fill;
    *rows = NULL;
    *count = 0;
    return is_unsupported(path, error);
}

ebpo_status ebpo_rows_read_part(const char *path, const char *name, unsigned least, unsigned most,
                                double fill, uint64_t first, uint64_t max_rows, double **rows,
                                uint64_t *count, uint64_t *total, ebpo_error *error)
{
    (void)first, (void)max_rows;
    *total = 0;
    return ebpo_rows_read(path, name, least, most, fill, rows, count, error);
}

ebpo_status ebpo_h5_make_volume(ebpo_h5_out *out, const char *path, const uint64_t dims[3],
                                ebpo_h5_id *id, ebpo_error *error)
{
    (void)path, (void)dims, (void)id;
    *id = -1;
    return is_unsupported(out->shown, error);
}

ebpo_status ebpo_h5_put_layers(ebpo_h5_out *out, const char *path, ebpo_h5_id id,
                               const uint64_t dims[3], uint64_t first, uint64_t layers,
                               const double *data, ebpo_error *error)
{
    (void)path, (void)id, (void)dims, (void)first, (void)layers, (void)data;
    return is_unsupported(out->shown, error);
}
