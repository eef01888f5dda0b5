/* Makes unnamed temporary files. On systems that cannot make a file without a name, the file has a
 * name for a moment. This name is stored before the file exists, so that a signal handler can
 * remove the file. Only one of these files has a name at a time. */
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <unistd.h>

#include "core/os.h"

enum { PATH_BYTES = 4096 + 64 }; /* space for the longest path of a folder, and a file name in it */

/* The path of the file that has a name at this moment, for ebpo_workspace_abandon in a signal
 * handler. A thread takes the lock before the file exists, and releases it after the name is
 * removed. */
static pthread_mutex_t named_lock = PTHREAD_MUTEX_INITIALIZER;
static atomic_bool is_named;
static char named[PATH_BYTES];

void ebpo_workspace_abandon(void)
{
    int saved = errno;
    if (atomic_load(&is_named))
        unlink(named);
    errno = saved;
}

/* Creates a file and removes its name at once. */
static int open_and_unlink(const char *folder)
{
    static unsigned counter;
    int fd = -1;
    pthread_mutex_lock(&named_lock);
    for (int attempt = 0; attempt < 100 && fd < 0; attempt++) {
        snprintf(named, sizeof named, "%s/.ebpo-%ld-%u.tmp", folder, (long)getpid(), counter++);
        /* set before the file exists, so that a signal never leaves the file behind */
        atomic_store(&is_named, true);
        fd = open(named, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
        if (fd >= 0)
            unlink(named);
        atomic_store(&is_named, false);
        if (fd < 0 && errno != EEXIST)
            break;
    }
    int fault = errno;
    pthread_mutex_unlock(&named_lock);
    errno = fault;
    return fd;
}

int ebpo_open_unnamed(const char *folder)
{
#ifdef EBPO_HAVE_O_TMPFILE
    int fd = open(folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (fd >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL))
        return fd;
#endif
    return open_and_unlink(folder);
}
