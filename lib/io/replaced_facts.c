#include "io/replaced_facts.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#ifdef EBPO_HAVE_XATTR
#include <sys/xattr.h>
#endif
#include <unistd.h>

#ifdef EBPO_HAVE_XATTR
/* No system lets a file have more of these. */
enum { NAMES_MOST = 65536, VALUE_MOST = 65536 };

static void take_attribute(int from, int to, const char *name, void *value)
{
    ssize_t size = fgetxattr(from, name, value, VALUE_MOST);
    if (size >= 0)
        (void)!fsetxattr(to, name, value, (size_t)size, 0); /* where the system allows */
}

static void take_attributes(int from, int to)
{
    char *names = malloc(NAMES_MOST);
    void *value = malloc(VALUE_MOST);
    ssize_t size = names && value ? flistxattr(from, names, NAMES_MOST) : -1;
    for (ssize_t at = 0; at < size; at += (ssize_t)strlen(names + at) + 1)
        take_attribute(from, to, names + at, value);
    free(names);
    free(value);
}

#else
static void take_attributes(int from, int to) { (void)from, (void)to; }
#endif

/* Who may not give a file away keeps it; it then does not act for another owner (set-user-ID). */
static mode_t take_owner(int to, const struct stat *was)
{
    struct stat is;
    mode_t mode = was->st_mode & 07777;
    if (fstat(to, &is) != 0)
        return mode & 0777;
    bool user = is.st_uid == was->st_uid || fchown(to, was->st_uid, (gid_t)-1) == 0,
         group = is.st_gid == was->st_gid || fchown(to, (uid_t)-1, was->st_gid) == 0;
    if (user && group)
        return mode;
    /* what the group was allowed is not for another one */
    return group ? mode & 0777 : mode & (0707 | (mode & 007) << 3);
}

bool ebpo_take_over_facts(int fd, const char *path, int mode)
{
    struct stat was;
    int from = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY);
    bool there = from >= 0 ? fstat(from, &was) == 0 : lstat(path, &was) == 0;
    if (there && S_ISREG(was.st_mode)) {
        mode = (int)take_owner(fd, &was);
        if (from >= 0)
            take_attributes(from, fd); /* before the mode, which a list may change */
    }
    if (from >= 0)
        close(from);
    return mode < 0 || fchmod(fd, (mode_t)mode) == 0;
}
