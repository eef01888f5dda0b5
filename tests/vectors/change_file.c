/* Changes a file through libhdf5, for vectors that the library does not write; see change_file.h.
 */
#include "change_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/checksum.h"

void die(const char *what, const char *why)
{
    fprintf(stderr, "make_vectors: %s: %s\n", what, why);
    exit(1);
}

hid_t changed;

void need(bool ok, const char *what)
{
    if (!ok)
        die("libhdf5", what);
}

/* Replaces the old one: another length is another type. */
static void put_anew(const char *object, const char *name, hid_t type, hid_t space, hid_t memory,
                     const void *value)
{
    hid_t id = H5Oopen(changed, object, H5P_DEFAULT);
    if (H5Aexists(id, name) > 0)
        H5Adelete(id, name);
    hid_t attribute = H5Acreate2(id, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    need(H5Awrite(attribute, memory, value) >= 0, name);
    H5Aclose(attribute);
    H5Sclose(space);
    H5Oclose(id);
}

void set_text_as(const char *object, const char *name, const char *text, size_t size,
                 H5T_str_t padding)
{
    char bytes[1024] = "";
    bool variable = size == H5T_VARIABLE;
    hid_t type = H5Tcopy(H5T_C_S1);
    need(variable || size <= sizeof bytes, name);
    memcpy(bytes, text, strlen(text));
    H5Tset_size(type, size);
    H5Tset_strpad(type, padding);
    H5Tset_cset(type, padding == H5T_STR_NULLPAD ? H5T_CSET_UTF8 : H5T_CSET_ASCII);
    put_anew(object, name, type, H5Screate(H5S_SCALAR), type,
             variable ? (const void *)&text : bytes);
    H5Tclose(type);
}

void set_text(const char *object, const char *name, const char *text)
{
    set_text_as(object, name, text, *text ? strlen(text) : 1, H5T_STR_NULLPAD);
}

void set_row(const char *object, const char *name, hid_t type, int64_t value)
{
    hsize_t one = 1;
    put_anew(object, name, type, H5Screate_simple(1, &one, NULL), H5T_NATIVE_INT64, &value);
}

uint64_t count_of(const char *object, const char *name)
{
    uint64_t value = 0;
    hid_t attribute = H5Aopen_by_name(changed, object, name, H5P_DEFAULT, H5P_DEFAULT);
    need(H5Aread(attribute, H5T_NATIVE_UINT64, &value) >= 0, name);
    H5Aclose(attribute);
    return value;
}

static void set_number_of(const char *object, const char *name, hid_t type, const void *value)
{
    hid_t id = H5Oopen(changed, object, H5P_DEFAULT), attribute = H5Aopen(id, name, H5P_DEFAULT);
    need(H5Awrite(attribute, type, value) >= 0, name);
    H5Aclose(attribute);
    H5Oclose(id);
}
static void set_number(const char *object, const char *name, hid_t type, int64_t value)
{
    set_number_of(object, name, type, &value);
}
void set_int(const char *object, const char *name, int64_t value)
{
    set_number(object, name, H5T_NATIVE_INT64, value);
}
void set_count(const char *object, const char *name, int64_t value)
{
    set_number(object, name, H5T_NATIVE_UINT64, value);
}

void set_reals(const char *name, double a, double b, double c)
{
    double values[3] = { a, b, c };
    hid_t attribute = H5Aopen_by_name(changed, "/", name, H5P_DEFAULT, H5P_DEFAULT);
    need(H5Awrite(attribute, H5T_NATIVE_DOUBLE, values) >= 0, name);
    H5Aclose(attribute);
}

void set_six(const char *name, const double values[6])
{
    hid_t attribute = H5Aopen_by_name(changed, "/", name, H5P_DEFAULT, H5P_DEFAULT);
    need(H5Awrite(attribute, H5T_NATIVE_DOUBLE, values) >= 0, name);
    H5Aclose(attribute);
}

void set_real(const char *object, const char *name, double value)
{
    set_number_of(object, name, H5T_NATIVE_DOUBLE, &value);
}

void get_text(const char *object, const char *name, char *text, size_t size)
{
    hid_t attribute = H5Aopen_by_name(changed, object, name, H5P_DEFAULT, H5P_DEFAULT),
          type = H5Aget_type(attribute);
    need(H5Tget_size(type) < size && H5Aread(attribute, type, text) >= 0, name);
    H5Tclose(type);
    H5Aclose(attribute);
}

void add_real(const char *object, const char *name, double value)
{
    put_anew(object, name, H5T_IEEE_F64LE, H5Screate(H5S_SCALAR), H5T_NATIVE_DOUBLE, &value);
}

void add_count(const char *object, const char *name, uint64_t value)
{
    hid_t space = H5Screate(H5S_SCALAR),
          attribute = H5Acreate_by_name(changed, object, name, H5T_STD_U64LE, space, H5P_DEFAULT,
                                        H5P_DEFAULT, H5P_DEFAULT);
    need(attribute >= 0 && H5Awrite(attribute, H5T_NATIVE_UINT64, &value) >= 0, name);
    H5Aclose(attribute);
    H5Sclose(space);
}

void drop_attribute(const char *object, const char *name)
{
    need(H5Adelete_by_name(changed, object, name, H5P_DEFAULT) >= 0, name);
}
void drop(const char *path) { need(H5Ldelete(changed, path, H5P_DEFAULT) >= 0, path); }

/* Sets one value of an array, counted row by row. */
/* Multiplies an array's value by `factor`, and adds `by`. The other values are unchanged, also
 * those above 2^63. */
static void change_value(const char *path, unsigned at, int64_t factor, int64_t by)
{
    int64_t *values = calloc(1 << 20, sizeof *values);
    hid_t id = H5Dopen2(changed, path, H5P_DEFAULT), stored = H5Dget_type(id);
    hid_t type = H5Tget_sign(stored) == H5T_SGN_NONE ? H5T_NATIVE_UINT64 : H5T_NATIVE_INT64;
    need(H5Dread(id, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, path);
    values[at] = factor * values[at] + by;
    need(H5Dwrite(id, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, path);
    H5Tclose(stored);
    H5Dclose(id);
    free(values);
}

void poke(const char *path, unsigned at, int64_t value) { change_value(path, at, 0, value); }

void add_to(const char *path, unsigned at, int64_t by) { change_value(path, at, 1, by); }

/* Copies a text attribute of one array to another. */
static void copy_text(hid_t from, hid_t to, const char *name)
{
    char text[256] = "";
    hid_t attribute = H5Aopen(from, name, H5P_DEFAULT), type = H5Aget_type(attribute),
          space = H5Screate(H5S_SCALAR);
    need(H5Tget_size(type) < sizeof text && H5Aread(attribute, type, text) >= 0, name);
    hid_t copy = H5Acreate2(to, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    need(H5Awrite(copy, type, text) >= 0, name);
    H5Aclose(copy);
    H5Sclose(space);
    H5Tclose(type);
    H5Aclose(attribute);
}

static hid_t make_array(const new_array *a, const char *path)
{
    hsize_t dims[2] = { a->rows, a->cols }, chunks[2] = { a->chunk, a->cols },
            most[2] = { a->unlimited ? H5S_UNLIMITED : a->rows, a->cols };
    int rank = a->cols ? 2 : 1;
    hid_t space = H5Screate_simple(rank, dims, most), dcpl = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_obj_track_times(dcpl, false);
    if (a->chunk)
        H5Pset_chunk(dcpl, rank, chunks);
    if (a->filters)
        a->filters(dcpl);
    hid_t id = H5Dcreate2(changed, path, a->type, space, H5P_DEFAULT, dcpl, H5P_DEFAULT);
    need(id >= 0, path);
    H5Pclose(dcpl);
    H5Sclose(space);
    return id;
}

static void write_values(hid_t id, const char *path, const new_array *a)
{
    int64_t *zeros =
        a->values ? NULL : calloc(a->rows * (a->cols ? a->cols : 1) + 1, sizeof *zeros);
    if (!a->unwritten)
        need(H5Dwrite(id, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT,
                      a->values ? a->values : zeros) >= 0,
             path);
    free(zeros);
}

void add_array(const char *path, new_array a)
{
    hid_t id = make_array(&a, path);
    write_values(id, path, &a);
    H5Dclose(id);
}

void replace(const char *path, new_array a)
{
    hid_t old = H5Dopen2(changed, path, H5P_DEFAULT);
    need(old >= 0, path);
    drop(path);
    hid_t id = make_array(&a, path);
    write_values(id, path, &a);
    copy_text(old, id, "coding");
    copy_text(old, id, "about");
    H5Dclose(id);
    H5Dclose(old);
}

void refilter(const char *path, void (*filters)(hid_t))
{
    int64_t values[256];
    hsize_t dims[2] = { 0, 0 };
    hid_t id = H5Dopen2(changed, path, H5P_DEFAULT), space = H5Dget_space(id),
          type = H5Dget_type(id);
    need(H5Sget_simple_extent_npoints(space) <= 256, path);
    H5Sget_simple_extent_dims(space, dims, NULL);
    need(H5Dread(id, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, path);
    replace(path, (new_array){ .type = type,
                               .rows = dims[0],
                               .cols = dims[1],
                               .chunk = dims[0],
                               .filters = filters,
                               .values = values });
    H5Tclose(type);
    H5Sclose(space);
    H5Dclose(id);
}
void checksum(hid_t dcpl) { H5Pset_fletcher32(dcpl); }
void scale_offset(hid_t dcpl) { H5Pset_scaleoffset(dcpl, H5Z_SO_INT, H5Z_SO_INT_MINBITS_DEFAULT); }

haddr_t chunk_address(const char *path, hsize_t *size)
{
    hsize_t at[2] = { 0, 0 };
    unsigned mask;
    haddr_t address;
    hid_t id = H5Dopen2(changed, path, H5P_DEFAULT);
    need(H5Dget_chunk_info_by_coord(id, at, &mask, &address, size) >= 0, path);
    H5Dclose(id);
    return address;
}

/* --- checksums of the current arrays --- */

typedef struct paths {
    const char *attribute; /* of the checksum */
    char *path[512];
    unsigned count;
} paths;

static bool ends_with(const char *name, const char *end)
{
    size_t length = strlen(name), of_end = strlen(end);
    return length > of_end && strcmp(name + length - of_end, end) == 0;
}

/* Returns the name of the checksum that counts an array. */
static const char *checksum_of(const char *name)
{
    char kind[16];
    get_text("/", "kind", kind, sizeof kind);
    bool border = strncmp(name, "border/", 7) == 0 ||
                  (strcmp(kind, "surface") == 0 && ends_with(name, "_winding"));
    if (strncmp(name, "surface/", 8) == 0)
        return "surface_sha256";
    return border                            ? "border_sha256"
           : ends_with(name, "gray_colours") ? "colours_sha256"
                                             : "content_sha256";
}

static herr_t take_array(hid_t object, const char *name, const H5O_info_t *info, void *user)
{
    paths *all = user;
    char path[64];
    (void)object;
    if (strcmp(checksum_of(name), all->attribute) != 0)
        return 0;
    if (info->type != H5O_TYPE_DATASET || strncmp(name, "x-", 2) == 0 ||
        strcmp(name, "chunk_checksums") == 0 || strncmp(name, "attributes/", 11) == 0)
        return 0;
    snprintf(path, sizeof path, "/%s", name);
    need(all->count < 512, "too many arrays");
    all->path[all->count++] = strdup(path);
    return 0;
}

static int in_order(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* Digests the values in little-endian order. */
static void digest_of_array(const char *path, uint8_t digest[32])
{
    hid_t id = H5Dopen2(changed, path, H5P_DEFAULT), stored = H5Dget_type(id),
          type = H5Tget_native_type(stored, H5T_DIR_ASCEND), space = H5Dget_space(id);
    size_t bytes = (size_t)H5Sget_simple_extent_npoints(space) * H5Tget_size(type);
    need(H5Tset_order(type, H5T_ORDER_LE) >= 0, path);
    void *values = calloc(bytes, 1); /* data in a missing external file counts as zeros */
    hid_t plan = H5Dget_create_plist(id);
    need(H5Pget_external_count(plan) > 0 ||
             H5Dread(id, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0,
         path);
    H5Pclose(plan);
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    ebpo_sha256_add(&state, values, bytes);
    ebpo_sha256_end(&state, digest);
    free(values);
    H5Sclose(space);
    H5Tclose(type);
    H5Tclose(stored);
    H5Dclose(id);
}

static void state_checksum(const char *name)
{
    paths all = { .attribute = name };
    uint8_t digest[32];
    char hex[65];
    ebpo_sha256 total;
    if (H5Aexists_by_name(changed, "/", name, H5P_DEFAULT) <= 0)
        return;
    need(H5Ovisit2(changed, H5_INDEX_NAME, H5_ITER_INC, take_array, &all, H5O_INFO_BASIC) >= 0,
         "H5Ovisit");
    qsort(all.path, all.count, sizeof *all.path, in_order);
    ebpo_sha256_begin(&total);
    for (unsigned i = 0; i < all.count; i++) {
        digest_of_array(all.path[i], digest);
        ebpo_sha256_add(&total, all.path[i], strlen(all.path[i]) + 1);
        ebpo_sha256_add(&total, digest, sizeof digest);
        free(all.path[i]);
    }
    ebpo_sha256_end(&total, digest);
    ebpo_sha256_hex(digest, hex);
    set_text("/", name, hex);
}

/* Section 8 of the specification. In files with subtrees no counted data is changed. */
void state_content(void)
{
    if (H5Lexists(changed, "subtrees", H5P_DEFAULT) > 0)
        return;
    state_checksum("content_sha256");
    state_checksum("colours_sha256");
    state_checksum("border_sha256");
    state_checksum("surface_sha256");
}

uint8_t *slurp(const char *path, size_t *size)
{
    FILE *in = fopen(path, "rb");
    struct stat facts;
    if (!in || fstat(fileno(in), &facts) != 0)
        die(path, "cannot be read");
    *size = (size_t)facts.st_size;
    uint8_t *data = malloc(*size);
    if (fread(data, 1, *size, in) != *size)
        die(path, "cannot be read");
    fclose(in);
    return data;
}

void spill(const char *path, const void *data, size_t size)
{
    FILE *out = fopen(path, "wb");
    if (!out || fwrite(data, 1, size, out) != size || fclose(out) != 0)
        die(path, "cannot be written");
}

void change_objects(const char *path, void (*change)(void))
{
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_libver_bounds(fapl, H5F_LIBVER_V110, H5F_LIBVER_V110);
    H5Pset_fclose_degree(fapl, H5F_CLOSE_STRONG);
    changed = H5Fopen(path, H5F_ACC_RDWR, fapl);
    need(changed >= 0, path);
    change();
    H5Fclose(changed);
    H5Pclose(fapl);
}
