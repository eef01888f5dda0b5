/* Verifies how the file stores its chunks (format-spec/gates.md, checksums.md).
 *
 * - The chunks of faces with the coding `gates` are decoded by a reference implementation, which
 *   follows the specification line by line and is not optimised. The corners are compared with the
 *   corners that the library has decoded.
 * - The list of chunk offsets (/subtrees/chunk_directory) is compared with HDF5's indexes.
 * - Unused bytes of the file are counted. They do not affect results, but a change of these bytes
 *   must be detectable.
 * - Chunk checksums are compared with the last bytes of the chunks. These bytes are read without
 *   the library's check of checksums. The order of /subtrees/checksums is computed from the numbers
 *   of the specification. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "format/chunk_directory.h"
#include "format/reader.h"
#include "hdf5_read/chunk.h"
#include "hdf5_read/head.h"
#include "verify/verify_parts.h"

/* --- reference implementation of a reader of the coding `gates` --- */

/* Limits of the specification. OPEN_MAX: maximum number of open edges. NEWEST_EDGES: number of
 * newest open edges among which pass_edge searches an edge. */
enum { OPEN_MAX = 64, NEWEST_EDGES = 32 };

/* An open edge, from vertex a to vertex b: an edge of a face that was read, across which the next
 * face may be read. */
typedef struct open_edge_ends {
    uint64_t a, b;
} open_edge_ends;

typedef struct gates_reader {
    const uint8_t *low;                /* first byte of the next vertex */
    const uint8_t *more, *end;         /* next of the bytes after the first; end of these bytes */
    open_edge_ends open[OPEN_MAX + 1]; /* newest last */
    size_t count;                      /* number of open edges */
    uint64_t used;                     /* number of vertices used so far */
} gates_reader;

static void open_edge(gates_reader *t, uint64_t a, uint64_t b)
{
    t->open[t->count++] = (open_edge_ends){ a, b };
    if (t->count > OPEN_MAX)
        memmove(t->open, t->open + 1, --t->count * sizeof *t->open);
}

static void remove_edge(gates_reader *t, size_t at)
{
    memmove(t->open + at, t->open + at + 1, (--t->count - at) * sizeof *t->open);
}

/* If the edge from a to b is among the newest open edges, removes it; if not, opens the reverse
 * edge. */
static void pass_edge(gates_reader *t, uint64_t a, uint64_t b)
{
    for (size_t back = 1; back <= NEWEST_EDGES && back <= t->count; back++)
        if (t->open[t->count - back].a == a && t->open[t->count - back].b == b) {
            remove_edge(t, t->count - back);
            return;
        }
    open_edge(t, b, a);
}

/* Reads a vertex from the bytes `low` and `more`. Returns false if the chunk is invalid. */
static bool read_vertex(gates_reader *t, uint64_t *vertex)
{
    uint64_t code = *t->low++;
    if (code > 240)
        return false;
    if (code == 240) {
        if (t->end - t->more < 4)
            return false;
        code = t->more[0] + 256u * t->more[1] + 65536u * t->more[2] + 16777216ull * t->more[3];
        t->more += 4;
    } else if (code >= 224) {
        if (t->more == t->end)
            return false;
        code = 224 + 256 * (code - 224) + *t->more++;
    }
    if (code > t->used)
        return false;
    *vertex = t->used - code;
    t->used += code == 0;
    return true;
}

/* Returns the index of the newest open edge that begins (if `first` is true) or ends at the vertex.
 * Returns t->count if there is none. */
static size_t newest_edge(const gates_reader *t, bool first, uint64_t vertex)
{
    for (size_t i = t->count; i > 0; i--)
        if ((first ? t->open[i - 1].a : t->open[i - 1].b) == vertex)
            return i - 1;
    return t->count;
}

/* Reads a face across an open edge, its gate. `gate`: number of the open edge; 1 is the newest.
 * `third`: three times the kind of the face's third vertex c, plus the position of the gate in the
 * face. Returns false if the chunk is invalid. Kinds of c, if the gate leads from a to b:
 *   0: a new vertex
 *   1: the end of the newest open edge that begins at b
 *   2: the beginning of the newest open edge that ends at a
 *   3: a vertex that is stored as read_vertex reads it
 *   4 and more: the beginning of an open edge; 4: the newest open edge */
static bool read_across(gates_reader *t, unsigned gate, unsigned third, uint64_t *face)
{
    uint64_t c = 0;
    unsigned kind = third / 3, k = third % 3;
    if (gate > t->count)
        return false;
    open_edge_ends e = t->open[t->count - gate];
    remove_edge(t, t->count - gate);
    size_t at = kind == 1   ? newest_edge(t, true, e.b)
                : kind == 2 ? newest_edge(t, false, e.a)
                : kind >= 4 ? t->count - 1 - (kind - 4)
                            : 0;
    if (kind != 0 && kind != 3 && (kind >= 4 ? kind - 4 >= t->count : at == t->count))
        return false;
    if (kind == 0)
        c = t->used++;
    else if (kind == 3 && !read_vertex(t, &c))
        return false;
    else if (kind != 3)
        c = kind == 1 ? t->open[at].b : t->open[at].a;
    if (kind == 1 || kind == 2)
        remove_edge(t, at);
    if (kind == 0) {
        open_edge(t, c, e.b);
        open_edge(t, e.a, c);
    }
    if (kind >= 2)
        pass_edge(t, e.b, c);
    if (kind == 1 || kind >= 3)
        pass_edge(t, c, e.a);
    face[k] = e.a;
    face[(k + 1) % 3] = e.b;
    face[(k + 2) % 3] = c;
    return true;
}

/* Reads a chunk whose faces are stored corner by corner (first byte 1). */
static bool read_corner_codes(const uint8_t *in, uint32_t rows, uint64_t *used, uint32_t *faces)
{
    for (size_t i = 0; i < 3 * (size_t)rows; i++) {
        uint64_t code = 0;
        for (size_t k = 0; k < 4; k++)
            code += (uint64_t)in[1 + k * 3 * rows + i] << 8 * k;
        if (code > *used)
            return false;
        faces[i] = (uint32_t)(*used - code);
        *used += code == 0;
    }
    for (size_t i = 12 * (size_t)rows + 1; i < 13 * (size_t)rows; i++)
        if (in[i])
            return false;
    return true;
}

bool ebpo_plain_gates_read(const uint8_t *in, uint32_t rows, uint64_t *used, uint32_t *faces)
{
    gates_reader t;
    size_t thirds = 0, numbers = 0;
    if (in[0] == 1)
        return read_corner_codes(in, rows, used, faces);
    for (uint32_t i = 0; i < rows; i++)
        thirds += in[i] != 0;
    for (size_t i = 0; i < thirds; i++)
        numbers += in[rows + i] / 3 == 3;
    const uint8_t *third = in + rows;
    t.low = third + thirds;
    t.more = t.low + 3 * (rows - thirds) + numbers;
    t.end = in + 13 * (size_t)rows;
    t.count = 0;
    t.used = *used;
    for (uint32_t i = 0; i < rows; i++) {
        uint64_t face[3];
        bool ok = true;
        if (in[i]) {
            ok = read_across(&t, in[i], *third++, face);
        } else {
            for (int k = 0; k < 3 && ok; k++)
                ok = read_vertex(&t, &face[k]);
            for (int k = 0; k < 3 && ok; k++)
                open_edge(&t, face[(k + 1) % 3], face[k]);
        }
        for (int k = 0; k < 3 && ok; k++)
            faces[3 * i + (uint32_t)k] = (uint32_t)face[k];
        if (!ok)
            return false;
    }
    for (; t.more < t.end; t.more++)
        if (*t.more)
            return false;
    *used = t.used;
    return true;
}

/* --- comparison with the corners that the library decoded --- */

enum { CORNERS_MAX = EBPO_CHUNK_BYTES_MAX / 4 };

static void compare_gates_chunk(ebpo_tally *tally, const uint8_t *streams, uint32_t *faces,
                                const ebpo_tree *tree, uint64_t row, uint64_t rows, uint64_t *used)
{
    const uint32_t *corners = tree->mesh.faces + 3 * row;
    bool same = ebpo_plain_gates_read(streams, (uint32_t)rows, used, faces);
    for (uint64_t i = 0; i < 3 * rows && same; i++)
        same = faces[i] == corners[i];
    (void)ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, same,
                           "/mesh/faces, from face %" PRIu64
                           " on: the two decoders give different corners",
                           row);
}

static ebpo_status compare_gates(ebpo_tally *tally, const ebpo_file *file, const ebpo_tree *tree,
                                 ebpo_idle_reader *r, uint32_t *faces, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, EBPO_A_FACES, 0);
    ebpo_status status = EBPO_OK;
    uint64_t used = 0, rows = array->shape.chunk_rows;
    for (uint64_t row = 0; row < array->shape.rows && status == EBPO_OK; row += rows) {
        uint64_t remaining = array->shape.rows - row;
        status = ebpo_reader_gates(file, row / rows, &r->reader, r->raw, error);
        if (status == EBPO_OK)
            compare_gates_chunk(tally, r->raw, faces, tree, row,
                                remaining < rows ? remaining : rows, &used);
    }
    return status;
}

ebpo_status ebpo_check_gates(ebpo_tally *tally, const ebpo_file *file, const ebpo_tree *tree,
                             ebpo_error *error)
{
    if (!ebpo_reader_array(file, EBPO_A_FACES, 0)->gates)
        return EBPO_OK;
    ebpo_idle_reader *r = ebpo_idle_readers_take(&ebpo_reader_own(file)->idle);
    uint32_t *faces = ebpo_alloc(CORNERS_MAX, sizeof *faces);
    ebpo_status status = r && faces ? compare_gates(tally, file, tree, r, faces, error)
                                    : ebpo_fail_memory(error, CORNERS_MAX * sizeof *faces);
    free(faces);
    ebpo_idle_readers_give(&ebpo_reader_own(file)->idle, r);
    return status;
}

/* --- the list of chunk offsets --- */

#define CHECK(condition, ...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, condition, __VA_ARGS__)

/* An array, and its chunks according to HDF5's index. */
typedef struct indexed {
    const ebpo_array_in *array;
    uint32_t number; /* number by which the list identifies the array */
    ebpo_chunk_location *chunks;
    uint64_t count;  /* number of chunks in HDF5's index */
    uint64_t listed; /* number of this array's chunks found in the list so far */
} indexed;

enum { INDEXED_MAX = EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS };

typedef struct offset_comparison {
    ebpo_tally *tally;
    const ebpo_file *file;
    ebpo_head head;
    indexed array[INDEXED_MAX];
    unsigned arrays;
    /* [rows] the list: the array's number in the upper 32 bits, the chunk's size in bytes in the
     * lower 32 bits */
    uint64_t *list, rows;
} offset_comparison;

/* Reads HDF5's index of an array, if the file has the array. `number`: the array's number in the
 * specification, which has 64 numbers for each level, and then numbers for all other arrays. */
static ebpo_status index_array(offset_comparison *c, const ebpo_array_in *array, uint32_t number,
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

static ebpo_status index_all(offset_comparison *c, ebpo_error *error)
{
    static const struct {
        ebpo_array_id id;
        uint32_t number;
    } roots[] = { { EBPO_A_VERTICES, 4096 },          { EBPO_A_FACES, 4097 },
                  { EBPO_A_FACES_INDEX, 4098 },       { EBPO_A_VERTEX_SOURCE, 4099 },
                  { EBPO_A_FACE_SOURCE, 4100 },       { EBPO_A_BORDER_LOOPS, 4101 },
                  { EBPO_A_BORDER_POINTS, 4102 },     { EBPO_A_SURFACE_PATCHES, 4103 },
                  { EBPO_A_SURFACE_TRIANGLES, 4104 }, { EBPO_A_SURFACE_POINTS, 4105 },
                  { EBPO_A_SURFACE_NORMALS, 4106 },   { EBPO_A_SURFACE_COLOURS, 4107 },
                  { EBPO_A_SUBTREE_INDEX, 4112 },     { EBPO_A_SUBTREE_COUNTS, 4113 },
                  { EBPO_A_SUBTREE_SHARED, 4114 },    { EBPO_A_CHECKSUM_PAGES, 4117 } };
    ebpo_status status = EBPO_OK;
    for (int level = 0; level < c->file->info.level_count && status == EBPO_OK; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS && status == EBPO_OK; id++)
            status = index_array(c, &c->file->level_array[level][id], (uint32_t)(64 * level + id),
                                 error);
    for (size_t i = 0; i < sizeof roots / sizeof *roots && status == EBPO_OK; i++)
        status = index_array(c, &c->file->root_array[roots[i].id], roots[i].number, error);
    return status;
}

/* Reads the list, /subtrees/chunk_directory. */
static ebpo_status read_list(offset_comparison *c, ebpo_error *error)
{
    const ebpo_array_in *a = &c->file->root_array[EBPO_A_CHUNK_DIRECTORY];
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
        status =
            ebpo_fail_file(error, status, c->file->in.shown, "/subtrees/chunk_directory: %s", why);
    free(stored);
    return status;
}

static indexed *find_indexed(offset_comparison *c, uint32_t number)
{
    for (unsigned i = 0; i < c->arrays; i++)
        if (c->array[i].number == number)
            return &c->array[i];
    return NULL;
}

/* Compares a row of the list with HDF5's index. `at`, `bytes`: offset in the file and size of the
 * chunk according to the list. */
static void compare_row(offset_comparison *c, uint64_t row, uint64_t at, uint32_t bytes)
{
    ebpo_tally *tally = c->tally;
    uint32_t number = (uint32_t)(c->list[row] >> 32);
    indexed *of = find_indexed(c, number);
    if (!of) /* the row is a gap, or belongs to an array that the header does not require */
        return;
    if (!CHECK(of->listed < of->count,
               "/subtrees/chunk_directory, row %" PRIu64 ": %s has only %" PRIu64 " chunks", row,
               of->array->path, of->count))
        return;
    const ebpo_chunk_location *chunk = &of->chunks[of->listed++];
    CHECK(chunk->address == at && chunk->bytes == bytes,
          "/subtrees/chunk_directory, row %" PRIu64 ": %" PRIu32 " bytes at %" PRIu64
          " as chunk %" PRIu64 " of %s, but HDF5 has %" PRIu32 " at %" PRIu64,
          row, bytes, at, of->listed - 1, of->array->path, chunk->bytes, chunk->address);
}

static void compare_directory(offset_comparison *c)
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
              "/subtrees/chunk_directory has %" PRIu64 " of the %" PRIu64 " chunks of %s",
              c->array[i].listed, c->array[i].count, c->array[i].array->path);
}

ebpo_status ebpo_check_chunk_offsets(ebpo_tally *tally, const ebpo_file *file,
                                     const ebpo_verify_options *options, ebpo_error *error)
{
    ebpo_error failure = EBPO_ERROR_INIT;
    (void)options;
    if (!file->has_directory)
        return EBPO_OK;
    offset_comparison *c = ebpo_alloc_zero(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->tally = tally;
    c->file = file;
    c->head = (ebpo_head)EBPO_HEAD_INIT;
    ebpo_status status = ebpo_head_open(&c->head, &ebpo_reader_own(file)->in, &failure);
    if (status == EBPO_OK)
        status = index_all(c, &failure);
    status = ebpo_head_close(&c->head, status, &failure);
    if (status == EBPO_OK)
        status = read_list(c, &failure);
    if (status == EBPO_OK)
        compare_directory(c);
    for (unsigned i = 0; i < c->arrays; i++)
        free(c->array[i].chunks);
    free(c->list);
    free(c);
    if (status != EBPO_E_FORMAT)
        return status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &failure);
    CHECK(false, "%s", failure.message);
    return EBPO_OK;
}

/* --- unused bytes --- */

/* State of the search for unused bytes of the file. */
typedef struct survey {
    const ebpo_file *file;
    const ebpo_progress *progress;
    ebpo_head head;
    ebpo_range *range; /* [count] ranges of used bytes */
    uint64_t count, capacity;
} survey;

static ebpo_status add_range(survey *s, ebpo_range range, ebpo_error *error)
{
    if (!ebpo_grow(&s->range, &s->capacity, s->count + 1, sizeof *s->range))
        return ebpo_fail_memory(error, (s->count + 1) * sizeof *s->range);
    s->range[s->count++] = range;
    return EBPO_OK;
}

/* Adds the chunks of an array to the used bytes. */
static ebpo_status add_array(survey *s, const ebpo_array_in *a, ebpo_head_rows rows,
                             ebpo_error *error)
{
    ebpo_shape shape;
    ebpo_chunk_location *chunks = NULL;
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

/* Adds the superblock, headers and indexes to the used bytes. */
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

/* Adds the number of bytes of a gap that are not zero to *filled. The gap may be large, so it is
 * read in several steps. */
static ebpo_status inspect_gap(const survey *s, ebpo_range gap, uint64_t *filled, ebpo_error *error)
{
    enum { STEP_BYTES = 1 << 14 };
    uint8_t bytes[STEP_BYTES];
    ebpo_input *in = &ebpo_reader_own(s->file)->in;
    ebpo_status status = EBPO_OK;
    while (gap.size && status == EBPO_OK) {
        uint64_t size = gap.size < STEP_BYTES ? gap.size : STEP_BYTES;
        if (!ebpo_progress_step(s->progress, "checking unused bytes", gap.offset, in->source.size,
                                error))
            return EBPO_E_CANCELLED;
        status = ebpo_input_read(in, gap.offset, size, bytes, error);
        for (uint64_t i = 0; i < size && status == EBPO_OK; i++)
            *filled += bytes[i] != 0;
        gap = (ebpo_range){ gap.offset + size, gap.size - size };
    }
    return status;
}

/* Sets *spare to the number of bytes between the used ranges, and *filled to the number of those
 * bytes that are not zero. */
static ebpo_status inspect_gaps(survey *s, uint64_t *spare, uint64_t *filled, ebpo_error *error)
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
            status = inspect_gap(s, (ebpo_range){ end, r.offset - end }, filled, error);
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
    ebpo_error failure = EBPO_ERROR_INIT;
    *spare = *filled = 0;
    if (ebpo_input_prefetches(in))
        return EBPO_OK;
    ebpo_status status = ebpo_head_open(&s.head, in, &failure);
    if (status == EBPO_OK) {
        ebpo_head_keep_ranges(&s.head);
        status = add_arrays(&s, &failure);
    }
    if (status == EBPO_OK)
        status = add_metadata(&s, &failure);
    status = ebpo_head_close(&s.head, status, &failure);
    if (status == EBPO_OK)
        status = inspect_gaps(&s, spare, filled, &failure);
    free(s.range);
    /* damage is not reported here, because other checks read the damaged data and report the damage
     */
    return status == EBPO_OK || status == EBPO_E_FORMAT ? EBPO_OK : ebpo_fail_with(error, &failure);
}

/* --- chunk checksums --- */

enum {
    SUM_BYTES = 4,  /* size of a checksum */
    UNKNOWN = 20000 /* greater than all numbers of arrays */
};

typedef struct checksum_comparison {
    ebpo_tally *tally;
    const ebpo_file *file;
    const char *path; /* of the list */
    /* [rows] the list: the array's number in the upper 32 bits, the checksum in the lower 32 bits
     */
    const uint64_t *list;
    uint64_t rows;
    /* if the list is /subtrees/checksum_index: the values of /subtrees/checksums (else NULL), and
     * of /subtrees/index, which has `blocks` rows of `cols` columns */
    const uint32_t *page;
    const uint64_t *index;
    uint64_t page_rows, blocks, cols;
} checksum_comparison;

/* Returns an array's number in the specification, or UNKNOWN. */
static uint32_t number_of(const ebpo_array_in *a)
{
    switch (a->id) {
    case EBPO_A_VERTICES: return 4096;
    case EBPO_A_FACES: return 4097;
    case EBPO_A_FACES_INDEX: return 4098;
    case EBPO_A_VERTEX_SOURCE: return 4099;
    case EBPO_A_FACE_SOURCE: return 4100;
    case EBPO_A_BORDER_LOOPS: return 4101;
    case EBPO_A_BORDER_POINTS: return 4102;
    case EBPO_A_SURFACE_PATCHES: return 4103;
    case EBPO_A_SURFACE_TRIANGLES: return 4104;
    case EBPO_A_SURFACE_POINTS: return 4105;
    case EBPO_A_SURFACE_NORMALS: return 4106;
    case EBPO_A_SURFACE_COLOURS: return 4107;
    case EBPO_A_SUBTREE_INDEX: return 4112;
    case EBPO_A_SUBTREE_COUNTS: return 4113;
    case EBPO_A_SUBTREE_SHARED: return 4114;
    case EBPO_A_CHECKSUM_PAGES: return 4117;
    case EBPO_A_ATTRIBUTE: return 8191 + (uint32_t)a->level;
    default: return a->id < EBPO_LEVEL_ARRAYS ? 64 * (uint32_t)a->level + (uint32_t)a->id : UNKNOWN;
    }
}

/* Compares the last bytes of a chunk with the value in a row of the list or array `path`. */
static ebpo_status compare_sum(checksum_comparison *c, const ebpo_array_in *a, uint64_t chunk,
                               const char *path, uint64_t row, uint32_t value, ebpo_error *error)
{
    ebpo_tally *tally = c->tally;
    ebpo_chunk_location at = a->chunks[chunk];
    uint8_t end[SUM_BYTES] = { 0 };
    if (!CHECK(at.bytes >= SUM_BYTES, "%s, chunk %" PRIu64 ": less than four bytes", a->path,
               chunk))
        return EBPO_OK;
    ebpo_status status = ebpo_input_read(&ebpo_reader_own(c->file)->in,
                                         at.address + at.bytes - SUM_BYTES, SUM_BYTES, end, error);
    if (status == EBPO_OK)
        CHECK(ebpo_load32(end) == value,
              "%s, chunk %" PRIu64 ": %s, row %" PRIu64 ", contains %08" PRIx32
              ", but the chunk ends with %08" PRIx32,
              a->path, chunk, path, row, value, ebpo_load32(end));
    return status;
}

/* Returns true if /subtrees/checksums has the chunks of an array. Three arrays of a level, with the
 * numbers 10 to 12, are indexes. */
static bool is_in_pages(const checksum_comparison *c, const ebpo_array_in *a)
{
    uint32_t number = number_of(a), of_level = number % 64;
    return c->page && a->present && ebpo_shape_chunks(&a->shape) > c->blocks &&
           (number == 4096 || number == 4097 || number == 4099 || number == 4100 ||
            (number < 4096 && (int)(number / 64) > c->file->info.subtree_level &&
             (of_level < 10 || of_level > 12)));
}

/* Returns the number of rows of an array before a block of subtrees (format-spec/checksums.md,
 * section 4). */
static uint64_t rows_before(const checksum_comparison *c, const ebpo_array_in *a, uint64_t block)
{
    /* column of each array of a level in the row of the level */
    static const uint8_t column[] = { 0, 0, 3, 1, 2, 0, 1, 1, 1, 5, 0, 0, 0, 1, 4, 0 };
    enum { TYPES = 0, WHITE = 5 };
    const uint64_t *row = c->index + block * c->cols;
    uint32_t number = number_of(a),
             before = number / 64 - (uint32_t)c->file->info.subtree_level - 1;
    if (number >= 4096)
        return number == 4096 || number == 4099 ? row[2] + row[3] : row[0] + row[1];
    const uint64_t *level = row + 6 + 7 * before;
    uint64_t groups =
        before ? level[-7] : block * c->file->root_array[EBPO_A_SUBTREE_COUNTS].shape.chunk_rows;
    return number % 64 == TYPES   ? groups
           : number % 64 == WHITE ? 8 * groups - level[0] - level[1] - level[2]
                                  : level[column[number % 64]];
}

/* Compares the next chunks of an array with the next rows of the pages, up to the rows of the block
 * after `block`. *done: number of chunks before. */
static ebpo_status compare_block(checksum_comparison *c, const ebpo_array_in *a, uint64_t block,
                                 uint64_t *done, uint64_t *row, ebpo_error *error)
{
    uint64_t end = block + 1 < c->blocks ? rows_before(c, a, block + 1) : UINT64_MAX;
    ebpo_status status = EBPO_OK;
    for (; *done < ebpo_shape_chunks(&a->shape) && *done * a->shape.chunk_rows < end &&
           *row < c->page_rows && status == EBPO_OK;
         ++*done, ++*row)
        status = compare_sum(c, a, *done, "/subtrees/checksums", *row, c->page[*row], error);
    return status;
}

/* Compares the chunks of subtrees with the pages. */
static ebpo_status compare_pages(checksum_comparison *c, ebpo_error *error)
{
    const ebpo_file *file = c->file;
    ebpo_tally *tally = c->tally;
    uint64_t row = 0, done[INDEXED_MAX] = { 0 };
    ebpo_status status = EBPO_OK;
    for (uint64_t block = 0; c->page && block < c->blocks; block++) {
        unsigned n = 0;
        for (int level = 0; level < file->info.level_count; level++)
            for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++, n++)
                if (status == EBPO_OK && is_in_pages(c, &file->level_array[level][id]))
                    status = compare_block(c, &file->level_array[level][id], block, &done[n], &row,
                                           error);
        for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS; id++, n++)
            if (status == EBPO_OK && is_in_pages(c, &file->root_array[id]))
                status = compare_block(c, &file->root_array[id], block, &done[n], &row, error);
    }
    if (c->page && status == EBPO_OK)
        CHECK(row == c->page_rows,
              "/subtrees/checksums has %" PRIu64 " rows, but the subtrees have %" PRIu64 " chunks",
              c->page_rows, row);
    return status;
}

static ebpo_status compare_array(checksum_comparison *c, const ebpo_array_in *a, ebpo_error *error)
{
    ebpo_tally *tally = c->tally;
    ebpo_status status = EBPO_OK;
    uint32_t number = number_of(a);
    if (!a->present || number == UNKNOWN || is_in_pages(c, a))
        return EBPO_OK;
    uint64_t found = 0, chunks = ebpo_shape_chunks(&a->shape);
    for (uint64_t row = 0; row < c->rows && status == EBPO_OK; row++)
        if ((uint32_t)(c->list[row] >> 32) == number && found++ < chunks)
            status = compare_sum(c, a, found - 1, c->path, row, (uint32_t)c->list[row], error);
    CHECK(found == chunks, "%s has %" PRIu64 " rows of the %" PRIu64 " chunks of %s", c->path,
          found, chunks, a->path);
    return status;
}

static ebpo_status compare_checksums(checksum_comparison *c, ebpo_error *error)
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

ebpo_status ebpo_check_checksums(ebpo_tally *tally, const ebpo_file *file, ebpo_error *error)
{
    const ebpo_array_in *a = &file->root_array[file->checksum_list],
                        *index = &file->root_array[EBPO_A_SUBTREE_INDEX];
    ebpo_read_options options = ebpo_read_threads(1);
    ebpo_error failure = EBPO_ERROR_INIT;
    uint64_t *list = NULL, *sums = NULL;
    uint32_t *page = NULL;
    /* in a remote file, this check would send a request for each chunk; such a file is checked only
     * by the library's reader */
    if (!file->has_checksums || ebpo_input_prefetches(&ebpo_reader_own(file)->in))
        return EBPO_OK;
    ebpo_status status = ebpo_file_locate(file, NULL, &failure);
    if (status == EBPO_OK)
        status = ebpo_long_chunk_read(file, a, &list, &failure);
    if (status == EBPO_OK && file->checksum_list == EBPO_A_CHECKSUM_INDEX) {
        status = ebpo_reader_make(file, EBPO_A_CHECKSUM_PAGES, 0, &options, sizeof *page, &page,
                                  &failure);
        if (status == EBPO_OK)
            status = ebpo_reader_make(file, EBPO_A_SUBTREE_INDEX, 0, &options, sizeof *sums, &sums,
                                      &failure);
    }
    checksum_comparison c = { .tally = tally,
                              .file = file,
                              .path = a->path,
                              .list = list,
                              .rows = a->shape.rows,
                              .page = page,
                              .page_rows = file->root_array[EBPO_A_CHECKSUM_PAGES].shape.rows,
                              .index = sums,
                              .blocks = index->shape.rows,
                              .cols = index->shape.cols };
    if (status == EBPO_OK)
        status = compare_checksums(&c, &failure);
    if (status == EBPO_OK)
        status = compare_pages(&c, &failure);
    free(list);
    ebpo_array_free(NULL, page);
    ebpo_array_free(NULL, sums);
    if (status != EBPO_E_FORMAT)
        return status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &failure);
    CHECK(false, "%s", failure.message);
    return EBPO_OK;
}
