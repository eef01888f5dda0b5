/* Some rows of attributes, chunk by chunk: for subsets. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/schema.h"
#include "format/pick.h"

typedef struct picking {
    ebpo_chunks *chunks;
    const uint32_t *rows;
    uint64_t count;
    unsigned threads;
    ebpo_error *error;
} picking;

static ebpo_status copy_picked_rows(const picking *p, int number, const uint32_t *rows, uint64_t count,
                        void *out)
{
    return ebpo_pick_attribute_rows(p->chunks, number, rows, count, p->threads, out, p->error);
}

static ebpo_status pick_columns(const picking *p, uint64_t n, ebpo_attribute *a)
{
    uint64_t bytes = a->columns * (uint64_t)ebpo_attribute_bytes(a->type);
    a->values = ebpo_alloc(p->count, bytes);
    return a->values ? copy_picked_rows(p, ebpo_values_number(n), p->rows, p->count, a->values)
                     : ebpo_fail_memory(p->error, p->count * bytes);
}

/* Numbers of the items of all lists: a list begins where the one before it in the file ends. */
static ebpo_status number_items(const picking *p, ebpo_attribute *a, const uint64_t *before,
                                uint32_t **items)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; i < p->count; i++) {
        if (before[i] > a->ends[i])
            return ebpo_chunks_fail(p->chunks, -1, EBPO_A_ATTRIBUTE, "a list ends before it begins",
                                    p->error);
        if (a->ends[i] > UINT32_MAX || a->ends[i] - before[i] > UINT32_MAX - sum)
            return ebpo_fail_file(p->error, EBPO_E_LIMIT, p->chunks->file->in.shown,
                                  "the lists of an attribute have more than 2^32 - 1 items; leave "
                                  "attributes out");
        sum += a->ends[i] - before[i];
    }
    uint32_t *next = *items = ebpo_alloc(sum, sizeof *next);
    if (!next)
        return ebpo_fail_memory(p->error, sum * sizeof *next);
    for (uint64_t i = 0; i < p->count; i++) {
        for (uint64_t k = before[i]; k < a->ends[i]; k++)
            *next++ = (uint32_t)k;
        a->ends[i] = (uint64_t)(next - *items);
    }
    return EBPO_OK;
}

/* Ends of the rows before those that are picked. */
static ebpo_status pick_before(const picking *p, uint64_t n, uint64_t *before)
{
    uint32_t *rows = ebpo_alloc(p->count, sizeof *rows);
    if (!rows)
        return ebpo_fail_memory(p->error, p->count * sizeof *rows);
    for (uint64_t i = 0; i < p->count; i++)
        rows[i] = p->rows[i] ? p->rows[i] - 1 : 0;
    ebpo_status status = copy_picked_rows(p, ebpo_values_number(n), rows, p->count, before);
    for (uint64_t i = 0; i < p->count; i++)
        if (p->rows[i] == 0)
            before[i] = 0;
    free(rows);
    return status;
}

static ebpo_status pick_lists(const picking *p, uint64_t n, ebpo_attribute *a)
{
    unsigned bytes = ebpo_attribute_bytes(a->type);
    uint32_t *items = NULL;
    uint64_t *before = ebpo_alloc(p->count, sizeof *before);
    a->ends = ebpo_alloc(p->count, sizeof *a->ends);
    ebpo_status status = before && a->ends
                             ? copy_picked_rows(p, ebpo_values_number(n), p->rows, p->count, a->ends)
                             : ebpo_fail_memory(p->error, p->count * 2 * sizeof *before);
    if (status == EBPO_OK)
        status = pick_before(p, n, before);
    if (status == EBPO_OK)
        status = number_items(p, a, before, &items);
    uint64_t count = status == EBPO_OK && p->count ? a->ends[p->count - 1] : 0;
    if (status == EBPO_OK) {
        a->values = ebpo_alloc(count, bytes);
        status = a->values ? EBPO_OK : ebpo_fail_memory(p->error, count * bytes);
    }
    if (status == EBPO_OK && count)
        status = copy_picked_rows(p, ebpo_items_number(n), items, count, a->values);
    free(items);
    free(before);
    return status;
}

ebpo_status ebpo_pick_attributes(ebpo_chunks *chunks, ebpo_attributes *to, const char *element,
                                 const uint32_t *rows, uint64_t count, unsigned threads,
                                 ebpo_error *error)
{
    picking p = { chunks, rows, count, threads, error };
    ebpo_status status = EBPO_OK;
    for (uint64_t n = 0; n < to->count && status == EBPO_OK; n++) {
        ebpo_attribute *a = &to->array[n];
        if (!ebpo_attribute_is_of(a, element))
            continue;
        status = chunks->file->attributes.head[n].different ? pick_lists(&p, n, a)
                                                            : pick_columns(&p, n, a);
        a->rows = count;
    }
    return status;
}
