#include "core/error.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "ebpo_config.h"

const char *ebpo_version(void) { return EBPO_VERSION; }

int ebpo_version_number(void) { return EBPO_VERSION_NUMBER; }

const char *ebpo_status_name(ebpo_status status)
{
    switch (status) {
    case EBPO_OK: return "EBPO_OK";
    case EBPO_E_MEMORY: return "EBPO_E_MEMORY";
    case EBPO_E_ARGUMENT: return "EBPO_E_ARGUMENT";
    case EBPO_E_IO: return "EBPO_E_IO";
    case EBPO_E_FORMAT: return "EBPO_E_FORMAT";
    case EBPO_E_VERSION: return "EBPO_E_VERSION";
    case EBPO_E_UNSUPPORTED: return "EBPO_E_UNSUPPORTED";
    case EBPO_E_NOT_SOLID: return "EBPO_E_NOT_SOLID";
    case EBPO_E_LIMIT: return "EBPO_E_LIMIT";
    case EBPO_E_CANCELLED: return "EBPO_E_CANCELLED";
    case EBPO_E_ABSENT: return "EBPO_E_ABSENT";
    }
    return "unknown status";
}

/* Always one line, even if a file name or another library's message has several. */
static void keep_to_one_line(char *text)
{
    for (; *text; text++)
        if ((unsigned char)*text < 0x20 || *text == 0x7f)
            *text = ' ';
}

static ebpo_status fail(ebpo_error *error, ebpo_status status, const char *file, const char *object,
                        int64_t offset, const char *format, va_list args)
{
    int begin = 0;
    if (!error)
        return status;
    *error = (ebpo_error){ .status = status, .offset = offset };
    if (*file)
        begin = snprintf(error->message, sizeof error->message, "%s: %s%s", file, object,
                         *object ? ": " : "");
    if (begin < (int)sizeof error->message)
        vsnprintf(error->message + begin, sizeof error->message - (size_t)begin, format, args);
    snprintf(error->file, sizeof error->file, "%s", file);
    snprintf(error->object, sizeof error->object, "%s", object);
    keep_to_one_line(error->message);
    keep_to_one_line(error->file);
    keep_to_one_line(error->object);
    return status;
}

ebpo_status ebpo_fail(ebpo_error *error, ebpo_status status, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fail(error, status, "", "", -1, format, args);
    va_end(args);
    return status;
}

ebpo_status ebpo_fail_file(ebpo_error *error, ebpo_status status, const char *file,
                           const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fail(error, status, file, "", -1, format, args);
    va_end(args);
    return status;
}

ebpo_status ebpo_fail_at(ebpo_error *error, ebpo_status status, const char *file,
                         const char *object, int64_t offset, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fail(error, status, file, object, offset, format, args);
    va_end(args);
    return status;
}

ebpo_status ebpo_fail_with(ebpo_error *error, const ebpo_error *cause)
{
    if (error)
        *error = *cause;
    return cause->status;
}

ebpo_status ebpo_fail_memory(ebpo_error *error, uint64_t bytes)
{
    return ebpo_fail(error, EBPO_E_MEMORY,
                     "out of memory: %" PRIu64 " bytes could not be allocated", bytes);
}

ebpo_status ebpo_fail_errno(ebpo_error *error, const char *path, const char *what)
{
    return ebpo_fail_file(error, EBPO_E_IO, path, "%s: %s", what, strerror(errno));
}
