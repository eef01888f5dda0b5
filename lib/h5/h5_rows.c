/* Rows of numbers from files of others: rows.h. libhdf5 reads them in a process of its own, which
 * hands them over in a file without a name. */
#include <ebpo/rows.h>
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/unnamed_file.h"
#include "h5/apart.h"
#include "h5/h5.h"
#include "h5/scope.h"

enum { COLUMNS_MOST = 64, ROWS_AT_ONCE = 16384 };

typedef struct dataset {
    const char *path, *name;
    int to; /* the descriptor of where rows go */
    unsigned least, most;
    double fill;
    hid_t file, set, space, type;
    hsize_t size[2];
} dataset;

static ebpo_status fail(const dataset *d, const char *what, ebpo_error *error)
{
    return ebpo_h5_fail(error, EBPO_E_FORMAT, d->path, d->name, what);
}

static ebpo_status open_set(dataset *d, ebpo_error *error)
{
    d->file = H5Fopen(d->path, H5F_ACC_RDONLY, H5P_DEFAULT);
    if (d->file < 0)
        return ebpo_h5_fail(error, EBPO_E_FORMAT, d->path, "", "not a whole HDF5 file");
    d->set = H5Dopen2(d->file, d->name, H5P_DEFAULT);
    if (d->set < 0)
        return fail(d, "there is no such dataset", error);
    d->space = H5Dget_space(d->set);
    d->type = H5Dget_type(d->set);
    return d->space < 0 || d->type < 0 ? fail(d, "the dataset is damaged", error) : EBPO_OK;
}

static ebpo_status check_set(dataset *d, unsigned least, unsigned most, ebpo_error *error)
{
    char what[96];
    H5T_class_t class = H5Tget_class(d->type);
    if (class != H5T_INTEGER && class != H5T_FLOAT)
        return fail(d, "holds no numbers", error);
    if (H5Sget_simple_extent_ndims(d->space) == 2 &&
        H5Sget_simple_extent_dims(d->space, d->size, NULL) == 2 && d->size[1] >= least &&
        d->size[1] <= most)
        return EBPO_OK;
    snprintf(what, sizeof what, "rows of %u%s%.0u numbers are expected", least,
             most > least ? " to " : "", most > least ? most : 0);
    return fail(d, what, error);
}

/* Rows from `first` on, into the first columns of rows that are `most` wide. *short_of_memory: why
 * it is false. */
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
    *short_of_memory = !good && ebpo_h5_short_of_memory(); /* closing wipes libhdf5's reason */
    if (memory >= 0)
        H5Sclose(memory);
    return good;
}

static ebpo_status copy_rows(const dataset *d, ebpo_error *error)
{
    static double rows[ROWS_AT_ONCE * COLUMNS_MOST];
    for (hsize_t i = 0; i < ROWS_AT_ONCE * (hsize_t)d->most; i++)
        rows[i] = d->fill;
    for (hsize_t first = 0; first < d->size[0]; first += ROWS_AT_ONCE) {
        hsize_t count = d->size[0] - first < ROWS_AT_ONCE ? d->size[0] - first : ROWS_AT_ONCE;
        bool short_of_memory;
        if (!read_piece(d, first, count, rows, &short_of_memory))
            return short_of_memory ? ebpo_fail_memory(error, d->size[0] * d->size[1] * sizeof *rows)
                                   : fail(d, "the dataset cannot be read", error);
        if (!ebpo_apart_write(d->to, rows, (size_t)count * d->most * sizeof *rows))
            return ebpo_fail_errno(error, d->path, "its rows could not be written to TMPDIR");
    }
    return EBPO_OK;
}

static ebpo_status read_apart(void *user, ebpo_error *error)
{
    dataset *d = user;
    ebpo_status status = open_set(d, error);
    if (status == EBPO_OK)
        status = check_set(d, d->least, d->most, error);
    return status == EBPO_OK ? copy_rows(d, error) : status;
}

/* What the other process has left. */
static ebpo_status take_rows(const dataset *d, double **rows, uint64_t *count, ebpo_error *error)
{
    struct stat facts;
    if (fstat(d->to, &facts) != 0)
        return ebpo_fail_errno(error, d->path, "its rows in TMPDIR cannot be read");
    uint64_t bytes = (uint64_t)facts.st_size, at = 0;
    *rows = ebpo_alloc(bytes, 1);
    if (!*rows)
        return ebpo_fail_memory(error, bytes);
    while (at < bytes) {
        ssize_t done = pread(d->to, (char *)*rows + at, (size_t)(bytes - at), (off_t)at);
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0)
            return ebpo_fail_errno(error, d->path, "its rows in TMPDIR cannot be read");
        at += (uint64_t)done;
    }
    *count = bytes / (d->most * sizeof **rows);
    return EBPO_OK;
}

static ebpo_status make_ready(dataset *d, ebpo_error *error)
{
    const char *folder = getenv("TMPDIR");
    struct stat facts;
    if (access(d->path, R_OK) != 0 || stat(d->path, &facts) != 0)
        return ebpo_fail_errno(error, d->path, "cannot be opened");
    if (!S_ISREG(facts.st_mode))
        return ebpo_fail_file(error, EBPO_E_IO, d->path, "is no regular file; name one");
    d->to = ebpo_open_unnamed(folder && *folder ? folder : "/tmp");
    return d->to >= 0 ? EBPO_OK : ebpo_fail_errno(error, d->path, "no room for its rows in TMPDIR");
}

ebpo_status ebpo_rows_read(const char *path, const char *name, unsigned least, unsigned most,
                           double fill, double **rows, uint64_t *count, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    static const ebpo_apart_limits limits = { UINT64_C(1) << 30, UINT64_MAX, 600 };
    dataset d = { path, name, -1, least, most, fill, -1, -1, -1, -1, { 0, 0 } };
    *rows = NULL;
    *count = 0;
    if (least < 1 || most < least || most > COLUMNS_MOST)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "rows: 1 to %d columns can be asked for",
                         COLUMNS_MOST);
    ebpo_status status = ebpo_h5_register(error); /* our own files have such datasets, too */
    if (status == EBPO_OK)
        status = make_ready(&d, error);
    if (status == EBPO_OK)
        status = ebpo_apart(read_apart, &d, path, &limits, error);
    if (status == EBPO_OK)
        status = take_rows(&d, rows, count, error);
    if (d.to >= 0)
        close(d.to);
    if (status != EBPO_OK) {
        free(*rows);
        *rows = NULL;
        *count = 0;
    }
    return status;
}
