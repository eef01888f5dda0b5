/* Computes the content checksum from the path and the SHA-256 of each array, sorted by path. The
 * SHA-256 is computed from the array's bytes before shuffle and compression, so the checksum does
 * not depend on the codec, the chunks or HDF5. Codes that restart at each chunk (vertices, source
 * indices) are recoded as in a file without subtrees. The part `attributes` has a separate checksum
 * of its values, so the content checksum is the same with and without attributes. Source:
 * format-spec/checksums.md. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/endian.h"
#include "core/error.h"
#include "format/content_checksum.h"
#include "format/schema.h"
#include "hdf5_read/coding.h"

enum {
    PLAIN_FACE_ROWS = 4096, /* faces in a chunk of a file without subtrees */
    /* number of chunks that PLAIN_FACE_ROWS faces take in a file with subtrees. In such a file,
     * /mesh/faces_index has a row for each chunk. In a file without subtrees, it has only every
     * SKIPPED-th of these rows */
    SKIPPED = PLAIN_FACE_ROWS / EBPO_FACE_BLOCK
};

bool ebpo_content_has(const ebpo_info *info, ebpo_array_id id)
{
    if (id == EBPO_A_FACES_INDEX && info->subtree_level) /* as in a file without subtrees */
        return info->face_count > PLAIN_FACE_ROWS;
    return !ebpo_schema_is_list(id) &&
           !(ebpo_schema[id].needs & (EBPO_NEEDS_SUBTREES | EBPO_NEEDS_ATTRIBUTES));
}

void ebpo_array_digest_begin(ebpo_array_digest *digest) { ebpo_sha256_begin(&digest->state); }

void ebpo_array_digest_end(ebpo_array_digest *digest, uint8_t out[32])
{
    ebpo_sha256_end(&digest->state, out);
}

static uint64_t load_integer(const uint8_t *at, unsigned size)
{
    return size == 4 ? ebpo_load32(at) : ebpo_load64(at);
}

/* Convert a zigzag code to a difference and back, modulo 2^(8 * size). The codes 0, 1, 2, 3, 4
 * stand for the differences 0, -1, 1, -2, 2. */
static uint64_t decode_zigzag(uint64_t code) { return (code >> 1) ^ (0 - (code & 1)); }

static uint64_t encode_zigzag(uint64_t value, unsigned size)
{
    return size == 4 ? (uint32_t)((uint32_t)value << 1 ^ (0 - ((uint32_t)value >> 31)))
                     : value << 1 ^ (0 - (value >> 63));
}

/* Recodes the first row of a chunk of differences as in a file without subtrees, and writes it to
 * `joined`. `continues`: true if that file would have this chunk and the previous chunk in one
 * larger chunk. The row is then the difference from the last row of the previous chunk. Keeps the
 * values of this chunk's last row in digest->last. */
static void join_deltas(ebpo_array_digest *digest, const ebpo_shape *shape, bool continues,
                        uint64_t rows, const uint8_t *bytes, uint8_t *joined)
{
    unsigned size = shape->element_size, cols = shape->cols ? shape->cols : 1;
    for (unsigned k = 0; k < cols; k++) {
        const uint8_t *column = bytes + k * size;
        uint64_t sum = 0, from = continues ? digest->last[k] : 0,
                 code = encode_zigzag(decode_zigzag(load_integer(column, size)) - from, size);
        for (uint64_t i = 0; i < rows; i++)
            sum += decode_zigzag(load_integer(column + i * cols * size, size));
        digest->last[k] = sum;
        if (size == 4)
            ebpo_store32(joined + k * size, (uint32_t)code);
        else
            ebpo_store64(joined + k * size, code);
    }
}

/* Adds only the rows of /mesh/faces_index that the same model has in a file without subtrees. */
static void add_faces_index(ebpo_array_digest *digest, uint64_t row, uint64_t rows,
                            size_t row_bytes, const uint8_t *bytes)
{
    for (uint64_t i = 0; i < rows; i++)
        if ((row + i) % SKIPPED == 0)
            ebpo_sha256_add(&digest->state, bytes + i * row_bytes, row_bytes);
}

void ebpo_array_digest_add(ebpo_array_digest *digest, const ebpo_info *info, ebpo_array_id id,
                           const ebpo_shape *shape, uint64_t row, uint64_t rows,
                           const uint8_t *bytes)
{
    size_t row_bytes = ebpo_shape_row_bytes(shape);
    uint32_t full = ebpo_full_chunk_rows(shape->rows, shape->cols, shape->element_size);
    uint8_t joined[3 * sizeof(uint64_t)];
    /* arrays of differences, which restart at each chunk */
    bool deltas = id == EBPO_A_VERTICES || id == EBPO_A_BORDER_POINTS ||
                  id == EBPO_A_VERTEX_SOURCE || id == EBPO_A_FACE_SOURCE;
    if (info->subtree_level && id == EBPO_A_FACES_INDEX) {
        add_faces_index(digest, row, rows, row_bytes, bytes);
    } else if (info->subtree_level && deltas) {
        join_deltas(digest, shape, row % full != 0, rows, bytes, joined);
        ebpo_sha256_add(&digest->state, joined, row_bytes);
        ebpo_sha256_add(&digest->state, bytes + row_bytes, (rows - 1) * row_bytes);
    } else {
        ebpo_sha256_add(&digest->state, bytes, rows * row_bytes);
    }
}

void ebpo_content_put(ebpo_content *content, const char *path, const uint8_t digest[32])
{
    if (!ebpo_grow(&content->entries, &content->capacity, content->count + 1,
                   sizeof *content->entries)) {
        content->short_of_memory = true;
        return;
    }
    ebpo_content_entry *entry = &content->entries[content->count++];
    snprintf(entry->path, sizeof entry->path, "%s", path);
    memcpy(entry->digest, digest, 32);
}

static int by_path(const void *a, const void *b)
{
    return strcmp(((const ebpo_content_entry *)a)->path, ((const ebpo_content_entry *)b)->path);
}

ebpo_status ebpo_content_end(ebpo_content *content, uint8_t digest[32], ebpo_error *error)
{
    if (content->short_of_memory)
        return ebpo_fail_memory(error, (content->count + 1) * sizeof *content->entries);
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    if (content->count)
        qsort(content->entries, content->count, sizeof *content->entries, by_path);
    for (uint64_t i = 0; i < content->count; i++) {
        ebpo_sha256_add(&state, content->entries[i].path, strlen(content->entries[i].path) + 1);
        ebpo_sha256_add(&state, content->entries[i].digest, 32);
    }
    ebpo_sha256_end(&state, digest);
    return EBPO_OK;
}

void ebpo_content_free(ebpo_content *content)
{
    free(content->entries);
    memset(content, 0, sizeof *content);
}

/* --- the checksum of the part `attributes`: over values, independent of their storage --- */

enum { PIECE = 1 << 16 }; /* bytes that are encoded at a time */

/* Adds the entry of array `number` of /attributes, which has `count` values of `size` bytes. */
static void digest_values(ebpo_content *content, int number, ebpo_workspace *workspace,
                          const uint8_t *values, uint64_t count, size_t size)
{
    uint8_t encoded[PIECE], digest[32];
    char path[EBPO_PATH_BYTES];
    ebpo_sha256 state;
    ebpo_sha256_begin(&state);
    EBPO_FOR_PIECES(workspace, at, count, PIECE / size) {
        uint64_t step = count - at < PIECE / size ? count - at : PIECE / size;
        ebpo_integers_encode(values + at * size, size, step, size, encoded);
        ebpo_sha256_add(&state, encoded, step * size);
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
