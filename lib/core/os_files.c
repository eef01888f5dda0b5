/* Makes unnamed temporary files. Where the system cannot make a file without a name, the file has
 * one for a moment. The name is stored before the file exists, so that a signal handler can remove
 * the file. Only one file at a time has a name. */
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <unistd.h>

#include "core/os.h"

enum { PATH_BYTES = 4096 + 64 }; /* the longest name of a folder, and of a file in it */

/* The name of the file that has one for a moment, for ebpo_workspace_abandon in a signal handler.
 */
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
