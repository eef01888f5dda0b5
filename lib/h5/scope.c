#include "h5/scope.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/error.h"
#include "h5/h5.h"
#include "h5/zstd_filter.h"

static pthread_mutex_t library = PTHREAD_MUTEX_INITIALIZER;

void ebpo_h5_enter(ebpo_h5_scope *scope)
{
    pthread_mutex_lock(&library);
    if (H5Eget_auto2(H5E_DEFAULT, &scope->printer, &scope->printer_data) < 0)
        *scope = (ebpo_h5_scope){ NULL, NULL };
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
}

void ebpo_h5_leave(ebpo_h5_scope *scope)
{
    H5Eset_auto2(H5E_DEFAULT, scope->printer, scope->printer_data);
    pthread_mutex_unlock(&library);
}

/* libhdf5 tells the path first, the number of the error behind it */
enum { CAUSE_BYTES = 8192, CAUSE_SHOWN = 160 };

static herr_t take_first(unsigned depth, const H5E_error2_t *entry, void *data)
{
    (void)depth;
    if (entry->desc)
        snprintf(data, CAUSE_BYTES, "%s", entry->desc);
    return 1; /* the innermost is enough */
}

static herr_t take_memory(unsigned depth, const H5E_error2_t *entry, void *data)
{
    (void)depth;
    *(bool *)data |= entry->maj_num == H5E_RESOURCE && entry->min_num == H5E_NOSPACE;
    return 0;
}

bool ebpo_h5_short_of_memory(void)
{
    bool found = false;
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, take_memory, &found);
    return found;
}

ebpo_status ebpo_h5_fail(ebpo_error *error, ebpo_status status, const char *shown,
                         const char *object, const char *what)
{
    char cause[CAUSE_BYTES] = "";
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, take_first, cause);
    H5Eclear2(H5E_DEFAULT);
    const char *number = strstr(cause, "errno = ");
    if (number && atoi(number + 8) > 0)
        return ebpo_fail_at(error, status, shown, object, -1, "%s: %s", what,
                            strerror(atoi(number + 8)));
    if (*cause)
        return ebpo_fail_at(error, status, shown, object, -1, "%s (libhdf5: %.*s)", what,
                            CAUSE_SHOWN, cause);
    return ebpo_fail_at(error, status, shown, object, -1, "%s", what);
}

hid_t ebpo_h5_integer_type(unsigned size, bool is_signed)
{
    switch (size) {
    case 1: return is_signed ? H5T_STD_I8LE : H5T_STD_U8LE;
    case 2: return is_signed ? H5T_STD_I16LE : H5T_STD_U16LE;
    case 4: return is_signed ? H5T_STD_I32LE : H5T_STD_U32LE;
    case 8: return is_signed ? H5T_STD_I64LE : H5T_STD_U64LE;
    }
    return -1;
}

ebpo_status ebpo_h5_register(ebpo_error *error)
{
    ebpo_h5_scope scope;
    ebpo_h5_enter(&scope);
    ebpo_status status = EBPO_OK;
    if (H5Zregister(&ebpo_zstd_filter) < 0)
        status = ebpo_h5_fail(error, EBPO_E_UNSUPPORTED, "HDF5", "",
                              "the zstd filter could not be registered");
    ebpo_h5_leave(&scope);
    return status;
}
