#include "io/foreign_bytes.h"

#include <string.h>
#include <strings.h>

#include "core/text.h"

enum { LOOK = 512 };

static const struct {
    const char *bytes;
    size_t count;
    const char *what;
} kinds[] = {
    { "version https://git-lfs.github.com/spec/", 40,
      "is a Git LFS pointer, not the file itself; fetch that: git lfs pull" },
    { "\xff\xfe\0\0", 4, "is text of four bytes a character (UTF-32); save it as UTF-8" },
    { "\0\0\xfe\xff", 4, "is text of four bytes a character (UTF-32); save it as UTF-8" },
    { "\xff\xfe", 2, "is text of two bytes a character (UTF-16); save it as UTF-8" },
    { "\xfe\xff", 2, "is text of two bytes a character (UTF-16); save it as UTF-8" },
    { "\x1f\x8b", 2, "is compressed by gzip; decompress it: gunzip <FILE >NEW" },
    { "BZh", 3, "is compressed by bzip2; decompress it: bunzip2 <FILE >NEW" },
    { "\xfd\x37zXZ\0", 6, "is compressed by xz; decompress it: unxz <FILE >NEW" },
    { "\x28\xb5\x2f\xfd", 4, "is compressed by zstd; decompress it: unzstd <FILE >NEW" },
    { "7z\xbc\xaf\x27\x1c", 6, "is a 7z archive; extract the file from it: 7z x" },
    { "PK\3\4", 4,
      "is a ZIP archive, as 3MF and NPZ files are; extract the file from it (unzip), or save the "
      "mesh as PLY, OBJ, STL or OFF" },
    { "\211HDF\r\n\032\n", 8,
      "is an HDF5 file; of an .ebpo.h5 file, 'ebpo extract --mesh' writes the mesh as a PLY" },
    { "glTF", 4, "is a glTF file; save the mesh as PLY, OBJ, STL or OFF" },
};

/* Text of two bytes a character without a mark: every other byte is zero. */
static bool is_wide(const uint8_t *data, uint64_t size)
{
    enum { CHARACTERS = 8 };
    if (size < 2 * CHARACTERS)
        return false;
    for (int first = 0; first < 2; first++) {
        int good = 0;
        for (int i = 0; i < CHARACTERS; i++) {
            uint8_t c = data[2 * i + first];
            good +=
                data[2 * i + 1 - first] == 0 && c < 0x7f && (c >= ' ' || (c >= '\t' && c <= '\r'));
        }
        if (good == CHARACTERS)
            return true;
    }
    return false;
}

static bool begins(const char *text, uint64_t size, const char *word)
{
    size_t n = strlen(word);
    return size >= n && strncasecmp(text, word, n) == 0;
}

/* Markup may begin behind white space. */
static const char *find_markup(const char *text, uint64_t size)
{
    for (; size && (*text == ' ' || (*text >= '\t' && *text <= '\r')); size--)
        text++;
    if (begins(text, size, "<!doctype html") || begins(text, size, "<html") ||
        begins(text, size, "<head"))
        return "is an HTML page, as servers send it for errors and logins; download the file "
               "itself";
    return begins(text, size, "<?xml") ? "is an XML file; save the mesh as PLY, OBJ, STL or OFF"
                                       : NULL;
}

const char *ebpo_foreign_bytes(const uint8_t *data, uint64_t size)
{
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (size >= kinds[i].count && memcmp(data, kinds[i].bytes, kinds[i].count) == 0)
            return kinds[i].what;
    if (is_wide(data, size))
        return "is text of two bytes a character (UTF-16); save it as UTF-8";
    uint64_t mark = ebpo_text_mark(data, size);
    return find_markup((const char *)data + mark, size - mark);
}

bool ebpo_bytes_are_text(const uint8_t *data, uint64_t size)
{
    for (uint64_t i = 0; i < size && i < LOOK; i++)
        if (data[i] == 0x7f || (data[i] < ' ' && !(data[i] >= '\t' && data[i] <= '\r')))
            return false;
    return size > 0;
}
