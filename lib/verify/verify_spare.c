/* Bytes of the file that belong to nothing. What stands there changes no answer, but a change of it
 * shall not go unseen. */
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "format/chunk_directory.h"
#include "hdf5_read/head.h"
#include "verify/verify_subtrees.h"

typedef struct survey {
    const ebpo_file *file;
    const ebpo_progress *progress;
    ebpo_head head;
    ebpo_range *range; /* what belongs to something */
    uint64_t count, capacity;
} survey;

static ebpo_status add_range(survey *s, ebpo_range range, ebpo_error *error)
{
    if (!ebpo_grow(&s->range, &s->capacity, s->count + 1, sizeof *s->range))
        return ebpo_fail_memory(error, (s->count + 1) * sizeof *s->range);
    s->range[s->count++] = range;
    return EBPO_OK;
}

static ebpo_status add_array(survey *s, const ebpo_array_in *a, ebpo_head_rows rows,
                             ebpo_error *error)
{
    ebpo_shape shape;
    ebpo_chunk_place *chunks = NULL;
    uint64_t stored;
    if (!a->present)
        return EBPO_OK;
    ebpo_status status = ebpo_head_read_array(&s->head, a->path, UINT64_MAX, rows, &shape, NULL,
                                              &chunks, &stored, error);
    uint64_t count = status == EBPO_OK ? ebpo_shape_chunks(&shape) : 0;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        status = add_range(s, (ebpo_range){ chunks[i].address, chunks[i].bytes }, error);
    free(chunks);
    return status;
}

static ebpo_status add_arrays(survey *s, ebpo_error *error)
{
    const ebpo_file *f = s->file;
    ebpo_status status = EBPO_OK;
    for (int level = 0; level < f->info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS && status == EBPO_OK; id++)
            status = add_array(s, &f->level_array[level][id],
                               ebpo_reader_rows_of_chunk(f, (ebpo_array_id)id), error);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS && status == EBPO_OK; id++)
        status = add_array(s, &f->root_array[id], ebpo_reader_rows_of_chunk(f, (ebpo_array_id)id),
                           error);
    for (int i = 0; i < f->attributes.arrays && status == EBPO_OK; i++)
        status = add_array(s, &f->attributes.array[i],
                           ebpo_reader_rows_of_chunk(f, EBPO_A_ATTRIBUTE), error);
    return status;
}

static ebpo_status add_metadata(survey *s, ebpo_error *error)
{
    ebpo_range *kept, superblock = { 0, EBPO_HEAD_SUPERBLOCK_BYTES };
    uint64_t count;
    ebpo_status status = ebpo_head_take_ranges(&s->head, &kept, &count, error);
    if (status == EBPO_OK)
        status = add_range(s, superblock, error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        status = add_range(s, kept[i], error);
    free(kept);
    return status;
}

static int by_offset(const void *a, const void *b)
{
    uint64_t x = ((const ebpo_range *)a)->offset, y = ((const ebpo_range *)b)->offset;
    return (x > y) - (x < y);
}

/* Counts the bytes of a gap that are not zero. It may be nearly all of a large file. */
static ebpo_status look_at_gap(const survey *s, ebpo_range gap, uint64_t *filled, ebpo_error *error)
{
    enum { PIECE = 1 << 14 };
    uint8_t piece[PIECE];
    ebpo_input *in = &ebpo_reader_own(s->file)->in;
    ebpo_status status = EBPO_OK;
    while (gap.size && status == EBPO_OK) {
        uint64_t size = gap.size < PIECE ? gap.size : PIECE;
        if (!ebpo_progress_step(s->progress, "looking at unused bytes", gap.offset, in->source.size,
                                error))
            return EBPO_E_CANCELLED;
        status = ebpo_input_read(in, gap.offset, size, piece, error);
        for (uint64_t i = 0; i < size && status == EBPO_OK; i++)
            *filled += piece[i] != 0;
        gap = (ebpo_range){ gap.offset + size, gap.size - size };
    }
    return status;
}

static ebpo_status look_at_gaps(survey *s, uint64_t *spare, uint64_t *filled, ebpo_error *error)
{
    uint64_t file_end = ebpo_reader_own(s->file)->in.source.size;
    ebpo_status status = add_range(s, (ebpo_range){ file_end, 0 }, error);
    uint64_t end = 0;
    if (status == EBPO_OK)
        qsort(s->range, s->count, sizeof *s->range, by_offset);
    for (uint64_t i = 0; i < s->count && status == EBPO_OK; i++) {
        ebpo_range r = s->range[i];
        if (r.offset > end) {
            *spare += r.offset - end;
            status = look_at_gap(s, (ebpo_range){ end, r.offset - end }, filled, error);
        }
        if (r.offset + r.size > end)
            end = r.offset + r.size;
    }
    return status;
}

ebpo_status ebpo_count_spare(const ebpo_file *file, const ebpo_progress *progress, uint64_t *spare,
                             uint64_t *filled, ebpo_error *error)
{
    ebpo_input *in = &ebpo_reader_own(file)->in;
    survey s = { .file = file, .progress = progress, .head = EBPO_HEAD_INIT };
    ebpo_error own = EBPO_ERROR_INIT;
    *spare = *filled = 0;
    if (ebpo_input_expects(in))
        return EBPO_OK;
    ebpo_status status = ebpo_head_open(&s.head, in, &own);
    if (status == EBPO_OK) {
        ebpo_head_keep_ranges(&s.head);
        status = add_arrays(&s, &own);
    }
    if (status == EBPO_OK)
        status = add_metadata(&s, &own);
    status = ebpo_head_close(&s.head, status, &own);
    if (status == EBPO_OK)
        status = look_at_gaps(&s, spare, filled, &own);
    free(s.range);
    /* what is damaged is told by those who read it */
    return status == EBPO_OK || status == EBPO_E_FORMAT ? EBPO_OK : ebpo_fail_with(error, &own);
}
