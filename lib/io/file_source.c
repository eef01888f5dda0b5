#include "io/file_source.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/error.h"

static ebpo_status read_whole(ebpo_whole_file *file, const char *path, ebpo_error *error)
{
    uint8_t *buffer = ebpo_alloc(file->size, 1);
    if (!buffer)
        return ebpo_fail_memory(error, file->size);
    file->buffer = buffer;
    file->data = buffer;
    uint64_t at = 0;
    while (at < file->size) {
        size_t piece = file->size - at < (1u << 30) ? (size_t)(file->size - at) : (1u << 30);
        ssize_t got = read(file->fd, buffer + at, piece);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            return ebpo_fail_errno(error, path, "cannot be read");
        if (got == 0)
            return ebpo_fail_file(error, EBPO_E_IO, path,
                                  "became shorter while it was read; read it again");
        at += (uint64_t)got;
    }
    return EBPO_OK;
}

static ebpo_status map_or_read(ebpo_whole_file *file, const char *path, ebpo_error *error)
{
    if (file->size == 0) {
        file->data = (const uint8_t *)"";
        return EBPO_OK;
    }
    if (file->size > (uint64_t)PTRDIFF_MAX)
        return ebpo_fail_file(error, EBPO_E_LIMIT, path, "too large for this machine's addresses");
    void *mapped = mmap(NULL, (size_t)file->size, PROT_READ, MAP_PRIVATE, file->fd, 0);
    if (mapped == MAP_FAILED)
        return read_whole(file, path, error);
    file->mapped = mapped;
    file->data = mapped;
    return EBPO_OK;
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
    ebpo_status status;
    struct stat st;
    file.fd = fd;
    if (fstat(file.fd, &st) != 0) {
        status = ebpo_fail_errno(error, path, "cannot be examined");
        goto done;
    }
    if (!S_ISREG(st.st_mode)) {
        status = ebpo_fail_file(error, EBPO_E_IO, path, "%s; name a regular file",
                                S_ISDIR(st.st_mode) ? "is a folder" : "is a pipe or device");
        goto done;
    }
    file.size = (uint64_t)st.st_size;
    file.mtime_s = st.st_mtim.tv_sec;
    file.mtime_ns = st.st_mtim.tv_nsec;
    status = map_or_read(&file, path, error);
done:
    if (status != EBPO_OK)
        ebpo_whole_file_close(&file);
    *out = file;
    return status;
}

ebpo_status ebpo_whole_file_unchanged(const ebpo_whole_file *file, const char *path,
                                      ebpo_error *error)
{
    struct stat st;
    if (fstat(file->fd, &st) != 0)
        return ebpo_fail_errno(error, path, "cannot be examined");
    if ((uint64_t)st.st_size != file->size || st.st_mtim.tv_sec != file->mtime_s ||
        st.st_mtim.tv_nsec != file->mtime_ns)
        return ebpo_fail_file(error, EBPO_E_IO, path,
                              "was changed while it was read; read it again");
    return EBPO_OK;
}

void ebpo_whole_file_close(ebpo_whole_file *file)
{
    if (file->mapped)
        munmap(file->mapped, (size_t)file->size);
    free(file->buffer);
    if (file->fd >= 0)
        close(file->fd);
    *file = (ebpo_whole_file)EBPO_WHOLE_FILE_INIT;
}

const char *ebpo_path_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}
