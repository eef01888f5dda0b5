#include "base/error.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "ebpo_config.h"

const char *ebpo_version(void) { return EBPO_VERSION; }

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

ebpo_status ebpo_fail(ebpo_error *error, ebpo_status status, const char *format, ...)
{
    if (error) {
        error->status = status;
        va_list args;
        va_start(args, format);
        vsnprintf(error->message, sizeof error->message, format, args);
        va_end(args);
        /* One line, whatever a file name or another library's message brings along. */
        for (char *c = error->message; *c; c++)
            if ((unsigned char)*c < 0x20 || *c == 0x7f)
                *c = ' ';
    }
    return status;
}

ebpo_status ebpo_fail_memory(ebpo_error *error, uint64_t bytes)
{
    return ebpo_fail(error, EBPO_E_MEMORY, "out of memory: %" PRIu64 " bytes could not be had",
                     bytes);
}

ebpo_status ebpo_fail_errno(ebpo_error *error, const char *path, const char *what)
{
    return ebpo_fail(error, EBPO_E_IO, "%s: %s: %s", path, what, strerror(errno));
}
