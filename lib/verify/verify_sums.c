/* The list of how chunks end, against the chunks: read by itself, without the reader's check. */
#include <inttypes.h>
#include <stdlib.h>

#include "core/endian.h"
#include "core/error.h"
#include "format/chunk_directory.h"
#include "verify/verify_subtrees.h"

#define CHECK(condition, ...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, condition, __VA_ARGS__)

enum { SUM_BYTES = 4, UNKNOWN = 20000 };

typedef struct comparison {
    ebpo_tally *tally;
    const ebpo_file *file;
    const uint64_t *list;
    uint64_t rows;
} comparison;

/* Each array's number as the specification gives it. */
static uint32_t number_of(const ebpo_array_in *a)
{
    switch (a->id) {
    case EBPO_A_VERTICES: return 4096;
    case EBPO_A_FACES: return 4097;
    case EBPO_A_FACES_INDEX: return 4098;
    case EBPO_A_VERTEX_SOURCE: return 4099;
    case EBPO_A_FACE_SOURCE: return 4100;
    case EBPO_A_SUBTREE_INDEX: return 4112;
    case EBPO_A_SUBTREE_COUNTS: return 4113;
    case EBPO_A_SUBTREE_OUTER: return 4114;
    case EBPO_A_ATTRIBUTE: return 8191 + (uint32_t)a->level;
    default: return a->id < EBPO_LEVEL_ARRAYS ? 64 * (uint32_t)a->level + (uint32_t)a->id : UNKNOWN;
    }
}

static ebpo_status compare_chunk(comparison *c, const ebpo_array_in *a, uint64_t chunk,
                                 uint64_t row, ebpo_error *error)
{
    ebpo_tally *tally = c->tally;
    ebpo_chunk_place at = a->chunks[chunk];
    uint8_t end[SUM_BYTES] = { 0 };
    if (!CHECK(at.bytes >= SUM_BYTES, "%s, chunk %" PRIu64 ": less than four bytes", a->path,
               chunk))
        return EBPO_OK;
    ebpo_status status = ebpo_input_read(&ebpo_reader_own(c->file)->in,
                                         at.address + at.bytes - SUM_BYTES, SUM_BYTES, end, error);
    if (status == EBPO_OK)
        CHECK(ebpo_load32(end) == (uint32_t)c->list[row],
              "%s, chunk %" PRIu64 ": /chunk_sums, row %" PRIu64 ", says %08" PRIx32
              ", but it ends with %08" PRIx32,
              a->path, chunk, row, (uint32_t)c->list[row], ebpo_load32(end));
    return status;
}

static ebpo_status compare_array(comparison *c, const ebpo_array_in *a, ebpo_error *error)
{
    ebpo_tally *tally = c->tally;
    ebpo_status status = EBPO_OK;
    uint32_t number = number_of(a);
    if (!a->present || number == UNKNOWN)
        return EBPO_OK;
    uint64_t found = 0, chunks = ebpo_shape_chunks(&a->shape);
    for (uint64_t row = 0; row < c->rows && status == EBPO_OK; row++)
        if ((uint32_t)(c->list[row] >> 32) == number && found++ < chunks)
            status = compare_chunk(c, a, found - 1, row, error);
    CHECK(found == chunks, "/chunk_sums has %" PRIu64 " rows of the %" PRIu64 " chunks of %s",
          found, chunks, a->path);
    return status;
}

static ebpo_status compare(comparison *c, ebpo_error *error)
{
    const ebpo_file *file = c->file;
    ebpo_status status = EBPO_OK;
    for (int level = 0; level < file->info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS && status == EBPO_OK; id++)
            status = compare_array(c, &file->level_array[level][id], error);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS && status == EBPO_OK; id++)
        status = compare_array(c, &file->root_array[id], error);
    for (int i = 0; i < file->attributes.arrays && status == EBPO_OK; i++)
        status = compare_array(c, &file->attributes.array[i], error);
    return status;
}

ebpo_status ebpo_check_sums(ebpo_tally *tally, const ebpo_file *file, ebpo_error *error)
{
    const ebpo_array_in *a = &file->root_array[EBPO_A_CHUNK_SUMS];
    ebpo_error own = EBPO_ERROR_INIT;
    uint64_t *list = NULL;
    /* far away each chunk would take a request: there the reader's own check has to do */
    if (!file->has_sums || ebpo_input_expects(&ebpo_reader_own(file)->in))
        return EBPO_OK;
    ebpo_status status = ebpo_file_locate(file, NULL, &own);
    if (status == EBPO_OK)
        status = ebpo_long_chunk_read(file, a, &list, &own);
    comparison c = { tally, file, list, a->shape.rows };
    if (status == EBPO_OK)
        status = compare(&c, &own);
    free(list);
    if (status != EBPO_E_FORMAT)
        return status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &own);
    CHECK(false, "%s", own.message);
    return EBPO_OK;
}
