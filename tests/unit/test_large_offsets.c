/* Tests bytes, rows and elements beyond 2^32, without the data: with sparse files, and with
 * mappings that take memory only for visited parts. */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <sys/vfs.h>
#include <unistd.h>

#include "read_by.h"
#include "core/workspace.h"
#include "check_main.h"
#include "hdf5_read/coding.h"
#include "format/chunk_directory.h"
#include "format/write_plan.h"
#include "format/reader.h"
#include "core/endian.h"
#include "core/checksum.h"
#include "mesh/import.h"
#include "io/file_source.h"
#include "mesh/ply.h"
#include "scratch.h"
#include "tree_json.h"

static const uint64_t FAR = UINT64_C(1) << 32;
static const char *path;

/* Maps zeros that take no memory until they are written to. Returns NULL when the system refuses to
 * overcommit, or addresses have 32 bits. */
static uint8_t *lend(uint64_t bytes)
{
    if (bytes > PTRDIFF_MAX)
        return NULL;
    void *at = mmap(NULL, bytes, PROT_READ | PROT_WRITE,
                    MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    return at == MAP_FAILED ? NULL : at;
}

/* --- PLY --- */

/* Writes a tetrahedron whose elements follow `bytes` of other data. */
static uint64_t far_tetrahedron(uint8_t *data, uint64_t bytes, const char *encoding)
{
    static const uint32_t faces[4][3] = { { 0, 2, 1 }, { 0, 1, 3 }, { 0, 3, 2 }, { 1, 2, 3 } };
    static const float xyz[4][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    uint8_t *at = data +
                  sprintf((char *)data,
                          "ply\nformat %s 1.0\nelement other %llu\nproperty uchar a\nelement "
                          "vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
                          "element face 4\nproperty list uchar uint vertex_indices\nend_header\n",
                          encoding, (unsigned long long)bytes) +
                  bytes;
    for (int i = 0; i < 12; i++, at += 4) {
        uint32_t bits;
        memcpy(&bits, &xyz[i / 3][i % 3], sizeof bits);
        ebpo_store32(at, bits);
    }
    for (int f = 0; f < 4; f++, at += 13) {
        at[0] = 3;
        for (int k = 0; k < 3; k++)
            ebpo_store32(at + 1 + 4 * k, faces[f][k]);
    }
    return (uint64_t)(at - data);
}

START_TEST(test_ply_elements_beyond_4_gib)
{
    uint64_t skipped = FAR + 12345;
    uint8_t *data = lend(skipped + 4096);
    if (!data)
        return;
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t size = far_tetrahedron(data, skipped, "binary_little_endian");
    ck_assert_msg(ebpo_ply_parse_memory(&mesh, data, size, "far.ply", NULL, 0, NULL, &error) ==
                      EBPO_OK,
                  "%s", error.message);
    ck_assert_uint_eq(mesh.vertex_count, 4);
    ck_assert_uint_eq(mesh.face_count, 4);
    ck_assert_uint_eq(mesh.source_size, size);
    ck_assert_float_eq(mesh.xyz32[11], 1);
    ck_assert_uint_eq(mesh.faces[11], 3);
    ebpo_mesh_free(&mesh);
    double *points;
    uint64_t count;
    ck_assert_msg(ebpo_points_parse_ply(data, size, "far.ply", &points, &count, &error) == EBPO_OK,
                  "%s", error.message);
    ck_assert_uint_eq(count, 4);
    ck_assert_double_eq(points[11], 1);
    free(points);
    /* When one byte is missing, or a corner is invalid, the message has the offset, which is above
     * 2^32. */
    ck_assert_int_eq(ebpo_ply_parse_memory(&mesh, data, size - 1, "far.ply", NULL, 0, NULL, &error),
                     EBPO_E_FORMAT);
    data[size - 1] = 1;
    ck_assert_int_eq(ebpo_ply_parse_memory(&mesh, data, size, "far.ply", NULL, 0, NULL, &error),
                     EBPO_E_FORMAT);
    char wanted[64];
    snprintf(wanted, sizeof wanted, "byte %llu:", (unsigned long long)size - 4);
    ck_assert_msg(strstr(error.message, wanted) != NULL, "%s lacks %s", error.message, wanted);
    munmap(data, (size_t)(skipped + 4096));
}
END_TEST

/* Reads a file with these counts in its header and the given size; 0: only the header and a few
 * bytes. */
static ebpo_status claims(const char *vertices, const char *faces, uint64_t size, ebpo_error *error)
{
    uint64_t space = size < 4096 ? 4096 : size;
    uint8_t *data = lend(space);
    ebpo_mesh mesh;
    if (!data)
        return EBPO_E_UNSUPPORTED;
    int header = sprintf((char *)data,
                         "ply\nformat binary_little_endian 1.0\nelement vertex %s\nproperty uchar "
                         "x\nproperty uchar y\nproperty uchar z\n"
                         "element face %s\nproperty list uchar uint vertex_indices\nend_header\n",
                         vertices, faces);
    ebpo_status status = ebpo_ply_parse_memory(&mesh, data, size ? size : (uint64_t)header + 40,
                                               "huge.ply", NULL, 0, NULL, error);
    ck_assert_ptr_null(mesh.faces);
    munmap(data, (size_t)(space));
    return status;
}

START_TEST(test_ply_counts_beyond_file_size)
{
    static const char *const counts[] = { "4294967294",          "4294967295",
                                          "4294967296",          "1099511627776",
                                          "9223372036854775808", "18446744073709551615" };
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        ebpo_error error = EBPO_ERROR_INIT;
        ck_assert_int_eq(claims(counts[i], "4", 0, &error), EBPO_E_FORMAT);
        ck_assert_msg(strstr(error.message, "cut short") != NULL, "%s", error.message);
        ck_assert_int_eq(claims("4", counts[i], 0, &error), EBPO_E_FORMAT);
        ck_assert_msg(strstr(error.message, counts[i]) != NULL, "%s", error.message);
    }
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(claims("18446744073709551616", "4", 0, &error), EBPO_E_FORMAT);
    ck_assert_msg(strstr(error.message, "not a count") != NULL, "%s", error.message);
}
END_TEST

START_TEST(test_ply_counts_beyond_limit_are_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = claims("4294967295", "4", 3 * FAR + 4096, &error);
    if (status == EBPO_E_UNSUPPORTED)
        return;
    ck_assert_int_eq(status, EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "2^32 - 2") != NULL &&
                      strstr(error.message, "split") != NULL,
                  "%s", error.message);
    ck_assert_int_eq(claims("4", "4294967295", 2 * FAR, &error), EBPO_E_LIMIT);
    ck_assert_int_eq(claims("4", "4294967296", 2 * FAR, &error), EBPO_E_LIMIT);
}
END_TEST

/* In 32 bits, three times this face count would be 2. */
START_TEST(test_stl_corners_beyond_limit_are_refused)
{
    const uint32_t faces = 1431655766;
    const uint64_t size = 84 + 50 * (uint64_t)faces;
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    uint8_t *data = lend(size);
    if (!data)
        return;
    ebpo_store32(data + 80, faces);
    const ebpo_import_job job = { .data = data, .size = size, .name = "a.stl", .attributes = true };
    ck_assert_int_eq(ebpo_import_memory(&mesh, &ebpo_import_stl, &job, &error), EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "split") != NULL, "%s", error.message);
    munmap(data, (size_t)size);
}
END_TEST

START_TEST(test_whole_files_beyond_4_gib)
{
    char end[3];
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    int fd = open(path, O_CREAT | O_RDWR | O_TRUNC, 0600);
    /* otherwise the file system does not support such files */
    if (pwrite(fd, "end", 3, (off_t)(FAR + 77)) == 3) {
        ck_assert_msg(ebpo_whole_file_open(&file, path, &error) == EBPO_OK, "%s", error.message);
        ck_assert_uint_eq(file.size, FAR + 80);
        ck_assert_int_eq(ebpo_whole_file_read(&file, FAR + 77, end, 3, path, &error), EBPO_OK);
        ck_assert_mem_eq(end, "end", 3);
        ck_assert_int_eq(ebpo_whole_file_unchanged(&file, path, &error), EBPO_OK);
        ebpo_whole_file_close(&file);
    }
    close(fd);
    unlink(path);
}
END_TEST

START_TEST(test_files_beyond_array_limit_are_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    file.size = (uint64_t)PTRDIFF_MAX + 1;
    ck_assert_int_eq(ebpo_whole_file_load(&file, NULL, 1, NULL, "long.ply", &error), EBPO_E_LIMIT);
    ck_assert_ptr_nonnull(strstr(error.message, "long.ply: the file has "));
    ck_assert_ptr_nonnull(strstr(error.message, "use a 64-bit program"));
    ck_assert_ptr_null(file.buffer);
}
END_TEST

/* --- containers --- */

/* With 32-bit arithmetic, 8 * count would be a small number of bytes. */
START_TEST(test_lists_beyond_array_limit_are_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const uint64_t counts[] = { UINT64_C(1) << 61, (uint64_t)PTRDIFF_MAX / 8 + 1 };
    for (size_t i = 0; i < 2; i++) {
        uint64_t *values = NULL;
        uint8_t *stored = NULL, none = 0;
        size_t bytes = 0;
        const char *why = "";
        ck_assert_int_eq(ebpo_long_chunk_decode(&none, 1, EBPO_PIPELINE_CHECKSUM, counts[i],
                                                &values, &why, &error),
                         EBPO_E_MEMORY);
        ck_assert_ptr_null(values);
        ck_assert_int_eq(ebpo_long_chunk_encode(NULL, counts[i], EBPO_PIPELINE_CHECKSUM, 0, &stored,
                                                &bytes, &error),
                         EBPO_E_MEMORY);
        ck_assert_ptr_null(stored);
    }
}
END_TEST

/* A container whose arrays follow 8 GiB of zeros. Its metadata is unchanged, except that offsets
 * are greater by 8 GiB. */
typedef struct shifted {
    uint8_t *bytes;
    uint64_t size, from, by; /* bytes from `from` on are shifted by `by` */
    uint64_t beyond, hinted; /* reads, and ranges of prefetch hints, beyond 2^32 */
} shifted;

static void expect_shifted(void *user, const ebpo_range *ranges, size_t count)
{
    shifted *s = user;
    for (size_t i = 0; i < count; i++) {
        ck_assert_uint_le(ranges[i].offset + ranges[i].size, s->by + s->size);
        s->hinted += ranges[i].offset > FAR;
    }
}

static ebpo_status read_shifted(void *user, uint64_t offset, uint64_t size, void *data,
                                ebpo_error *error)
{
    shifted *s = user;
    (void)error;
    memset(data, 0, size);
    s->beyond += offset > FAR;
    for (uint64_t i = 0; i < size; i++) {
        uint64_t at = offset + i, behind = at - s->by;
        if (at < s->from)
            ((uint8_t *)data)[i] = s->bytes[at];
        else if (at >= s->from + s->by && behind < s->size)
            ((uint8_t *)data)[i] = s->bytes[behind];
    }
    return EBPO_OK;
}

/* Computes the checksum of metadata, which is stored after the metadata. */
static void sum_again(uint8_t *at, uint64_t bytes)
{
    ebpo_store32(at + bytes, ebpo_lookup3(at, bytes));
}

/* Updates the checksum of a continuation block of an object header. A message of the header has the
 * offset and length of the block. */
static void sum_piece_again(shifted *s, uint64_t place)
{
    for (uint64_t i = 48; i + 16 < s->from; i++) {
        uint64_t bytes = ebpo_load64(s->bytes + i + 8);
        if (ebpo_load64(s->bytes + i) == place && bytes > 4 && bytes <= s->from - place) {
            sum_again(s->bytes + place, bytes - 4);
            return;
        }
    }
    ck_abort_msg("no message refers to the block at %llu", (unsigned long long)place);
}

/* Updates the checksums of superblock and object headers, as in the HDF5 file format specification.
 */
static void sum_metadata_again(shifted *s)
{
    uint8_t *b = s->bytes;
    sum_again(b, 44);
    for (uint64_t i = 48; i + 28 < s->from; i++) {
        if (memcmp(b + i, "OCHK", 4) == 0)
            sum_piece_again(s, i);
        if (memcmp(b + i, "OHDR\2", 5) != 0)
            continue;
        unsigned flags = b[i + 5], wide = 1u << (flags & 3);
        uint64_t size = 0, head = 6 + (flags & 0x20 ? 16 : 0) + (flags & 0x10 ? 4 : 0);
        for (unsigned k = 0; k < wide; k++)
            size |= (uint64_t)b[i + head + k] << 8 * k;
        sum_again(b + i, head + wide + size);
    }
}

static void move_address(shifted *s, uint64_t address)
{
    int found = 0;
    for (uint64_t i = 48; i + 8 <= s->from; i++)
        if (ebpo_load64(s->bytes + i) == address) {
            ebpo_store64(s->bytes + i, address + s->by);
            found++;
        }
    ck_assert_int_eq(found, 1);
}

/* Increases all chunk offsets by `by`; the file was opened from the original bytes. */
static void shift(shifted *s, const ebpo_file *file)
{
    uint64_t places[256];
    unsigned count = 0;
    s->from = s->size;
    for (int level = 0; level < file->info.level_count; level++)
        for (int id = 0; id < EBPO_ARRAYS; id++) {
            const ebpo_array_in *a =
                id < EBPO_LEVEL_ARRAYS ? &file->level_array[level][id] : &file->root_array[id];
            if (!a->present || (level && id >= EBPO_LEVEL_ARRAYS))
                continue;
            for (uint64_t i = 0; i < ebpo_shape_chunks(&a->shape); i++) {
                ck_assert_uint_lt(count, 256);
                places[count++] = a->chunks[i].address;
                s->from = s->from < a->chunks[i].address ? s->from : a->chunks[i].address;
            }
        }
    for (unsigned i = 0; i < count; i++)
        move_address(s, places[i]);
    ebpo_store64(s->bytes + 28, s->size + s->by);
    sum_metadata_again(s);
}

static shifted vector_of(const char *name)
{
    char file[512];
    shifted s = { .by = 2 * FAR };
    const char *vectors = getenv("EBPO_VECTORS");
    ck_assert_msg(vectors != NULL, "EBPO_VECTORS does not name the folder of format-spec/vectors");
    snprintf(file, sizeof file, "%s/passed/%s.ebpo.h5", vectors, name);
    FILE *f = fopen(file, "rb");
    ck_assert_msg(f != NULL, "%s", file);
    fseek(f, 0, SEEK_END);
    s.size = (uint64_t)ftell(f);
    rewind(f);
    s.bytes = malloc(s.size);
    ck_assert_uint_eq(fread(s.bytes, 1, s.size, f), s.size);
    fclose(f);
    return s;
}

static uint8_t *copy_of(const shifted *s)
{
    uint8_t *copy = malloc(s->size);
    memcpy(copy, s->bytes, s->size);
    return copy;
}

static char *text_of(ebpo_file *file)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    char *text = NULL;
    size_t length = 0;
    FILE *out = open_memstream(&text, &length);
    ck_assert_msg(ebpo_file_read_tree(file, READ_BY(2), &tree, &error) == EBPO_OK, "%s",
                  error.message);
    tree_json(out, &tree);
    fclose(out);
    ebpo_tree_free(&tree);
    return text;
}

START_TEST(test_container_in_memory_beyond_8_gib)
{
    static const char *const names[] = { "01_one_leaf_unfiltered", "06_four_levels_leaf_planes" };
    for (size_t i = 0; i < 2 * sizeof names / sizeof *names;
         /* repeats everything as a remote file, whose chunk offsets are read later, with prefetch
          * hints */
         i++) {
        bool away = i >= sizeof names / sizeof *names;
        shifted s = vector_of(names[i % (sizeof names / sizeof *names)]);
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_file *near, *far;
        ebpo_source source = { .struct_size = sizeof(ebpo_source),
                               .user = &s,
                               .size = s.by + s.size,
                               .read = read_shifted,
                               .prefetch = away ? expect_shifted : NULL };
        uint8_t *as_read = copy_of(&s);
        ck_assert_msg(ebpo_open_memory(as_read, s.size, "near", &near, &error) == EBPO_OK, "%s",
                      error.message);
        shift(&s, near);
        ck_assert_msg(ebpo_open_source(&source, "far", &far, &error) == EBPO_OK, "%s",
                      error.message);
        ck_assert_uint_gt(far->level_array[0][EBPO_A_TYPES].chunks[0].address, 2 * FAR);
        char *here = text_of(near), *there = text_of(far);
        ck_assert_str_eq(here, there);
        ck_assert_uint_gt(s.beyond, 0);
        ck_assert(!away || s.hinted > 0);
        ck_assert_msg(ebpo_file_check_content(far, READ_BY(1), &error) == EBPO_OK, "%s",
                      error.message);
        free(here);
        free(there);
        ebpo_close(near);
        ebpo_close(far);
        free(as_read);
        free(s.bytes);
    }
}
END_TEST

START_TEST(test_container_on_disk_beyond_8_gib)
{
    shifted s = vector_of("06_four_levels_leaf_planes");
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *near, *far;
    int fd = open(path, O_CREAT | O_RDWR | O_TRUNC, 0600);
    uint8_t *as_read = copy_of(&s);
    ck_assert_msg(ebpo_open_memory(as_read, s.size, "near", &near, &error) == EBPO_OK, "%s",
                  error.message);
    shift(&s, near);
    ssize_t behind = (ssize_t)(s.size - s.from);
    if (pwrite(fd, s.bytes, s.from, 0) == (ssize_t)s.from &&
        pwrite(fd, s.bytes + s.from, (size_t)behind, (off_t)(s.from + s.by)) == behind) {
        ck_assert_msg(ebpo_open(path, &far, &error) == EBPO_OK, "%s", error.message);
        ck_assert_uint_eq(ebpo_file_info(far)->file_bytes, s.by + s.size);
        char *here = text_of(near), *there = text_of(far);
        ck_assert_str_eq(here, there);
        free(here);
        free(there);
        ebpo_close(far);
    }
    ebpo_close(near);
    close(fd);
    unlink(path);
    free(as_read);
    free(s.bytes);
}
END_TEST

START_TEST(test_container_uses_8_byte_addresses)
{
    shifted s = vector_of("03_one_leaf");
    ck_assert_mem_eq(s.bytes + 1, "HDF", 3);
    ck_assert_uint_eq(s.bytes[9], 8);  /* superblock version 2 and 3: size of offsets */
    ck_assert_uint_eq(s.bytes[10], 8); /* size of lengths */
    free(s.bytes);
}
END_TEST

/* The writer encodes a leaf whose references begin at row 2^32 + 65536. The preceding row of the
 * index states this row. */
START_TEST(test_references_beyond_32_bits)
{
    enum { ROWS = 16384, LEAVES = EBPO_INDEX_ROWS + 1 };
    uint64_t before = FAR + 65536, *first = calloc(LEAVES, sizeof *first);
    uint32_t *news = calloc(LEAVES, sizeof *news), *counts = calloc(LEAVES, sizeof *counts);
    uint32_t *refs = (uint32_t *)(void *)lend((before + ROWS) * sizeof *refs);
    if (!refs)
        return;
    counts[0] = UINT32_MAX - 65535;
    counts[1] = 131072;
    counts[LEAVES - 1] = ROWS;
    first[LEAVES - 1] = 4000000000;
    for (uint32_t i = 0; i < ROWS; i++)
        refs[before + i] = 3 * i;
    ebpo_tree *tree = calloc(1, sizeof *tree);
    ebpo_plan plan = { .tree = tree };
    tree->level[5] = (ebpo_level){ .leaf_count = LEAVES,
                                   .leaf_first = first,
                                   .leaf_new = news,
                                   .leaf_ref_count = counts,
                                   .leaf_refs = refs,
                                   .ref_count = before + ROWS };
    plan.index[5][EBPO_INDEX_LEAVES] = ebpo_index_leaves(&tree->level[5]);
    ebpo_array_out array = { .id = EBPO_A_LEAF_REFS,
                             .level = 5,
                             .shape = {
                                 .rows = before + ROWS, .chunk_rows = ROWS, .element_size = 4 } };
    uint32_t *rows = malloc(4 * ROWS);
    ebpo_plan_encode(&plan, &array, before, ROWS, (uint8_t *)rows);
    for (uint32_t i = 0; i < ROWS; i++)
        rows[i] = ebpo_load32(rows + i); /* files are little-endian */
    ck_assert(ebpo_refs_decode(rows, ROWS, first[LEAVES - 1]));
    for (uint32_t i = 0; i < ROWS; i++)
        ck_assert_uint_eq(rows[i], 3 * i);
    /* in the first leaf, of zeros: 0 - 1 - 0 */
    ebpo_plan_encode(&plan, &array, FAR / 2, ROWS, (uint8_t *)rows);
    ck_assert_uint_eq(rows[0], UINT32_MAX);
    ck_assert_uint_eq(rows[ROWS - 1], UINT32_MAX);
    free(rows);
    free(plan.index[5][EBPO_INDEX_LEAVES]);
    free(tree);
    free(first);
    free(news);
    free(counts);
    munmap(refs, (size_t)((before + ROWS) * sizeof *refs));
}
END_TEST

/* --- workspace --- */

/* Checks an array of more than 2^32 bytes. Returns false when addresses have 32 bits, so that there
 * is no such array. */
static bool haptic_ends(ebpo_workspace *w)
{
    uint64_t count = FAR / 8 + 1000;
    uint64_t *array = ebpo_array_alloc(w, count, sizeof *array);
    if (FAR > PTRDIFF_MAX) {
        ck_assert_ptr_null(array);
        return false;
    }
    ck_assert_ptr_nonnull(array);
    array[0] = 7;
    array[count - 1] = 11;
    array[FAR / 8] = 13; /* its bytes begin at 2^32 */
    ck_assert_uint_eq(array[0], 7);
    ck_assert_uint_eq(array[count - 1], 11);
    ebpo_release_pages(w);
    ck_assert_uint_eq(array[FAR / 8], 13);
    ebpo_array_free(w, array);
    return true;
}

START_TEST(test_workspace_memory_beyond_4_gib)
{
    ebpo_workspace *w;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    ck_assert_msg(ebpo_workspace_make_any(&w, 64 * FAR, scratch(NULL), &error) == EBPO_OK, "%s",
                  error.message);
    bool had = haptic_ends(w);
    ebpo_workspace_get_stats(w, &f);
    ck_assert(!had || f.held_peak > FAR);
    ck_assert_uint_eq(f.filed_peak, 0);
    ebpo_workspace_free(w);
}
END_TEST

/* Allocates the blocks of a file at once, which is fast when the file system supports it. */
static bool disk_lends(const char *where)
{
    enum { EXT = 0xef53, XFS = 0x58465342 };
    static const long BTRFS = 0x9123683e;
    struct statfs kind;
    struct statvfs space;
    return statfs(where, &kind) == 0 && statvfs(where, &space) == 0 &&
           (kind.f_type == EXT || kind.f_type == XFS || kind.f_type == BTRFS) &&
           (uint64_t)space.f_bavail * space.f_frsize > 4 * FAR;
}

START_TEST(test_workspace_files_beyond_4_gib)
{
    ebpo_workspace *w;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    if (!disk_lends(scratch(NULL)))
        return;
    ck_assert_msg(ebpo_workspace_make_any(&w, 1 << 20, scratch(NULL), &error) == EBPO_OK, "%s",
                  error.message);
    bool had = haptic_ends(w);
    ebpo_workspace_get_stats(w, &f);
    ck_assert(!had || f.filed_peak > FAR);
    ebpo_workspace_free(w);
}
END_TEST

START_TEST(test_workspace_size_overflow_is_refused)
{
    ebpo_workspace *w;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_workspace_make_any(&w, 1 << 20, scratch(NULL), &error), EBPO_OK);
    /* 2^64 + 2^21 bytes */
    ck_assert_ptr_null(ebpo_array_alloc(w, (UINT64_C(1) << 61) + (1 << 18), 8));
    ck_assert_ptr_null(ebpo_array_zero(w, (UINT64_C(1) << 60) + (1 << 17), 16));
    ck_assert_int_eq(ebpo_workspace_fail(w, UINT64_MAX, &error), EBPO_E_MEMORY);
    ebpo_workspace_free(w);
}
END_TEST

static void enter(void)
{
    scratch_enter();
    path = scratch("far");
}

TEST_SUITE(large_offsets)
{
    Suite *suite = suite_create("large offsets");
    TCase *tests = tcase_create("large offsets");
    tcase_set_timeout(tests, 120);
    tcase_add_checked_fixture(tests, enter, scratch_leave);
    tcase_add_test(tests, test_ply_elements_beyond_4_gib);
    tcase_add_test(tests, test_ply_counts_beyond_file_size);
    tcase_add_test(tests, test_ply_counts_beyond_limit_are_refused);
    tcase_add_test(tests, test_stl_corners_beyond_limit_are_refused);
    tcase_add_test(tests, test_whole_files_beyond_4_gib);
    tcase_add_test(tests, test_files_beyond_array_limit_are_refused);
    tcase_add_test(tests, test_lists_beyond_array_limit_are_refused);
    tcase_add_test(tests, test_container_in_memory_beyond_8_gib);
    tcase_add_test(tests, test_container_on_disk_beyond_8_gib);
    tcase_add_test(tests, test_container_uses_8_byte_addresses);
    tcase_add_test(tests, test_references_beyond_32_bits);
    tcase_add_test(tests, test_workspace_memory_beyond_4_gib);
    tcase_add_test(tests, test_workspace_files_beyond_4_gib);
    tcase_add_test(tests, test_workspace_size_overflow_is_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
