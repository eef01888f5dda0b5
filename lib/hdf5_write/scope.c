/* Provides the scope of each use of libhdf5 (h5_parts.h): locks a mutex, because Debian's serial
 * build is not thread-safe, and switches off HDF5's error printing. Also provides functions that
 * are called within a scope. They open untrusted files, and make errors that name the file, the
 * object and libhdf5's innermost reason. Also registers the library's filter. */
#include "hdf5_write/h5_parts.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "core/text.h"
#include "hdf5_write/h5.h"
#include "hdf5_write/zstd_filter.h"

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

enum {
    /* size of a buffer for a message of libhdf5, which may have a path before the error number */
    CAUSE_BYTES = 8192,
    CAUSE_SHOWN = 160 /* greatest length of libhdf5's message in a message of this library */
};

/* Callback of H5Ewalk2: copies libhdf5's innermost message to `data`. */
static herr_t copy_first_message(unsigned depth, const H5E_error2_t *entry, void *data)
{
    (void)depth;
    if (entry->desc)
        snprintf(data, CAUSE_BYTES, "%s", entry->desc);
    return 1; /* stop: only the innermost message is needed */
}

/* Callback of H5Ewalk2: sets *data to true for an error that is a lack of memory. */
static herr_t record_memory(unsigned depth, const H5E_error2_t *entry, void *data)
{
    (void)depth;
    *(bool *)data |= entry->maj_num == H5E_RESOURCE && entry->min_num == H5E_NOSPACE;
    return 0;
}

bool ebpo_h5_short_of_memory(void)
{
    bool found = false;
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, record_memory, &found);
    return found;
}

/* Returns the error number of the system (errno) in libhdf5's message `cause`. Returns 0 if the
 * message has no such number. */
static int system_error(const char *cause)
{
    const char *number = strstr(cause, "errno = ");
    return number ? atoi(number + 8) : 0;
}

ebpo_status ebpo_h5_fail(ebpo_error *error, ebpo_status status, const char *shown,
                         const char *object, const char *what)
{
    char cause[CAUSE_BYTES] = "";
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, copy_first_message, cause);
    H5Eclear2(H5E_DEFAULT);
    int number = system_error(cause);
    if (number > 0)
        return ebpo_fail_at(error, status, shown, object, -1, "%s: %s", what, strerror(number));
    if (*cause && ebpo_text_ok(cause)) /* the cause may contain names from the file */
        return ebpo_fail_at(error, status, shown, object, -1, "%s (libhdf5: %.*s)", what,
                            CAUSE_SHOWN, cause);
    return ebpo_fail_at(error, status, shown, object, -1, "%s", what);
}

/* Opens a file for reading. Returns a negative id on failure. */
static hid_t open_with(const char *path, bool lock)
{
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    if (!lock)
        H5Pset_file_locking(fapl, false, true);
    hid_t file = H5Fopen(path, H5F_ACC_RDONLY, fapl);
    if (fapl >= 0 && file >= 0) /* after a failure, closing would erase libhdf5's reason */
        H5Pclose(fapl);
    return file;
}

ebpo_status ebpo_h5_open_to_read(const char *path, const char *shown, bool lock, hid_t *file,
                                 ebpo_error *error)
{
    char cause[CAUSE_BYTES] = "";
    *file = open_with(path, lock);
    if (*file >= 0)
        return EBPO_OK;
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, copy_first_message, cause);
    int number = strstr(cause, "unable to lock file") ? system_error(cause) : 0;
    if (number == EAGAIN || number == EACCES)
        return ebpo_fail_file(error, EBPO_E_IO, shown,
                              "is open for writing in another program; close it there first");
    if (strstr(cause, "already open for write"))
        return ebpo_fail_file(error, EBPO_E_IO, shown,
                              "is marked as open for writing; close it in the program that "
                              "writes it, or, if that program has crashed, remove the mark with "
                              "`h5clear -s`");
    if (number) { /* the file system has no locks */
        H5Eclear2(H5E_DEFAULT);
        *file = open_with(path, false);
    }
    return *file >= 0 ? EBPO_OK
                      : ebpo_h5_fail(error, EBPO_E_FORMAT, shown, "",
                                     "not a whole HDF5 file, or the file is damaged");
}

bool ebpo_h5_is_elsewhere(hid_t set)
{
    hid_t plist = H5Dget_create_plist(set);
    bool elsewhere =
        plist >= 0 && (H5Pget_layout(plist) == H5D_VIRTUAL || H5Pget_external_count(plist) > 0);
    if (plist >= 0)
        H5Pclose(plist);
    return elsewhere;
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
