#include "core/sized.h"

#include <ctype.h>
#include <string.h>

#include "core/error.h"

/* No struct has been smaller than its size and one member, and none will be larger than two
 * pages. */
enum { SMALLEST = 2 * sizeof(size_t), LARGEST = 8192 };

static bool plausible(size_t size)
{
    return size >= SMALLEST && size <= LARGEST && size % sizeof(size_t) == 0;
}

ebpo_status ebpo_sized_check(size_t size, const char *type, ebpo_error *error)
{
    char macro[64];
    size_t n = 0;
    if (plausible(size))
        return EBPO_OK;
    for (; type[n] && n + 1 < sizeof macro; n++)
        macro[n] = (char)toupper((unsigned char)type[n]);
    macro[n] = 0;
    return ebpo_fail(error, EBPO_E_ARGUMENT,
                     "%s: its struct_size is %zu, which no version has; begin it with %s_INIT",
                     type, size, macro);
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
                             "%s: something is set in it that libebpo %s does not know; leave it "
                             "away, or use a newer library",
                             type, ebpo_version());
    memcpy((unsigned char *)own + sizeof(size_t), bytes + sizeof(size_t), common - sizeof(size_t));
    return EBPO_OK;
}

ebpo_status ebpo_sized_give(void *out, size_t out_size, const void *filled, size_t size)
{
    unsigned char *bytes = out;
    size_t common = out_size < size ? out_size : size;
    if (!plausible(out_size))
        return EBPO_E_ARGUMENT;
    memcpy(bytes + sizeof(size_t), (const unsigned char *)filled + sizeof(size_t),
           common - sizeof(size_t));
    memset(bytes + common, 0, out_size - common);
    return EBPO_OK;
}
