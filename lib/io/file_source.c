#include "io/file_source.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/arrays.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"

enum { PIECE = 1 << 22, FRESH_NS = 100000000 };

/* Less than 0.1 s ago, or in times to come: the system's times go in steps of some milliseconds. */
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
    /* non-blocking: a pipe must not hang us */
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
        ssize_t got = pread(file->fd, next, bytes < PIECE ? (size_t)bytes : PIECE, (off_t)at);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            return ebpo_fail_errno(error, path, "cannot be read");
        if (got == 0)
            return ebpo_fail_file(error, EBPO_E_IO, path,
                                  "became shorter while it was read; read it again");
        next += got;
        at += (uint64_t)got;
        bytes -= (uint64_t)got;
    }
    return EBPO_OK;
}

typedef struct loading {
    const ebpo_whole_file *file;
    uint8_t *to;
    const char *path;
} loading;

static ebpo_status load_piece(void *context, uint64_t begin, uint64_t end, unsigned worker,
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
                              "has %" PRIu64 " bytes, more than a program of %d bits can hold in "
                              "one piece; read it with one of 64 bits",
                              file->size, (int)sizeof(size_t) * CHAR_BIT);
    file->workspace = workspace;
    file->buffer = ebpo_array_alloc(workspace, file->size, 1);
    if (!file->buffer)
        return ebpo_workspace_fail(workspace, file->size, error);
    loading l = { file, file->buffer, path };
    file->data = file->buffer;
    return ebpo_parallel_for(threads, workspace, file->size, PIECE, load_piece, &l, progress,
                             "reading", error);
}

/* Whether it still says what was loaded. */
static ebpo_status compare(const ebpo_whole_file *file, const char *path, bool *same,
                           ebpo_error *error)
{
    enum { STEP = 1 << 16 };
    ebpo_status status = EBPO_OK;
    uint8_t *now = ebpo_alloc(STEP, 1);
    if (!now)
        return ebpo_fail_memory(error, STEP);
    *same = true;
    EBPO_FOR_ITEMS_EVERY(file->workspace, 64, step, 0, (file->size + STEP - 1) / STEP) {
        uint64_t at = step * STEP, left = file->size - at;
        size_t bytes = left < STEP ? (size_t)left : STEP;
        status = ebpo_whole_file_read(file, at, now, bytes, path, error);
        *same = status == EBPO_OK && memcmp(now, file->data + at, bytes) == 0;
        if (!*same)
            break;
    }
    free(now);
    return status;
}

ebpo_status ebpo_whole_file_unchanged(const ebpo_whole_file *file, const char *path,
                                      ebpo_error *error)
{
    struct stat st;
    if (fstat(file->fd, &st) != 0)
        return ebpo_fail_errno(error, path, "cannot be examined");
    bool same = (uint64_t)st.st_size == file->size && st.st_mtim.tv_sec == file->mtime_s &&
                st.st_mtim.tv_nsec == file->mtime_ns;
    bool doubtful =
        file->fresh || st.st_ctim.tv_sec != file->ctime_s || st.st_ctim.tv_nsec != file->ctime_ns;
    ebpo_status status =
        same && doubtful && file->data ? compare(file, path, &same, error) : EBPO_OK;
    if (status == EBPO_OK && !same)
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
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

ebpo_status ebpo_target_path(const char *path, char **out, ebpo_error *error)
{
    const char *name = ebpo_path_name(path);
    *out = NULL;
    if (!*name)
        return ebpo_fail_file(error, EBPO_E_IO, path, "names no file; give the output a file name");
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
