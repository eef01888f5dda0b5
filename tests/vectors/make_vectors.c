/* Makes the files of format-spec/vectors: make_vectors FOLDER. passed/ with what must be read,
 * failed/ with what must be refused and why; each failed file is a passed one with a single named
 * change. Run it when the format changes, look at the difference, and commit both. */
#include <hdf5.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ebpo/build.h>

#include "known_leaks.h"
#include "random_tree.h"
#include "solids.h"
#include "subset/subset_parts.h"
#include "tree_json.h"
#include "vector_read.h"

static const char *folder;

static void die(const char *what, const char *why)
{
    fprintf(stderr, "make_vectors: %s: %s\n", what, why);
    exit(1);
}

/* --- passed --- */

static const float tetrahedron[] = { 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1 };
static const uint32_t tetrahedron_faces[] = { 0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3 };

static ebpo_mesh make_mesh(uint64_t faces, bool doubles)
{
    ebpo_mesh mesh = { .vertex_count = 4, .face_count = faces };
    mesh.faces = malloc(sizeof tetrahedron_faces);
    memcpy(mesh.faces, tetrahedron_faces, sizeof tetrahedron_faces);
    if (doubles)
        mesh.xyz64 = malloc(12 * sizeof(double));
    else
        mesh.xyz32 = malloc(sizeof tetrahedron);
    for (int i = 0; i < 12; i++)
        if (doubles)
            mesh.xyz64[i] = tetrahedron[i] / 3.0;
        else
            mesh.xyz32[i] = tetrahedron[i];
    return mesh;
}

static void build_mesh(ebpo_tree *tree, ebpo_mesh mesh, int max_level, uint32_t leaf_faces,
                       uint32_t more_parts)
{
    ebpo_mesh_report report;
    ebpo_mend_record mend = { .weld = false };
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_progress silent = { NULL, NULL };
    ebpo_error error = EBPO_ERROR_INIT;
    options.max_level = max_level;
    options.leaf_faces = leaf_faces;
    options.parts |= more_parts;
    options.threads = 1;
    options.unit = "m";
    if (ebpo_mesh_check(&mesh, 1, silent, &report, &error) != EBPO_OK ||
        ebpo_build(&mesh, &report, &mend, &options, tree, &error) != EBPO_OK)
        die("build", error.message);
}

static void build(ebpo_tree *tree, uint64_t faces, bool doubles, int max_level, uint32_t leaf_faces,
                  uint32_t more_parts)
{
    build_mesh(tree, make_mesh(faces, doubles), max_level, leaf_faces, more_parts);
}

/* Several chunks of faces and of vertices. */
static void build_torus(ebpo_tree *tree, uint32_t around, uint32_t across, uint32_t leaf_faces,
                        uint32_t more_parts)
{
    ebpo_mesh mesh = ebpo_test_torus(1, 0.375, around, across);
    ebpo_test_to_float(&mesh);
    build_mesh(tree, mesh, 5, leaf_faces, more_parts);
}

static void write_laid_out(const char *name, ebpo_tree *tree, ebpo_codec codec, uint32_t parts,
                           uint64_t subtree_faces)
{
    char path[512];
    ebpo_tree back;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    options.codec = codec;
    options.parts = parts;
    options.subtree_faces = subtree_faces;
    snprintf(tree->info.generator, sizeof tree->info.generator, "make_vectors");
    snprintf(path, sizeof path, "%s/passed/%s.ebpo.h5", folder, name);
    if (ebpo_tree_write(tree, path, &options, &error) != EBPO_OK ||
        vector_read(path, &back, &error) != EBPO_OK)
        die(name, error.message);
    snprintf(path, sizeof path, "%s/passed/%s.json", folder, name);
    FILE *out = fopen(path, "w");
    if (!out)
        die(path, "cannot be written");
    tree_json(out, &back);
    fclose(out);
    ebpo_tree_free(&back);
    ebpo_tree_free(tree);
}

static void write_vector(const char *name, ebpo_tree *tree, ebpo_codec codec, uint32_t parts)
{
    write_laid_out(name, tree, codec, parts, 0);
}

/* A part of the file of vector 06. */
static void subset(ebpo_tree *tree, const ebpo_subset_options *options)
{
    char path[512];
    ebpo_file *whole;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(path, sizeof path, "%s/passed/06_four_levels_leaf_planes.ebpo.h5", folder);
    if (ebpo_open(path, &whole, &error) != EBPO_OK ||
        ebpo_subset_tree(tree, whole, options, &error) != EBPO_OK)
        die(path, error.message);
    ebpo_close(whole);
}

/* In an order in which each needs only what those before it have shown. */
static void make_passed(void)
{
    ebpo_tree tree;
    build(&tree, 4, false, 0, 16, 0);
    write_vector("01_one_leaf_unfiltered", &tree, EBPO_CODEC_NONE, ~0u);
    build(&tree, 4, false, 0, 16, 0);
    write_vector("02_one_leaf_deflate", &tree, EBPO_CODEC_DEFLATE, ~0u);
    build(&tree, 4, false, 0, 16, 0);
    write_vector("03_one_leaf", &tree, EBPO_CODEC_ZSTD, ~0u);
    build(&tree, 4, true, 0, 16, 0);
    write_vector("04_doubles", &tree, EBPO_CODEC_ZSTD, ~0u);
    build(&tree, 4, false, 1, 0, 0);
    write_vector("05_two_levels", &tree, EBPO_CODEC_ZSTD, ~0u);
    build(&tree, 4, false, 3, 1, EBPO_PART_LEAF_PLANES);
    write_vector("06_four_levels_leaf_planes", &tree, EBPO_CODEC_ZSTD, ~0u);
    build(&tree, 3, false, 2, 1, 0);
    write_vector("07_surface", &tree, EBPO_CODEC_ZSTD, ~0u);
    build(&tree, 4, false, 2, 1, 0);
    write_vector("08_without_mesh", &tree, EBPO_CODEC_ZSTD, EBPO_PART_PLANES);
    build(&tree, 4, false, 2, 1, 0);
    write_vector("09_without_maps", &tree, EBPO_CODEC_ZSTD, EBPO_PART_PLANES | EBPO_PART_MESH);
    random_tree_options odd = { 11, 4, 6, 4, true, false, true, false };
    random_tree_make(&tree, &odd);
    write_vector("10_windings_of_all_sizes", &tree, EBPO_CODEC_ZSTD, ~0u);
    random_tree_options many = { 12, 3, 9, 600, true, false, false, false };
    random_tree_make(&tree, &many);
    write_vector("11_two_chunks_of_faces", &tree, EBPO_CODEC_ZSTD, EBPO_PART_MESH);
    ebpo_subset_options levels = EBPO_SUBSET_OPTIONS_INIT, box = EBPO_SUBSET_OPTIONS_INIT;
    levels.last_level = 1;
    levels.parts = EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES;
    subset(&tree, &levels);
    write_vector("12_subset_levels", &tree, EBPO_CODEC_ZSTD, ~0u);
    box.boxed = true;
    for (int k = 0; k < 3; k++)
        box.max[k] = 0.2;
    subset(&tree, &box);
    write_vector("13_subset_box", &tree, EBPO_CODEC_ZSTD, ~0u);
    build(&tree, 4, false, 3, 1, EBPO_PART_LEAF_PLANES);
    write_laid_out("14_subtrees", &tree, EBPO_CODEC_ZSTD, ~0u, 1);
    build(&tree, 4, false, 3, 1, EBPO_PART_LEAF_PLANES);
    write_laid_out("15_subtrees_unfiltered", &tree, EBPO_CODEC_NONE, ~0u, 1);
    build_torus(&tree, 80, 32, 6, EBPO_PART_LEAF_PLANES);
    write_laid_out("16_many_subtrees", &tree, EBPO_CODEC_ZSTD, ~0u, 10);
    build_torus(&tree, 36, 30, 16, 0);
    write_laid_out("17_chunks_of_subtrees_unfiltered", &tree, EBPO_CODEC_NONE,
                   EBPO_PART_PLANES | EBPO_PART_MESH, 10);
}

/* --- failed --- */

static hid_t file; /* the copy that is being changed */

static void need(bool ok, const char *what)
{
    if (!ok)
        die("libhdf5", what);
}

static void set_text(const char *object, const char *name, const char *text)
{
    hid_t id = H5Oopen(file, object, H5P_DEFAULT), type = H5Tcopy(H5T_C_S1),
          space = H5Screate(H5S_SCALAR);
    H5Tset_size(type, strlen(text));
    H5Tset_strpad(type, H5T_STR_NULLPAD);
    H5Tset_cset(type, H5T_CSET_UTF8);
    if (H5Aexists(id, name) > 0)
        H5Adelete(id, name);
    hid_t attribute = H5Acreate2(id, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    need(H5Awrite(attribute, type, text) >= 0, name);
    H5Aclose(attribute);
    H5Sclose(space);
    H5Tclose(type);
    H5Oclose(id);
}

static void set_number(const char *object, const char *name, hid_t type, int64_t value)
{
    hid_t id = H5Oopen(file, object, H5P_DEFAULT), attribute = H5Aopen(id, name, H5P_DEFAULT);
    need(H5Awrite(attribute, type, &value) >= 0, name);
    H5Aclose(attribute);
    H5Oclose(id);
}
static void set_int(const char *object, const char *name, int64_t value)
{
    set_number(object, name, H5T_NATIVE_INT64, value);
}
static void set_count(const char *object, const char *name, int64_t value)
{
    set_number(object, name, H5T_NATIVE_UINT64, value);
}

static void set_reals(const char *name, double a, double b, double c)
{
    double values[3] = { a, b, c };
    hid_t attribute = H5Aopen_by_name(file, "/", name, H5P_DEFAULT, H5P_DEFAULT);
    need(H5Awrite(attribute, H5T_NATIVE_DOUBLE, values) >= 0, name);
    H5Aclose(attribute);
}

static void add_count(const char *object, const char *name, uint64_t value)
{
    hid_t space = H5Screate(H5S_SCALAR),
          attribute = H5Acreate_by_name(file, object, name, H5T_STD_U64LE, space, H5P_DEFAULT,
                                        H5P_DEFAULT, H5P_DEFAULT);
    need(attribute >= 0 && H5Awrite(attribute, H5T_NATIVE_UINT64, &value) >= 0, name);
    H5Aclose(attribute);
    H5Sclose(space);
}

static void drop_attribute(const char *object, const char *name)
{
    need(H5Adelete_by_name(file, object, name, H5P_DEFAULT) >= 0, name);
}
static void drop(const char *path) { need(H5Ldelete(file, path, H5P_DEFAULT) >= 0, path); }

/* One value of an array, counted row by row. */
static void poke(const char *path, unsigned at, int64_t value)
{
    int64_t *values = calloc(1 << 20, sizeof *values);
    hid_t id = H5Dopen2(file, path, H5P_DEFAULT);
    need(H5Dread(id, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, path);
    values[at] = value;
    need(H5Dwrite(id, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, path);
    H5Dclose(id);
    free(values);
}

/* An array in place of another: `chunk` 0 stands for contiguous storage, `limit` 0 for unlimited
 * rows. */
static void replace(const char *path, hid_t type, hsize_t rows, hsize_t cols, hsize_t chunk,
                    hsize_t limit, void (*filters)(hid_t))
{
    hsize_t dims[2] = { rows, cols }, most[2] = { limit ? limit : H5S_UNLIMITED, cols },
            chunks[2] = { chunk, cols };
    static const int64_t zeros[4096];
    int rank = cols ? 2 : 1;
    drop(path);
    hid_t space = H5Screate_simple(rank, dims, most), dcpl = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_obj_track_times(dcpl, false);
    if (chunk)
        H5Pset_chunk(dcpl, rank, chunks);
    if (filters)
        filters(dcpl);
    hid_t id = H5Dcreate2(file, path, type, space, H5P_DEFAULT, dcpl, H5P_DEFAULT);
    need(id >= 0 && H5Dwrite(id, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, zeros) >= 0,
         path);
    H5Dclose(id);
    H5Pclose(dcpl);
    H5Sclose(space);
}

static void checksum(hid_t dcpl) { H5Pset_fletcher32(dcpl); }
static void scale_offset(hid_t dcpl)
{
    H5Pset_scaleoffset(dcpl, H5Z_SO_INT, H5Z_SO_INT_MINBITS_DEFAULT);
}

static haddr_t chunk_address(const char *path, hsize_t *size)
{
    hsize_t at[2] = { 0, 0 };
    unsigned mask;
    haddr_t address;
    hid_t id = H5Dopen2(file, path, H5P_DEFAULT);
    need(H5Dget_chunk_info_by_coord(id, at, &mask, &address, size) >= 0, path);
    H5Dclose(id);
    return address;
}

#define LEAVES    "05_two_levels"
#define DEEP      "06_four_levels_leaf_planes"
#define ODD       "10_windings_of_all_sizes"
#define LONG      "11_two_chunks_of_faces"
#define CUT_SHORT "12_subset_levels"
#define BOXED     "13_subset_box"
#define SUBTREES  "15_subtrees_unfiltered"
#define CHUNKS    "17_chunks_of_subtrees_unfiltered"

static void v_format(void) { set_text("/", "format", "EBP-Octree in HDF6"); }
static void v_format_missing(void) { drop_attribute("/", "format"); }
static void v_draft(void) { set_text("/", "format_version", "1.0-draft"); }
static void v_major(void) { set_int("/", "format_version_major", 2); }
static void v_required(void) { set_text("/", "required_parts", "levels mesh animation"); }
static void v_no_levels_part(void) { set_text("/", "required_parts", "mesh"); }
static void v_part_twice(void) { set_text("/", "optional_parts", "planes planes"); }
static void v_subset_word(void) { set_text("/", "required_parts", "levels mesh"); }
static void v_subset_of(void) { drop_attribute("/", "subset_of"); }
static void v_subset_level(void) { set_int("/", "subset_levels", 0); }
static void v_pruned_more(void) { set_count("/levels/01", "pruned", 99); }
static void v_pruned_less(void) { drop_attribute("/levels/01", "pruned"); }
static void v_pruned_whole(void) { add_count("/levels/01", "pruned", 1); }
static void v_attribute_missing(void) { drop_attribute("/", "epsilon"); }
static void v_attribute_type(void)
{
    drop_attribute("/", "face_count");
    set_text("/", "face_count", "4");
}
static void v_kind(void) { set_text("/", "kind", "liquid"); }
static void v_control(void) { set_text("/", "unit", "m\nm"); }
static void v_digest_text(void) { set_text("/", "content_sha256", "none"); }
static void v_nan_box(void) { set_reals("box_origin", 0, NAN, 0); }
static void v_flat_box(void) { set_reals("box_size", 1, 0, 1); }
static void v_inexact_box(void) { set_reals("box_size", 1.1, 1.3, 1.7); }
static void v_level_count(void) { set_int("/", "level_count", 22); }
static void v_level_beyond(void) { set_int("/", "level_count", 3); }
static void v_max_level(void) { set_int("/", "max_level", 0); }
static void v_faces_huge(void) { set_count("/", "face_count", (int64_t)1 << 40); }
static void v_faces_more(void) { set_count("/", "face_count", 5); }
static void v_source_less(void) { set_count("/", "source_vertex_count", 3); }
static void v_gray_deep(void) { set_count("/levels/01", "gray", 1); }
static void v_nodes(void) { set_count("/levels/01", "white", 77); }
static void v_planes_many(void) { set_count("/levels/00", "planes", 256); }
static void v_planes_count(void) { set_count("/levels/00", "planes", 200); }
static void v_new_sum(void) { set_count("/levels/01", "faces_new", 3); }
static void v_level_missing(void) { drop("/levels/01"); }
static void v_array_missing(void) { drop("/mesh/faces"); }
static void v_group_for_array(void)
{
    hid_t plist = H5Pcreate(H5P_GROUP_CREATE);
    H5Pset_obj_track_times(plist, false);
    drop("/mesh/faces");
    H5Gclose(H5Gcreate2(file, "/mesh/faces", H5P_DEFAULT, plist, H5P_DEFAULT));
    H5Pclose(plist);
}
static void v_subtree_level(void) { set_int("/", "subtree_level", 0); }
static void v_subtree_table(void) { drop("/subtrees/counts"); }
/* Its bytes stay, so that it still holds for a reader. */
static void v_places_array(void) { poke("/subtrees/places", 1, INT64_C(4097) << 32 | 8); }
static void v_places_bytes(void) { poke("/subtrees/places", 1, 1 << 30); }
static void v_soft_link(void)
{
    drop("/mesh/faces");
    need(H5Lcreate_soft("/levels/00/types", file, "/mesh/faces", H5P_DEFAULT, H5P_DEFAULT) >= 0,
         "link");
}
static void v_external_link(void)
{
    drop("/mesh");
    need(H5Lcreate_external("03_one_leaf.ebpo.h5", "/mesh", file, "/mesh", H5P_DEFAULT,
                            H5P_DEFAULT) >= 0,
         "link");
}
static void v_big_endian(void) { replace("/mesh/faces", H5T_STD_U32BE, 4, 3, 4, 4, checksum); }
static void v_signed(void) { replace("/mesh/faces", H5T_STD_I32LE, 4, 3, 4, 4, checksum); }
static void v_float(void) { replace("/mesh/vertices", H5T_IEEE_F32LE, 4, 3, 4, 4, checksum); }
static void v_wide(void) { replace("/mesh/vertices", H5T_STD_U64LE, 4, 3, 4, 4, checksum); }
static void v_shape(void) { replace("/mesh/faces", H5T_STD_U32LE, 4, 2, 4, 4, checksum); }
static void v_length(void) { replace("/mesh/faces", H5T_STD_U32LE, 5, 3, 5, 5, checksum); }
static void v_chunk(void) { replace("/mesh/faces", H5T_STD_U32LE, 4, 3, 2, 4, checksum); }
static void v_contiguous(void) { replace("/mesh/faces", H5T_STD_U32LE, 4, 3, 0, 4, NULL); }
static void v_unlimited(void) { replace("/mesh/faces", H5T_STD_U32LE, 4, 3, 4, 0, checksum); }
static void v_filter(void) { replace("/mesh/faces", H5T_STD_U32LE, 4, 3, 4, 4, scale_offset); }
static void v_root_siblings(void) { poke("/levels/00/types", 0, 3 | 2 << 2); }
static void v_types(void) { poke("/levels/01/types", 0, 0); }
static void v_types_gray(void) { poke("/levels/01/types", 0, 0xffff); }
static void v_plane_code(void) { poke("/levels/00/planes", 0, 0xffffffff); }
static void v_plane_counts(void) { poke("/levels/00/plane_counts", 0, 0); }
static void v_leaf_plane(void) { poke("/levels/03/leaf_planes", 0, 0xfff00000); }
static void v_skip(void) { poke("/levels/01/leaf_skip", 0, 1); }
static void v_skip_far(void) { poke("/levels/01/leaf_skip", 0, 0xffffffff); }
static void v_leaf_new(void) { poke("/levels/01/leaf_new", 0, 200); }
static void v_ref_counts(void) { poke("/levels/01/leaf_ref_count", 0, 200); }
static void v_refs(void) { poke("/levels/01/leaf_refs", 0, 4); }
static void v_order(void) { poke("/levels/02/leaf_skip", 1, 46); }
static void v_black(void) { poke("/levels/03/black_winding", 0, 2); }
static void v_white(void) { poke("/levels/03/white_winding", 0, 1); }
static void v_nan(void) { poke("/mesh/vertices", 0, (int64_t)0x7fc00000u << 1); }
static void v_corner(void) { poke("/mesh/faces", 11, 9); }
static void v_corner_first(void) { poke("/mesh/faces", 0, 1); }
static void v_faces_index(void) { poke("/mesh/faces_index", 1, 3); }
static void v_map_twice(void) { poke("/maps/face_source", 1, 0); }
static void v_map_far(void) { poke("/maps/vertex_source", 0, 200); }
static void v_content(void) { poke("/mesh/vertices", 0, 2); }

typedef enum late_change { NONE, CUT, FLIP_CHUNK, FLIP_HEAD, SWAP_CHUNK, NOT_HDF5 } late_change;

typedef struct failed_vector {
    const char *name, *base;
    void (*change)(void);
    late_change late; /* to the bytes, when the file is closed */
} failed_vector;

static const failed_vector failed[] = {
    { "not_hdf5", LEAVES, NULL, NOT_HDF5 },
    { "cut_off", LEAVES, NULL, CUT },
    { "head_bit_flipped", LEAVES, NULL, FLIP_HEAD },
    { "format_wrong", LEAVES, v_format, NONE },
    { "format_missing", LEAVES, v_format_missing, NONE },
    { "version_major_2", LEAVES, v_major, NONE },
    { "version_draft", LEAVES, v_draft, NONE },
    { "required_part_unknown", LEAVES, v_required, NONE },
    { "required_part_levels_missing", LEAVES, v_no_levels_part, NONE },
    { "part_listed_twice", LEAVES, v_part_twice, NONE },
    { "subset_without_its_word", BOXED, v_subset_word, NONE },
    { "subset_of_missing", BOXED, v_subset_of, NONE },
    { "subset_levels_0", CUT_SHORT, v_subset_level, NONE },
    { "pruned_more_than_gray", BOXED, v_pruned_more, NONE },
    { "pruned_not_counted", BOXED, v_pruned_less, NONE },
    { "subtree_level_0", SUBTREES, v_subtree_level, NONE },
    { "subtree_table_missing", SUBTREES, v_subtree_table, NONE },
    { "places_of_another_array", CHUNKS, v_places_array, NONE },
    { "places_of_impossible_bytes", CHUNKS, v_places_bytes, NONE },
    { "pruned_in_a_whole_file", DEEP, v_pruned_whole, NONE },
    { "attribute_missing", LEAVES, v_attribute_missing, NONE },
    { "attribute_of_wrong_type", LEAVES, v_attribute_type, NONE },
    { "kind_unknown", LEAVES, v_kind, NONE },
    { "unit_with_control_character", LEAVES, v_control, NONE },
    { "digest_not_hexadecimal", LEAVES, v_digest_text, NONE },
    { "box_nan", LEAVES, v_nan_box, NONE },
    { "box_flat", LEAVES, v_flat_box, NONE },
    { "box_inexact", LEAVES, v_inexact_box, NONE },
    { "level_count_22", LEAVES, v_level_count, NONE },
    { "level_count_beyond_levels", LEAVES, v_level_beyond, NONE },
    { "max_level_below_levels", LEAVES, v_max_level, NONE },
    { "face_count_huge", LEAVES, v_faces_huge, NONE },
    { "face_count_beyond_source", LEAVES, v_faces_more, NONE },
    { "vertex_count_beyond_source", LEAVES, v_source_less, NONE },
    { "gray_at_deepest_level", LEAVES, v_gray_deep, NONE },
    { "nodes_do_not_add_up", LEAVES, v_nodes, NONE },
    { "planes_more_than_nodes_can_have", LEAVES, v_planes_many, NONE },
    { "planes_count_wrong", DEEP, v_planes_count, NONE },
    { "new_faces_do_not_add_up", LEAVES, v_new_sum, NONE },
    { "level_missing", LEAVES, v_level_missing, NONE },
    { "array_missing", LEAVES, v_array_missing, NONE },
    { "group_in_place_of_array", LEAVES, v_group_for_array, NONE },
    { "soft_link_in_place_of_array", LEAVES, v_soft_link, NONE },
    { "external_link_in_place_of_group", LEAVES, v_external_link, NONE },
    { "array_big_endian", LEAVES, v_big_endian, NONE },
    { "array_signed", LEAVES, v_signed, NONE },
    { "array_of_floats", LEAVES, v_float, NONE },
    { "vertices_of_other_width", LEAVES, v_wide, NONE },
    { "array_with_two_columns", LEAVES, v_shape, NONE },
    { "array_too_long", LEAVES, v_length, NONE },
    { "array_with_other_chunks", LEAVES, v_chunk, NONE },
    { "array_contiguous", LEAVES, v_contiguous, NONE },
    { "array_unlimited", LEAVES, v_unlimited, NONE },
    { "array_with_other_filter", LEAVES, v_filter, NONE },
    { "chunk_bit_flipped", LEAVES, NULL, FLIP_CHUNK },
    { "chunk_frame_of_other_size", LEAVES, NULL, SWAP_CHUNK },
    { "root_with_siblings", LEAVES, v_root_siblings, NONE },
    { "types_contradict_counts", LEAVES, v_types, NONE },
    { "types_gray_at_deepest_level", LEAVES, v_types_gray, NONE },
    { "plane_code_of_no_plane", DEEP, v_plane_code, NONE },
    { "plane_counts_wrong", DEEP, v_plane_counts, NONE },
    { "leaf_plane_code_of_no_plane", DEEP, v_leaf_plane, NONE },
    { "leaf_skip_beyond_faces", LEAVES, v_skip, NONE },
    { "leaf_skip_far_beyond_faces", LEAVES, v_skip_far, NONE },
    { "leaf_new_too_large", LEAVES, v_leaf_new, NONE },
    { "leaf_ref_count_too_large", LEAVES, v_ref_counts, NONE },
    { "leaf_ref_not_before_first", LEAVES, v_refs, NONE },
    { "leaves_out_of_depth_first_order", ODD, v_order, NONE },
    { "black_node_outside", ODD, v_black, NONE },
    { "white_node_inside", ODD, v_white, NONE },
    { "vertex_nan", LEAVES, v_nan, NONE },
    { "face_vertex_below_zero", LEAVES, v_corner, NONE },
    { "face_vertex_before_first_use", LEAVES, v_corner_first, NONE },
    { "faces_index_wrong", LONG, v_faces_index, NONE },
    { "map_number_twice", LEAVES, v_map_twice, NONE },
    { "map_number_out_of_range", LEAVES, v_map_far, NONE },
    { "content_changed", LEAVES, v_content, NONE },
};

static uint8_t *slurp(const char *path, size_t *size)
{
    FILE *in = fopen(path, "rb");
    struct stat facts;
    if (!in || fstat(fileno(in), &facts) != 0)
        die(path, "cannot be read");
    *size = (size_t)facts.st_size;
    uint8_t *data = malloc(*size);
    if (fread(data, 1, *size, in) != *size)
        die(path, "cannot be read");
    fclose(in);
    return data;
}

static void spill(const char *path, const void *data, size_t size)
{
    FILE *out = fopen(path, "wb");
    if (!out || fwrite(data, 1, size, out) != size || fclose(out) != 0)
        die(path, "cannot be written");
}

static void change_bytes(const char *path, late_change late)
{
    size_t size;
    hsize_t chunk_size = 0, other_size = 0;
    uint8_t *data = slurp(path, &size);
    file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    haddr_t faces = chunk_address("/mesh/faces", &chunk_size),
            types = chunk_address("/levels/00/types", &other_size);
    H5Fclose(file);
    switch (late) {
    case CUT: size -= 40; break;
    case FLIP_CHUNK: data[faces + chunk_size / 2] ^= 16; break;
    case FLIP_HEAD: data[60] ^= 16; break;
    case SWAP_CHUNK: memcpy(data + faces, data + types, other_size); break;
    case NOT_HDF5: memset(data, ' ', size = 64); break;
    case NONE: break;
    }
    spill(path, data, size);
    free(data);
}

static void change_objects(const char *path, void (*change)(void))
{
    hid_t fapl = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_libver_bounds(fapl, H5F_LIBVER_V110, H5F_LIBVER_V110);
    H5Pset_fclose_degree(fapl, H5F_CLOSE_STRONG);
    file = H5Fopen(path, H5F_ACC_RDWR, fapl);
    need(file >= 0, path);
    change();
    H5Fclose(file);
    H5Pclose(fapl);
}

static void make_failed(const failed_vector *v)
{
    char from[512], path[512], text[1024];
    size_t size;
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(from, sizeof from, "%s/passed/%s.ebpo.h5", folder, v->base);
    snprintf(path, sizeof path, "%s/failed/%s.ebpo.h5", folder, v->name);
    uint8_t *data = slurp(from, &size);
    spill(path, data, size);
    free(data);
    if (v->change)
        change_objects(path, v->change);
    if (v->late != NONE)
        change_bytes(path, v->late);
    if (vector_read(path, &tree, &error) == EBPO_OK)
        die(v->name, "is read without an error");
    vector_outcome(path, &error, text, sizeof text);
    snprintf(path, sizeof path, "%s/failed/%s.txt", folder, v->name);
    spill(path, text, strlen(text));
}

int main(int argc, char **argv)
{
    char path[512];
    if (argc != 2)
        die("usage", "make_vectors FOLDER");
    folder = argv[1];
    H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
    snprintf(path, sizeof path, "%s/passed", folder);
    mkdir(path, 0777);
    snprintf(path, sizeof path, "%s/failed", folder);
    mkdir(path, 0777);
    if (ebpo_register_filters(NULL) != EBPO_OK)
        die("zstd", "no filter");
    make_passed();
    for (size_t i = 0; i < sizeof failed / sizeof failed[0]; i++)
        make_failed(&failed[i]);
    return 0;
}
