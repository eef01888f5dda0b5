/* Opening and reading files that nobody vouches for, see h5.h. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/text.h"
#include "h5/driver.h"
#include "h5/h5.h"
#include "h5/scope.h"
#include "h5/zstd_filter.h"

static hid_t file_access(ebpo_h5_driver *driver)
{
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    if (fapl >= 0 && (H5Pset_fclose_degree(fapl, H5F_CLOSE_STRONG) < 0 ||
                      H5Pset_file_locking(fapl, false, true) < 0 ||
                      H5Pset_cache(fapl, 0, 1, 0, 1.0) < 0 || !ebpo_h5_driver_use(driver, fapl))) {
        H5Pclose(fapl);
        return -1;
    }
    return fapl;
}

ebpo_status ebpo_h5_open(ebpo_h5_in *in, ebpo_input *input, ebpo_error *error)
{
    *in = (ebpo_h5_in){ .shown = input->shown, .file = -1, .file_bytes = input->source.size };
    in->driver = ebpo_alloc_zero(1, sizeof *in->driver);
    if (!in->driver)
        return ebpo_fail_memory(error, sizeof *in->driver);
    ebpo_status status = ebpo_h5_driver_open(in->driver, input, error);
    if (status != EBPO_OK)
        return status;
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t fapl = file_access(in->driver);
    in->file = fapl < 0 ? -1 : H5Fopen(in->shown, H5F_ACC_RDONLY, fapl);
    if (in->file < 0)
        status = ebpo_h5_fail(
            error, EBPO_E_FORMAT, in->shown, "",
            "not a whole HDF5 file; was it cut off in copying, or is it something else?");
    if (fapl >= 0)
        H5Pclose(fapl);
    ebpo_h5_leave(&scope);
    return status;
}

void ebpo_h5_expect_index(ebpo_h5_in *in, ebpo_range index) { in->driver->index = index; }

ebpo_status ebpo_h5_close(ebpo_h5_in *in, ebpo_status status, ebpo_error *error)
{
    ebpo_h5_close_id(in->file);
    if (in->driver && in->driver->status != EBPO_OK)
        status = ebpo_fail_with(error, &in->driver->error);
    if (in->driver)
        ebpo_h5_driver_close(in->driver);
    free(in->driver);
    *in = (ebpo_h5_in)EBPO_H5_IN_INIT;
    return status;
}

ebpo_h5_kind ebpo_h5_look(ebpo_h5_in *in, const char *path)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_h5_kind kind = EBPO_H5_ABSENT;
    H5L_info_t link;
    H5O_info_t object;
    htri_t there = H5Lexists(in->file, path, H5P_DEFAULT);
    if (there != 0) {
        kind = EBPO_H5_OTHER;
        if (there > 0 && H5Lget_info(in->file, path, &link, H5P_DEFAULT) >= 0 &&
            link.type == H5L_TYPE_HARD &&
            H5Oget_info_by_name2(in->file, path, &object, H5O_INFO_BASIC, H5P_DEFAULT) >= 0)
            kind = object.type == H5O_TYPE_GROUP     ? EBPO_H5_GROUP
                   : object.type == H5O_TYPE_DATASET ? EBPO_H5_ARRAY
                                                     : EBPO_H5_OTHER;
    }
    ebpo_h5_leave(&scope);
    return kind;
}

ebpo_status ebpo_h5_open_group(ebpo_h5_in *in, const char *path, ebpo_h5_id *id, ebpo_error *error)
{
    *id = -1;
    if (strcmp(path, "/") != 0 && ebpo_h5_look(in, path) != EBPO_H5_GROUP)
        return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, path, -1,
                            "a group is expected here and there is none");
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    *id = H5Gopen2(in->file, path, H5P_DEFAULT);
    ebpo_status status =
        *id >= 0 ? EBPO_OK
                 : ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, path, "the group is damaged");
    ebpo_h5_leave(&scope);
    return status;
}

static ebpo_status attribute_fails(ebpo_h5_in *in, const char *object, const char *name,
                                   const char *what, ebpo_error *error)
{
    char place[160];
    snprintf(place, sizeof place, "%s: attribute %s", object, name);
    return ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, place, what);
}

/* Opens the attribute and its type; EBPO_E_ABSENT when there is none. `points`: how many values it
 * must have. */
static ebpo_status open_attribute(ebpo_h5_in *in, hid_t id, const char *object, const char *name,
                                  hssize_t points, hid_t *attribute, hid_t *type, ebpo_error *error)
{
    *attribute = *type = -1;
    htri_t there = H5Aexists(id, name);
    if (there == 0)
        return EBPO_E_ABSENT;
    hid_t space = -1;
    if (there > 0)
        *attribute = H5Aopen(id, name, H5P_DEFAULT);
    if (*attribute >= 0) {
        *type = H5Aget_type(*attribute);
        space = H5Aget_space(*attribute);
    }
    bool ok = *type >= 0 && space >= 0 && H5Sget_simple_extent_npoints(space) == points;
    if (space >= 0)
        H5Sclose(space);
    if (ok)
        return EBPO_OK;
    return attribute_fails(in, object, name, "it is damaged or has the wrong number of values",
                           error);
}

static void close_attribute(hid_t attribute, hid_t type)
{
    if (type >= 0)
        H5Tclose(type);
    if (attribute >= 0)
        H5Aclose(attribute);
}

static ebpo_status read_text(ebpo_h5_in *in, hid_t id, const char *object, const char *name,
                             char *text, size_t size, ebpo_error *error)
{
    enum { STORED_MOST = 65536 }; /* an attribute in a header has no more */
    hid_t attribute, type;
    ebpo_status status = open_attribute(in, id, object, name, 1, &attribute, &type, error);
    size_t length = status == EBPO_OK ? H5Tget_size(type) : 0;
    bool fits = length && length <= STORED_MOST && H5Tget_class(type) == H5T_STRING &&
                H5Tis_variable_str(type) == 0;
    char *stored = fits ? ebpo_alloc_zero(length + 1, 1) : NULL;
    memset(text, 0, size);
    if (fits && !stored)
        status = ebpo_fail_memory(error, length + 1);
    if (stored && H5Aread(attribute, type, stored) >= 0 && strlen(stored) < size &&
        ebpo_text_ok(stored))
        memcpy(text, stored, strlen(stored));
    else if (status == EBPO_OK)
        status = attribute_fails(in, object, name,
                                 "it is not a fixed-length UTF-8 text of a sensible length", error);
    free(stored);
    close_attribute(attribute, type);
    return status;
}

ebpo_status ebpo_h5_get_text(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const char *name,
                             char *text, size_t size, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status = read_text(in, id, object, name, text, size, error);
    ebpo_h5_leave(&scope);
    return status;
}

static ebpo_status get_numbers(ebpo_h5_in *in, hid_t id, const char *object, const char *name,
                               hid_t stored, hid_t memory, void *values, unsigned count,
                               const char *what, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t attribute, type;
    ebpo_status status =
        open_attribute(in, id, object, name, count ? count : 1, &attribute, &type, error);
    if (status == EBPO_OK &&
        (H5Tequal(type, stored) <= 0 || H5Aread(attribute, memory, values) < 0))
        status = attribute_fails(in, object, name, what, error);
    close_attribute(attribute, type);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_get_int(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const char *name,
                            int64_t *value, ebpo_error *error)
{
    return get_numbers(in, id, object, name, H5T_STD_I64LE, H5T_NATIVE_INT64, value, 0,
                       "it is not an i64", error);
}

ebpo_status ebpo_h5_get_count(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const char *name,
                              uint64_t *value, ebpo_error *error)
{
    return get_numbers(in, id, object, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, value, 0,
                       "it is not a u64", error);
}

ebpo_status ebpo_h5_get_real(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const char *name,
                             double *values, unsigned count, ebpo_error *error)
{
    return get_numbers(in, id, object, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values, count,
                       "it is not of f64 numbers", error);
}

ebpo_status ebpo_h5_look_at_array(ebpo_h5_in *in, const char *path, ebpo_h5_id *id,
                                  ebpo_error *error)
{
    bool found = ebpo_h5_look(in, path) == EBPO_H5_ARRAY;
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    *id = found ? H5Dopen2(in->file, path, H5P_DEFAULT) : -1;
    ebpo_status status =
        *id >= 0 ? EBPO_OK
                 : ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, path, "the array is damaged");
    ebpo_h5_leave(&scope);
    return status;
}

/* Number of filters, with their ids; shuffle must have been set for our elements. -1 when there are
 * more than three. */
static int list_filters(hid_t dcpl, unsigned element_size, int ids[3])
{
    int count = H5Pget_nfilters(dcpl);
    if (count < 0 || count > 3)
        return -1;
    for (int i = 0; i < count; i++) {
        unsigned flags, values[4] = { 0 };
        size_t value_count = 4;
        /* Neither name nor configuration: for those libhdf5 may want the filter registered, and
         * says so in an error that is none of ours. */
        ids[i] = H5Pget_filter2(dcpl, (unsigned)i, &flags, &value_count, values, 0, NULL, NULL);
        if (ids[i] < 0 ||
            (ids[i] == H5Z_FILTER_SHUFFLE && (value_count != 1 || values[0] != element_size)))
            return -1;
    }
    return count;
}

/* Shuffled elements of one byte are what they were: h5repack shuffles all arrays alike. */
static bool find_pipeline(hid_t dcpl, unsigned element_size, ebpo_pipeline *pipeline)
{
    static const struct {
        ebpo_pipeline pipeline;
        int count, ids[2];
        bool shuffled;
    } known[] = {
        { EBPO_PIPELINE_ZSTD, 1, { EBPO_ZSTD_FILTER_ID }, true },
        { EBPO_PIPELINE_DEFLATE, 2, { H5Z_FILTER_DEFLATE, H5Z_FILTER_FLETCHER32 }, true },
        { EBPO_PIPELINE_CHECKSUM, 1, { H5Z_FILTER_FLETCHER32 }, false },
        { EBPO_PIPELINE_BARE, 0, { 0 }, false },
    };
    int ids[3] = { 0 };
    int count = list_filters(dcpl, element_size, ids);
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        int shuffles = known[i].shuffled && (element_size > 1 || ids[0] == H5Z_FILTER_SHUFFLE);
        if (count != known[i].count + shuffles || (shuffles && ids[0] != H5Z_FILTER_SHUFFLE))
            continue;
        bool same = true;
        for (int k = 0; k < known[i].count; k++)
            same = same && ids[shuffles + k] == known[i].ids[k];
        if (same) {
            *pipeline = known[i].pipeline;
            return true;
        }
    }
    return false;
}

static bool find_type(hid_t dataset, ebpo_h5_shape *shape)
{
    hid_t type = H5Dget_type(dataset);
    bool found = false;
    for (unsigned size = 1; size <= 8 && !found; size *= 2)
        for (int is_signed = 0; is_signed < 2 && !found; is_signed++)
            if (type >= 0 && H5Tequal(type, ebpo_h5_integer_type(size, is_signed)) > 0) {
                shape->element_size = (uint8_t)size;
                shape->is_signed = is_signed;
                found = true;
            }
    if (type >= 0)
        H5Tclose(type);
    return found;
}

enum { COLS_MOST = 160 };

/* Chunks of 4 GiB and more are none of HDF5's. */
static bool rows_fit(const ebpo_h5_shape *shape, ebpo_h5_rows rule, hsize_t rows)
{
    uint64_t full = ebpo_h5_chunk_rows(shape->rows, shape->cols, shape->element_size);
    if (rule == EBPO_H5_ROWS_ALL)
        return rows == shape->rows && rows <= UINT32_MAX / ebpo_h5_row_bytes(shape);
    bool power = rows && !(rows & (rows - 1));
    return rows == full || (rule == EBPO_H5_ROWS_POWER && power && rows < full);
}

static const char *find_shape(hid_t dataset, hid_t dcpl, ebpo_h5_rows rule, ebpo_h5_shape *shape)
{
    hsize_t dims[2] = { 0, 0 }, most[2] = { 0, 0 }, chunk[2] = { 0, 0 };
    hid_t space = H5Dget_space(dataset);
    int rank = space >= 0 ? H5Sget_simple_extent_ndims(space) : -1;
    bool plain = (rank == 1 || rank == 2) && H5Sget_simple_extent_dims(space, dims, most) == rank;
    if (space >= 0)
        H5Sclose(space);
    if (!find_type(dataset, shape))
        return "the array is not of little-endian integers";
    if (!plain || dims[0] == 0 || most[0] != dims[0] || most[1] != dims[1] || dims[1] > COLS_MOST ||
        (rank == 2 && dims[1] == 0))
        return "the array does not have one or two fixed dimensions";
    shape->rows = dims[0];
    shape->cols = rank == 2 ? (uint32_t)dims[1] : 0;
    if (H5Pget_layout(dcpl) != H5D_CHUNKED || H5Pget_chunk(dcpl, 2, chunk) != rank)
        return "the array is not stored in chunks";
    shape->chunk_rows = (uint32_t)chunk[0];
    if (!rows_fit(shape, rule, chunk[0]) || chunk[1] != shape->cols)
        return "the array's chunks do not have the size that the format fixes";
    if (!find_pipeline(dcpl, shape->element_size, &shape->pipeline))
        return "the array's filters are none of the format's";
    return NULL;
}

/* Address and size of one chunk, by reading it while the driver records. What is wrong with it, or
 * NULL. */
static const char *find_chunk(ebpo_h5_in *in, hid_t dataset, const ebpo_h5_shape *shape,
                              uint64_t number, uint64_t bound, ebpo_h5_chunk *chunk)
{
    uint8_t unused[1]; /* the driver writes nothing */
    uint32_t mask = 0;
    hsize_t at[2] = { number * shape->chunk_rows, 0 };
    ebpo_h5_driver *d = in->driver;
    d->recorded = 0;
    d->recording = true;
    herr_t result = H5Dread_chunk(dataset, H5P_DEFAULT, at, &mask, unused);
    d->recording = false;
    if (result < 0 || d->recorded != 1 || d->bytes == 0)
        return "the chunk is missing";
    if (mask != 0)
        return "the chunk was stored without its filters";
    if (d->bytes > bound)
        return "the chunk is larger than it can be";
    if (d->address > in->file_bytes || d->bytes > in->file_bytes - d->address)
        return "the chunk lies beyond the end of the file";
    *chunk = (ebpo_h5_chunk){ d->address, (uint32_t)d->bytes };
    return NULL;
}

/* A chunk takes some bytes, so a file cannot hold more of them than its size allows. */
static ebpo_status find_chunks(ebpo_h5_in *in, hid_t dataset, const char *path,
                               const ebpo_h5_shape *shape, ebpo_h5_chunk **chunks, uint64_t *stored,
                               ebpo_error *error)
{
    enum { CHUNK_MIN = 4 };
    char place[160];
    uint64_t count = ebpo_h5_chunk_count(shape),
             bound = ebpo_chunk_bound(shape->chunk_rows * ebpo_h5_row_bytes(shape));
    const char *wrong = NULL;
    if (count > 1 && count > in->file_bytes / CHUNK_MIN)
        return ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, path,
                            "the array has more chunks than the file can hold");
    *chunks = ebpo_alloc(count, sizeof **chunks);
    if (!*chunks)
        return ebpo_fail_memory(error, count * sizeof **chunks);
    for (uint64_t i = 0; i < count; i++) {
        wrong = find_chunk(in, dataset, shape, i, bound, *chunks + i);
        if (wrong) {
            snprintf(place, sizeof place, "%s: chunk %" PRIu64, path, i);
            return ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, place, wrong);
        }
        *stored += (*chunks)[i].bytes;
        if (*stored > in->file_bytes)
            return ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, path,
                                "the array's chunks do not fit the file");
    }
    return EBPO_OK;
}

ebpo_status ebpo_h5_read_array(ebpo_h5_in *in, const char *path, uint64_t most, ebpo_h5_rows rows,
                               ebpo_h5_shape *shape, char coding[EBPO_H5_CODING_BYTES],
                               ebpo_h5_chunk **chunks, uint64_t *stored_bytes, ebpo_error *error)
{
    *chunks = NULL;
    *stored_bytes = 0;
    ebpo_h5_kind kind = ebpo_h5_look(in, path);
    if (kind != EBPO_H5_ARRAY)
        return ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, path, -1,
                            "%s; get a fresh copy of the file",
                            kind == EBPO_H5_ABSENT ? "the array is missing"
                                                   : "this is not an array");
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t dataset = H5Dopen2(in->file, path, H5P_DEFAULT),
          dcpl = dataset >= 0 ? H5Dget_create_plist(dataset) : -1;
    const char *wrong =
        dcpl < 0 ? "the array's description is damaged" : find_shape(dataset, dcpl, rows, shape);
    ebpo_status status =
        wrong ? ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, path, wrong) : EBPO_OK;
    if (status == EBPO_OK && coding)
        status = read_text(in, dataset, path, "coding", coding, EBPO_H5_CODING_BYTES, error);
    if (status == EBPO_E_ABSENT)
        status = ebpo_fail_at(error, EBPO_E_FORMAT, in->shown, path, -1,
                              "attribute coding is missing; get a fresh copy of the file");
    if (status == EBPO_OK && ebpo_h5_chunk_count(shape) <= most)
        status = find_chunks(in, dataset, path, shape, chunks, stored_bytes, error);
    if (dcpl >= 0)
        H5Pclose(dcpl);
    if (dataset >= 0)
        H5Dclose(dataset);
    ebpo_h5_leave(&scope);
    if (status != EBPO_OK) {
        free(*chunks);
        *chunks = NULL;
    }
    return status;
}
