/* Telling the source what will be read. */
#include <stdlib.h>

#include "core/alloc.h"
#include "format/reader.h"

static void add_range(ebpo_expected *e, uint64_t offset, uint64_t size)
{
    ebpo_range *last = e->count ? &e->range[e->count - 1] : NULL;
    if (last && last->offset + last->size == offset)
        last->size += size;
    else if (ebpo_grow(&e->range, &e->capacity, e->count + 1,
                       sizeof *e->range)) /* else it is read without having been announced */
        e->range[e->count++] = (ebpo_range){ offset, size };
}

bool ebpo_expected_wanted(const ebpo_expected *e)
{
    return e->summed || ebpo_input_expects(&e->file->in) ||
           (e->near && ebpo_input_hints(&e->file->in));
}

void ebpo_expect_chunks(ebpo_expected *e, const ebpo_array_in *array, uint64_t begin, uint64_t end)
{
    /* A failure is the reading's to tell. */
    if (!ebpo_expected_wanted(e) || !array->present || e->failed)
        return;
    /* not again and again: each time would take all retries */
    e->failed = ebpo_reader_locate(e->file, array, NULL) != EBPO_OK;
    if (e->failed)
        return;
    for (uint64_t i = begin; i < end; i++)
        add_range(e, array->chunks[i].address, array->chunks[i].bytes);
}

void ebpo_expect_array(ebpo_expected *e, const ebpo_array_in *array)
{
    ebpo_expect_chunks(e, array, 0, array->present ? ebpo_shape_chunks(&array->shape) : 0);
}

void ebpo_expect_level(ebpo_expected *e, int level, uint32_t without)
{
    uint32_t needs = ebpo_schema_has(&e->file->info) & ~without;
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
        if (ebpo_schema[id].needs & needs)
            ebpo_expect_array(e, &e->file->level_array[level][id]);
}

void ebpo_expect_root(ebpo_expected *e, uint32_t needs)
{
    /* the list of sums comes with whatever is read first */
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_A_CHUNK_SUMS; id++)
        if (ebpo_schema[id].needs & needs)
            ebpo_expect_array(e, &e->file->root_array[id]);
}

void ebpo_expect_attributes(ebpo_expected *e)
{
    for (int i = 0; i < e->file->attributes.arrays; i++)
        ebpo_expect_array(e, &e->file->attributes.array[i]);
}

static int compare_ranges(const void *a, const void *b)
{
    uint64_t x = ((const ebpo_range *)a)->offset, y = ((const ebpo_range *)b)->offset;
    return (x > y) - (x < y);
}

/* By place, joined where at most so many bytes lie between them. */
static void join_ranges(ebpo_expected *e, uint64_t between)
{
    uint64_t kept = 0;
    if (e->count)
        qsort(e->range, e->count, sizeof *e->range, compare_ranges);
    for (uint64_t i = 0; i < e->count; i++) {
        ebpo_range *last = kept ? &e->range[kept - 1] : NULL, next = e->range[i];
        uint64_t end = next.offset + next.size;
        if (last && next.offset <= last->offset + last->size + between)
            last->size = end > last->offset + last->size ? end - last->offset : last->size;
        else
            e->range[kept++] = next;
    }
    e->count = kept;
}

/* Each takes a call of the system. */
static void hint_system(ebpo_expected *e)
{
    enum { BETWEEN = 16 << 10 };
    join_ranges(e, BETWEEN);
    ebpo_input_hint(&ebpo_reader_own(e->file)->in, e->range, e->count);
}

uint64_t ebpo_expected_bytes(ebpo_expected *e)
{
    uint64_t sum = 0;
    join_ranges(e, 0);
    for (uint64_t i = 0; i < e->count; i++)
        sum += e->range[i].size;
    free(e->range);
    *e = (ebpo_expected)EBPO_EXPECTED_INIT(e->file);
    return sum;
}

/* Without the list of sums nothing is read. */
static bool wants_sums(const ebpo_file *file)
{
    return file->has_sums && !atomic_load(&file->summed);
}

static ebpo_range where_sums(const ebpo_file *file)
{
    const ebpo_chunk_place *at = file->root_array[EBPO_A_CHUNK_SUMS].chunks;
    return (ebpo_range){ at->address, at->bytes };
}

void ebpo_expect_all(ebpo_expected *e)
{
    if (e->count && wants_sums(e->file))
        add_range(e, where_sums(e->file).offset, where_sums(e->file).size);
    if (ebpo_input_expects(&e->file->in))
        ebpo_input_expect(&ebpo_reader_own(e->file)->in, e->range, e->count);
    else
        hint_system(e);
    free(e->range);
    *e = (ebpo_expected)EBPO_EXPECTED_INIT(e->file);
}

/* Not of a size that no file has for its first levels. */
static bool is_top(const ebpo_info *info)
{
    enum { SHARE = 16, ANYWAY = 1 << 20 };
    return info->top_bytes <= info->file_bytes / SHARE + ANYWAY;
}

void ebpo_expect_top(const ebpo_file *file)
{
    const ebpo_info *info = &file->info;
    ebpo_file *own = ebpo_reader_own(file);
    uint64_t index_end = info->chunk_index_offset + info->chunk_index_bytes, from,
             top = info->top_bytes < info->file_bytes ? info->top_bytes : info->file_bytes;
    if (!ebpo_input_expects(&file->in) || !file->has_places || atomic_load(&file->located) ||
        !is_top(info))
        return;
    const ebpo_chunk_place *places = file->root_array[EBPO_A_PLACES].chunks;
    ebpo_range range[4] = { { places->address, places->bytes } };
    size_t count = 1;
    if (wants_sums(file))
        range[count++] = where_sums(file);
    from = file->in.source.prefetched;
    if (from < info->chunk_index_offset && info->chunk_index_offset <= top)
        range[count++] = (ebpo_range){ from, info->chunk_index_offset - from };
    from = from > index_end ? from : index_end;
    if (from < top)
        range[count++] = (ebpo_range){ from, top - from };
    ebpo_input_expect(&own->in, range, count);
}

void ebpo_file_prefetch_levels(const ebpo_file *file, int first, int last)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(file);
    int end = last < file->info.level_count - 1 ? last : file->info.level_count - 1;
    for (int level = first < 0 ? 0 : first; level <= end; level++)
        ebpo_expect_level(&e, level, 0);
    ebpo_expect_all(&e);
}

void ebpo_expect_tree(const ebpo_file *file)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(file);
    for (int level = 0; level < file->info.level_count; level++)
        ebpo_expect_level(&e, level, 0);
    ebpo_expect_root(&e, ~0u);
    ebpo_expect_attributes(&e);
    ebpo_expect_all(&e);
}
