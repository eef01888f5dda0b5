/* Stands in for the readers of meshes, which the modules do not contain: recognises only the
 * common beginnings of mesh files, for the message on a file of another type. */
#include <string.h>

#include "mesh/import.h"

static const ebpo_import_format ply = { .called = "a PLY", .beginning_decides = true };
static const ebpo_import_format off = { .called = "an OFF" };

/* To this name open_file.c refers. */
const ebpo_import_format ebpo_import_stl = { .called = "an STL" };

static bool begins_with(const uint8_t *data, uint64_t size, const char *word)
{
    return size >= strlen(word) && memcmp(data, word, strlen(word)) == 0;
}

const ebpo_import_format *ebpo_import_recognise(const uint8_t *data, uint64_t size,
                                                const char *name)
{
    (void)name;
    if (begins_with(data, size, "ply\n") || begins_with(data, size, "ply\r"))
        return &ply;
    return begins_with(data, size, "solid ") ? &ebpo_import_stl
           : begins_with(data, size, "OFF")  ? &off
                                             : NULL;
}

bool ebpo_stl_states_size(const uint8_t *data, uint64_t known, uint64_t size)
{
    uint32_t faces = 0;
    if (known >= 84)
        memcpy(&faces, data + 80, sizeof faces);
    return faces && size == 84 + 50 * (uint64_t)faces;
}
