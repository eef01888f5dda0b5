/* Starts a program on Windows: passes its arguments to `main` as UTF-8, and switches off the
 * conversion of line ends in standard input, output and error. */
#define WIN32_LEAN_AND_MEAN
#include <windows.h>

#include "core/os.h"
#include "core/os_windows_parts.h"

int main(int argc, char **argv);
int wmain(int argc, wchar_t **argv);

/* Replaces '\' by '/' in an argument that is a path. An argument counts as a path if the folder
 * before its last '\' exists. */
static void use_slashes(const wchar_t *wide, char *text)
{
    wchar_t folder[PATH_MAX];
    const wchar_t *last = wcsrchr(wide, L'\\');
    if (!last || wcslen(wide) >= PATH_MAX)
        return;
    wcscpy(folder, wide);
    folder[last - wide + 1] = 0;
    if (GetFileAttributesW(folder) == INVALID_FILE_ATTRIBUTES)
        return;
    for (char *c = text; *c; c++)
        *c = *c == '\\' ? '/' : *c;
}

int wmain(int argc, wchar_t **argv)
{
    char **text = calloc((size_t)argc + 1, sizeof *text);
    for (int i = 0; text && i < argc; i++) {
        text[i] = ebpo_windows_narrow(argv[i]);
        if (!text[i])
            return 1;
        use_slashes(argv[i], text[i]);
    }
    for (int fd = 0; fd <= 2; fd++)
        _setmode(fd, _O_BINARY);
    SetConsoleOutputCP(CP_UTF8);
    return text ? main(argc, text) : 1;
}
