/* Provides sources of a file's bytes (ebpo_source): a regular file, which is read by pread, and
 * memory of the caller. http_source.c has the source for URLs. An input is a source with a name for
 * messages and a count of reads. Each read must be within the source's size. Files are not mapped,
 * because the process would end if another program shortened a mapped file.
 *
 * This file also recognises URLs, and removes passwords and queries from URLs for messages. */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ebpo/http.h>

#include "core/alloc.h"
#include "core/error.h"
#include "io/byte_source.h"

/* Maximum number of bytes for one call of pread. Some systems read no more than about 2 GiB. */
static const uint64_t CALL_BYTES_MAX = UINT64_C(1) << 30;

/* The source of a regular file. */
typedef struct path_source {
    int fd;
    char path[];
} path_source;

static ebpo_status path_read(void *user, uint64_t offset, uint64_t size, void *data,
                             ebpo_error *error)
{
    const path_source *s = user;
    uint8_t *to = data;
    while (size) {
        ssize_t received = pread(s->fd, to, (size_t)(size < CALL_BYTES_MAX ? size : CALL_BYTES_MAX),
                                 (off_t)offset);
        if (received < 0 && errno == EINTR)
            continue;
        if (received < 0)
            return ebpo_fail_errno(error, s->path, "cannot be read");
        if (received == 0)
            return ebpo_fail_at(
                error, EBPO_E_IO, s->path, "", (int64_t)offset,
                "byte %" PRIu64
                " cannot be read: the file became shorter while it was open; open it again",
                offset);
        to += received;
        offset += (uint64_t)received;
        size -= (uint64_t)received;
    }
    return EBPO_OK;
}

static void path_close(void *user)
{
    path_source *s = user;
    close(s->fd);
    free(s);
}

static ebpo_status fail_to_open(const char *path, ebpo_error *error)
{
    if (errno == ENOENT && strstr(path, "://"))
        return ebpo_fail_file(error, EBPO_E_IO, path,
                              "no such file; the only supported URLs are http:// and https://");
    return ebpo_fail_errno(error, path, "cannot be opened");
}

/* Opens a regular file and gets its size. The file is opened with O_NONBLOCK, so that the call does
 * not wait if the path is a pipe. */
static ebpo_status open_regular(const char *path, int *fd, uint64_t *size, ebpo_error *error)
{
    struct stat facts;
    ebpo_status status = EBPO_OK;
    *fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (*fd < 0)
        return fail_to_open(path, error);
    if (fstat(*fd, &facts) < 0)
        status = ebpo_fail_errno(error, path, "cannot be examined");
    else if (!S_ISREG(facts.st_mode)) {
        status = ebpo_fail_file(error, EBPO_E_IO, path, "not a regular file");
        if (error && S_ISDIR(facts.st_mode))
            error->system_error = EISDIR;
    } else
        *size = (uint64_t)facts.st_size;
    if (status != EBPO_OK)
        close(*fd);
    return status;
}

ebpo_status ebpo_source_of_path(ebpo_source *out, const char *path, ebpo_error *error)
{
    int fd;
    uint64_t size = 0;
    *out = (ebpo_source)EBPO_SOURCE_INIT;
    ebpo_status status = open_regular(path, &fd, &size, error);
    if (status != EBPO_OK)
        return status;
    path_source *s = ebpo_alloc(sizeof *s + strlen(path) + 1, 1);
    if (!s) {
        close(fd);
        return ebpo_fail_memory(error, sizeof *s + strlen(path) + 1);
    }
    s->fd = fd;
    strcpy(s->path, path);
    *out = (ebpo_source){ sizeof *out, s, size, path_read, path_close, NULL, 0 };
    return EBPO_OK;
}

int ebpo_input_descriptor(const ebpo_input *input)
{
    const path_source *s = input->source.user;
    return input->source.read == path_read && strcmp(s->path, input->shown) == 0 ? s->fd : -1;
}

bool ebpo_input_can_advise(const ebpo_input *input)
{
#ifdef POSIX_FADV_WILLNEED
    return input->source.read == path_read;
#else
    (void)input;
    return false;
#endif
}

void ebpo_input_advise(ebpo_input *input, const ebpo_range *ranges, size_t count)
{
    enum { LARGE = 1 << 20 }; /* bytes; within larger ranges, the system reads ahead by itself */
#ifdef POSIX_FADV_WILLNEED
    const path_source *s = input->source.user;
    for (size_t i = 0; i < count && ebpo_input_can_advise(input); i++)
        if (ranges[i].size < LARGE && ranges[i].offset <= input->source.size)
            (void)posix_fadvise(s->fd, (off_t)ranges[i].offset, (off_t)ranges[i].size,
                                POSIX_FADV_WILLNEED); /* reading reports errors */
#else
    (void)input;
    (void)ranges;
    (void)count;
#endif
}

static ebpo_status memory_read(void *user, uint64_t offset, uint64_t size, void *data,
                               ebpo_error *error)
{
    (void)error;
    memcpy(data, (const uint8_t *)user + offset, (size_t)size);
    return EBPO_OK;
}

ebpo_source ebpo_source_of_memory(const void *data, uint64_t size)
{
    /* the cast removes const, because the member `user` is not const; the source only reads */
    return (ebpo_source){
        sizeof(ebpo_source), (void *)(uintptr_t)data, size, memory_read, NULL, NULL, 0
    };
}

/* Returns the number of bytes at the beginning of the file that the source already had when the
 * input was opened. ebpo_input_open counts these bytes in input->bytes, so later reads do not count
 * them again. */
static uint64_t bytes_prefetched(const ebpo_input *input)
{
    return input->source.prefetched < input->source.size ? input->source.prefetched
                                                         : input->source.size;
}

ebpo_status ebpo_input_open(ebpo_input *input, const ebpo_source *source, const char *name,
                            ebpo_error *error)
{
    input->source = *source;
    input->shown = strdup(name);
    atomic_init(&input->bytes, bytes_prefetched(input));
    atomic_init(&input->reads, 0);
    if (input->shown)
        return EBPO_OK;
    ebpo_input_close(input);
    return ebpo_fail_memory(error, strlen(name) + 1);
}

void ebpo_input_close(ebpo_input *input)
{
    if (input->source.close)
        input->source.close(input->source.user);
    input->source = (ebpo_source)EBPO_SOURCE_INIT;
    free(input->shown);
    input->shown = NULL;
}

ebpo_status ebpo_input_read(ebpo_input *input, uint64_t offset, uint64_t size, void *data,
                            ebpo_error *error)
{
    ebpo_error cause = EBPO_ERROR_INIT;
    if (size == 0)
        return EBPO_OK;
    if (offset > input->source.size || size > input->source.size - offset)
        return ebpo_fail_at(error, EBPO_E_FORMAT, input->shown, "", (int64_t)offset,
                            "bytes %" PRIu64 " to %" PRIu64
                            " are needed, but the file ends at %" PRIu64
                            "; get a fresh copy of the file",
                            offset, offset + size - 1, input->source.size);
    uint64_t begin = offset > bytes_prefetched(input) ? offset : bytes_prefetched(input);
    ebpo_status status = input->source.read(input->source.user, offset, size, data, &cause);
    if (status !=
        EBPO_E_PENDING) { /* a pending read will be repeated; only the last attempt is counted */
        atomic_fetch_add_explicit(&input->bytes, offset + size > begin ? offset + size - begin : 0,
                                  memory_order_relaxed);
        atomic_fetch_add_explicit(&input->reads, 1, memory_order_relaxed);
    }
    if (status == EBPO_OK)
        return EBPO_OK;
    if (*cause.message) {
        cause.status = status; /* the caller's source may have set only the message */
        return ebpo_fail_with(error, &cause);
    }
    return ebpo_fail_at(error, status, input->shown, "", (int64_t)offset,
                        "bytes %" PRIu64 " to %" PRIu64 " could not be read", offset,
                        offset + size - 1);
}

void ebpo_input_prefetch(ebpo_input *input, const ebpo_range *ranges, size_t count)
{
    uint64_t size = input->source.size;
    if (!input->source.prefetch || count == 0)
        return;
    for (size_t i = 0; i < count; i++)
        if (ranges[i].offset > size || ranges[i].size > size - ranges[i].offset)
            return; /* the read reports the error */
    input->source.prefetch(input->source.user, ranges, count);
}

bool ebpo_is_url(const char *name)
{
    return strncasecmp(name, "http://", 7) == 0 || strncasecmp(name, "https://", 8) == 0;
}

/* Appends `text` to `out`, cut to the capacity. Returns the new length. */
static size_t append_text(char *out, size_t used, size_t capacity, const char *text, size_t length)
{
    size_t space = capacity - 1 - used, taken = length < space ? length : space;
    memcpy(out + used, text, taken);
    return used + taken;
}

char *ebpo_url_redact(const char *name, char *out, size_t capacity)
{
    size_t used = 0;
    if (capacity == 0)
        return out;
    if (ebpo_is_url(name)) {
        const char *host = strstr(name, "//") + 2;
        used = append_text(out, 0, capacity, name, (size_t)(host - name));
        for (size_t i = strcspn(host, "/?#"); i > 0; i--)
            /* A password ends at the last @. A password that contains an @ makes the URL invalid,
             * but must not be shown either. */
            if (host[i - 1] == '@') {
                host += i;
                break;
            }
        used = append_text(out, used, capacity, host, strcspn(host, "?#"));
    } else {
        used = append_text(out, 0, capacity, name, strlen(name));
    }
    out[used] = 0;
    return out;
}
