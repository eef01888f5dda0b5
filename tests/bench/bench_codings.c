/* Measures bytes per face of other codings of the arrays of a file, chunk by chunk: bench_codings
 * FILE.ebpo.h5. Prints a table for docs/develop/codings.md. Speeds are 10^6 bytes of the array a
 * second on one core, zstd included, the best of three rounds for each chunk. Float coordinates
 * only. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <zdict.h>
#include <zstd.h>

#include <ebpo/file.h>

#include "core/endian.h"
#include "hdf5_read/coding.h"
#include "hdf5_read/face_gates.h"

enum { SPACE = 1 << 20, STREAMS_MAX = 32, TURNS = 3, DICTIONARY = 16384 };

/* Contents of a chunk before zstd: streams of similar bytes. */
typedef struct streams {
    const uint8_t *bytes[STREAMS_MAX];
    size_t size[STREAMS_MAX];
    int count;
} streams;

/* How zstd is used. `blocks`: one block for each stream. */
typedef struct effort {
    int level, match_least;
    bool blocks;
    const void *dictionary;
    size_t dictionary_bytes;
} effort;

static const effort one_block = { 3, 0, false, NULL, 0 }, today = { 7, 6, true, NULL, 0 };

static ebpo_tree tree;
static uint32_t faces_rows, vertices_rows, list_rows; /* rows of a chunk */
static ZSTD_CCtx *writer;
static ZSTD_DCtx *reader;
static uint8_t stored[SPACE], space[SPACE];

static void check(bool fine, const char *what)
{
    if (!fine) {
        fprintf(stderr, "bench_codings: %s\n", what);
        exit(1);
    }
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void begin_frame(const effort *e, size_t size)
{
    bool small = e->blocks && size < 4096; /* as in lib/hdf5_read/chunk.c */
    ZSTD_CCtx_reset(writer, ZSTD_reset_session_and_parameters);
    ZSTD_CCtx_setParameter(writer, ZSTD_c_compressionLevel, small ? 3 : e->level);
    ZSTD_CCtx_setParameter(writer, ZSTD_c_checksumFlag, 1);
    if (e->match_least && !small)
        ZSTD_CCtx_setParameter(writer, ZSTD_c_minMatch, e->match_least);
    if (e->dictionary)
        ZSTD_CCtx_loadDictionary(writer, e->dictionary, e->dictionary_bytes);
    ZSTD_CCtx_setPledgedSrcSize(writer, size);
}

/* Writes one frame with all streams to `stored`. */
static size_t frame(const streams *s, const effort *e)
{
    size_t size = 0;
    int last = 0;
    for (int i = 0; i < s->count; i++) {
        size += s->size[i];
        last = s->size[i] ? i : last;
    }
    begin_frame(e, size);
    ZSTD_outBuffer out = { stored, sizeof stored, 0 };
    for (int i = 0; i <= last; i++) {
        ZSTD_inBuffer in = { s->bytes[i], s->size[i], 0 };
        ZSTD_EndDirective how = i == last ? ZSTD_e_end : e->blocks ? ZSTD_e_flush : ZSTD_e_continue;
        size_t left = ZSTD_compressStream2(writer, &out, &in, how);
        check(!ZSTD_isError(left) && in.pos == in.size, "zstd");
    }
    return out.pos;
}

static void report(const char *array, const char *coding, uint64_t bytes, double speed)
{
    printf("| %s | %s | %.3f |", array, coding, (double)bytes / (double)tree.mesh.face_count);
    if (speed > 0)
        printf(" %.0f", speed / 1e6);
    printf(" |\n");
}

/* Adds bytes k of values[0], values[stride], ... for k = 0 .. 3, as four streams at *at. */
static void add_planes(streams *s, uint8_t **at, const uint32_t *values, size_t count,
                       size_t stride)
{
    for (int k = 0; k < 4; k++) {
        s->bytes[s->count] = *at;
        s->size[s->count++] = count;
        for (size_t i = 0; i < count; i++)
            *(*at)++ = (uint8_t)(values[i * stride] >> 8 * k);
    }
}

static size_t planes(const uint32_t *values, size_t count, int columns, const effort *e)
{
    uint8_t *at = space;
    streams s = { .count = 0 };
    for (int c = 0; c < columns; c++)
        add_planes(&s, &at, values + c, count / (size_t)columns, (size_t)columns);
    return frame(&s, e);
}

static size_t bit_planes(const uint32_t *values, size_t count)
{
    size_t bytes = (count + 7) / 8;
    streams s = { .count = 32 };
    memset(space, 0, 32 * bytes);
    for (int k = 0; k < 32; k++) {
        s.bytes[k] = space + bytes * (size_t)k;
        s.size[k] = bytes;
        for (size_t i = 0; i < count; i++)
            space[bytes * (size_t)k + i / 8] |= (uint8_t)((values[i] >> k & 1) << i % 8);
    }
    return frame(&s, &today);
}

/* Writes the number of bits and the two bits after the first one into a byte for each value, and
 * packs the other bits. */
static size_t bit_counts(const uint32_t *values, size_t count)
{
    size_t bits = 0;
    uint8_t *packed = space + count;
    memset(packed, 0, 4 * count);
    for (size_t i = 0; i < count; i++) {
        uint64_t value = (uint64_t)values[i] + 4;
        int length = 2;
        while (value >> (length + 1))
            length++;
        space[i] = (uint8_t)(length << 2 | (value >> (length - 2) & 3));
        for (int k = 0; k < length - 2; k++, bits++)
            packed[bits / 8] |= (uint8_t)((value >> k & 1) << bits % 8);
    }
    streams s = { { space, packed }, { count, (bits + 7) / 8 }, 2 };
    return frame(&s, &today);
}

/* Compresses columns of codes by zstd: with the current coding, with separate columns, and with a
 * dictionary. */
static void standard(const char *array, const uint32_t *codes, uint64_t rows, int columns,
                     uint32_t chunk)
{
    uint64_t sum[4] = { 0 };
    size_t sizes[1024], samples = 0, used = 0;
    static uint8_t sample[64 << 20], dictionary[DICTIONARY];
    for (uint64_t r = 0; r < rows; r += chunk) {
        size_t n = (size_t)(rows - r < chunk ? rows - r : chunk) * (size_t)columns;
        const uint32_t *part = codes + r * (uint64_t)columns;
        sum[0] += planes(part, n, 1, &one_block);
        sum[1] += planes(part, n, 1, &today);
        if (samples < 1024 && used + 4 * n <= sizeof sample) {
            memcpy(sample + used, space, 4 * n);
            used += sizes[samples++] = 4 * n;
        }
        sum[2] += planes(part, n, columns, &today);
    }
    report(array, "one block, level 3", sum[0], 0);
    report(array, "**today**: a block for each plane of bytes", sum[1], 0);
    if (columns > 1)
        report(array, "columns separate", sum[2], 0);
    size_t trained =
        ZDICT_trainFromBuffer(dictionary, DICTIONARY, sample, sizes, (unsigned)samples);
    effort with = { 7, 6, true, dictionary, trained };
    if (ZDICT_isError(trained))
        return;
    for (uint64_t r = 0; r < rows; r += chunk) {
        uint64_t n = (rows - r < chunk ? rows - r : chunk) * (uint64_t)columns;
        sum[3] += planes(codes + r * (uint64_t)columns, n, 1, &with);
    }
    report(array, "with a dictionary", sum[3] + trained, 0);
}

static uint32_t ordered(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return ebpo_float_order32(bits);
}

/* ---- vertices, from which a vertex is predicted ---- */

/* For each vertex, in the first face with it: the two other vertices of that face, and the corner
 * across these in an earlier face; ~0: there is none, or it is in an earlier chunk. */
typedef struct origin {
    uint32_t a, b, across;
} origin;

typedef struct sides {
    uint64_t *key, mask;
    uint32_t *third;
} sides;

static uint64_t slot(const sides *s, uint64_t key)
{
    uint64_t i = key * UINT64_C(0x9e3779b97f4a7c15) >> 20 & s->mask;
    while (s->key[i] != UINT64_MAX && s->key[i] != key)
        i = (i + 1) & s->mask;
    return i;
}

static void note_origin(const sides *s, const uint32_t *f, int k, origin *o)
{
    uint32_t v = f[k], first = v / vertices_rows * vertices_rows;
    uint32_t a = f[(k + 1) % 3], b = f[(k + 2) % 3];
    uint64_t at = slot(s, b | (uint64_t)a << 32);
    bool known = a < v && b < v && s->key[at] != UINT64_MAX;
    o->across = known && s->third[at] >= first ? s->third[at] : UINT32_MAX;
    o->a = a < v && a >= first ? a : UINT32_MAX;
    o->b = b < v && b >= first ? b : UINT32_MAX;
}

static origin *find_origins(void)
{
    uint64_t size = 1, seen = 0;
    while (size < 6 * tree.mesh.face_count)
        size *= 2;
    sides s = { malloc(size * 8), size - 1, malloc(size * 4) };
    origin *origins = malloc(tree.mesh.vertex_count * sizeof *origins);
    check(s.key && s.third && origins, "no memory");
    memset(s.key, 0xff, size * 8);
    memset(origins, 0xff, tree.mesh.vertex_count * sizeof *origins);
    for (uint64_t i = 0; i < tree.mesh.face_count; i++) {
        const uint32_t *f = tree.mesh.faces + 3 * i;
        for (int k = 0; k < 3; k++)
            if (f[k] == seen)
                note_origin(&s, f, k, &origins[seen++]);
        for (int k = 0; k < 3; k++) {
            uint64_t key = f[k] | (uint64_t)f[(k + 1) % 3] << 32, at = slot(&s, key);
            s.key[at] = key;
            s.third[at] = f[(k + 2) % 3];
        }
    }
    free(s.key);
    free(s.third);
    return origins;
}

static uint32_t predicted(const origin *o, uint64_t v, int c)
{
    const float *xyz = tree.mesh.xyz32 + c;
    bool a = o->a != UINT32_MAX, b = o->b != UINT32_MAX;
    if (a && b && o->across != UINT32_MAX)
        return ordered(xyz[3 * (uint64_t)o->a] + xyz[3 * (uint64_t)o->b] -
                       xyz[3 * (uint64_t)o->across]);
    if (a && b)
        return ordered((xyz[3 * (uint64_t)o->a] + xyz[3 * (uint64_t)o->b]) / 2);
    if (a || b)
        return ordered(xyz[3 * (uint64_t)(a ? o->a : o->b)]);
    return v % vertices_rows ? ordered(xyz[3 * (v - 1)]) : 0;
}

static void vertices(const origin *origins)
{
    uint64_t rows = tree.mesh.vertex_count, bits = 0, counts = 0, near = 0;
    uint32_t *codes = calloc(rows, 12), *across = calloc(rows, 12);
    check(codes && across, "no memory");
    for (uint64_t i = 0; i < 3 * rows; i++) {
        uint32_t value = ordered(tree.mesh.xyz32[i]);
        uint32_t before = i / 3 % vertices_rows ? ordered(tree.mesh.xyz32[i - 3]) : 0;
        codes[i] = ebpo_zigzag32(value - before);
        across[i] = ebpo_zigzag32(value - predicted(&origins[i / 3], i / 3, (int)(i % 3)));
    }
    standard("vertices", codes, rows, 3, vertices_rows);
    for (uint64_t r = 0; r < rows; r += vertices_rows) {
        uint64_t n = 3 * (rows - r < vertices_rows ? rows - r : vertices_rows);
        bits += bit_planes(codes + 3 * r, n);
        counts += bit_counts(codes + 3 * r, n);
        near += planes(across + 3 * r, n, 1, &today);
    }
    report("vertices", "planes of bits", bits, 0);
    report("vertices", "counts of bits, bits packed", counts, 0);
    report("vertices", "across an edge (parallelogram)", near, 0);
    free(codes);
    free(across);
}

/* ---- faces ---- */

enum { GATES_BYTES = 4096 * EBPO_GATES_COLS };

/* Returns the seconds to decode a chunk from `stored`. */
static double gates_back(size_t bytes, uint32_t rows, uint64_t seen, const uint32_t *expected)
{
    static uint32_t back[3 * 4096];
    static uint8_t codes[sizeof back];
    double best = 1e9;
    for (int turn = 0; turn < TURNS; turn++) {
        uint64_t then = seen;
        double begin = now();
        size_t size = ZSTD_decompressDCtx(reader, space, sizeof space, stored, bytes);
        check(!ZSTD_isError(size), "zstd");
        bool fine =
            ebpo_gates_decode(space, rows, codes) && ebpo_corners_decode(codes, rows, &then, back);
        double took = now() - begin;
        check(fine && memcmp(back, expected, 12 * (size_t)rows) == 0, "the decoded faces differ");
        best = took < best ? took : best;
    }
    return best;
}

static void faces_by_gates(const uint32_t *codes)
{
    static uint8_t raw[GATES_BYTES], file[GATES_BYTES];
    uint64_t seen = 0, sum = 0, rows = tree.mesh.face_count;
    double seconds = 0;
    for (uint64_t r = 0; r < rows; r += faces_rows) {
        uint32_t n = (uint32_t)(rows - r < faces_rows ? rows - r : faces_rows);
        size_t ends[EBPO_GATES_ENDS], begin = 0;
        for (uint32_t i = 0; i < 3 * n; i++)
            ebpo_store32(file + 4 * (size_t)i, codes[3 * r + i]);
        ebpo_gates_encode(file, n, raw, ends);
        streams all = { .count = EBPO_GATES_ENDS + 1 };
        for (int i = 0; i < all.count; i++) {
            size_t end = i < EBPO_GATES_ENDS ? ends[i] : EBPO_GATES_COLS * (size_t)n;
            all.bytes[i] = raw + begin;
            all.size[i] = end - begin;
            begin = end;
        }
        size_t bytes = frame(&all, &today);
        sum += bytes;
        seconds += gates_back(bytes, n, seen, tree.mesh.faces + 3 * r);
        for (uint32_t i = 0; i < 3 * n; i++)
            seen += codes[3 * r + i] == 0;
    }
    report("faces", "across edges (`gates`)", sum, 12.0 * (double)rows / seconds);
}

static void faces(void)
{
    uint64_t rows = tree.mesh.face_count, seen = 0;
    uint32_t *codes = calloc(rows, 12);
    check(codes, "no memory");
    for (uint64_t i = 0; i < 3 * rows; i++) {
        codes[i] = (uint32_t)(seen - tree.mesh.faces[i]);
        seen += codes[i] == 0;
    }
    standard("faces", codes, rows, 3, faces_rows);
    faces_by_gates(codes);
    free(codes);
}

/* ---- lists and maps ---- */

static size_t gaps_of(const ebpo_level *l, uint32_t *gaps, uint8_t *first)
{
    size_t at = 0;
    for (uint64_t i = 0; i < l->leaf_count; i++) {
        uint32_t count = l->leaf_ref_count[i];
        uint64_t before = l->leaf_first[i];
        bool ascending = count > 1 && l->leaf_refs[at] < l->leaf_refs[at + 1];
        for (uint32_t k = 0; k < count; k++) {
            uint32_t face = l->leaf_refs[at + (ascending ? count - 1 - k : k)];
            gaps[at + k] = (uint32_t)(before - 1 - face);
            first[at + k] = k == 0;
            before = face;
        }
        at += count;
    }
    return at;
}

static size_t first_apart(const uint32_t *gaps, const uint8_t *first, size_t count)
{
    static uint32_t part[2][16384];
    size_t n[2] = { 0, 0 };
    for (size_t i = 0; i < count; i++)
        part[first[i]][n[first[i]]++] = gaps[i];
    streams s = { .count = 0 };
    uint8_t *at = space;
    add_planes(&s, &at, part[1], n[1], 1);
    add_planes(&s, &at, part[0], n[0], 1);
    return frame(&s, &today);
}

static void lists(void)
{
    uint64_t sum[3] = { 0 };
    for (int i = 0; i < tree.info.level_count; i++) {
        const ebpo_level *l = &tree.level[i];
        uint32_t *gaps = malloc(l->ref_count * 4 + 1);
        uint8_t *first = malloc(l->ref_count + 1);
        check(gaps && first, "no memory");
        size_t count = gaps_of(l, gaps, first);
        for (size_t r = 0; r < count; r += list_rows) {
            size_t n = count - r < list_rows ? count - r : list_rows;
            sum[0] += planes(gaps + r, n, 1, &one_block);
            sum[1] += planes(gaps + r, n, 1, &today);
            sum[2] += first_apart(gaps + r, first + r, n);
        }
        free(gaps);
        free(first);
    }
    report("leaf_refs", "one block, level 3", sum[0], 0);
    report("leaf_refs", "**today**: a block for each plane of bytes", sum[1], 0);
    report("leaf_refs", "the first of each leaf separate", sum[2], 0);
}

static void map(const char *name, const uint32_t *numbers, uint64_t rows)
{
    uint32_t *codes = calloc(rows, 4);
    check(codes, "no memory");
    for (uint64_t i = 0; i < rows; i++)
        codes[i] = ebpo_zigzag32(numbers[i] - (i % list_rows ? numbers[i - 1] : 0));
    standard(name, codes, rows, 1, list_rows);
    free(codes);
}

/* Predicts a vertex from another corner of its first face. */
static void map_across(const origin *origins)
{
    uint64_t rows = tree.mesh.vertex_count, sum = 0;
    uint32_t *codes = calloc(rows, 4);
    check(codes, "no memory");
    for (uint64_t i = 0; i < rows; i++) {
        const origin *o = &origins[i];
        uint32_t from = o->a != UINT32_MAX ? o->a : o->b;
        uint32_t before = i % list_rows ? tree.vertex_source[i - 1] : 0;
        codes[i] = ebpo_zigzag32(tree.vertex_source[i] -
                                 (from != UINT32_MAX ? tree.vertex_source[from] : before));
    }
    for (uint64_t r = 0; r < rows; r += list_rows)
        sum += planes(codes + r, rows - r < list_rows ? rows - r : list_rows, 1, &today);
    report("vertex_source", "from a neighbour", sum, 0);
    free(codes);
}

static void read_tree(const char *path)
{
    ebpo_file *file = NULL;
    ebpo_error error;
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    bool fine = ebpo_open(path, &file, &error) == EBPO_OK &&
                ebpo_file_read_tree(file, &options, &tree, &error) == EBPO_OK;
    check(fine, fine ? "" : error.message);
    ebpo_close(file);
    check(tree.mesh.xyz32 && tree.vertex_source && tree.face_source, "needs floats and maps");
}

int main(int count, char **arguments)
{
    check(count == 2, "usage: bench_codings FILE.ebpo.h5");
    read_tree(arguments[1]);
    bool small = tree.info.subtree_level > 0; /* chunks of few rows: section 2 of the format */
    faces_rows = small ? 2048 : 4096;
    vertices_rows = small ? 1024 : 4096;
    list_rows = small ? 4096 : 16384;
    writer = ZSTD_createCCtx();
    reader = ZSTD_createDCtx();
    check(writer && reader, "no memory");
    printf("| array | coding | B/face | decoding, 10^6 B/s a core |\n|---|---|---|---|\n");
    origin *origins = find_origins();
    vertices(origins);
    faces();
    lists();
    map("vertex_source", tree.vertex_source, tree.mesh.vertex_count);
    map_across(origins);
    map("face_source", tree.face_source, tree.mesh.face_count);
    free(origins);
    ZSTD_freeCCtx(writer);
    ZSTD_freeDCtx(reader);
    ebpo_tree_free(&tree);
    return 0;
}
