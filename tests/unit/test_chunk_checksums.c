/* Tests the list of chunk checksums: it matches the file, and only the correct chunks are
 * accepted. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>
#include <ebpo/subtree.h>

#include "core/endian.h"
#include "changed_array.h"
#include "check_main.h"
#include "format/chunk_directory.h"
#include "format/reader.h"
#include "model_file.h"
#include "scratch.h"
#include "solids.h"

typedef struct bytes {
    uint8_t *at;
    size_t size;
} bytes;

static bytes slurp(const char *path)
{
    FILE *f = fopen(path, "rb");
    bytes b = { NULL, 0 };
    ck_assert(f && fseek(f, 0, SEEK_END) == 0);
    b.size = (size_t)ftell(f);
    rewind(f);
    b.at = malloc(b.size);
    ck_assert(b.at && fread(b.at, 1, b.size, f) == b.size && fclose(f) == 0);
    return b;
}

/* Writes a mesh. `max_level`: as in ebpo_build_options. */
static bytes write_mesh(const char *name, ebpo_mesh mesh, int max_level, ebpo_codec codec,
                        uint64_t subtree_faces, ebpo_chunk_checksums checksums)
{
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    build.leaf_faces = 4;
    build.parts = ~0u;
    build.max_level = max_level;
    write.codec = codec;
    write.subtree_faces = subtree_faces;
    write.chunk_checksums = checksums;
    ebpo_tree tree = model_build(mesh, &build);
    model_write(&tree, scratch(name), &write);
    return slurp(scratch(name));
}

/* Writes a torus. All tori have the same topology, so that uncompressed files have chunks of the
 * same sizes. `wide`: size of the torus. */
static bytes write_torus(const char *name, double wide, ebpo_codec codec, uint64_t subtree_faces,
                         ebpo_chunk_checksums checksums)
{
    return write_mesh(name, ebpo_test_torus(wide, 0.25, 60, 40), -1, codec, subtree_faces,
                      checksums);
}

/* Writes a torus with several blocks of subtrees, and with pages of checksums. */
static bytes write_paged(const char *name, double wide)
{
    return write_mesh(name, ebpo_test_torus(wide, 0.03125, 160, 16), 5, EBPO_CODEC_NONE, 10,
                      EBPO_CHECKSUMS_DEFAULT);
}

static ebpo_file *open_bytes(const bytes *b)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    ck_assert_msg(ebpo_open_memory(b->at, b->size, "x", &file, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_int_eq(ebpo_file_locate(file, NULL, NULL), EBPO_OK);
    return file;
}

/* Returns array n of the file, present or not; NULL after the last one. */
static const ebpo_array_in *array_of(const ebpo_file *file, int n)
{
    int levels = EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS;
    return n < levels ? &file->level_array[n / EBPO_LEVEL_ARRAYS][n % EBPO_LEVEL_ARRAYS]
           : n < levels + EBPO_ARRAYS - EBPO_LEVEL_ARRAYS
               ? &file->root_array[EBPO_LEVEL_ARRAYS + n - levels]
               : NULL;
}

static uint64_t chunks_of(const ebpo_array_in *a)
{
    return a->present && !ebpo_schema_is_list(a->id) ? ebpo_shape_chunks(&a->shape) : 0;
}

static const struct {
    ebpo_codec codec;
    uint64_t subtree_faces;
} kinds[] = { { EBPO_CODEC_ZSTD, EBPO_NO_SUBTREES },    { EBPO_CODEC_ZSTD, 8 },
              { EBPO_CODEC_DEFLATE, EBPO_NO_SUBTREES }, { EBPO_CODEC_DEFLATE, 8 },
              { EBPO_CODEC_NONE, EBPO_NO_SUBTREES },    { EBPO_CODEC_NONE, 8 } };
enum { KINDS = sizeof kinds / sizeof *kinds };

START_TEST(test_chunk_checksums_list_every_chunk)
{
    bytes b = write_torus("a.ebpo.h5", 1, kinds[_i].codec, kinds[_i].subtree_faces,
                          EBPO_CHECKSUMS_DEFAULT);
    ebpo_file *file = open_bytes(&b);
    const ebpo_array_in *list = &file->root_array[EBPO_A_CHUNK_CHECKSUMS], *a;
    uint64_t *rows, row = 0;
    ck_assert(list->present && file->has_checksums);
    ck_assert_int_eq(ebpo_long_chunk_read(file, list, &rows, NULL), EBPO_OK);
    for (int n = 0; (a = array_of(file, n)); n++)
        for (uint64_t k = 0; k < chunks_of(a); k++, row++) {
            ck_assert_uint_lt(row, list->shape.rows);
            ck_assert_uint_eq((uint32_t)rows[row],
                              ebpo_load32(b.at + a->chunks[k].address + a->chunks[k].bytes - 4));
        }
    ck_assert_uint_eq(row, list->shape.rows);
    free(rows);
    ebpo_close(file);
    free(b.at);
}
END_TEST

static ebpo_status pass(void *context, const ebpo_array_in *array, uint64_t chunk, uint64_t row,
                        uint64_t rows, const uint8_t *data, ebpo_error *error)
{
    (void)context, (void)array, (void)chunk, (void)row, (void)rows, (void)data, (void)error;
    return EBPO_OK;
}

/* Returns true when reading array n of these bytes reports that chunk `chunk` is wrong. */
static bool is_detected(const bytes *b, int n, uint64_t chunk)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    char expected[80];
    options.threads = 1;
    snprintf(expected, sizeof expected, "chunk %llu is damaged: its checksum is not the one",
             (unsigned long long)chunk);
    ebpo_file *file = open_bytes(b);
    ebpo_status status = ebpo_reader_rows(file, array_of(file, n), &options, pass, NULL, &error);
    ebpo_close(file);
    return status == EBPO_E_FORMAT && strstr(error.message, expected);
}

/* Copies each chunk of one file to the other file. The chunks have the same length and valid
 * checksums. */
START_TEST(test_chunks_of_other_version_are_refused)
{
    uint64_t subtrees = _i ? 8 : EBPO_NO_SUBTREES, found = 0, paged = 0;
    bytes b = _i == 2
                  ? write_paged("a.ebpo.h5", 1)
                  : write_torus("a.ebpo.h5", 1, EBPO_CODEC_NONE, subtrees, EBPO_CHECKSUMS_DEFAULT),
          other = _i == 2 ? write_paged("b.ebpo.h5", 1.0625)
                          : write_torus("b.ebpo.h5", 1.0625, EBPO_CODEC_NONE, subtrees,
                                        EBPO_CHECKSUMS_DEFAULT);
    ebpo_file *file = open_bytes(&b), *from = open_bytes(&other);
    const ebpo_array_in *a;
    uint8_t kept[1 << 17];
    for (int n = 0; (a = array_of(file, n)); n++) {
        const ebpo_array_in *theirs = array_of(from, n);
        for (uint64_t k = 0; k < chunks_of(a) && k < chunks_of(theirs); k++) {
            uint8_t *at = b.at + a->chunks[k].address;
            uint32_t size = a->chunks[k].bytes;
            if (size != theirs->chunks[k].bytes ||
                memcmp(at, other.at + theirs->chunks[k].address, size) == 0)
                continue;
            memcpy(kept, at, size);
            memcpy(at, other.at + theirs->chunks[k].address, size);
            ck_assert_msg(is_detected(&b, n, k), "%s, chunk %d", a->path, (int)k);
            memcpy(at, kept, size);
            found++;
            paged += ebpo_has_paged_checksums(file, a);
        }
    }
    ck_assert_uint_gt(found, 10);
    ck_assert_int_eq(paged > 1, _i == 2);
    ebpo_close(file);
    ebpo_close(from);
    free(b.at);
    free(other.at);
}
END_TEST

static unsigned pages_read(const ebpo_file *file)
{
    unsigned count = 0;
    for (uint64_t i = 0; i < ebpo_shape_chunks(&file->root_array[EBPO_A_CHECKSUM_PAGES].shape); i++)
        count += atomic_load(&file->page_read[i]);
    return count;
}

/* The checksums of the first chunks of all arrays are together, and those of the last chunks, so
 * that a reader of a subtree needs few pages. Reading a chunk reads only its page. */
START_TEST(test_subtrees_need_few_pages)
{
    bytes b = write_mesh("a.ebpo.h5", ebpo_test_torus(1, 0.25, 400, 240), 8, EBPO_CODEC_ZSTD, 100,
                         EBPO_CHECKSUMS_DEFAULT);
    ebpo_file *file = open_bytes(&b);
    const ebpo_array_in *pages = &file->root_array[EBPO_A_CHECKSUM_PAGES], *a;
    ck_assert(pages->present && !file->root_array[EBPO_A_CHUNK_CHECKSUMS].present);
    ck_assert_uint_eq(pages->shape.chunk_rows, EBPO_CHECKSUM_ROWS);
    uint64_t all = ebpo_shape_chunks(&pages->shape), /* near: twice the mean rows of a block */
        near = 2 * pages->shape.rows / file->root_array[EBPO_A_SUBTREE_INDEX].shape.rows;
    ck_assert_uint_gt(all, near / EBPO_CHECKSUM_ROWS + 1);
    ck_assert_uint_lt(file->root_array[EBPO_A_CHECKSUM_INDEX].shape.rows, pages->shape.rows);
    ck_assert_int_eq(ebpo_checksum_pages_prepare(file, NULL), EBPO_OK);
    ebpo_idle_reader *r = ebpo_idle_readers_take(&file->idle);
    for (int n = 0; (a = array_of(file, n)); n++) {
        uint64_t last = chunks_of(a) - 1;
        if (!a->present || !ebpo_has_paged_checksums(file, a))
            continue;
        ck_assert_uint_lt(a->chunks[0].checksum_row, near);
        ck_assert_uint_ge(a->chunks[last].checksum_row, pages->shape.rows - near);
        ck_assert_int_eq(ebpo_reader_chunk(file, a, 0, &r->reader, r->raw, NULL), EBPO_OK);
        ck_assert_uint_le(pages_read(file), near / EBPO_CHECKSUM_ROWS + 1);
    }
    ck_assert_int_eq(ebpo_file_check_content(file, NULL, NULL), EBPO_OK);
    ck_assert_uint_eq(pages_read(file), all);
    ebpo_idle_readers_give(&file->idle, r);
    ebpo_close(file);
    free(b.at);
}
END_TEST

/* A subtree may be the first thing that is read after opening. */
START_TEST(test_subtree_is_read_first)
{
    bytes b = write_paged("a.ebpo.h5", 1);
    ebpo_file *file = open_bytes(&b);
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subtree *subtree = NULL;
    double p[3] = { 1.03125, 0, 0 };
    ck_assert_msg(ebpo_subtree_open(file, ebpo_octcode_at(info, p, info->subtree_level), NULL,
                                    &subtree, &error) == EBPO_OK,
                  "%s", error.message);
    ebpo_subtree_close(subtree);
    ebpo_close(file);
    free(b.at);
}
END_TEST

/* Wrong sums in /subtrees/index, with correct checksums, give an error and no other harm. */
START_TEST(test_hostile_sums_of_pages_are_refused)
{
    static const uint64_t values[] = { 0, 1, UINT32_MAX, UINT64_MAX / 2, UINT64_MAX };
    bytes b = write_paged("a.ebpo.h5", 1);
    changeable c;
    changeable_load(&c, scratch("a.ebpo.h5"));
    uint64_t count = changeable_count(&c, EBPO_A_SUBTREE_INDEX);
    for (uint64_t i = 0; i < 5 * count; i += ebpo_test_scale() < 1 ? 17 : 1) {
        uint64_t before = changeable_put(&c, EBPO_A_SUBTREE_INDEX, i / 5, values[i % 5]);
        ebpo_tree tree;
        ebpo_file *file;
        ck_assert_int_eq(ebpo_open_memory(c.data, c.size, "x", &file, NULL), EBPO_OK);
        ebpo_status status = ebpo_file_read_tree(file, NULL, &tree, NULL);
        ck_assert(status == EBPO_OK || status == EBPO_E_FORMAT);
        if (status == EBPO_OK)
            ebpo_tree_free(&tree);
        ebpo_close(file);
        changeable_put(&c, EBPO_A_SUBTREE_INDEX, i / 5, before);
    }
    changeable_free(&c);
    free(b.at);
}
END_TEST

/* Files without checksums report no error. */
START_TEST(test_files_without_checksums_are_equal)
{
    bytes with = write_torus("a.ebpo.h5", 1, EBPO_CODEC_NONE, 8, EBPO_CHECKSUMS_DEFAULT),
          without = write_torus("b.ebpo.h5", 1, EBPO_CODEC_NONE, 8, EBPO_CHECKSUMS_NONE);
    ebpo_file *a = open_bytes(&with), *b = open_bytes(&without);
    ck_assert(!b->root_array[EBPO_A_CHUNK_CHECKSUMS].present && !b->has_checksums && !b->checksums);
    ck_assert_mem_eq(ebpo_file_info(a)->content_sha256, ebpo_file_info(b)->content_sha256, 32);
    ck_assert_int_eq(ebpo_file_check_content(a, NULL, NULL), EBPO_OK);
    ck_assert_int_eq(ebpo_file_check_content(b, NULL, NULL), EBPO_OK);
    ebpo_close(a);
    ebpo_close(b);
    free(with.at);
    free(without.at);
}
END_TEST

START_TEST(test_invalid_checksum_option_is_refused)
{
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    write.chunk_checksums = (ebpo_chunk_checksums)2;
    ebpo_tree tree = model_build_parts(ebpo_test_torus(1, 0.25, 12, 8), 4, ~0u);
    ck_assert_int_eq(ebpo_tree_write(&tree, scratch("a.ebpo.h5"), &write, NULL), EBPO_E_ARGUMENT);
    ebpo_tree_free(&tree);
}
END_TEST

TEST_SUITE(chunk_checksums)
{
    Suite *suite = suite_create("chunk_sums");
    TCase *tests = tcase_create("sums");
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_set_timeout(tests, 120);
    tcase_add_loop_test(tests, test_chunk_checksums_list_every_chunk, 0, KINDS);
    tcase_add_loop_test(tests, test_chunks_of_other_version_are_refused, 0, 3);
    tcase_add_test(tests, test_subtrees_need_few_pages);
    tcase_add_test(tests, test_subtree_is_read_first);
    tcase_add_test(tests, test_hostile_sums_of_pages_are_refused);
    tcase_add_test(tests, test_files_without_checksums_are_equal);
    tcase_add_test(tests, test_invalid_checksum_option_is_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
