/* Tests the container: trees are read as they were written, bit by bit; equal trees give equal
 * files; and damage is detected. */
#include <fcntl.h>
#include <hdf5.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/endian.h"
#include "check_main.h"
#include "read_by.h"
#include "hdf5_read/chunk.h"
#include "hdf5_read/coding.h"
#include "format/content_checksum.h"
#include "format/reader.h"
#include "hdf5_write/h5.h"
#include "random_tree.h"
#include "scratch.h"
#include "solids.h"

static uint8_t *slurp(const char *path, size_t *size)
{
    FILE *f = fopen(path, "rb");
    ck_assert_ptr_nonnull(f);
    fseek(f, 0, SEEK_END);
    *size = (size_t)ftell(f);
    rewind(f);
    uint8_t *data = malloc(*size + 1);
    ck_assert_uint_eq(fread(data, 1, *size, f), *size);
    fclose(f);
    return data;
}

static void spill(const char *path, const uint8_t *data, size_t size)
{
    FILE *f = fopen(path, "wb");
    ck_assert_ptr_nonnull(f);
    ck_assert_uint_eq(fwrite(data, 1, size, f), size);
    fclose(f);
}

static void write_ok(const ebpo_tree *tree, const char *path, ebpo_codec codec, unsigned threads,
                     uint32_t parts)
{
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    options.codec = codec;
    options.threads = threads;
    options.parts = parts;
    ck_assert_msg(ebpo_tree_write(tree, path, &options, &error) == EBPO_OK, "%s", error.message);
}

static ebpo_file *open_ok(const char *path)
{
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_open(path, &file, &error) == EBPO_OK, "%s", error.message);
    return file;
}

static void same(const void *a, const void *b, uint64_t count, size_t size, const char *what)
{
    ck_assert_msg(!a == !b || count == 0, "%s: present in one only", what);
    if (a && b)
        ck_assert_msg(memcmp(a, b, count * size) == 0, "%s differs", what);
}

static void same_level(const ebpo_level *a, const ebpo_level *b)
{
    ck_assert_uint_eq(a->group_count, b->group_count);
    ck_assert_uint_eq(a->gray_count, b->gray_count);
    ck_assert_uint_eq(a->leaf_count, b->leaf_count);
    ck_assert_uint_eq(a->white_count, b->white_count);
    ck_assert_uint_eq(a->black_count, b->black_count);
    ck_assert_uint_eq(a->ref_count, b->ref_count);
    ck_assert_uint_eq(a->new_count, b->new_count);
    same(a->types, b->types, a->group_count, 2, "types");
    same(a->plane_counts, b->plane_counts, a->gray_count, 1, "plane_counts");
    same(a->planes, b->planes, a->plane_count, 4, "planes");
    same(a->gray_colours, b->gray_colours, a->gray_count, 4, "gray_colours");
    same(a->leaf_winding, b->leaf_winding, a->leaf_count, 4, "leaf_winding");
    same(a->black_winding, b->black_winding, a->black_count, 4, "black_winding");
    same(a->white_winding, b->white_winding, a->white_count, 4, "white_winding");
    same(a->leaf_first, b->leaf_first, a->leaf_count, 8, "leaf_first");
    same(a->leaf_new, b->leaf_new, a->leaf_count, 4, "leaf_new");
    same(a->leaf_ref_count, b->leaf_ref_count, a->leaf_count, 4, "leaf_ref_count");
    same(a->leaf_refs, b->leaf_refs, a->ref_count, 4, "leaf_refs");
    same(a->leaf_plane_counts, b->leaf_plane_counts, a->leaf_count, 1, "leaf_plane_counts");
    same(a->leaf_planes, b->leaf_planes, a->leaf_plane_count, 4, "leaf_planes");
    ck_assert(a->gray_volume == b->gray_volume && a->leaf_volume == b->leaf_volume);
}

static void same_tree(const ebpo_tree *a, const ebpo_tree *b)
{
    ck_assert_int_eq(a->info.level_count, b->info.level_count);
    for (int i = 0; i < a->info.level_count; i++)
        same_level(&a->level[i], &b->level[i]);
    same(a->mesh.faces, b->mesh.faces, a->mesh.face_count, 12, "faces");
    same(a->mesh.xyz32, b->mesh.xyz32, a->mesh.vertex_count, 12, "float vertices");
    same(a->mesh.xyz64, b->mesh.xyz64, a->mesh.vertex_count, 24, "double vertices");
    same(a->vertex_source, b->vertex_source, a->mesh.vertex_count, 4, "vertex_source");
    same(a->face_source, b->face_source, a->mesh.face_count, 4, "face_source");
    ck_assert_str_eq(a->info.source_name, b->info.source_name);
    ck_assert_str_eq(a->info.unit, b->info.unit);
    ck_assert_str_eq(a->info.crs, b->info.crs);
    ck_assert(memcmp(a->info.box_origin, b->info.box_origin, 24) == 0 &&
              memcmp(a->info.box_size, b->info.box_size, 24) == 0);
    ck_assert(a->info.report.genus == b->info.report.genus &&
              a->info.report.volume == b->info.report.volume);
    ck_assert(a->info.rule == b->info.rule && a->info.solid == b->info.solid &&
              a->info.epsilon == b->info.epsilon);
}

/* Shapes of trees: a single leaf, several levels, many items (index arrays, several chunks), odd
 * winding numbers, a surface, doubles, leaf planes. */
static const random_tree_options shapes[] = {
    { 1, 1, 0, 9, true, false, false, false },     { 2, 2, 0, 5, true, false, false, false },
    { 3, 5, 8, 6, true, true, true, false },       { 4, 6, 7, 9, false, false, false, true },
    { 5, 12, 1, 300, true, false, false, true },   { 6, 8, 8, 9, true, false, true, true },
    { 7, 7, 9, 90000, true, false, false, false },
};
enum { SHAPES = sizeof shapes / sizeof shapes[0] };

START_TEST(test_tree_round_trip_is_bit_exact)
{
    ebpo_tree tree, back;
    random_tree_options options = shapes[_i];
    if (options.new_faces > 1000)
        options.levels = 3;
    random_tree_make(&tree, &options);
    if (_i % 2)
        random_tree_paint(&tree);
    for (int codec = EBPO_CODEC_ZSTD; codec <= EBPO_CODEC_NONE; codec++)
        for (unsigned threads = 1; threads <= 3; threads += 2) {
            if (ebpo_test_scale() < 1 && (_i + codec + (int)threads / 2) % 2)
                continue; /* each codec with one number of threads */
            write_ok(&tree, scratch("t.ebpo.h5"), (ebpo_codec)codec, threads, ~0u);
            ebpo_file *file = open_ok(scratch("t.ebpo.h5"));
            ebpo_error error = EBPO_ERROR_INIT;
            ck_assert_msg(ebpo_file_read_tree(file, READ_BY(threads), &back, &error) == EBPO_OK,
                          "%s", error.message);
            ck_assert_int_eq(ebpo_file_info(file)->codec, codec);
            ck_assert_msg(ebpo_file_check_content(file, READ_BY(threads), &error) == EBPO_OK, "%s",
                          error.message);
            same_tree(&tree, &back);
            ebpo_tree_free(&back);
            ebpo_close(file);
        }
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_file_bytes_same_for_any_threads)
{
    ebpo_tree tree;
    random_tree_make(&tree, &shapes[5]);
    for (int codec = EBPO_CODEC_ZSTD; codec <= EBPO_CODEC_NONE; codec++) {
        size_t size, other_size;
        write_ok(&tree, scratch("a.ebpo.h5"), (ebpo_codec)codec, 1, ~0u);
        write_ok(&tree, scratch("b.ebpo.h5"), (ebpo_codec)codec, 7, ~0u);
        uint8_t *a = slurp(scratch("a.ebpo.h5"), &size),
                *b = slurp(scratch("b.ebpo.h5"), &other_size);
        ck_assert_uint_eq(size, other_size);
        ck_assert_int_eq(memcmp(a, b, size), 0);
        free(a);
        free(b);
    }
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_content_checksum_ignores_codec)
{
    ebpo_tree tree;
    uint8_t digest[32];
    random_tree_make(&tree, &shapes[2]);
    for (int codec = EBPO_CODEC_ZSTD; codec <= EBPO_CODEC_NONE; codec++) {
        write_ok(&tree, scratch("a.ebpo.h5"), (ebpo_codec)codec, 1, ~0u);
        ebpo_file *file = open_ok(scratch("a.ebpo.h5"));
        if (codec == EBPO_CODEC_ZSTD)
            memcpy(digest, ebpo_file_info(file)->content_sha256, 32);
        ck_assert_int_eq(memcmp(digest, ebpo_file_info(file)->content_sha256, 32), 0);
        ebpo_close(file);
    }
    ebpo_tree_free(&tree);
}
END_TEST

typedef struct metadata_places {
    uint64_t head, index, index_bytes, chunk_bytes;
} metadata_places;

static herr_t check_chunks(hid_t group, const char *name, const H5L_info_t *info, void *data)
{
    (void)info;
    metadata_places *m = data;
    hid_t object = H5Oopen(group, name, H5P_DEFAULT);
    if (H5Iget_type(object) == H5I_DATASET) {
        hsize_t count = 0;
        hid_t space = H5Dget_space(object);
        ck_assert_int_ge(H5Dget_num_chunks(object, space, &count), 0);
        for (hsize_t i = 0; i < count; i++) {
            hsize_t at[2], size;
            unsigned mask;
            haddr_t address;
            ck_assert_int_ge(H5Dget_chunk_info(object, space, i, at, &mask, &address, &size), 0);
            ck_assert_uint_ge(address, m->head);
            ck_assert(address + size <= m->index || address >= m->index + m->index_bytes);
            /* metadata that is needed to find an array comes before the array */
            ck_assert(count == 1 || address >= m->index + m->index_bytes);
            m->chunk_bytes += size;
        }
        H5Sclose(space);
    }
    H5Oclose(object);
    return 0;
}

/* The file has headers, the first levels, the index of large arrays, then all other data, without
 * gaps. */
START_TEST(test_metadata_is_in_two_blocks)
{
    ebpo_tree tree;
    random_tree_make(&tree, &shapes[4]);
    ck_assert_int_eq(tree.info.level_count, 12);
    write_ok(&tree, scratch("a.ebpo.h5"), EBPO_CODEC_ZSTD, 1, ~0u);
    ebpo_file *file = open_ok(scratch("a.ebpo.h5"));
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    ck_assert_int_eq(ebpo_file_locate(file, &stored, NULL), EBPO_OK);
    metadata_places m = { info->head_bytes, info->chunk_index_offset, info->chunk_index_bytes, 0 };
    uint64_t size = info->file_bytes, first_levels = m.head;
    for (int level = 0; level < info->index_level; level++)
        first_levels += stored.level_bytes[level];
    ck_assert_int_gt(info->index_level, 3);
    ck_assert_uint_ge(m.index, first_levels);
    ck_assert_uint_gt(m.index_bytes, 0);
    ebpo_close(file);
    ck_assert_uint_lt(m.head, 64 << 10);
    hid_t fid = H5Fopen(scratch("a.ebpo.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
    ck_assert_int_ge(H5Lvisit(fid, H5_INDEX_NAME, H5_ITER_NATIVE, check_chunks, &m), 0);
    H5Fclose(fid);
    ck_assert_uint_eq(m.head + m.index_bytes + m.chunk_bytes, size);
    ebpo_tree_free(&tree);
}
END_TEST

/* The sizes of metadata are correct also for headers whose checksums end in zero bytes, and for
 * files with one array. */
START_TEST(test_files_have_no_gaps)
{
    static const uint32_t parts[] = { ~0u, EBPO_PART_PLANES, 0, EBPO_PART_MESH };
    for (unsigned seed = 1; seed <= 100; seed++) {
        random_tree_options options = { seed,          1 + (int)(seed % 3),
                                        2 + seed % 5,  seed * 7 % 260 + 1,
                                        seed % 2 == 0, false,
                                        seed % 3 == 0, false };
        ebpo_tree tree;
        random_tree_make(&tree, &options);
        for (int codec = EBPO_CODEC_ZSTD; codec <= EBPO_CODEC_NONE; codec++) {
            uint32_t some = parts[seed % 4];
            if (ebpo_test_scale() < 1 && (seed / 4 + (unsigned)codec) % 3)
                continue; /* each part with each codec, and each tree once */
            write_ok(&tree, scratch("a.ebpo.h5"), (ebpo_codec)codec, 1, some);
            ebpo_file *file = open_ok(scratch("a.ebpo.h5"));
            const ebpo_info *info = ebpo_file_info(file);
            ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
            ck_assert_int_eq(ebpo_file_locate(file, &stored, NULL), EBPO_OK);
            uint64_t sum = info->head_bytes + info->chunk_index_bytes + stored.mesh_vertex_bytes +
                           stored.mesh_face_bytes + stored.map_bytes + stored.checksum_bytes;
            for (int level = 0; level < info->level_count; level++)
                sum += stored.level_bytes[level];
            ck_assert_msg(sum == info->file_bytes, "seed %u, codec %d: %d bytes, the file has %d",
                          seed, codec, (int)sum, (int)info->file_bytes);
            ebpo_close(file);
        }
        ebpo_tree_free(&tree);
    }
}
END_TEST

START_TEST(test_libhdf5_reads_compressed_chunks)
{
    ebpo_tree tree;
    random_tree_make(&tree, &shapes[5]);
    ck_assert_int_eq(ebpo_register_filters(NULL), EBPO_OK);
    for (int codec = EBPO_CODEC_ZSTD; codec <= EBPO_CODEC_NONE; codec++) {
        write_ok(&tree, scratch("a.ebpo.h5"), (ebpo_codec)codec, 2, ~0u);
        hid_t fid = H5Fopen(scratch("a.ebpo.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
        hid_t planes = H5Dopen2(fid, "/levels/06/planes", H5P_DEFAULT),
              codes = H5Dopen2(fid, "/mesh/faces", H5P_DEFAULT);
        uint32_t *values = malloc(tree.level[6].plane_count * 4),
                 *faces = malloc(tree.mesh.face_count * 12);
        ck_assert_int_ge(H5Dread(planes, H5T_NATIVE_UINT32, H5S_ALL, H5S_ALL, H5P_DEFAULT, values),
                         0);
        ck_assert_int_ge(H5Dread(codes, H5T_STD_U32LE, H5S_ALL, H5S_ALL, H5P_DEFAULT, faces), 0);
        ck_assert_int_eq(memcmp(values, tree.level[6].planes, tree.level[6].plane_count * 4), 0);
        uint64_t seen = 0;
        ck_assert(ebpo_corners_decode((uint8_t *)faces, tree.mesh.face_count, &seen, faces));
        ck_assert_int_eq(memcmp(faces, tree.mesh.faces, tree.mesh.face_count * 12), 0);
        free(values);
        free(faces);
        H5Dclose(planes);
        H5Dclose(codes);
        H5Fclose(fid);
    }
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_omitted_parts_are_absent)
{
    ebpo_tree tree, back;
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_maps maps;
    random_tree_make(&tree, &shapes[3]);
    random_tree_paint(&tree);
    for (uint32_t some = 0; some < 16; some++) {
        uint32_t parts = some | (some % 3 == 1 ? EBPO_PART_COLOURS : 0);
        write_ok(&tree, scratch("a.ebpo.h5"), EBPO_CODEC_ZSTD, 1, parts);
        ebpo_file *file = open_ok(scratch("a.ebpo.h5"));
        uint32_t there = parts & EBPO_PART_MESH ? parts : parts & ~(uint32_t)EBPO_PART_MAPS;
        ck_assert_uint_eq(ebpo_file_info(file)->parts, there);
        ck_assert_msg(ebpo_file_read_tree(file, READ_BY(1), &back, &error) == EBPO_OK, "%s",
                      error.message);
        ck_assert_int_eq(back.level[5].leaf_planes != NULL, (there & EBPO_PART_LEAF_PLANES) != 0);
        ck_assert_int_eq(back.level[4].planes != NULL, (there & EBPO_PART_PLANES) != 0);
        ck_assert_int_eq(back.level[4].gray_colours != NULL, (there & EBPO_PART_COLOURS) != 0);
        ck_assert_int_eq(back.level[5].leaf_first != NULL, (there & EBPO_PART_MESH) != 0);
        ck_assert_int_eq(ebpo_file_read_mesh(file, READ_BY(1), &mesh, NULL),
                         there & EBPO_PART_MESH ? EBPO_OK : EBPO_E_ABSENT);
        ebpo_mesh_free(&mesh);
        ck_assert_int_eq(ebpo_file_read_maps(file, NULL, &maps, NULL),
                         there & EBPO_PART_MAPS ? EBPO_OK : EBPO_E_ABSENT);
        ebpo_maps_free(&maps);
        ck_assert_int_eq(ebpo_file_check_content(file, READ_BY(2), NULL), EBPO_OK);
        ebpo_tree_free(&back);
        ebpo_close(file);
    }
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_source_order_inverts_maps)
{
    ebpo_tree tree;
    ebpo_mesh mesh;
    bool ordered;
    random_tree_make(&tree, &shapes[_i]);
    /* every second index is missing, as after welding */
    tree.info.source_vertex_count = tree.mesh.vertex_count * 2;
    for (uint64_t i = 0; i < tree.mesh.vertex_count; i++)
        tree.vertex_source[i] *= 2;
    write_ok(&tree, scratch("a.ebpo.h5"), EBPO_CODEC_ZSTD, 1, ~0u);
    ebpo_file *file = open_ok(scratch("a.ebpo.h5"));
    ck_assert_int_eq(ebpo_file_read_source_mesh(file, READ_BY(2), &mesh, &ordered, NULL), EBPO_OK);
    ck_assert(ordered);
    for (uint64_t i = 0; i < tree.mesh.face_count; i++)
        for (int k = 0; k < 3; k++)
            ck_assert_uint_eq(mesh.faces[3 * (uint64_t)tree.face_source[i] + k],
                              tree.vertex_source[tree.mesh.faces[3 * i + k]] / 2);
    size_t size = mesh.xyz32 ? 12 : 24;
    const char *sorted = mesh.xyz32 ? (char *)mesh.xyz32 : (char *)mesh.xyz64;
    const char *stored = mesh.xyz32 ? (char *)tree.mesh.xyz32 : (char *)tree.mesh.xyz64;
    for (uint64_t i = 0; i < tree.mesh.vertex_count; i++)
        ck_assert_int_eq(memcmp(sorted + tree.vertex_source[i] / 2 * size, stored + i * size, size),
                         0);
    ebpo_mesh_free(&mesh);
    ebpo_close(file);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_read_only_folder_is_sufficient)
{
    ebpo_tree tree;
    random_tree_make(&tree, &shapes[1]);
    write_ok(&tree, scratch("a.ebpo.h5"), EBPO_CODEC_ZSTD, 1, ~0u);
    ck_assert_int_eq(chmod(scratch("a.ebpo.h5"), 0444) | chmod(scratch(NULL), 0555), 0);
    ebpo_file *file = open_ok(scratch("a.ebpo.h5")), *again = open_ok(scratch("a.ebpo.h5"));
    ebpo_close(file);
    ck_assert_int_eq(ebpo_file_check_content(again, READ_BY(1), NULL), EBPO_OK);
    ebpo_close(again);
    ebpo_tree_free(&tree);
}
END_TEST

/* Opens and reads everything; returns true when no error was found, including the checksum. */
static bool reads_well(const char *path, ebpo_error *error)
{
    ebpo_file *file;
    ebpo_tree tree;
    if (ebpo_open(path, &file, error) != EBPO_OK)
        return false;
    bool ok = ebpo_file_read_tree(file, READ_BY(1), &tree, error) == EBPO_OK;
    if (ok)
        ebpo_tree_free(&tree);
    ok = ok && ebpo_file_check_content(file, READ_BY(1), error) == EBPO_OK;
    ebpo_close(file);
    return ok;
}

START_TEST(test_truncated_files_are_refused)
{
    ebpo_tree tree;
    size_t size;
    random_tree_make(&tree, &shapes[2]);
    write_ok(&tree, scratch("a.ebpo.h5"), EBPO_CODEC_ZSTD, 1, ~0u);
    uint8_t *data = slurp(scratch("a.ebpo.h5"), &size);
    for (size_t cut = 0; cut < size; cut += cut < size - 20 ? 197 : 1) {
        ebpo_error error = EBPO_ERROR_INIT;
        spill(scratch("b.ebpo.h5"), data, cut);
        ck_assert_msg(!reads_well(scratch("b.ebpo.h5"), &error), "cut at %zu", cut);
        ck_assert_ptr_nonnull(strstr(error.message, "b.ebpo.h5"));
    }
    free(data);
    ebpo_tree_free(&tree);
}
END_TEST

/* zstd frames have a few unused bits. reads_well() compares the content, so an accepted flip
 * changed nothing. */
START_TEST(test_bit_flips_after_header_are_detected)
{
    ebpo_tree tree;
    size_t size;
    random_tree_make(&tree, &shapes[2]);
    write_ok(&tree, scratch("a.ebpo.h5"), (ebpo_codec)_i, 1, ~0u);
    ebpo_file *file = open_ok(scratch("a.ebpo.h5"));
    uint64_t head = ebpo_file_info(file)->head_bytes;
    ck_assert_uint_eq(ebpo_file_info(file)->chunk_index_bytes, 0);
    ebpo_close(file);
    uint8_t *data = slurp(scratch("a.ebpo.h5"), &size);
    unsigned missed = 0;
    for (size_t at = (size_t)head; at < size; at += ebpo_test_scale() < 1 ? 149 : 37) {
        ebpo_error error = EBPO_ERROR_INIT;
        uint8_t old = data[at];
        data[at] ^= (uint8_t)(1u << at % 8);
        spill(scratch("b.ebpo.h5"), data, size);
        missed += reads_well(scratch("b.ebpo.h5"), &error);
        data[at] = old;
    }
    ck_assert_uint_le(missed, _i == EBPO_CODEC_ZSTD ? 2 : 0);
    free(data);
    ebpo_tree_free(&tree);
}
END_TEST

/* A flipped bit in the header is refused, or has no effect (in bytes that HDF5 leaves unused). It
 * never causes a crash or other content. */
START_TEST(test_bit_flips_in_header_are_harmless)
{
    ebpo_tree tree, back;
    size_t size;
    random_tree_make(&tree, &shapes[1]);
    write_ok(&tree, scratch("a.ebpo.h5"), EBPO_CODEC_ZSTD, 1, ~0u);
    uint8_t *data = slurp(scratch("a.ebpo.h5"), &size);
    for (size_t at = 0; at < size && at < 9000; at += 13) {
        uint8_t old = data[at];
        data[at] ^= (uint8_t)(1u << at % 8);
        spill(scratch("b.ebpo.h5"), data, size);
        ebpo_file *file;
        if (ebpo_open(scratch("b.ebpo.h5"), &file, NULL) == EBPO_OK) {
            if (ebpo_file_read_tree(file, READ_BY(1), &back, NULL) == EBPO_OK) {
                same_tree(&tree, &back);
                ebpo_tree_free(&back);
            }
            ebpo_close(file);
        }
        data[at] = old;
    }
    free(data);
    ebpo_tree_free(&tree);
}
END_TEST

typedef void (*spoil_fn)(ebpo_tree *tree);
static void spoil_types(ebpo_tree *t) { t->level[1].types[0] ^= 1; }
static void spoil_root(ebpo_tree *t) { t->level[0].types[0] |= 4; }
static void spoil_first_use(ebpo_tree *t) { t->mesh.faces[0] = 1; }
static void spoil_vertex(ebpo_tree *t) { t->mesh.xyz64[3] = NAN; }
static void spoil_map(ebpo_tree *t) { t->vertex_source[1] = t->vertex_source[0]; }
static void spoil_plane(ebpo_tree *t) { t->level[3].planes[0] = UINT32_MAX; }
static void spoil_text(ebpo_tree *t) { t->info.unit[0] = '\n'; }
static void spoil_box(ebpo_tree *t) { t->info.box_origin[1] = NAN; }
static void spoil_order(ebpo_tree *t) { t->level[4].leaf_first[2]++; }
static void spoil_black(ebpo_tree *t) { t->level[4].black_winding[0] = 0; }
static void spoil_mesh(ebpo_tree *t) { t->mesh.face_count--; }
static void spoil_levels(ebpo_tree *t) { t->info.level_count = 22; }
static void spoil_refs(ebpo_tree *t)
{
    ebpo_level *l = &t->level[4];
    uint64_t at = 0, leaf = 0;
    while (l->leaf_ref_count[leaf] < 2)
        at += l->leaf_ref_count[leaf++];
    uint32_t first = l->leaf_refs[at];
    l->leaf_refs[at] = l->leaf_refs[at + 1];
    l->leaf_refs[at + 1] = first;
}
static const spoil_fn spoils[] = { spoil_refs,   spoil_types, spoil_root,  spoil_first_use,
                                   spoil_vertex, spoil_map,   spoil_plane, spoil_text,
                                   spoil_box,    spoil_order, spoil_black, spoil_mesh,
                                   spoil_levels };

START_TEST(test_writer_refuses_invalid_tree)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    random_tree_make(&tree, &shapes[2]);
    spoils[_i](&tree);
    ck_assert_int_eq(ebpo_tree_write(&tree, scratch("a.ebpo.h5"), NULL, &error), EBPO_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(error.message, "not written"));
    ck_assert_int_ne(access(scratch("a.ebpo.h5"), F_OK), 0);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_index_contradicting_arrays_is_refused)
{
    static const char *const names[] = { "types_index", "gray_index", "leaf_index" };
    ebpo_tree tree;
    ebpo_level level;
    random_tree_make(&tree, &shapes[5]);
    write_ok(&tree, scratch("a.ebpo.h5"), EBPO_CODEC_ZSTD, 2, ~0u);
    ck_assert_int_eq(ebpo_register_filters(NULL), EBPO_OK);
    hid_t fid = H5Fopen(scratch("a.ebpo.h5"), H5F_ACC_RDWR, H5P_DEFAULT);
    int number = 0;
    for (char path[64]; number < 8; number++) {
        snprintf(path, sizeof path, "/levels/%02d/%s", number, names[_i]);
        if (H5Lexists(fid, path, H5P_DEFAULT) <= 0)
            continue;
        uint64_t values[4096];
        hid_t id = H5Dopen2(fid, path, H5P_DEFAULT);
        ck_assert_int_ge(H5Dread(id, H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), 0);
        values[_i == 1 ? 1 : 4]++;
        ck_assert_int_ge(H5Dwrite(id, H5T_NATIVE_UINT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), 0);
        H5Dclose(id);
        break;
    }
    H5Fclose(fid);
    ck_assert_int_lt(number, 8);
    ebpo_file *file = open_ok(scratch("a.ebpo.h5"));
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_file_read_level(file, number, READ_BY(1), &level, &error), EBPO_E_FORMAT);
    ck_assert_ptr_nonnull(strstr(error.message, names[_i]));
    ebpo_close(file);
    ebpo_tree_free(&tree);
}
END_TEST

/* Stops after some data was written. */
static bool stop_soon(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)user;
    (void)stage;
    (void)total;
    return done == 0;
}

START_TEST(test_cancelled_writer_keeps_old_file)
{
    ebpo_tree tree;
    size_t size, again;
    random_tree_make(&tree, &shapes[3]);
    write_ok(&tree, scratch("a.ebpo.h5"), EBPO_CODEC_DEFLATE, 1, ~0u);
    uint8_t *before = slurp(scratch("a.ebpo.h5"), &size);
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    options.progress.report = stop_soon;
    ck_assert_int_eq(ebpo_tree_write(&tree, scratch("a.ebpo.h5"), &options, NULL),
                     EBPO_E_CANCELLED);
    uint8_t *after = slurp(scratch("a.ebpo.h5"), &again);
    ck_assert(size == again && memcmp(before, after, size) == 0);
    free(before);
    free(after);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_invalid_codec_and_level_are_refused)
{
    ebpo_tree tree;
    random_tree_make(&tree, &shapes[0]);
    const struct {
        ebpo_codec codec;
        int level;
        ebpo_status status;
    } cases[] = {
        { EBPO_CODEC_ZSTD, 22, EBPO_OK },        { EBPO_CODEC_ZSTD, 23, EBPO_E_ARGUMENT },
        { EBPO_CODEC_DEFLATE, 9, EBPO_OK },      { EBPO_CODEC_DEFLATE, 10, EBPO_E_ARGUMENT },
        { EBPO_CODEC_NONE, 1, EBPO_E_ARGUMENT }, { (ebpo_codec)7, 0, EBPO_E_ARGUMENT },
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
        options.codec = cases[i].codec;
        options.codec_level = cases[i].level;
        ck_assert_int_eq(ebpo_tree_write(&tree, scratch("a.ebpo.h5"), &options, NULL),
                         cases[i].status);
    }
    ebpo_write_options unknown = EBPO_WRITE_OPTIONS_INIT;
    unknown.face_coding = (ebpo_face_coding)3;
    ck_assert_int_eq(ebpo_tree_write(&tree, scratch("b.ebpo.h5"), &unknown, NULL), EBPO_E_ARGUMENT);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_foreign_files_are_identified)
{
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_open(scratch("none"), &file, &error), EBPO_E_IO);
    ck_assert_int_eq(ebpo_open(scratch(NULL), &file, &error), EBPO_E_IO);
    spill(scratch("text"), (const uint8_t *)"hello", 5);
    ck_assert_int_eq(ebpo_open(scratch("text"), &file, &error), EBPO_E_FORMAT);
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    H5Fclose(H5Fcreate(scratch("other.h5"), H5F_ACC_TRUNC, H5P_DEFAULT, fapl));
    ck_assert_int_eq(ebpo_open(scratch("other.h5"), &file, &error), EBPO_E_UNSUPPORTED);
    H5Pset_libver_bounds(fapl, H5F_LIBVER_V110, H5F_LIBVER_V110);
    H5Fclose(H5Fcreate(scratch("other.h5"), H5F_ACC_TRUNC, H5P_DEFAULT, fapl));
    H5Pclose(fapl);
    ck_assert_int_eq(ebpo_open(scratch("other.h5"), &file, &error), EBPO_E_FORMAT);
    ck_assert_ptr_nonnull(strstr(error.message, "not an EBP-Octree"));
    ck_assert_ptr_null(file);
}
END_TEST

START_TEST(test_hdf5_error_handler_is_restored)
{
    H5E_auto2_t before, after;
    void *data;
    ebpo_file *file;
    H5Eget_auto2(H5E_DEFAULT, &before, &data);
    spill(scratch("text"), (const uint8_t *)"hello", 5);
    ck_assert_int_eq(ebpo_open(scratch("text"), &file, NULL), EBPO_E_FORMAT);
    H5Eget_auto2(H5E_DEFAULT, &after, &data);
    ck_assert(before == after);
}
END_TEST

START_TEST(test_chunk_round_trip_in_all_pipelines)
{
    static ebpo_chunk_coder coder;
    static uint8_t raw[EBPO_CHUNK_BYTES_MAX], back[EBPO_CHUNK_BYTES_MAX];
    uint64_t state = 1;
    for (size_t i = 0; i < sizeof raw; i++, state = state * 6364136223846793005u + 1)
        raw[i] = (uint8_t)(state >> 60);
    for (int pipeline = EBPO_PIPELINE_ZSTD; pipeline <= EBPO_PIPELINE_BARE; pipeline++)
        for (size_t size = 1; size <= 8; size *= 2)
            for (size_t bytes = 8; bytes <= sizeof raw; bytes *= 8) {
                uint8_t *stored = malloc(ebpo_chunk_bound(bytes));
                size_t used = 0;
                const char *why;
                ck_assert_int_eq(ebpo_chunk_encode(&coder, (ebpo_pipeline)pipeline, 0, size, raw,
                                                   bytes, stored, &used),
                                 EBPO_OK);
                ck_assert_int_eq(ebpo_chunk_decode(&coder, (ebpo_pipeline)pipeline, size, stored,
                                                   used, back, bytes, &why),
                                 EBPO_OK);
                ck_assert_int_eq(memcmp(raw, back, bytes), 0);
                ck_assert_int_eq(ebpo_chunk_decode(&coder, (ebpo_pipeline)pipeline, size, stored,
                                                   used - 1, back, bytes, &why),
                                 EBPO_E_FORMAT);
                free(stored);
            }
    ebpo_chunk_coder_clear(&coder);
}
END_TEST

/* Sets the two lowest bits of the modes of sequences, which zstd ignores and no checksum covers. */
START_TEST(test_unused_frame_bits_are_refused)
{
    static const struct {
        size_t bytes, raw_bytes, modes;
        const char *frame;
    } frames[] = {
        { 29, 32, 15,
          "\x28\xb5\x2f\xfd\x24\x20\x85\x00\x00\x20\x00\x00\x01\x00\x04\x00\x29\x1c\x54\x06"
          "\x80\xc3\x2d\xc0\x02\x11\xde\x4a\xac" },
        { 41, 32, 29,
          "\x28\xb5\x2f\xfd\x24\x20\xe5\x00\x00\x90\x00\x02\x02\x01\x02\x02\x02\x01\x03\x03"
          "\x02\x02\x03\x03\x02\x02\x02\x02\x03\x00\x29\x01\x68\x1e\x56\x5b\xbc\xe6\x7c\x27\xda" },
    };
    static ebpo_chunk_coder coder;
    uint8_t stored[64], back[64];
    const char *why;
    memcpy(stored, frames[_i].frame, frames[_i].bytes);
    ck_assert_int_eq(ebpo_chunk_decode(&coder, EBPO_PIPELINE_ZSTD, 1, stored, frames[_i].bytes,
                                       back, frames[_i].raw_bytes, &why),
                     EBPO_OK);
    for (uint8_t bit = 1; bit <= 2; bit++) {
        stored[frames[_i].modes] ^= bit;
        ck_assert_int_eq(ebpo_chunk_decode(&coder, EBPO_PIPELINE_ZSTD, 1, stored, frames[_i].bytes,
                                           back, frames[_i].raw_bytes, &why),
                         EBPO_E_FORMAT);
        ck_assert_str_eq(why, "an unused bit of the zstd frame is set");
        stored[frames[_i].modes] ^= bit;
    }
    ebpo_chunk_coder_clear(&coder);
}
END_TEST

/* 4,096 numbers of ten random bits are 5,120 bytes. With one code table for all planes they would
 * take about 5,700 bytes at the default level. */
START_TEST(test_byte_planes_are_compressed_separately)
{
    static ebpo_chunk_coder coder;
    enum { COUNT = 4096, BYTES = COUNT * 4 };
    static uint8_t raw[BYTES], back[BYTES];
    uint64_t state = 1;
    for (size_t i = 0; i < COUNT; i++, state = state * 6364136223846793005u + 1)
        ebpo_store32(raw + 4 * i, (uint32_t)(state >> 54));
    uint8_t *stored = malloc(ebpo_chunk_bound(BYTES));
    size_t used = 0;
    const char *why;
    for (int level = 0; level <= 19; level += 19) {
        ck_assert_int_eq(ebpo_chunk_encode(&coder, EBPO_PIPELINE_ZSTD, level, 4, raw, BYTES, stored,
                                           &used),
                         EBPO_OK);
        ck_assert_uint_lt(used, level ? 5500 : 5400);
        ck_assert_int_eq(ebpo_chunk_decode(&coder, EBPO_PIPELINE_ZSTD, 4, stored, used, back, BYTES,
                                           &why),
                         EBPO_OK);
        ck_assert_int_eq(memcmp(raw, back, BYTES), 0);
    }
    free(stored);
    ebpo_chunk_coder_clear(&coder);
}
END_TEST

/* For empty data nothing is allocated or sorted, which sanitizers check. */
START_TEST(test_checksum_of_empty_content)
{
    /* the SHA-256 begins with these bytes */
    static const uint8_t of_nothing[4] = { 0xe3, 0xb0, 0xc4, 0x42 };
    ebpo_content content = { 0 };
    ebpo_hints expected = EBPO_HINTS_INIT(NULL);
    uint8_t digest[32];
    ck_assert_int_eq(ebpo_content_end(&content, digest, NULL), EBPO_OK);
    ck_assert_mem_eq(digest, of_nothing, sizeof of_nothing);
    ebpo_content_free(&content);
    ck_assert_uint_eq(ebpo_hints_bytes(&expected), 0);
}
END_TEST

START_TEST(test_encodings_keep_every_bit_pattern)
{
    uint32_t bits[12] = { 0,           1,           0x80000000u, 0x7fffffffu,
                          0xffffffffu, 0x7f800000u, 0xff800000u, 0x3f800000u,
                          0xbf800000u, 2,           3,           4 };
    float xyz[12], back[12];
    uint8_t file[48];
    memcpy(xyz, bits, sizeof bits);
    ebpo_points32_encode(xyz, 4, file);
    ebpo_points32_decode(file, 4, back);
    ck_assert_int_eq(memcmp(xyz, back, sizeof xyz), 0);
    ck_assert_uint_eq(ebpo_float_order32(0x80000000u), 0xffffffffu); /* -0 comes right before +0 */
    uint32_t numbers[3] = { UINT32_MAX, 0, 5 }, numbers_back[3];
    ebpo_numbers_encode(numbers, 3, file);
    ebpo_numbers_decode(file, 3, numbers_back);
    ck_assert_int_eq(memcmp(numbers, numbers_back, sizeof numbers), 0);
}
END_TEST

TEST_SUITE(container)
{
    Suite *suite = suite_create("container");
    TCase *tests = tcase_create("container"), *empty = tcase_create("empty");
    tcase_set_timeout(tests, 300);
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_add_loop_test(tests, test_tree_round_trip_is_bit_exact, 0, SHAPES);
    tcase_add_test(tests, test_file_bytes_same_for_any_threads);
    tcase_add_test(tests, test_content_checksum_ignores_codec);
    tcase_add_test(tests, test_metadata_is_in_two_blocks);
    tcase_add_test(tests, test_files_have_no_gaps);
    tcase_add_test(tests, test_libhdf5_reads_compressed_chunks);
    tcase_add_test(tests, test_omitted_parts_are_absent);
    tcase_add_loop_test(tests, test_source_order_inverts_maps, 1, 4);
    tcase_add_test(tests, test_read_only_folder_is_sufficient);
    tcase_add_test(tests, test_truncated_files_are_refused);
    tcase_add_loop_test(tests, test_bit_flips_after_header_are_detected, 0, 3);
    tcase_add_test(tests, test_bit_flips_in_header_are_harmless);
    tcase_add_loop_test(tests, test_writer_refuses_invalid_tree, 0,
                        sizeof spoils / sizeof spoils[0]);
    tcase_add_loop_test(tests, test_index_contradicting_arrays_is_refused, 0, 3);
    tcase_add_test(tests, test_cancelled_writer_keeps_old_file);
    tcase_add_test(tests, test_invalid_codec_and_level_are_refused);
    tcase_add_test(tests, test_foreign_files_are_identified);
    tcase_add_test(tests, test_hdf5_error_handler_is_restored);
    tcase_add_loop_test(tests, test_unused_frame_bits_are_refused, 0, 2);
    tcase_add_test(tests, test_byte_planes_are_compressed_separately);
    tcase_add_test(tests, test_chunk_round_trip_in_all_pipelines);
    tcase_add_test(empty, test_checksum_of_empty_content);
    tcase_add_test(tests, test_encodings_keep_every_bit_pattern);
    suite_add_tcase(suite, tests);
    suite_add_tcase(suite, empty);
    return suite;
}
