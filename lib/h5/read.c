/* Opening and reading files that nobody vouches for, see h5.h. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"
#include "h5/h5.h"
#include "h5/scope.h"
#include "h5/zstd_filter.h"

static ebpo_status look_at_file(const char *path, ebpo_error *error)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return ebpo_fail_errno(error, path, "cannot be opened");
    struct stat facts;
    ebpo_status status = EBPO_OK;
    if (fstat(fd, &facts) < 0)
        status = ebpo_fail_errno(error, path, "cannot be examined");
    else if (!S_ISREG(facts.st_mode))
        status = ebpo_fail(error, EBPO_E_IO, "%s: not a regular file; give the name of an .ebpo.h5 file", path);
    close(fd);
    return status;
}

static hid_t file_access(void)
{
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    if (fapl >= 0 && (H5Pset_fclose_degree(fapl, H5F_CLOSE_STRONG) < 0 || H5Pset_file_locking(fapl, false, true) < 0 ||
                      H5Pset_cache(fapl, 0, 1, 0, 1.0) < 0)) {
        H5Pclose(fapl);
        return -1;
    }
    return fapl;
}

ebpo_status ebpo_h5_open(ebpo_h5_in *in, const char *path, ebpo_error *error)
{
    ebpo_status status = look_at_file(path, error);
    if (status != EBPO_OK)
        return status;
    in->shown = strdup(path);
    if (!in->shown)
        return ebpo_fail_memory(error, strlen(path) + 1);
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t fapl = file_access();
    hsize_t size = 0;
    in->file = fapl < 0 ? -1 : H5Fopen(path, H5F_ACC_RDONLY, fapl);
    if (in->file < 0 || H5Fget_filesize(in->file, &size) < 0)
        status = ebpo_h5_fail(error, EBPO_E_FORMAT, path, "", "not a whole HDF5 file; was it cut off in copying, or is it something else?");
    in->file_bytes = size;
    if (fapl >= 0)
        H5Pclose(fapl);
    ebpo_h5_leave(&scope);
    return status;
}

void ebpo_h5_close(ebpo_h5_in *in)
{
    ebpo_h5_close_id(in->file);
    free(in->shown);
    *in = (ebpo_h5_in)EBPO_H5_IN_INIT;
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
        if (there > 0 && H5Lget_info(in->file, path, &link, H5P_DEFAULT) >= 0 && link.type == H5L_TYPE_HARD &&
            H5Oget_info_by_name2(in->file, path, &object, H5O_INFO_BASIC, H5P_DEFAULT) >= 0)
            kind = object.type == H5O_TYPE_GROUP ? EBPO_H5_GROUP : object.type == H5O_TYPE_DATASET ? EBPO_H5_ARRAY : EBPO_H5_OTHER;
    }
    ebpo_h5_leave(&scope);
    return kind;
}

ebpo_status ebpo_h5_open_group(ebpo_h5_in *in, const char *path, ebpo_h5_id *id, ebpo_error *error)
{
    *id = -1;
    if (strcmp(path, "/") != 0 && ebpo_h5_look(in, path) != EBPO_H5_GROUP)
        return ebpo_fail(error, EBPO_E_FORMAT, "%s: %s: a group is expected here and there is none", in->shown, path);
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    *id = H5Gopen2(in->file, path, H5P_DEFAULT);
    ebpo_status status = *id >= 0 ? EBPO_OK : ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, path, "the group is damaged");
    ebpo_h5_leave(&scope);
    return status;
}

static ebpo_status attribute_fails(ebpo_h5_in *in, const char *object, const char *name, const char *what, ebpo_error *error)
{
    char place[160];
    snprintf(place, sizeof place, "%s: attribute %s", object, name);
    return ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, place, what);
}

/* Opens the attribute and its type; EBPO_E_ABSENT when there is none. `points`: how many values it must have. */
static ebpo_status open_attribute(ebpo_h5_in *in, hid_t id, const char *object, const char *name, hssize_t points, hid_t *attribute,
                                  hid_t *type, ebpo_error *error)
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
    return attribute_fails(in, object, name, "it is damaged or has the wrong number of values", error);
}

static void close_attribute(hid_t attribute, hid_t type)
{
    if (type >= 0)
        H5Tclose(type);
    if (attribute >= 0)
        H5Aclose(attribute);
}

bool ebpo_h5_text_ok(const char *text)
{
    const uint8_t *p = (const uint8_t *)text;
    while (*p) {
        unsigned more = *p < 0x80 ? 0 : *p >= 0xc2 && *p < 0xe0 ? 1 : *p >= 0xe0 && *p < 0xf0 ? 2 : *p >= 0xf0 && *p < 0xf5 ? 3 : 9;
        if (more == 9 || *p < 0x20 || *p == 0x7f)
            return false;
        if ((*p == 0xe0 && p[1] < 0xa0) || (*p == 0xed && p[1] >= 0xa0) || (*p == 0xf0 && p[1] < 0x90) || (*p == 0xf4 && p[1] >= 0x90) ||
            (*p == 0xc2 && p[1] < 0xa0))
            return false; /* overlong, surrogate, beyond Unicode, control */
        for (p++; more; more--, p++)
            if (*p < 0x80 || *p > 0xbf)
                return false;
    }
    return true;
}

ebpo_status ebpo_h5_get_text(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const char *name, char *text, size_t size,
                             ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t attribute, type;
    ebpo_status status = open_attribute(in, id, object, name, 1, &attribute, &type, error);
    memset(text, 0, size);
    if (status == EBPO_OK) {
        size_t length = H5Tget_size(type);
        if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0 || length == 0 || length >= size ||
            H5Aread(attribute, type, text) < 0 || !ebpo_h5_text_ok(text))
            status = attribute_fails(in, object, name, "it is not a fixed-length UTF-8 text of a sensible length", error);
    }
    if (status != EBPO_OK)
        text[0] = 0;
    close_attribute(attribute, type);
    ebpo_h5_leave(&scope);
    return status;
}

static ebpo_status get_numbers(ebpo_h5_in *in, hid_t id, const char *object, const char *name, hid_t stored, hid_t memory, void *values,
                               unsigned count, const char *what, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t attribute, type;
    ebpo_status status = open_attribute(in, id, object, name, count ? count : 1, &attribute, &type, error);
    if (status == EBPO_OK && (H5Tequal(type, stored) <= 0 || H5Aread(attribute, memory, values) < 0))
        status = attribute_fails(in, object, name, what, error);
    close_attribute(attribute, type);
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_get_int(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const char *name, int64_t *value, ebpo_error *error)
{
    return get_numbers(in, id, object, name, H5T_STD_I64LE, H5T_NATIVE_INT64, value, 0, "it is not an i64", error);
}

ebpo_status ebpo_h5_get_count(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const char *name, uint64_t *value, ebpo_error *error)
{
    return get_numbers(in, id, object, name, H5T_STD_U64LE, H5T_NATIVE_UINT64, value, 0, "it is not a u64", error);
}

ebpo_status ebpo_h5_get_real(ebpo_h5_in *in, ebpo_h5_id id, const char *object, const char *name, double *values, unsigned count,
                             ebpo_error *error)
{
    return get_numbers(in, id, object, name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values, count, "it is not of f64 numbers",
                       error);
}

/* Number of filters, with their ids; shuffle must have been set for our elements. -1 when there are more than three. */
static int list_filters(hid_t dcpl, unsigned element_size, int ids[3])
{
    int count = H5Pget_nfilters(dcpl);
    if (count < 0 || count > 3)
        return -1;
    for (int i = 0; i < count; i++) {
        unsigned flags, config, values[4] = { 0 };
        size_t value_count = 4;
        char name[8];
        ids[i] = H5Pget_filter2(dcpl, (unsigned)i, &flags, &value_count, values, sizeof name, name, &config);
        if (ids[i] < 0 || (ids[i] == H5Z_FILTER_SHUFFLE && (value_count != 1 || values[0] != element_size)))
            return -1;
    }
    return count;
}

static bool find_pipeline(hid_t dcpl, unsigned element_size, ebpo_pipeline *pipeline)
{
    static const struct { ebpo_pipeline pipeline; int count, ids[2]; bool shuffled; } known[] = {
        { EBPO_PIPELINE_ZSTD, 1, { EBPO_ZSTD_FILTER_ID }, true },
        { EBPO_PIPELINE_DEFLATE, 2, { H5Z_FILTER_DEFLATE, H5Z_FILTER_FLETCHER32 }, true },
        { EBPO_PIPELINE_CHECKSUM, 1, { H5Z_FILTER_FLETCHER32 }, false },
        { EBPO_PIPELINE_BARE, 0, { 0 }, false },
    };
    int ids[3] = { 0 };
    int count = list_filters(dcpl, element_size, ids);
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        int shuffles = known[i].shuffled && element_size > 1;
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

static const char *find_shape(hid_t dataset, hid_t dcpl, ebpo_h5_shape *shape)
{
    hsize_t dims[2] = { 0, 0 }, most[2] = { 0, 0 }, chunk[2] = { 0, 0 };
    hid_t space = H5Dget_space(dataset);
    int rank = space >= 0 ? H5Sget_simple_extent_ndims(space) : -1;
    bool plain = (rank == 1 || rank == 2) && H5Sget_simple_extent_dims(space, dims, most) == rank;
    if (space >= 0)
        H5Sclose(space);
    if (!find_type(dataset, shape))
        return "the array is not of little-endian integers";
    if (!plain || dims[0] == 0 || most[0] != dims[0] || most[1] != dims[1] || dims[1] > 8 || (rank == 2 && dims[1] == 0))
        return "the array does not have one or two fixed dimensions";
    shape->rows = dims[0];
    shape->cols = rank == 2 ? (uint32_t)dims[1] : 0;
    if (H5Pget_layout(dcpl) != H5D_CHUNKED || H5Pget_chunk(dcpl, 2, chunk) != rank)
        return "the array is not stored in chunks";
    shape->chunk_rows = ebpo_h5_chunk_rows(shape->rows, shape->cols, shape->element_size);
    if (chunk[0] != shape->chunk_rows || chunk[1] != shape->cols)
        return "the array's chunks do not have the size that the format fixes";
    if (!find_pipeline(dcpl, shape->element_size, &shape->pipeline))
        return "the array's filters are none of the format's";
    return NULL;
}

/* A chunk takes some bytes, so a file cannot hold more of them than its size allows. */
static const char *find_storage(ebpo_h5_in *in, hid_t dataset, const ebpo_h5_shape *shape, uint64_t *stored, uint64_t *address)
{
    enum { CHUNK_MIN = 4 };
    if (ebpo_h5_chunk_count(shape) > in->file_bytes / CHUNK_MIN)
        return "the array has more chunks than the file can hold";
    *stored = H5Dget_storage_size(dataset);
    if (*stored > in->file_bytes || ebpo_h5_chunk_count(shape) > *stored / (shape->rows == 1 ? 1 : CHUNK_MIN))
        return "the array's chunks do not fit the file";
    hsize_t at[2] = { 0, 0 }, size;
    haddr_t where = HADDR_UNDEF;
    unsigned mask;
    if (H5Dget_chunk_info_by_coord(dataset, at, &mask, &where, &size) < 0 || where == HADDR_UNDEF)
        return "the array's first chunk is missing";
    *address = where;
    return NULL;
}

ebpo_status ebpo_h5_open_array(ebpo_h5_in *in, const char *path, ebpo_h5_shape *shape, uint64_t *stored_bytes, uint64_t *address,
                               ebpo_h5_id *id, ebpo_error *error)
{
    *id = -1;
    ebpo_h5_kind kind = ebpo_h5_look(in, path);
    if (kind != EBPO_H5_ARRAY)
        return ebpo_fail(error, EBPO_E_FORMAT, "%s: %s: %s; get a fresh copy of the file", in->shown, path,
                         kind == EBPO_H5_ABSENT ? "the array is missing" : "this is not an array");
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hid_t dcpl = -1;
    *id = H5Dopen2(in->file, path, H5P_DEFAULT);
    if (*id >= 0)
        dcpl = H5Dget_create_plist(*id);
    const char *wrong = dcpl < 0 ? "the array's description is damaged" : find_shape(*id, dcpl, shape);
    if (!wrong)
        wrong = find_storage(in, *id, shape, stored_bytes, address);
    ebpo_status status = wrong ? ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, path, wrong) : EBPO_OK;
    if (dcpl >= 0)
        H5Pclose(dcpl);
    if (wrong && *id >= 0) {
        H5Dclose(*id);
        *id = -1;
    }
    ebpo_h5_leave(&scope);
    return status;
}

ebpo_status ebpo_h5_get_chunk(ebpo_h5_in *in, const char *path, ebpo_h5_id id, const ebpo_h5_shape *shape, uint64_t chunk, void *data,
                              size_t capacity, size_t *bytes, ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    hsize_t at[2] = { chunk * shape->chunk_rows, 0 }, size = 0;
    uint32_t mask = 0;
    const char *wrong = NULL;
    if (H5Dget_chunk_storage_size(id, at, &size) < 0 || size == 0)
        wrong = "a chunk is missing";
    else if (size > capacity)
        wrong = "a chunk is larger than it can be";
    else if (H5Dread_chunk(id, H5P_DEFAULT, at, &mask, data) < 0)
        wrong = "a chunk cannot be read";
    else if (mask != 0)
        wrong = "a chunk was stored without its filters";
    *bytes = (size_t)size;
    ebpo_status status = wrong ? ebpo_h5_fail(error, EBPO_E_FORMAT, in->shown, path, wrong) : EBPO_OK;
    ebpo_h5_leave(&scope);
    return status;
}
