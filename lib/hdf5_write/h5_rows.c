/* Reads rows of numbers from untrusted HDF5 files (ebpo/rows.h). libhdf5 reads the rows in a
 * separate process, which writes the rows to an unnamed temporary file, so that this process can
 * read them. */
#include <ebpo/rows.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/text.h"
#include "core/os.h"
#include "hdf5_write/h5_parts.h"
#include "hdf5_write/h5.h"

enum {
    COLUMNS_MAX = 64,
    ROWS_AT_ONCE = 16384,
    /* The rows may take at most EXPANSION_MAX times the bytes of the file (deflate cannot compress
       more), or EXPANSION_FREE bytes if that is more. Without a limit, a file of a kilobyte could
       state any number of rows. */
    EXPANSION_MAX = 1024,
    EXPANSION_FREE = 64 << 20
};

/* A request for rows, and the dataset that has the rows. */
typedef struct dataset {
    const char *path, *name; /* path of the file; name of the dataset in the file */
    int to;                  /* descriptor of the temporary file for the rows */
    unsigned least, most;    /* allowed numbers of columns */
    uint64_t bytes_max;      /* limit for all rows */
    double fill;             /* value for columns that were requested, but that the dataset lacks */
    uint64_t first, end;     /* the requested rows [first, end) */
    hid_t file, set, space, type; /* valid while the dataset is open */
    hsize_t size[2];              /* rows and columns of the dataset */
} dataset;

static ebpo_status rows_fail(const dataset *d, const char *what, ebpo_error *error)
{
    return ebpo_h5_fail(error, EBPO_E_FORMAT, d->path, d->name, what);
}

/* Callback of libhdf5 for an external link: refuses the link and records it. */
static herr_t follow_none(const char *parent_file, const char *parent_group, const char *file,
                          const char *object, unsigned *flags, hid_t access, void *user)
{
    (void)parent_file, (void)parent_group, (void)file, (void)object, (void)flags, (void)access;
    *(bool *)user = true;
    return -1;
}

static ebpo_status open_set(dataset *d, ebpo_error *error)
{
    bool elsewhere = false;
    hid_t access = H5Pcreate(H5P_DATASET_ACCESS);
    if (access < 0 || H5Pset_elink_cb(access, follow_none, &elsewhere) < 0)
        return ebpo_fail_memory(error, sizeof *d);
    d->set = H5Dopen2(d->file, d->name, access);
    H5Pclose(access);
    if (elsewhere || (d->set >= 0 && ebpo_h5_is_elsewhere(d->set)))
        return rows_fail(d,
                         "the dataset's values are in another file, which is not read; name this "
                         "other file",
                         error);
    if (d->set < 0)
        return rows_fail(d, "there is no such dataset", error);
    d->space = H5Dget_space(d->set);
    d->type = H5Dget_type(d->set);
    return d->space < 0 || d->type < 0 ? rows_fail(d, "the dataset is damaged", error) : EBPO_OK;
}

/* Returns true if the file's root attribute `format` names this format or the format of paint
 * files.
 */
static bool is_of_format(hid_t file)
{
    enum { LIMIT = 64 };
    static const char begin[] = "EBP-Octree";
    char text[LIMIT] = "";
    hid_t attribute = H5Aexists(file, "format") > 0 ? H5Aopen(file, "format", H5P_DEFAULT) : -1,
          type = attribute >= 0 ? H5Aget_type(attribute) : -1;
    bool fits = type >= 0 && H5Tget_class(type) == H5T_STRING && H5Tis_variable_str(type) == 0 &&
                H5Tget_size(type) <= LIMIT && H5Aget_storage_size(attribute) <= LIMIT &&
                H5Aread(attribute, type, text) >= 0 && strncmp(text, begin, sizeof begin - 1) == 0;
    if (type >= 0)
        H5Tclose(type);
    if (attribute >= 0)
        H5Aclose(attribute);
    return fits;
}

/* Returns a description of the values if the dataset does not have plain real numbers, else NULL.
 */
static const char *other_values(const dataset *d, hid_t set, hid_t type)
{
    H5T_class_t class = H5Tget_class(type);
    if (class == H5T_COMPOUND)
        return "compound values, such as complex numbers or rows with named columns";
    if (class == H5T_ENUM)
        return "values of an enumeration, such as true and false";
    if (class == H5T_ARRAY)
        return "an array in each element";
    if (class != H5T_INTEGER && class != H5T_FLOAT)
        return "text, bits or references";
    if (H5Aexists(set, "coding") <= 0 || !is_of_format(d->file))
        return NULL;
    return d->most == 3 ? "codes of the .ebpo.h5 format (`ebpo extract --mesh` writes the vertices "
                          "as a PLY, which can be given instead)"
                        : "codes of the .ebpo.h5 format";
}

/* Returns true if the dataset has two dimensions and an allowed number of columns. */
static bool has_rows(hid_t space, unsigned least, unsigned most, hsize_t size[2])
{
    return H5Sget_simple_extent_ndims(space) == 2 &&
           H5Sget_simple_extent_dims(space, size, NULL) == 2 && size[1] >= least && size[1] <= most;
}

/* Writes a description of the expected rows to `what`, such as "rows of 3 numbers" or "rows of 6 to
 * 7 numbers". */
static void describe_rows(const dataset *d, char what[64])
{
    snprintf(what, 64, "rows of %u%s%.0u numbers", d->least, d->most > d->least ? " to " : "",
             d->most > d->least ? d->most : 0);
}

/* Writes the shape of a dataset as "2 x 3", or "" for a single value. */
static void describe_shape(hid_t space, char *text, size_t capacity)
{
    hsize_t size[H5S_MAX_RANK];
    int rank = H5Sget_simple_extent_dims(space, size, NULL), at = 0;
    *text = 0;
    for (int i = 0; i < rank && at >= 0 && (size_t)at < capacity; i++)
        at += snprintf(text + at, capacity - (size_t)at, "%s%" PRIu64, i ? " x " : "",
                       (uint64_t)size[i]);
}

/* Checks that the dataset has rows of an allowed number of real numbers, and not too many rows.
 * Sets d->size. */
static ebpo_status check_set(dataset *d, ebpo_error *error)
{
    char what[256], wanted[64], shape[96];
    const char *others = other_values(d, d->set, d->type);
    describe_rows(d, wanted);
    if (others) {
        snprintf(what, sizeof what, "the dataset has %s; expected %s", others, wanted);
        return rows_fail(d, what, error);
    }
    if (has_rows(d->space, d->least, d->most, d->size))
        return d->size[0] <= d->bytes_max / (d->most * sizeof(double))
                   ? EBPO_OK
                   : ebpo_h5_fail(
                         error, EBPO_E_LIMIT, d->path, d->name,
                         "the dataset has so many more rows than the file has bytes that reading "
                         "the dataset may exhaust memory; pass the rows as a NumPy array");
    describe_shape(d->space, shape, sizeof shape);
    snprintf(what, sizeof what, "expected %s, got %s%s", wanted,
             *shape ? "an array of " : "a single value", shape);
    return rows_fail(d, what, error);
}

/* The datasets of the file that have the requested rows. */
typedef struct candidates {
    const dataset *d;
    unsigned objects,
        found;       /* number of visited objects; number of datasets with the requested rows */
    char names[384]; /* the first names, for a message */
} candidates;

/* Callback of H5Ovisit2: adds a dataset to the candidates if it has the requested rows. */
static herr_t inspect_object(hid_t file, const char *name, const H5O_info_t *info, void *user)
{
    enum { OBJECTS_MAX = 65536, SHOWN = 4 };
    candidates *c = user;
    hsize_t size[2];
    if (++c->objects > OBJECTS_MAX)
        return 1;
    if (info->type != H5O_TYPE_DATASET || !ebpo_text_ok(name)) /* the name will be printed */
        return 0;
    hid_t set = H5Dopen2(file, name, H5P_DEFAULT);
    /* checked first, because H5Dget_space opens the files of a virtual dataset */
    bool in_file = set >= 0 && !ebpo_h5_is_elsewhere(set);
    hid_t space = in_file ? H5Dget_space(set) : -1, type = in_file ? H5Dget_type(set) : -1;
    size_t at = strlen(c->names);
    if (space >= 0 && type >= 0 && has_rows(space, c->d->least, c->d->most, size) &&
        !other_values(c->d, set, type)) {
        if (c->found < SHOWN && at + strlen(c->d->path) + strlen(name) + 8 < sizeof c->names)
            snprintf(c->names + at, sizeof c->names - at, "%s%s:/%s", at ? ", " : "", c->d->path,
                     name);
        c->found++;
    }
    if (type >= 0)
        H5Tclose(type);
    if (space >= 0)
        H5Sclose(space);
    if (set >= 0)
        H5Dclose(set);
    return 0;
}

/* Sets an error that lists the datasets with the requested rows, or that reports that the file has
 * no such dataset. */
static ebpo_status name_sets(dataset *d, ebpo_error *error)
{
    candidates c = { .d = d };
    char wanted[64];
    describe_rows(d, wanted);
    (void)H5Ovisit2(d->file, H5_INDEX_NAME, H5_ITER_INC, inspect_object, &c, H5O_INFO_BASIC);
    H5Eclear2(H5E_DEFAULT);
    if (!c.found)
        return ebpo_fail_file(error, EBPO_E_ABSENT, d->path, "the file has no dataset of %s",
                              wanted);
    return ebpo_fail_file(error, EBPO_E_FORMAT, d->path,
                          "is an HDF5 file; name a dataset of %s in it: %s%s", wanted,
                          *c.names ? c.names : "FILE.h5:/path", c.found > 4 ? ", ..." : "");
}

/* Reads `count` rows, beginning with row `first`, into `rows`, [count][d->most]. If the dataset has
 * fewer than d->most columns, the last columns of `rows` do not change. On failure, sets
 * *short_of_memory to true if a lack of memory is the reason. */
static bool read_piece(const dataset *d, hsize_t first, hsize_t count, double *rows,
                       bool *short_of_memory)
{
    hsize_t wide[2] = { count, d->most }, from[2] = { first, 0 }, to[2] = { 0, 0 },
            size[2] = { count, d->size[1] };
    hid_t memory = H5Screate_simple(2, wide, NULL);
    bool good = memory >= 0 &&
                H5Sselect_hyperslab(memory, H5S_SELECT_SET, to, NULL, size, NULL) >= 0 &&
                H5Sselect_hyperslab(d->space, H5S_SELECT_SET, from, NULL, size, NULL) >= 0 &&
                H5Dread(d->set, H5T_NATIVE_DOUBLE, memory, d->space, H5P_DEFAULT, rows) >= 0;
    *short_of_memory = !good && ebpo_h5_short_of_memory(); /* closing erases libhdf5's reason */
    if (memory >= 0)
        H5Sclose(memory);
    return good;
}

/* Writes the total number of rows, then the requested rows, to d->to. */
static ebpo_status copy_rows(const dataset *d, ebpo_error *error)
{
    static double rows[ROWS_AT_ONCE * COLUMNS_MAX];
    for (hsize_t i = 0; i < ROWS_AT_ONCE * (hsize_t)d->most; i++)
        rows[i] = d->fill;
    hsize_t end = d->end < d->size[0] ? d->end : d->size[0];
    uint64_t total = d->size[0];
    if (!ebpo_process_write(d->to, &total, sizeof total))
        return ebpo_fail_errno(error, d->path, "the rows could not be written to TMPDIR");
    for (hsize_t first = d->first; first < end; first += ROWS_AT_ONCE) {
        hsize_t count = end - first < ROWS_AT_ONCE ? end - first : ROWS_AT_ONCE;
        bool short_of_memory;
        if (!read_piece(d, first, count, rows, &short_of_memory))
            return short_of_memory ? ebpo_fail_memory(error, d->size[0] * d->size[1] * sizeof *rows)
                                   : rows_fail(d, "the dataset cannot be read", error);
        if (!ebpo_process_write(d->to, rows, (size_t)count * d->most * sizeof *rows))
            return ebpo_fail_errno(error, d->path, "the rows could not be written to TMPDIR");
    }
    return EBPO_OK;
}

/* Does the work of the separate process: reads the rows and writes them to d->to. */
static ebpo_status read_apart(void *user, ebpo_error *error)
{
    dataset *d = user;
    ebpo_status status = ebpo_h5_open_to_read(d->path, d->path, true, &d->file, error);
    if (status == EBPO_OK && (!d->name || !*d->name))
        return name_sets(d, error);
    if (status == EBPO_OK)
        status = open_set(d, error);
    if (status == EBPO_OK)
        status = check_set(d, error);
    return status == EBPO_OK ? copy_rows(d, error) : status;
}

/* Reads `bytes` bytes of the temporary file from offset `from` on. */
static bool read_bytes(const dataset *d, uint64_t from, void *to, uint64_t bytes)
{
    for (uint64_t at = 0; at < bytes;) {
        ssize_t done = pread(d->to, (char *)to + at, (size_t)(bytes - at), (off_t)(from + at));
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0)
            return false;
        at += (uint64_t)done;
    }
    return true;
}

/* Reads the result of the separate process from the temporary file: the total number of rows, and
 * the requested rows. */
static ebpo_status read_result(const dataset *d, double **rows, uint64_t *count, uint64_t *total,
                               ebpo_error *error)
{
    struct stat facts;
    if (fstat(d->to, &facts) != 0 || !read_bytes(d, 0, total, sizeof *total))
        return ebpo_fail_errno(error, d->path, "the temporary rows in TMPDIR cannot be read");
    uint64_t bytes = (uint64_t)facts.st_size - sizeof *total;
    *rows = ebpo_alloc(bytes, 1);
    if (!*rows)
        return ebpo_fail_memory(error, bytes);
    if (!read_bytes(d, sizeof *total, *rows, bytes))
        return ebpo_fail_errno(error, d->path, "the temporary rows in TMPDIR cannot be read");
    *count = bytes / (d->most * sizeof **rows);
    return EBPO_OK;
}

/* Computes the limit of bytes, and opens the unnamed temporary file for the rows. */
static ebpo_status prepare_reading(dataset *d, ebpo_error *error)
{
    const char *folder = getenv("TMPDIR");
    struct stat facts;
    if (access(d->path, R_OK) != 0 || stat(d->path, &facts) != 0)
        return ebpo_fail_errno(error, d->path, "cannot be opened");
    if (!S_ISREG(facts.st_mode))
        return ebpo_fail_file(error, EBPO_E_IO, d->path,
                              "is not a regular file; name a regular file");
    uint64_t bytes = (uint64_t)facts.st_size;
    d->bytes_max = bytes > UINT64_MAX / 2 / EXPANSION_MAX ? UINT64_MAX / 2 : bytes * EXPANSION_MAX;
    d->bytes_max = d->bytes_max < EXPANSION_FREE ? EXPANSION_FREE : d->bytes_max;
    d->to = ebpo_open_unnamed(folder && *folder ? folder : "/tmp");
    return d->to >= 0 ? EBPO_OK
                      : ebpo_fail_errno(error, d->path,
                                        "a temporary file for the rows could not be opened in "
                                        "TMPDIR");
}

ebpo_status ebpo_rows_read(const char *path, const char *name, unsigned least, unsigned most,
                           double fill, double **rows, uint64_t *count, ebpo_error *error)
{
    uint64_t total;
    return ebpo_rows_read_part(path, name, least, most, fill, 0, UINT64_MAX, rows, count, &total,
                               error);
}

ebpo_status ebpo_rows_read_part(const char *path, const char *name, unsigned least, unsigned most,
                                double fill, uint64_t first, uint64_t max_rows, double **rows,
                                uint64_t *count, uint64_t *total, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_process_limits limits = { UINT64_C(1) << 30, 0, 600 };
    uint64_t end = max_rows > UINT64_MAX - first ? UINT64_MAX : first + max_rows;
    dataset d = { path, name, -1, least, most, 0, fill, first, end, -1, -1, -1, -1, { 0, 0 } };
    *rows = NULL;
    *count = *total = 0;
    if (least < 1 || most < least || most > COLUMNS_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "rows: 1 to %d columns can be requested",
                         COLUMNS_MAX);
    /* because datasets in files of this library may have the library's filter (zstd) */
    ebpo_status status = ebpo_h5_register(error);
    if (status == EBPO_OK)
        status = prepare_reading(&d, error);
    limits.file_bytes = d.bytes_max + sizeof *total;
    if (status == EBPO_OK)
        status = ebpo_run_in_process(read_apart, &d, path, &limits, error);
    if (status == EBPO_OK)
        status = read_result(&d, rows, count, total, error);
    if (d.to >= 0)
        close(d.to);
    if (status != EBPO_OK) {
        free(*rows);
        *rows = NULL;
        *count = *total = 0;
    }
    return status;
}
