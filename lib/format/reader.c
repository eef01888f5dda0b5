/* Reads chunks of an open file: fetches the stored bytes, compares their checksum, decompresses and
 * unshuffles them. Several threads read independent chunks at once, each with a separate chunk
 * reader. The file keeps some idle chunk readers, because creating a decoder takes longer than
 * decoding a chunk. Before reading, callers collect the chunks (ebpo_hints) and send prefetch
 * hints, so that a remote source fetches the chunks in few requests. If a hint fails, the chunks
 * are read without it. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/parallel.h"
#include "format/checksum_pages.h"
#include "format/chunk_directory.h"
#include "format/file_in.h"
#include "format/reader.h"
#include "hdf5_read/coding.h"
#include "hdf5_read/face_gates.h"

enum {
    IDLE_MAX = 4,        /* maximum number of idle readers of a file */
    STORED_MAX = 1 << 18 /* maximum size, in bytes, of an idle reader's buffer */
};

void ebpo_idle_readers_make(ebpo_idle_readers *readers)
{
    *readers = (ebpo_idle_readers){ .first = NULL };
    pthread_mutex_init(&readers->lock, NULL);
}

static void free_reader(ebpo_idle_reader *r)
{
    ebpo_chunk_coder_clear(&r->reader.coder);
    free(r->reader.stored);
    free(r);
}

void ebpo_idle_readers_free(ebpo_idle_readers *readers)
{
    for (ebpo_idle_reader *r = readers->first, *next; r; r = next) {
        next = r->next;
        free_reader(r);
    }
    pthread_mutex_destroy(&readers->lock);
}

/* Creates a reader. Its large members are not initialised. */
static ebpo_idle_reader *new_reader(void)
{
    ebpo_idle_reader *r = ebpo_alloc(1, sizeof *r);
    if (r) {
        r->reader.coder.zstd_in = r->reader.coder.zstd_out = NULL;
        r->reader.stored = NULL;
        r->reader.capacity = 0;
    }
    return r;
}

ebpo_idle_reader *ebpo_idle_readers_take(ebpo_idle_readers *readers)
{
    pthread_mutex_lock(&readers->lock);
    ebpo_idle_reader *r = readers->first;
    if (r) {
        readers->first = r->next;
        readers->count--;
    }
    pthread_mutex_unlock(&readers->lock);
    return r ? r : new_reader();
}

void ebpo_idle_readers_give(ebpo_idle_readers *readers, ebpo_idle_reader *r)
{
    if (!r)
        return;
    if (r->reader.capacity > STORED_MAX) {
        free(r->reader.stored);
        r->reader.stored = NULL;
        r->reader.capacity = 0;
    }
    pthread_mutex_lock(&readers->lock);
    bool keep = readers->count < IDLE_MAX;
    if (keep) {
        r->next = readers->first;
        readers->first = r;
        readers->count++;
    }
    pthread_mutex_unlock(&readers->lock);
    if (!keep)
        free_reader(r);
}

/* --- prefetch hints --- */

/* Adds a range of the file to the collection. Adds nothing if memory is short. */
static void add_range(ebpo_hints *e, uint64_t offset, uint64_t size)
{
    ebpo_range *last = e->count ? &e->range[e->count - 1] : NULL;
    if (last && last->offset + last->size == offset)
        last->size += size;
    else if (ebpo_grow(&e->range, &e->capacity, e->count + 1, sizeof *e->range))
        e->range[e->count++] = (ebpo_range){ offset, size };
}

bool ebpo_hints_wanted(const ebpo_hints *e)
{
    return e->counts_bytes || ebpo_input_prefetches(&e->file->in) ||
           (e->local && ebpo_input_can_advise(&e->file->in));
}

bool ebpo_has_paged_checksums(const ebpo_file *file, const ebpo_array_in *a)
{
    return file->has_checksums && file->checksum_list == EBPO_A_CHECKSUM_INDEX &&
           ebpo_is_paged(&file->info, a->id, a->level, &a->shape);
}

/* Returns true if the checksum of a chunk is in a page that has not been read; *page is its number.
 * The rows of chunks must be known (pages_ready). */
static bool page_is_missing(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                            uint64_t *page)
{
    *page = array->chunks[chunk].checksum_row /
            file->root_array[EBPO_A_CHECKSUM_PAGES].shape.chunk_rows;
    return !atomic_load(&file->page_read[*page]);
}

/* Collects the pages with the checksums of chunks [begin, end). If the rows of chunks in the pages
 * are not known yet, collects all pages and the array that gives the rows. */
static void hint_checksums(ebpo_hints *e, const ebpo_array_in *array, uint64_t begin, uint64_t end)
{
    const ebpo_array_in *pages = &e->file->root_array[EBPO_A_CHECKSUM_PAGES];
    uint64_t page, last = UINT64_MAX;
    if (!ebpo_has_paged_checksums(e->file, array) || e->has_all_pages)
        return;
    if (!atomic_load(&e->file->pages_ready)) {
        e->has_all_pages = true;
        ebpo_hint_array(e, pages);
        ebpo_hint_array(e, &e->file->root_array[EBPO_A_SUBTREE_INDEX]);
        return;
    }
    for (uint64_t i = begin; i < end; i++)
        if (page_is_missing(e->file, array, i, &page) && page != last) {
            add_range(e, pages->chunks[page].address, pages->chunks[page].bytes);
            last = page;
        }
}

void ebpo_hint_chunks(ebpo_hints *e, const ebpo_array_in *array, uint64_t begin, uint64_t end)
{
    if (!ebpo_hints_wanted(e) || !array->present || e->failed)
        return;
    /* After a failure, the next calls do not locate chunks again, because each attempt would repeat
     * all retries of the failed request. The later read reports the error. */
    e->failed = ebpo_reader_locate(e->file, array, NULL) != EBPO_OK;
    if (e->failed)
        return;
    for (uint64_t i = begin; i < end; i++)
        add_range(e, array->chunks[i].address, array->chunks[i].bytes);
    hint_checksums(e, array, begin, end);
}

void ebpo_hint_array(ebpo_hints *e, const ebpo_array_in *array)
{
    ebpo_hint_chunks(e, array, 0, array->present ? ebpo_shape_chunks(&array->shape) : 0);
}

void ebpo_hint_level(ebpo_hints *e, int level, uint32_t without)
{
    uint32_t needs = ebpo_schema_has(&e->file->info) & ~without;
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
        if (ebpo_schema[id].needs & needs)
            ebpo_hint_array(e, &e->file->level_array[level][id]);
}

void ebpo_hint_root(ebpo_hints *e, uint32_t needs)
{
    /* excludes the list of chunk checksums, which is read together with the first data */
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_A_CHUNK_CHECKSUMS; id++)
        if (ebpo_schema[id].needs & needs)
            ebpo_hint_array(e, &e->file->root_array[id]);
}

void ebpo_hint_attributes(ebpo_hints *e)
{
    for (int i = 0; i < e->file->attributes.arrays; i++)
        ebpo_hint_array(e, &e->file->attributes.array[i]);
}

static int compare_ranges(const void *a, const void *b)
{
    uint64_t x = ((const ebpo_range *)a)->offset, y = ((const ebpo_range *)b)->offset;
    return (x > y) - (x < y);
}

/* Sorts ranges by offset, and joins them across gaps of at most `gap` bytes. */
static void join_ranges(ebpo_hints *e, uint64_t gap)
{
    uint64_t kept = 0;
    if (e->count)
        qsort(e->range, e->count, sizeof *e->range, compare_ranges);
    for (uint64_t i = 0; i < e->count; i++) {
        ebpo_range *last = kept ? &e->range[kept - 1] : NULL, next = e->range[i];
        uint64_t end = next.offset + next.size;
        if (last && next.offset <= last->offset + last->size + gap)
            last->size = end > last->offset + last->size ? end - last->offset : last->size;
        else
            e->range[kept++] = next;
    }
    e->count = kept;
}

/* Sends hints to the operating system. Joins ranges that are close together, because each range
 * takes a system call. */
static void hint_system(ebpo_hints *e)
{
    enum { BETWEEN = 16 << 10 }; /* bytes between ranges that are joined */
    join_ranges(e, BETWEEN);
    ebpo_input_advise(&ebpo_reader_own(e->file)->in, e->range, e->count);
}

uint64_t ebpo_hints_bytes(ebpo_hints *e)
{
    uint64_t sum = 0;
    join_ranges(e, 0);
    for (uint64_t i = 0; i < e->count; i++)
        sum += e->range[i].size;
    free(e->range);
    *e = (ebpo_hints)EBPO_HINTS_INIT(e->file);
    return sum;
}

/* Returns true if the file has a list of chunk checksums that has not been read. The list is read
 * before all other data. */
static bool wants_checksums(const ebpo_file *file)
{
    return file->has_checksums && !atomic_load(&file->checksums_read);
}

/* Returns the range of the list of chunk checksums in the file. */
static ebpo_range where_checksums(const ebpo_file *file)
{
    const ebpo_chunk_location *at = file->root_array[file->checksum_list].chunks;
    return (ebpo_range){ at->address, at->bytes };
}

void ebpo_hint_all(ebpo_hints *e)
{
    if (e->count && wants_checksums(e->file))
        add_range(e, where_checksums(e->file).offset, where_checksums(e->file).size);
    if (ebpo_input_prefetches(&e->file->in))
        ebpo_input_prefetch(&ebpo_reader_own(e->file)->in, e->range, e->count);
    else
        hint_system(e);
    free(e->range);
    *e = (ebpo_hints)EBPO_HINTS_INIT(e->file);
}

/* Returns true if top_bytes, which the file states, is plausible: at most 1 MiB more than a
 * sixteenth of the file. A false value would cause long requests. */
static bool is_plausible_top(const ebpo_info *info)
{
    enum { SHARE = 16, ANYWAY = 1 << 20 };
    return info->top_bytes <= info->file_bytes / SHARE + ANYWAY;
}

/* Returns the range of the list of checksums, together with the pages of checksums if they are
 * small. Writers store the pages before the list, so one request fetches both. */
static ebpo_range where_small_checksums(const ebpo_file *file)
{
    enum { SMALL = 16 << 10, PAGE_OVERHEAD = 32 }; /* bytes; bytes of a page besides its values */
    const ebpo_array_in *pages = &file->root_array[EBPO_A_CHECKSUM_PAGES];
    ebpo_range range = where_checksums(file);
    if (!pages->present || pages->shape.rows > SMALL / 4)
        return range;
    uint64_t bytes = 4 * pages->shape.rows + PAGE_OVERHEAD * ebpo_shape_chunks(&pages->shape);
    bytes = bytes < range.offset ? bytes : 0;
    return (ebpo_range){ range.offset - bytes, range.size + bytes };
}

void ebpo_hint_top(const ebpo_file *file)
{
    const ebpo_info *info = &file->info;
    ebpo_file *own = ebpo_reader_own(file);
    uint64_t index_end = info->chunk_index_offset + info->chunk_index_bytes, from,
             top = info->top_bytes < info->file_bytes ? info->top_bytes : info->file_bytes;
    if (!ebpo_input_prefetches(&file->in) || !file->has_directory || atomic_load(&file->located) ||
        !is_plausible_top(info))
        return;
    const ebpo_chunk_location *directory = file->root_array[EBPO_A_CHUNK_DIRECTORY].chunks;
    /* the chunk directory, the list of checksums, and the top bytes before and after HDF5's chunk
     * indexes, which are not needed with the chunk directory */
    ebpo_range range[4] = { { directory->address, directory->bytes } };
    size_t count = 1;
    if (wants_checksums(file))
        range[count++] = where_small_checksums(file);
    from = file->in.source.prefetched;
    if (from < info->chunk_index_offset && info->chunk_index_offset <= top)
        range[count++] = (ebpo_range){ from, info->chunk_index_offset - from };
    from = from > index_end ? from : index_end;
    if (from < top)
        range[count++] = (ebpo_range){ from, top - from };
    ebpo_input_prefetch(&own->in, range, count);
}

void ebpo_file_prefetch_levels(const ebpo_file *file, int first, int last)
{
    ebpo_hints e = EBPO_HINTS_INIT(file);
    int end = last < file->info.level_count - 1 ? last : file->info.level_count - 1;
    for (int level = first < 0 ? 0 : first; level <= end; level++)
        ebpo_hint_level(&e, level, 0);
    ebpo_hint_all(&e);
}

void ebpo_hint_tree(const ebpo_file *file)
{
    ebpo_hints e = EBPO_HINTS_INIT(file);
    for (int level = 0; level < file->info.level_count; level++)
        ebpo_hint_level(&e, level, 0);
    ebpo_hint_root(&e, ~0u);
    ebpo_hint_attributes(&e);
    ebpo_hint_all(&e);
}

enum {
    RUN_BYTES = 1 << 20, /* maximum number of bytes of one read */
    RUN_CHUNKS = 64      /* maximum number of chunks that a thread takes at a time */
};

/* State of ebpo_reader_rows. */
typedef struct job {
    const ebpo_file *file;
    const ebpo_array_in *array;
    ebpo_rows_fn take;
    void *context;
    ebpo_workspace *workspace;
    ebpo_idle_reader **reader; /* [threads] NULL: the thread has not started */
} job;

/* Reads bytes [address, address + bytes) of the file into reader->stored. If this buffer has fewer
 * than `capacity` or `bytes` bytes, allocates a buffer of the larger number. */
static ebpo_status fetch_stored(const ebpo_file *file, ebpo_chunk_reader *reader, uint64_t address,
                                size_t bytes, size_t capacity, ebpo_error *error)
{
    if (capacity < bytes)
        capacity = bytes;
    if (reader->capacity < capacity) {
        free(reader->stored);
        reader->stored = ebpo_alloc(capacity, 1);
        reader->capacity = reader->stored ? capacity : 0;
    }
    if (!reader->stored)
        return ebpo_fail_memory(error, capacity);
    return ebpo_input_read(&ebpo_reader_own(file)->in, address, bytes, reader->stored, error);
}

/* --- pages of checksums --- */

/* Numbers the chunks of all paged arrays, and allocates the values of pages. */
static ebpo_status make_pages(ebpo_file *file, const uint64_t *index, ebpo_error *error)
{
    const ebpo_array_in *pages = &file->root_array[EBPO_A_CHECKSUM_PAGES];
    int all = ebpo_all_arrays(file);
    unsigned count = 0;
    ebpo_paged_array *array = ebpo_alloc((uint64_t)all, sizeof *array);
    uint32_t *value = ebpo_alloc(pages->shape.rows, sizeof *value);
    atomic_uchar *read = ebpo_alloc_zero(ebpo_shape_chunks(&pages->shape), sizeof *read);
    if (!array || !value || !read) {
        free(array);
        free(value);
        free(read);
        return ebpo_fail_memory(error, pages->shape.rows * sizeof *value);
    }
    for (int i = 0; i < all; i++) {
        ebpo_array_in *a = ebpo_array_number(file, i);
        if (a->present && ebpo_has_paged_checksums(file, a))
            array[count++] = (ebpo_paged_array){ .id = a->id,
                                                 .level = a->level,
                                                 .shape = &a->shape,
                                                 .row = &a->chunks[0].checksum_row,
                                                 .step = sizeof *a->chunks };
    }
    ebpo_number_checksums(&file->info, index, array, count);
    free(array);
    file->page_value = value;
    file->page_read = read;
    return EBPO_OK;
}

ebpo_status ebpo_checksum_pages_prepare(const ebpo_file *file, ebpo_error *error)
{
    ebpo_file *own = ebpo_reader_own(file);
    ebpo_read_options options = ebpo_read_threads(1);
    uint64_t *index = NULL;
    if (!file->has_checksums || file->checksum_list != EBPO_A_CHECKSUM_INDEX ||
        atomic_load(&file->pages_ready))
        return EBPO_OK;
    /* before the lock, because both calls also lock; two threads may read the index */
    ebpo_status status = ebpo_file_locate(file, NULL, error);
    if (status == EBPO_OK)
        status =
            ebpo_reader_make(file, EBPO_A_SUBTREE_INDEX, 0, &options, sizeof *index, &index, error);
    if (status != EBPO_OK)
        return status;
    pthread_mutex_lock(&own->lock);
    if (!atomic_load(&own->pages_ready)) {
        status = make_pages(own, index, error);
        if (status == EBPO_OK)
            atomic_store(&own->pages_ready, true);
    }
    pthread_mutex_unlock(&own->lock);
    ebpo_array_free(options.workspace, index);
    return status;
}

/* Reads a page. */
static ebpo_status read_page(ebpo_file *file, uint64_t page, ebpo_error *error)
{
    const ebpo_array_in *pages = &file->root_array[EBPO_A_CHECKSUM_PAGES];
    uint64_t first = page * pages->shape.chunk_rows, remaining = pages->shape.rows - first,
             rows = remaining < pages->shape.chunk_rows ? remaining : pages->shape.chunk_rows;
    ebpo_idle_reader *idle = ebpo_idle_readers_take(&file->idle);
    if (!idle)
        return ebpo_fail_memory(error, sizeof *idle);
    ebpo_status status = ebpo_reader_chunk(file, pages, page, &idle->reader, idle->raw, error);
    pthread_mutex_lock(&file->lock);
    if (status == EBPO_OK && !atomic_load(&file->page_read[page])) {
        for (uint64_t i = 0; i < rows; i++)
            file->page_value[first + i] = ebpo_load32(idle->raw + 4 * i);
        atomic_store(&file->page_read[page], 1);
    }
    pthread_mutex_unlock(&file->lock);
    ebpo_idle_readers_give(&file->idle, idle);
    return status;
}

/* Finds the expected checksum of a chunk of a paged array. */
static ebpo_status find_in_page(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                                uint32_t *checksum, ebpo_error *error)
{
    uint64_t page;
    ebpo_status status = ebpo_checksum_pages_prepare(file, error);
    if (status == EBPO_OK && page_is_missing(file, array, chunk, &page))
        status = read_page(ebpo_reader_own(file), page, error);
    if (status == EBPO_OK)
        *checksum = file->page_value[array->chunks[chunk].checksum_row];
    return status;
}

/* Compares the checksum of a chunk, its last four bytes, with the expected checksum, which may be
 * read from the file. *fits is true if the file states no checksums. */
static ebpo_status chunk_fits(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                              const uint8_t *stored, size_t bytes, bool *fits, ebpo_error *error)
{
    uint32_t expected = 0;
    ebpo_status status = EBPO_OK;
    *fits = true;
    if (!file->has_checksums || !file->checksums) /* no list, or not used yet (npm/module/view.c) */
        return EBPO_OK;
    if (ebpo_has_paged_checksums(file, array))
        status = find_in_page(file, array, chunk, &expected, error);
    else
        expected = file->checksums[array->first_checksum + chunk];
    *fits = status == EBPO_OK && bytes >= 4 && ebpo_chunk_checksum(stored, bytes) == expected;
    return status;
}

/* --- chunks --- */

static ebpo_status chunk_damaged(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                                 const char *why, ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, array->path, -1,
                        "chunk %" PRIu64 " is damaged: %s; get a fresh copy of the file", chunk,
                        why);
}

/* Unpacks a chunk to the bytes that HDF5 would return. */
static ebpo_status unpack_stored(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                                 ebpo_chunk_coder *coder, const uint8_t *stored, uint8_t *raw,
                                 ebpo_error *error)
{
    ebpo_shape shape = ebpo_stored_shape(&array->shape, array->gates);
    size_t bytes = shape.chunk_rows * ebpo_shape_row_bytes(&shape);
    const char *why;
    bool fits;
    ebpo_status status =
        chunk_fits(file, array, chunk, stored, array->chunks[chunk].bytes, &fits, error);
    if (status != EBPO_OK)
        return status;
    if (!fits)
        return chunk_damaged(file, array, chunk,
                             file->checksum_list == EBPO_A_CHUNK_CHECKSUMS
                                 ? "its checksum is not the one in /chunk_checksums"
                                 : "its checksum is not the one that the file states",
                             error);
    status = ebpo_chunk_decode(coder, shape.pipeline, shape.element_size, stored,
                               array->chunks[chunk].bytes, raw, bytes, &why);
    if (status == EBPO_E_MEMORY)
        return ebpo_fail_memory(error, bytes);
    return status == EBPO_OK ? EBPO_OK : chunk_damaged(file, array, chunk, why, error);
}

/* Decodes a chunk of faces that is stored as gates: relative to edges of preceding faces. The
 * result has the other coding of faces, high-water codes (hdf5_read/coding.h). The rows after the
 * last face are set to 0. The gates are unpacked to coder->scratch. This memory is free, because it
 * is used only to unshuffle elements of several bytes. */
static ebpo_status unpack_gates(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                                ebpo_chunk_coder *coder, const uint8_t *stored, uint8_t *codes,
                                ebpo_error *error)
{
    uint64_t remaining = array->shape.rows - chunk * array->shape.chunk_rows,
             rows = remaining < array->shape.chunk_rows ? remaining : array->shape.chunk_rows;
    size_t row = ebpo_shape_row_bytes(&array->shape);
    ebpo_status status = unpack_stored(file, array, chunk, coder, stored, coder->scratch, error);
    if (status != EBPO_OK)
        return status;
    memset(codes + rows * row, 0, (array->shape.chunk_rows - rows) * row);
    return ebpo_gates_decode(coder->scratch, (uint32_t)rows, codes)
               ? EBPO_OK
               : chunk_damaged(file, array, chunk, "its streams do not encode faces", error);
}

/* Decodes a chunk to rows of array->shape. */
static ebpo_status decode_stored(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                                 ebpo_chunk_coder *coder, const uint8_t *stored, uint8_t *raw,
                                 ebpo_error *error)
{
    return array->gates ? unpack_gates(file, array, chunk, coder, stored, raw, error)
                        : unpack_stored(file, array, chunk, coder, stored, raw, error);
}

/* Reads the stored bytes of a chunk into reader->stored. */
static ebpo_status fetch_chunk(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                               ebpo_chunk_reader *reader, ebpo_error *error)
{
    ebpo_status status = ebpo_reader_locate(file, array, error);
    if (status == EBPO_OK)
        status = ebpo_chunk_checksums_read(file, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_chunk_location *at = &array->chunks[chunk];
    return fetch_stored(file, reader, at->address, at->bytes, ebpo_reader_chunk_bound(array),
                        error);
}

ebpo_status ebpo_reader_chunk(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                              ebpo_chunk_reader *reader, uint8_t *raw, ebpo_error *error)
{
    ebpo_status status = fetch_chunk(file, array, chunk, reader, error);
    return status == EBPO_OK
               ? decode_stored(file, array, chunk, &reader->coder, reader->stored, raw, error)
               : status;
}

ebpo_status ebpo_reader_gates(const ebpo_file *file, uint64_t chunk, ebpo_chunk_reader *reader,
                              uint8_t *raw, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, EBPO_A_FACES, 0);
    ebpo_status status = fetch_chunk(file, array, chunk, reader, error);
    return status == EBPO_OK
               ? unpack_stored(file, array, chunk, &reader->coder, reader->stored, raw, error)
               : status;
}

/* Returns the end of a run of chunks that one read fetches: the chunks [begin, result). They are
 * contiguous in the file, and end at or before chunk `end`. A run of several chunks takes at most
 * RUN_BYTES. *bytes: size of the run. */
static uint64_t find_run(const ebpo_array_in *array, uint64_t begin, uint64_t end, size_t *bytes)
{
    const ebpo_chunk_location *c = array->chunks;
    uint64_t next = begin + 1;
    *bytes = c[begin].bytes;
    while (next < end && c[next].address == c[begin].address + *bytes &&
           *bytes + c[next].bytes <= RUN_BYTES)
        *bytes += c[next++].bytes;
    return next;
}

/* Fetches the chunks [begin, end), which take `bytes` bytes, with one read, and passes the rows of
 * each chunk to the callback. */
static ebpo_status read_run(job *j, ebpo_idle_reader *idle, uint64_t begin, uint64_t end,
                            size_t bytes, ebpo_error *error)
{
    const ebpo_array_in *a = j->array;
    ebpo_status status =
        fetch_stored(j->file, &idle->reader, a->chunks[begin].address, bytes, 0, error);
    size_t at = 0;
    for (uint64_t chunk = begin; chunk < end && status == EBPO_OK; chunk++) {
        uint64_t row = chunk * a->shape.chunk_rows, remaining = a->shape.rows - row;
        status = decode_stored(j->file, a, chunk, &idle->reader.coder, idle->reader.stored + at,
                               idle->raw, error);
        if (status == EBPO_OK)
            status = j->take(j->context, a, chunk, row,
                             remaining < a->shape.chunk_rows ? remaining : a->shape.chunk_rows,
                             idle->raw, error);
        at += a->chunks[chunk].bytes;
    }
    return status;
}

static ebpo_status read_chunks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    job *j = context;
    if (!j->reader[worker])
        j->reader[worker] = ebpo_idle_readers_take(&ebpo_reader_own(j->file)->idle);
    if (!j->reader[worker])
        return ebpo_fail_memory(error, sizeof **j->reader);
    ebpo_status status = EBPO_OK;
    while (begin < end && status == EBPO_OK) {
        size_t bytes;
        uint64_t run = find_run(j->array, begin, end, &bytes);
        status = read_run(j, j->reader[worker], begin, run, bytes, error);
        ebpo_release_pages(j->workspace);
        begin = run;
    }
    return status;
}

ebpo_status ebpo_reader_rows(const ebpo_file *file, const ebpo_array_in *array,
                             const ebpo_read_options *options, ebpo_rows_fn take, void *context,
                             ebpo_error *error)
{
    uint64_t chunks = ebpo_shape_chunks(&array->shape);
    ebpo_status status = ebpo_reader_locate(file, array, error);
    if (status == EBPO_OK)
        status = ebpo_chunk_checksums_read(file, error);
    if (status != EBPO_OK)
        return status;
    unsigned threads = chunks > 2 ? ebpo_thread_count(options->threads) : 1;
    job j = { .file = file,
              .array = array,
              .take = take,
              .context = context,
              .workspace = options->workspace };
    j.reader = ebpo_alloc_zero(threads, sizeof *j.reader);
    if (!j.reader)
        return ebpo_fail_memory(error, threads * sizeof *j.reader);
    /* chunks that a thread takes at a time: about a quarter of its share, so that runs are long */
    uint64_t grain = chunks / (threads * 4) + 1;
    if (grain > RUN_CHUNKS)
        grain = RUN_CHUNKS;
    status = ebpo_parallel_for(threads, NULL, chunks, grain, read_chunks, &j, NULL, "read", error);
    for (unsigned i = 0; i < threads; i++)
        ebpo_idle_readers_give(&ebpo_reader_own(file)->idle, j.reader[i]);
    free(j.reader);
    return status;
}

/* Memory for decoded integers of `size` bytes. */
typedef struct target {
    uint8_t *values;
    size_t size;
} target;

static ebpo_status decode_integers(void *context, const ebpo_array_in *array, uint64_t chunk,
                                   uint64_t row, uint64_t rows, const uint8_t *bytes,
                                   ebpo_error *error)
{
    (void)chunk;
    (void)error;
    const target *t = context;
    uint64_t cols = array->shape.cols ? array->shape.cols : 1;
    ebpo_integers_decode(bytes, array->shape.element_size, array->shape.is_signed, rows * cols,
                         t->values + row * cols * t->size, t->size);
    return EBPO_OK;
}

/* Reads the integers of an array into `values`, `size` bytes each. */
static ebpo_status reader_integers(const ebpo_file *file, const ebpo_array_in *array,
                                   const ebpo_read_options *options, void *values, size_t size,
                                   ebpo_error *error)
{
    target t = { values, size };
    return ebpo_reader_rows(file, array, options, decode_integers, &t, error);
}

ebpo_status ebpo_reader_make(const ebpo_file *file, ebpo_array_id id, int level,
                             const ebpo_read_options *options, size_t size, void *values_out,
                             ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, id, level);
    void *values = NULL;
    ebpo_status status = EBPO_OK;
    if (array->present) {
        uint64_t cols = array->shape.cols ? array->shape.cols : 1;
        values = ebpo_array_alloc(options->workspace, array->shape.rows, size * cols);
        status = values ? reader_integers(file, array, options, values, size, error)
                        : ebpo_workspace_fail(options->workspace, array->shape.rows * size * cols,
                                              error);
    }
    if (status != EBPO_OK) {
        ebpo_array_free(options->workspace, values);
        values = NULL;
    }
    memcpy(values_out, &values, sizeof values);
    return status;
}
