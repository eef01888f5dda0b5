/* Reads ranges of rows of a file's arrays through a cache of decoded chunks under a budget of
 * memory. A chunk is decoded and checked when it is loaded into the cache. Several threads may
 * share a cache, except a counted cache, which belongs to one thread. A counted cache reads and
 * prefetches only requested chunks, and refuses loads beyond a limit of bytes read (EBPO_E_LIMIT).
 */
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/hash.h"
#include "format/chunks.h"
#include "format/read_attributes.h"
#include "hdf5_read/coding.h"

enum {
    CHUNK_BITS = 48, /* bits of a key for the number of the chunk */
    AROUND = 4       /* number of adjacent chunks that are fetched together */
};
/* Limits of the bytes that a counted cache prefetches and has not yet read (ebpo_chunks_capacity).
 */
enum {
    AHEAD_MAX = 4 << 20, /* bytes */
    AHEAD_SHARE = 4,     /* a quarter of the remaining limit */
    BATCH_SHARE = 16     /* a sixteenth of the remaining limit, and of AHEAD_MAX */
};

/* Returns the key of a chunk in the cache: the array's number and the chunk's number. */
static uint64_t key_of(const ebpo_array_in *array, uint64_t chunk)
{
    uint64_t number = array->id < EBPO_LEVEL_ARRAYS
                          ? (uint64_t)array->level * EBPO_LEVEL_ARRAYS + array->id
                          : (uint64_t)EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + array->id;
    if (array->id == EBPO_A_ATTRIBUTE)
        number += 1 + (uint64_t)array->level;
    return number << CHUNK_BITS | chunk;
}

/* Returns the array of a key. */
static const ebpo_array_in *array_of(const ebpo_chunks *c, uint64_t key)
{
    uint64_t number = key >> CHUNK_BITS, levels = (uint64_t)EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS;
    return number < levels
               ? &c->file->level_array[number / EBPO_LEVEL_ARRAYS][number % EBPO_LEVEL_ARRAYS]
           : number - levels <= EBPO_A_ATTRIBUTE
               ? &c->file->root_array[number - levels]
               : &c->file->attributes.array[number - levels - EBPO_A_ATTRIBUTE - 1];
}

/* Returns the number of the chunk with this key, in its array. */
static uint64_t chunk_of(uint64_t key) { return key & ((UINT64_C(1) << CHUNK_BITS) - 1); }

/* Returns the number of rows of a chunk, without padding. */
static uint64_t chunk_rows(const ebpo_array_in *array, uint64_t chunk)
{
    uint64_t remaining = array->shape.rows - chunk * array->shape.chunk_rows;
    return remaining < array->shape.chunk_rows ? remaining : array->shape.chunk_rows;
}

/* Callback of the cache: computes the memory of a chunk, which is the same during and after
 * loading. */
static ebpo_status estimate_chunk(void *user, uint64_t key, uint64_t *peak, uint64_t *keep,
                                  ebpo_error *error)
{
    const ebpo_array_in *array = array_of(user, key);
    (void)error;
    *peak = *keep = chunk_rows(array, chunk_of(key)) * ebpo_shape_row_bytes(&array->shape);
    return EBPO_OK;
}

/* Decodes the corners of faces. Checks that the vertices exist, and that the number of vertices
 * used so far agrees with the array /mesh/faces_index. */
static ebpo_status decode_faces(const ebpo_chunks *c, uint64_t chunk, uint64_t rows,
                                const uint8_t *raw, uint32_t *corners, ebpo_error *error)
{
    const ebpo_array_in *array = &c->file->root_array[EBPO_A_FACES];
    uint64_t vertices = c->file->info.vertex_count,
             used = c->vertices_before ? c->vertices_before[chunk] : 0;
    if (used > vertices || (chunk == 0 && used))
        return ebpo_chunks_fail(c, -1, EBPO_A_FACES_INDEX,
                                "the index has more vertices than the mesh", error);
    if (!ebpo_corners_decode(raw, rows, &used, corners) || used > vertices)
        return ebpo_chunks_fail(c, -1, EBPO_A_FACES, "a face names a vertex that does not exist",
                                error);
    if (chunk + 1 < ebpo_shape_chunks(&array->shape) && used != c->vertices_before[chunk + 1])
        return ebpo_chunks_fail(c, -1, EBPO_A_FACES_INDEX, "the index contradicts the faces",
                                error);
    return EBPO_OK;
}

static ebpo_status decode_vertices(const ebpo_chunks *c, uint64_t rows, const uint8_t *raw,
                                   void *xyz, ebpo_error *error)
{
    int finite = true;
    if (c->file->info.double_coordinates) {
        const double *values = xyz;
        ebpo_points64_decode(raw, rows, xyz);
        for (uint64_t i = 0; i < 3 * rows; i++)
            finite &= isfinite(values[i]) != 0;
    } else {
        const float *values = xyz;
        ebpo_points32_decode(raw, rows, xyz);
        for (uint64_t i = 0; i < 3 * rows; i++)
            finite &= fabsf(values[i]) <= FLT_MAX; /* compilers vectorise this loop */
    }
    return finite ? EBPO_OK
                  : ebpo_chunks_fail(c, -1, EBPO_A_VERTICES, "a coordinate is not a finite number",
                                     error);
}

/* Decodes source indices (positions in the source mesh) of vertices or faces. */
static ebpo_status decode_map(const ebpo_chunks *c, ebpo_array_id id, uint64_t rows,
                              const uint8_t *raw, uint32_t *indices, ebpo_error *error)
{
    const ebpo_info *info = &c->file->info;
    uint64_t limit = id == EBPO_A_FACE_SOURCE
                         ? info->source_face_count + info->repair_record.added_faces
                         : info->source_vertex_count;
    uint32_t largest = 0;
    ebpo_numbers_decode(raw, rows, indices);
    for (uint64_t i = 0; i < rows; i++)
        largest = indices[i] > largest ? indices[i] : largest;
    return largest < limit
               ? EBPO_OK
               : ebpo_chunks_fail(c, -1, id, "a source index is out of range or used twice", error);
}

/* Decodes a chunk and checks its values. */
static ebpo_status decode_item(const ebpo_chunks *c, const ebpo_array_in *array, uint64_t chunk,
                               const uint8_t *raw, void *item, ebpo_error *error)
{
    uint64_t rows = chunk_rows(array, chunk);
    switch (array->id) {
    case EBPO_A_VERTICES: return decode_vertices(c, rows, raw, item, error);
    case EBPO_A_FACES: return decode_faces(c, chunk, rows, raw, item, error);
    case EBPO_A_VERTEX_SOURCE:
    case EBPO_A_FACE_SOURCE: return decode_map(c, array->id, rows, raw, item, error);
    case EBPO_A_ATTRIBUTE: ebpo_attribute_decode(c->file, array, rows, raw, item); return EBPO_OK;
    default: memcpy(item, raw, rows * ebpo_shape_row_bytes(&array->shape)); return EBPO_OK;
    }
}

/* Adds to the hints those chunks of [begin, end) of an array that are not in memory. Returns true
 * if there are such chunks. */
static bool hint_missing(ebpo_chunks *c, ebpo_hints *e, const ebpo_array_in *array, uint64_t begin,
                         uint64_t end)
{
    bool missing = false;
    for (uint64_t i = begin; i < end; i++)
        if (!ebpo_cache_has(c->cache, key_of(array, i))) {
            ebpo_hint_chunks(e, array, i, i + 1);
            missing = true;
        }
    return missing;
}

bool ebpo_chunks_hint(ebpo_chunks *c, ebpo_hints *e, ebpo_array_id id, int level, uint64_t row,
                      uint64_t rows)
{
    const ebpo_array_in *array = ebpo_reader_array(c->file, id, level);
    if (!ebpo_hints_wanted(e) || !array->present || rows == 0 || row >= array->shape.rows)
        return false;
    if (c->collecting)
        (void)ebpo_chunks_missing(c, id, level, row, rows, c->collecting);
    if (c->counted)
        return false;
    uint64_t remaining = array->shape.rows - row,
             last = row + (rows < remaining ? rows : remaining) - 1;
    return hint_missing(c, e, array, row / array->shape.chunk_rows,
                        last / array->shape.chunk_rows + 1);
}

/* Sends prefetch hints for a chunk and adjacent chunks, which are likely to be read next. A request
 * for a few chunks takes about as long as a request for one chunk. */
static void hint_around(ebpo_chunks *c, const ebpo_array_in *array, uint64_t chunk)
{
    uint64_t begin = chunk / AROUND * AROUND, count = ebpo_shape_chunks(&array->shape);
    ebpo_hints e = EBPO_HINTS_INIT(c->file);
    /* in files with subtrees, adjacent chunks belong to other arrays */
    if (!ebpo_input_prefetches(&c->file->in) || c->file->info.subtree_level)
        return;
    hint_missing(c, &e, array, begin, count - begin < AROUND ? count : begin + AROUND);
    ebpo_hint_all(&e);
}

/* --- counting --- */

/* Returns the number of bytes that must be read for a chunk. If the chunk's offset is not known
 * yet, this is an upper bound, which includes the data with the chunk offsets. */
static uint64_t cost_of(const ebpo_chunks *c, const ebpo_array_in *array, uint64_t chunk)
{
    if (ebpo_shape_chunks(&array->shape) == 1 || atomic_load(&c->file->located))
        return array->chunks[chunk].bytes;
    const ebpo_info *info = &c->file->info;
    uint64_t prefetched = c->file->in.source.prefetched,
             index_end = info->chunk_index_offset + info->chunk_index_bytes;
    /* locating the chunks reads the headers again */
    uint64_t header = prefetched < info->head_bytes ? info->chunk_index_offset : 0;
    uint64_t index = index_end <= prefetched                 ? 0
                     : info->chunk_index_offset < prefetched ? index_end - prefetched
                                                             : info->chunk_index_bytes;
    return header + index + ebpo_reader_chunk_bound(array);
}

/* Returns true if `more` bytes can be read within the limit. Prefetched bytes count as read. */
static bool fits_budget(const ebpo_chunks *c, uint64_t more)
{
    uint64_t taken = atomic_load(&c->file->in.bytes) + c->ahead_bytes;
    return taken <= c->limit && more <= c->limit - taken;
}

static ebpo_status refuse_load(ebpo_chunks *c, const ebpo_array_in *array, ebpo_error *error)
{
    c->refused = true;
    return ebpo_fail_at(error, EBPO_E_LIMIT, c->file->in.shown, array->path, -1,
                        "reading more would exceed the limit of %" PRIu64 " bytes", c->limit);
}

/* Checks the limit before a chunk is read. Always admits a prefetched chunk, whose bytes were
 * counted when it was prefetched, and removes it from c->ahead. */
static ebpo_status admit_load(ebpo_chunks *c, const ebpo_array_in *array, uint64_t key,
                              ebpo_error *error)
{
    uint64_t cost = cost_of(c, array, chunk_of(key));
    for (uint64_t i = 0; i < c->ahead_count; i++)
        if (c->ahead[i] == key) {
            c->ahead[i] = c->ahead[--c->ahead_count];
            c->ahead_bytes -= cost;
            return EBPO_OK;
        }
    return fits_budget(c, cost) ? EBPO_OK : refuse_load(c, array, error);
}

/* Returns true if the chunk of a key is prefetched and not yet read. */
static bool is_ahead(const ebpo_chunks *c, uint64_t key)
{
    for (uint64_t i = 0; i < c->ahead_count; i++)
        if (c->ahead[i] == key)
            return true;
    return false;
}

static uint64_t smaller_of(uint64_t a, uint64_t b) { return a < b ? a : b; }

/* Returns a quarter of the remaining limit (at most AHEAD_MAX), minus the prefetched bytes that are
 * not yet read. Prefetched bytes may remain unread for long, for example when a view turns away.
 * The result is therefore at least a sixteenth of the remaining limit (at most a sixteenth of
 * AHEAD_MAX), so that chunks are not fetched one by one. */
uint64_t ebpo_chunks_capacity(const ebpo_chunks *c)
{
    uint64_t taken = atomic_load(&c->file->in.bytes),
             remaining = c->limit > taken ? c->limit - taken : 0,
             share = smaller_of(remaining / AHEAD_SHARE, AHEAD_MAX);
    uint64_t batch = smaller_of(remaining / BATCH_SHARE, AHEAD_MAX / BATCH_SHARE);
    return share > c->ahead_bytes + batch ? share - c->ahead_bytes : batch;
}

/* Sends prefetch hints for chunks of a counted cache, within its limit. The bytes of a chunk count
 * as read as soon as its hint is sent. The first `now` chunks are needed at once. The other chunks
 * are prefetched only within ebpo_chunks_capacity. */
static void chunks_hint(ebpo_chunks *c, const uint64_t *keys, unsigned now, unsigned count)
{
    ebpo_hints e = EBPO_HINTS_INIT(c->file);
    uint64_t space = ebpo_chunks_capacity(c);
    for (unsigned i = 0; i < count; i++) {
        const ebpo_array_in *array = array_of(c, keys[i]);
        if (ebpo_shape_chunks(&array->shape) > 1 && !atomic_load(&c->file->located))
            continue; /* the chunk's offset is not known yet */
        uint64_t cost = cost_of(c, array, chunk_of(keys[i]));
        if (is_ahead(c, keys[i]) || !fits_budget(c, cost) || (i >= now && cost > space) ||
            !ebpo_grow(&c->ahead, &c->ahead_capacity, c->ahead_count + 1, sizeof *c->ahead))
            continue;
        space -= i >= now ? cost : 0;
        c->ahead[c->ahead_count++] = keys[i];
        c->ahead_bytes += cost;
        ebpo_hint_chunks(&e, array, chunk_of(keys[i]), chunk_of(keys[i]) + 1);
    }
    ebpo_hint_all(&e);
}

bool ebpo_chunks_hinted(const ebpo_chunks *c, const ebpo_chunk_keys *keys)
{
    for (unsigned i = 0; i < keys->count; i++)
        if (!is_ahead(c, keys->key[i]))
            return false;
    return true;
}

static void clear_slots(ebpo_chunk_keys *keys, unsigned slots)
{
    keys->mask = slots - 1;
    memset(keys->slot, 0, slots * sizeof *keys->slot);
}

void ebpo_chunk_keys_begin(ebpo_chunk_keys *keys)
{
    keys->count = 0;
    keys->bytes = 0;
    clear_slots(keys, 16);
}

/* Returns the slot of a key, or the free slot for a new key. */
static uint64_t slot_of(const ebpo_chunk_keys *keys, uint64_t key)
{
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_number(key), keys->mask,
                   !keys->slot[at] || keys->key[keys->slot[at] - 1] == key);
    return at;
}

static void add_key(ebpo_chunk_keys *keys, uint64_t key, uint64_t bytes)
{
    uint64_t at = slot_of(keys, key);
    if (keys->slot[at] || keys->count == EBPO_CHUNK_KEYS)
        return;
    keys->key[keys->count++] = key;
    keys->bytes += bytes;
    keys->slot[at] = (uint16_t)keys->count;
    if (2 * keys->count <= keys->mask || keys->count == EBPO_CHUNK_KEYS)
        return;
    clear_slots(keys, 2 * (keys->mask + 1));
    for (unsigned i = 0; i < keys->count; i++)
        keys->slot[slot_of(keys, keys->key[i])] = (uint16_t)(i + 1);
}

bool ebpo_chunks_missing(ebpo_chunks *c, ebpo_array_id id, int level, uint64_t row, uint64_t rows,
                         ebpo_chunk_keys *keys)
{
    const ebpo_array_in *array = ebpo_reader_array(c->file, id, level);
    bool missing = false;
    if (!array->present || rows == 0 || row >= array->shape.rows)
        return false;
    uint64_t remaining = array->shape.rows - row,
             last = (row + (rows < remaining ? rows : remaining) - 1) / array->shape.chunk_rows;
    for (uint64_t i = row / array->shape.chunk_rows; i <= last; i++) {
        uint64_t key = key_of(array, i);
        if (!ebpo_cache_has(c->cache, key)) {
            missing = true;
            add_key(keys, key, cost_of(c, array, i));
        }
    }
    return missing;
}

void ebpo_chunks_collect(ebpo_chunks *c, ebpo_chunk_keys *keys) { c->collecting = keys; }

/* Returns true for chunks whose content determines which further chunks are needed: chunks of the
 * table of subtrees, and of the node types down to the subtrees' roots. */
static bool locates_more(const ebpo_chunks *c, uint64_t key)
{
    const ebpo_array_in *a = array_of(c, key);
    return a->id >= EBPO_A_SUBTREE_INDEX ||
           ((a->id == EBPO_A_TYPES || a->id == EBPO_A_TYPES_INDEX) &&
            a->level <= c->file->info.subtree_level);
}

ebpo_status ebpo_chunks_fetch(ebpo_chunks *c, const ebpo_chunk_keys *keys, unsigned now,
                              ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    chunks_hint(c, keys->key, now, keys->count);
    for (unsigned i = 0; i < keys->count && status == EBPO_OK; i++) {
        void *item;
        if (i >= now && !(locates_more(c, keys->key[i]) && is_ahead(c, keys->key[i])))
            continue;
        status = ebpo_cache_get(c->cache, keys->key[i], &item, NULL, error);
        if (status == EBPO_OK)
            ebpo_cache_unpin(c->cache, keys->key[i]);
    }
    return status;
}

/* Reads c->vertices_before. A counted cache calls this function when it reads its first chunk of
 * faces; other caches call it when they are created. */
static ebpo_status read_vertices_before(ebpo_chunks *c, ebpo_error *error)
{
    const ebpo_array_in *index = ebpo_reader_array(c->file, EBPO_A_FACES_INDEX, 0);
    uint64_t cost = 0;
    ebpo_read_options read = ebpo_read_threads(1);
    for (uint64_t i = 0; c->counted && index->present && i < ebpo_shape_chunks(&index->shape); i++)
        cost += cost_of(c, index, i);
    if (c->counted && !fits_budget(c, cost))
        return refuse_load(c, index, error);
    return ebpo_reader_make(c->file, EBPO_A_FACES_INDEX, 0, &read, sizeof *c->vertices_before,
                            &c->vertices_before, error);
}

void ebpo_chunks_limit(ebpo_chunks *chunks, uint64_t bytes)
{
    chunks->limit = bytes;
    chunks->refused = false;
}

bool ebpo_chunks_refused(const ebpo_chunks *chunks) { return chunks->refused; }

static ebpo_status load_chunk(void *user, uint64_t key, uint64_t most, void **item, uint64_t *bytes,
                              ebpo_error *error)
{
    (void)most;
    ebpo_chunks *c = user;
    const ebpo_array_in *array = array_of(c, key);
    ebpo_status allowed = c->counted && array->id == EBPO_A_FACES && !c->vertices_before
                              ? read_vertices_before(c, error)
                              : EBPO_OK;
    if (allowed == EBPO_OK && c->counted)
        allowed = admit_load(c, array, key, error);
    if (allowed != EBPO_OK)
        return allowed;
    uint64_t rows = chunk_rows(array, chunk_of(key));
    size_t row_bytes = ebpo_shape_row_bytes(&array->shape);
    ebpo_idle_readers *idle = &ebpo_reader_own(c->file)->idle;
    ebpo_idle_reader *reader = ebpo_idle_readers_take(idle);
    void *made = reader ? ebpo_alloc(rows, row_bytes) : NULL;
    ebpo_status status =
        made ? EBPO_OK : ebpo_fail_memory(error, rows * row_bytes + sizeof *reader);
    if (!c->counted)
        hint_around(c, array, chunk_of(key));
    if (status == EBPO_OK)
        status =
            ebpo_reader_chunk(c->file, array, chunk_of(key), &reader->reader, reader->raw, error);
    if (status == EBPO_OK)
        status = decode_item(c, array, chunk_of(key), reader->raw, made, error);
    ebpo_idle_readers_give(idle, reader);
    if (status == EBPO_OK) {
        *item = made;
        *bytes = rows * row_bytes;
    } else {
        free(made);
    }
    return status;
}

static void release_chunk(void *user, void *item)
{
    (void)user;
    free(item);
}

/* Creates a cache. `pool`: shared budget; NULL: the cache has the budget `budget`. */
static ebpo_status make_chunks(ebpo_chunks **out, const ebpo_file *file, uint64_t budget,
                               ebpo_cache_pool *pool, bool counted, ebpo_error *error)
{
    *out = NULL;
    ebpo_chunks *c = ebpo_alloc_zero(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->file = file;
    c->counted = counted;
    c->limit = UINT64_MAX;
    pthread_mutex_init(&c->lock, NULL);
    ebpo_cache_source source = { c, estimate_chunk, load_chunk, release_chunk };
    ebpo_status status = counted ? EBPO_OK : read_vertices_before(c, error);
    if (status == EBPO_OK)
        status = pool ? ebpo_cache_make_in(&c->cache, &source, "chunk", pool, error)
                      : ebpo_cache_make(&c->cache, &source, "chunk", budget, error);
    if (status == EBPO_OK)
        *out = c;
    else
        ebpo_chunks_free(c);
    return status;
}

ebpo_status ebpo_chunks_make(ebpo_chunks **out, const ebpo_file *file, uint64_t budget,
                             ebpo_error *error)
{
    return make_chunks(out, file, budget, NULL, false, error);
}

ebpo_status ebpo_chunks_make_in(ebpo_chunks **out, const ebpo_file *file, ebpo_cache_pool *pool,
                                ebpo_error *error)
{
    return make_chunks(out, file, 0, pool, false, error);
}

ebpo_status ebpo_chunks_make_counted(ebpo_chunks **out, const ebpo_file *file, uint64_t budget,
                                     ebpo_error *error)
{
    return make_chunks(out, file, budget, NULL, true, error);
}

void ebpo_chunks_free(ebpo_chunks *chunks)
{
    if (!chunks)
        return;
    ebpo_cache_free(chunks->cache);
    ebpo_array_free(NULL, chunks->vertices_before);
    free(chunks->ahead);
    free(chunks->rows);
    pthread_mutex_destroy(&chunks->lock);
    free(chunks);
}

void ebpo_chunks_get_stats(ebpo_chunks *chunks, ebpo_cache_stats *out)
{
    ebpo_cache_get_stats(chunks->cache, out);
}

void ebpo_held_chunk_release(ebpo_chunks *chunks, ebpo_held_chunk *view)
{
    if (view->rows)
        ebpo_cache_unpin(chunks->cache, view->key);
    *view = (ebpo_held_chunk){ .array = view->array };
}

ebpo_status ebpo_held_chunk_load(ebpo_chunks *chunks, ebpo_held_chunk *view, uint64_t row,
                                 ebpo_error *error)
{
    uint64_t chunk = row / view->array->shape.chunk_rows;
    void *item;
    /* released before loading, because a small budget may need the memory of the pinned chunk */
    ebpo_held_chunk_release(chunks, view);
    uint64_t key = key_of(view->array, chunk);
    if (chunks->collecting && !ebpo_cache_has(chunks->cache, key)) {
        add_key(chunks->collecting, key, cost_of(chunks, view->array, chunk));
        return EBPO_E_LIMIT;
    }
    ebpo_status status = ebpo_cache_get(chunks->cache, key, &item, NULL, error);
    if (status != EBPO_OK)
        return status;
    view->key = key;
    view->begin = chunk * view->array->shape.chunk_rows;
    view->end = view->begin + chunk_rows(view->array, chunk);
    view->rows = item;
    return EBPO_OK;
}

/* --- rows of plain arrays --- */

/* Converts integers of the file to native integers of `size` bytes. */
static void widen_integers(const ebpo_shape *shape, const uint8_t *rows, uint64_t count,
                           uint8_t *values, size_t size)
{
    if (shape->element_size == size && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__)
        memcpy(values, rows, count * size);
    else
        ebpo_integers_decode(rows, shape->element_size, shape->is_signed, count, values, size);
}

/* Checks a caller's request: the array has integers, the rows exist, and `size` is sufficient. */
static ebpo_status check_rows(const ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                              uint64_t rows, size_t size, ebpo_error *error)
{
    const char *shown = chunks->file->in.shown;
    bool of_surface = id >= EBPO_A_SURFACE_PATCHES && id <= EBPO_A_SURFACE_COLOURS;
    if ((id >= EBPO_LEVEL_ARRAYS && id != EBPO_A_SUBTREE_SHARED && !of_surface) || level < 0 ||
        level >= chunks->file->info.level_count)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                              "level %d has no integer array number %d", level, (int)id);
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, id, level);
    if (!array->present || row > array->shape.rows || rows > array->shape.rows - row ||
        size < array->shape.element_size)
        return ebpo_fail_at(error, EBPO_E_ARGUMENT, shown, array->path, -1,
                            "%" PRIu64 " rows from row %" PRIu64
                            " on, with elements of %zu bytes, were requested, but the array has "
                            "%" PRIu64 " rows with elements of %d bytes",
                            rows, row, size, array->shape.rows, array->shape.element_size);
    return EBPO_OK;
}

ebpo_status ebpo_chunks_integers(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                                 uint64_t rows, void *values, size_t size, ebpo_error *error)
{
    ebpo_status status = check_rows(chunks, id, level, row, rows, size, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, id, level);
    ebpo_hints hints = EBPO_HINTS_INIT(chunks->file);
    if (!chunks->counted)
        ebpo_chunks_hint(chunks, &hints, id, level, row, rows);
    ebpo_hint_all(&hints);
    ebpo_held_chunk view = { .array = array };
    uint64_t cols = array->shape.cols ? array->shape.cols : 1;
    uint8_t *out = values;
    while (rows && status == EBPO_OK) {
        status = ebpo_held_chunk_move(chunks, &view, row, error);
        if (status != EBPO_OK)
            break;
        uint64_t step = view.end - row < rows ? view.end - row : rows;
        widen_integers(&array->shape,
                       view.rows + (row - view.begin) * ebpo_shape_row_bytes(&array->shape),
                       step * cols, out, size);
        out += step * cols * size;
        row += step;
        rows -= step;
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

ebpo_status ebpo_chunks_take(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                             uint64_t rows, size_t size, void *values_out, ebpo_error *error)
{
    void *values = NULL;
    /* check the request first, because it determines the size of the memory */
    ebpo_status status = rows ? check_rows(chunks, id, level, row, rows, size, error) : EBPO_OK;
    if (status == EBPO_OK && rows) {
        const ebpo_array_in *array = ebpo_reader_array(chunks->file, id, level);
        uint64_t cols = array->shape.cols ? array->shape.cols : 1;
        values = ebpo_alloc(rows, size * cols);
        status = values ? ebpo_chunks_integers(chunks, id, level, row, rows, values, size, error)
                        : ebpo_fail_memory(error, rows * size * cols);
    }
    if (status != EBPO_OK) {
        free(values);
        values = NULL;
    }
    memcpy(values_out, &values, sizeof values);
    return status;
}
