/* Writes a model to a file (ebpo_tree_write). Also reads a file and writes it again with other
 * options (ebpo_file_repack). Source: format-spec/hdf5-messages.md and subtrees.md.
 *
 * The headers (groups, array headers, attributes) come first in the file. To determine their size,
 * the same file is first written in memory, with tiny chunks. Then several threads encode and
 * compress chunks, WINDOW_CHUNKS at a time (a window). The chunks are appended in the order of
 * chunk_layout.c: first the chunks with which a reader locates a subtree, then all other chunks.
 *
 * All chunk indexes of HDF5 form one metadata block, immediately before the first chunk that
 * belongs to an array with several chunks. The list of chunk checksums and the list of chunk sizes
 * are the last chunks. Content checksums are computed while chunks are compressed. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/file.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/checksum.h"
#include "format/checksum_pages.h"
#include "format/chunk_layout.h"
#include "format/chunk_directory.h"
#include "format/content_checksum.h"
#include "format/head_facts.h"
#include "format/reader.h"
#include "format/write_file.h"
#include "format/write_plan.h"
#include "hdf5_read/face_gates.h"
#include "io/publish.h"

/* --- headers --- */

/* The lists that have a row for each chunk. */
typedef enum chunk_list {
    /* /chunk_checksums: chunk checksums, in the order of arrays. If the file has pages of
     * checksums: /subtrees/checksum_index, only of chunks that are not in the pages */
    CHUNK_CHECKSUMS,
    /* /subtrees/chunk_directory: stored sizes in file order, whose running sums are offsets */
    CHUNK_SIZES,
    CHUNK_LIST_COUNT
} chunk_list;

/* The headers of a file, while the file is written. */
typedef struct file_headers {
    /* write_headers and headers_begin_index set the handles of the plan's arrays */
    ebpo_plan *plan;
    ebpo_h5_out out;
    ebpo_h5_id root;
    ebpo_array_out list[CHUNK_LIST_COUNT]; /* a list without rows is not written */
    ebpo_array_out pages;                  /* /subtrees/checksums; not written without rows */
    uint64_t chunks;                       /* number of chunks of the plan's arrays */
    int codec_level;
    uint64_t head_bytes;  /* size of the headers */
    uint64_t index_bytes; /* size of HDF5's chunk indexes; 0 if no array has several chunks */
} file_headers;

/* The file's first chunk, which contains the root's type. It is written with the headers. */
typedef struct first_chunk {
    const void *data; /* stored bytes */
    size_t bytes;
} first_chunk;

/* Bytes reserved after the array header if the plan has only one array. No other array header
 * follows in the metadata block, and HDF5 may then enlarge this header by up to a tenth of the
 * block's free space. */
enum { ALONE_BYTES = 4096 };

/* Returns true if an array has several chunks: HDF5 then writes a chunk index. */
static bool has_index(const ebpo_plan *plan)
{
    for (unsigned i = 0; i < plan->count; i++)
        if (ebpo_shape_chunks(&plan->array[i].shape) > 1)
            return true;
    return false;
}

/* Describes the array of a list with `rows` rows; 0: the list is not written. */
static void plan_list(const file_headers *h, ebpo_array_out *a, ebpo_array_id id, uint64_t rows,
                      uint64_t chunk_rows)
{
    *a = (ebpo_array_out){ .id = id, .handle = -1 };
    ebpo_schema_path(id, 0, a->path);
    if (rows)
        a->shape = (ebpo_shape){ .rows = rows,
                                 .chunk_rows = (uint32_t)(rows < chunk_rows ? rows : chunk_rows),
                                 .element_size = ebpo_schema[id].sizes,
                                 .pipeline = h->plan->array[0].shape.pipeline };
}

/* Returns true if the checksums of an array's chunks are in pages. A file with a single block of
 * subtrees (checksum_pages.c) has no pages, because every query would need all of them. */
static bool is_paged(const ebpo_plan *plan, const ebpo_array_out *a)
{
    return plan->info.subtree_level && ebpo_schema_rows(&plan->info, EBPO_A_SUBTREE_INDEX, 0) > 1 &&
           ebpo_is_paged(&plan->info, a->id, a->level, &a->shape);
}

/* Returns the number of chunks of an array that is written, or 0. */
static uint64_t chunks_of(const ebpo_array_out *a)
{
    return a->shape.rows ? ebpo_shape_chunks(&a->shape) : 0;
}

/* Initialises the headers, which refer to the plan; the caller frees the plan after headers_close.
 * At the end, the caller calls headers_close and then ebpo_h5_finish or ebpo_h5_discard. */
static void headers_plan(file_headers *h, ebpo_plan *plan, uint64_t chunks,
                         const ebpo_write_options *options)
{
    bool has_checksums = options->chunk_checksums == EBPO_CHECKSUMS_DEFAULT;
    *h = (file_headers){
        .plan = plan, .root = -1, .chunks = chunks, .codec_level = options->codec_level
    };
    h->out = (ebpo_h5_out)EBPO_H5_OUT_INIT;
    uint64_t paged = 0, all = UINT32_MAX; /* all: a list has a single chunk */
    for (unsigned i = 0; i < plan->count && has_checksums; i++)
        paged += is_paged(plan, &plan->array[i]) ? ebpo_shape_chunks(&plan->array[i].shape) : 0;
    plan_list(h, &h->pages, EBPO_A_CHECKSUM_PAGES, paged, EBPO_CHECKSUM_ROWS);
    chunks += chunks_of(&h->pages);
    plan_list(h, &h->list[CHUNK_CHECKSUMS], paged ? EBPO_A_CHECKSUM_INDEX : EBPO_A_CHUNK_CHECKSUMS,
              has_checksums ? chunks - paged : 0, all);
    /* other rows of the list of sizes: HDF5's chunk indexes, the list of checksums */
    plan_list(h, &h->list[CHUNK_SIZES], EBPO_A_CHUNK_DIRECTORY,
              plan->info.subtree_level ? chunks + has_index(plan) + has_checksums : 0, all);
}

static ebpo_status make_level_groups(file_headers *h, ebpo_error *error)
{
    const ebpo_info *info = &h->plan->info;
    ebpo_h5_id id;
    ebpo_status status =
        ebpo_h5_make_group(&h->out, "/levels", (unsigned)info->level_count, &id, error);
    if (status == EBPO_OK)
        status =
            ebpo_h5_put_text(&h->out, id, "about", "levels of the octree, the root first", error);
    ebpo_h5_close_id(&h->out, status == EBPO_OK ? id : -1);
    for (int level = 0; level < info->level_count && status == EBPO_OK; level++) {
        char path[EBPO_PATH_BYTES];
        unsigned links = 0;
        for (unsigned i = 0; i < h->plan->count; i++)
            links += h->plan->array[i].id < EBPO_LEVEL_ARRAYS && h->plan->array[i].level == level;
        snprintf(path, sizeof path, "/levels/%02d", level);
        status = ebpo_h5_make_group(&h->out, path, links, &id, error);
        if (status == EBPO_OK)
            status = ebpo_facts_put_level(&h->out, id, &info->level[level], error);
        if (status == EBPO_OK)
            status = ebpo_h5_put_text(&h->out, id, "about",
                                      "one level: the attributes count its nodes, planes and faces",
                                      error);
        ebpo_h5_close_id(&h->out, id);
    }
    return status;
}

/* Creates a group in the root group, with space for links to all arrays that the group may have.
 * `need`: condition for the arrays of this group (EBPO_NEEDS_MESH and so on). Does nothing if the
 * file does not meet this condition. */
static ebpo_status make_root_group(file_headers *h, const char *path, uint32_t need,
                                   const char *about, ebpo_error *error)
{
    unsigned links = 0;
    ebpo_h5_id id = -1;
    if (!(ebpo_schema_has(&h->plan->info) & need))
        return EBPO_OK;
    for (int k = EBPO_LEVEL_ARRAYS; k < EBPO_ARRAYS; k++)
        links +=
            (ebpo_schema[k].needs & need) != 0 &&
            (h->pages.shape.rows || (k != EBPO_A_CHECKSUM_PAGES && k != EBPO_A_CHECKSUM_INDEX));
    ebpo_status status = ebpo_h5_make_group(&h->out, path, links, &id, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(&h->out, id, "about", about, error);
    ebpo_h5_close_id(&h->out, id);
    return status;
}

/* Writes the offset of a list's chunk and the file's size as attributes of the list. Readers use
 * the list only if both values match the file. */
static ebpo_status headers_put_validity(file_headers *h, chunk_list list, uint64_t file_bytes,
                                        uint64_t offset, ebpo_error *error)
{
    ebpo_h5_id id = h->list[list].handle;
    ebpo_status status = ebpo_h5_put_count(&h->out, id, "file_bytes", file_bytes, error);
    return status == EBPO_OK ? ebpo_h5_put_count(&h->out, id, "offset", offset, error) : status;
}

/* Creates an array with its HDF5 attributes. Writes the array's first chunk if `first` is not NULL.
 */
static ebpo_status make_array(file_headers *h, ebpo_array_out *a, const first_chunk *first,
                              ebpo_error *error)
{
    ebpo_shape shape = ebpo_stored_shape(&a->shape, a->gates);
    ebpo_status status = ebpo_h5_make_array(&h->out, a->path, &shape, &a->handle, error);
    if (status == EBPO_OK && first)
        status = ebpo_h5_put_chunk(&h->out, a->path, a->handle, &a->shape, 0, first->data,
                                   first->bytes, error);
    if (status == EBPO_OK && a->id == EBPO_A_ATTRIBUTE)
        return ebpo_attributes_put_array(&h->out, h->plan, a, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(&h->out, a->handle, "coding",
                                  a->gates ? EBPO_GATES_CODING : ebpo_schema[a->id].coding, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_text(&h->out, a->handle, "about", ebpo_schema[a->id].about, error);
    if (status == EBPO_OK && shape.cols && !a->gates) {
        char columns[EBPO_COLUMNS_BYTES];
        ebpo_schema_columns(&h->plan->info, a->id, columns);
        status = ebpo_h5_put_text(&h->out, a->handle, "columns", columns, error);
    }
    return status;
}

/* Writes all headers and the first chunk. The headers are one metadata block of `head_bytes` bytes.
 * While this block is the last block of the file, HDF5 enlarges the block instead of using its free
 * space. So the first chunk is written early, before the attributes of the first array. It is
 * stored after the block. The block then cannot grow, and all later headers use its free space. */
static ebpo_status write_headers(file_headers *h, const char *path, const char *shown,
                                 uint64_t head_bytes, first_chunk first, ebpo_error *error)
{
    ebpo_plan *plan = h->plan;
    h->out.codec_level = h->codec_level;
    /* links of the root group: /levels, /mesh, /maps, and optional groups and arrays */
    ebpo_status status =
        ebpo_h5_create(&h->out, path, shown, head_bytes,
                       3 + (h->list[CHUNK_CHECKSUMS].shape.rows && !h->pages.shape.rows) +
                           (plan->info.subtree_level != 0) + (plan->attributes != NULL) +
                           (plan->info.parts & EBPO_PART_BORDER ? 1 : 0) +
                           (plan->info.parts & EBPO_PART_SURFACE ? 1 : 0),
                       error);
    if (status == EBPO_OK)
        status = ebpo_h5_root(&h->out, &h->root, error);
    if (status == EBPO_OK)
        status = ebpo_facts_put(&h->out, h->root, &plan->info, error);
    if (status == EBPO_OK)
        status = make_level_groups(h, error);
    if (status == EBPO_OK)
        status = make_root_group(h, "/mesh", EBPO_NEEDS_MESH,
                                 "the triangle mesh, in the order of the leaves", error);
    if (status == EBPO_OK)
        status = make_root_group(h, "/maps", EBPO_NEEDS_MAPS,
                                 "numbers of the vertices and faces in the source", error);
    if (status == EBPO_OK)
        status = make_root_group(h, "/border", EBPO_NEEDS_BORDER,
                                 "the border of a surface, as closed loops", error);
    if (status == EBPO_OK)
        status = make_root_group(h, "/surface", EBPO_NEEDS_SURFACE,
                                 "simplified surfaces of nodes, for pictures", error);
    if (status == EBPO_OK)
        status = make_root_group(h, "/subtrees", EBPO_NEEDS_SUBTREES,
                                 "where the rows of each subtree begin in every array", error);
    if (status == EBPO_OK)
        status = ebpo_attributes_put_group(&h->out, plan, error);
    for (unsigned i = 0; i < plan->count && status == EBPO_OK; i++)
        status = make_array(h, &plan->array[i], i == 0 ? &first : NULL, error);
    if (status == EBPO_OK && h->pages.shape.rows)
        status = make_array(h, &h->pages, NULL, error);
    for (chunk_list l = 0; l < CHUNK_LIST_COUNT && status == EBPO_OK; l++) {
        if (h->list[l].shape.rows == 0)
            continue;
        status = make_array(h, &h->list[l], NULL, error);
        if (status == EBPO_OK)
            status = headers_put_validity(h, l, 0, 0, error);
    }
    return status;
}

/* Closes the root and the arrays, but not the file. */
static void headers_close(file_headers *h)
{
    for (unsigned i = 0; i < h->plan->count; i++) {
        ebpo_h5_close_id(&h->out, h->plan->array[i].handle);
        h->plan->array[i].handle = -1;
    }
    ebpo_h5_close_id(&h->out, h->pages.handle);
    h->pages.handle = -1;
    for (chunk_list l = 0; l < CHUNK_LIST_COUNT; l++) {
        ebpo_h5_close_id(&h->out, h->list[l].handle);
        h->list[l].handle = -1;
    }
    ebpo_h5_close_id(&h->out, h->root);
    h->root = -1;
}

/* Writes the headers to the file and leaves the file open. headers_measure must have been called.
 * `shown`: name of the file for messages. */
static ebpo_status headers_lay_out(file_headers *h, const char *path, const char *shown,
                                   first_chunk first, ebpo_error *error)
{
    return write_headers(h, path, shown, h->head_bytes, first, error);
}

/* Measures headers and HDF5's chunk indexes by writing the same file in memory, with chunks of one
 * byte. Sets h->head_bytes and h->index_bytes. */
static ebpo_status headers_measure(file_headers *h, const char *shown, ebpo_error *error)
{
    ebpo_plan *plan = h->plan;
    /* capacity: more than headers and indexes take; headers, all: measured bytes without and with
     * the indexes */
    uint64_t capacity = (256 << 10) + (4 << 10) * (uint64_t)plan->count +
                        32 * (h->chunks + chunks_of(&h->pages)),
             headers = 0, all = 0;
    ebpo_status status = write_headers(h, NULL, shown, capacity, (first_chunk){ "", 1 }, error);
    if (status == EBPO_OK)
        status = ebpo_h5_head_used(&h->out, capacity, &headers, error);
    for (unsigned i = 0; i < plan->count && status == EBPO_OK; i++) {
        const ebpo_array_out *a = &plan->array[i];
        for (uint64_t k = i == 0; k < ebpo_shape_chunks(&a->shape) && status == EBPO_OK; k++)
            status = ebpo_h5_put_chunk(&h->out, a->path, a->handle, &a->shape, k, "", 1, error);
    }
    for (uint64_t k = 0; k < chunks_of(&h->pages) && status == EBPO_OK; k++)
        status = ebpo_h5_put_chunk(&h->out, h->pages.path, h->pages.handle, &h->pages.shape, k, "",
                                   1, error);
    headers_close(h);
    if (status == EBPO_OK)
        status = ebpo_h5_head_used(&h->out, capacity, &all, error);
    ebpo_h5_discard(&h->out);
    /* 8 bytes more, because the last checksum of the headers may end in zero bytes, which
     * ebpo_h5_head_used does not count; then the next multiple of 8 */
    h->head_bytes = (headers + 8 + 7) / 8 * 8;
    if (plan->count == 1)
        h->head_bytes += ALONE_BYTES;
    /* 8 more bytes for the same reason */
    h->index_bytes = has_index(plan) ? (all - headers + 8 + 7) / 8 * 8 : 0;
    return status;
}

/* Opens the file again with metadata blocks of h->index_bytes bytes, so that all chunk indexes of
 * HDF5 are in one block. HDF5 allocates this block when the first chunk of an array with several
 * chunks is written. */
static ebpo_status headers_begin_index(file_headers *h, ebpo_error *error)
{
    headers_close(h);
    ebpo_status status = ebpo_h5_reopen(&h->out, h->index_bytes, error);
    if (status == EBPO_OK)
        status = ebpo_h5_root(&h->out, &h->root, error);
    for (unsigned i = 0; i < h->plan->count && status == EBPO_OK; i++)
        status =
            ebpo_h5_open_array(&h->out, h->plan->array[i].path, &h->plan->array[i].handle, error);
    if (status == EBPO_OK && h->pages.shape.rows)
        status = ebpo_h5_open_array(&h->out, h->pages.path, &h->pages.handle, error);
    for (chunk_list l = 0; l < CHUNK_LIST_COUNT && status == EBPO_OK; l++)
        if (h->list[l].shape.rows)
            status = ebpo_h5_open_array(&h->out, h->list[l].path, &h->list[l].handle, error);
    return status;
}

/* --- chunks --- */

/* Maximum number of chunks of a window. A window is the set of chunks that are in memory at a time.
 * The chunks take at most 8 MiB before compression, and about 8 MiB compressed. */
enum { WINDOW_CHUNKS = 128 };

/* A chunk of the window: its position, and its bytes before and after compression. */
typedef struct window_chunk {
    const ebpo_array_out *array;
    uint64_t chunk;        /* number of the chunk in the array */
    uint8_t *raw, *stored; /* before and after compression */
    size_t raw_bytes, stored_bytes;
} window_chunk;

/* State of writing one file. */
typedef struct writer {
    ebpo_plan plan;
    const ebpo_write_options *options;
    unsigned threads;
    file_headers head;
    window_chunk window[WINDOW_CHUNKS];
    unsigned used;            /* number of chunks in the window */
    ebpo_chunk_coder *coders; /* [threads] compression state of each thread */
    ebpo_chunk_order order;
    ebpo_array_digest *digest; /* [arrays of the plan] */
    ebpo_content content[EBPO_DIGESTS];
    uint64_t chunk_bytes, chunks_done; /* stored bytes and number of the chunks so far */
    /* [chunks] rows of the list of chunk checksums, if the list is written */
    uint64_t *checksum_row;
    /* [arrays of the plan] index of the array's first row in checksum_row; not used for arrays with
     * a page_row */
    uint64_t *first_checksum;
    uint64_t pages_checksum; /* the same for the pages of checksums */
    /* [arrays of the plan][chunks] rows of the chunks in page_value; NULL: not in pages */
    uint32_t **page_row;
    uint32_t *page_value; /* [rows of /subtrees/checksums] */
    /* [size_rows] rows so far of the list of chunk sizes, if the list is written */
    uint64_t *size_row;
    uint64_t size_rows;
    uint64_t top_bytes; /* end of the chunks with which a reader locates a subtree */
    uint64_t index_at;  /* offset of HDF5's chunk indexes; 0: none, or not yet written */
} writer;

/* Encodes the rows of the chunks [begin, end) of the window. Pads the last chunk of an array with
 * zeros. */
static ebpo_status encode_chunks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    writer *w = context;
    (void)worker;
    (void)error;
    for (uint64_t i = begin; i < end; i++) {
        window_chunk *s = &w->window[i];
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

/* Adds the chunks of the window to the digests of their arrays. If an array's last chunk is in the
 * window, the array's digest is complete: adds it to the array's content checksum. */
static void digest_window(writer *w)
{
    for (unsigned i = 0; i < w->used; i++) {
        const window_chunk *s = &w->window[i];
        const ebpo_shape *shape = &s->array->shape;
        uint64_t row = s->chunk * shape->chunk_rows, remaining = shape->rows - row;
        ebpo_array_digest *state = &w->digest[s->array - w->plan.array];
        uint8_t digest[32];
        if (!ebpo_content_has(&w->plan.info, s->array->id))
            continue;
        if (row == 0)
            ebpo_array_digest_begin(state);
        ebpo_array_digest_add(state, &w->plan.info, s->array->id, shape, row,
                              remaining < shape->chunk_rows ? remaining : shape->chunk_rows,
                              s->raw);
        if (remaining > shape->chunk_rows)
            continue;
        ebpo_array_digest_end(state, digest);
        ebpo_content_put(&w->content[ebpo_content_of(s->array->id, w->plan.info.solid)],
                         s->array->path, digest);
    }
}

/* Compresses a chunk of faces that are stored as gates: relative to edges of preceding faces
 * (face_gates.h). Pads the last chunk with zeros after the rows of gates. */
static ebpo_status compress_gates(window_chunk *s, ebpo_chunk_coder *coder, int level)
{
    ebpo_shape stored = ebpo_stored_shape(&s->array->shape, true);
    uint64_t remaining = stored.rows - s->chunk * stored.chunk_rows,
             rows = remaining < stored.chunk_rows ? remaining : stored.chunk_rows;
    size_t ends[EBPO_GATES_ENDS], bytes = stored.chunk_rows * ebpo_shape_row_bytes(&stored);
    ebpo_gates_encode(s->raw, (uint32_t)rows, coder->scratch, ends);
    memset(coder->scratch + rows * EBPO_GATES_COLS, 0, bytes - rows * EBPO_GATES_COLS);
    return ebpo_chunk_encode_streams(coder, stored.pipeline, level, coder->scratch, bytes, ends,
                                     EBPO_GATES_ENDS, s->stored, &s->stored_bytes);
}

/* Default zstd level of simplified surfaces: high, because they are small and sent over networks.
 */
enum { LEVEL_OF_SURFACES = 16 };

static ebpo_status compress_chunk(window_chunk *s, ebpo_chunk_coder *coder, int level)
{
    const ebpo_shape *shape = &s->array->shape;
    if (!level && shape->pipeline == EBPO_PIPELINE_ZSTD &&
        ebpo_schema[s->array->id].needs == EBPO_NEEDS_SURFACE)
        level = LEVEL_OF_SURFACES;
    return s->array->gates ? compress_gates(s, coder, level)
                           : ebpo_chunk_encode(coder, shape->pipeline, level, shape->element_size,
                                               s->raw, s->raw_bytes, s->stored, &s->stored_bytes);
}

/* Item 0 adds the whole window to the digests. Item i > 0 compresses chunk i - 1 of the window. */
static ebpo_status compress_chunks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                   ebpo_error *error)
{
    writer *w = context;
    for (uint64_t i = begin; i < end; i++) {
        if (i == 0) {
            digest_window(w);
            continue;
        }
        window_chunk *s = &w->window[i - 1];
        ebpo_status status = compress_chunk(s, &w->coders[worker], w->options->codec_level);
        if (status != EBPO_OK)
            return ebpo_fail_at(error, status, w->head.out.shown, s->array->path, -1,
                                "a chunk could not be compressed");
    }
    return EBPO_OK;
}

/* Encodes and compresses all chunks of the window. */
static ebpo_status encode_window(writer *w, ebpo_error *error)
{
    unsigned threads = w->used > 4 ? w->threads : 1;
    ebpo_status status = ebpo_parallel_for(threads, w->plan.tree->mesh.workspace, w->used, 1,
                                           encode_chunks, w, NULL, "write", error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, w->plan.tree->mesh.workspace, w->used + 1u, 1,
                                   compress_chunks, w, NULL, "write", error);
    return status;
}

/* Adds a row to the list of chunk sizes. */
static void add_size_row(writer *w, uint32_t number, uint64_t bytes)
{
    if (!w->head.list[CHUNK_SIZES].shape.rows)
        return;
    w->size_row[w->size_rows++] = ebpo_list_row(number, bytes);
}

/* Adds a chunk to the lists, and the chunk's size to w->chunk_bytes. Called in file order, before
 * the chunk is written. */
static void list_chunk(writer *w, const window_chunk *s)
{
    if (w->index_at == 0 && ebpo_shape_chunks(&s->array->shape) > 1) {
        w->index_at = w->head.head_bytes + w->chunk_bytes;
        add_size_row(w, EBPO_ROW_NO_ARRAY, w->head.index_bytes);
    }
    uint32_t number = ebpo_array_list_number(s->array->id, s->array->level);
    add_size_row(w, number, s->stored_bytes);
    uint32_t checksum = ebpo_chunk_checksum(s->stored, s->stored_bytes);
    size_t array = (size_t)(s->array - w->plan.array);
    if (w->page_row[array])
        w->page_value[w->page_row[array][s->chunk]] = checksum;
    else if (w->head.list[CHUNK_CHECKSUMS].shape.rows)
        w->checksum_row[w->first_checksum[array] + s->chunk] = ebpo_list_row(number, checksum);
    w->chunk_bytes += s->stored_bytes;
    if (w->chunks_done + 1 == w->order.top)
        w->top_bytes =
            w->head.head_bytes + w->chunk_bytes + (w->index_at ? w->head.index_bytes : 0);
}

/* Encodes and writes all chunks of the window, and empties the window. */
static ebpo_status flush_window(writer *w, ebpo_error *error)
{
    ebpo_status status = encode_window(w, error);
    for (unsigned i = 0; i < w->used && status == EBPO_OK; i++) {
        const window_chunk *s = &w->window[i];
        list_chunk(w, s);
        if (w->chunks_done++ == 0)
            continue; /* the first chunk was written with the headers */
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
        w->window[w->used].array = &w->plan.array[w->order.chunk[i].array];
        w->window[w->used++].chunk = w->order.chunk[i].chunk;
        if (w->used == WINDOW_CHUNKS)
            status = flush_window(w, error);
    }
    return status == EBPO_OK && w->used ? flush_window(w, error) : status;
}

/* Writes the pages of checksums. */
static ebpo_status write_pages(writer *w, ebpo_error *error)
{
    const ebpo_array_out *a = &w->head.pages;
    const ebpo_shape *shape = &a->shape;
    window_chunk *s = &w->window[0]; /* for its buffers */
    uint32_t number = ebpo_array_list_number(EBPO_A_CHECKSUM_PAGES, 0);
    ebpo_status status = EBPO_OK;
    for (uint64_t k = 0; k < chunks_of(a) && status == EBPO_OK; k++) {
        memset(s->raw, 0, 4 * (size_t)shape->chunk_rows);
        for (uint64_t i = k * shape->chunk_rows, n = 0; n < shape->chunk_rows && i < shape->rows;
             i++, n++)
            ebpo_store32(s->raw + 4 * n, w->page_value[i]);
        status = ebpo_chunk_encode(&w->coders[0], shape->pipeline, w->options->codec_level,
                                   shape->element_size, s->raw, 4 * (size_t)shape->chunk_rows,
                                   s->stored, &s->stored_bytes);
        if (status != EBPO_OK)
            return ebpo_fail_at(error, status, w->head.out.shown, a->path, -1,
                                "a chunk could not be compressed");
        status = ebpo_h5_put_chunk(&w->head.out, a->path, a->handle, shape, k, s->stored,
                                   s->stored_bytes, error);
        add_size_row(w, number, s->stored_bytes);
        w->checksum_row[w->pages_checksum + k] =
            ebpo_list_row(number, ebpo_chunk_checksum(s->stored, s->stored_bytes));
        w->chunk_bytes += s->stored_bytes;
    }
    return status;
}

/* Writes a list as one chunk. *bytes: stored size; 0 for a list without rows. */
static ebpo_status write_list(writer *w, chunk_list list, const uint64_t *values, size_t *bytes,
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

/* Writes the lists, which are the last chunks of the file. If libhdf5 has written other data
 * between the chunks, the lists are wrong. The attributes of the lists are then 0, so that readers
 * ignore the lists. */
static ebpo_status write_lists(writer *w, ebpo_error *error)
{
    size_t bytes[CHUNK_LIST_COUNT];
    uint64_t offset = w->head.head_bytes + w->chunk_bytes + w->head.index_bytes, size = 0;
    const uint64_t *values[CHUNK_LIST_COUNT] = { w->checksum_row, w->size_row };
    ebpo_status status =
        write_list(w, CHUNK_CHECKSUMS, values[CHUNK_CHECKSUMS], &bytes[CHUNK_CHECKSUMS], error);
    if (status == EBPO_OK && bytes[CHUNK_CHECKSUMS])
        add_size_row(w, ebpo_array_list_number(w->head.list[CHUNK_CHECKSUMS].id, 0),
                     bytes[CHUNK_CHECKSUMS]);
    if (status == EBPO_OK)
        status = write_list(w, CHUNK_SIZES, values[CHUNK_SIZES], &bytes[CHUNK_SIZES], error);
    if (status == EBPO_OK)
        status = ebpo_h5_size(&w->head.out, &size, error);
    bool valid = status == EBPO_OK && size == offset + bytes[CHUNK_CHECKSUMS] + bytes[CHUNK_SIZES];
    for (chunk_list l = 0; l < CHUNK_LIST_COUNT && status == EBPO_OK; l++) {
        if (w->head.list[l].shape.rows)
            status = headers_put_validity(&w->head, l, valid ? size : 0, valid ? offset : 0, error);
        offset += bytes[l];
    }
    return status;
}

/* Computes the rows of all chunks in the lists of checksums. */
static ebpo_status number_chunks(writer *w, ebpo_error *error)
{
    uint64_t sum = 0;
    unsigned count = 0;
    bool has_pages = w->head.pages.shape.rows != 0, passed = false;
    ebpo_paged_array *paged = ebpo_alloc(w->plan.count, sizeof *paged);
    ebpo_status status = paged ? EBPO_OK : EBPO_E_MEMORY;
    for (unsigned i = 0; i < w->plan.count && status == EBPO_OK; i++) {
        const ebpo_array_out *a = &w->plan.array[i];
        if (!passed && a->id == EBPO_A_ATTRIBUTE) {
            w->pages_checksum = sum; /* the numbers of attributes are greater */
            sum += chunks_of(&w->head.pages);
            passed = true;
        }
        w->first_checksum[i] = sum;
        if (!has_pages || !is_paged(&w->plan, a)) {
            sum += ebpo_shape_chunks(&a->shape);
            continue;
        }
        w->page_row[i] = ebpo_alloc(ebpo_shape_chunks(&a->shape), sizeof **w->page_row);
        if (!w->page_row[i])
            status = EBPO_E_MEMORY;
        paged[count++] = (ebpo_paged_array){ .id = a->id,
                                             .level = a->level,
                                             .shape = &a->shape,
                                             .row = w->page_row[i],
                                             .step = sizeof **w->page_row };
    }
    if (!passed)
        w->pages_checksum = sum;
    if (status == EBPO_OK && count)
        ebpo_number_checksums(&w->plan.info, w->plan.subtrees.index, paged, count);
    free(paged);
    return status == EBPO_OK ? EBPO_OK
                             : ebpo_fail_memory(error, w->order.count * sizeof **w->page_row);
}

/* Allocates the buffers of the window and the rows of the lists. */
static ebpo_status make_window(writer *w, ebpo_error *error)
{
    size_t bound = ebpo_chunk_bound(EBPO_CHUNK_BYTES_MAX),
           buffer_bytes = EBPO_CHUNK_BYTES_MAX + bound;
    uint64_t chunk_count = w->order.count < WINDOW_CHUNKS ? w->order.count : WINDOW_CHUNKS;
    w->threads = ebpo_thread_count(w->options->threads);
    w->coders = ebpo_alloc_zero(w->threads, sizeof *w->coders);
    uint8_t *buffers = ebpo_alloc(chunk_count, buffer_bytes);
    w->window[0].raw = buffers;
    w->digest = ebpo_alloc(w->plan.count, sizeof *w->digest);
    w->size_row = ebpo_alloc(w->head.list[CHUNK_SIZES].shape.rows, sizeof *w->size_row);
    w->checksum_row = ebpo_alloc(w->head.list[CHUNK_CHECKSUMS].shape.rows, sizeof *w->checksum_row);
    w->first_checksum = ebpo_alloc(w->plan.count, sizeof *w->first_checksum);
    w->page_value = ebpo_alloc(w->head.pages.shape.rows, sizeof *w->page_value);
    w->page_row = ebpo_alloc_zero(w->plan.count, sizeof *w->page_row);
    if (!w->coders || !buffers || !w->digest || !w->size_row || !w->checksum_row ||
        !w->first_checksum || !w->page_value || !w->page_row)
        return ebpo_fail_memory(error, chunk_count * buffer_bytes);
    for (unsigned i = 0; i < chunk_count; i++) {
        w->window[i].raw = buffers + i * buffer_bytes;
        w->window[i].stored = w->window[i].raw + EBPO_CHUNK_BYTES_MAX;
    }
    return number_chunks(w, error);
}

/* Encodes the file's first chunk, which is written with the headers. */
static ebpo_status encode_first(writer *w, uint8_t *stored, size_t *bytes, ebpo_error *error)
{
    window_chunk *s = &w->window[0];
    s->array = &w->plan.array[0];
    s->chunk = 0;
    (void)encode_chunks(w, 0, 1, 0, NULL);
    ebpo_status status = compress_chunks(w, 1, 2, 0, error);
    *bytes = s->stored_bytes;
    memcpy(stored, s->stored, s->stored_bytes);
    return status;
}

/* Writes the content checksum, and those of the parts with a separate checksum. */
static ebpo_status put_digests(writer *w, ebpo_error *error)
{
    uint8_t digest[32];
    ebpo_status status = ebpo_content_end(&w->content[EBPO_DIGEST_CONTENT], digest, error);
    if (status == EBPO_OK)
        status = ebpo_facts_put_digest(&w->head.out, w->head.root, digest, error);
    if (status == EBPO_OK && w->plan.info.parts & EBPO_PART_COLOURS) {
        status = ebpo_content_end(&w->content[EBPO_DIGEST_COLOURS], digest, error);
        if (status == EBPO_OK)
            status = ebpo_facts_put_colours_digest(&w->head.out, w->head.root, digest, error);
    }
    if (status == EBPO_OK && w->plan.info.parts & EBPO_PART_BORDER) {
        status = ebpo_content_end(&w->content[EBPO_DIGEST_BORDER], digest, error);
        if (status == EBPO_OK)
            status = ebpo_facts_put_border_digest(&w->head.out, w->head.root, digest, error);
    }
    if (status == EBPO_OK && w->plan.info.parts & EBPO_PART_SURFACE) {
        status = ebpo_content_end(&w->content[EBPO_DIGEST_SURFACE], digest, error);
        if (status == EBPO_OK)
            status = ebpo_facts_put_surface_digest(&w->head.out, w->head.root, digest, error);
    }
    return status;
}

/* Writes the whole file. Another version of libhdf5 may place its metadata elsewhere in the file.
 * Then this function does not fail, and readers accept the file, but tests that compare bytes fail.
 */
static ebpo_status write_file(writer *w, const char *path, const char *shown, ebpo_error *error)
{
    uint8_t first[256]; /* the first chunk is small: the root's type, two bytes before encoding */
    size_t first_bytes = 0;
    ebpo_status status = encode_first(w, first, &first_bytes, error);
    if (status == EBPO_OK)
        status = headers_measure(&w->head, shown, error);
    if (status == EBPO_OK)
        status = headers_lay_out(&w->head, path, shown, (first_chunk){ first, first_bytes }, error);
    if (status == EBPO_OK && w->head.index_bytes)
        status = headers_begin_index(&w->head, error);
    if (status == EBPO_OK)
        status = write_chunks(w, error);
    if (status == EBPO_OK)
        status = write_pages(w, error);
    if (status == EBPO_OK)
        status = write_lists(w, error);
    if (status == EBPO_OK)
        status = put_digests(w, error);
    if (status == EBPO_OK)
        status = ebpo_facts_put_index(&w->head.out, w->head.root, w->index_at, w->head.index_bytes,
                                      error);
    if (status == EBPO_OK && w->plan.info.subtree_level)
        status = ebpo_facts_put_top(&w->head.out, w->head.root, w->top_bytes, error);
    headers_close(&w->head);
    if (status == EBPO_OK)
        status = ebpo_h5_finish(&w->head.out, error);
    return status;
}

static ebpo_status check_options(const ebpo_write_options *options, const char *path,
                                 ebpo_error *error)
{
    if ((unsigned)options->codec > EBPO_CODEC_NONE || options->codec_level < 0 ||
        options->codec_level > ebpo_pipeline_facts_of((ebpo_pipeline)options->codec)->level_max)
        return ebpo_fail_file(
            error, EBPO_E_ARGUMENT, path,
            "unknown codec, or invalid codec level; levels are 1 to 22 for zstd, 1 to 9 for "
            "deflate, and 0 for none");
    if ((unsigned)options->chunk_checksums > EBPO_CHECKSUMS_NONE)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, path, "chunk_checksums: invalid value %u",
                              (unsigned)options->chunk_checksums);
    return EBPO_OK;
}

/* Writes a file. If `publish` is NULL, writes directly to `path`, else to a temporary name, which
 * is renamed to `path` at the end. `shown`: name for messages. */
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
    headers_plan(&w->head, &w->plan, w->order.count, w->options);
    if (status == EBPO_OK)
        status = make_window(w, error);
    if (status == EBPO_OK && publish)
        status = ebpo_publish_begin(publish, path, error);
    if (status == EBPO_OK)
        status = write_file(w, publish ? ebpo_publish_path(publish) : path, shown, error);
    headers_close(&w->head);
    ebpo_h5_discard(&w->head.out);
    if (status == EBPO_OK && publish)
        status = ebpo_publish_commit(publish, error);
    for (unsigned i = 0; w->coders && i < w->threads; i++)
        ebpo_chunk_coder_clear(&w->coders[i]);
    free(w->coders);
    free(w->window[0].raw);
    free(w->digest);
    free(w->size_row);
    free(w->checksum_row);
    free(w->first_checksum);
    for (unsigned i = 0; w->page_row && i < w->plan.count; i++)
        free(w->page_row[i]);
    free(w->page_row);
    free(w->page_value);
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

ebpo_status ebpo_tree_store(const ebpo_tree *tree, const char *folder, const char *name,
                            const ebpo_write_options *options, ebpo_file **out, ebpo_error *error)
{
    ebpo_publish publish = EBPO_PUBLISH_INIT;
    char path[EBPO_FOLDER_BYTES + 32];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    ebpo_status status = ebpo_publish_begin(&publish, path, error);
    if (status == EBPO_OK)
        status = ebpo_tree_write_into(tree, ebpo_publish_path(&publish), folder, options, error);
    if (status == EBPO_OK)
        status = ebpo_open_own(ebpo_publish_path(&publish), out, error);
    ebpo_publish_abort(&publish);
    return status;
}

/* --- repacking --- */

/* Checks that the written file states the same content checksums as `from`, the file that was read.
 * If the checksums are equal, also checks the content of the written file. If they differ, checks
 * the content of `from` to find the reason, and returns an error. */
static ebpo_status check_written(const ebpo_file *from, const ebpo_publish *out,
                                 const ebpo_read_options *read, ebpo_error *error)
{
    ebpo_file *file;
    ebpo_status status = ebpo_open_own(ebpo_publish_path(out), &file, error);
    if (status != EBPO_OK)
        return status;
    bool are_equal = memcmp(file->info.content_sha256, from->info.content_sha256,
                            sizeof file->info.content_sha256) == 0 &&
                     memcmp(file->attributes.sha256, from->attributes.sha256,
                            sizeof file->attributes.sha256) == 0;
    if (are_equal)
        status = ebpo_file_check_content(file, read, error);
    ebpo_close(file);
    if (status != EBPO_OK || are_equal)
        return status;
    status = ebpo_file_check_content(from, read, error);
    return status != EBPO_OK
               ? status
               : ebpo_fail_file(error, EBPO_E_UNSUPPORTED, from->in.shown,
                                "repacking would change the content checksum, although the "
                                "stored checksum is correct, because another program has stored "
                                "arrays in a way that ebpo does not write; nothing was written");
}

ebpo_status ebpo_repack_with(const ebpo_file *file, const char *path, const ebpo_read_options *read,
                             const ebpo_write_options *write, ebpo_change_tree_fn *change,
                             ebpo_error *error)
{
    ebpo_write_options wanted = EBPO_WRITE_OPTIONS_INIT;
    ebpo_publish out = EBPO_PUBLISH_INIT;
    ebpo_tree tree = { 0 };
    ebpo_status status = EBPO_TAKE(ebpo_write_options, &wanted, write, error);
    wanted.parts = ~0u;
    /* before reading, so that a folder without write permission is reported at once */
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&out, path, error);
    if (status == EBPO_OK) {
        ebpo_publish_expect_input(&out, &file->in);
        status = ebpo_file_read_tree(file, read, &tree, error);
    }
    if (status == EBPO_OK && change)
        status = change(&tree, &wanted, error);
    if (status == EBPO_OK)
        status = ebpo_tree_write_into(&tree, ebpo_publish_path(&out), path, &wanted, error);
    ebpo_tree_free(&tree);
    if (status == EBPO_OK)
        status = check_written(file, &out, read, error);
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&out, error);
    ebpo_publish_abort(&out);
    return status;
}

ebpo_status ebpo_file_repack(const ebpo_file *file, const char *path, const ebpo_read_options *read,
                             const ebpo_write_options *write, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    return ebpo_repack_with(file, path, read, write, NULL, error);
}
