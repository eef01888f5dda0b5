/* Reads complete files (meshes, images, scenes) into memory or a workspace. A file that changes
 * while it is read is rejected. The size and the times of the file show a change. If the times are
 * not reliable, the bytes are compared. If the name of a file comes from another file, it is opened
 * only below a given folder, with one system call (openat2) if available. Files of other kinds are
 * recognised by their first bytes, and the message gives a remedy. */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/os.h"
#include "core/parallel.h"
#include "core/text.h"
#include "core/workspace.h"
#include "io/file_source.h"

enum {
    READ_BYTES = 1 << 22, /* greatest number of bytes of one read */
    FRESH_NS = 100000000  /* see is_fresh */
};

/* Returns true if the last change was less than 0.1 s ago, or has a time in the future. Then a
 * further change may get the same file time, because file times have steps of some milliseconds. */
static bool is_fresh(const struct stat *st)
{
    struct timespec now;
    if (clock_gettime(CLOCK_REALTIME, &now) != 0)
        return true;
    int64_t seconds = (int64_t)now.tv_sec - st->st_ctim.tv_sec;
    return seconds < 0 ||
           (seconds <= 1 && seconds * 1000000000 + now.tv_nsec - st->st_ctim.tv_nsec < FRESH_NS);
}

ebpo_status ebpo_whole_file_open(ebpo_whole_file *out, const char *path, ebpo_error *error)
{
    *out = (ebpo_whole_file)EBPO_WHOLE_FILE_INIT;
    /* O_NONBLOCK: opening a pipe must not wait */
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd < 0)
        return ebpo_fail_errno(error, path, "cannot be opened for reading");
    return ebpo_whole_file_take(out, fd, path, error);
}

ebpo_status ebpo_whole_file_take(ebpo_whole_file *out, int fd, const char *path, ebpo_error *error)
{
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    ebpo_status status = EBPO_OK;
    struct stat st;
    file.fd = fd;
    if (fstat(file.fd, &st) != 0)
        status = ebpo_fail_errno(error, path, "cannot be examined");
    else if (!S_ISREG(st.st_mode))
        status = ebpo_fail_file(error, EBPO_E_IO, path, "%s; name a regular file",
                                S_ISDIR(st.st_mode) ? "is a folder" : "is a pipe or device");
    else
        file = (ebpo_whole_file){ .fd = fd,
                                  .size = (uint64_t)st.st_size,
                                  .mtime_s = st.st_mtim.tv_sec,
                                  .mtime_ns = st.st_mtim.tv_nsec,
                                  .ctime_s = st.st_ctim.tv_sec,
                                  .ctime_ns = st.st_ctim.tv_nsec,
                                  .fresh = is_fresh(&st) };
    if (status != EBPO_OK)
        ebpo_whole_file_close(&file);
    *out = file;
    return status;
}

ebpo_status ebpo_whole_file_read(const ebpo_whole_file *file, uint64_t at, void *to, uint64_t bytes,
                                 const char *path, ebpo_error *error)
{
    uint8_t *next = to;
    while (bytes) {
        ssize_t received =
            pread(file->fd, next, bytes < READ_BYTES ? (size_t)bytes : READ_BYTES, (off_t)at);
        if (received < 0 && errno == EINTR)
            continue;
        if (received < 0)
            return ebpo_fail_errno(error, path, "cannot be read");
        if (received == 0)
            return ebpo_fail_file(error, EBPO_E_IO, path,
                                  "became shorter while it was read; read it again");
        next += received;
        at += (uint64_t)received;
        bytes -= (uint64_t)received;
    }
    return EBPO_OK;
}

/* A file that several threads read. */
typedef struct loading {
    const ebpo_whole_file *file;
    uint8_t *to;
    const char *path;
} loading;

static ebpo_status load_range(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    const loading *l = context;
    (void)worker;
    return ebpo_whole_file_read(l->file, begin, l->to + begin, end - begin, l->path, error);
}

ebpo_status ebpo_whole_file_load(ebpo_whole_file *file, ebpo_workspace *workspace, unsigned threads,
                                 const ebpo_progress *progress, const char *path, ebpo_error *error)
{
    file->data = (const uint8_t *)"";
    if (file->size == 0)
        return EBPO_OK;
    if (file->size > PTRDIFF_MAX)
        return ebpo_fail_file(error, EBPO_E_LIMIT, path,
                              "the file has %" PRIu64 " bytes, more than a %d-bit program can hold "
                              "in memory; use a 64-bit program",
                              file->size, (int)sizeof(size_t) * CHAR_BIT);
    file->workspace = workspace;
    file->buffer = ebpo_array_alloc(workspace, file->size, 1);
    if (!file->buffer)
        return ebpo_workspace_fail(workspace, file->size, error);
    loading l = { file, file->buffer, path };
    file->data = file->buffer;
    return ebpo_parallel_for(threads, workspace, file->size, READ_BYTES, load_range, &l, progress,
                             "reading", error);
}

/* Compares the file's current content with the loaded bytes, and sets *equal to the result. */
static ebpo_status compare_bytes(const ebpo_whole_file *file, const char *path, bool *equal,
                                 ebpo_error *error)
{
    enum { STEP = 1 << 16 };
    ebpo_status status = EBPO_OK;
    uint8_t *current = ebpo_alloc(STEP, 1);
    if (!current)
        return ebpo_fail_memory(error, STEP);
    *equal = true;
    EBPO_FOR_ITEMS_EVERY(file->workspace, 64, step, 0, (file->size + STEP - 1) / STEP) {
        uint64_t at = step * STEP, remaining = file->size - at;
        size_t bytes = remaining < STEP ? (size_t)remaining : STEP;
        status = ebpo_whole_file_read(file, at, current, bytes, path, error);
        *equal = status == EBPO_OK && memcmp(current, file->data + at, bytes) == 0;
        if (!*equal)
            break;
    }
    free(current);
    return status;
}

ebpo_status ebpo_whole_file_unchanged(const ebpo_whole_file *file, const char *path,
                                      ebpo_error *error)
{
    struct stat st;
    if (fstat(file->fd, &st) != 0)
        return ebpo_fail_errno(error, path, "cannot be examined");
    bool equal = (uint64_t)st.st_size == file->size && st.st_mtim.tv_sec == file->mtime_s &&
                 st.st_mtim.tv_nsec == file->mtime_ns;
    /* true: the file may have changed although the modification time is equal */
    bool doubtful =
        file->fresh || st.st_ctim.tv_sec != file->ctime_s || st.st_ctim.tv_nsec != file->ctime_ns;
    ebpo_status status =
        equal && doubtful && file->data ? compare_bytes(file, path, &equal, error) : EBPO_OK;
    if (status == EBPO_OK && !equal)
        return ebpo_fail_file(error, EBPO_E_IO, path,
                              "was changed while it was read; read it again");
    return status;
}

void ebpo_whole_file_close(ebpo_whole_file *file)
{
    ebpo_array_free(file->workspace, file->buffer);
    if (file->fd >= 0)
        close(file->fd);
    *file = (ebpo_whole_file)EBPO_WHOLE_FILE_INIT;
}

const char *ebpo_path_name(const char *path)
{
    const char *last = ebpo_last_separator(path);
    return last ? last + 1 : path;
}

ebpo_status ebpo_target_path(const char *path, char **out, ebpo_error *error)
{
    const char *name = ebpo_path_name(path);
    *out = NULL;
    if (!*name)
        return ebpo_fail_file(error, EBPO_E_IO, path,
                              "the path ends with '/'; name a file for the output");
    char *folder = strndup(path, (size_t)(name - path));
    if (!folder)
        return ebpo_fail_memory(error, strlen(path));
    char *real = realpath(*folder ? folder : ".", NULL);
    free(folder);
    if (!real)
        return ebpo_fail_errno(error, path, "the folder of the output cannot be used");
    bool made = asprintf(out, "%s/%s", real[1] ? real : "", name) >= 0;
    free(real);
    if (made)
        return EBPO_OK;
    *out = NULL;
    return ebpo_fail_memory(error, strlen(path));
}

#ifdef EBPO_HAVE_OPENAT2
#include <linux/openat2.h>
#include <sys/syscall.h>
#endif

enum { FLAGS = O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY };

/* Opens the file `name` below the folder `top` with openat2. *fd: descriptor, or -1 with errno.
 * Returns false if the system does not have this call, or a filter of system calls forbids it. */
static bool open_at_once(int top, const char *name, int *fd)
{
#ifdef EBPO_HAVE_OPENAT2
    struct open_how how = { .flags = FLAGS, .resolve = RESOLVE_BENEATH | RESOLVE_NO_MAGICLINKS };
    *fd = (int)syscall(SYS_openat2, top, name, &how, sizeof how);
    return *fd >= 0 || (errno != ENOSYS && errno != EPERM && errno != EINVAL && errno != E2BIG);
#else
    (void)top, (void)name, (void)fd;
    return false;
#endif
}

/* Opens the folders of the path `name`, which begins in the folder `top`, one after the other. Then
 * opens the file. Does not follow links. Returns a descriptor, or -1 with errno. Changes `name`. */
static int open_folder_by_folder(int top, char *name)
{
    char *remaining = NULL, *word = strtok_r(name, "/", &remaining), *next;
    int folder = dup(top), fd = -1;
    if (!word || folder < 0) {
        errno = word ? errno : ENOENT;
        return -1;
    }
    for (; folder >= 0 && (next = strtok_r(NULL, "/", &remaining)); word = next) {
        int below = strcmp(word, "..") == 0
                        ? (errno = EXDEV, -1)
                        : openat(folder, word, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        int saved_errno = errno;
        close(folder);
        errno = saved_errno;
        folder = below;
    }
    if (folder >= 0) {
        fd = strcmp(word, "..") == 0 ? (errno = EXDEV, -1)
                                     : openat(folder, word, FLAGS | O_NOFOLLOW);
        int saved_errno = errno;
        close(folder);
        errno = fd < 0 && saved_errno == ELOOP ? EXDEV : saved_errno;
    }
    return fd;
}

int ebpo_open_below(const char *folder, const char *name)
{
    int top = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC), fd = -1;
    if (top < 0)
        return -1;
    if (!open_at_once(top, name, &fd)) {
        char *copy = strdup(name);
        fd = copy ? open_folder_by_folder(top, copy) : -1;
        int saved_errno = copy ? errno : ENOMEM;
        free(copy);
        errno = saved_errno;
    }
    int saved_errno = errno;
    close(top);
    errno = saved_errno;
    return fd;
}

/* Number of bytes that ebpo_bytes_are_text checks. */
enum { CHECKED_BYTES = 512 };

/* Kinds of files that are recognised by their first bytes. */
static const struct {
    const char *bytes;
    size_t count;     /* number of these bytes */
    const char *what; /* text of a message */
} kinds[] = {
    { "version https://git-lfs.github.com/spec/", 40,
      "is a Git LFS pointer, not the file itself; fetch the file: git lfs pull" },
    { "\xff\xfe\0\0", 4, "is text of four bytes a character (UTF-32); save it as UTF-8" },
    { "\0\0\xfe\xff", 4, "is text of four bytes a character (UTF-32); save it as UTF-8" },
    { "\xff\xfe", 2, "is text of two bytes a character (UTF-16); save it as UTF-8" },
    { "\xfe\xff", 2, "is text of two bytes a character (UTF-16); save it as UTF-8" },
    { "\x1f\x8b", 2, "is compressed by gzip; decompress it: gunzip <FILE >NEW" },
    { "BZh", 3, "is compressed by bzip2; decompress it: bunzip2 <FILE >NEW" },
    { "\xfd\x37zXZ\0", 6, "is compressed by xz; decompress it: unxz <FILE >NEW" },
    { "\x28\xb5\x2f\xfd", 4, "is compressed by zstd; decompress it: unzstd <FILE >NEW" },
    { "7z\xbc\xaf\x27\x1c", 6, "is a 7z archive; extract the file from it: 7z x" },
    { "PK\3\4", 4,
      "is a ZIP archive, as 3MF and NPZ files are; extract the file from it (unzip), or save the "
      "mesh as PLY, OBJ, STL or OFF" },
    { "\211HDF\r\n\032\n", 8,
      "is an HDF5 file; if it is an .ebpo.h5 file, 'ebpo extract --mesh' writes the mesh as PLY" },
    { "glTF", 4, "is a glTF file; save the mesh as PLY, OBJ, STL or OFF" },
};

/* Returns true for UTF-16 text without a byte order mark: every second byte is zero. */
static bool is_wide(const uint8_t *data, uint64_t size)
{
    enum { CHARACTERS = 8 };
    if (size < 2 * CHARACTERS)
        return false;
    for (int first = 0; first < 2; first++) {
        int good = 0;
        for (int i = 0; i < CHARACTERS; i++) {
            uint8_t c = data[2 * i + first];
            good +=
                data[2 * i + 1 - first] == 0 && c < 0x7f && (c >= ' ' || (c >= '\t' && c <= '\r'));
        }
        if (good == CHARACTERS)
            return true;
    }
    return false;
}

static bool begins_with(const char *text, uint64_t size, const char *word)
{
    size_t n = strlen(word);
    return size >= n && strncasecmp(text, word, n) == 0;
}

/* Recognises HTML and XML; white space may precede them. Returns a description and a remedy, or
 * NULL. */
static const char *find_markup(const char *text, uint64_t size)
{
    for (; size && (*text == ' ' || (*text >= '\t' && *text <= '\r')); size--)
        text++;
    if (begins_with(text, size, "<!doctype html") || begins_with(text, size, "<html") ||
        begins_with(text, size, "<head"))
        return "is an HTML page, as servers send it for errors and logins; download the file "
               "itself";
    return begins_with(text, size, "<?xml")
               ? "is an XML file; save the mesh as PLY, OBJ, STL or OFF"
               : NULL;
}

const char *ebpo_wrong_kind_of_file(const uint8_t *data, uint64_t size)
{
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (size >= kinds[i].count && memcmp(data, kinds[i].bytes, kinds[i].count) == 0)
            return kinds[i].what;
    if (is_wide(data, size))
        return "is text of two bytes a character (UTF-16); save it as UTF-8";
    uint64_t bom = ebpo_text_bom_length(data, size);
    return find_markup((const char *)data + bom, size - bom);
}

bool ebpo_bytes_are_text(const uint8_t *data, uint64_t size)
{
    for (uint64_t i = 0; i < size && i < CHECKED_BYTES; i++)
        if (data[i] == 0x7f || (data[i] < ' ' && !(data[i] >= '\t' && data[i] <= '\r')))
            return false;
    return size > 0;
}
