/* Rows of numbers from files of others: rows.h. */
#include <ebpo/rows.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "h5/h5.h"
#include "h5/scope.h"

enum { COLUMNS_MOST = 64 };

typedef struct dataset {
    const char *path, *name;
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

/* Into the first columns of rows that are `most` wide. */
static ebpo_status read_set(const dataset *d, unsigned most, double *rows, ebpo_error *error)
{
    hsize_t wide[2] = { d->size[0], most }, from[2] = { 0, 0 };
    if (d->size[0] == 0)
        return EBPO_OK;
    hid_t memory = H5Screate_simple(2, wide, NULL);
    bool good = memory >= 0 &&
                H5Sselect_hyperslab(memory, H5S_SELECT_SET, from, NULL, d->size, NULL) >= 0 &&
                H5Dread(d->set, H5T_NATIVE_DOUBLE, memory, H5S_ALL, H5P_DEFAULT, rows) >= 0;
    ebpo_status status = EBPO_OK;
    if (!good)
        status = ebpo_h5_short_of_memory()
                     ? ebpo_fail_memory(error, d->size[0] * d->size[1] * sizeof *rows)
                     : fail(d, "the dataset cannot be read", error);
    if (memory >= 0)
        H5Sclose(memory);
    return status;
}

static ebpo_status read_rows(dataset *d, unsigned least, unsigned most, double fill, double **rows,
                             uint64_t *count, ebpo_error *error)
{
    ebpo_status status = open_set(d, error);
    if (status == EBPO_OK)
        status = check_set(d, least, most, error);
    if (status != EBPO_OK)
        return status;
    *rows = ebpo_alloc(d->size[0], most * sizeof **rows);
    if (!*rows)
        return ebpo_fail_memory(error, d->size[0] * most * sizeof **rows);
    for (uint64_t i = 0; d->size[1] < most && i < d->size[0]; i++)
        for (uint64_t k = d->size[1]; k < most; k++)
            (*rows)[i * most + k] = fill;
    *count = d->size[0];
    return read_set(d, most, *rows, error);
}

static void close_set(dataset *d)
{
    if (d->type >= 0)
        H5Tclose(d->type);
    if (d->space >= 0)
        H5Sclose(d->space);
    if (d->set >= 0)
        H5Dclose(d->set);
    if (d->file >= 0)
        H5Fclose(d->file);
}

ebpo_status ebpo_rows_read(const char *path, const char *name, unsigned least, unsigned most,
                           double fill, double **rows, uint64_t *count, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    dataset d = { path, name, -1, -1, -1, -1, { 0, 0 } };
    ebpo_h5_scope scope;
    *rows = NULL;
    *count = 0;
    if (least < 1 || most < least || most > COLUMNS_MOST)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "rows: 1 to %d columns can be asked for",
                         COLUMNS_MOST);
    if (access(path, R_OK) != 0)
        return ebpo_fail_errno(error, path, "cannot be opened");
    ebpo_status status = ebpo_h5_register(error); /* our own files have such datasets, too */
    if (status != EBPO_OK)
        return status;
    ebpo_h5_enter(&scope);
    status = read_rows(&d, least, most, fill, rows, count, error);
    close_set(&d);
    ebpo_h5_leave(&scope);
    if (status != EBPO_OK) {
        free(*rows);
        *rows = NULL;
        *count = 0;
    }
    return status;
}
