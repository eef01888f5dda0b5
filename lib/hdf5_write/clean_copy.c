/* Copies a file that another program has rewritten in another HDF5 layout. The copy has the layout
 * of this format. libhdf5 makes the copy in a separate process (separate_process.c). Chunks whose
 * filters and numbers of rows fit the format are copied as stored. For other layouts, filters and
 * byte orders, libhdf5 decodes the values. Arrays that do not fit the format are omitted, and the
 * first omitted array is reported. Depth and number of objects are bounded, because hard links may
 * form cycles. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/text.h"
#include "hdf5_read/chunk.h"
#include "hdf5_write/h5_parts.h"
#include "hdf5_write/h5.h"
#include "hdf5_write/zstd_filter.h"

enum {
    HEAD_BYTES = 262144,     /* bytes for the headers of the copy */
    DEPTH_MAX = 2,           /* maximum depth of a group: /levels/00 */
    OBJECTS_MAX = 8192,      /* maximum number of objects and attributes */
    VALUE_MAX = 65536,       /* maximum number of bytes of an attribute */
    LEVEL = 1,               /* compression level: the lowest, because the copy is temporary */
    CACHE_BYTES = 256 << 20, /* size of libhdf5's cache of decoded chunks */
    PATH = 96                /* size of a path, including the final zero byte */
};

/* State of copying a file. The functions below set c->status and *c->error on failure. */
typedef struct copying {
    hid_t from;
    ebpo_h5_out to;
    const char *from_path, *to_path, *shown;
    bool from_goes; /* true: the file's name from_path is removed after opening */
    ebpo_h5_chunk_rows_fn chunk_rows;
    bool subtrees, kept;     /* arguments of chunk_rows (ebpo_h5_chunk_rows_fn) */
    ebpo_pipeline pipeline;  /* filters of all arrays of the copy */
    hid_t access;            /* access list of arrays, with a cache for large chunks */
    unsigned objects, depth; /* number of objects so far; depth of the current group */
    ebpo_error omitted;      /* error that describes the first omitted array and the reason */
    ebpo_status status;
    ebpo_error *error;
} copying;

static herr_t copy_fails(copying *c, const char *path, const char *what)
{
    if (c->status == EBPO_OK)
        c->status = ebpo_h5_fail(c->error, EBPO_E_FORMAT, c->shown, path, what);
    return -1;
}

/* --- attributes --- */

typedef struct attribute_copy {
    copying *c;
    ebpo_h5_id to;
} attribute_copy;

/* Callback of H5Aiterate2: copies an attribute of fixed size. Skips other attributes, which the
 * format does not have. */
static herr_t copy_attribute(hid_t object, const char *name, const H5A_info_t *info, void *user)
{
    (void)info;
    static uint8_t value[VALUE_MAX];
    attribute_copy *a = user;
    hid_t attribute = H5Aopen(object, name, H5P_DEFAULT);
    hid_t type = attribute >= 0 ? H5Aget_type(attribute) : -1,
          space = attribute >= 0 ? H5Aget_space(attribute) : -1;
    H5T_class_t class = type >= 0 ? H5Tget_class(type) : H5T_NO_CLASS;
    hssize_t values = space >= 0 ? H5Sget_simple_extent_npoints(space) : 0;
    size_t size = type >= 0 ? H5Tget_size(type) : 0;
    bool plain = (class == H5T_INTEGER || class == H5T_FLOAT ||
                  (class == H5T_STRING && H5Tis_variable_str(type) == 0)) &&
                 size > 0 && values > 0 && (uint64_t)values <= VALUE_MAX / size;
    if (++a->c->objects > OBJECTS_MAX)
        return copy_fails(a->c, ebpo_text_ok(name) ? name : "",
                          "the file has too many objects and attributes");
    if (plain && H5Aread(attribute, type, value) >= 0) {
        hid_t type_copy =
            H5Tcopy(type); /* a copy is necessary, because the type may belong to another object */
        ebpo_status status = ebpo_h5_put_attribute(&a->c->to, a->to, name, type_copy,
                                                   H5Scopy(space), -1, value, a->c->error);
        a->c->status = a->c->status == EBPO_OK ? status : a->c->status;
        H5Tclose(type_copy);
    }
    if (space >= 0)
        H5Sclose(space);
    if (type >= 0)
        H5Tclose(type);
    if (attribute >= 0)
        H5Aclose(attribute);
    return a->c->status == EBPO_OK ? 0 : -1;
}

static void copy_attributes(copying *c, hid_t from, ebpo_h5_id to, const char *path)
{
    attribute_copy a = { c, to };
    hsize_t at = 0;
    if (H5Aiterate2(from, H5_INDEX_NAME, H5_ITER_NATIVE, &at, copy_attribute, &a) < 0)
        copy_fails(c, path, "the object's attributes are damaged");
}

/* --- arrays --- */

/* An array to copy. */
typedef struct array_copy {
    hid_t set, plist; /* the array in the file, and its creation properties */
    const char *path;
    ebpo_shape shape;       /* shape of the copy, valid after inspect_object */
    uint64_t stored_chunks; /* number of chunks in the file */
    bool as_stored;         /* true: chunks are copied as stored */
    hid_t type;             /* type for reading values */
} array_copy;

/* Records why an array is omitted. Does nothing if an earlier array was omitted. */
static void omit_array(copying *c, const char *path, const char *what)
{
    if (!*c->omitted.message)
        (void)!ebpo_fail_at(&c->omitted, EBPO_E_FORMAT, c->shown, path, -1, "%s", what);
}

/* Finds the pipeline of an array's filters. Returns false if the format does not have these
 * filters.
 */
static bool find_pipeline(hid_t plist, unsigned element_size, ebpo_pipeline *pipeline)
{
    enum { FILTERS_MAX = 3 };
    int count = H5Pget_nfilters(plist);
    unsigned ids[FILTERS_MAX] = { 0 };
    for (int i = 0; i < count && count <= FILTERS_MAX; i++) {
        unsigned flags, values[4] = { 0 };
        size_t value_count = 4;
        int id = H5Pget_filter2(plist, (unsigned)i, &flags, &value_count, values, 0, NULL, NULL);
        if (id < 0 || (id == H5Z_FILTER_SHUFFLE && (value_count != 1 || values[0] != element_size)))
            return false;
        ids[i] = (unsigned)id;
    }
    return ebpo_pipeline_of_filters(ids, count, element_size, pipeline);
}

static bool has_filter(hid_t plist, int id)
{
    for (int i = 0; i < H5Pget_nfilters(plist); i++) {
        unsigned flags;
        size_t none = 0;
        if (H5Pget_filter2(plist, (unsigned)i, &flags, &none, NULL, 0, NULL, NULL) == id)
            return true;
    }
    return false;
}

/* Returns true if libhdf5 has all filters of the array. Otherwise omits the array, with a reason
 * that names the missing filter, and returns false. */
static bool can_decode(copying *c, const array_copy *a)
{
    for (int i = 0; i < H5Pget_nfilters(a->plist); i++) {
        unsigned flags, config = 0;
        size_t none = 0;
        char name[48] = "", what[256];
        int id =
            H5Pget_filter2(a->plist, (unsigned)i, &flags, &none, NULL, sizeof name, name, NULL);
        if (id >= 0 && H5Zfilter_avail(id) > 0 && H5Zget_filter_info(id, &config) >= 0 &&
            config & H5Z_FILTER_CONFIG_DECODE_ENABLED)
            continue;
        snprintf(
            what, sizeof what,
            "the array is compressed by HDF5's filter %d (%.40s), which libhdf5 does not have; on "
            "a machine with this filter's plugin, rewrite the file with "
            "`h5repack -f SHUF -f GZIP=6 -f FLET`",
            id, *name && ebpo_text_ok(name) ? name : "no name");
        omit_array(c, a->path, what);
        return false;
    }
    return true;
}

/* Finds the type and the size of the values. Returns NULL, or the reason why the array does not fit
 * the format. */
static const char *find_values(array_copy *a)
{
    hsize_t dims[2] = { 0, 0 };
    if (ebpo_h5_is_elsewhere(
            a->set)) /* checked first, because H5Dget_space opens the files of a virtual dataset */
        return "the array's values are stored in another file or in other arrays, which are "
               "never read";
    hid_t space = H5Dget_space(a->set), type = H5Dget_type(a->set);
    int rank = space >= 0 ? H5Sget_simple_extent_ndims(space) : -1;
    bool plain = (rank == 1 || rank == 2) && H5Sget_simple_extent_dims(space, dims, NULL) == rank;
    unsigned size =
        type >= 0 && H5Tget_class(type) == H5T_INTEGER ? (unsigned)H5Tget_size(type) : 0;
    bool is_signed = size && H5Tget_sign(type) == H5T_SGN_2;
    a->type = ebpo_h5_integer_type(size, is_signed);
    a->as_stored = a->type >= 0 && H5Tequal(type, a->type) > 0;
    if (type >= 0)
        H5Tclose(type);
    ebpo_h5_close_space(space);
    if (a->type < 0)
        return "the array is not of integers of 1, 2, 4 or 8 bytes";
    if (!plain || dims[0] == 0 || (rank == 2 && (dims[1] == 0 || dims[1] > UINT16_MAX)))
        return "the array does not have one or two dimensions";
    a->shape = (ebpo_shape){ .rows = dims[0],
                             .cols = rank == 2 ? (uint32_t)dims[1] : 0,
                             .element_size = (uint8_t)size,
                             .is_signed = is_signed };
    return NULL;
}

/* Finds the number of the array's chunks in the file. If each chunk has all columns, sets
 * shape.chunk_rows to the number of rows of a chunk. */
static void find_chunks(array_copy *a)
{
    int rank = a->shape.cols ? 2 : 1;
    hsize_t chunk[2] = { 0, 0 };
    if (H5Pget_layout(a->plist) != H5D_CHUNKED || H5Pget_chunk(a->plist, 2, chunk) != rank ||
        chunk[0] == 0 || (rank == 2 && chunk[1] == 0))
        return;
    a->stored_chunks = (a->shape.rows - 1) / chunk[0] + 1;
    if (rank == 2)
        a->stored_chunks *= (a->shape.cols - 1) / chunk[1] + 1;
    if (chunk[1] == a->shape.cols && chunk[0] <= UINT32_MAX / ebpo_shape_row_bytes(&a->shape))
        a->shape.chunk_rows = (uint32_t)chunk[0];
}

/* Examines an array, and finds the shape of its copy. Returns false if the array is omitted. */
static bool inspect_object(copying *c, array_copy *a)
{
    const char *wrong = a->plist >= 0 ? find_values(a) : "the array is damaged";
    if (wrong) {
        omit_array(c, a->path, wrong);
        return false;
    }
    find_chunks(a);
    uint32_t stored = a->shape.chunk_rows,
             rows = c->chunk_rows(a->path, &a->shape, c->subtrees, c->kept);
    ebpo_pipeline pipeline = c->pipeline;
    a->as_stored = a->as_stored && stored == rows &&
                   find_pipeline(a->plist, a->shape.element_size, &pipeline) &&
                   pipeline == c->pipeline;
    a->shape.chunk_rows = rows;
    a->shape.pipeline = c->pipeline;
    return can_decode(c, a);
}

/* Returns true if the file has all chunks of the array. For a missing chunk, HDF5 would silently
 * return the fill value. */
static bool has_all_chunks(const array_copy *a)
{
    hsize_t chunks = 0;
    if (!a->stored_chunks)
        return H5Dget_storage_size(a->set) > 0;
    hid_t space = H5Dget_space(a->set);
    bool exists =
        space >= 0 && H5Dget_num_chunks(a->set, space, &chunks) >= 0 && chunks == a->stored_chunks;
    ebpo_h5_close_space(space);
    return exists;
}

/* Reads the chunk that begins with row `first`, without decoding it. Returns false if the chunk
 * must be decoded instead. */
static bool read_stored(const array_copy *a, uint64_t first, void *data, size_t bound,
                        size_t *bytes)
{
    hsize_t at[2] = { first, 0 }, stored = 0;
    uint32_t mask = 0;
    if (!a->as_stored || H5Dget_chunk_storage_size(a->set, at, &stored) < 0 || stored == 0 ||
        stored > bound || H5Dread_chunk(a->set, H5P_DEFAULT, at, &mask, data) < 0 || mask != 0)
        return false;
    *bytes = (size_t)stored;
    return a->shape.pipeline != EBPO_PIPELINE_ZSTD ||
           (ebpo_zstd_has_checksum(data, *bytes) && !ebpo_zstd_fault(data, *bytes));
}

static bool read_values(const array_copy *a, uint64_t first, uint64_t rows, void *values)
{
    int rank = a->shape.cols ? 2 : 1;
    hsize_t from[2] = { first, 0 }, size[2] = { rows, a->shape.cols };
    hid_t space = H5Dget_space(a->set), memory = H5Screate_simple(rank, size, NULL);
    bool good = space >= 0 && memory >= 0 &&
                H5Sselect_hyperslab(space, H5S_SELECT_SET, from, NULL, size, NULL) >= 0 &&
                H5Dread(a->set, a->type, memory, space, H5P_DEFAULT, values) >= 0;
    if (good) { /* after a failure, closing would erase libhdf5's reason */
        ebpo_h5_close_space(space);
        ebpo_h5_close_space(memory);
    }
    return good;
}

/* Makes the copy's chunk that begins with row `first`: reads its values and encodes them. Returns
 * false on failure. */
static bool make_chunk(copying *c, const array_copy *a, uint64_t first, uint8_t *data,
                       size_t *bytes)
{
    static ebpo_chunk_coder coder;
    static uint8_t values[EBPO_CHUNK_BYTES_MAX];
    size_t row = ebpo_shape_row_bytes(&a->shape), chunk_bytes = a->shape.chunk_rows * row;
    uint64_t rows = a->shape.rows - first;
    if (rows > a->shape.chunk_rows)
        rows = a->shape.chunk_rows;
    memset(values + rows * row, 0, chunk_bytes - (size_t)rows * row);
    if (!read_values(a, first, rows, values)) {
        copy_fails(c, a->path, "the array cannot be read; get a fresh copy of the file");
        return false;
    }
    c->status = ebpo_chunk_encode(&coder, a->shape.pipeline, LEVEL, a->shape.element_size, values,
                                  chunk_bytes, data, bytes);
    return c->status == EBPO_OK || (c->status = ebpo_fail_memory(c->error, chunk_bytes), false);
}

static void copy_values(copying *c, const array_copy *a)
{
    const ebpo_shape *shape = &a->shape;
    uint64_t bound = ebpo_chunk_bound(shape->chunk_rows * ebpo_shape_row_bytes(shape));
    ebpo_h5_id to = -1;
    uint8_t *data = ebpo_alloc(bound, 1);
    if (!data)
        c->status = ebpo_fail_memory(c->error, bound);
    else if (!has_all_chunks(a))
        copy_fails(c, a->path, "a chunk is missing; get a fresh copy of the file");
    else
        c->status = ebpo_h5_make_array(&c->to, a->path, shape, &to, c->error);
    for (uint64_t i = 0; i < ebpo_shape_chunks(shape) && c->status == EBPO_OK; i++) {
        size_t bytes = 0;
        uint64_t first = i * shape->chunk_rows;
        if (read_stored(a, first, data, bound, &bytes) || make_chunk(c, a, first, data, &bytes))
            c->status = ebpo_h5_put_chunk(&c->to, a->path, to, shape, i, data, bytes, c->error);
    }
    if (c->status == EBPO_OK)
        copy_attributes(c, a->set, to, a->path);
    ebpo_h5_close_id(&c->to, to);
    free(data);
}

/* Makes a chunk directory in the copy. The format requires this array, but the original directory
 * describes the chunks of the original file. So the new directory has one row, and lacks the
 * attributes `file_bytes` and `offset`. Readers ignore a directory without these attributes. */
static void make_empty_directory(copying *c, const char *path)
{
    static const uint64_t none[2];
    ebpo_shape shape = { .rows = 1, .chunk_rows = 1, .element_size = 8, .pipeline = c->pipeline };
    ebpo_chunk_coder coder = { .zstd_out = NULL };
    uint8_t data[2048];
    size_t bytes;
    ebpo_h5_id to = -1;
    c->status =
        ebpo_chunk_encode(&coder, c->pipeline, LEVEL, 8, (const uint8_t *)none, 8, data, &bytes);
    if (c->status == EBPO_OK)
        c->status = ebpo_h5_make_array(&c->to, path, &shape, &to, c->error);
    if (c->status == EBPO_OK)
        c->status = ebpo_h5_put_chunk(&c->to, path, to, &shape, 0, data, bytes, c->error);
    if (c->status == EBPO_OK)
        c->status = ebpo_h5_put_text(&c->to, to, "coding", "plain", c->error);
    ebpo_h5_close_id(&c->to, to);
    ebpo_chunk_coder_clear(&coder);
}

static void copy_array(copying *c, hid_t group, const char *name, const char *path)
{
    array_copy a = { .set = H5Dopen2(group, name, c->access), .path = path };
    a.plist = a.set >= 0 ? H5Dget_create_plist(a.set) : -1;
    if (strcmp(path, "/subtrees/chunk_directory") == 0 || strcmp(path, "/subtrees/places") == 0)
        make_empty_directory(c, path);
    else if (inspect_object(c, &a))
        copy_values(c, &a);
    ebpo_h5_close_list(a.plist);
    if (a.set >= 0)
        H5Dclose(a.set);
}

/* Returns the number of rows in a chunk of an array of the file. Returns 1 for an array without
 * chunks, and 0 if the array is missing. */
static hsize_t rows_of(hid_t file, const char *path)
{
    hid_t set = H5Dopen2(file, path, H5P_DEFAULT), plist = set >= 0 ? H5Dget_create_plist(set) : -1;
    hsize_t chunk[2] = { set >= 0, 0 };
    if (plist >= 0 && H5Pget_layout(plist) == H5D_CHUNKED)
        (void)H5Pget_chunk(plist, 2, chunk);
    ebpo_h5_close_list(plist);
    if (set >= 0)
        H5Dclose(set);
    return chunk[0];
}

/* Chooses the filters of the copy. These are the filters of the array /levels/00/types, which every
 * file has, if the format allows these filters. Sets c->kept to true if the chunks in the file have
 * the numbers of rows that the format requires. */
static void inspect_file(copying *c)
{
    array_copy a = { .set = H5Dopen2(c->from, "/levels/00/types", H5P_DEFAULT) };
    a.plist = a.set >= 0 ? H5Dget_create_plist(a.set) : -1;
    c->pipeline = EBPO_PIPELINE_ZSTD;
    if (a.plist >= 0 && has_filter(a.plist, H5Z_FILTER_DEFLATE))
        c->pipeline = EBPO_PIPELINE_DEFLATE;
    else if (a.plist >= 0 && H5Pget_layout(a.plist) == H5D_CHUNKED && !find_values(&a))
        (void)find_pipeline(a.plist, a.shape.element_size, &c->pipeline);
    ebpo_h5_close_list(a.plist);
    if (a.set >= 0)
        H5Dclose(a.set);
    c->subtrees = H5Lexists(c->from, "subtrees", H5P_DEFAULT) > 0;
    hsize_t rows = rows_of(c->from, "/mesh/vertices");
    ebpo_shape many = { .rows = UINT64_MAX, .cols = 3, .element_size = 8 };
    c->kept = rows == 0 || rows == c->chunk_rows("/mesh/vertices", &many, c->subtrees, true);
    c->access = H5Pcreate(H5P_DATASET_ACCESS);
    if (c->access < 0 || H5Pset_chunk_cache(c->access, 521, CACHE_BYTES, 1) < 0)
        copy_fails(c, "", "libhdf5 cannot be set up");
}

/* --- groups --- */

typedef struct group_copy {
    copying *c;
    const char *path; /* "" for the root */
} group_copy;

static void copy_group(copying *c, hid_t from, const char *path);

/* Callback of H5Literate: copies the array or group to which a link refers. Skips objects that do
 * not belong to this format. */
static herr_t copy_link(hid_t group, const char *name, const H5L_info_t *info, void *user)
{
    const group_copy *g = user;
    copying *c = g->c;
    char path[PATH];
    static const char *const known[] = { "levels", "mesh", "maps", "subtrees", "attributes" };
    bool is_part_of_format = *g->path || c->depth > 0;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        is_part_of_format = is_part_of_format || strcmp(name, known[i]) == 0;
    if (!is_part_of_format || info->type != H5L_TYPE_HARD || !ebpo_text_ok(name) ||
        snprintf(path, sizeof path, "%s/%s", g->path, name) >= PATH)
        return 0;
    if (++c->objects > OBJECTS_MAX)
        return copy_fails(c, path, "the file has too many objects and attributes");
    hid_t object = H5Oopen(group, name, H5P_DEFAULT);
    if (object < 0)
        return copy_fails(c, path, "the object is damaged");
    H5I_type_t type = H5Iget_type(object);
    if (type == H5I_DATASET)
        copy_array(c, group, name, path);
    else if (type == H5I_GROUP && c->depth < DEPTH_MAX)
        copy_group(c, object, path);
    H5Oclose(object);
    return c->status == EBPO_OK ? 0 : -1;
}

static void copy_group(copying *c, hid_t from, const char *path)
{
    group_copy g = { c, path };
    ebpo_h5_id to = -1;
    hsize_t at = 0;
    c->status = *path ? ebpo_h5_make_group(&c->to, path, 16, &to, c->error)
                      : ebpo_h5_root(&c->to, &to, c->error);
    if (c->status == EBPO_OK)
        copy_attributes(c, from, to, *path ? path : "/");
    ebpo_h5_close_id(&c->to, to);
    c->depth += *path != 0;
    if (c->status == EBPO_OK &&
        H5Literate(from, H5_INDEX_NAME, H5_ITER_INC, &at, copy_link, &g) < 0)
        copy_fails(c, *path ? path : "/", "the group is damaged");
    c->depth -= *path != 0;
}

/* Does the work of the separate process. */
static ebpo_status copy_all(void *user, ebpo_error *error)
{
    copying *c = user;
    c->error = error;
    c->status = ebpo_h5_open_to_read(c->from_path, c->shown, false, &c->from, error);
    if (c->from_goes)
        unlink(c->from_path);
    if (c->status == EBPO_OK)
        c->status = ebpo_h5_create(&c->to, c->to_path, c->shown, HEAD_BYTES, 5, error);
    unlink(c->to_path);
    if (c->status == EBPO_OK)
        inspect_file(c);
    hid_t root = c->status == EBPO_OK ? H5Gopen2(c->from, "/", H5P_DEFAULT) : -1;
    if (root >= 0)
        copy_group(c, root, "");
    else
        copy_fails(c, "/", "the group is damaged");
    if (c->status == EBPO_OK)
        c->status = ebpo_h5_finish(&c->to, error);
    if (c->status == EBPO_OK)
        *error = c->omitted;
    return c->status;
}

ebpo_status ebpo_h5_clean_copy(const char *from, bool from_goes, const char *to, const char *shown,
                               ebpo_h5_chunk_rows_fn chunk_rows, const ebpo_process_limits *limits,
                               ebpo_error *omitted, ebpo_error *error)
{
    copying c = { .from = -1,
                  .to = EBPO_H5_OUT_INIT,
                  .from_path = from,
                  .to_path = to,
                  .shown = shown,
                  .from_goes = from_goes,
                  .chunk_rows = chunk_rows,
                  .omitted = EBPO_ERROR_INIT };
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_run_in_process(copy_all, &c, shown, limits, &reported);
    *omitted = reported;
    return status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &reported);
}
