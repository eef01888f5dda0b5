/* The checksum of the part `attributes`: of the values, however they are stored. */
#include <stdlib.h>

#include "core/array_loops.h"
#include "hdf5_read/coding.h"
#include "format/attribute_digest.h"
#include "format/schema.h"
#include "format/content.h"

enum { PIECE = 1 << 16 };

static void digest_values(ebpo_content *content, int number, ebpo_workspace *workspace,
                          const uint8_t *values, uint64_t count, size_t size)
{
    uint8_t file[PIECE], digest[32];
    char path[EBPO_PATH_BYTES];
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    EBPO_FOR_PIECES(workspace, at, count, PIECE / size) {
        uint64_t here = count - at < PIECE / size ? count - at : PIECE / size;
        ebpo_integers_encode(values + at * size, size, here, size, file);
        ebpo_sha256_add(&state, file, here * size);
    }
    ebpo_sha256_end(&state, digest);
    ebpo_attribute_path(number, path);
    ebpo_content_put(content, path, digest);
}

ebpo_status ebpo_attributes_digest(const ebpo_attributes *attributes, uint8_t digest[32],
                                   ebpo_error *error)
{
    ebpo_content content = { .entries = NULL };
    ebpo_workspace *workspace = attributes->workspace;
    if (attributes->header)
        digest_values(&content, 0, NULL, (const uint8_t *)attributes->header,
                      attributes->header_bytes, 1);
    for (uint64_t i = 0; i < attributes->count; i++) {
        const ebpo_attribute *a = &attributes->array[i];
        unsigned bytes = ebpo_attribute_bytes(a->type);
        uint64_t count = ebpo_attribute_value_count(a);
        if (a->ends)
            digest_values(&content, ebpo_values_number(i), workspace, (const uint8_t *)a->ends,
                          a->rows, sizeof *a->ends);
        if (!a->ends || count)
            digest_values(&content, a->ends ? ebpo_items_number(i) : ebpo_values_number(i),
                          workspace, a->values, count, bytes);
    }
    ebpo_status status = ebpo_content_end(&content, digest, error);
    ebpo_content_free(&content);
    return status;
}
