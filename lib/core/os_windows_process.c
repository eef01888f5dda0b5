/* Implements functions of POSIX (os_windows.h) with functions of Windows: processes, signals,
 * limits, waiting for input, libraries, the environment and texts. */
#define WIN32_LEAN_AND_MEAN
#include <windows.h>

#include <poll.h>

#include "core/os.h"
#include "core/os_windows_parts.h"

/* Fails with ENOSYS. */
static int not_provided(void)
{
    errno = ENOSYS;
    return -1;
}

/* --- processes and signals --- */

uid_t geteuid(void) { return 0; }

pid_t fork(void) { return not_provided(); }

pid_t waitpid(pid_t process, int *state, int flags)
{
    (void)process, (void)flags;
    *state = 0;
    return not_provided();
}

/* Returns 0 if a process exists. Sends no signal, because callers use only signal 0, which only
 * tests whether the process exists. */
int kill(pid_t process, int number)
{
    DWORD code = STILL_ACTIVE;
    (void)number;
    HANDLE found = OpenProcess(PROCESS_QUERY_LIMITED_INFORMATION, FALSE, (DWORD)process);
    if (!found && GetLastError() == ERROR_ACCESS_DENIED)
        return 0;
    bool runs = found && GetExitCodeProcess(found, &code) && code == STILL_ACTIVE;
    if (found)
        CloseHandle(found);
    errno = runs ? errno : ESRCH;
    return runs ? 0 : -1;
}

const char *strsignal(int number)
{
    (void)number;
    return "a signal";
}

static bool is_known(int number)
{
    return number == SIGINT || number == SIGTERM || number == SIGHUP || number == SIGABRT ||
           number == SIGFPE || number == SIGILL || number == SIGSEGV;
}

#undef signal
void (*ebpo_windows_signal(int number, void (*handler)(int)))(int)
{
    return is_known(number) ? signal(number, handler) : SIG_DFL;
}

/* Always behaves as with the flag SA_RESETHAND, because the C library restores the default action
 * when a signal arrives. */
int sigaction(int number, const struct sigaction *action, struct sigaction *before)
{
    if (!is_known(number)) {
        errno = EINVAL;
        return -1;
    }
    void (*former)(int) = signal(number, action ? action->sa_handler : SIG_DFL);
    if (!action)
        signal(number, former);
    if (before)
        *before = (struct sigaction){ .sa_handler = former };
    return 0;
}

/* --- limits --- */

int getrlimit(int what, struct rlimit *out)
{
    enum {
        DESCRIPTORS = 2048,  /* greatest number of descriptors of the C library */
        MAIN_STACK = 2 << 20 /* stack of a program's main thread, in bytes */
    };
    rlim_t most = what == RLIMIT_NOFILE  ? DESCRIPTORS
                  : what == RLIMIT_STACK ? MAIN_STACK
                                         : RLIM_INFINITY;
    *out = (struct rlimit){ most, most };
    return 0;
}

int setrlimit(int what, const struct rlimit *limit)
{
    (void)what, (void)limit;
    return not_provided();
}

/* --- waiting for input --- */

/* Returns true if a read from the descriptor would not wait. */
static bool is_ready(int fd)
{
    DWORD bytes = 0;
    HANDLE file = (HANDLE)_get_osfhandle(fd);
    int state = ebpo_windows_socket_state(fd);
    if (state >= 0)
        return state;
    if (GetFileType(file) == FILE_TYPE_PIPE)
        return !PeekNamedPipe(file, NULL, 0, NULL, &bytes, NULL) || bytes > 0;
    return GetFileType(file) != FILE_TYPE_CHAR || WaitForSingleObject(file, 0) == WAIT_OBJECT_0;
}

int poll(struct pollfd *of, unsigned long count, int milliseconds)
{
    enum { STEP_MS = 2 };
    for (int waited = 0;; waited += STEP_MS) {
        int ready = 0;
        for (unsigned long i = 0; i < count; i++) {
            of[i].revents = of[i].fd >= 0 && is_ready(of[i].fd) ? POLLIN : 0;
            ready += of[i].revents != 0;
        }
        if (ready || (milliseconds >= 0 && waited >= milliseconds))
            return ready;
        Sleep(STEP_MS);
    }
}

/* --- libraries --- */

void *dlopen(const char *name, int flags)
{
    (void)name, (void)flags;
    (void)not_provided();
    return NULL;
}

const char *dlerror(void) { return "loading libraries is not supported on this system"; }

static HMODULE module_of(const void *address)
{
    HMODULE module = NULL;
    GetModuleHandleExW(GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS |
                           GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT,
                       address, &module);
    return module;
}

void *dlsym(void *library, const char *name)
{
    HMODULE module = library ? (HMODULE)library : GetModuleHandleW(L"libebpo-0.dll");
    FARPROC found = module ? GetProcAddress(module, name) : NULL;
    void *address;
    memcpy(&address, &found, sizeof address);
    return address;
}

int dladdr(const void *address, Dl_info *out)
{
    static char path[PATH_MAX];
    WCHAR wide[PATH_MAX];
    HMODULE module = module_of(address);
    DWORD size = module ? GetModuleFileNameW(module, wide, PATH_MAX) : 0;
    char *text = size > 0 && size < PATH_MAX ? ebpo_windows_narrow(wide) : NULL;
    if (!text)
        return 0;
    snprintf(path, sizeof path, "%s", text);
    free(text);
    out->dli_fname = path;
    return 1;
}

/* --- the environment --- */

static char temporary_folder[PATH_MAX];

/* Sets temporary_folder to TMPDIR. If TMPDIR is not set, uses the temporary folder of Windows, or
 * "" if there is no such folder. */
static void find_temporary_folder(void)
{
    WCHAR wide[PATH_MAX];
    DWORD size = GetEnvironmentVariableW(L"TMPDIR", wide, PATH_MAX);
    if (size == 0 || size >= PATH_MAX)
        size = GetTempPathW(PATH_MAX, wide);
    char *text = size > 0 && size < PATH_MAX ? ebpo_windows_narrow(wide) : NULL;
    if (text)
        snprintf(temporary_folder, sizeof temporary_folder, "%s", text);
    free(text);
    for (char *c = temporary_folder; *c; c++)
        *c = *c == '\\' ? '/' : *c;
    size_t length = strlen(temporary_folder);
    if (length && temporary_folder[length - 1] == '/')
        temporary_folder[length - 1] = 0;
}

#undef getenv
char *ebpo_windows_getenv(const char *name)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    if (strcmp(name, "TMPDIR") != 0)
        return getenv(name);
    pthread_once(&once, find_temporary_folder);
    return *temporary_folder ? temporary_folder : NULL;
}

/* --- texts --- */

locale_t newlocale(int mask, const char *name, locale_t base)
{
    static char only;
    (void)mask, (void)name, (void)base;
    return (locale_t)(void *)&only;
}

char *strndup(const char *text, size_t most)
{
    size_t size = strnlen(text, most);
    char *out = malloc(size + 1);
    if (out) {
        memcpy(out, text, size);
        out[size] = 0;
    }
    return out;
}

char *stpcpy(char *to, const char *from)
{
    size_t size = strlen(from);
    memcpy(to, from, size + 1);
    return to + size;
}

ssize_t getline(char **line, size_t *space, FILE *in)
{
    size_t size = 0;
    for (int c = 0; c != '\n' && (c = getc(in)) != EOF;) {
        if (size + 2 > *space) {
            size_t wanted = *space < 64 ? 128 : 2 * *space;
            char *wider = realloc(*line, wanted);
            if (!wider)
                return -1;
            *line = wider;
            *space = wanted;
        }
        (*line)[size++] = (char)c;
    }
    if (size == 0)
        return -1;
    (*line)[size] = 0;
    return (ssize_t)size;
}

/* A stream of open_memstream: a temporary file, whose content is copied to the text when the stream
 * is flushed or closed. */
typedef struct memory_stream {
    FILE *file;
    char **text;
    size_t *size;
    struct memory_stream *next;
} memory_stream;

static pthread_mutex_t streams_lock = PTHREAD_MUTEX_INITIALIZER;
static memory_stream *streams;

FILE *open_memstream(char **text, size_t *size)
{
    const char *folder = ebpo_windows_getenv("TMPDIR");
    memory_stream *s = calloc(1, sizeof *s);
    int fd = s ? open(folder ? folder : ".", O_TMPFILE | O_RDWR, 0600) : -1;
    FILE *file = fd >= 0 ? fdopen(fd, "w+") : NULL;
    if (!file) {
        if (fd >= 0)
            close(fd);
        free(s);
        return NULL;
    }
    *text = NULL;
    *size = 0;
    *s = (memory_stream){ file, text, size, NULL };
    pthread_mutex_lock(&streams_lock);
    s->next = streams;
    streams = s;
    pthread_mutex_unlock(&streams_lock);
    return file;
}

/* Returns the stream of open_memstream that has this file, or NULL. If `closes` is true, also
 * removes the stream from the list. */
static memory_stream *find_stream(const FILE *file, bool closes)
{
    pthread_mutex_lock(&streams_lock);
    memory_stream **link = &streams, *s;
    while (*link && (*link)->file != file)
        link = &(*link)->next;
    if ((s = *link) && closes)
        *link = s->next;
    pthread_mutex_unlock(&streams_lock);
    return s;
}

/* Copies the flushed content of the file to the text. */
static bool take_text(const memory_stream *s)
{
    struct stat facts;
    int fd = _fileno(s->file);
    if (fstat(fd, &facts) != 0)
        return false;
    size_t size = (size_t)facts.st_size, done = 0;
    char *text = realloc(*s->text, size + 1);
    if (!text)
        return false;
    *s->text = text;
    for (ssize_t received = 1; done < size && received > 0;
         done += received > 0 ? (size_t)received : 0)
        received = pread(fd, text + done, size - done, (off_t)done);
    text[done] = 0;
    *s->size = done;
    off_t end = (off_t)size;
    return done == size && lseek(fd, end, SEEK_SET) == end; /* pread moves the position */
}

#undef fflush
int ebpo_windows_fflush(FILE *file)
{
    const memory_stream *s = file ? find_stream(file, false) : NULL;
    int result = fflush(file);
    return result == 0 && s && !take_text(s) ? EOF : result;
}

#undef fclose
int ebpo_windows_fclose(FILE *file)
{
    memory_stream *s = find_stream(file, true);
    int result = fflush(file);
    if (s && result == 0 && !take_text(s))
        result = EOF;
    free(s);
    return fclose(file) == 0 ? result : EOF;
}
