/* Unnamed temporary files. Where the system cannot make them without a name, they have one for a
 * moment: it is recorded before the file exists, so that a signal handler can remove it. One file
 * at a time. */
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <unistd.h>

#include "core/os.h"

enum { PATH_BYTES = 4096 + 64 }; /* the longest name of a folder, and of a file in it */

/* The temporary name where files cannot be made without one; a signal may come at that moment. One
 * at a time. */
static pthread_mutex_t passing_lock = PTHREAD_MUTEX_INITIALIZER;
static atomic_bool is_passing;
static char passing[PATH_BYTES];

void ebpo_workspace_abandon(void)
{
    int saved = errno;
    if (atomic_load(&is_passing))
        unlink(passing);
    errno = saved;
}

static int open_and_unlink(const char *folder)
{
    static unsigned counter;
    int fd = -1;
    pthread_mutex_lock(&passing_lock);
    for (int attempt = 0; attempt < 100 && fd < 0; attempt++) {
        snprintf(passing, sizeof passing, "%s/.ebpo-%ld-%u.tmp", folder, (long)getpid(), counter++);
        /* set before the file exists, so that a signal never leaves it behind */
        atomic_store(&is_passing, true);
        fd = open(passing, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
        if (fd >= 0)
            unlink(passing);
        atomic_store(&is_passing, false);
        if (fd < 0 && errno != EEXIST)
            break;
    }
    int fault = errno;
    pthread_mutex_unlock(&passing_lock);
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
