/* Runs libhdf5 on untrusted files in a separate process, so that a crash does not end this process.
 * The separate process is forked from this process. It has limits of memory, time and bytes
 * written, and loads no plugins. It reports its status and error through a pipe. */
#include "hdf5_write/h5_parts.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"

/* The result that the separate process reports at its end. */
typedef struct report {
    ebpo_status status;
    ebpo_error error;
} report;

/* Returns the address space of this process in bytes, or 0 if it is not known. */
static uint64_t address_bytes(void)
{
    unsigned long long pages = 0;
    FILE *f = fopen("/proc/self/statm", "re");
    if (f && fscanf(f, "%llu", &pages) != 1)
        pages = 0;
    if (f)
        fclose(f);
    return pages * (uint64_t)sysconf(_SC_PAGESIZE);
}

/* Lowers the limit of the resource `what` of this process to `most`. */
static void limit_resource(int what, uint64_t most)
{
    struct rlimit limit;
    if (getrlimit(what, &limit) == 0 &&
        (limit.rlim_max == RLIM_INFINITY || most < limit.rlim_max)) {
        limit.rlim_cur = limit.rlim_max = most;
        setrlimit(what, &limit);
    }
}

/* Sets the limits of the separate process. `address_space`: bytes of the address space when the
 * process was forked; 0: not known. */
static void set_limits(const ebpo_process_limits *limits, uint64_t address_space)
{
    limit_resource(RLIMIT_CORE, 0);
    limit_resource(RLIMIT_FSIZE, limits->file_bytes);
    limit_resource(RLIMIT_CPU, limits->seconds);
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    (void)address_space; /* sanitizers reserve all addresses */
#else
    if (address_space)
        limit_resource(RLIMIT_AS, address_space + limits->memory_bytes);
#endif
}

bool ebpo_process_write(int fd, const void *data, size_t bytes)
{
    for (const char *at = data; bytes > 0;) {
        ssize_t done = write(fd, at, bytes);
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0)
            return false;
        at += done;
        bytes -= (size_t)done;
    }
    return true;
}

/* Reads from a pipe. Returns 1 if all bytes were read, 0 if the other end was closed early, and -1
 * if reading failed. */
static int read_all(int fd, void *data, size_t bytes)
{
    for (char *at = data; bytes > 0;) {
        ssize_t done = read(fd, at, bytes);
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0)
            return done < 0 ? -1 : 0;
        at += done;
        bytes -= (size_t)done;
    }
    return 1;
}

/* Runs the work in the separate process, and reports the result. Does not return. */
static void run_work(ebpo_process_fn work, void *user, const ebpo_process_limits *limits,
                     uint64_t address_space, int out)
{
    static const int handled[] = { SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGTERM };
    report r = { EBPO_OK, EBPO_ERROR_INIT };
    for (size_t i = 0; i < sizeof handled / sizeof handled[0]; i++)
        /* signal handlers of the caller must not run in the separate process */
        signal(handled[i], SIG_DFL);
    signal(SIGXFSZ,
           SIG_IGN); /* so that a write beyond the limit fails instead of ending the process */
    signal(SIGPIPE, SIG_IGN);
    set_limits(limits, address_space);
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
    H5PLset_loading_state(0);
    r.status = work(user, &r.error);
    ebpo_process_write(out, &r, sizeof r);
    _exit(0);
}

/* Sets the error for a process that ended without a result. `state`: state of the process, from
 * waitpid. */
static ebpo_status fail_by_state(int state, const char *shown, ebpo_error *error)
{
    if (!WIFSIGNALED(state)) /* the process ended by itself, but could not report its result */
        return ebpo_fail_file(error, EBPO_E_IO, shown,
                              "the separate process that reads the file through libhdf5 ended "
                              "early");
    if (WTERMSIG(state) == SIGXCPU || WTERMSIG(state) == SIGKILL)
        return ebpo_fail_file(
            error, EBPO_E_FORMAT, shown,
            "libhdf5 exceeded its limits of time or memory; the file is damaged or malicious");
    return ebpo_fail_file(error, EBPO_E_FORMAT, shown,
                          "libhdf5 crashed on the file, in a separate process, by signal %d (%s); "
                          "the file is damaged or malicious, so do not trust it",
                          WTERMSIG(state), strsignal(WTERMSIG(state)));
}

static bool make_pipe(int ends[2])
{
#ifdef EBPO_HAVE_PIPE2
    return pipe2(ends, O_CLOEXEC) == 0;
#else
    return pipe(ends) == 0 && fcntl(ends[0], F_SETFD, FD_CLOEXEC) == 0 &&
           fcntl(ends[1], F_SETFD, FD_CLOEXEC) == 0;
#endif
}

ebpo_status ebpo_run_in_process(ebpo_process_fn work, void *user, const char *shown,
                                const ebpo_process_limits *limits, ebpo_error *error)
{
    int ends[2], state = 0;
    ebpo_h5_scope scope;
    report r;
    if (!make_pipe(ends))
        return ebpo_fail_errno(error, shown,
                               "the separate process for reading could not be started");
    uint64_t address_space = address_bytes();
    ebpo_h5_enter(&scope); /* so that no thread is in libhdf5 when the process is forked */
    pid_t child = fork();
    if (child == 0) {
        ebpo_h5_leave(&scope);
        close(ends[0]);
        run_work(work, user, limits, address_space, ends[1]);
    }
    int fault = errno; /* kept, because the calls below overwrite errno */
    ebpo_h5_leave(&scope);
    close(ends[1]);
    int reported = child > 0 ? read_all(ends[0], &r, sizeof r) : 0;
    fault = reported < 0 ? errno : fault;
    close(ends[0]);
    while (child > 0 && waitpid(child, &state, 0) < 0 && errno == EINTR)
        ;
    if (child < 0) {
        errno = fault;
        return ebpo_fail_errno(error, shown,
                               "the separate process for reading could not be started");
    }
    errno = fault;
    if (reported < 0)
        return ebpo_fail_errno(error, shown,
                               "the result of the separate process for reading is not readable");
    if (!reported)
        return fail_by_state(state, shown, error);
    /* terminate the texts, because the process may have written any bytes */
    r.error.message[sizeof r.error.message - 1] = r.error.file[sizeof r.error.file - 1] =
        r.error.object[sizeof r.error.object - 1] = 0;
    if (r.status != EBPO_OK && r.status != r.error.status)
        return fail_by_state(state, shown, error);
    if (r.status != EBPO_OK || *r.error.message)
        (void)!ebpo_fail_with(error, &r.error);
    return r.status;
}
