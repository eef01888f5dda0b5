/* Fills in errors, and reads and writes versioned structs, for all public functions. An error has a
 * status and a message that names file and object. A function whose callee fails returns the
 * callee's error, so the error describes the first cause. Versioned structs begin with their size
 * (ebpo/base.h), so the caller may have been compiled with an older or newer version of the header.
 * The library reads from options, and writes to results, only as many bytes as the caller's struct
 * has. Members of options that this version does not know must be 0. */
#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "core/error.h"
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
    case EBPO_E_PENDING: return "EBPO_E_PENDING";
    }
    return "unknown status";
}

/* Replaces line breaks, so that the message is one line even if a file name or another library's
 * message has several. */
static void keep_to_one_line(char *text)
{
    for (; *text; text++)
        if ((unsigned char)*text < 0x20 || *text == 0x7f)
            *text = ' ';
}

static ebpo_status fill_error(ebpo_error *error, ebpo_status status, const char *file,
                              const char *object, int64_t offset, const char *format, va_list args)
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
    fill_error(error, status, "", "", -1, format, args);
    va_end(args);
    return status;
}

ebpo_status ebpo_fail_file(ebpo_error *error, ebpo_status status, const char *file,
                           const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fill_error(error, status, file, "", -1, format, args);
    va_end(args);
    return status;
}

ebpo_status ebpo_fail_at(ebpo_error *error, ebpo_status status, const char *file,
                         const char *object, int64_t offset, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fill_error(error, status, file, object, offset, format, args);
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
    int number = errno;
    ebpo_fail_file(error, EBPO_E_IO, path, "%s: %s", what, strerror(number));
    if (error)
        error->system_error = number;
    return EBPO_E_IO;
}

/* Limits of struct_size: if the value is outside these limits, the caller did not initialise the
 * struct. A struct has at least the member struct_size and one more member. */
enum { SMALLEST = 2 * sizeof(size_t), LARGEST = 8192 };

static bool is_plausible_size(size_t size)
{
    return size >= SMALLEST && size <= LARGEST && size % sizeof(size_t) == 0;
}

ebpo_status ebpo_sized_check(size_t size, const char *type, ebpo_error *error)
{
    char macro[64];
    size_t n = 0;
    if (is_plausible_size(size))
        return EBPO_OK;
    for (; type[n] && n + 1 < sizeof macro; n++)
        macro[n] = (char)toupper((unsigned char)type[n]);
    macro[n] = 0;
    return ebpo_fail(error, EBPO_E_ARGUMENT,
                     "%s: invalid struct_size %zu; initialise the struct with %s_INIT", type, size,
                     macro);
}

ebpo_status ebpo_sized_take(void *own, size_t own_size, const void *given, size_t given_size,
                            const char *type, ebpo_error *error)
{
    const unsigned char *bytes = given;
    size_t common = given_size < own_size ? given_size : own_size;
    ebpo_status status = ebpo_sized_check(given_size, type, error);
    if (status != EBPO_OK)
        return status;
    for (size_t i = own_size; i < given_size; i++)
        if (bytes[i])
            return ebpo_fail(error, EBPO_E_UNSUPPORTED,
                             "%s: a field is set that libebpo %s does not support; clear it, or "
                             "use a newer library",
                             type, ebpo_version());
    memcpy((unsigned char *)own + sizeof(size_t), bytes + sizeof(size_t), common - sizeof(size_t));
    return EBPO_OK;
}

ebpo_status ebpo_sized_give(void *out, size_t out_size, const void *filled, size_t size)
{
    unsigned char *bytes = out;
    size_t common = out_size < size ? out_size : size;
    if (!is_plausible_size(out_size))
        return EBPO_E_ARGUMENT;
    memcpy(bytes + sizeof(size_t), (const unsigned char *)filled + sizeof(size_t),
           common - sizeof(size_t));
    memset(bytes + common, 0, out_size - common);
    return EBPO_OK;
}
