/* Reads files from memory, from paths and from a source of the caller: the trees are the same,
 * reads are few, and failed reads are reported correctly. */
#include <limits.h>
#include <hdf5.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include "check_main.h"
#include "read_by.h"
#include "format/reader.h"
#include "random_tree.h"
#include "scratch.h"
#include "solids.h"
#include "tree_json.h"

static const char *path, *rewritten;
static uint8_t *data; /* the bytes of `path`, in a block of exactly their size */
static size_t size;
static char *expected; /* the tree in it */

static uint8_t *slurp(const char *name, size_t *bytes)
{
    FILE *f = fopen(name, "rb");
    ck_assert_ptr_nonnull(f);
    fseek(f, 0, SEEK_END);
    *bytes = (size_t)ftell(f);
    rewind(f);
    uint8_t *all = malloc(*bytes);
    ck_assert_uint_eq(fread(all, 1, *bytes, f), *bytes);
    fclose(f);
    return all;
}

static char *text_of(const ebpo_tree *tree)
{
    char *text = NULL;
    size_t length = 0;
    FILE *out = open_memstream(&text, &length);
    tree_json(out, tree);
    fclose(out);
    return text;
}

static char *read_text(ebpo_file *file, unsigned threads)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_file_read_tree(file, READ_BY(threads), &tree, &error) == EBPO_OK, "%s",
                  error.message);
    char *text = text_of(&tree);
    ebpo_tree_free(&tree);
    return text;
}

static void expect_tree(ebpo_file *file, unsigned threads)
{
    ebpo_error error = EBPO_ERROR_INIT;
    char *text = read_text(file, threads);
    ck_assert_msg(strcmp(text, expected) == 0, "the tree differs");
    ck_assert_msg(ebpo_file_check_content(file, READ_BY(threads), &error) == EBPO_OK, "%s",
                  error.message);
    free(text);
}

static void make_file(const random_tree_options *options, ebpo_codec codec)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    write.codec = codec;
    random_tree_make(&tree, options);
    ck_assert_msg(ebpo_tree_write(&tree, path, &write, &error) == EBPO_OK, "%s", error.message);
    ebpo_tree_free(&tree);
    free(data);
    data = slurp(path, &size);
    ebpo_file *file;
    ck_assert_msg(ebpo_open(path, &file, &error) == EBPO_OK, "%s", error.message);
    free(expected);
    expected = read_text(file, 1);
    ebpo_close(file);
}

static const random_tree_options small = { 2, 3, 3, 5, true, false, false, false };
/* several chunks in many arrays */
static const random_tree_options large = { 7, 3, 9, 90000, true, false, false, false };

static void set_up(void)
{
    scratch_enter();
    path = scratch("a.ebpo.h5");
    rewritten = scratch("b.ebpo.h5");
}

static void tear_down(void)
{
    scratch_leave();
    free(data);
    free(expected);
    data = NULL;
    expected = NULL;
}

/* A source over `data` that fails at its `fail_at`-th read, counted from 0. */
typedef struct probe {
    _Atomic unsigned reads, closes;
    unsigned fail_at;
    ebpo_status status;
    bool silent;
} probe;

static ebpo_status probe_read(void *user, uint64_t offset, uint64_t bytes, void *to,
                              ebpo_error *error)
{
    probe *p = user;
    ck_assert(offset <= size && bytes <= size - offset && bytes > 0);
    if (p->reads++ == p->fail_at) {
        if (!p->silent) {
            error->status = p->status;
            snprintf(error->message, sizeof error->message, "the connection is lost");
        }
        return p->status;
    }
    memcpy(to, data + offset, bytes);
    return EBPO_OK;
}

static void probe_close(void *user)
{
    probe *p = user;
    p->closes++;
}

static ebpo_status open_probe(ebpo_file **file, probe *p, ebpo_error *error)
{
    ebpo_source source = { sizeof(ebpo_source), p, size, probe_read, probe_close, NULL, 0 };
    return ebpo_open_source(&source, "afar", file, error);
}

/* Writes the same content by libhdf5, with distributed metadata. By default, chunks are in B-trees
 * and have no checksums; with `kept`, the file has the layout of this format. */
static void rewrite(bool kept)
{
    static const char *const groups[] = { "levels", "mesh", "maps", "subtrees" };
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS), fcpl = H5Pcreate(H5P_FILE_CREATE);
    H5Pset_libver_bounds(fapl, kept ? H5F_LIBVER_V110 : H5F_LIBVER_EARLIEST, H5F_LIBVER_V110);
    H5Pset_attr_phase_change(fcpl, kept ? 65535 : 8, kept ? 0 : 6);
    hid_t in = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT),
          out = H5Fcreate(rewritten, H5F_ACC_TRUNC, fcpl, fapl);
    H5Pclose(fapl);
    H5Pclose(fcpl);
    for (int i = 0; i < 4; i++)
        if (H5Lexists(in, groups[i], H5P_DEFAULT) > 0)
            ck_assert_int_ge(H5Ocopy(in, groups[i], out, groups[i], H5P_DEFAULT, H5P_DEFAULT), 0);
    H5O_info_t facts;
    ck_assert_int_ge(H5Oget_info2(in, &facts, H5O_INFO_NUM_ATTRS), 0);
    for (hsize_t i = 0; i < facts.num_attrs; i++) {
        char name[64], value[512];
        hid_t from =
            H5Aopen_by_idx(in, ".", H5_INDEX_NAME, H5_ITER_INC, i, H5P_DEFAULT, H5P_DEFAULT);
        hid_t type = H5Aget_type(from), space = H5Aget_space(from);
        ck_assert_int_gt(H5Aget_name(from, sizeof name, name), 0);
        ck_assert_int_ge(H5Aread(from, type, value), 0);
        hid_t to = H5Acreate2(out, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
        ck_assert_int_ge(H5Awrite(to, type, value), 0);
        H5Aclose(to);
        H5Aclose(from);
        H5Tclose(type);
        H5Sclose(space);
    }
    H5Fclose(in);
    H5Fclose(out);
}

/* Copies the attribute that gives the coding of an array. */
static void copy_coding(hid_t from, hid_t to)
{
    char text[16] = "";
    hid_t old = H5Aopen(from, "coding", H5P_DEFAULT), type = H5Aget_type(old),
          space = H5Screate(H5S_SCALAR);
    ck_assert_uint_lt(H5Tget_size(type), sizeof text);
    ck_assert_int_ge(H5Aread(old, type, text), 0);
    hid_t fresh = H5Acreate2(to, "coding", type, space, H5P_DEFAULT, H5P_DEFAULT);
    ck_assert_int_ge(H5Awrite(fresh, type, text), 0);
    H5Aclose(fresh);
    H5Sclose(space);
    H5Tclose(type);
    H5Aclose(old);
}

/* Writes one array again without filters, with all chunks allocated at once: libhdf5 then computes
 * their offsets and stores no table. */
static void strip(hid_t file, const char *name)
{
    hid_t old = H5Dopen2(file, name, H5P_DEFAULT), type = H5Dget_type(old),
          space = H5Dget_space(old);
    hid_t from = H5Dget_create_plist(old), plain = H5Pcreate(H5P_DATASET_CREATE);
    hsize_t chunk[2], dims[2] = { 1, 1 };
    int rank = H5Pget_chunk(from, 2, chunk);
    H5Sget_simple_extent_dims(space, dims, NULL);
    void *values = malloc(dims[0] * dims[1] * H5Tget_size(type));
    ck_assert_int_ge(H5Dread(old, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), 0);
    H5Pset_chunk(plain, rank, chunk);
    H5Pset_alloc_time(plain, H5D_ALLOC_TIME_EARLY);
    ck_assert_int_ge(H5Ldelete(file, name, H5P_DEFAULT), 0);
    hid_t fresh = H5Dcreate2(file, name, type, space, H5P_DEFAULT, plain, H5P_DEFAULT);
    ck_assert_int_ge(H5Dwrite(fresh, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), 0);
    free(values);
    copy_coding(old, fresh);
    H5Pclose(from);
    H5Pclose(plain);
    H5Sclose(space);
    H5Tclose(type);
    H5Dclose(old);
    H5Dclose(fresh);
}

static herr_t list_array(hid_t group, const char *name, const H5O_info_t *info, void *user)
{
    (void)group;
    char(**next)[64] = user;
    if (info->type == H5O_TYPE_DATASET)
        snprintf(*(*next)++, 64, "%s", name);
    return 0;
}

static void rewrite_without_filters(void)
{
    static char names[256][64];
    char(*next)[64] = names;
    FILE *f = fopen(rewritten, "wb");
    ck_assert_uint_eq(fwrite(data, 1, size, f), size);
    fclose(f);
    ck_assert_int_eq(ebpo_register_filters(NULL), EBPO_OK);
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_libver_bounds(fapl, H5F_LIBVER_V110, H5F_LIBVER_V110);
    hid_t file = H5Fopen(rewritten, H5F_ACC_RDWR, fapl);
    ck_assert_int_ge(H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_INC, list_array, &next, H5O_INFO_BASIC),
                     0);
    while (next-- != names)
        strip(file, *next);
    H5Pclose(fapl);
    H5Fclose(file);
}

START_TEST(test_memory_path_and_source_trees_match)
{
    for (int codec = EBPO_CODEC_ZSTD; codec <= EBPO_CODEC_NONE; codec++) {
        probe p = { .fail_at = UINT32_MAX };
        ebpo_file *file[3];
        make_file(_i ? &large : &small, (ebpo_codec)codec);
        ck_assert_int_eq(ebpo_open(path, &file[0], NULL), EBPO_OK);
        ck_assert_int_eq(ebpo_open_memory(data, size, "bytes", &file[1], NULL), EBPO_OK);
        ck_assert_int_eq(open_probe(&file[2], &p, NULL), EBPO_OK);
        for (int i = 0; i < 3; i++) {
            expect_tree(file[i], 2);
            ck_assert_uint_eq(p.closes, 0);
            ck_assert_uint_eq(ebpo_file_info(file[i])->file_bytes, size);
            ebpo_close(file[i]);
        }
        ck_assert_uint_eq(p.closes, 1);
    }
}
END_TEST

START_TEST(test_open_and_array_read_counts)
{
    uint64_t bytes, reads, later, later_reads;
    ebpo_file *file;
    ebpo_tree tree;
    make_file(&large, EBPO_CODEC_ZSTD);
    ck_assert_int_eq(ebpo_open(path, &file, NULL), EBPO_OK);
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_file_stats stats = ebpo_test_file_stats(file);
    bytes = stats.bytes_read;
    ck_assert_uint_eq(stats.reads, 1);
    ck_assert_uint_eq(bytes, size < 131072 ? size : 131072);
    ck_assert_int_eq(ebpo_file_read_tree(file, READ_BY(1), &tree, NULL), EBPO_OK);
    ebpo_file_stats after = ebpo_test_file_stats(file);
    later = after.bytes_read;
    later_reads = after.reads;
    reads = stats.reads;
    /* only the list of chunk offsets of the part `subtrees` was needed */
    ebpo_stored_sizes sizes = EBPO_STORED_SIZES_INIT;
    ck_assert_int_eq(ebpo_file_locate(file, &sizes, NULL), EBPO_OK);
    ck_assert_uint_eq(later - bytes, size - info->head_bytes - info->chunk_index_bytes -
                                         sizes.subtree_bytes +
                                         file->root_array[EBPO_A_CHUNK_DIRECTORY].stored_bytes);
    uint64_t arrays = 0, chunks = 0;
    for (int i = 0; i < EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS; i++) {
        const ebpo_array_in *a =
            i < EBPO_ARRAYS ? &file->root_array[i] : &file->level_array[0][0] + (i - EBPO_ARRAYS);
        arrays += a->present;
        chunks += a->present ? ebpo_shape_chunks(&a->shape) : 0;
    }
    ck_assert_uint_gt(chunks, arrays + 20);
    ck_assert_uint_ge(later_reads - reads, arrays);
    /* neighbours are read together */
    ck_assert_uint_lt(later_reads - reads, arrays + (chunks - arrays) / 2);
    ebpo_tree_free(&tree);
    ebpo_close(file);
}
END_TEST

static void probe_expect(void *user, const ebpo_range *ranges, size_t count)
{
    (void)user;
    for (size_t i = 0; i < count; i++)
        ck_assert(ranges[i].offset <= size && ranges[i].size <= size - ranges[i].offset);
}

/* For remote files the index is read on demand, at the offset in the header; other programs may
 * have moved it. */
START_TEST(test_chunk_index_found_at_any_offset)
{
    ebpo_error error = EBPO_ERROR_INIT;
    make_file(&large, EBPO_CODEC_ZSTD);
    for (int falsified = 0; falsified < 6; falsified++) {
        probe p = { .fail_at = UINT_MAX };
        ebpo_file *file;
        ebpo_source source = { .struct_size = sizeof(ebpo_source),
                               .user = &p,
                               .size = size,
                               .read = probe_read,
                               .close = probe_close,
                               .prefetch = probe_expect,
                               .prefetched = 100000 };
        ck_assert_msg(ebpo_open_source(&source, "far", &file, &error) == EBPO_OK, "%s",
                      error.message);
        ebpo_info *info = &file->info;
        ck_assert(info->chunk_index_bytes > 0 && !atomic_load(&file->located) && p.reads == 1);
        switch (falsified) {
        case 1: info->chunk_index_offset = info->chunk_index_bytes = 0; break;
        case 2: info->chunk_index_offset -= 1000; break;
        case 3: info->chunk_index_bytes /= 2; break;
        case 4: info->chunk_index_offset = 200000, info->chunk_index_bytes = 300000; break;
        case 5: info->chunk_index_offset = 0, info->chunk_index_bytes = size; break;
        }
        unsigned before = p.reads;
        ck_assert_msg(ebpo_file_locate(file, NULL, &error) == EBPO_OK, "%s", error.message);
        ck_assert_uint_le(p.reads - before,
                          falsified ? 20 : 2); /* the header again, and the index */
        expect_tree(file, 1);
        ebpo_close(file);
    }
}
END_TEST

/* Fails at read 0, 1, 2, ... of opening and of reading everything, until there are no more reads.
 */
static unsigned fail_everywhere(ebpo_status status, bool silent)
{
    for (unsigned k = 0;; k++) {
        probe p = { .fail_at = k, .status = status, .silent = silent };
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_file *file;
        ebpo_tree tree;
        ebpo_status got = open_probe(&file, &p, &error);
        ck_assert((got == EBPO_OK) == (file != NULL));
        ck_assert_int_eq(H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL), 0);
        ck_assert_uint_eq(p.closes, got != EBPO_OK);
        if (got == EBPO_OK) {
            got = ebpo_file_read_tree(file, READ_BY(1), &tree, &error);
            if (got == EBPO_OK)
                ebpo_tree_free(&tree);
            ebpo_close(file);
        }
        ck_assert_uint_eq(p.closes, 1);
        if (p.reads <= k) {
            ck_assert_int_eq(got, EBPO_OK);
            return k;
        }
        ck_assert_msg(got == status, "read %u: %s, %s", k, ebpo_status_name(got), error.message);
        ck_assert_ptr_nonnull(
            strstr(error.message, silent ? "afar: bytes " : "the connection is lost"));
    }
}

START_TEST(test_failing_reads_are_reported)
{
    make_file(&small, EBPO_CODEC_ZSTD);
    ck_assert_uint_gt(fail_everywhere(EBPO_E_IO, false), 10);
    ck_assert_uint_gt(fail_everywhere(EBPO_E_MEMORY, true), 10);
}
END_TEST

START_TEST(test_failing_reads_with_scattered_metadata)
{
    probe p = { .fail_at = UINT32_MAX };
    ebpo_file *file;
    make_file(&large, EBPO_CODEC_NONE);
    rewrite(true);
    free(data);
    data = slurp(rewritten, &size);
    ck_assert_uint_gt(size, 1 << 20);
    ck_assert_int_eq(open_probe(&file, &p, NULL), EBPO_OK);
    ck_assert_uint_gt(p.reads, 3); /* so that some reads after the header can fail */
    ebpo_close(file);
    fail_everywhere(EBPO_E_IO, false);
}
END_TEST

START_TEST(test_files_repacked_by_libhdf5_are_equal)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    make_file(_i < 2 ? &small : &large, EBPO_CODEC_ZSTD);
    if (_i % 2)
        rewrite_without_filters();
    else
        rewrite(true);
    ck_assert_msg(ebpo_open(rewritten, &file, &error) == EBPO_OK, "%s", error.message);
    expect_tree(file, 2);
    ebpo_close(file);
}
END_TEST

START_TEST(test_files_without_checksums_are_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    make_file(&small, EBPO_CODEC_ZSTD);
    rewrite(false);
    ck_assert_int_eq(ebpo_open(rewritten, &file, &error), EBPO_E_UNSUPPORTED);
    ck_assert_ptr_nonnull(strstr(error.message, "superblock of version 0"));
    ck_assert_ptr_nonnull(strstr(error.message, "--compat"));
    ck_assert_msg(ebpo_open_compat(rewritten, NULL, &file, &error) == EBPO_OK, "%s", error.message);
    expect_tree(file, 2);
    ebpo_close(file);
    /* opens this file like all other files */
    ck_assert_int_eq(ebpo_open_compat(path, NULL, &file, &error), EBPO_OK);
    ebpo_close(file);
}
END_TEST

/* The result is an error or the same content. libhdf5 runs in a separate process. */
START_TEST(test_damage_without_checksums_is_harmless)
{
    make_file(&small, EBPO_CODEC_ZSTD);
    rewrite(false);
    free(data);
    data = slurp(rewritten, &size);
    for (size_t bit = 64; bit < 4096 * 8; bit += 331) {
        ebpo_file *file;
        ebpo_error error = EBPO_ERROR_INIT;
        data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        FILE *f = fopen(rewritten, "wb");
        ck_assert_uint_eq(fwrite(data, 1, size, f), size);
        fclose(f);
        data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        if (ebpo_open_compat(rewritten, NULL, &file, &error) == EBPO_OK)
            ebpo_close(file);
        else
            ck_assert_ptr_nonnull(strstr(error.message, rewritten));
    }
}
END_TEST

static void compare_table(hid_t fid, const ebpo_array_in *array, uint64_t *chunks)
{
    hid_t id = H5Dopen2(fid, array->path, H5P_DEFAULT);
    uint64_t count = ebpo_shape_chunks(&array->shape), stored = 0;
    ck_assert_int_ge(id, 0);
    for (uint64_t i = 0; i < count; i++) {
        hsize_t at[2] = { i * array->shape.chunk_rows, 0 }, bytes;
        unsigned mask;
        haddr_t address;
        ck_assert_int_ge(H5Dget_chunk_info_by_coord(id, at, &mask, &address, &bytes), 0);
        ck_assert_uint_eq(array->chunks[i].address, address);
        ck_assert_uint_eq(array->chunks[i].bytes, bytes);
        stored += bytes;
    }
    ck_assert_uint_eq(array->stored_bytes, stored);
    ck_assert_uint_eq(H5Dget_storage_size(id), stored);
    *chunks += count;
    H5Dclose(id);
}

START_TEST(test_chunk_tables_match_libhdf5)
{
    ebpo_file *file;
    uint64_t chunks = 0, arrays = 0;
    make_file(&large, EBPO_CODEC_ZSTD);
    const char *name = _i == 0 ? path : rewritten;
    if (_i == 1)
        rewrite(true);
    if (_i == 2)
        rewrite_without_filters();
    ck_assert_int_eq(ebpo_open(name, &file, NULL), EBPO_OK);
    ck_assert(file->info.subtree_level && file->has_directory == (_i == 0));
    ck_assert_int_eq(ebpo_file_locate(file, NULL, NULL), EBPO_OK);
    hid_t fid = H5Fopen(name, H5F_ACC_RDONLY, H5P_DEFAULT);
    for (int i = 0; i < EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS; i++) {
        const ebpo_array_in *a =
            i < EBPO_ARRAYS ? &file->root_array[i] : &file->level_array[0][0] + (i - EBPO_ARRAYS);
        ck_assert_int_eq(a->present, a->chunks != NULL);
        arrays += a->present;
        if (a->present)
            compare_table(fid, a, &chunks);
    }
    ck_assert_uint_gt(chunks, arrays + 20);
    H5Fclose(fid);
    ebpo_close(file);
}
END_TEST

START_TEST(test_open_file_keeps_no_hdf5_objects)
{
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    make_file(&small, EBPO_CODEC_ZSTD);
    ck_assert_int_eq(ebpo_open(path, &file, NULL), EBPO_OK);
    ck_assert_int_eq(H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL), 0);
    ck_assert_int_eq(H5close(), 0); /* libhdf5 is no longer needed */
    expect_tree(file, 2);
    ebpo_close(file);
    ck_assert_msg(ebpo_open(path, &file, &error) == EBPO_OK, "%s",
                  error.message); /* libhdf5 is initialised again */
    ebpo_close(file);
}
END_TEST

START_TEST(test_reads_stay_inside_memory_buffer)
{
    ebpo_tree tree;
    make_file(&small, EBPO_CODEC_DEFLATE);
    for (size_t cut = 0; cut < size; cut += cut < 64 ? 1 : 211) {
        ebpo_file *file;
        ebpo_error error = EBPO_ERROR_INIT;
        uint8_t *bytes = malloc(cut);
        memcpy(bytes, data, cut);
        ebpo_status status = ebpo_open_memory(bytes, cut, "cut.ebpo.h5", &file, &error);
        if (status == EBPO_OK) {
            status = ebpo_file_read_tree(file, READ_BY(1), &tree, &error);
            ebpo_close(file);
        }
        ck_assert_int_eq(status, EBPO_E_FORMAT);
        ck_assert_ptr_nonnull(strstr(error.message, "cut.ebpo.h5"));
        ck_assert_int_eq(H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL), 0);
        free(bytes);
    }
}
END_TEST

START_TEST(test_file_truncated_while_open_fails)
{
    ebpo_file *file;
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    make_file(&large, EBPO_CODEC_ZSTD);
    ck_assert_int_eq(ebpo_open(path, &file, NULL), EBPO_OK);
    ck_assert_int_eq(truncate(path, (off_t)size / 2), 0);
    ck_assert_int_eq(ebpo_file_read_tree(file, READ_BY(2), &tree, &error), EBPO_E_IO);
    ck_assert_ptr_nonnull(strstr(error.message, path));
    ck_assert_ptr_nonnull(strstr(error.message, "became shorter"));
    ebpo_close(file);
}
END_TEST

START_TEST(test_non_regular_file_is_refused)
{
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(mkfifo(path, 0600), 0);
    ck_assert_int_eq(ebpo_open(path, &file, &error), EBPO_E_IO);
    ck_assert_ptr_nonnull(strstr(error.message, "not a regular file"));
    ck_assert_int_eq(ebpo_open(scratch(NULL), &file, &error), EBPO_E_IO);
    ck_assert_int_eq(ebpo_open(rewritten, &file, &error), EBPO_E_IO);
    ck_assert_ptr_null(file);
}
END_TEST

START_TEST(test_missing_arguments_close_source)
{
    probe p = { .fail_at = 0 };
    ebpo_source source = { sizeof(ebpo_source), &p, 5, NULL, probe_close, NULL, 0 };
    ebpo_file *file;
    ck_assert_int_eq(ebpo_open_source(&source, "x", &file, NULL), EBPO_E_ARGUMENT);
    ck_assert_uint_eq(p.closes, 1);
    p.closes = 0;
    ebpo_open_options by_source = EBPO_OPEN_OPTIONS_INIT;
    by_source.source = &source;
    ck_assert_int_eq(ebpo_open_with("x", &by_source, &file, NULL), EBPO_E_ARGUMENT);
    ck_assert_uint_eq(p.closes, 1);
    by_source.struct_size = 0;
    ck_assert_int_eq(ebpo_open_with("x", &by_source, &file, NULL), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_open_memory(NULL, 5, NULL, &file, NULL), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_open_memory(NULL, 0, NULL, &file, NULL), EBPO_E_FORMAT);
    ck_assert_int_eq(ebpo_open_memory("text", 4, NULL, &file, NULL), EBPO_E_FORMAT);
    ck_assert_ptr_null(file);
}
END_TEST

static void *read_in_thread(void *user) { return read_text(user, 2); }

START_TEST(test_threads_read_one_file)
{
    ebpo_file *file;
    pthread_t thread[4];
    void *text;
    make_file(&large, EBPO_CODEC_ZSTD);
    ck_assert_int_eq(ebpo_open(path, &file, NULL), EBPO_OK);
    for (int i = 0; i < 4; i++)
        ck_assert_int_eq(pthread_create(&thread[i], NULL, read_in_thread, file), 0);
    for (int i = 0; i < 4; i++) {
        ck_assert_int_eq(pthread_join(thread[i], &text), 0);
        ck_assert_msg(strcmp(text, expected) == 0, "the tree differs");
        free(text);
    }
    ebpo_close(file);
}
END_TEST

static void *open_in_thread(void *user)
{
    for (int i = 0; i < 20; i++) {
        ebpo_file *file;
        if (ebpo_open(user, &file, NULL) != EBPO_OK)
            return user;
        ebpo_close(file);
    }
    return NULL;
}

START_TEST(test_threads_open_one_file)
{
    pthread_t thread[4];
    void *failed;
    make_file(&small, EBPO_CODEC_ZSTD);
    for (int i = 0; i < 4; i++)
        ck_assert_int_eq(pthread_create(&thread[i], NULL, open_in_thread, (void *)path), 0);
    for (int i = 0; i < 4; i++) {
        ck_assert_int_eq(pthread_join(thread[i], &failed), 0);
        ck_assert_ptr_null(failed);
    }
}
END_TEST

TEST_SUITE(source)
{
    Suite *suite = suite_create("source");
    TCase *tests = tcase_create("source");
    tcase_set_timeout(tests, 300);
    tcase_add_checked_fixture(tests, set_up, tear_down);
    tcase_add_loop_test(tests, test_memory_path_and_source_trees_match, 0, 2);
    tcase_add_test(tests, test_open_and_array_read_counts);
    tcase_add_test(tests, test_chunk_index_found_at_any_offset);
    tcase_add_test(tests, test_failing_reads_are_reported);
    tcase_add_test(tests, test_failing_reads_with_scattered_metadata);
    tcase_add_loop_test(tests, test_files_repacked_by_libhdf5_are_equal, 0, 4);
    tcase_add_test(tests, test_files_without_checksums_are_refused);
    tcase_add_test(tests, test_damage_without_checksums_is_harmless);
    tcase_add_loop_test(tests, test_chunk_tables_match_libhdf5, 0, 3);
    tcase_add_test(tests, test_open_file_keeps_no_hdf5_objects);
    tcase_add_test(tests, test_reads_stay_inside_memory_buffer);
    tcase_add_test(tests, test_file_truncated_while_open_fails);
    tcase_add_test(tests, test_non_regular_file_is_refused);
    tcase_add_test(tests, test_missing_arguments_close_source);
    tcase_add_test(tests, test_threads_read_one_file);
    tcase_add_test(tests, test_threads_open_one_file);
    suite_add_tcase(suite, tests);
    return suite;
}
