#include "cli/command.h"
#include "cli/process_memory.h"
#include "cli/words.h"

#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int command_failed(const char *name, const ebpo_error *error)
{
    char why[128] = "";
    if (error->status == EBPO_E_MEMORY)
        process_memory_reason(why, sizeof why);
    fprintf(stderr, "ebpo %s: %s%s\n", name,
            error->message[0] ? error->message : ebpo_status_name(error->status), why);
    if (error->status == EBPO_E_ARGUMENT)
        return EXIT_USAGE;
    return error->status == EBPO_E_NOT_SOLID ? EXIT_NOT_SOLID : EXIT_FAILED;
}

int command_usage(const char *name, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    fprintf(stderr, "ebpo %s: ", name);
    vfprintf(stderr, format, list);
    fprintf(stderr, "; try 'ebpo %s --help'\n", name);
    va_end(list);
    return EXIT_USAGE;
}

int command_no_memory(const char *name)
{
    char why[128];
    process_memory_reason(why, sizeof why);
    fprintf(stderr, "ebpo %s: not enough memory%s\n", name, why);
    return EXIT_FAILED;
}

int command_thread(pthread_t *thread, void *(*body)(void *), void *argument)
{
    pthread_attr_t attributes;
    int failed = pthread_attr_init(&attributes);
    if (failed)
        return failed;
    failed = pthread_attr_setstacksize(&attributes, COMMAND_STACK);
    if (!failed)
        failed = pthread_create(thread, &attributes, body, argument);
    pthread_attr_destroy(&attributes);
    return failed;
}

unsigned command_cores(void)
{
#ifdef EBPO_HAVE_SCHED_GETAFFINITY
    cpu_set_t set;
    return sched_getaffinity(0, sizeof set, &set) == 0 ? (unsigned)CPU_COUNT(&set) : 1;
#else
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    return cores < 1 ? 1 : (unsigned)cores;
#endif
}

bool command_same_file(const char *a, const char *b)
{
    struct stat sa, sb;
    return !ebpo_is_url(a) && stat(a, &sa) == 0 && stat(b, &sb) == 0 && sa.st_dev == sb.st_dev &&
           sa.st_ino == sb.st_ino;
}

bool command_overwrites(const char *name, const char *in, const char *out)
{
    if (strcmp(in, out) != 0 && !command_same_file(in, out))
        return false;
    fprintf(stderr, "ebpo %s: %s: is both input and output; choose another output\n", name, out);
    return true;
}

char *command_path_in_scene(const char *scene, const char *path)
{
    bool is_absolute = *path == '/' || strstr(path, "://");
#ifdef _WIN32
    is_absolute = is_absolute || *path == '\\' || (*path && path[1] == ':');
#endif
    size_t folder = is_absolute ? 0 : (size_t)(words_file_name(scene) - scene), size = strlen(path);
    char *joined = malloc(folder + size + 1);
    if (joined) {
        memcpy(joined, scene, folder);
        memcpy(joined + folder, path, size + 1);
    }
    return joined;
}

/* Opens a regular file; never waits for data of a pipe. */
static int open_regular(const char *name, const char *path)
{
    struct stat st;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd >= 0 && fstat(fd, &st) == 0) {
        if (S_ISREG(st.st_mode))
            return fd;
        errno = S_ISDIR(st.st_mode) ? EISDIR : 0;
    }
    int number = errno;
    if (fd >= 0)
        close(fd);
    if (number == 0 || number == ENXIO)
        fprintf(stderr, "ebpo %s: %s: is a pipe or device; name a regular file\n", name, path);
    else if (number != ENOENT)
        fprintf(stderr, "ebpo %s: %s: cannot be opened: %s\n", name, path, strerror(number));
    errno = number;
    return -1;
}

int command_is_hdf5(const char *name, const char *path)
{
    static const char signature[8] = "\211HDF\r\n\032\n";
    char head[8] = "";
    size_t size = 0;
    ssize_t read_bytes = 1;
    if (ebpo_is_url(path))
        return 1; /* the caller opens the URL, and then reports an error */
    int fd = open_regular(name, path);
    if (fd < 0)
        return errno == ENOENT ? 1 : -1; /* 1: the caller opens the file, and reports the error */
    while (size < sizeof head && read_bytes != 0) {
        read_bytes = read(fd, head + size, sizeof head - size);
        if (read_bytes < 0 && errno != EINTR)
            break;
        size += read_bytes > 0 ? (size_t)read_bytes : 0;
    }
    if (read_bytes < 0)
        fprintf(stderr, "ebpo %s: %s: cannot be read: %s\n", name, path, strerror(errno));
    close(fd);
    return read_bytes < 0 ? -1 : size == sizeof head && memcmp(head, signature, sizeof head) == 0;
}

bool command_requires_hdf5(const char *name, const char *path)
{
    int is_hdf5 = command_is_hdf5(name, path);
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    if (is_hdf5 != 0)
        return is_hdf5 > 0;
    /* ebpo_open fails; its message names the kind of a file that is not HDF5 */
    bool success = ebpo_open(path, &file, &error) == EBPO_OK;
    if (!success)
        fprintf(stderr, "ebpo %s: %s\n", name, error.message);
    ebpo_close(file);
    return success;
}

bool command_has_level(const char *name, const ebpo_info *info, int64_t level)
{
    if (level < info->level_count)
        return true;
    fprintf(stderr, "ebpo %s: there is no level %d; this file has levels 0 to %d\n", name,
            (int)level, info->level_count - 1);
    return false;
}

/* Reports an error of standard output, unless an earlier error was reported. `number`: errno; 0:
 * not known. Returns false. */
static bool not_written(const char *name, int number)
{
    static bool reported;
    if (!reported)
        fprintf(stderr, "ebpo%s%s: standard output: %s\n", name ? " " : "", name ? name : "",
                number ? strerror(number) : "could not be written");
    reported = true;
    return false;
}

bool command_not_written(const char *name) { return not_written(name, errno); }

bool command_flush(const char *name)
{
    errno = 0;
    return (fflush(stdout) == 0 && !ferror(stdout)) || not_written(name, errno);
}

bool command_write(const char *name, const char *bytes, size_t count)
{
    while (count > 0) {
        ssize_t done = write(STDOUT_FILENO, bytes, count);
        if (done < 0 && errno != EINTR)
            return not_written(name, errno);
        bytes += done > 0 ? done : 0;
        count -= done > 0 ? (size_t)done : 0;
    }
    return true;
}
