/* Declares the part of POSIX that the project uses and that Windows (mingw-w64) lacks, or has with
 * another meaning. Builds for Windows include this file before every source file, so that all other
 * files are written for POSIX. Macros here rename functions of the C library that POSIX extends. A
 * macro also renames structures and members with the same name. The headers in core/windows have
 * the names of POSIX headers. They are empty, except poll.h and sys/socket.h.
 *
 * Paths are UTF-8 with '/' or '\' between names, and may be long; the functions convert paths to
 * UTF-16. Errors are values of errno. Functions that are not provided on Windows (fork) fail with
 * ENOSYS. */
#ifndef EBPO_CORE_OS_WINDOWS_H
#define EBPO_CORE_OS_WINDOWS_H

#include <direct.h>
#include <dirent.h>
#include <emmintrin.h>
#include <errno.h>
#include <fcntl.h>
#include <io.h>
#include <limits.h>
#include <locale.h>
#include <math.h>
#include <process.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

/* --- files --- */

#undef PATH_MAX
#define PATH_MAX 4096

typedef int uid_t;
typedef int gid_t;

#define O_DIRECTORY 0x01000000
#define O_NOFOLLOW  0x02000000
#define O_NONBLOCK  0x04000000
#define O_NOCTTY    0
#define O_CLOEXEC   0 /* no descriptor is inherited */
/* A file without a name in a folder: it is removed when it is closed. */
#define O_TMPFILE           0x08000000
#define EBPO_HAVE_O_TMPFILE 1

#define AT_FDCWD            (-100)
#define AT_SYMLINK_NOFOLLOW 1
#define AT_SYMLINK_FOLLOW   2
#define AT_REMOVEDIR        4

#define S_IFLNK    0xA000
#define S_ISLNK(m) (((m)&0xF000) == S_IFLNK)

#define LOCK_EX 2
#define LOCK_NB 4
#define LOCK_UN 8

#define F_DUPFD_CLOEXEC 1
#define F_GETFD         2
#define F_SETFD         3
#define F_GETFL         4
#define F_SETFL         5
#define FD_CLOEXEC      1

#undef stat
#undef fstat
#undef lseek
#define lseek _lseeki64

struct ebpo_windows_stat {
    uint64_t st_dev, st_ino; /* serial number of the volume; number of the file in it */
    int64_t st_size;
    mode_t st_mode;
    uid_t st_uid; /* always 0, because owners are not examined */
    gid_t st_gid;
    struct timespec st_atim, st_mtim, st_ctim; /* st_ctim: the last change of data or attributes */
};
#undef st_atime
#undef st_mtime
#undef st_ctime
#define st_mtime st_mtim.tv_sec

#define stat  ebpo_windows_stat
#define fstat ebpo_windows_fstat
#define lstat ebpo_windows_lstat
int ebpo_windows_stat(const char *path, struct ebpo_windows_stat *out);
int ebpo_windows_fstat(int fd, struct ebpo_windows_stat *out);
int ebpo_windows_lstat(const char *path, struct ebpo_windows_stat *out);
int fstatat(int folder, const char *name, struct ebpo_windows_stat *out, int flags);

#define open   ebpo_windows_open
#define unlink ebpo_windows_unlink
#define rename ebpo_windows_rename
#define mkdir  ebpo_windows_mkdir
#define rmdir  ebpo_windows_rmdir
#define chmod  ebpo_windows_chmod
#define access ebpo_windows_access
#define fopen  ebpo_windows_fopen
#define fdopen ebpo_windows_fdopen
#define fclose ebpo_windows_fclose
#define fflush ebpo_windows_fflush
#define remove ebpo_windows_unlink
#define umask  _umask
int ebpo_windows_open(const char *path, int flags, ...);
int ebpo_windows_unlink(const char *path);
int ebpo_windows_rename(const char *from, const char *to);
int ebpo_windows_mkdir(const char *path, mode_t mode);
int ebpo_windows_rmdir(const char *path);
int ebpo_windows_chmod(const char *path, mode_t mode);
int ebpo_windows_access(const char *path, int mode);
FILE *ebpo_windows_fopen(const char *path, const char *mode);
FILE *ebpo_windows_fdopen(int fd, const char *mode);
int ebpo_windows_fclose(FILE *file);
int ebpo_windows_fflush(FILE *file);

int openat(int folder, const char *name, int flags, ...);
int unlinkat(int folder, const char *name, int flags);
int mkdirat(int folder, const char *name, mode_t mode);
int renameat(int from_folder, const char *from, int to_folder, const char *to);
int linkat(int from_folder, const char *from, int to_folder, const char *to, int flags);
int mkostemp(char *pattern, int flags);
char *mkdtemp(char *pattern);
char *realpath(const char *path, char *out);
ssize_t pread(int fd, void *data, size_t bytes, off_t at);
ssize_t pwrite(int fd, const void *data, size_t bytes, off_t at);
int flock(int fd, int how);
int fsync(int fd);
int fchmod(int fd, mode_t mode);
int fchown(int fd, uid_t user, gid_t group);
int fcntl(int fd, int what, ...);
int pipe(int ends[2]);
int futimens(int fd, const struct timespec *times);

/* Returns ENOSYS: advice on the use of files is not supported. */
static inline int posix_fadvise(int fd, off_t at, off_t bytes, int advice)
{
    (void)fd, (void)at, (void)bytes, (void)advice;
    return ENOSYS;
}
#define POSIX_FADV_WILLNEED 3
#define POSIX_FADV_DONTNEED 4

/* --- folders --- */

typedef struct ebpo_windows_folder ebpo_windows_folder;
struct ebpo_windows_entry {
    uint64_t d_ino; /* always 0 */
    char d_name[4 * 260];
};
#define DIR      ebpo_windows_folder
#define dirent   ebpo_windows_entry
#define opendir  ebpo_windows_opendir
#define readdir  ebpo_windows_readdir
#define closedir ebpo_windows_closedir
DIR *ebpo_windows_opendir(const char *path);
struct dirent *ebpo_windows_readdir(DIR *folder);
int ebpo_windows_closedir(DIR *folder);
DIR *fdopendir(int fd);
int dirfd(DIR *folder);

/* --- memory --- */

#define PROT_READ     1
#define PROT_WRITE    2
#define MAP_SHARED    1
#define MAP_PRIVATE   2
#define MAP_ANONYMOUS 4
#define MAP_FAILED    ((void *)-1)
#define MS_ASYNC      1
#define MCL_CURRENT   1
#define MCL_FUTURE    2
void *mmap(void *at, size_t bytes, int protection, int flags, int fd, off_t offset);
int munmap(void *at, size_t bytes);
int msync(void *at, size_t bytes, int flags);
int mincore(void *at, size_t bytes, unsigned char *flags);
int mlockall(int flags);
int munlockall(void);

/* Blocks of aligned_alloc are freed with `free`, so `free` is a function that recognises them. */
#define free ebpo_windows_free
void *aligned_alloc(size_t alignment, size_t bytes);
void ebpo_windows_free(void *block);

enum { _SC_PHYS_PAGES = 1, _SC_PAGESIZE, _SC_NPROCESSORS_ONLN };
long sysconf(int name);

/* --- processes, signals, limits --- */

#define SIGHUP  21 /* the value of SIGBREAK, which also arrives when the console is closed */
#define SIGPIPE 101
#define SIGXFSZ 102
#define SIGXCPU 103
#define SIGBUS  104
#define SIGKILL 105
#define signal  ebpo_windows_signal
void (*ebpo_windows_signal(int number, void (*handler)(int)))(int);

typedef _sigset_t sigset_t;
struct sigaction {
    void (*sa_handler)(int);
    sigset_t sa_mask;
    int sa_flags;
};
#define SA_RESETHAND 0x80000000u
#define SIG_UNBLOCK  1
#define SIG_SETMASK  2
#undef pthread_sigmask
int sigaction(int number, const struct sigaction *action, struct sigaction *before);

/* Signal masks have no effect, because handlers run on separate threads. */
static inline int sigemptyset(sigset_t *set)
{
    *set = 0;
    return 0;
}
static inline int sigfillset(sigset_t *set)
{
    *set = ~(sigset_t)0;
    return 0;
}
static inline int sigaddset(sigset_t *set, int number)
{
    *set |= (sigset_t)1 << (number & 31);
    return 0;
}
static inline int pthread_sigmask(int how, const sigset_t *set, sigset_t *before)
{
    (void)how, (void)set;
    if (before)
        *before = 0;
    return 0;
}

uid_t geteuid(void);
#define fork ebpo_windows_fork
pid_t fork(void);
pid_t waitpid(pid_t process, int *state, int flags);
int kill(pid_t process, int number);
const char *strsignal(int number);
#define WIFSIGNALED(state) ((void)(state), 0)
#define WTERMSIG(state)    ((void)(state), 0)

typedef uint64_t rlim_t;
struct rlimit {
    rlim_t rlim_cur, rlim_max;
};
#define RLIM_INFINITY UINT64_MAX
enum { RLIMIT_CORE, RLIMIT_FSIZE, RLIMIT_CPU, RLIMIT_AS, RLIMIT_DATA, RLIMIT_STACK, RLIMIT_NOFILE };
int getrlimit(int what, struct rlimit *out);
int setrlimit(int what, const struct rlimit *limit);

struct rusage {
    uint64_t ru_minflt; /* number of page faults of all kinds */
    uint64_t ru_majflt; /* always 0 */
};
#define RUSAGE_SELF 0
int getrusage(int who, struct rusage *out);

typedef struct {
    const char *dli_fname;
} Dl_info;
#define RTLD_DEFAULT NULL
#define RTLD_NOW     1
#define RTLD_LOCAL   2
void *dlopen(const char *name, int flags);
void *dlsym(void *library, const char *name);
int dladdr(const void *address, Dl_info *out);
const char *dlerror(void);

/* --- numbers --- */

/* Returns the square root, rounded once. The function sqrt of mingw-w64, which is called if the
 * compiler generates no instruction, rounds twice. */
static inline double ebpo_windows_sqrt(double x)
{
    return _mm_cvtsd_f64(_mm_sqrt_sd(_mm_setzero_pd(), _mm_set_sd(x)));
}
#define sqrt ebpo_windows_sqrt

/* --- texts --- */

#define getenv ebpo_windows_getenv
char *ebpo_windows_getenv(const char *name);

/* The only locale is "C", because the library uses no other locale. */
typedef struct ebpo_windows_locale *locale_t;
#define LC_ALL_MASK 0
locale_t newlocale(int mask, const char *name, locale_t base);
static inline void freelocale(locale_t locale) { (void)locale; }
static inline double strtod_l(const char *text, char **end, locale_t locale)
{
    (void)locale;
    return strtod(text, end);
}
static inline float strtof_l(const char *text, char **end, locale_t locale)
{
    (void)locale;
    return strtof(text, end);
}

char *strndup(const char *text, size_t most);
char *stpcpy(char *to, const char *from);
ssize_t getline(char **line, size_t *space, FILE *in);
FILE *open_memstream(char **text, size_t *size);

#endif
