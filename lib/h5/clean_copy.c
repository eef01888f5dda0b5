/* Files of other programs' layout, written anew: compat.h. Runs apart, alone in its process. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/error.h"
#include "h5/apart.h"
#include "h5/h5.h"
#include "h5/h5_objects.h"
#include "h5/zstd_filter.h"

enum {
    HEAD_BYTES = 262144,
    DEPTH_MOST = 2,      /* /levels/00 */
    OBJECTS_MOST = 8192, /* so that hard links may lead in circles */
    VALUE_MOST = 65536,  /* bytes of an attribute */
    PATH = 96
};

typedef struct copying {
    hid_t from;
    ebpo_h5_out to;
    const char *from_path, *to_path, *shown;
    bool from_goes;
    unsigned objects, depth;
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

/* Those of fixed size; the others are nothing of this format. */
static herr_t copy_attribute(hid_t object, const char *name, const H5A_info_t *info, void *user)
{
    (void)info;
    static uint8_t value[VALUE_MOST];
    attribute_copy *a = user;
    hid_t attribute = H5Aopen(object, name, H5P_DEFAULT);
    hid_t type = attribute >= 0 ? H5Aget_type(attribute) : -1,
          space = attribute >= 0 ? H5Aget_space(attribute) : -1;
    H5T_class_t class = type >= 0 ? H5Tget_class(type) : H5T_NO_CLASS;
    hssize_t values = space >= 0 ? H5Sget_simple_extent_npoints(space) : 0;
    size_t size = type >= 0 ? H5Tget_size(type) : 0;
    bool plain = (class == H5T_INTEGER || class == H5T_FLOAT ||
                  (class == H5T_STRING && H5Tis_variable_str(type) == 0)) &&
                 size > 0 && values > 0 && (uint64_t)values <= VALUE_MOST / size;
    if (++a->c->objects > OBJECTS_MOST)
        return copy_fails(a->c, name, "the file has too many objects and attributes");
    if (plain && H5Aread(attribute, type, value) >= 0) {
        hid_t own = H5Tcopy(type); /* in case that it is another object's */
        ebpo_status status = ebpo_h5_put_attribute(&a->c->to, a->to, name, own, H5Scopy(space), -1,
                                                   value, a->c->error);
        a->c->status = a->c->status == EBPO_OK ? status : a->c->status;
        H5Tclose(own);
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
        copy_fails(c, path, "its attributes are damaged");
}

/* --- arrays --- */

static bool find_type(hid_t set, ebpo_shape *shape)
{
    hid_t type = H5Dget_type(set);
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

/* Shuffled elements of one byte are what they were. */
static bool find_pipeline(hid_t plist, unsigned element_size, ebpo_pipeline *pipeline)
{
    int count = H5Pget_nfilters(plist), ids[3] = { 0 }, first = 0;
    for (int i = 0; i < count && count <= 3; i++) {
        unsigned flags, values[4] = { 0 };
        size_t value_count = 4;
        ids[i] = H5Pget_filter2(plist, (unsigned)i, &flags, &value_count, values, 0, NULL, NULL);
        if (ids[i] < 0 ||
            (ids[i] == H5Z_FILTER_SHUFFLE && (value_count != 1 || values[0] != element_size)))
            return false;
    }
    first = count > 0 && ids[0] == H5Z_FILTER_SHUFFLE;
    bool shuffled = first || element_size == 1;
    count -= first;
    if (shuffled && count == 1 && ids[first] == EBPO_ZSTD_FILTER_ID)
        *pipeline = EBPO_PIPELINE_ZSTD;
    else if (shuffled && count == 2 && ids[first] == H5Z_FILTER_DEFLATE &&
             ids[first + 1] == H5Z_FILTER_FLETCHER32)
        *pipeline = EBPO_PIPELINE_DEFLATE;
    else if (!first && count == 1 && ids[0] == H5Z_FILTER_FLETCHER32)
        *pipeline = EBPO_PIPELINE_CHECKSUM;
    else if (!first && count == 0)
        *pipeline = EBPO_PIPELINE_BARE;
    else
        return false;
    return true;
}

static bool find_shape(hid_t set, hid_t plist, ebpo_shape *shape)
{
    hsize_t dims[2] = { 0, 0 }, most[2] = { 0, 0 }, chunk[2] = { 0, 0 };
    hid_t space = H5Dget_space(set);
    int rank = space >= 0 ? H5Sget_simple_extent_ndims(space) : -1;
    bool plain = (rank == 1 || rank == 2) && H5Sget_simple_extent_dims(space, dims, most) == rank;
    if (space >= 0)
        H5Sclose(space);
    if (!plain || !find_type(set, shape) || dims[0] == 0 || most[0] != dims[0] ||
        most[1] != dims[1] || (rank == 2 && (dims[1] == 0 || dims[1] > UINT16_MAX)) ||
        H5Pget_layout(plist) != H5D_CHUNKED || H5Pget_chunk(plist, 2, chunk) != rank ||
        chunk[0] == 0 || chunk[0] > UINT32_MAX || chunk[1] != dims[1])
        return false;
    shape->rows = dims[0];
    shape->cols = rank == 2 ? (uint32_t)dims[1] : 0;
    shape->chunk_rows = (uint32_t)chunk[0];
    return chunk[0] <= UINT32_MAX / ebpo_shape_row_bytes(shape) &&
           find_pipeline(plist, shape->element_size, &shape->pipeline);
}

static void copy_chunk(copying *c, hid_t from, ebpo_h5_id to, const char *path,
                       const ebpo_shape *shape, uint64_t number, void *data, uint64_t bound)
{
    hsize_t at[2] = { number * shape->chunk_rows, 0 }, bytes = 0;
    uint32_t mask = 0;
    if (H5Dget_chunk_storage_size(from, at, &bytes) < 0 || bytes == 0)
        copy_fails(c, path, "a chunk is missing");
    else if (bytes > bound)
        copy_fails(c, path, "a chunk is larger than it can be");
    else if (H5Dread_chunk(from, H5P_DEFAULT, at, &mask, data) < 0)
        copy_fails(c, path, "a chunk cannot be read");
    else if (mask != 0)
        copy_fails(c, path, "a chunk was stored without its filters");
    else
        c->status =
            ebpo_h5_put_chunk(&c->to, path, to, shape, number, data, (size_t)bytes, c->error);
}

static void copy_values(copying *c, hid_t from, const char *path, const ebpo_shape *shape)
{
    uint64_t bound = ebpo_chunk_bound(shape->chunk_rows * ebpo_shape_row_bytes(shape));
    ebpo_h5_id to = -1;
    void *data = ebpo_alloc(bound, 1);
    if (!data)
        c->status = ebpo_fail_memory(c->error, bound);
    else
        c->status = ebpo_h5_make_array(&c->to, path, shape, &to, c->error);
    for (uint64_t i = 0; i < ebpo_shape_chunks(shape) && c->status == EBPO_OK; i++)
        copy_chunk(c, from, to, path, shape, i, data, bound);
    if (c->status == EBPO_OK)
        copy_attributes(c, from, to, path);
    ebpo_h5_close_id(&c->to, to);
    free(data);
}

/* What is no array of this format is left out: if it is called for, it is missing. */
static void copy_array(copying *c, hid_t from, const char *path)
{
    ebpo_shape shape = { .rows = 0 };
    hid_t plist = H5Dget_create_plist(from);
    if (plist >= 0 && find_shape(from, plist, &shape))
        copy_values(c, from, path, &shape);
    ebpo_h5_close_list(plist);
}

/* --- groups --- */

typedef struct group_copy {
    copying *c;
    const char *path; /* "" of the root */
} group_copy;

static void copy_group(copying *c, hid_t from, const char *path);

static herr_t copy_link(hid_t group, const char *name, const H5L_info_t *info, void *user)
{
    const group_copy *g = user;
    copying *c = g->c;
    char path[PATH];
    static const char *const known[] = { "levels", "mesh", "maps", "subtrees", "attributes" };
    bool ours = *g->path || c->depth > 0;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        ours = ours || strcmp(name, known[i]) == 0;
    if (!ours || info->type != H5L_TYPE_HARD ||
        snprintf(path, sizeof path, "%s/%s", g->path, name) >= PATH)
        return 0;
    if (++c->objects > OBJECTS_MOST)
        return copy_fails(c, path, "the file has too many objects and attributes");
    hid_t object = H5Oopen(group, name, H5P_DEFAULT);
    if (object < 0)
        return copy_fails(c, path, "the object is damaged");
    H5I_type_t type = H5Iget_type(object);
    if (type == H5I_DATASET)
        copy_array(c, object, path);
    else if (type == H5I_GROUP && c->depth < DEPTH_MOST)
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

static ebpo_status copy_all(void *user, ebpo_error *error)
{
    copying *c = user;
    c->error = error;
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_file_locking(fapl, false, true);
    c->from = H5Fopen(c->from_path, H5F_ACC_RDONLY, fapl);
    if (c->from_goes)
        unlink(c->from_path);
    ebpo_h5_close_list(fapl);
    if (c->from < 0)
        copy_fails(c, "", "not a whole HDF5 file, or a damaged one");
    else
        c->status = ebpo_h5_create(&c->to, c->to_path, c->shown, HEAD_BYTES, 5, error);
    unlink(c->to_path);
    hid_t root = c->status == EBPO_OK ? H5Gopen2(c->from, "/", H5P_DEFAULT) : -1;
    if (root >= 0)
        copy_group(c, root, "");
    else
        copy_fails(c, "/", "the group is damaged");
    if (c->status == EBPO_OK)
        c->status = ebpo_h5_finish(&c->to, error);
    return c->status;
}

ebpo_status ebpo_h5_clean_copy(const char *from, bool from_goes, const char *to, const char *shown,
                               const ebpo_apart_limits *limits, ebpo_error *error)
{
    copying c = { .from = -1,
                  .to = EBPO_H5_OUT_INIT,
                  .from_path = from,
                  .to_path = to,
                  .shown = shown,
                  .from_goes = from_goes };
    return ebpo_apart(copy_all, &c, shown, limits, error);
}
