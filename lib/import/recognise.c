#include <string.h>
#include <strings.h>

#include "base/endian.h"
#include "import/import.h"

static bool begins(const uint8_t *data, uint64_t size, const char *word)
{
    size_t n = strlen(word);
    return size > n && memcmp(data, word, n) == 0 &&
           (data[n] == ' ' || (data[n] >= '\t' && data[n] <= '\r'));
}

/* "OFF", with letters before it for colours, normals and texture coordinates. */
static bool is_off(const uint8_t *data, uint64_t size)
{
    static const char *const words[] = { "OFF",   "COFF",   "NOFF",   "CNOFF",
                                         "STOFF", "STCOFF", "STNOFF", "STCNOFF" };
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (begins(data, size, words[i]))
            return true;
    return false;
}

/* Binary STL has no magic number, but its size follows from its count of faces. */
static bool is_stl(const uint8_t *data, uint64_t size)
{
    if (size >= 84 && size == 84 + 50 * (uint64_t)ebpo_load32(data + 80))
        return true;
    return begins(data, size, "solid");
}

bool ebpo_import_recognise(ebpo_import_format *format, const uint8_t *data, uint64_t size,
                           const char *name)
{
    size_t n = strlen(name);
    const char *ending = n >= 4 ? name + n - 4 : "";
    if (is_off(data, size) || strcasecmp(ending, ".off") == 0)
        *format = EBPO_IMPORT_OFF;
    else if (is_stl(data, size) || strcasecmp(ending, ".stl") == 0)
        *format = EBPO_IMPORT_STL;
    else if (strcasecmp(ending, ".obj") == 0)
        *format = EBPO_IMPORT_OBJ;
    else
        return false;
    return true;
}
