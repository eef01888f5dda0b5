/* ebpo_tree_write: lays the file out once in memory to learn the sizes of its metadata, then writes
 * headers, the chunks of the first levels, the index of large arrays' chunks, and all other chunks,
 * in one go. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/parallel.h"
#include "base/sha256.h"
#include "base/arrays.h"
#include "base/sized.h"
#include "container/chunk_order.h"
#include "container/content.h"
#include "container/head_facts.h"
#include "container/plan.h"
#include "container/container_write.h"
#include "container/places.h"
#include "io/publish.h"

/* Chunks that are in memory at a time: 8 MiB raw and as much encoded. */
enum { WINDOW = 128 };

/* HDF5 lets a header grow within its metadata block by a tenth of what is left there: room for that
 * where no other header follows. */
enum { ALONE_BYTES = 4096 };

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
    ebpo_h5_out out;
    ebpo_h5_id root;
    slot slots[WINDOW];
    unsigned used;            /* slots */
    ebpo_chunk_coder *coders; /* one for each thread */
    ebpo_chunk_order order;
    ebpo_array_digest *digest; /* [arrays of the plan] */
    ebpo_content content;
    uint64_t chunk_bytes, chunks_done, chunks;
    ebpo_array_out places; /* without subtrees it has no rows */
    uint64_t *place;       /* [rows of places] */
    uint64_t place_count, top_bytes;
    /* headers; the index of arrays of several chunks, and where it begins (0: there is none, or not
     * yet) */
    uint64_t head_bytes, index_bytes, index_at;
} writer;

static ebpo_status make_level_groups(writer *w, ebpo_error *error)
{
    const ebpo_info *info = &w->plan.info;
    ebpo_h5_id id;
    ebpo_status status =
        ebpo_h5_make_group(&w->out, "/levels", (unsigned)info->level_count, &id, error);
    ebpo_h5_close_id(status == EBPO_OK ? id : -1);
    for (int level = 0; level < info->level_count && status == EBPO_OK; level++) {
        char path[EBPO_PATH_BYTES];
        unsigned links = 0;
        for (unsigned i = 0; i < w->plan.count; i++)
            links += w->plan.array[i].id < EBPO_LEVEL_ARRAYS && w->plan.array[i].level == level;
        snprintf(path, sizeof path, "/levels/%02d", level);
        status = ebpo_h5_make_group(&w->out, path, links, &id, error);
        if (status == EBPO_OK)
            status = ebpo_facts_put_level(&w->out, id, &info->level[level], error);
        ebpo_h5_close_id(id);
    }
    return status;
}

/* A group of the root, if the part is there, with room for all arrays that it may have. */
static ebpo_status make_root_group(writer *w, const char *path, ebpo_part part, ebpo_error *error)
{
    unsigned links = 0;
    ebpo_h5_id id = -1;
    if (!(w->plan.info.parts & part))
        return EBPO_OK;
    for (int k = EBPO_LEVEL_ARRAYS; k < EBPO_ARRAYS; k++)
        links += (ebpo_schema[k].needs & part) != 0;
    ebpo_status status = ebpo_h5_make_group(&w->out, path, links, &id, error);
    ebpo_h5_close_id(id);
    return status;
}

/* The file's first chunk (of the root's type), as soon as it can be. */
typedef struct first_chunk {
    const void *data;
    size_t bytes;
} first_chunk;

static unsigned links_of_table(const writer *w)
{
    return w->places.shape.rows ? EBPO_ARRAYS - EBPO_A_SUBTREE_INDEX : 0;
}

static ebpo_status make_table_group(writer *w, ebpo_error *error)
{
    ebpo_h5_id id = -1;
    if (!links_of_table(w))
        return EBPO_OK;
    ebpo_status status = ebpo_h5_make_group(&w->out, "/subtrees", links_of_table(w), &id, error);
    ebpo_h5_close_id(id);
    return status;
}

/* Of the list of chunks: its own place and the file's size, which tell readers whether it still
 * holds. */
static ebpo_status put_holds(writer *w, uint64_t file_bytes, uint64_t offset, ebpo_error *error)
{
    ebpo_status status =
        ebpo_h5_put_count(&w->out, w->places.handle, "file_bytes", file_bytes, error);
    return status == EBPO_OK ? ebpo_h5_put_count(&w->out, w->places.handle, "offset", offset, error)
                             : status;
}

static ebpo_status make_array(writer *w, ebpo_array_out *a, const first_chunk *first,
                              ebpo_error *error)
{
    ebpo_status status = ebpo_h5_make_array(&w->out, a->path, &a->shape, &a->handle, error);
    if (status == EBPO_OK && first)
        status = ebpo_h5_put_chunk(&w->out, a->path, a->handle, &a->shape, 0, first->data,
                                   first->bytes, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(&w->out, a->handle, "coding", ebpo_schema[a->id].coding, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(&w->out, a->handle, "about", ebpo_schema[a->id].about, error);
    return status;
}

/* Everything but the chunks, and the first of these, before the first header grows by attributes:
 * HDF5 then cannot grow the metadata block at the end of the file, but only fill it. */
static ebpo_status lay_out(writer *w, const char *path, const char *shown, uint64_t head_bytes,
                           first_chunk first, ebpo_error *error)
{
    ebpo_plan *plan = &w->plan;
    w->out.codec_level = w->options->codec_level;
    ebpo_status status =
        ebpo_h5_create(&w->out, path, shown, head_bytes, 3 + (links_of_table(w) != 0), error);
    if (status == EBPO_OK)
        status = ebpo_h5_root(&w->out, &w->root, error);
    if (status == EBPO_OK)
        status = ebpo_facts_put(&w->out, w->root, &plan->info, error);
    if (status == EBPO_OK)
        status = make_level_groups(w, error);
    if (status == EBPO_OK)
        status = make_root_group(w, "/mesh", EBPO_PART_MESH, error);
    if (status == EBPO_OK)
        status = make_root_group(w, "/maps", EBPO_PART_MAPS, error);
    if (status == EBPO_OK)
        status = make_table_group(w, error);
    for (unsigned i = 0; i < plan->count && status == EBPO_OK; i++)
        status = make_array(w, &plan->array[i], i == 0 ? &first : NULL, error);
    if (status == EBPO_OK && w->places.shape.rows)
        status = make_array(w, &w->places, NULL, error);
    if (status == EBPO_OK && w->places.shape.rows)
        status = put_holds(w, 0, 0, error);
    return status;
}

static void close_handles(writer *w)
{
    for (unsigned i = 0; i < w->plan.count; i++) {
        ebpo_h5_close_id(w->plan.array[i].handle);
        w->plan.array[i].handle = -1;
    }
    ebpo_h5_close_id(w->places.handle);
    ebpo_h5_close_id(w->root);
    w->places.handle = w->root = -1;
}

static bool has_index(const ebpo_plan *plan)
{
    for (unsigned i = 0; i < plan->count; i++)
        if (ebpo_h5_chunk_count(&plan->array[i].shape) > 1)
            return true;
    return false;
}

/* Sizes of headers and index: the same file in memory, with chunks of one byte. */
static ebpo_status measure_metadata(writer *w, const char *shown, ebpo_error *error)
{
    ebpo_plan *plan = &w->plan;
    uint64_t capacity = (256 << 10) + (4 << 10) * (uint64_t)plan->count + 32 * w->chunks,
             headers = 0, all = 0;
    ebpo_status status = lay_out(w, NULL, shown, capacity, (first_chunk){ "", 1 }, error);
    if (status == EBPO_OK)
        status = ebpo_h5_head_used(&w->out, capacity, &headers, error);
    for (unsigned i = 0; i < plan->count && status == EBPO_OK; i++) {
        const ebpo_array_out *a = &plan->array[i];
        for (uint64_t k = i == 0; k < ebpo_h5_chunk_count(&a->shape) && status == EBPO_OK; k++)
            status = ebpo_h5_put_chunk(&w->out, a->path, a->handle, &a->shape, k, "", 1, error);
    }
    close_handles(w);
    if (status == EBPO_OK)
        status = ebpo_h5_head_used(&w->out, capacity, &all, error);
    ebpo_h5_discard(&w->out);
    w->head_bytes = (headers + 8 + 7) / 8 * 8; /* the last checksum may end in zero bytes */
    if (plan->count == 1)
        w->head_bytes += ALONE_BYTES;
    /* not by the sizes, which are too small where a checksum ends in zero bytes */
    w->index_bytes = has_index(plan) ? (all - headers + 8 + 7) / 8 * 8 : 0;
    return status;
}

/* What comes now is in a piece of its own, once the first array of several chunks calls for it. */
static ebpo_status begin_index(writer *w, const char *path, ebpo_error *error)
{
    close_handles(w);
    ebpo_status status = ebpo_h5_reopen(&w->out, path, w->index_bytes, error);
    if (status == EBPO_OK)
        status = ebpo_h5_root(&w->out, &w->root, error);
    for (unsigned i = 0; i < w->plan.count && status == EBPO_OK; i++)
        status =
            ebpo_h5_open_array(&w->out, w->plan.array[i].path, &w->plan.array[i].handle, error);
    if (status == EBPO_OK && w->places.shape.rows)
        status = ebpo_h5_open_array(&w->out, w->places.path, &w->places.handle, error);
    return status;
}

static ebpo_status fill_slot(void *context, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    writer *w = context;
    (void)worker;
    (void)error;
    for (uint64_t i = begin; i < end; i++) {
        slot *s = &w->slots[i];
        const ebpo_h5_shape *shape = &s->array->shape;
        uint64_t row = s->chunk * shape->chunk_rows, rows = shape->rows - row < shape->chunk_rows
                                                                ? shape->rows - row
                                                                : shape->chunk_rows;
        size_t bytes = rows * ebpo_h5_row_bytes(shape);
        s->raw_bytes = shape->chunk_rows * ebpo_h5_row_bytes(shape);
        ebpo_plan_encode(&w->plan, s->array, row, rows, s->raw);
        memset(s->raw + bytes, 0, s->raw_bytes - bytes);
    }
    return EBPO_OK;
}

static void digest_slots(writer *w)
{
    for (unsigned i = 0; i < w->used; i++) {
        const slot *s = &w->slots[i];
        const ebpo_h5_shape *shape = &s->array->shape;
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
        ebpo_content_put(&w->content, s->array->path, digest);
    }
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
        ebpo_status status =
            ebpo_chunk_encode(&w->coders[worker], s->array->shape.pipeline, w->options->codec_level,
                              s->array->shape.element_size, s->raw, s->raw_bytes, s->stored,
                              &s->stored_bytes);
        if (status != EBPO_OK)
            return ebpo_fail_at(error, status, w->out.shown, s->array->path, -1,
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
    if (!w->places.shape.rows)
        return;
    w->place[w->place_count++] = ebpo_place(number, bytes);
}

/* Called for each chunk, in the order of the file, before it is written. */
static void place_chunk(writer *w, const slot *s)
{
    if (w->index_at == 0 && ebpo_h5_chunk_count(&s->array->shape) > 1) {
        w->index_at = w->head_bytes + w->chunk_bytes;
        note_place(w, EBPO_PLACE_GAP, w->index_bytes);
    }
    note_place(w, ebpo_place_number(s->array->id, s->array->level), s->stored_bytes);
    w->chunk_bytes += s->stored_bytes;
    if (w->chunks_done + 1 == w->order.top)
        w->top_bytes = w->head_bytes + w->chunk_bytes + (w->index_at ? w->index_bytes : 0);
}

static ebpo_status flush_window(writer *w, ebpo_error *error)
{
    ebpo_status status = encode_window(w, error);
    for (unsigned i = 0; i < w->used && status == EBPO_OK; i++) {
        const slot *s = &w->slots[i];
        place_chunk(w, s);
        if (w->chunks_done++ == 0)
            continue; /* written by lay_out */
        status = ebpo_h5_put_chunk(&w->out, s->array->path, s->array->handle, &s->array->shape,
                                   s->chunk, s->stored, s->stored_bytes, error);
    }
    w->used = 0;
    const ebpo_progress *progress = &w->options->progress;
    if (status == EBPO_OK &&
        !ebpo_progress_step(progress, "writing", w->chunks_done, w->chunks, error))
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

/* The last chunk of the file. Where libhdf5 has put something else in between, the list says that
 * it does not hold. */
static ebpo_status write_places(writer *w, ebpo_error *error)
{
    uint8_t *stored = NULL;
    size_t bytes = 0;
    uint64_t offset = w->head_bytes + w->chunk_bytes + w->index_bytes, size = 0;
    ebpo_status status = ebpo_places_encode(w->place, w->place_count, w->places.shape.pipeline,
                                            w->options->codec_level, &stored, &bytes, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_chunk(&w->out, w->places.path, w->places.handle, &w->places.shape, 0,
                                   stored, bytes, error);
    free(stored);
    if (status == EBPO_OK)
        status = ebpo_h5_size(&w->out, &size, error);
    bool holds = size == offset + bytes;
    return status == EBPO_OK ? put_holds(w, holds ? size : 0, holds ? offset : 0, error) : status;
}

static void plan_places(writer *w)
{
    w->places = (ebpo_array_out){ .id = EBPO_A_PLACES, .handle = -1 };
    ebpo_schema_path(EBPO_A_PLACES, 0, w->places.path);
    if (!w->plan.info.subtree_level)
        return;
    uint64_t rows = w->chunks + has_index(&w->plan);
    w->places.shape = (ebpo_h5_shape){ .rows = rows,
                                       .chunk_rows = (uint32_t)rows,
                                       .element_size = 8,
                                       .pipeline = w->plan.array[0].shape.pipeline };
}

static ebpo_status make_window(writer *w, ebpo_error *error)
{
    size_t bound = ebpo_chunk_bound(EBPO_CHUNK_BYTES_MAX),
           slot_bytes = EBPO_CHUNK_BYTES_MAX + bound;
    uint64_t wanted = w->chunks < WINDOW ? w->chunks : WINDOW;
    w->threads = ebpo_thread_count(w->options->threads);
    w->coders = ebpo_alloc_zero(w->threads, sizeof *w->coders);
    uint8_t *block = ebpo_alloc(wanted, slot_bytes);
    w->slots[0].raw = block;
    w->digest = ebpo_alloc(w->plan.count, sizeof *w->digest);
    w->place = ebpo_alloc(w->places.shape.rows, sizeof *w->place);
    if (!w->coders || !block || !w->digest || !w->place)
        return ebpo_fail_memory(error, wanted * slot_bytes);
    for (unsigned i = 0; i < wanted; i++) {
        w->slots[i].raw = block + i * slot_bytes;
        w->slots[i].stored = w->slots[i].raw + EBPO_CHUNK_BYTES_MAX;
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

static ebpo_status write_file(writer *w, const char *path, const char *shown, ebpo_error *error)
{
    uint8_t first[256], digest[32]; /* the chunk is of two bytes */
    size_t first_bytes = 0;
    ebpo_status status = encode_first(w, first, &first_bytes, error);
    if (status == EBPO_OK)
        status = measure_metadata(w, shown, error);
    if (status == EBPO_OK)
        status = lay_out(w, path, shown, w->head_bytes, (first_chunk){ first, first_bytes }, error);
    if (status == EBPO_OK && w->index_bytes)
        status = begin_index(w, path, error);
    if (status == EBPO_OK)
        status = write_chunks(w, error);
    if (status == EBPO_OK && w->places.shape.rows)
        status = write_places(w, error);
    if (status == EBPO_OK)
        status = ebpo_content_end(&w->content, digest, error);
    if (status == EBPO_OK)
        status = ebpo_facts_put_digest(&w->out, w->root, digest, error);
    if (status == EBPO_OK)
        status = ebpo_facts_put_index(&w->out, w->root, w->index_at, w->index_bytes, error);
    if (status == EBPO_OK && w->plan.info.subtree_level)
        status = ebpo_facts_put_top(&w->out, w->root, w->top_bytes, error);
    close_handles(w);
    if (status == EBPO_OK)
        /* another libhdf5 may have placed metadata otherwise: no reader relies on it, tests do */
        status = ebpo_h5_finish(&w->out, error);
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
    w->out = (ebpo_h5_out)EBPO_H5_OUT_INIT;
    w->root = -1;
    status = check_options(w->options, shown, error);
    if (status == EBPO_OK && !ebpo_progress_stage(&w->options->progress, "writing", error))
        status = EBPO_E_CANCELLED;
    if (status == EBPO_OK)
        status = ebpo_plan_make(&w->plan, tree, w->options, shown, error);
    if (status == EBPO_OK)
        status = ebpo_chunk_order_make(&w->order, &w->plan, error);
    w->chunks = w->order.count;
    plan_places(w);
    if (status == EBPO_OK)
        status = make_window(w, error);
    if (status == EBPO_OK && publish)
        status = ebpo_publish_begin(publish, path, error);
    if (status == EBPO_OK)
        status = write_file(w, publish ? ebpo_publish_path(publish) : path, shown, error);
    close_handles(w);
    ebpo_h5_discard(&w->out);
    if (status == EBPO_OK && publish)
        status = ebpo_publish_commit(publish, error);
    for (unsigned i = 0; w->coders && i < w->threads; i++)
        ebpo_chunk_coder_clear(&w->coders[i]);
    free(w->coders);
    free(w->slots[0].raw);
    free(w->digest);
    free(w->place);
    ebpo_chunk_order_free(&w->order);
    ebpo_plan_free(&w->plan);
    ebpo_content_free(&w->content);
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
