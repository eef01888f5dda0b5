/* Makes the passed vectors, in an order in which each needs only features of earlier ones. Vector
 * 20 is a file of version 1.0, which no longer changes and is not made here. */
#include "make_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>

#include "attributes_json.h"
#include "mesh/textures.h"
#include "core/checksum.h"
#include "change_file.h"
#include "hdf5_read/chunk.h"
#include "hdf5_read/face_gates.h"
#include "nodes_json.h"
#include "mesh/ply.h"
#include "solids.h"
#include "construct/construct_stages.h"
#include "derive/subset_parts.h"
#include "tree_json.h"
#include "vector_read.h"

static const char *folder;

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

/* Differences between vectors. */
typedef struct how {
    int max_level;
    uint32_t leaf_faces, more_parts;
    ebpo_rule rule;
    bool fill_holes, drop_duplicates;
    double weld_distance;
} how;

static void build_mesh(ebpo_tree *tree, ebpo_mesh mesh, how h)
{
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_prepare_options prepare = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    prepare.threads = options.threads = 1;
    prepare.fill_holes = h.fill_holes;
    prepare.drop_duplicates = h.drop_duplicates;
    prepare.weld_distance = h.weld_distance;
    options.max_level = h.max_level;
    options.leaf_faces = h.leaf_faces;
    options.parts = (options.parts & ~(uint32_t)EBPO_PART_BORDER) | h.more_parts;
    options.rule = h.rule;
    options.unit = "m";
    if (ebpo_mesh_prepare(&mesh, &prepare, &prepared, &error) != EBPO_OK ||
        ebpo_build(&mesh, &prepared.report, &prepared.record, &options, tree, &error) != EBPO_OK)
        die("build", error.message);
}

static void build(ebpo_tree *tree, uint64_t faces, bool doubles, int max_level, uint32_t leaf_faces,
                  uint32_t more_parts)
{
    build_mesh(tree, make_mesh(faces, doubles),
               (how){ max_level, leaf_faces, more_parts, 0, 0, 0, 0 });
}

static void build_float(ebpo_tree *tree, ebpo_mesh mesh, how h)
{
    ebpo_test_to_float(&mesh);
    build_mesh(tree, mesh, h);
}

/* Makes a tetrahedron of size 1, `outer` times, wound inwards if negative; and `inner` times a box
 * that contains a cell of level 4 beside an edge. */
static ebpo_mesh nested(int outer, int inner)
{
    static const double low[3] = { 0.05, 0.05, 0.24 }, high[3] = { 0.13, 0.13, 0.33 };
    ebpo_mesh mesh = ebpo_test_tetrahedron(1), second = ebpo_test_box(low, high, 1);
    uint64_t shell = mesh.face_count, count = (uint64_t)abs(outer) * shell;
    if (outer < 0)
        ebpo_test_reverse(&mesh);
    mesh.faces = realloc(mesh.faces, count * 3 * sizeof *mesh.faces);
    for (uint64_t i = 3 * shell; i < 3 * count; i++)
        mesh.faces[i] = mesh.faces[i - 3 * shell];
    mesh.face_count = count;
    for (int i = 0; i < inner; i++)
        ebpo_test_append(&mesh, &second);
    ebpo_mesh_free(&second);
    return mesh;
}

static void write_json(const char *name, const ebpo_tree *tree)
{
    char path[512];
    snprintf(path, sizeof path, "%s/passed/%s.json", folder, name);
    FILE *out = fopen(path, "w");
    if (!out)
        die(path, "cannot be written");
    tree_json(out, tree);
    fclose(out);
    if (tree->mesh.attributes) {
        snprintf(path, sizeof path, "%s/passed/%s.attributes.json", folder, name);
        out = fopen(path, "w");
        if (!out)
            die(path, "cannot be written");
        attributes_json(out, tree->mesh.attributes);
        fclose(out);
    }
    if (!nodes_json_fits(tree))
        return;
    snprintf(path, sizeof path, "%s/passed/%s.ebpo.h5", folder, name);
    char *text = nodes_json(path, tree);
    snprintf(path, sizeof path, "%s/passed/%s.nodes.json", folder, name);
    spill(path, text, strlen(text));
    free(text);
}

static void write_file(const char *name, ebpo_tree *tree, const ebpo_write_options *options)
{
    char path[512];
    ebpo_tree back;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(tree->info.generator, sizeof tree->info.generator, "make_vectors");
    snprintf(path, sizeof path, "%s/passed/%s.ebpo.h5", folder, name);
    if (ebpo_tree_write(tree, path, options, &error) != EBPO_OK ||
        vector_read(path, &back, &error) != EBPO_OK)
        die(name, error.message);
    write_json(name, &back);
    ebpo_tree_free(&back);
    ebpo_tree_free(tree);
}

static ebpo_write_options laid_out(ebpo_codec codec, uint32_t parts, uint64_t subtree_faces)
{
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    options.codec = codec;
    options.parts = parts;
    options.subtree_faces = subtree_faces;
    options.face_coding = EBPO_FACES_HIGH_WATER;
    options.chunk_checksums = EBPO_CHECKSUMS_NONE; /* only vectors about them have them */
    return options;
}

static void write_laid_out(const char *name, ebpo_tree *tree, ebpo_codec codec, uint32_t parts,
                           uint64_t subtree_faces)
{
    ebpo_write_options options = laid_out(codec, parts, subtree_faces);
    write_file(name, tree, &options);
}

static void write_vector(const char *name, ebpo_tree *tree, ebpo_codec codec, uint32_t parts)
{
    write_laid_out(name, tree, codec, parts, 0);
}

/* Makes a passed vector as left by another program, or a later version; `behind`: bytes after the
 * HDF5 file. */
static void derive_longer(const char *name, const char *base, void (*change)(void), size_t behind)
{
    char path[512];
    size_t size;
    ebpo_tree back;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(path, sizeof path, "%s/passed/%s.ebpo.h5", folder, base);
    uint8_t *data = slurp(path, &size);
    snprintf(path, sizeof path, "%s/passed/%s.ebpo.h5", folder, name);
    spill(path, data, size);
    free(data);
    change_objects(path, change);
    data = slurp(path, &size);
    data = realloc(data, size + behind);
    memset(data + size, 0, behind);
    spill(path, data, size + behind);
    free(data);
    if (vector_read(path, &back, &error) != EBPO_OK)
        die(name, error.message);
    write_json(name, &back);
    ebpo_tree_free(&back);
}

static void derive(const char *name, const char *base, void (*change)(void))
{
    derive_longer(name, base, change, 0);
}

static void subset(ebpo_tree *tree, const char *base, const ebpo_subset_options *options)
{
    char path[512];
    ebpo_file *whole;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(path, sizeof path, "%s/passed/%s.ebpo.h5", folder, base);
    if (ebpo_open(path, &whole, &error) != EBPO_OK ||
        ebpo_subset_tree(tree, whole, options, &error) != EBPO_OK)
        die(path, error.message);
    ebpo_close(whole);
}

static void make_small(void)
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
    build_float(&tree, nested(128, 1), (how){ 4, 130, 0, EBPO_RULE_EVENODD, 0, 0, 0 });
    write_vector("10_windings_of_two_bytes", &tree, EBPO_CODEC_ZSTD, ~0u);
    build_float(&tree, ebpo_test_torus(1, 0.375, 80, 32), (how){ 4, 64, 0, 0, 0, 0, 0 });
    write_vector("11_two_chunks_of_faces", &tree, EBPO_CODEC_ZSTD, EBPO_PART_MESH);
}

static void make_subsets(void)
{
    ebpo_tree tree;
    ebpo_subset_options levels = EBPO_SUBSET_OPTIONS_INIT, box = EBPO_SUBSET_OPTIONS_INIT;
    levels.last_level = 1;
    levels.parts = EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES;
    subset(&tree, "06_four_levels_leaf_planes", &levels);
    write_vector("12_subset_levels", &tree, EBPO_CODEC_ZSTD, ~0u);
    box.boxed = true;
    for (int k = 0; k < 3; k++)
        box.max[k] = 0.2;
    subset(&tree, "06_four_levels_leaf_planes", &box);
    write_vector("13_subset_box", &tree, EBPO_CODEC_ZSTD, ~0u);
}

static void make_subtrees(void)
{
    ebpo_tree tree;
    build(&tree, 4, false, 3, 1, EBPO_PART_LEAF_PLANES);
    write_laid_out("14_subtrees", &tree, EBPO_CODEC_ZSTD, ~0u, 1);
    build(&tree, 4, false, 3, 1, EBPO_PART_LEAF_PLANES);
    write_laid_out("15_subtrees_unfiltered", &tree, EBPO_CODEC_NONE, ~0u, 1);
    build_float(&tree, ebpo_test_torus(1, 0.375, 80, 32),
                (how){ 5, 6, EBPO_PART_LEAF_PLANES, 0, 0, 0, 0 });
    write_laid_out("16_many_subtrees", &tree, EBPO_CODEC_ZSTD, ~0u, 10);
    build_float(&tree, ebpo_test_torus(1, 0.375, 36, 30), (how){ 5, 16, 0, 0, 0, 0, 0 });
    write_laid_out("17_chunks_of_subtrees_unfiltered", &tree, EBPO_CODEC_NONE,
                   EBPO_PART_PLANES | EBPO_PART_MESH, 10);
}

/* --- files of other programs and other versions --- */

static void without_filters(void)
{
    static const char *const paths[] = {
        "/levels/00/types",    "/levels/00/leaf_winding",   "/levels/00/leaf_skip",
        "/levels/00/leaf_new", "/levels/00/leaf_ref_count", "/mesh/vertices",
        "/mesh/faces",         "/maps/vertex_source",       "/maps/face_source"
    };
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++)
        refilter(paths[i], NULL);
}

static void of_a_later_version(void)
{
    hid_t plist = H5Pcreate(H5P_GROUP_CREATE);
    H5Pset_obj_track_times(plist, false);
    set_text("/", "format_version", "1.99");
    set_int("/", "format_version_minor", 99);
    set_text("/", "optional_parts", "planes maps x-example.org-scans seasons");
    set_text("/", "x-example.org-operator", "nobody");
    H5Gclose(H5Gcreate2(changed, "/x-example.org-scans", H5P_DEFAULT, plist, H5P_DEFAULT));
    H5Gclose(H5Gcreate2(changed, "/seasons", H5P_DEFAULT, plist, H5P_DEFAULT));
    set_text("/seasons", "about", "a part that this version does not know");
    H5Pclose(plist);
}

/* The arrays stay in the file, and do not count. */
static void without_the_word_maps(void)
{
    set_text("/", "optional_parts", "planes");
    H5Lmove(changed, "/maps", changed, "/x-maps", H5P_DEFAULT, H5P_DEFAULT);
    state_content();
    H5Lmove(changed, "/x-maps", changed, "/maps", H5P_DEFAULT, H5P_DEFAULT);
}

/* Texts that end in zeros or in none, of ASCII; rows of one value; hints of other types; and the
 * former name of the coding of leaf_skip. */
static void with_attributes_of_others(void)
{
    set_text_as("/", "format", "EBP-Octree in HDF5", 40, H5T_STR_NULLTERM);
    set_text_as("/", "kind", "solid", 5, H5T_STR_SPACEPAD);
    set_text_as("/mesh/vertices", "coding", "delta", 12, H5T_STR_NULLTERM);
    set_text("/", "optional_parts", "seasons planes maps seasons");
    set_text("/", "date", "");
    set_text("/", "selection", "");
    set_row("/", "face_count", H5T_STD_U64LE, 4);
    set_row("/", "level_count", H5T_STD_I64LE, 2);
    set_row("/", "chunk_index_bytes", H5T_STD_I32BE, -1);
    set_text("/", "chunk_index_offset", "behind the levels");
    set_text("/levels/01/leaf_skip", "coding", "delta");
}

/* At paths of the specification, of listed parts; the first two where the header counts no rows. */
static void with_arrays_not_called_for(void)
{
    add_array("/levels/00/leaf_skip",
              (new_array){ .type = H5T_STD_U32LE, .rows = 0, .chunk = 1, .unwritten = true });
    add_array("/levels/00/leaf_new", (new_array){ .type = H5T_IEEE_F64BE, .rows = 3 });
    add_array("/levels/01/leaf_planes",
              (new_array){ .type = H5T_STD_U32LE, .rows = 2, .chunk = 2 });
    add_array("/levels/01/colours",
              (new_array){ .type = H5T_STD_U8LE, .rows = 2, .cols = 3, .chunk = 1 });
    add_array("/mesh/faces_index",
              (new_array){ .type = H5T_STD_U64LE, .rows = 1, .cols = 1, .chunk = 1 });
    need(H5Lcreate_soft("/elsewhere", changed, "/maps/names", H5P_DEFAULT, H5P_DEFAULT) >= 0,
         "link");
}

static void shuffle_and_deflate(hid_t dcpl)
{
    H5Pset_shuffle(dcpl);
    H5Pset_deflate(dcpl, 1);
    H5Pset_fletcher32(dcpl);
}

/* As `h5repack -f SHUF -f GZIP=1 -f FLET` writes arrays of one byte. */
static void shuffle_bytes(void)
{
    refilter("/levels/00/leaf_winding", shuffle_and_deflate);
    refilter("/levels/00/leaf_new", shuffle_and_deflate);
    refilter("/levels/00/leaf_ref_count", shuffle_and_deflate);
}

/* The list is wrong, and readers must ignore it. */
static void without_offset_of_places(void)
{
    drop_attribute("/subtrees/chunk_directory", "offset");
    poke("/subtrees/chunk_directory", 1, INT64_C(4097) << 32 | 8);
}
static void with_false_places(void)
{
    poke("/subtrees/chunk_directory", 1, INT64_C(4097) << 32 | 8);
}

static void make_derived(void)
{
    derive("18_one_leaf_bare", "03_one_leaf", without_filters);
    derive("19_unknown_optional_part", "03_one_leaf", of_a_later_version);
    derive("33_part_not_listed", "05_two_levels", without_the_word_maps);
    derive("34_attributes_of_other_programs", "05_two_levels", with_attributes_of_others);
    derive("35_arrays_not_called_for", "05_two_levels", with_arrays_not_called_for);
    derive("36_shuffled_bytes", "02_one_leaf_deflate", shuffle_bytes);
    derive("37_chunk_directory_without_offset", "17_chunks_of_subtrees_unfiltered",
           without_offset_of_places);
    derive_longer("38_bytes_behind_the_end", "17_chunks_of_subtrees_unfiltered", with_false_places,
                  16);
}

/* --- kinds of meshes --- */

/* The triangle of the unit square in z = 0, and one so close below the face between the lower and
 * upper children of the root that it comes near the upper ones, without contact. */
static void build_near(ebpo_tree *tree)
{
    ebpo_mesh mesh = ebpo_test_tetrahedron(1);
    build_mesh(tree, mesh, (how){ 1, 0, 0, 0, 0, 0, 0 });
    double cell_face = tree->info.box_origin[2] + tree->info.box_size[2] / 2,
           z = cell_face - tree->info.box_size[2] / 2 / 1024;
    ebpo_tree_free(tree);
    mesh = ebpo_test_tetrahedron(1);
    uint32_t a = ebpo_test_append_vertex(&mesh, 0.0625, 0.0625, z),
             b = ebpo_test_append_vertex(&mesh, 0.125, 0.0625, z),
             c = ebpo_test_append_vertex(&mesh, 0.0625, 0.125, z),
             d = ebpo_test_append_vertex(&mesh, 0.0625, 0.0625, z - 0.0625);
    ebpo_test_append_face(&mesh, a, b, c);
    ebpo_test_append_face(&mesh, a, c, d);
    ebpo_test_append_face(&mesh, a, d, b);
    ebpo_test_append_face(&mesh, b, d, c);
    build_mesh(tree, mesh, (how){ 1, 0, 0, 0, 0, 0, 0 });
    if (tree->info.box_origin[2] + tree->info.box_size[2] / 2 != cell_face)
        die("near", "the root cell depends on more than the outer faces");
    ebpo_level *l = &tree->level[1];
    uint64_t at = 0, leaf = 0; /* the leaf of octant 4, and its references */
    for (unsigned octant = 0; octant < 4; octant++)
        if ((l->types[0] >> 2 * octant & 3) == EBPO_LEAF)
            at += l->leaf_ref_count[leaf++];
    uint32_t near = UINT32_MAX;
    for (uint32_t f = 0; f < tree->mesh.face_count; f++) {
        bool all = true;
        for (int k = 0; k < 3; k++)
            all &= tree->mesh.xyz64[3 * tree->mesh.faces[3 * f + k] + 2] == z;
        near = all ? f : near;
    }
    uint64_t place = at, end = at + l->leaf_ref_count[leaf];
    while (place < end && l->leaf_refs[place] < near)
        place++;
    l->leaf_refs = realloc(l->leaf_refs, (l->ref_count + 1) * sizeof *l->leaf_refs);
    memmove(l->leaf_refs + place + 1, l->leaf_refs + place,
            (l->ref_count - place) * sizeof *l->leaf_refs);
    l->leaf_refs[place] = near;
    l->leaf_ref_count[leaf]++;
    l->ref_count++;
}

static void make_meshes(void)
{
    ebpo_tree tree;
    build(&tree, 4, true, 2, 1, EBPO_PART_LEAF_PLANES);
    write_vector("21_doubles_in_several_leaves", &tree, EBPO_CODEC_ZSTD, ~0u);
    build_float(&tree, nested(-1, 2), (how){ 4, 1, 0, EBPO_RULE_POSITIVE, 0, 0, 0 });
    write_vector("22_rule_positive", &tree, EBPO_CODEC_ZSTD, ~0u);
    build_mesh(&tree, make_mesh(3, false), (how){ 1, 0, 0, 0, true, 0, 0 });
    write_vector("23_faces_added_by_mending", &tree, EBPO_CODEC_ZSTD, ~0u);
    ebpo_mesh mesh = make_mesh(4, true);
    (void)ebpo_test_append_vertex(&mesh, 0.1, 0.1, 0.1);
    build_mesh(&tree, mesh, (how){ 1, 0, 0, 0, 0, 0, 0 });
    write_vector("24_unused_vertex", &tree, EBPO_CODEC_ZSTD, ~0u);
    build_near(&tree);
    write_vector("25_face_that_comes_near", &tree, EBPO_CODEC_ZSTD, ~0u);
    ebpo_subset_options close_enough = EBPO_SUBSET_OPTIONS_INIT;
    close_enough.max_error = 0.15;
    close_enough.parts = EBPO_PART_PLANES;
    subset(&tree, "16_many_subtrees", &close_enough);
    write_vector("26_subset_error", &tree, EBPO_CODEC_ZSTD, ~0u);
    build_float(&tree, nested(32768, 1), (how){ 4, 33000, 0, EBPO_RULE_EVENODD, 0, 0, 0 });
    write_vector("27_windings_of_four_bytes", &tree, EBPO_CODEC_ZSTD, EBPO_PART_PLANES);
}

/* --- several chunks, and indexes --- */

static void make_large(void)
{
    ebpo_tree tree;
    build(&tree, 4, false, 6, 0, 0);
    write_vector("28_leaf_index", &tree, EBPO_CODEC_ZSTD, EBPO_PART_PLANES | EBPO_PART_MESH);
    build(&tree, 4, false, 7, 0, 0);
    write_vector("29_types_and_gray_index", &tree, EBPO_CODEC_ZSTD, EBPO_PART_PLANES);
    build(&tree, 4, false, 7, 0, 0);
    write_vector("30_chunks_of_lists", &tree, EBPO_CODEC_ZSTD, EBPO_PART_MESH);
    build_float(&tree, ebpo_test_sheet(64, 64), (how){ 3, 256, 0, 0, 0, 0, 0 });
    write_vector("31_chunks_of_vertices", &tree, EBPO_CODEC_ZSTD, EBPO_PART_MESH);
    build_float(&tree, ebpo_test_sheet(128, 128), (how){ 3, 1024, 0, 0, 0, 0, 0 });
    write_vector("32_chunks_of_maps", &tree, EBPO_CODEC_ZSTD, EBPO_PART_MESH | EBPO_PART_MAPS);
}

/* --- attributes --- */

/* Attributes of every kind: colours and normals, also an array that is none, lists of one length
 * and of different ones, another element, comments, one of them in Latin 1. */
static const char coloured[] =
    "ply\nformat ascii 1.0\ncomment a tetrahedron, f\xfcr Leser\nobj_info made by hand\n"
    "element vertex 4\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    "property float x\nproperty float y\nproperty float z\n"
    "property float nx\nproperty float ny\nproperty float nz\nproperty double quality\n"
    "property int8 mark\n"
    "element face 4\nproperty short label\nproperty list uchar uint vertex_indices\n"
    "property list uchar float texcoord\nproperty list ushort int words\n"
    "element edge 2\nproperty uint vertex1\nproperty uint vertex2\nproperty ushort kind\n"
    "element camera 0\nproperty float view_px\n"
    "end_header\n"
    "255 0 0 0 0 0 0 0 -1 0.5 -128\n0 255 0 1 0 0 1 0 0 1e300 127\n"
    "0 0 255 0 1 0 0 1 0 -0 0\n128 128 128 0 0 1 nan -inf 1.5 0.1 -1\n"
    "-3 3 0 2 1 6 0 0 1 0 0 1 0\n32767 3 0 1 3 6 0 0 0.5 0 0.5 1 2 7 -7\n"
    "-32768 3 0 3 2 6 0.25 0 1 0 0 1 1 2147483647\n0 3 1 2 3 6 0 0 1 0 0 1 3 1 2 3\n"
    "0 1 7\n2 3 65535\n";

static ebpo_mesh read_text(const char *text, const char *name)
{
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    if (ebpo_ply_parse_all(&mesh, (const uint8_t *)text, strlen(text), name, NULL, true, 1, NULL,
                           &error) != EBPO_OK)
        die(name, error.message);
    return mesh;
}

static ebpo_mesh read_coloured(void) { return read_text(coloured, "coloured.ply"); }

static void make_attributes(void)
{
    ebpo_tree tree;
    ebpo_subset_options box = EBPO_SUBSET_OPTIONS_INIT;
    build_mesh(&tree, read_coloured(), (how){ 2, 1, 0, 0, 0, 0, 0 });
    write_vector("39_attributes", &tree, EBPO_CODEC_ZSTD, ~(uint32_t)EBPO_PART_COLOURS);
    build_mesh(&tree, read_coloured(), (how){ 3, 1, EBPO_PART_LEAF_PLANES, 0, 0, 0, 0 });
    write_laid_out("40_attributes_subtrees_unfiltered", &tree, EBPO_CODEC_NONE,
                   ~(uint32_t)EBPO_PART_COLOURS, 1);
    box.boxed = true;
    for (int k = 0; k < 3; k++)
        box.max[k] = 0.2;
    subset(&tree, "40_attributes_subtrees_unfiltered", &box);
    write_vector("41_attributes_of_a_subset", &tree, EBPO_CODEC_NONE, ~0u);
}

/* --- colours of envelopes --- */

/* Colours of faces with 16 bits under other names, beside vertices that all have the same red,
 * green and blue, and different alpha; one of a face is NaN. */
static const char faces_coloured[] =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    "property uchar alpha\nelement face 4\nproperty list uchar uint vertex_indices\n"
    "property float diffuse_red\nproperty ushort diffuse_green\nproperty short diffuse_blue\n"
    "end_header\n"
    "0 0 0 9 9 9 0\n1 0 0 9 9 9 1\n0 1 0 9 9 9 2\n0 0 1 9 9 9 3\n"
    "3 0 2 1 0.5 65535 300\n3 0 1 3 nan 1000 -7\n3 0 3 2 1 128 128\n3 1 2 3 2 0 255\n";

static void make_colours(void)
{
    ebpo_tree tree;
    ebpo_subset_options box = EBPO_SUBSET_OPTIONS_INIT, levels = EBPO_SUBSET_OPTIONS_INIT;
    build_mesh(&tree, read_coloured(), (how){ 2, 1, 0, 0, 0, 0, 0 });
    write_vector("42_colours_of_vertices", &tree, EBPO_CODEC_ZSTD, ~0u);
    build_mesh(&tree, read_text(faces_coloured, "faces.ply"), (how){ 3, 1, 0, 0, 0, 0, 0 });
    write_vector("43_colours_of_faces", &tree, EBPO_CODEC_ZSTD, ~0u);
    build_mesh(&tree, read_coloured(), (how){ 3, 1, EBPO_PART_LEAF_PLANES, 0, 0, 0, 0 });
    write_laid_out("44_colours_subtrees_unfiltered", &tree, EBPO_CODEC_NONE, ~0u, 1);
    box.boxed = true;
    for (int k = 0; k < 3; k++)
        box.max[k] = 0.2;
    subset(&tree, "44_colours_subtrees_unfiltered", &box);
    write_vector("45_colours_of_a_subset", &tree, EBPO_CODEC_NONE, ~0u);
    levels.last_level = 2;
    levels.parts = EBPO_PART_PLANES | EBPO_PART_COLOURS;
    subset(&tree, "44_colours_subtrees_unfiltered", &levels);
    write_vector("46_colours_without_mesh", &tree, EBPO_CODEC_ZSTD, ~0u);
}

/* --- faces across edges --- */

/* The same four faces as in vector 47, as a chunk without streams. */
static void as_codes(void)
{
    enum { FACES = 4 };
    uint8_t gates[FACES * EBPO_GATES_COLS], codes[12 * FACES], planes[12 * FACES];
    hid_t id = H5Dopen2(changed, "/mesh/faces", H5P_DEFAULT);
    need(H5Dread(id, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, gates) >= 0 &&
             ebpo_gates_decode(gates, FACES, codes),
         "faces");
    ebpo_shuffle(codes, sizeof codes, 4, planes);
    memset(gates, 0, sizeof gates);
    gates[0] = 1;
    memcpy(gates + 1, planes, sizeof planes);
    need(H5Dwrite(id, H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, gates) >= 0, "faces");
    H5Dclose(id);
}

static void write_gates(const char *name, ebpo_tree *tree, ebpo_codec codec, uint64_t subtree_faces)
{
    ebpo_write_options options = laid_out(codec, EBPO_PART_MESH | EBPO_PART_MAPS, subtree_faces);
    options.face_coding = EBPO_FACES_GATES;
    write_file(name, tree, &options);
}

static void make_gates(void)
{
    ebpo_tree tree;
    build(&tree, 4, false, 1, 1, 0);
    write_gates("47_gates_unfiltered", &tree, EBPO_CODEC_NONE, 0);
    derive("48_gates_as_codes", "47_gates_unfiltered", as_codes);
    build_float(&tree, ebpo_test_sheet(64, 64), (how){ 3, 256, 0, 0, 0, 0, 0 });
    write_gates("49_gates", &tree, EBPO_CODEC_ZSTD, 0);
    build_float(&tree, ebpo_test_torus(1, 0.375, 80, 32), (how){ 5, 6, 0, 0, 0, 0, 0 });
    write_gates("50_gates_of_subtrees", &tree, EBPO_CODEC_DEFLATE, 10);
}

/* --- textures --- */

static void add_texture(ebpo_attributes *to, const char *name, const char *use, const char *image)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint8_t digest[32];
    ebpo_sha256 state;
    ebpo_texture_bytes list[EBPO_TEXTURE_ARRAYS] = {
        [EBPO_TEXTURE_NAME] = { name, strlen(name) }, [EBPO_TEXTURE_USE] = { use, strlen(use) }
    };
    ebpo_sha256_begin(&state);
    if (image) {
        ebpo_sha256_add(&state, image, strlen(image));
        ebpo_sha256_end(&state, digest);
        list[EBPO_TEXTURE_SHA256] = (ebpo_texture_bytes){ digest, sizeof digest };
        list[EBPO_TEXTURE_BYTES] = (ebpo_texture_bytes){ image, strlen(image) };
    }
    if (ebpo_textures_add(to, true, list, &error) != EBPO_OK)
        die(name, error.message);
}

/* One in a folder, one that was not found; and one whose path leaves any folder. */
static void make_textures(void)
{
    ebpo_tree tree;
    for (int upwards = 0; upwards < 2; upwards++) {
        ebpo_mesh mesh = make_mesh(4, false);
        mesh.attributes = ebpo_attributes_make(NULL);
        if (!mesh.attributes)
            die("textures", "no memory");
        add_texture(mesh.attributes, upwards ? "../up.png" : "folder\\red.png",
                    "map_Kd red paint\nmap_Bump blue", "not really an image");
        if (!upwards)
            add_texture(mesh.attributes, "gone.png", "TextureFile", NULL);
        build_mesh(&tree, mesh, (how){ 0, 16, 0, 0, 0, 0, 0 });
        write_vector(upwards ? "52_texture_upwards" : "51_textures", &tree, EBPO_CODEC_ZSTD, ~0u);
    }
}

/* In a tetrahedron without its last side, one face occurs three times: the second copy has the
 * opposite orientation. The hole is filled, with an index after the six of the source. */
static void make_dropped(void)
{
    ebpo_tree tree;
    ebpo_mesh mesh = make_mesh(3, false);
    mesh.faces = realloc(mesh.faces, 6 * 3 * sizeof *mesh.faces);
    static const uint32_t faces[6][3] = { { 0, 2, 1 }, { 1, 0, 2 }, { 0, 1, 3 },
                                          { 2, 0, 1 }, { 0, 3, 2 }, { 3, 0, 1 } };
    memcpy(mesh.faces, faces, sizeof faces);
    mesh.face_count = 6;
    build_mesh(&tree, mesh, (how){ 1, 1, 0, 0, true, true, 0 });
    write_vector("53_dropped_faces", &tree, EBPO_CODEC_ZSTD, ~0u);
}

/* The tetrahedron with a fifth vertex near the last one, which half of the faces there use; and a
 * face between these two, which keeps two vertices. */
static void make_welded(void)
{
    ebpo_tree tree;
    ebpo_mesh mesh = make_mesh(4, false);
    mesh.xyz32 = realloc(mesh.xyz32, 15 * sizeof *mesh.xyz32);
    mesh.faces = realloc(mesh.faces, 15 * sizeof *mesh.faces);
    static const float near[3] = { 0.0078125F, 0, 1 };
    static const uint32_t faces[5][3] = {
        { 0, 2, 1 }, { 0, 1, 4 }, { 0, 3, 2 }, { 1, 2, 3 }, { 3, 4, 1 }
    };
    memcpy(mesh.xyz32 + 12, near, sizeof near);
    memcpy(mesh.faces, faces, sizeof faces);
    mesh.vertex_count = mesh.face_count = 5;
    build_mesh(&tree, mesh, (how){ 1, 1, 0, 0, 0, 0, 0.015625 });
    write_vector("58_welded_within_a_distance", &tree, EBPO_CODEC_ZSTD, ~0u);
}

/* --- chunk checksums --- */

/* The list is outdated, but states that it is not valid. */
static void stale_checksums(void)
{
    poke("/chunk_checksums", 0, 1);
    poke("/chunk_checksums", 2, 12345);
    drop_attribute("/chunk_checksums", "offset");
}

static size_t file_size;
static void put_size(void)
{
    set_count("/chunk_checksums", "file_bytes", (int64_t)file_size);
    set_count("/subtrees/chunk_directory", "file_bytes", (int64_t)file_size);
}

/* The object is not a list of checksums, and does not state the size of the file. */
static void checksums_of_others(void)
{
    replace("/chunk_checksums", (new_array){ H5T_IEEE_F32BE, 3, 2, 0, false, false, NULL, NULL });
}

/* Their rows stay in the list, as those of arrays added by a later version. */
static void without_the_word_colours(void)
{
    set_text("/", "optional_parts", "planes maps leaf-planes attributes");
}

/* Adding attributes to a file enlarges it: the lists about chunks state the current size. */
static void state_size(const char *name, void (*put)(void))
{
    char path[512];
    size_t size;
    ebpo_tree back;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(path, sizeof path, "%s/passed/%s.ebpo.h5", folder, name);
    free(slurp(path, &size));
    file_size = size;
    change_objects(path, put);
    if (vector_read(path, &back, &error) != EBPO_OK)
        die(name, error.message);
    ebpo_tree_free(&back);
}

static herr_t remove_filters(hid_t object, const char *name, const H5O_info_t *info, void *user)
{
    char path[64];
    (void)object;
    (void)user;
    snprintf(path, sizeof path, "/%s", name);
    if (info->type == H5O_TYPE_DATASET)
        refilter(path, NULL);
    return 0;
}

/* All arrays are bare, the list of checksums is wrong, and hints have impossible values. */
static void with_bare_lists(void)
{
    set_text("/", "optional_parts", "planes maps leaf-planes");
    drop("/attributes");
    need(H5Ovisit2(changed, H5_INDEX_NAME, H5_ITER_INC, remove_filters, NULL, H5O_INFO_BASIC) >= 0,
         "H5Ovisit");
    poke("/chunk_checksums", 0, 1);
    add_count("/chunk_checksums", "file_bytes", 0);
    add_count("/chunk_checksums", "offset", 0);
    set_count("/", "top_bytes", INT64_MAX);
    set_count("/", "chunk_index_offset", 100);
    set_count("/", "chunk_index_bytes", INT64_MAX);
}

/* The list states that it is valid. */
static void put_place(void)
{
    hsize_t bytes;
    set_count("/chunk_checksums", "file_bytes", (int64_t)file_size);
    set_count("/chunk_checksums", "offset", (int64_t)chunk_address("/chunk_checksums", &bytes));
}

static void make_sums(void)
{
    ebpo_tree tree;
    ebpo_write_options options = laid_out(EBPO_CODEC_ZSTD, ~0u, 0);
    options.chunk_checksums = EBPO_CHECKSUMS_DEFAULT;
    build(&tree, 4, false, 2, 1, EBPO_PART_LEAF_PLANES);
    write_file("54_chunk_checksums", &tree, &options);
    options = laid_out(EBPO_CODEC_NONE, ~0u, 1);
    options.chunk_checksums = EBPO_CHECKSUMS_DEFAULT;
    build_mesh(&tree, read_coloured(), (how){ 3, 1, EBPO_PART_LEAF_PLANES, 0, 0, 0, 0 });
    write_file("55_chunk_checksums_of_subtrees", &tree, &options);
    derive("56_chunk_checksums_of_a_part_not_listed", "55_chunk_checksums_of_subtrees",
           without_the_word_colours);
    state_size("56_chunk_checksums_of_a_part_not_listed", put_size);
    derive("57_chunk_checksums_without_offset", "55_chunk_checksums_of_subtrees", stale_checksums);
    derive("63_chunk_checksums_of_others", "54_chunk_checksums", checksums_of_others);
    derive("64_lists_of_a_bare_file", "55_chunk_checksums_of_subtrees", with_bare_lists);
    state_size("64_lists_of_a_bare_file", put_place);
    options = laid_out(EBPO_CODEC_NONE, EBPO_PART_MESH, 10);
    options.chunk_checksums = EBPO_CHECKSUMS_DEFAULT;
    build_float(&tree, ebpo_test_torus(1, 0.03125, 160, 16), (how){ 4, 16, 0, 0, 0, 0, 0 });
    write_file("74_checksums_by_subtree", &tree, &options);
}

/* --- subtrees and gates, in files that are large enough --- */

/* Columns of bytes, and of numbers. */
static void add_smooth(ebpo_mesh *mesh)
{
    ebpo_attribute colour = { .element = "vertex",
                              .names = "label layer order",
                              .type = EBPO_ATTRIBUTE_UINT8,
                              .list = EBPO_ATTRIBUTE_NO_LIST,
                              .columns = 3 },
                   smooth = { .element = "vertex",
                              .names = "height slope",
                              .type = EBPO_ATTRIBUTE_FLOAT64,
                              .list = EBPO_ATTRIBUTE_NO_LIST,
                              .columns = 2 };
    mesh->attributes = ebpo_attributes_make(NULL);
    if (!mesh->attributes || !ebpo_attributes_add(mesh->attributes, &colour) ||
        !ebpo_attributes_add(mesh->attributes, &smooth))
        die("smooth", "no memory");
    for (int k = 0; k < 2; k++) {
        ebpo_attribute *a = &mesh->attributes->array[k];
        uint64_t items = mesh->vertex_count * a->columns;
        if (!ebpo_attribute_reserve(NULL, a, mesh->vertex_count, items))
            die("smooth", "no memory");
        a->rows = mesh->vertex_count;
        for (uint64_t i = 0; i < items; i++) {
            double value = (double)(float)mesh->xyz64[i / 2 * 3 + 2 * (i % 2)];
            if (k)
                memcpy(a->values + 8 * i, &value, sizeof value);
            else
                a->values[i] = (uint8_t)(i * i >> 7);
        }
    }
}

/* A tetrahedron, and faces that share only one of its vertices, whose number is soon far back. */
static ebpo_mesh fan(uint32_t faces)
{
    ebpo_mesh mesh = ebpo_test_tetrahedron(1);
    for (uint32_t i = 0; i < faces; i++) {
        double x = 2 + (double)(i % 64) / 64, y = (double)(i / 64) / 64;
        uint32_t a = ebpo_test_append_vertex(&mesh, x, y, 1),
                 b = ebpo_test_append_vertex(&mesh, x + 1.0 / 256, y, 1);
        ebpo_test_append_face(&mesh, 0, a, b);
    }
    return mesh;
}

/* --- borders of surfaces --- */

/* A tetrahedron without a face, and a face twice, whose border has weight 2. */
static ebpo_mesh open_faces(void)
{
    ebpo_mesh mesh = ebpo_test_tetrahedron(1);
    mesh.face_count = 3;
    uint32_t a = ebpo_test_append_vertex(&mesh, 2, 0, 0.5),
             b = ebpo_test_append_vertex(&mesh, 3, 0, 0),
             c = ebpo_test_append_vertex(&mesh, 2, 1, 0);
    ebpo_test_append_face(&mesh, a, b, c);
    ebpo_test_append_face(&mesh, a, b, c);
    return mesh;
}

/* Adds the border to a tree that was built without it, whose envelopes contain the faces only. */
static void add_border(ebpo_tree *tree)
{
    ebpo_error error = EBPO_ERROR_INIT;
    if (ebpo_build_border(tree, 1, NULL, &error) != EBPO_OK)
        die("border", error.message);
}

static void make_borders(void)
{
    ebpo_tree tree;
    ebpo_subset_options box = EBPO_SUBSET_OPTIONS_INIT;
    how plain = { 2, 1, 0, 0, 0, 0, 0 };
    build_float(&tree, open_faces(), plain);
    add_border(&tree);
    write_vector("65_border", &tree, EBPO_CODEC_NONE, ~0u);
    build_mesh(&tree, open_faces(), plain);
    add_border(&tree);
    write_vector("66_border_doubles", &tree, EBPO_CODEC_ZSTD, ~0u);
    ebpo_mesh torus = ebpo_test_torus(1, 0.375, 80, 32);
    torus.face_count -= 70;
    plain = (how){ 5, 6, 0, 0, 0, 0, 0 };
    build_float(&tree, torus, plain);
    add_border(&tree);
    write_laid_out("67_border_with_subtrees", &tree, EBPO_CODEC_ZSTD, ~0u, 10);
    box.boxed = true;
    for (int k = 0; k < 3; k++)
        box.max[k] = 0.6;
    subset(&tree, "67_border_with_subtrees", &box);
    write_vector("68_border_of_a_subset", &tree, EBPO_CODEC_ZSTD, ~0u);
}

/* Surfaces with holes whose envelopes contain the inside. */
static void make_insides(void)
{
    ebpo_tree tree;
    ebpo_mesh torus = ebpo_test_torus(1, 0.375, 12, 8);
    torus.face_count -= 20;
    build_float(&tree, torus, (how){ 3, 4, EBPO_PART_BORDER, 0, 0, 0, 0 });
    write_vector("72_inside", &tree, EBPO_CODEC_NONE, ~0u);
    torus = ebpo_test_torus(1, 0.375, 80, 32);
    torus.face_count -= 70;
    build_float(&tree, torus, (how){ 5, 6, EBPO_PART_BORDER, 0, 0, 0, 0 });
    write_laid_out("73_inside_with_subtrees", &tree, EBPO_CODEC_ZSTD, ~0u, 10);
}

/* --- the simplified surface --- */

/* A torus whose vertices have colours. */
static ebpo_mesh coloured_torus(void)
{
    ebpo_mesh torus = ebpo_test_torus(1, 0.375, 96, 44);
    size_t capacity = 512 + 96 * (size_t)torus.vertex_count + 32 * (size_t)torus.face_count, used;
    char *text = malloc(capacity);
    used = (size_t)snprintf(text, capacity,
                            "ply\nformat ascii 1.0\nelement vertex %llu\nproperty float x\n"
                            "property float y\nproperty float z\nproperty uchar red\n"
                            "property uchar green\nproperty uchar blue\nelement face %llu\n"
                            "property list uchar int vertex_indices\nend_header\n",
                            (unsigned long long)torus.vertex_count,
                            (unsigned long long)torus.face_count);
    for (uint64_t i = 0; i < torus.vertex_count; i++) {
        const double *p = torus.xyz64 + 3 * i;
        used += (size_t)snprintf(text + used, capacity - used, "%.9g %.9g %.9g %d %d %d\n",
                                 (double)(float)p[0], (double)(float)p[1], (double)(float)p[2],
                                 (int)(128 + 80 * p[0]), (int)(128 + 80 * p[1]), (int)(i % 200));
    }
    for (uint64_t i = 0; i < torus.face_count; i++)
        used += (size_t)snprintf(text + used, capacity - used, "3 %u %u %u\n", torus.faces[3 * i],
                                 torus.faces[3 * i + 1], torus.faces[3 * i + 2]);
    ebpo_mesh_free(&torus);
    torus = read_text(text, "torus.ply");
    free(text);
    return torus;
}

static void make_surfaces(void)
{
    ebpo_tree tree;
    ebpo_subset_options levels = EBPO_SUBSET_OPTIONS_INIT;
    how with = { 5, 6, EBPO_PART_SURFACE, 0, 0, 0, 0 };
    build_float(&tree, ebpo_test_torus(1, 0.375, 48, 24), with);
    write_vector("69_surface", &tree, EBPO_CODEC_ZSTD, ~0u);
    build_mesh(&tree, coloured_torus(), (how){ 4, 64, EBPO_PART_SURFACE, 0, 0, 0, 0 });
    write_laid_out("70_surface_with_subtrees", &tree, EBPO_CODEC_ZSTD, ~0u, 10);
    levels.last_level = 2;
    levels.parts = EBPO_PART_SURFACE;
    subset(&tree, "70_surface_with_subtrees", &levels);
    write_vector("71_surface_without_mesh", &tree, EBPO_CODEC_DEFLATE, ~0u);
}

static void make_long(void)
{
    ebpo_tree tree;
    ebpo_subset_options box = EBPO_SUBSET_OPTIONS_INIT;
    build_float(&tree, fan(2400), (how){ 0, 10000, 0, 0, 0, 0, 0 });
    write_gates("59_gates_of_five_bytes", &tree, EBPO_CODEC_ZSTD, 0);
    box.boxed = true;
    for (int k = 0; k < 3; k++)
        box.max[k] = 0.6;
    subset(&tree, "16_many_subtrees", &box);
    write_laid_out("60_subset_with_subtrees", &tree, EBPO_CODEC_ZSTD, ~0u, 10);
    build_mesh(&tree, ebpo_test_torus(1, 0.375, 80, 32), (how){ 5, 6, 0, 0, 0, 0, 0 });
    write_laid_out("61_doubles_with_subtrees", &tree, EBPO_CODEC_ZSTD, ~0u, 10);
    ebpo_mesh mesh = ebpo_test_torus(1, 0.375, 80, 32);
    add_smooth(&mesh);
    build_float(&tree, mesh, (how){ 4, 64, 0, 0, 0, 0, 0 });
    write_laid_out("62_column_delta_over_chunks", &tree, EBPO_CODEC_ZSTD, ~0u, 100);
}

void make_passed(const char *to)
{
    folder = to;
    make_small();
    make_subsets();
    make_subtrees();
    make_derived();
    make_meshes();
    make_large();
    make_attributes();
    make_colours();
    make_gates();
    make_textures();
    make_dropped();
    make_sums();
    make_welded();
    make_long();
    make_borders();
    make_surfaces();
    make_insides();
}
