/* Implements the functions of POSIX for files and folders (os_windows.h) with functions of Windows.
 *
 * Every file is opened so that other programs may read, write, rename and remove it at any time, as
 * on POSIX. A removed file loses its name at once if the file system supports this (NTFS), and
 * otherwise when the file is closed. A path gets the prefix "\\?\", which permits paths of 32,767
 * characters. Functions that get a descriptor of a folder use the folder's current path. */
#define WIN32_LEAN_AND_MEAN
#include <windows.h>

#include "core/os.h"
#include "core/os_windows_parts.h"

enum {
    WIDE_MAX = 32768, /* longest path in units of UTF-16, with the final zero */
    TRIES = 20,       /* attempts to rename a file, or to find a new name */
    TRY_MS = 10       /* milliseconds between attempts */
};

/* Values and a struct that mingw-w64 declares only for some versions of Windows. */
enum { FILE_DISPOSITION_EX = 21, FILE_RENAME_EX = 22 };
enum { DISPOSE = 1, DISPOSE_AT_ONCE = 2, DISPOSE_READ_ONLY = 16 };
enum { RENAME_REPLACE = 1, RENAME_AT_ONCE = 2 };
typedef struct rename_info {
    DWORD flags;
    HANDLE folder;
    DWORD bytes;
    WCHAR name[];
} rename_info;

/* --- errors --- */

/* Errors of Windows, and the values of errno for them. */
static const struct {
    DWORD fault;
    int number;
} numbers[] = {
    { ERROR_FILE_NOT_FOUND, ENOENT },
    { ERROR_PATH_NOT_FOUND, ENOENT },
    { ERROR_INVALID_NAME, ENOENT },
    { ERROR_BAD_PATHNAME, ENOENT },
    { ERROR_BAD_NETPATH, ENOENT },
    { ERROR_BAD_NET_NAME, ENOENT },
    { ERROR_INVALID_DRIVE, ENOENT },
    { ERROR_DIRECTORY, ENOTDIR },
    { ERROR_ACCESS_DENIED, EACCES },
    { ERROR_SHARING_VIOLATION, EACCES },
    { ERROR_LOCK_VIOLATION, EWOULDBLOCK },
    { ERROR_WRITE_PROTECT, EROFS },
    { ERROR_FILE_EXISTS, EEXIST },
    { ERROR_ALREADY_EXISTS, EEXIST },
    { ERROR_DIR_NOT_EMPTY, ENOTEMPTY },
    { ERROR_NOT_SAME_DEVICE, EXDEV },
    { ERROR_FILENAME_EXCED_RANGE, ENAMETOOLONG },
    { ERROR_TOO_MANY_OPEN_FILES, EMFILE },
    { ERROR_INVALID_HANDLE, EBADF },
    { ERROR_NOT_ENOUGH_MEMORY, ENOMEM },
    { ERROR_OUTOFMEMORY, ENOMEM },
    { ERROR_COMMITMENT_LIMIT, ENOMEM },
    { ERROR_DISK_FULL, ENOSPC },
    { ERROR_HANDLE_DISK_FULL, ENOSPC },
    { ERROR_FILE_TOO_LARGE, EFBIG },
    { ERROR_BROKEN_PIPE, EPIPE },
    { ERROR_NO_DATA, EPIPE },
    { ERROR_INVALID_PARAMETER, EINVAL },
    { ERROR_NO_UNICODE_TRANSLATION, EILSEQ },
    { ERROR_NOT_SUPPORTED, ENOSYS },
};

int ebpo_windows_fail(void)
{
    DWORD fault = GetLastError();
    errno = EIO;
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        if (numbers[i].fault == fault)
            errno = numbers[i].number;
    return -1;
}

static int fail_with(int number)
{
    errno = number;
    return -1;
}

/* --- paths --- */

/* Converts text to UTF-16. Returns NULL on failure, with errno. The caller frees the result. */
static WCHAR *widen_text(const char *text)
{
    int size = MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, text, -1, NULL, 0);
    WCHAR *wide = size > 0 ? malloc((size_t)size * sizeof *wide) : NULL;
    if (size <= 0)
        (void)ebpo_windows_fail();
    else if (wide)
        MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, text, -1, wide, size);
    return wide;
}

char *ebpo_windows_narrow(const wchar_t *wide)
{
    int size = WideCharToMultiByte(CP_UTF8, 0, wide, -1, NULL, 0, NULL, NULL);
    char *text = size > 0 ? malloc((size_t)size) : NULL;
    if (text)
        WideCharToMultiByte(CP_UTF8, 0, wide, -1, text, size, NULL, NULL);
    return text;
}

/* Returns the absolute path, with the prefix for long paths. Returns NULL on failure, with errno.
 * The caller frees the result. */
static WCHAR *absolute_path(const WCHAR *path)
{
    static const WCHAR plain[] = L"\\\\?\\", network[] = L"\\\\?\\UNC";
    WCHAR *out = malloc((WIDE_MAX + 8) * sizeof *out), *from = out ? out + 8 : NULL;
    DWORD size = out ? GetFullPathNameW(path, WIDE_MAX, from, NULL) : 0;
    if (size == 0 || size >= WIDE_MAX) {
        if (out)
            errno = size ? ENAMETOOLONG : (ebpo_windows_fail(), errno);
        free(out);
        return NULL;
    }
    while (size > 3 && from[size - 1] == L'\\')
        from[--size] = 0;
    if (wcsncmp(from, L"\\\\.\\", 4) == 0 || wcsncmp(from, L"\\\\?\\", 4) == 0) {
        memmove(out, from, (size + 1) * sizeof *out);
        return out;
    }
    bool is_network = from[0] == L'\\' && from[1] == L'\\';
    const WCHAR *prefix = is_network ? network : plain;
    size_t length = wcslen(prefix), skipped = is_network ? 1 : 0;
    memmove(out + length, from + skipped, (size + 1 - skipped) * sizeof *out);
    memcpy(out, prefix, length * sizeof *out);
    return out;
}

/* Converts a path for the functions of Windows. Returns NULL on failure, with errno. The caller
 * frees the result. */
static WCHAR *wide_path(const char *path)
{
    if (!*path) {
        errno = ENOENT;
        return NULL;
    }
    WCHAR *wide = widen_text(strcmp(path, "/dev/null") == 0 ? "NUL" : path);
    WCHAR *out = wide ? absolute_path(wide) : NULL;
    free(wide);
    return out;
}

/* Removes the prefix of a path, if there is one, and replaces each backslash by '/'. Returns NULL
 * when out of memory. The caller frees the result. Changes `wide`. */
static char *plain_path(WCHAR *wide)
{
    bool is_network = wcsncmp(wide, L"\\\\?\\UNC\\", 8) == 0;
    WCHAR *from = is_network ? wide + 6 : wcsncmp(wide, L"\\\\?\\", 4) == 0 ? wide + 4 : wide;
    if (is_network)
        *from = L'\\';
    char *path = ebpo_windows_narrow(from);
    for (char *c = path; c && *c; c++)
        *c = *c == '\\' ? '/' : *c;
    return path;
}

/* Returns the path of an open file, with all links resolved. Returns NULL on failure, with errno.
 * The caller frees the result. */
static char *path_of(HANDLE file)
{
    WCHAR *wide = malloc(WIDE_MAX * sizeof *wide);
    DWORD size = wide ? GetFinalPathNameByHandleW(file, wide, WIDE_MAX, 0) : 0;
    char *path = NULL;
    if (wide && size > 0 && size < WIDE_MAX)
        path = plain_path(wide);
    else if (wide)
        errno = size ? ENAMETOOLONG : (ebpo_windows_fail(), errno);
    free(wide);
    return path;
}

static HANDLE handle_of(int fd) { return (HANDLE)_get_osfhandle(fd); }

/* Returns the path of a name below a folder. Returns NULL on failure, with errno. EXDEV: the name
 * contains '\' or ':', or begins with '/', and so might lead out of the folder. The caller frees
 * the path. */
static char *path_below(int folder, const char *name)
{
    char *out = NULL, *path;
    if (folder == AT_FDCWD)
        return strdup(name);
    if (strpbrk(name, "\\:") || *name == '/') {
        errno = EXDEV;
        return NULL;
    }
    path = path_of(handle_of(folder));
    if (path && asprintf(&out, "%s/%s", path, name) < 0)
        out = NULL;
    free(path);
    return out;
}

/* --- opening --- */

static bool is_link(HANDLE file)
{
    FILE_ATTRIBUTE_TAG_INFO tag;
    return GetFileInformationByHandleEx(file, FileAttributeTagInfo, &tag, sizeof tag) &&
           tag.FileAttributes & FILE_ATTRIBUTE_REPARSE_POINT &&
           (tag.ReparseTag == IO_REPARSE_TAG_SYMLINK ||
            tag.ReparseTag == IO_REPARSE_TAG_MOUNT_POINT);
}

static HANDLE open_handle(const WCHAR *path, DWORD rights, DWORD how, DWORD flags)
{
    return CreateFileW(path, rights, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, NULL,
                       how, flags | FILE_FLAG_BACKUP_SEMANTICS, NULL);
}

static bool names_link(const WCHAR *path)
{
    HANDLE file =
        open_handle(path, FILE_READ_ATTRIBUTES, OPEN_EXISTING, FILE_FLAG_OPEN_REPARSE_POINT);
    bool yes = file != INVALID_HANDLE_VALUE && is_link(file);
    if (file != INVALID_HANDLE_VALUE)
        CloseHandle(file);
    return yes;
}

/* Converts the flags of open to the argument of CreateFile that decides whether to create, truncate
 * or only open the file. */
static DWORD way_of(int flags)
{
    if (flags & O_CREAT)
        return flags & O_EXCL ? CREATE_NEW : flags & O_TRUNC ? CREATE_ALWAYS : OPEN_ALWAYS;
    return flags & O_TRUNC ? TRUNCATE_EXISTING : OPEN_EXISTING;
}

static int open_wide(const WCHAR *path, int flags, DWORD more)
{
    static const DWORD rights[] = { GENERIC_READ, GENERIC_WRITE | FILE_READ_ATTRIBUTES,
                                    GENERIC_READ | GENERIC_WRITE, GENERIC_READ };
    BY_HANDLE_FILE_INFORMATION facts;
    if (flags & O_NOFOLLOW && names_link(path))
        return fail_with(ELOOP);
    DWORD delete_right = more & FILE_FLAG_DELETE_ON_CLOSE ? DELETE : 0;
    HANDLE file = open_handle(path, rights[flags & 3] | delete_right, way_of(flags), more);
    if (file == INVALID_HANDLE_VALUE)
        return ebpo_windows_fail();
    bool is_folder = GetFileType(file) == FILE_TYPE_DISK &&
                     GetFileInformationByHandle(file, &facts) &&
                     facts.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY;
    int wrong = is_folder && flags & 3 ? EISDIR : !is_folder && flags & O_DIRECTORY ? ENOTDIR : 0;
    int fd = wrong ? -1 : _open_osfhandle((intptr_t)file, flags & O_APPEND);
    if (fd < 0) {
        CloseHandle(file);
        errno = wrong ? wrong : EMFILE;
    }
    return fd;
}

/* Opens a new file in the folder. The file is removed when it is closed. */
static int open_temporary(const char *folder)
{
    static atomic_uint number;
    int fd = -1;
    for (int i = 0; i < TRIES && fd < 0; i++) {
        char *path;
        if (asprintf(&path, "%s/.ebpo-%d-%u.tmp", folder, getpid(), atomic_fetch_add(&number, 1)) <
            0)
            return fail_with(ENOMEM);
        WCHAR *wide = wide_path(path);
        free(path);
        if (!wide)
            return -1;
        fd = open_wide(wide, O_RDWR | O_CREAT | O_EXCL,
                       FILE_FLAG_DELETE_ON_CLOSE | FILE_ATTRIBUTE_TEMPORARY);
        free(wide);
        if (fd < 0 && errno != EEXIST)
            break;
    }
    return fd;
}

int open(const char *path, int flags, ...)
{
    int number, end = 0;
    if (sscanf(path, "/dev/fd/%d%n", &number, &end) == 1 && !path[end])
        return _dup(number);
    if (flags & O_TMPFILE)
        return open_temporary(path);
    WCHAR *wide = wide_path(path);
    int fd = wide ? open_wide(wide, flags, FILE_ATTRIBUTE_NORMAL) : -1;
    free(wide);
    return fd;
}

int openat(int folder, const char *name, int flags, ...)
{
    char *path = path_below(folder, name);
    int fd = path ? open(path, flags, 0) : -1;
    free(path);
    return fd;
}

/* Converts a mode of fopen. Returns the flags of open, and writes the mode of fdopen to `out`. */
static int flags_of_mode(const char *mode, char out[4])
{
    bool both = strchr(mode, '+') != NULL;
    int flags = both ? O_RDWR : *mode == 'r' ? O_RDONLY : O_WRONLY;
    snprintf(out, 4, "%c%sb", *mode, both ? "+" : "");
    return flags |
           (*mode == 'w'   ? O_CREAT | O_TRUNC
            : *mode == 'a' ? O_CREAT | O_APPEND
                           : 0) |
           (strchr(mode, 'x') ? O_EXCL : 0);
}

FILE *fdopen(int fd, const char *mode)
{
    char binary[4];
    (void)flags_of_mode(mode, binary);
    return _fdopen(fd, binary);
}

FILE *fopen(const char *path, const char *mode)
{
    char binary[4];
    int fd = open(path, flags_of_mode(mode, binary), 0666);
    FILE *file = fd >= 0 ? _fdopen(fd, binary) : NULL;
    if (fd >= 0 && !file)
        close(fd);
    return file;
}

/* --- facts --- */

/* Converts a time of Windows, in units of 100 ns since 1601. */
static struct timespec time_of(int64_t ticks)
{
    const int64_t a_second = 10000000, to_1970 = INT64_C(11644473600);
    return (struct timespec){ ticks / a_second - to_1970, (long)(ticks % a_second * 100) };
}

static int facts_of(HANDLE file, struct stat *out)
{
    BY_HANDLE_FILE_INFORMATION facts;
    FILE_BASIC_INFO times;
    DWORD kind = GetFileType(file);
    *out = (struct stat){ .st_mode = kind == FILE_TYPE_PIPE ? S_IFIFO : S_IFCHR };
    if (kind == FILE_TYPE_UNKNOWN)
        return GetLastError() == NO_ERROR ? fail_with(EBADF) : ebpo_windows_fail();
    if (kind != FILE_TYPE_DISK)
        return 0;
    if (!GetFileInformationByHandle(file, &facts) ||
        !GetFileInformationByHandleEx(file, FileBasicInfo, &times, sizeof times))
        return ebpo_windows_fail();
    bool is_folder = facts.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY,
         is_fixed = facts.dwFileAttributes & FILE_ATTRIBUTE_READONLY;
    mode_t kind_bits = is_link(file) ? S_IFLNK : is_folder ? S_IFDIR : S_IFREG;
    *out = (struct stat){ .st_dev = facts.dwVolumeSerialNumber,
                          .st_ino = (uint64_t)facts.nFileIndexHigh << 32 | facts.nFileIndexLow,
                          .st_size =
                              (int64_t)((uint64_t)facts.nFileSizeHigh << 32 | facts.nFileSizeLow),
                          .st_mode = (mode_t)(kind_bits | (is_fixed ? 0444 : 0666)),
                          .st_atim = time_of(times.LastAccessTime.QuadPart),
                          .st_mtim = time_of(times.LastWriteTime.QuadPart),
                          .st_ctim =
                              time_of(times.ChangeTime.QuadPart ? times.ChangeTime.QuadPart
                                                                : times.LastWriteTime.QuadPart) };
    return 0;
}

int fstat(int fd, struct stat *out) { return facts_of(handle_of(fd), out); }

static int facts_of_path(const char *path, DWORD flags, struct stat *out)
{
    WCHAR *wide = wide_path(path);
    if (!wide)
        return -1;
    HANDLE file = open_handle(wide, FILE_READ_ATTRIBUTES, OPEN_EXISTING, flags);
    free(wide);
    if (file == INVALID_HANDLE_VALUE)
        return ebpo_windows_fail();
    int result = facts_of(file, out);
    CloseHandle(file);
    return result;
}

int stat(const char *path, struct stat *out) { return facts_of_path(path, 0, out); }

int lstat(const char *path, struct stat *out)
{
    return facts_of_path(path, FILE_FLAG_OPEN_REPARSE_POINT, out);
}

int fstatat(int folder, const char *name, struct stat *out, int flags)
{
    char *path = path_below(folder, name);
    int result = !path ? -1 : flags & AT_SYMLINK_NOFOLLOW ? lstat(path, out) : stat(path, out);
    free(path);
    return result;
}

int access(const char *path, int mode)
{
    WCHAR *wide = wide_path(path);
    DWORD facts = wide ? GetFileAttributesW(wide) : INVALID_FILE_ATTRIBUTES;
    if (wide && facts == INVALID_FILE_ATTRIBUTES)
        (void)ebpo_windows_fail();
    free(wide);
    if (facts != INVALID_FILE_ATTRIBUTES && mode & W_OK && facts & FILE_ATTRIBUTE_READONLY)
        return fail_with(EACCES);
    return facts == INVALID_FILE_ATTRIBUTES ? -1 : 0;
}

/* Changes nothing, because Windows has no permission bits. Only checks that the file exists. */
int chmod(const char *path, mode_t mode)
{
    (void)mode;
    return access(path, 0);
}

int fchmod(int fd, mode_t mode)
{
    (void)mode;
    return handle_of(fd) == INVALID_HANDLE_VALUE ? -1 : 0;
}

int fchown(int fd, uid_t user, gid_t group)
{
    (void)fd, (void)user, (void)group;
    return 0;
}

int futimens(int fd, const struct timespec *times)
{
    FILETIME now;
    (void)times; /* always NULL: now */
    GetSystemTimeAsFileTime(&now);
    return SetFileTime(handle_of(fd), NULL, &now, &now) ? 0 : ebpo_windows_fail();
}

char *realpath(const char *path, char *out)
{
    WCHAR *wide = NULL, program[PATH_MAX];
    if (strcmp(path, "/proc/self/exe") == 0) {
        if (GetModuleFileNameW(NULL, program, PATH_MAX) < PATH_MAX)
            wide = absolute_path(program);
    } else {
        wide = wide_path(path);
    }
    if (!wide)
        return NULL;
    HANDLE file = open_handle(wide, FILE_READ_ATTRIBUTES, OPEN_EXISTING, 0);
    if (file == INVALID_HANDLE_VALUE) {
        free(wide);
        (void)ebpo_windows_fail();
        return NULL;
    }
    char *found = path_of(file);
    if (!found && wcslen(wide) > MAX_PATH) /* wine 8 does not support long paths here */
        found = plain_path(wide);
    CloseHandle(file);
    free(wide);
    size_t size = found ? strlen(found) : 0;
    /* "C:/" becomes "C:", so that '/' and a name can be added to every path */
    if (size && found[size - 1] == '/')
        found[--size] = 0;
    if (!found || !out)
        return found;
    bool fits = size < PATH_MAX;
    if (fits)
        memcpy(out, found, size + 1);
    free(found);
    errno = fits ? errno : ENAMETOOLONG;
    return fits ? out : NULL;
}

/* --- renaming and removing --- */

/* Removes the name of an open file or folder at once. Returns false if the file system does not
 * support this. */
static bool dispose_at_once(HANDLE file)
{
    DWORD flags = DISPOSE | DISPOSE_AT_ONCE | DISPOSE_READ_ONLY;
    return SetFileInformationByHandle(file, (FILE_INFO_BY_HANDLE_CLASS)FILE_DISPOSITION_EX, &flags,
                                      sizeof flags);
}

static int remove_wide(const WCHAR *path, bool folder)
{
    HANDLE file = open_handle(path, DELETE | FILE_READ_ATTRIBUTES, OPEN_EXISTING,
                              FILE_FLAG_OPEN_REPARSE_POINT);
    if (file == INVALID_HANDLE_VALUE)
        return ebpo_windows_fail();
    struct stat facts;
    int wrong = facts_of(file, &facts) != 0         ? errno
                : !S_ISDIR(facts.st_mode) && folder ? ENOTDIR
                : S_ISDIR(facts.st_mode) && !folder ? EISDIR
                                                    : 0;
    bool done = !wrong && dispose_at_once(file);
    CloseHandle(file);
    if (wrong)
        return fail_with(wrong);
    if (!done)
        done = folder ? RemoveDirectoryW(path) : DeleteFileW(path);
    return done ? 0 : ebpo_windows_fail();
}

static int remove_path(const char *path, bool folder)
{
    WCHAR *wide = wide_path(path);
    int result = wide ? remove_wide(wide, folder) : -1;
    free(wide);
    return result;
}

int unlink(const char *path) { return remove_path(path, false); }

int rmdir(const char *path) { return remove_path(path, true); }

int unlinkat(int folder, const char *name, int flags)
{
    char *path = path_below(folder, name);
    int result = path ? remove_path(path, flags & AT_REMOVEDIR) : -1;
    free(path);
    return result;
}

/* Renames a file even if another program has the target `to` open. That program keeps the former
 * content open. */
static bool rename_at_once(const WCHAR *from, const WCHAR *to)
{
    size_t bytes = wcslen(to) * sizeof *to;
    rename_info *info = calloc(1, sizeof *info + bytes + sizeof *to);
    HANDLE file =
        info ? open_handle(from, DELETE | SYNCHRONIZE, OPEN_EXISTING, FILE_FLAG_OPEN_REPARSE_POINT)
             : INVALID_HANDLE_VALUE;
    bool done = false;
    if (file != INVALID_HANDLE_VALUE) {
        info->flags = RENAME_REPLACE | RENAME_AT_ONCE;
        info->bytes = (DWORD)bytes;
        memcpy(info->name, to, bytes);
        done = SetFileInformationByHandle(file, (FILE_INFO_BY_HANDLE_CLASS)FILE_RENAME_EX, info,
                                          (DWORD)(sizeof *info + bytes));
        CloseHandle(file);
    }
    free(info);
    return done;
}

/* Tries several times, because indexers and virus scanners open new files for a moment. */
int rename(const char *from, const char *to)
{
    WCHAR *old = wide_path(from), *new = old ? wide_path(to) : NULL;
    bool done = false;
    for (int i = 0; new &&i < TRIES && !done; i++) {
        done = MoveFileExW(old, new, MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH);
        DWORD why = GetLastError();
        if (!done && why != ERROR_ACCESS_DENIED && why != ERROR_SHARING_VIOLATION)
            break;
        done = done || rename_at_once(old, new);
        if (!done)
            Sleep(TRY_MS);
        SetLastError(why);
    }
    if (new && !done)
        (void)ebpo_windows_fail();
    free(old);
    free(new);
    return done ? 0 : -1;
}

int renameat(int from_folder, const char *from, int to_folder, const char *to)
{
    char *old = path_below(from_folder, from), *new = old ? path_below(to_folder, to) : NULL;
    int result = new ? rename(old, new) : -1;
    free(old);
    free(new);
    return result;
}

int linkat(int from_folder, const char *from, int to_folder, const char *to, int flags)
{
    (void)from_folder, (void)from, (void)to_folder, (void)to, (void)flags;
    return fail_with(ENOSYS);
}

/* --- new folders and names --- */

int mkdir(const char *path, mode_t mode)
{
    (void)mode;
    WCHAR *wide = wide_path(path);
    bool done = wide && CreateDirectoryW(wide, NULL);
    if (wide && !done)
        (void)ebpo_windows_fail();
    free(wide);
    return done ? 0 : -1;
}

int mkdirat(int folder, const char *name, mode_t mode)
{
    char *path = path_below(folder, name);
    int result = path ? mkdir(path, mode) : -1;
    free(path);
    return result;
}

/* Replaces the six X at the end of a pattern by characters that probably no other name has. */
static void choose_letters(char *pattern)
{
    static atomic_uint number;
    LARGE_INTEGER ticks;
    QueryPerformanceCounter(&ticks);
    uint64_t mixed = ((uint64_t)ticks.QuadPart ^ (uint64_t)getpid() << 40 ^
                      (uint64_t)atomic_fetch_add(&number, 1) << 20) *
                     UINT64_C(0x9e3779b97f4a7c15);
    size_t size = strlen(pattern);
    for (int i = 0; i < 6; i++, mixed >>= 5)
        pattern[size - 6 + i] = "abcdefghijklmnopqrstuvwxyz234567"[mixed >> 5 & 31];
}

char *mkdtemp(char *pattern)
{
    for (int i = 0; i < 100; i++) {
        choose_letters(pattern);
        if (mkdir(pattern, 0700) == 0)
            return pattern;
        if (errno != EEXIST)
            break;
    }
    return NULL;
}

int mkostemp(char *pattern, int flags)
{
    for (int i = 0; i < 100; i++) {
        choose_letters(pattern);
        int fd = open(pattern, O_RDWR | O_CREAT | O_EXCL | flags, 0600);
        if (fd >= 0 || errno != EEXIST)
            return fd;
    }
    return -1;
}

/* --- descriptors --- */

ssize_t pread(int fd, void *data, size_t bytes, off_t at)
{
    OVERLAPPED where = { .Offset = (DWORD)at, .OffsetHigh = (DWORD)((uint64_t)at >> 32) };
    DWORD received = 0;
    if (ReadFile(handle_of(fd), data, bytes < INT_MAX ? (DWORD)bytes : INT_MAX, &received, &where))
        return (ssize_t)received;
    return GetLastError() == ERROR_HANDLE_EOF ? 0 : ebpo_windows_fail();
}

ssize_t pwrite(int fd, const void *data, size_t bytes, off_t at)
{
    OVERLAPPED where = { .Offset = (DWORD)at, .OffsetHigh = (DWORD)((uint64_t)at >> 32) };
    DWORD written = 0;
    if (WriteFile(handle_of(fd), data, bytes < INT_MAX ? (DWORD)bytes : INT_MAX, &written, &where))
        return (ssize_t)written;
    return ebpo_windows_fail();
}

/* Locks one byte far after the end of the file. On Windows, no other process can read locked bytes,
 * so a lock of the content would keep others from reading it. */
int flock(int fd, int how)
{
    OVERLAPPED where = { .OffsetHigh = 0x40000000 };
    HANDLE file = handle_of(fd);
    if (how & LOCK_UN)
        return UnlockFileEx(file, 0, 1, 0, &where) ? 0 : ebpo_windows_fail();
    DWORD flags = LOCKFILE_EXCLUSIVE_LOCK | (how & LOCK_NB ? LOCKFILE_FAIL_IMMEDIATELY : 0);
    if (LockFileEx(file, flags, 0, 1, 0, &where))
        return 0;
    return GetLastError() == ERROR_IO_PENDING ? fail_with(EWOULDBLOCK) : ebpo_windows_fail();
}

/* Flushes a file, even if it was opened only for reading. Does not flush folders, because NTFS
 * writes names to its journal. */
int fsync(int fd)
{
    struct stat facts;
    HANDLE file = handle_of(fd);
    if (fstat(fd, &facts) == 0 && S_ISDIR(facts.st_mode))
        return 0;
    if (FlushFileBuffers(file))
        return 0;
    if (GetLastError() != ERROR_ACCESS_DENIED)
        return ebpo_windows_fail();
    HANDLE again =
        ReOpenFile(file, GENERIC_WRITE, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, 0);
    if (again == INVALID_HANDLE_VALUE)
        return ebpo_windows_fail();
    int result = FlushFileBuffers(again) ? 0 : ebpo_windows_fail();
    CloseHandle(again);
    return result;
}

/* F_SETFL sets only O_NONBLOCK, and only for sockets. */
int fcntl(int fd, int what, ...)
{
    if (what == F_SETFL && ebpo_windows_socket_state(fd) >= 0) {
        va_list arguments;
        va_start(arguments, what);
        int flags = va_arg(arguments, int);
        va_end(arguments);
        return ebpo_windows_socket_waits(fd, !(flags & O_NONBLOCK));
    }
    /* F_DUPFD_CLOEXEC has an argument: the new descriptor must not be less than it. All callers
     * give 3. The argument is ignored, because the descriptors 0 to 2 are always in use. */
    if (what == F_DUPFD_CLOEXEC) {
        int copy = _dup(fd);
        return copy;
    }
    intptr_t file = _get_osfhandle(fd);
    return file == -1 || file == -2 ? fail_with(EBADF) : 0;
}

int pipe(int ends[2]) { return _pipe(ends, 1 << 16, _O_BINARY | _O_NOINHERIT); }

/* --- folders --- */

struct ebpo_windows_folder {
    int fd;
    HANDLE found; /* INVALID_HANDLE_VALUE: no entry was read */
    bool ended;
    WCHAR *pattern;
    struct dirent entry;
};

DIR *fdopendir(int fd)
{
    DIR *folder = calloc(1, sizeof *folder);
    char *path = folder ? path_of(handle_of(fd)) : NULL, *pattern = NULL;
    if (path && asprintf(&pattern, "%s/*", path) < 0)
        pattern = NULL;
    if (pattern)
        folder->pattern = wide_path(pattern);
    free(path);
    free(pattern);
    if (!folder || !folder->pattern) {
        free(folder);
        return NULL;
    }
    folder->fd = fd;
    folder->found = INVALID_HANDLE_VALUE;
    return folder;
}

DIR *opendir(const char *path)
{
    int fd = open(path, O_RDONLY | O_DIRECTORY);
    DIR *folder = fd >= 0 ? fdopendir(fd) : NULL;
    if (fd >= 0 && !folder)
        close(fd);
    return folder;
}

struct dirent *readdir(DIR *folder)
{
    WIN32_FIND_DATAW data;
    if (folder->ended)
        return NULL;
    if (folder->found == INVALID_HANDLE_VALUE) {
        folder->found = FindFirstFileW(folder->pattern, &data);
        folder->ended = folder->found == INVALID_HANDLE_VALUE;
    } else {
        folder->ended = !FindNextFileW(folder->found, &data);
    }
    if (folder->ended)
        return NULL;
    folder->entry.d_name[0] = 0;
    WideCharToMultiByte(CP_UTF8, 0, data.cFileName, -1, folder->entry.d_name,
                        sizeof folder->entry.d_name, NULL, NULL);
    return &folder->entry;
}

int dirfd(DIR *folder) { return folder->fd; }

int closedir(DIR *folder)
{
    if (folder->found != INVALID_HANDLE_VALUE)
        FindClose(folder->found);
    int result = close(folder->fd);
    free(folder->pattern);
    free(folder);
    return result;
}
