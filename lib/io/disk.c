#include "io/disk.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/sha256.h"

/* A block's file: magic, block number, size, SHA-256 of these three and the bytes, the bytes. */
enum { MAGIC_BYTES = 8, DIGEST_AT = 24, HEAD_BYTES = 56, NAME_BYTES = 128 };
static const char MAGIC[MAGIC_BYTES + 1] = "EBPOBLK2", SUFFIX[] = ".ebpo-block",
                                      TEMPORARY[] = ".ebpo-part-";
static const double STALE_SECONDS = 3600; /* a temporary file that old has lost its writer */

struct ebpo_disk {
    int folder;
    uint64_t limit;
    char key[65];
    pthread_mutex_t lock;
    uint64_t written; /* since the folder was last scanned */
    uint64_t number;  /* for temporary names */
    uint64_t held, others;
};

static void digest(const uint8_t head[DIGEST_AT], const void *data, size_t size, uint8_t out[32])
{
    ebpo_sha256 sha;
    ebpo_sha256_begin(&sha);
    ebpo_sha256_add(&sha, head, DIGEST_AT);
    ebpo_sha256_add(&sha, data, size);
    ebpo_sha256_end(&sha, out);
}

/* Blocks of the usual size are named as they always were. */
static void make_key(ebpo_disk *d, size_t block, const char *url, const ebpo_http_version *v)
{
    uint8_t size[8], of_block[8], out[32];
    ebpo_store64(of_block, block);
    ebpo_sha256 sha;
    ebpo_store64(size, v->size);
    ebpo_sha256_begin(&sha);
    ebpo_sha256_add(&sha, url, strlen(url) + 1);
    ebpo_sha256_add(&sha, v->etag, strlen(v->etag) + 1);
    ebpo_sha256_add(&sha, v->modified, strlen(v->modified) + 1);
    ebpo_sha256_add(&sha, size, sizeof size);
    if (block != EBPO_DISK_BLOCK)
        ebpo_sha256_add(&sha, of_block, sizeof of_block);
    ebpo_sha256_end(&sha, out);
    ebpo_sha256_hex(out, d->key);
}

/* --- making room --- */

typedef struct entry {
    struct timespec used;
    uint64_t bytes;
    char name[NAME_BYTES];
} entry;

static bool ends_with(const char *name, const char *end)
{
    size_t n = strlen(name), e = strlen(end);
    return n >= e && strcmp(name + n - e, end) == 0;
}

static int older(const void *a, const void *b)
{
    const struct timespec *x = &((const entry *)a)->used, *y = &((const entry *)b)->used;
    if (x->tv_sec != y->tv_sec)
        return x->tv_sec < y->tv_sec ? -1 : 1;
    return x->tv_nsec < y->tv_nsec ? -1 : x->tv_nsec > y->tv_nsec;
}

/* Our files in the folder, and no others. */
static entry *list(const ebpo_disk *d, uint64_t *count, uint64_t *bytes)
{
    entry *entries = NULL;
    uint64_t capacity = 0;
    int fd = openat(d->folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *folder = fd < 0 ? NULL : fdopendir(fd);
    *count = *bytes = 0;
    if (!folder && fd >= 0)
        close(fd);
    for (struct dirent *f; folder && (f = readdir(folder)) != NULL;) {
        struct stat st;
        bool block = ends_with(f->d_name, SUFFIX),
             part = strncmp(f->d_name, TEMPORARY, sizeof TEMPORARY - 1) == 0;
        if ((!block && !part) || strlen(f->d_name) >= NAME_BYTES ||
            fstatat(d->folder, f->d_name, &st, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(st.st_mode))
            continue;
        if (part) {
            if (difftime(time(NULL), st.st_mtime) > STALE_SECONDS)
                unlinkat(d->folder, f->d_name, 0);
            continue;
        }
        if (!ebpo_grow(&entries, &capacity, *count + 1, sizeof *entries))
            break;
        entry *e = &entries[(*count)++];
        e->used = st.st_mtim;
        e->bytes = (uint64_t)st.st_size;
        strcpy(e->name, f->d_name);
        *bytes += e->bytes;
    }
    if (folder)
        closedir(folder);
    return entries;
}

static void count_held(ebpo_disk *d)
{
    uint64_t count, bytes;
    entry *entries = list(d, &count, &bytes);
    for (uint64_t i = 0; i < count; i++) {
        uint64_t own = entries[i].bytes > HEAD_BYTES ? entries[i].bytes - HEAD_BYTES : 0;
        *(strncmp(entries[i].name, d->key, sizeof d->key - 1) == 0 ? &d->held : &d->others) += own;
    }
    free(entries);
}

void ebpo_disk_held(const ebpo_disk *d, uint64_t *held, uint64_t *others)
{
    *held = d->held;
    *others = d->others;
}

/* Done after each eighth of the limit that is written, so one process alone stays below it. */
static void trim(ebpo_disk *d)
{
    uint64_t count, bytes;
    entry *entries = list(d, &count, &bytes);
    if (bytes > d->limit / 8 * 7) {
        qsort(entries, count, sizeof *entries, older);
        for (uint64_t i = 0; i < count && bytes > d->limit / 4 * 3; i++)
            if (unlinkat(d->folder, entries[i].name, 0) == 0)
                bytes -= entries[i].bytes;
    }
    free(entries);
}

/* --- opening --- */

static bool writable(int folder)
{
    char name[NAME_BYTES];
    snprintf(name, sizeof name, "%s%ld-try", TEMPORARY, (long)getpid());
    int fd = openat(folder, name, O_CREAT | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0)
        return false;
    close(fd);
    unlinkat(folder, name, 0);
    return true;
}

/* With those above it that are missing. */
static bool make_folder(const char *folder)
{
    char path[PATH_MAX];
    size_t length = strlen(folder);
    if (length >= sizeof path) {
        errno = ENAMETOOLONG;
        return false;
    }
    memcpy(path, folder, length + 1);
    for (char *slash = strchr(path + 1, '/'); length && slash; slash = strchr(slash + 1, '/')) {
        *slash = 0;
        (void)mkdir(path, 0777); /* if that does not work, the next one tells */
        *slash = '/';
    }
    return mkdir(path, 0777) == 0 || errno == EEXIST;
}

ebpo_status ebpo_disk_open(ebpo_disk **out, const char *folder, uint64_t bytes, size_t block,
                           const char *url, const ebpo_http_version *version, ebpo_error *error)
{
    *out = NULL;
    int fd = make_folder(folder) ? open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
    if (fd < 0 || !writable(fd)) {
        /* another folder does not help a process that has too many files open */
        bool folders = errno != EMFILE && errno != ENFILE && errno != ENOMEM;
        ebpo_status status = ebpo_fail_file(error, folders ? EBPO_E_ARGUMENT : EBPO_E_IO, folder,
                                            "cannot be used as a cache folder: %s%s",
                                            strerror(errno), folders ? "; give another one" : "");
        if (fd >= 0)
            close(fd);
        return status;
    }
    ebpo_disk *d = ebpo_alloc_zero(1, sizeof *d);
    if (!d) {
        close(fd);
        return ebpo_fail_memory(error, sizeof *d);
    }
    d->folder = fd;
    d->limit = bytes;
    pthread_mutex_init(&d->lock, NULL);
    make_key(d, block, url, version);
    trim(d);
    count_held(d);
    *out = d;
    return EBPO_OK;
}

void ebpo_disk_close(ebpo_disk *d)
{
    if (!d)
        return;
    if (d->written)
        trim(d);
    close(d->folder);
    pthread_mutex_destroy(&d->lock);
    free(d);
}

/* --- blocks --- */

static void block_name(const ebpo_disk *d, uint64_t block, char name[NAME_BYTES])
{
    snprintf(name, NAME_BYTES, "%s-%" PRIx64 "%s", d->key, block, SUFFIX);
}

static bool read_fully(int fd, void *data, size_t size)
{
    uint8_t *to = data;
    while (size) {
        ssize_t got = read(fd, to, size);
        if (got <= 0 && !(got < 0 && errno == EINTR))
            return false;
        if (got > 0) {
            to += got;
            size -= (size_t)got;
        }
    }
    return true;
}

static bool write_fully(int fd, const void *data, size_t size)
{
    const uint8_t *from = data;
    while (size) {
        ssize_t put = write(fd, from, size);
        if (put < 0 && errno != EINTR)
            return false;
        if (put > 0) {
            from += put;
            size -= (size_t)put;
        }
    }
    return true;
}

bool ebpo_disk_get(ebpo_disk *d, uint64_t block, void *data, size_t size)
{
    char name[NAME_BYTES];
    uint8_t head[HEAD_BYTES], sum[32], more;
    block_name(d, block, name);
    int fd = openat(d->folder, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0)
        return false;
    bool good = read_fully(fd, head, sizeof head) && memcmp(head, MAGIC, MAGIC_BYTES) == 0 &&
                ebpo_load64(head + 8) == block && ebpo_load64(head + 16) == size &&
                read_fully(fd, data, size) && read(fd, &more, 1) == 0;
    if (good) {
        digest(head, data, size, sum);
        good = memcmp(sum, head + DIGEST_AT, sizeof sum) == 0;
    }
    if (good)
        (void)!futimens(fd, NULL); /* used now; a folder that is read only by now does no harm */
    close(fd);
    if (!good)
        unlinkat(d->folder, name, 0);
    return good;
}

void ebpo_disk_put(ebpo_disk *d, uint64_t block, const void *data, size_t size)
{
    char name[NAME_BYTES], temporary[NAME_BYTES];
    uint8_t head[HEAD_BYTES];
    pthread_mutex_lock(&d->lock);
    uint64_t number = d->number++;
    pthread_mutex_unlock(&d->lock);
    block_name(d, block, name);
    snprintf(temporary, sizeof temporary, "%s%.16s-%ld-%p-%" PRIu64, TEMPORARY, d->key,
             (long)getpid(), (void *)d, number);
    memcpy(head, MAGIC, MAGIC_BYTES);
    ebpo_store64(head + 8, block);
    ebpo_store64(head + 16, size);
    digest(head, data, size, head + DIGEST_AT);
    int fd =
        openat(d->folder, temporary, O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (fd < 0)
        return;
    bool good = write_fully(fd, head, sizeof head) && write_fully(fd, data, size);
    good = close(fd) == 0 && good;
    if (!good || renameat(d->folder, temporary, d->folder, name) != 0) {
        unlinkat(d->folder, temporary, 0);
        return;
    }
    pthread_mutex_lock(&d->lock);
    d->written += size + HEAD_BYTES;
    bool full = d->written > d->limit / 8;
    if (full)
        d->written = 0;
    pthread_mutex_unlock(&d->lock);
    if (full)
        trim(d);
}
