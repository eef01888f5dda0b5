/* The list of all chunks, against HDF5's own index. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/chunk_directory.h"
#include "format/reader.h"
#include "verify/verify_subtrees.h"

#define CHECK(condition, ...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, condition, __VA_ARGS__)

/* An array as HDF5 tells it, and how many of its chunks the list has had. */
typedef struct indexed {
    const ebpo_array_in *array;
    uint32_t number;
    ebpo_chunk_place *chunks;
    uint64_t count, listed;
} indexed;

enum { MOST = EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS };

typedef struct comparison {
    ebpo_tally *tally;
    const ebpo_file *file;
    ebpo_head head;
    indexed array[MOST];
    unsigned arrays;
    uint64_t *list, rows;
    uint64_t top; /* end of what looking up a subtree takes */
} comparison;

/* Numbers as the specification gives them: 64 a level; then the mesh, the maps, the table. */
static ebpo_status index_array(comparison *c, const ebpo_array_in *array, uint32_t number,
                               ebpo_error *error)
{
    ebpo_shape shape;
    uint64_t stored;
    if (!array->present)
        return EBPO_OK;
    indexed *to = &c->array[c->arrays++];
    *to = (indexed){ .array = array, .number = number };
    ebpo_status status =
        ebpo_head_read_array(&c->head, array->path, UINT64_MAX, EBPO_HEAD_ROWS_POWER, &shape, NULL,
                             &to->chunks, &stored, error);
    to->count = status == EBPO_OK ? ebpo_shape_chunks(&shape) : 0;
    return status;
}

static ebpo_status index_all(comparison *c, ebpo_error *error)
{
    static const struct {
        ebpo_array_id id;
        uint32_t number;
    } roots[] = { { EBPO_A_VERTICES, 4096 },       { EBPO_A_FACES, 4097 },
                  { EBPO_A_FACES_INDEX, 4098 },    { EBPO_A_VERTEX_SOURCE, 4099 },
                  { EBPO_A_FACE_SOURCE, 4100 },    { EBPO_A_SUBTREE_INDEX, 4112 },
                  { EBPO_A_SUBTREE_COUNTS, 4113 }, { EBPO_A_SUBTREE_OUTER, 4114 } };
    ebpo_status status = EBPO_OK;
    for (int level = 0; level < c->file->info.level_count && status == EBPO_OK; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS && status == EBPO_OK; id++)
            status = index_array(c, &c->file->level_array[level][id], (uint32_t)(64 * level + id),
                                 error);
    for (size_t i = 0; i < sizeof roots / sizeof *roots && status == EBPO_OK; i++)
        status = index_array(c, &c->file->root_array[roots[i].id], roots[i].number, error);
    return status;
}

static ebpo_status read_list(comparison *c, ebpo_error *error)
{
    const ebpo_array_in *a = &c->file->root_array[EBPO_A_PLACES];
    const char *why = "";
    uint8_t *stored = ebpo_alloc(a->chunks[0].bytes, 1);
    c->rows = a->shape.rows;
    ebpo_status status = stored
                             ? ebpo_input_read(&ebpo_reader_own(c->file)->in, a->chunks[0].address,
                                               a->chunks[0].bytes, stored, error)
                             : ebpo_fail_memory(error, a->chunks[0].bytes);
    if (status == EBPO_OK)
        status = ebpo_long_chunk_decode(stored, a->chunks[0].bytes, a->shape.pipeline, c->rows,
                                        &c->list, &why, error);
    if (status == EBPO_E_FORMAT)
        status = ebpo_fail_file(error, status, c->file->in.shown, "/subtrees/places: %s", why);
    free(stored);
    return status;
}

static indexed *find(comparison *c, uint32_t number)
{
    for (unsigned i = 0; i < c->arrays; i++)
        if (c->array[i].number == number)
            return &c->array[i];
    return NULL;
}

static bool is_top(const comparison *c, const indexed *of)
{
    return of->number == 4112 ||
           (of->number < 4096 && of->array->level <= c->file->info.subtree_level);
}

static void compare_row(comparison *c, uint64_t row, uint64_t at, uint32_t bytes)
{
    ebpo_tally *tally = c->tally;
    uint32_t number = (uint32_t)(c->list[row] >> 32);
    indexed *of = find(c, number);
    if (!of) {
        CHECK(number >= 4096,
              "/subtrees/places, row %" PRIu64 ": number %" PRIu32
              " is of an array that is not in the file",
              row, number);
        return;
    }
    if (!CHECK(of->listed < of->count,
               "/subtrees/places, row %" PRIu64 ": %s has only %" PRIu64 " chunks", row,
               of->array->path, of->count))
        return;
    const ebpo_chunk_place *chunk = &of->chunks[of->listed++];
    CHECK(chunk->address == at && chunk->bytes == bytes,
          "/subtrees/places, row %" PRIu64 ": %" PRIu32 " bytes at %" PRIu64 " as chunk %" PRIu64
          " of %s, but HDF5 has %" PRIu32 " at %" PRIu64,
          row, bytes, at, of->listed - 1, of->array->path, chunk->bytes, chunk->address);
    if (is_top(c, of) && chunk->address + chunk->bytes > c->top)
        c->top = chunk->address + chunk->bytes;
}

static void compare(comparison *c)
{
    ebpo_tally *tally = c->tally;
    uint64_t at = c->array[0].chunks[0].address;
    for (uint64_t row = 0; row < c->rows; row++) {
        uint32_t bytes = (uint32_t)c->list[row];
        compare_row(c, row, at, bytes);
        at += bytes;
    }
    for (unsigned i = 0; i < c->arrays; i++)
        CHECK(c->array[i].listed == c->array[i].count,
              "/subtrees/places has %" PRIu64 " of the %" PRIu64 " chunks of %s",
              c->array[i].listed, c->array[i].count, c->array[i].array->path);
    uint64_t top = c->file->info.top_bytes;
    CHECK(top == 0 || (top >= c->top && top <= c->file->info.file_bytes),
          "top_bytes states %" PRIu64 ", but what looking up a subtree takes ends at %" PRIu64, top,
          c->top);
}

ebpo_status ebpo_check_places(ebpo_tally *tally, const ebpo_file *file,
                              const ebpo_verify_options *options, ebpo_error *error)
{
    ebpo_error own = EBPO_ERROR_INIT;
    (void)options;
    if (!file->has_places)
        return EBPO_OK;
    comparison *c = ebpo_alloc_zero(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->tally = tally;
    c->file = file;
    c->head = (ebpo_head)EBPO_HEAD_INIT;
    ebpo_status status = ebpo_head_open(&c->head, &ebpo_reader_own(file)->in, &own);
    if (status == EBPO_OK)
        status = index_all(c, &own);
    status = ebpo_head_close(&c->head, status, &own);
    if (status == EBPO_OK)
        status = read_list(c, &own);
    if (status == EBPO_OK)
        compare(c);
    for (unsigned i = 0; i < c->arrays; i++)
        free(c->array[i].chunks);
    free(c->list);
    free(c);
    if (status != EBPO_E_FORMAT)
        return status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &own);
    CHECK(false, "%s", own.message);
    return EBPO_OK;
}
