#include "io/open_below.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifdef EBPO_HAVE_OPENAT2
#include <linux/openat2.h>
#include <sys/syscall.h>
#endif

enum { FLAGS = O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY };

/* False: the system has no such call, or a filter forbids it. */
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

/* Word by word, from folder to folder. */
static int walk(int top, char *name)
{
    char *left = NULL, *word = strtok_r(name, "/", &left), *next;
    int folder = dup(top), fd = -1;
    if (!word || folder < 0) {
        errno = word ? errno : ENOENT;
        return -1;
    }
    for (; folder >= 0 && (next = strtok_r(NULL, "/", &left)); word = next) {
        int below = strcmp(word, "..") == 0
                        ? (errno = EXDEV, -1)
                        : openat(folder, word, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        int why = errno;
        close(folder);
        errno = why;
        folder = below;
    }
    if (folder >= 0) {
        fd = strcmp(word, "..") == 0 ? (errno = EXDEV, -1)
                                     : openat(folder, word, FLAGS | O_NOFOLLOW);
        int why = errno;
        close(folder);
        errno = fd < 0 && why == ELOOP ? EXDEV : why;
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
        fd = copy ? walk(top, copy) : -1;
        int why = copy ? errno : ENOMEM;
        free(copy);
        errno = why;
    }
    int why = errno;
    close(top);
    errno = why;
    return fd;
}
