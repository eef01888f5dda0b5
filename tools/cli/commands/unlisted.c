/* Opens a file without its lists of chunks. The lists state the length of their file, and the
 * library ignores them in a file of another length. So the file is read as if it were one byte
 * longer. */
#include "cli/commands/unlisted.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* A file that appears to be one byte longer, see unlisted.h. */
typedef struct longer_source {
    int fd;
    uint64_t size; /* size of the file; the source has one more byte */
    const char *path;
} longer_source;

static ebpo_status fail_path(const char *path, ebpo_error *error)
{
    snprintf(error->message, sizeof error->message, "%s: %s", path, strerror(errno));
    return error->status = EBPO_E_IO;
}

static ebpo_status read_longer(void *user, uint64_t offset, uint64_t size, void *data,
                               ebpo_error *error)
{
    const longer_source *l = user;
    uint64_t end = offset + size < l->size ? offset + size : l->size;
    uint8_t *to = data;
    memset(to, 0, size);
    while (offset < end) {
        ssize_t read_bytes = pread(l->fd, to, end - offset, (off_t)offset);
        if (read_bytes < 0 && errno == EINTR)
            continue;
        if (read_bytes == 0)
            errno = EIO; /* the file was truncated meanwhile */
        if (read_bytes <= 0)
            return fail_path(l->path, error);
        to += read_bytes;
        offset += (uint64_t)read_bytes;
    }
    return EBPO_OK;
}

static void close_longer(void *user)
{
    longer_source *l = user;
    close(l->fd);
    free(l);
}

ebpo_status unlisted_open(const char *path, uint64_t max_expansion, ebpo_file **out,
                          ebpo_error *error)
{
    ebpo_open_options options = EBPO_OPEN_OPTIONS_INIT;
    ebpo_source source = EBPO_SOURCE_INIT;
    struct stat st;
    *out = NULL;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    longer_source *l =
        fd >= 0 && fstat(fd, &st) == 0 && S_ISREG(st.st_mode) ? malloc(sizeof *l) : NULL;
    if (!l) {
        ebpo_status status = fail_path(path, error);
        if (fd >= 0)
            close(fd);
        return status;
    }
    *l = (longer_source){ fd, (uint64_t)st.st_size, path };
    source.user = l;
    source.size = l->size + 1;
    source.read = read_longer;
    source.close = close_longer;
    options.max_expansion = max_expansion;
    options.source = &source;
    return ebpo_open_with(path, &options, out, error);
}
