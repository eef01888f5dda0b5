/* Replaces output files atomically: writes a temporary file in the same folder, syncs it, renames
 * it to the target, and syncs the folder. If the output was made from an earlier version of the
 * target, the target is compared with this version before the rename, under the target's lock. If
 * two outputs belong together and the second output cannot be replaced, the first output is
 * restored. A new file gets the owner, permissions and extended attributes of the file that it
 * replaces. The functions for the library's callers are at the end. */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#ifdef EBPO_HAVE_XATTR
#include <sys/xattr.h>
#endif
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/os.h"
#include "io/byte_source.h"
#include "io/file_lock.h"
#include "io/file_source.h"
#include "io/publish.h"
#include "io/unfinished.h"

/* --- properties that a new file gets from the replaced file --- */

#ifdef EBPO_HAVE_XATTR
/* Maximum size in bytes of the list of names, and of one value. No system allows more. */
enum { NAMES_MAX = 65536, VALUE_MAX = 65536 };

static void copy_attribute(int from, int to, const char *name, void *value)
{
    ssize_t size = fgetxattr(from, name, value, VALUE_MAX);
    if (size >= 0)
        (void)!fsetxattr(to, name, value, (size_t)size, 0); /* fails if the system forbids it */
}

static void copy_attributes(int from, int to)
{
    char *names = malloc(NAMES_MAX);
    void *value = malloc(VALUE_MAX);
    ssize_t size = names && value ? flistxattr(from, names, NAMES_MAX) : -1;
    for (ssize_t at = 0; at < size; at += (ssize_t)strlen(names + at) + 1)
        copy_attribute(from, to, names + at, value);
    free(names);
    free(value);
}

#else
static void copy_attributes(int from, int to) { (void)from, (void)to; }
#endif

/* Gives the file the owner and group of the replaced file (`old`). Returns the mode to set. If the
 * system does not allow the change, the new file keeps the owner or group of this process. Then the
 * mode lacks the bits set-user-ID, set-group-ID and sticky. */
static mode_t copy_owner(int to, const struct stat *old)
{
    struct stat new;
    mode_t mode = old->st_mode & 07777;
    if (fstat(to, &new) != 0)
        return mode & 0777;
    bool user = new.st_uid == old->st_uid || fchown(to, old->st_uid, (gid_t)-1) == 0,
         group = new.st_gid == old->st_gid || fchown(to, (uid_t)-1, old->st_gid) == 0;
    if (user && group)
        return mode;
    /* The old group's permissions must not apply to another group, so that group gets at most the
     * permissions of all users. */
    return group ? mode & 0777 : mode & (0707 | (mode & 007) << 3);
}

/* Gives the open file `fd` the mode of the regular file at `path`. If the system allows this, also
 * copies the owner and the extended attributes (including access control lists). If there is no
 * regular file at `path`, sets `mode`; -1: does not set the mode. Returns false with errno if the
 * mode cannot be set. */
static bool copy_facts(int fd, const char *path, int mode)
{
    struct stat old;
    int from = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY);
    bool exists = from >= 0 ? fstat(from, &old) == 0 : lstat(path, &old) == 0;
    if (exists && S_ISREG(old.st_mode)) {
        mode = (int)copy_owner(fd, &old);
        if (from >= 0)
            /* before the mode, because an access control list may change the mode */
            copy_attributes(from, fd);
    }
    if (from >= 0)
        close(from);
    return mode < 0 || fchmod(fd, (mode_t)mode) == 0;
}

/* --- beginning --- */

static atomic_uint name_counter;

/* Checks that the target is missing or a regular file. Sets publish->mode. */
static ebpo_status check_target(ebpo_publish *publish, const char *path, ebpo_error *error)
{
    struct stat st;
    if (lstat(path, &st) != 0)
        return errno == ENOENT ? EBPO_OK : ebpo_fail_errno(error, path, "cannot be written");
    if (S_ISREG(st.st_mode)) {
        publish->mode = st.st_mode & 07777;
        return EBPO_OK;
    }
    const char *what = S_ISDIR(st.st_mode)   ? "is a folder"
                       : S_ISLNK(st.st_mode) ? "is a symbolic link"
                                             : "is a pipe or device";
    return ebpo_fail_file(error, EBPO_E_IO, path,
                          "%s, which cannot be replaced by an output file; name another file",
                          what);
}

static ebpo_status resolve_target(ebpo_publish *publish, const char *path, ebpo_error *error)
{
    ebpo_status status = ebpo_target_path(path, &publish->target, error);
    if (status != EBPO_OK)
        return status;
    const char *name = ebpo_path_name(publish->target);
    publish->folder = strndup(publish->target, (size_t)(name - publish->target));
    publish->shown = strdup(path);
    return publish->folder && publish->shown ? EBPO_OK : ebpo_fail_memory(error, strlen(path));
}

static ebpo_status create_temporary(ebpo_publish *publish, ebpo_error *error)
{
    for (int attempt = 0; attempt < 100; attempt++) {
        free(publish->temporary);
        if (asprintf(&publish->temporary, "%s.%.*s.%ld-%u.tmp", publish->folder,
                     EBPO_TARGET_NAME_KEPT, ebpo_path_name(publish->target), (long)getpid(),
                     atomic_fetch_add(&name_counter, 1)) < 0) {
            publish->temporary = NULL;
            return ebpo_fail_memory(error, PATH_MAX);
        }
        if (strlen(publish->temporary) >= PATH_MAX)
            return ebpo_fail_file(error, EBPO_E_IO, publish->shown,
                                  "the path is too long; write to a folder with a shorter path");
        /* Registers the name for the signal handler before the file exists, so that a signal never
         * leaves the file behind. */
        ebpo_unfinished_set(publish->slot, publish->temporary);
        /* Mode 0600: the file that is replaced may be private, so the new content is private until
         * copy_facts sets the mode. */
        publish->fd = open(publish->temporary, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW,
                           publish->mode < 0 ? 0666 : 0600);
        if (publish->fd >= 0) {
            /* Other processes remove abandoned temporary files. The lock shows them that this file
             * is in use. */
            (void)flock(publish->fd, LOCK_EX | LOCK_NB);
            return EBPO_OK;
        }
        ebpo_unfinished_unset(publish->slot);
        if (errno != EEXIST)
            break;
    }
    ebpo_status status = ebpo_fail_errno(error, publish->shown,
                                         "no temporary file can be created in the output's folder");
    free(publish->temporary);
    publish->temporary = NULL;
    return status;
}

ebpo_status ebpo_publish_begin(ebpo_publish *out, const char *path, ebpo_error *error)
{
    *out = (ebpo_publish)EBPO_PUBLISH_INIT;
    ebpo_publish publish = EBPO_PUBLISH_INIT;
    ebpo_status status = resolve_target(&publish, path, error);
    if (status == EBPO_OK)
        status = check_target(&publish, path, error);
    if (status == EBPO_OK && (publish.slot = ebpo_unfinished_reserve()) < 0)
        status = ebpo_fail_file(error, EBPO_E_LIMIT, path,
                                "this process cannot write or lock more than %d files at a time",
                                EBPO_UNFINISHED_MAX);
    if (status == EBPO_OK) {
        ebpo_remove_stale_files(publish.folder, ebpo_path_name(publish.target));
        status = create_temporary(&publish, error);
    }
    if (status != EBPO_OK) {
        ebpo_publish_abort(&publish);
        return status;
    }
    *out = publish;
    return EBPO_OK;
}

static ebpo_file_version version_of(const struct stat *st)
{
    return (ebpo_file_version){ true, st->st_dev, st->st_ino, st->st_size, st->st_mtim };
}

ebpo_file_version ebpo_file_version_of(int fd)
{
    struct stat st;
    return fstat(fd, &st) == 0 ? version_of(&st) : (ebpo_file_version){ .exists = false };
}

void ebpo_publish_expect(ebpo_publish *publish, const ebpo_file_version *expected, bool locked)
{
    publish->expects = true;
    publish->locked = locked;
    publish->expected = *expected;
}

void ebpo_publish_expect_input(ebpo_publish *publish, const ebpo_input *input)
{
    struct stat target_stat, input_stat;
    char *from = realpath(input->shown, NULL);
    int fd = ebpo_input_descriptor(input);
    bool has_same_path = from && strcmp(from, publish->target) == 0,
         exists = lstat(publish->target, &target_stat) == 0,
         known = fd >= 0 && fstat(fd, &input_stat) == 0,
         is_same_file = exists && known && target_stat.st_dev == input_stat.st_dev &&
                        target_stat.st_ino == input_stat.st_ino;
    if ((has_same_path || is_same_file) && (known || exists)) {
        ebpo_file_version version = version_of(known ? &input_stat : &target_stat);
        ebpo_publish_expect(publish, &version, false);
    }
    free(from);
}

const char *ebpo_publish_path(const ebpo_publish *publish) { return publish->temporary; }

/* Opens the stream with an explicit buffer, so that a lack of memory for the buffer is reported,
 * and so that there are few system calls. */
FILE *ebpo_publish_stream(ebpo_publish *publish)
{
    enum { BUFFER = 1 << 16 };
    if (publish->stream)
        return publish->stream;
    if (!publish->buffer)
        publish->buffer = ebpo_alloc(BUFFER, 1);
    publish->stream = publish->buffer ? fdopen(publish->fd, "w+b") : NULL;
    if (!publish->stream)
        return NULL;
    publish->fd = -1; /* the stream owns the descriptor now */
    (void)!setvbuf(publish->stream, publish->buffer, _IOFBF, BUFFER);
    return publish->stream;
}

/* Closes the stream or the descriptor. Returns false if data could not be written. */
static bool close_writer(ebpo_publish *publish)
{
    bool good = true;
    if (publish->stream) {
        good = !ferror(publish->stream);
        good = fclose(publish->stream) == 0 && good;
    } else if (publish->fd >= 0) {
        good = close(publish->fd) == 0;
    }
    free(publish->buffer);
    publish->buffer = NULL;
    publish->stream = NULL;
    publish->fd = -1;
    return good;
}

/* Syncs and closes a file or folder. Returns false, with errno, if the sync fails. */
static bool sync_and_close(int fd)
{
    /* EINVAL: the file system cannot sync folders */
    bool good = fsync(fd) == 0 || errno == EINVAL;
    int saved = errno;
    close(fd);
    errno = saved;
    return good;
}

/* Returns false, with errno, if the folder cannot be synced. */
static bool sync_folder(const char *path)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_DIRECTORY);
    return fd >= 0 && sync_and_close(fd);
}

/* Closes the temporary file, sets its mode, and syncs it, unless it is `unsynced`. For this, opens
 * the file again by its name, because a library may have written the file through another
 * descriptor. */
static ebpo_status make_ready(ebpo_publish *publish, ebpo_error *error)
{
    errno = 0;
    if (!close_writer(publish))
        return ebpo_fail_errno(error, publish->shown,
                               errno ? "could not be written" : "could not be written completely");
    int fd = open(publish->temporary, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (fd >= 0 && !copy_facts(fd, publish->target, publish->mode)) {
        int saved = errno;
        close(fd);
        errno = saved;
        return ebpo_fail_errno(error, publish->shown,
                               "the new file could not get the mode of the replaced file");
    }
    if (fd < 0 || !(publish->unsynced ? close(fd) == 0 : sync_and_close(fd)))
        return ebpo_fail_errno(error, publish->shown, "could not be synced to the disk");
    return EBPO_OK;
}

/* Returns true if the target has the expected version, or is missing, so that replacing it loses no
 * data of another program. */
static bool is_expected(const ebpo_publish *publish)
{
    struct stat st;
    const ebpo_file_version *e = &publish->expected;
    if (!publish->expects || lstat(publish->target, &st) != 0)
        return true;
    ebpo_file_version current = version_of(&st);
    return e->exists && e->device == current.device && e->inode == current.inode &&
           e->size == current.size && e->modified.tv_sec == current.modified.tv_sec &&
           e->modified.tv_nsec == current.modified.tv_nsec;
}

/* Renames the temporary file to the target, if the target has the expected version. */
static ebpo_status put_in_place(ebpo_publish *publish, ebpo_error *error)
{
    if (!is_expected(publish))
        return ebpo_fail_file(
            error, EBPO_E_IO, publish->shown,
            "another program has changed the file since it was read, so the file was not replaced; "
            "read the file again and repeat the change, or write to another file");
    if (rename(publish->temporary, publish->target) != 0)
        return ebpo_fail_errno(error, publish->shown,
                               "the finished temporary file could not be renamed to the output");
    free(publish->temporary);
    publish->temporary = NULL;
    return EBPO_OK;
}

/* Syncs the folder of the target. */
static ebpo_status sync_name(const ebpo_publish *publish, ebpo_error *error)
{
    return sync_folder(publish->folder)
               ? EBPO_OK
               : ebpo_fail_errno(error, publish->shown,
                                 "the file is complete, but its folder could not be synced to the "
                                 "disk");
}

ebpo_status ebpo_publish_commit(ebpo_publish *publish, ebpo_error *error)
{
    ebpo_file_lock lock = EBPO_FILE_LOCK_INIT;
    ebpo_status status = make_ready(publish, error);
    if (status == EBPO_OK && publish->expects && !publish->locked)
        status = ebpo_file_lock_take(&lock, publish->target, EBPO_FILE_LOCK_SAVING, NULL, error);
    if (status == EBPO_OK)
        status = put_in_place(publish, error);
    ebpo_file_lock_release(&lock);
    if (status == EBPO_OK && !publish->unsynced)
        status = sync_name(publish, error);
    ebpo_publish_abort(publish);
    return status;
}

void ebpo_publish_unlock(int fd) { (void)flock(fd, LOCK_UN); }

/* Exchanges the names of the temporary file and the target. Then the previous file has the
 * temporary name. Returns false on failure, with errno. ENOENT: the target is missing. */
static bool exchange_files(const ebpo_publish *publish)
{
#ifdef EBPO_HAVE_RENAMEAT2
    return renameat2(AT_FDCWD, publish->temporary, AT_FDCWD, publish->target, RENAME_EXCHANGE) == 0;
#else
    struct stat st;
    /* if the target is missing, lstat has set errno to ENOENT */
    if (lstat(publish->target, &st) == 0)
        errno = ENOSYS;
    return false;
#endif
}

/* Restores the first target, because the second target could not be replaced. `exchanged`: the
 * previous file still exists under the temporary name. `fresh`: there was no previous file.
 * `cause`: why the second target could not be replaced. */
static ebpo_status restore_first(ebpo_publish *first, bool exchanged, bool fresh, ebpo_error *cause,
                                 ebpo_error *error)
{
    if (exchanged ? exchange_files(first) : fresh && unlink(first->target) == 0)
        return ebpo_fail_with(error, cause);
    return ebpo_fail_file(error, cause->status, cause->file,
                          "%s; of the two files, only %s was replaced; write both files again",
                          strerror(errno), first->shown);
}

ebpo_status ebpo_publish_commit_pair(ebpo_publish *first, ebpo_publish *second, ebpo_error *error)
{
    ebpo_error cause = EBPO_ERROR_INIT;
    ebpo_file_lock lock = EBPO_FILE_LOCK_INIT;
    ebpo_status status = make_ready(first, error);
    if (status == EBPO_OK)
        status = make_ready(second, error);
    if (status == EBPO_OK)
        status = ebpo_file_lock_take(&lock, first->target, EBPO_FILE_LOCK_SAVING, NULL, error);
    bool exchanged = status == EBPO_OK && exchange_files(first),
         fresh = !exchanged && errno == ENOENT;
    if (status == EBPO_OK && !exchanged)
        status = put_in_place(first, error);
    if (status == EBPO_OK && put_in_place(second, &cause) != EBPO_OK)
        status = restore_first(first, exchanged, fresh, &cause, error);
    ebpo_file_lock_release(&lock);
    if (status == EBPO_OK)
        status = sync_name(first, error);
    if (status == EBPO_OK && strcmp(first->folder, second->folder) != 0)
        status = sync_name(second, error);
    ebpo_publish_abort(first);
    ebpo_publish_abort(second);
    return status;
}

void ebpo_publish_abort(ebpo_publish *publish)
{
    close_writer(publish);
    if (publish->temporary)
        unlink(publish->temporary);
    ebpo_unfinished_forget(publish->slot);
    free(publish->shown);
    free(publish->folder);
    free(publish->target);
    free(publish->temporary);
    *publish = (ebpo_publish)EBPO_PUBLISH_INIT;
}

/* --- for the callers of the library: whole files, and aborting --- */

ebpo_status ebpo_write_file(const char *path, const void *data, size_t size, ebpo_error *error)
{
    ebpo_publish out = EBPO_PUBLISH_INIT;
    ebpo_status status = ebpo_publish_begin(&out, path, error);
    if (status != EBPO_OK)
        return status;
    FILE *stream = ebpo_publish_stream(&out);
    if (!stream)
        status = ebpo_fail_memory(error, BUFSIZ);
    else if (fwrite(data, 1, size, stream) != size)
        status = ebpo_fail_errno(error, path, "could not be written");
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&out, error);
    ebpo_publish_abort(&out);
    return status;
}

struct ebpo_output {
    ebpo_publish publish;
};

ebpo_status ebpo_output_begin(const char *path, ebpo_output **out, int *descriptor,
                              ebpo_error *error)
{
    *descriptor = -1;
    *out = ebpo_alloc(1, sizeof **out);
    if (!*out)
        return ebpo_fail_memory(error, sizeof **out);
    ebpo_status status = ebpo_publish_begin(&(*out)->publish, path, error);
    if (status != EBPO_OK) {
        free(*out);
        *out = NULL;
        return status;
    }
    *descriptor = (*out)->publish.fd;
    return EBPO_OK;
}

ebpo_status ebpo_output_end(ebpo_output *out, ebpo_error *error)
{
    ebpo_status status = ebpo_publish_commit(&out->publish, error);
    free(out);
    return status;
}

void ebpo_output_abandon(ebpo_output *out)
{
    if (out)
        ebpo_publish_abort(&out->publish);
    free(out);
}

ebpo_status ebpo_check_output(const char *path, ebpo_error *error)
{
    ebpo_publish out;
    ebpo_status status = ebpo_publish_begin(&out, path, error);
    ebpo_publish_abort(&out);
    return status;
}

void ebpo_abandon_outputs(void)
{
    ebpo_unfinished_remove();
    ebpo_workspace_abandon();
}
