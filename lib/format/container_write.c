/* ebpo_tree_write: headers, the chunks of the first levels, the index of large arrays' chunks, and
 * all other chunks, in one go. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/sha256.h"
#include "core/arrays.h"
#include "core/sized.h"
#include "hdf5_read/face_gates.h"
#include "format/chunk_layout.h"
#include "format/chunk_sums.h"
#include "format/content.h"
#include "format/head_facts.h"
#include "format/container_write.h"
#include "format/headers_write.h"
#include "format/long_chunk.h"
#include "format/places.h"
#include "io/publish.h"

/* Chunks that are in memory at a time: 8 MiB raw and as much encoded. */
enum { WINDOW = 128 };

typedef struct slot {
    const ebpo_array_out *array;
    uint64_t chunk;
    uint8_t *raw, *stored;
    size_t raw_bytes, stored_bytes;
    ebpo_status status;
} slot;

typedef struct writer {
    ebpo_plan plan;
    const ebpo_write_options *options;
    unsigned threads;
    ebpo_headers head;
    slot slots[WINDOW];
    unsigned used;            /* slots */
    ebpo_chunk_coder *coders; /* one for each thread */
    ebpo_chunk_order order;
    ebpo_array_digest *digest; /* [arrays of the plan] */
    ebpo_content content[EBPO_DIGESTS];
    uint64_t chunk_bytes, chunks_done;
    uint64_t *sum; /* [chunks], if sums are written: of the plan's arrays one after the other */
    uint64_t *first_sum; /* [arrays of the plan] */
    uint64_t *place;     /* [rows of places] */
    uint64_t place_count, top_bytes;
    uint64_t index_at; /* where the index begins; 0: there is none, or not yet */
} writer;

static ebpo_status fill_slot(void *context, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    writer *w = context;
    (void)worker;
    (void)error;
    for (uint64_t i = begin; i < end; i++) {
        slot *s = &w->slots[i];
        const ebpo_shape *shape = &s->array->shape;
        uint64_t row = s->chunk * shape->chunk_rows, rows = shape->rows - row < shape->chunk_rows
                                                                ? shape->rows - row
                                                                : shape->chunk_rows;
        size_t bytes = rows * ebpo_shape_row_bytes(shape);
        s->raw_bytes = shape->chunk_rows * ebpo_shape_row_bytes(shape);
        ebpo_plan_encode(&w->plan, s->array, row, rows, s->raw);
        memset(s->raw + bytes, 0, s->raw_bytes - bytes);
    }
    return EBPO_OK;
}

static void digest_slots(writer *w)
{
    for (unsigned i = 0; i < w->used; i++) {
        const slot *s = &w->slots[i];
        const ebpo_shape *shape = &s->array->shape;
        uint64_t row = s->chunk * shape->chunk_rows, left = shape->rows - row;
        ebpo_array_digest *state = &w->digest[s->array - w->plan.array];
        uint8_t digest[32];
        if (!ebpo_content_has(&w->plan.info, s->array->id))
            continue;
        if (row == 0)
            ebpo_array_digest_begin(state);
        ebpo_array_digest_add(state, &w->plan.info, s->array->id, shape, row,
                              left < shape->chunk_rows ? left : shape->chunk_rows, s->raw);
        if (left > shape->chunk_rows)
            continue;
        ebpo_array_digest_end(state, digest);
        ebpo_content_put(&w->content[ebpo_content_of(s->array->id)], s->array->path, digest);
    }
}

/* The filling of the last chunk is no face. */
static ebpo_status compress_gates(slot *s, ebpo_chunk_coder *coder, int level)
{
    ebpo_shape stored = ebpo_stored_shape(&s->array->shape, true);
    uint64_t left = stored.rows - s->chunk * stored.chunk_rows,
             rows = left < stored.chunk_rows ? left : stored.chunk_rows;
    size_t ends[EBPO_GATES_ENDS], bytes = stored.chunk_rows * ebpo_shape_row_bytes(&stored);
    ebpo_gates_encode(s->raw, (uint32_t)rows, coder->scratch, ends);
    memset(coder->scratch + rows * EBPO_GATES_COLS, 0, bytes - rows * EBPO_GATES_COLS);
    return ebpo_chunk_encode_streams(coder, stored.pipeline, level, coder->scratch, bytes, ends,
                                     EBPO_GATES_ENDS, s->stored, &s->stored_bytes);
}

static ebpo_status compress_chunk(slot *s, ebpo_chunk_coder *coder, int level)
{
    const ebpo_shape *shape = &s->array->shape;
    return s->array->gates ? compress_gates(s, coder, level)
                           : ebpo_chunk_encode(coder, shape->pipeline, level, shape->element_size,
                                               s->raw, s->raw_bytes, s->stored, &s->stored_bytes);
}

/* Item 0 digests the whole window, the others compress one slot each. */
static ebpo_status compress_slot(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    writer *w = context;
    for (uint64_t i = begin; i < end; i++) {
        if (i == 0) {
            digest_slots(w);
            continue;
        }
        slot *s = &w->slots[i - 1];
        ebpo_status status = compress_chunk(s, &w->coders[worker], w->options->codec_level);
        if (status != EBPO_OK)
            return ebpo_fail_at(error, status, w->head.out.shown, s->array->path, -1,
                                "a chunk could not be compressed");
    }
    return EBPO_OK;
}

static ebpo_status encode_window(writer *w, ebpo_error *error)
{
    unsigned threads = w->used > 4 ? w->threads : 1;
    ebpo_status status = ebpo_parallel_for(threads, w->plan.tree->mesh.workspace, w->used, 1,
                                           fill_slot, w, NULL, "write", error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, w->plan.tree->mesh.workspace, w->used + 1u, 1,
                                   compress_slot, w, NULL, "write", error);
    return status;
}

static void note_place(writer *w, uint32_t number, uint64_t bytes)
{
    if (!w->head.list[EBPO_LIST_PLACES].shape.rows)
        return;
    w->place[w->place_count++] = ebpo_place(number, bytes);
}

/* Called for each chunk, in the order of the file, before it is written. */
static void place_chunk(writer *w, const slot *s)
{
    if (w->index_at == 0 && ebpo_shape_chunks(&s->array->shape) > 1) {
        w->index_at = w->head.head_bytes + w->chunk_bytes;
        note_place(w, EBPO_PLACE_GAP, w->head.index_bytes);
    }
    uint32_t number = ebpo_place_number(s->array->id, s->array->level);
    note_place(w, number, s->stored_bytes);
    if (w->head.list[EBPO_LIST_SUMS].shape.rows)
        w->sum[w->first_sum[s->array - w->plan.array] + s->chunk] =
            ebpo_place(number, ebpo_chunk_sum(s->stored, s->stored_bytes));
    w->chunk_bytes += s->stored_bytes;
    if (w->chunks_done + 1 == w->order.top)
        w->top_bytes =
            w->head.head_bytes + w->chunk_bytes + (w->index_at ? w->head.index_bytes : 0);
}

static ebpo_status flush_window(writer *w, ebpo_error *error)
{
    ebpo_status status = encode_window(w, error);
    for (unsigned i = 0; i < w->used && status == EBPO_OK; i++) {
        const slot *s = &w->slots[i];
        place_chunk(w, s);
        if (w->chunks_done++ == 0)
            continue; /* written with the headers */
        status = ebpo_h5_put_chunk(&w->head.out, s->array->path, s->array->handle, &s->array->shape,
                                   s->chunk, s->stored, s->stored_bytes, error);
    }
    w->used = 0;
    const ebpo_progress *progress = &w->options->progress;
    if (status == EBPO_OK &&
        !ebpo_progress_step(progress, "writing", w->chunks_done, w->order.count, error))
        status = EBPO_E_CANCELLED;
    return status;
}

static ebpo_status write_chunks(writer *w, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < w->order.count && status == EBPO_OK; i++) {
        w->slots[w->used].array = &w->plan.array[w->order.chunk[i].array];
        w->slots[w->used++].chunk = w->order.chunk[i].chunk;
        if (w->used == WINDOW)
            status = flush_window(w, error);
    }
    return status == EBPO_OK && w->used ? flush_window(w, error) : status;
}

static ebpo_status write_list(writer *w, ebpo_list list, const uint64_t *values, size_t *bytes,
                              ebpo_error *error)
{
    const ebpo_array_out *a = &w->head.list[list];
    uint8_t *stored = NULL;
    *bytes = 0;
    if (!a->shape.rows)
        return EBPO_OK;
    ebpo_status status = ebpo_long_chunk_encode(values, a->shape.rows, a->shape.pipeline,
                                                w->options->codec_level, &stored, bytes, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_chunk(&w->head.out, a->path, a->handle, &a->shape, 0, stored, *bytes,
                                   error);
    free(stored);
    return status;
}

/* The last chunks of the file. Where libhdf5 has put something else in between, the lists say that
 * they do not hold. */
static ebpo_status write_lists(writer *w, ebpo_error *error)
{
    size_t bytes[EBPO_LISTS];
    uint64_t offset = w->head.head_bytes + w->chunk_bytes + w->head.index_bytes, size = 0;
    const uint64_t *values[EBPO_LISTS] = { w->sum, w->place };
    ebpo_status status =
        write_list(w, EBPO_LIST_SUMS, values[EBPO_LIST_SUMS], &bytes[EBPO_LIST_SUMS], error);
    if (status == EBPO_OK && bytes[EBPO_LIST_SUMS])
        note_place(w, ebpo_place_number(EBPO_A_CHUNK_SUMS, 0), bytes[EBPO_LIST_SUMS]);
    if (status == EBPO_OK)
        status = write_list(w, EBPO_LIST_PLACES, values[EBPO_LIST_PLACES], &bytes[EBPO_LIST_PLACES],
                            error);
    if (status == EBPO_OK)
        status = ebpo_h5_size(&w->head.out, &size, error);
    bool holds =
        status == EBPO_OK && size == offset + bytes[EBPO_LIST_SUMS] + bytes[EBPO_LIST_PLACES];
    for (ebpo_list l = 0; l < EBPO_LISTS && status == EBPO_OK; l++) {
        if (w->head.list[l].shape.rows)
            status =
                ebpo_headers_put_holds(&w->head, l, holds ? size : 0, holds ? offset : 0, error);
        offset += bytes[l];
    }
    return status;
}

static ebpo_status make_window(writer *w, ebpo_error *error)
{
    size_t bound = ebpo_chunk_bound(EBPO_CHUNK_BYTES_MAX),
           slot_bytes = EBPO_CHUNK_BYTES_MAX + bound;
    uint64_t wanted = w->order.count < WINDOW ? w->order.count : WINDOW;
    w->threads = ebpo_thread_count(w->options->threads);
    w->coders = ebpo_alloc_zero(w->threads, sizeof *w->coders);
    uint8_t *block = ebpo_alloc(wanted, slot_bytes);
    w->slots[0].raw = block;
    w->digest = ebpo_alloc(w->plan.count, sizeof *w->digest);
    w->place = ebpo_alloc(w->head.list[EBPO_LIST_PLACES].shape.rows, sizeof *w->place);
    w->sum = ebpo_alloc(w->head.list[EBPO_LIST_SUMS].shape.rows, sizeof *w->sum);
    w->first_sum = ebpo_alloc(w->plan.count, sizeof *w->first_sum);
    if (!w->coders || !block || !w->digest || !w->place || !w->sum || !w->first_sum)
        return ebpo_fail_memory(error, wanted * slot_bytes);
    for (unsigned i = 0; i < wanted; i++) {
        w->slots[i].raw = block + i * slot_bytes;
        w->slots[i].stored = w->slots[i].raw + EBPO_CHUNK_BYTES_MAX;
    }
    uint64_t sums = 0;
    for (unsigned i = 0; i < w->plan.count; i++) {
        w->first_sum[i] = sums;
        sums += ebpo_shape_chunks(&w->plan.array[i].shape);
    }
    return EBPO_OK;
}

/* The root's types, encoded ahead of its turn. */
static ebpo_status encode_first(writer *w, uint8_t *stored, size_t *bytes, ebpo_error *error)
{
    slot *s = &w->slots[0];
    s->array = &w->plan.array[0];
    s->chunk = 0;
    (void)fill_slot(w, 0, 1, 0, NULL);
    ebpo_status status = compress_slot(w, 1, 2, 0, error);
    *bytes = s->stored_bytes;
    memcpy(stored, s->stored, s->stored_bytes);
    return status;
}

static ebpo_status put_digests(writer *w, ebpo_error *error)
{
    uint8_t digest[32];
    ebpo_status status = ebpo_content_end(&w->content[EBPO_DIGEST_CONTENT], digest, error);
    if (status == EBPO_OK)
        status = ebpo_facts_put_digest(&w->head.out, w->head.root, digest, error);
    if (status != EBPO_OK || !(w->plan.info.parts & EBPO_PART_COLOURS))
        return status;
    status = ebpo_content_end(&w->content[EBPO_DIGEST_COLOURS], digest, error);
    return status == EBPO_OK
               ? ebpo_facts_put_colours_digest(&w->head.out, w->head.root, digest, error)
               : status;
}

static ebpo_status write_file(writer *w, const char *path, const char *shown, ebpo_error *error)
{
    uint8_t first[256]; /* the chunk is of two bytes */
    size_t first_bytes = 0;
    ebpo_status status = encode_first(w, first, &first_bytes, error);
    if (status == EBPO_OK)
        status = ebpo_headers_measure(&w->head, shown, error);
    if (status == EBPO_OK)
        status = ebpo_headers_lay_out(&w->head, path, shown,
                                      (ebpo_first_chunk){ first, first_bytes }, error);
    if (status == EBPO_OK && w->head.index_bytes)
        status = ebpo_headers_begin_index(&w->head, error);
    if (status == EBPO_OK)
        status = write_chunks(w, error);
    if (status == EBPO_OK)
        status = write_lists(w, error);
    if (status == EBPO_OK)
        status = put_digests(w, error);
    if (status == EBPO_OK)
        status = ebpo_facts_put_index(&w->head.out, w->head.root, w->index_at, w->head.index_bytes,
                                      error);
    if (status == EBPO_OK && w->plan.info.subtree_level)
        status = ebpo_facts_put_top(&w->head.out, w->head.root, w->top_bytes, error);
    ebpo_headers_close(&w->head);
    if (status == EBPO_OK)
        /* another libhdf5 may have placed metadata otherwise: no reader relies on it, tests do */
        status = ebpo_h5_finish(&w->head.out, error);
    return status;
}

static ebpo_status check_options(const ebpo_write_options *options, const char *path,
                                 ebpo_error *error)
{
    int most = options->codec == EBPO_CODEC_ZSTD      ? 22
               : options->codec == EBPO_CODEC_DEFLATE ? 9
                                                      : 0;
    if ((unsigned)options->codec > EBPO_CODEC_NONE || options->codec_level < 0 ||
        options->codec_level > most)
        return ebpo_fail_file(
            error, EBPO_E_ARGUMENT, path,
            "no such codec or codec level; zstd takes 1 to 22, deflate 1 to 9, none takes 0");
    if ((unsigned)options->chunk_sums > EBPO_SUMS_NONE)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, path, "chunk_sums: there is no choice %u",
                              (unsigned)options->chunk_sums);
    return EBPO_OK;
}

/* Publishes the file under its name; without `publish` writes right into `path`. */
static ebpo_status write_tree(const ebpo_tree *tree, const char *path, const char *shown,
                              ebpo_publish *publish, const ebpo_write_options *options,
                              ebpo_error *error)
{
    ebpo_write_options wanted = EBPO_WRITE_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_write_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    writer *w = ebpo_alloc_zero(1, sizeof *w);
    if (!w)
        return ebpo_fail_memory(error, sizeof *w);
    w->options = &wanted;
    status = check_options(w->options, shown, error);
    if (status == EBPO_OK && !ebpo_progress_stage(&w->options->progress, "writing", error))
        status = EBPO_E_CANCELLED;
    if (status == EBPO_OK)
        status = ebpo_plan_make(&w->plan, tree, w->options, shown, error);
    if (status == EBPO_OK)
        status = ebpo_chunk_order_make(&w->order, &w->plan, error);
    ebpo_headers_plan(&w->head, &w->plan, w->order.count, w->options);
    if (status == EBPO_OK)
        status = make_window(w, error);
    if (status == EBPO_OK && publish)
        status = ebpo_publish_begin(publish, path, error);
    if (status == EBPO_OK)
        status = write_file(w, publish ? ebpo_publish_path(publish) : path, shown, error);
    ebpo_headers_close(&w->head);
    ebpo_h5_discard(&w->head.out);
    if (status == EBPO_OK && publish)
        status = ebpo_publish_commit(publish, error);
    for (unsigned i = 0; w->coders && i < w->threads; i++)
        ebpo_chunk_coder_clear(&w->coders[i]);
    free(w->coders);
    free(w->slots[0].raw);
    free(w->digest);
    free(w->place);
    free(w->sum);
    free(w->first_sum);
    ebpo_chunk_order_free(&w->order);
    ebpo_plan_free(&w->plan);
    for (int i = 0; i < EBPO_DIGESTS; i++)
        ebpo_content_free(&w->content[i]);
    free(w);
    return status;
}

ebpo_status ebpo_tree_write(const ebpo_tree *tree, const char *path,
                            const ebpo_write_options *options, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_publish publish = EBPO_PUBLISH_INIT;
    ebpo_status status = write_tree(tree, path, path, &publish, options, error);
    ebpo_publish_abort(&publish);
    return status;
}

ebpo_status ebpo_tree_write_into(const ebpo_tree *tree, const char *path, const char *shown,
                                 const ebpo_write_options *options, ebpo_error *error)
{
    return write_tree(tree, path, shown, NULL, options, error);
}
