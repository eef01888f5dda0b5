/* Makes the failed vectors: each is a passed one that breaks one rule of the specification, whose
 * number its .txt states. */
#include "make_parts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zstd.h>

#include "change_file.h"
#include "core/checksum.h"
#include "vector_read.h"

static const char *folder;

#define LEAVES    "05_two_levels"
#define DEEP      "06_four_levels_leaf_planes"
#define ONE       "01_one_leaf_unfiltered"
#define NO_MESH   "08_without_mesh"
#define NO_MAPS   "09_without_maps"
#define DROPPED   "53_dropped_faces"
#define ODD       "10_windings_of_two_bytes"
#define LONG      "11_two_chunks_of_faces"
#define CUT_SHORT "12_subset_levels"
#define BOXED     "13_subset_box"
#define SUBTREES  "15_subtrees_unfiltered"
#define CHUNKS    "17_chunks_of_subtrees_unfiltered"
#define LISTS     "28_leaf_index"
#define INDEXED   "29_types_and_gray_index"
#define COLOURED  "39_attributes"
#define PAINTED   "42_colours_of_vertices"
#define UNUSED    "24_unused_vertex"
#define GATES     "47_gates_unfiltered"
#define TEXTURED  "51_textures"
#define WELDED    "58_welded_within_a_distance"
#define SUMMED    "55_chunk_checksums_of_subtrees"
#define PAGED     "74_checksums_by_subtree"
#define SURFACE   "07_surface"
#define BORDER    "65_border"
#define PATCHES   "69_surface"
#define CLOSE     "26_subset_error"
#define MANY      "16_many_subtrees"

/* As the library writes it; elements of one byte are not shuffled. */
static void zstd(hid_t dcpl)
{
    unsigned level = 6;
    H5Pset_filter(dcpl, 32015, 0, 1, &level);
}

static void v_format(void) { set_text("/", "format", "EBP-Octree in HDF6"); }
static void v_format_missing(void) { drop_attribute("/", "format"); }
static void v_draft(void) { set_text("/", "format_version", "1.0-draft"); }
static void v_major(void) { set_int("/", "format_version_major", 2); }
static void v_variable(void) { set_text_as("/", "unit", "m", H5T_VARIABLE, H5T_STR_NULLTERM); }
static void v_maps_alone(void) { set_text("/", "optional_parts", "planes maps"); }
static void v_absent_part(void) { set_count("/levels/01", "leaf_planes", 3); }
static void v_required(void) { set_text("/", "required_parts", "levels mesh animation"); }
static void v_required_first(void)
{
    v_required();
    drop_attribute("/", "epsilon");
    set_text("/", "kind", "liquid");
}
static void v_no_levels_part(void) { set_text("/", "required_parts", "mesh"); }
static void v_part_twice(void) { set_text("/", "optional_parts", "planes planes"); }
static void v_subset_word(void) { set_text("/", "required_parts", "levels mesh"); }
static void v_subset_of(void) { drop_attribute("/", "subset_of"); }
static void v_subset_level(void) { set_int("/", "subset_levels", 0); }
static void v_pruned_more(void) { set_count("/levels/01", "pruned", 99); }
static void v_pruned_less(void) { drop_attribute("/levels/01", "pruned"); }
static void v_pruned_type(void) { set_text("/levels/01", "pruned", "0"); }
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
static void v_level_beyond(void)
{
    set_int("/", "max_level", 2);
    set_int("/", "level_count", 3);
}
static void v_max_level(void) { set_int("/", "max_level", 0); }
static void v_faces_huge(void) { set_count("/", "face_count", (int64_t)1 << 40); }
static void v_faces_more(void) { set_count("/", "source_face_count", 3); }
static void v_dropped(void) { set_count("/", "mend_dropped_faces", 7); }
static void v_dropped_kept(void) { set_count("/", "mend_dropped_faces", 4); }
static void v_weld_none(void) { set_reals("mend_weld_distance", 0, 0, 0); }
static void v_weld_infinite(void) { set_reals("mend_weld_distance", INFINITY, 0, 0); }
static void v_weld_not_requested(void) { set_count("/", "mend_weld", 0); }
static void v_weld_moved(void) { set_reals("mend_weld_moved", -1, 0, 0); }
static void v_weld_moved_missing(void) { drop_attribute("/", "mend_weld_moved"); }
static void v_source_less(void) { set_count("/", "source_vertex_count", 3); }
/* Replaces a leaf, so that there are still eight nodes. */
static void v_gray_deep(void)
{
    set_count("/levels/01", "gray", 1);
    set_count("/levels/01", "leaf", count_of("/levels/01", "leaf") - 1);
}
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
    H5Gclose(H5Gcreate2(changed, "/mesh/faces", H5P_DEFAULT, plist, H5P_DEFAULT));
    H5Pclose(plist);
}
static void v_subtree_level(void) { set_int("/", "subtree_level", 0); }
static void v_subtree_table(void) { drop("/subtrees/counts"); }
/* Its bytes stay, so that the list is still valid for a reader. */
static void v_places_array(void) { poke("/subtrees/chunk_directory", 1, INT64_C(4097) << 32 | 8); }
static void v_places_end(void) { poke("/subtrees/chunk_directory", 1, 1 << 30); }
static void v_places_bytes(void)
{
    poke("/subtrees/chunk_directory", 0, 1027);
} /* of two, unfiltered */
static void v_places(void) { drop("/subtrees/chunk_directory"); }
static void v_outer(void) { drop("/subtrees/shared_chunks"); }
static void v_soft_link(void)
{
    drop("/mesh/faces");
    need(H5Lcreate_soft("/levels/00/types", changed, "/mesh/faces", H5P_DEFAULT, H5P_DEFAULT) >= 0,
         "link");
}
static void v_external_link(void)
{
    drop("/mesh");
    need(H5Lcreate_external("03_one_leaf.ebpo.h5", "/mesh", changed, "/mesh", H5P_DEFAULT,
                            H5P_DEFAULT) >= 0,
         "link");
}
static void v_big_endian(void)
{
    replace("/mesh/faces", (new_array){ H5T_STD_U32BE, 4, 3, 4, false, false, checksum, NULL });
}
static void v_signed(void)
{
    replace("/mesh/faces", (new_array){ H5T_STD_I32LE, 4, 3, 4, false, false, checksum, NULL });
}
static void v_float(void)
{
    replace("/mesh/vertices", (new_array){ H5T_IEEE_F32LE, 4, 3, 4, false, false, checksum, NULL });
}
static void v_wide(void)
{
    replace("/mesh/vertices", (new_array){ H5T_STD_U64LE, 4, 3, 4, false, false, checksum, NULL });
}
static void v_shape(void)
{
    replace("/mesh/faces", (new_array){ H5T_STD_U32LE, 4, 2, 4, false, false, checksum, NULL });
}
static void v_length(void)
{
    replace("/mesh/faces", (new_array){ H5T_STD_U32LE, 5, 3, 5, false, false, checksum, NULL });
}
static void v_chunk(void)
{
    replace("/mesh/faces", (new_array){ H5T_STD_U32LE, 4, 3, 2, false, false, checksum, NULL });
}
static void v_contiguous(void)
{
    replace("/mesh/faces", (new_array){ H5T_STD_U32LE, 4, 3, 0, false, false, NULL, NULL });
}
/* Bytes, and rows, in other files. */
static void external_storage(hid_t dcpl)
{
    need(H5Pset_external(dcpl, "elsewhere.bin", 0, H5F_UNLIMITED) >= 0, "external storage");
}
static void v_external_storage(void)
{
    replace("/mesh/faces",
            (new_array){ H5T_STD_U32LE, 4, 3, 0, false, true, external_storage, NULL });
}
static void virtual_rows(hid_t dcpl)
{
    const hsize_t rows[2] = { 4, 3 };
    hid_t space = H5Screate_simple(2, rows, NULL);
    need(H5Pset_virtual(dcpl, space, "elsewhere.h5", "/mesh/faces", space) >= 0, "virtual dataset");
    H5Sclose(space);
}
static void v_virtual(void)
{
    replace("/mesh/faces", (new_array){ H5T_STD_U32LE, 4, 3, 0, false, true, virtual_rows, NULL });
}
/* An unregistered number: libhdf5 would search a plugin with it. */
static void unknown_filter(hid_t dcpl)
{
    need(H5Pset_filter(dcpl, 65000, H5Z_FLAG_OPTIONAL, 0, NULL) >= 0, "unknown filter");
}
static void v_unknown_filter(void)
{
    replace("/mesh/faces",
            (new_array){ H5T_STD_U32LE, 4, 3, 4, false, true, unknown_filter, NULL });
}
static void v_unlimited(void)
{
    replace("/mesh/faces", (new_array){ H5T_STD_U32LE, 4, 3, 4, true, false, checksum, NULL });
}
static void v_filter(void)
{
    replace("/mesh/faces", (new_array){ H5T_STD_U32LE, 4, 3, 4, false, false, scale_offset, NULL });
}
/* The same values, with a pipeline other than that of the file. */
static void v_two_pipelines(void)
{
    static const int64_t values[] = { 0, 4, 1, 4 };
    replace("/maps/vertex_source",
            (new_array){ H5T_STD_U32LE, 4, 0, 4, false, false, checksum, values });
}
static void v_missing_chunk(void)
{
    replace("/maps/face_source",
            (new_array){ H5T_STD_U32LE, 4, 0, 4, false, true, checksum, NULL });
}
/* Shuffled, and not compressed. */
static void v_filter_mask(void)
{
    static const uint32_t codes[] = { 0, 2, 2, 2 };
    uint8_t shuffled[sizeof codes];
    for (unsigned i = 0; i < sizeof codes; i++)
        shuffled[i % 4 * 4 + i / 4] = (uint8_t)(codes[i / 4] >> 8 * (i % 4));
    hsize_t at[1] = { 0 };
    hid_t id = H5Dopen2(changed, "/maps/face_source", H5P_DEFAULT);
    need(H5Dwrite_chunk(id, H5P_DEFAULT, 2, at, sizeof shuffled, shuffled) >= 0, "chunk");
    H5Dclose(id);
}
/* The unchanged bytes of the chunk, in a frame without a checksum. */
static void v_no_checksum(void)
{
    static const char path[] = "/mesh/faces";
    uint8_t stored[4096], raw[4096], frame[4096];
    hsize_t at[2] = { 0, 0 }, size = 0;
    uint32_t mask;
    (void)chunk_address(path, &size);
    hid_t id = H5Dopen2(changed, path, H5P_DEFAULT);
    need(size <= sizeof stored && H5Dread_chunk(id, H5P_DEFAULT, at, &mask, stored) >= 0, path);
    size_t bytes = ZSTD_decompress(raw, sizeof raw, stored, (size_t)size);
    need(!ZSTD_isError(bytes), "ZSTD_decompress");
    bytes = ZSTD_compress(frame, sizeof frame, raw, bytes, 3); /* content size, no checksum */
    need(!ZSTD_isError(bytes), "ZSTD_compress");
    need(H5Dwrite_chunk(id, H5P_DEFAULT, 0, at, bytes, frame) >= 0, "chunk");
    H5Dclose(id);
}
/* Flips a bit of the array's first frame that zstd does not detect: the first such bit from that
 * byte on. */
static void turn_unseen(const char *path, size_t from, uint8_t bit)
{
    uint8_t stored[4096], raw[4096], other[4096];
    hsize_t at[2] = { 0, 0 }, size = 0;
    uint32_t mask;
    (void)chunk_address(path, &size);
    hid_t id = H5Dopen2(changed, path, H5P_DEFAULT);
    need(size <= sizeof stored && H5Dread_chunk(id, H5P_DEFAULT, at, &mask, stored) >= 0, path);
    size_t bytes = ZSTD_decompress(raw, sizeof raw, stored, (size_t)size), i = from;
    need(!ZSTD_isError(bytes), "ZSTD_decompress");
    for (bool found = false; !found; i += !found) {
        need(i + 4 < size, "a bit that zstd does not look at");
        stored[i] ^= bit;
        found = ZSTD_decompress(other, sizeof other, stored, (size_t)size) == bytes &&
                memcmp(raw, other, bytes) == 0;
        stored[i] ^= found ? 0 : bit;
    }
    need(H5Dwrite_chunk(id, H5P_DEFAULT, 0, at, (size_t)size, stored) >= 0, "chunk");
    H5Dclose(id);
}
enum { FRAME_HEADER = 6, BLOCK_HEADER = 3 }; /* sizes in frames below 256 bytes */
static void v_unused_bit(void) { turn_unseen("/mesh/faces", FRAME_HEADER + BLOCK_HEADER, 1); }
static void v_repeated_once(void) { turn_unseen("/levels/00/plane_counts", FRAME_HEADER, 2); }
/* One valid frame, with hundreds of empty blocks before the others. RFC 8878, 3.1.1. */
static void v_long_chunk(void)
{
    static const char path[] = "/mesh/faces";
    enum { EMPTY_BLOCKS = 3 * 400 };
    uint8_t stored[4096], frame[4096 + EMPTY_BLOCKS] = { 0 };
    hsize_t at[2] = { 0, 0 }, size = 0;
    uint32_t mask;
    (void)chunk_address(path, &size);
    hid_t id = H5Dopen2(changed, path, H5P_DEFAULT);
    need(size <= sizeof stored && H5Dread_chunk(id, H5P_DEFAULT, at, &mask, stored) >= 0, path);
    need(stored[4] >> 5 == 1 && (stored[4] & 3) == 0, "a frame of a single segment");
    size_t header = 4 + 1 + 1; /* magic number, descriptor, size in one byte */
    memcpy(frame, stored, header);
    memcpy(frame + header + EMPTY_BLOCKS, stored + header, (size_t)size - header);
    need(H5Dwrite_chunk(id, H5P_DEFAULT, 0, at, (size_t)size + EMPTY_BLOCKS, frame) >= 0, "chunk");
    H5Dclose(id);
}
static void v_coding(void) { set_text("/mesh/faces", "coding", "zebra"); }
static void v_coding_missing(void) { drop_attribute("/mesh/faces", "coding"); }
static void v_minor(void) { set_int("/", "format_version_minor", -1); }
static void v_two_spaces(void) { set_text("/", "optional_parts", "planes  maps"); }
static void v_c1(void) { set_text("/", "unit", "m\xc2\x85"); }
static void v_types_index(void) { poke("/levels/07/types_index", 5, 1); }
static void v_gray_index(void) { poke("/levels/06/gray_index", 1, 3); }
static void v_leaf_index(void) { poke("/levels/06/leaf_index", 4, 7); }

/* The leaves of the last group get another type, 0 (white) or 1 (black); other data is adapted. */
static void replace_leaves(int64_t other)
{
    int64_t types[64], winding[512], leaves = 0, rank = 0;
    hid_t id = H5Dopen2(changed, "/levels/02/types", H5P_DEFAULT), space = H5Dget_space(id);
    int64_t groups = H5Sget_simple_extent_npoints(space), gone = 0;
    need(groups <= 64 && H5Dread(id, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, types) >= 0,
         "types");
    H5Sclose(space);
    H5Dclose(id);
    id = H5Dopen2(changed, "/levels/02/leaf_winding", H5P_DEFAULT);
    need(H5Dread(id, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, winding) >= 0, "winding");
    H5Dclose(id);
    for (int64_t g = 0; g < groups; g++)
        for (int octant = 0; octant < 8; octant++) {
            int type = (int)(types[g] >> 2 * octant & 3);
            if (g == groups - 1 && type == 2)
                gone++;
            else if (type == 2)
                winding[leaves++] = winding[rank];
            rank += type == 2;
        }
    int64_t last = types[groups - 1], leaf_bits = last >> 1 & 0x5555;
    need((last & leaf_bits) == 0, "no gray node in the last group");
    poke("/levels/02/types", (unsigned)groups - 1, (last & ~(leaf_bits << 1)) | leaf_bits * other);
    const char *count = other ? "black" : "white";
    set_count("/levels/02", "leaf", leaves);
    set_count("/levels/02", count, (int64_t)count_of("/levels/02", count) + gone);
    replace("/levels/02/leaf_winding", (new_array){ H5T_STD_I8LE, (hsize_t)leaves, 0,
                                                    (hsize_t)leaves, false, false, zstd, winding });
}

static void v_zero_group(void) { replace_leaves(0); }
static void v_closed_group(void) { replace_leaves(1); }

static void v_root_siblings(void) { poke("/levels/00/types", 0, 3 | 2 << 2); }
static void v_types(void) { poke("/levels/01/types", 0, 2); }
static void v_types_gray(void) { poke("/levels/01/types", 0, 0xffff); }
static void v_plane_code(void) { poke("/levels/00/planes", 0, 0xffffffff); }
static void v_plane_counts(void) { poke("/levels/00/plane_counts", 0, 0); }
static void v_leaf_plane(void) { poke("/levels/03/leaf_planes", 0, 0xfff00000); }
static void v_skip(void) { poke("/levels/01/leaf_skip", 0, 1); }
static void v_skip_far(void) { poke("/levels/01/leaf_skip", 0, 0xffffffff); }
static void v_leaf_new(void) { poke("/levels/01/leaf_new", 0, 200); }
static void v_ref_counts(void) { poke("/levels/01/leaf_ref_count", 0, 200); }
static void v_refs(void) { poke("/levels/01/leaf_refs", 0, 4); }
/* The new faces of one leaf begin one later; those after it are unchanged. */
static void v_order(void)
{
    poke("/levels/03/leaf_skip", 12, 1);
    poke("/levels/03/leaf_skip", 13, 127);
}
static void v_black(void) { poke("/levels/04/black_winding", 0, 2); }
static void v_white(void) { poke("/levels/04/white_winding", 0, 1); }
static void v_nan(void) { poke("/mesh/vertices", 0, (int64_t)0x7fc00000u << 1); }
static void v_corner(void) { poke("/mesh/faces", 11, 9); }
static void v_corner_first(void) { poke("/mesh/faces", 0, 1); }
static void v_faces_index(void) { poke("/mesh/faces_index", 1, 3); }
static void v_map_twice(void) { poke("/maps/face_source", 1, 0); }
static void v_map_far(void) { poke("/maps/vertex_source", 0, 200); }
static void v_attributes_changed(void) { poke("/attributes/000", 0, 2); }
static void v_colour(void) { poke("/levels/00/gray_colours", 0, 1 << 24); }
static void v_colours_missing(void) { drop("/levels/01/gray_colours"); }
static void v_colours_digest(void) { drop_attribute("/", "colours_sha256"); }
static void v_colours_changed(void) { poke("/levels/00/gray_colours", 0, 0); }
static void v_attributes_missing(void) { drop("/attributes/003"); }
static void v_attributes_many(void) { set_count("/attributes", "arrays", 1001); }
static void v_attributes_type(void) { set_text("/attributes/003", "type", "int64"); }
static void v_attributes_width(void) { set_text("/attributes/003", "type", "int32"); }
static void v_attributes_names(void) { set_text("/attributes/000", "columns", "red green"); }
static void v_attributes_element(void) { set_text("/attributes/003", "element", "edge"); }
static void v_attributes_coding(void) { set_text("/attributes/001", "coding", "delta"); }
static void v_attributes_ends(void) { poke("/attributes/006", 2, 1); }
static void v_attributes_items(void) { poke("/attributes/006", 3, 8); }
static void v_attributes_no_mesh(void)
{
    set_text("/", "required_parts", "levels");
    for (const char *const *path =
             (const char *const[]){ "/levels/00", "/levels/01", "/levels/02", NULL };
         *path; path++) {
        set_count(*path, "faces_new", 0);
        set_count(*path, "faces_referenced", 0);
    }
    set_text("/", "optional_parts", "planes attributes");
}

/* Four faces, of which only the first is new: gates from 0 on, three bytes for third corners,
 * numbers from 7 on, zeros from 10 on. */
static void v_gates_alone(void) { set_text("/", "required_parts", "levels gates"); }
static void v_gates_unsaid(void) { set_text("/", "required_parts", "levels mesh"); }
static void v_gates_word(void) { set_text("/mesh/faces", "coding", "high-water"); }
static void v_gate(void) { poke("/mesh/faces", 1, 4); }
static void v_third(void) { poke("/mesh/faces", 4, 3 * (4 + 2)); }
static void v_gate_number(void) { poke("/mesh/faces", 7, 1); }
static void v_gate_low(void) { poke("/mesh/faces", 7, 241); }
static void v_gates_behind(void) { poke("/mesh/faces", 51, 1); }
/* All separate, in numbers of five bytes: 64 instead of 52. */
static void v_gates_long(void)
{
    for (unsigned i = 0; i < 4; i++)
        poke("/mesh/faces", i, 0);
    for (unsigned i = 0; i < 12; i++)
        poke("/mesh/faces", 4 + i, 240);
    for (unsigned i = 4; i < 9; i++)
        poke("/mesh/faces", 16 + 4 * i, 1 + i % 3);
}
static void v_attributes_image(void) { set_text("/attributes/001", "columns", "sha256"); }
/* The row of the colour of the root becomes a row of a missing array; the number of the first one
 * is beyond those after it. */
static void v_checksums_fewer(void) { poke("/chunk_checksums", 3, INT64_C(14) << 32); }
static void v_checksums_order(void) { poke("/chunk_checksums", 0, INT64_C(70) << 32); }
static void v_content(void) { poke("/mesh/vertices", 0, 2); }

/* --- ranges of the header --- */

static void v_unit_long(void) { set_text("/", "unit", "a unit with more than 31 bytes, m"); }
static void v_subset_error(void) { set_reals("subset_error", 0, 0, 0); }
static void v_subset_box(void)
{
    set_six("subset_box", (const double[6]){ 0, 0.5, 0, 1, 0.25, 1 });
}
static void select_at_random(double percent, double k_root)
{
    set_text("/", "selection", "random");
    set_text("/", "selection_normals", "angle");
    add_real("/", "selection_percent", percent);
    add_real("/", "selection_k_root", k_root);
}
static void v_percent(void)
{
    select_at_random(101, 0);
    add_count("/", "selection_seed", 1);
}
static void v_k_root(void)
{
    select_at_random(50, -1);
    add_count("/", "selection_seed", 1);
}
static void v_no_seed(void) { select_at_random(50, 0); }
static void v_words_long(void)
{
    char names[257];
    memset(names, 'n', 256);
    names[256] = 0;
    set_text("/attributes/002", "columns", names);
}
static void v_lengths(void) { set_count("/attributes/006", "lengths_differ", 2); }

/* A white node of the root becomes a black one. */
static void v_black_surface(void)
{
    poke("/levels/01/types", 0, (11199 & ~(3 << 14)) | 1 << 14);
    set_count("/levels/01", "white", count_of("/levels/01", "white") - 1);
    set_count("/levels/01", "black", 1);
}
static void v_corner_new(void) { poke("/mesh/faces", 11, 0); }
static void v_gate_new(void) { poke("/mesh/faces", 5, 2); } /* t = 0, as k = 2 before */

/* --- subtrees --- */

static hsize_t cols_of(const char *path)
{
    hsize_t dims[2] = { 0, 0 };
    hid_t id = H5Dopen2(changed, path, H5P_DEFAULT), space = H5Dget_space(id);
    need(H5Sget_simple_extent_dims(space, dims, NULL) == 2, path);
    H5Sclose(space);
    H5Dclose(id);
    return dims[1];
}
enum { GRAY_COLUMN = 6, END_COLUMN = 12 }; /* of the first level below the roots */
static void v_subtree_index(void) { add_to("/subtrees/index", 0, 1); }
static void v_subtree_sum(void)
{
    add_to("/subtrees/index", (unsigned)cols_of("/subtrees/index") + GRAY_COLUMN, 1);
}
static void v_subtree_counts(void) { add_to("/subtrees/counts", GRAY_COLUMN, 1); }
/* Moves items from one subtree to the next, so that the sums agree. */
static void move_items(unsigned column)
{
    unsigned cols = (unsigned)cols_of("/subtrees/counts");
    add_to("/subtrees/counts", column, 1);
    add_to("/subtrees/counts", cols + column, -1);
}
/* Chunks of 512 rows, where 1,024 are stated; of 48, which is no power of two. */
static void v_rows_of_vertices(void)
{
    hsize_t rows = count_of("/", "vertex_count");
    replace("/mesh/vertices",
            (new_array){ H5T_STD_U32LE, rows, 3, 512, false, false, checksum, NULL });
}
static void v_rows_of_level(void)
{
    hsize_t leaves = count_of("/levels/04", "leaf");
    replace("/levels/04/leaf_skip",
            (new_array){ H5T_STD_U32LE, leaves, 0, 48, false, false, checksum, NULL });
}
static void v_subtree_gray(void) { move_items(GRAY_COLUMN); }
static void v_subtree_end(void) { move_items(END_COLUMN); }
/* A byte more for the first chunk, and one less for the second. */
static void v_places_header(void)
{
    add_to("/subtrees/chunk_directory", 0, 1);
    add_to("/subtrees/chunk_directory", 1, -1);
}

/* --- limits of attributes --- */

static void v_header_long(void)
{
    replace("/attributes/header",
            (new_array){ H5T_STD_U8LE, (1 << 20) + 1, 0, 1 << 16, false, false, zstd, NULL });
}
static void shuffled_zstd(hid_t dcpl)
{
    H5Pset_shuffle(dcpl);
    zstd(dcpl);
}
/* Keeps the attributes that the array needs. */
static void replace_list(const char *path, new_array a)
{
    static const char *const names[] = { "element", "columns", "type", "list" };
    char text[4][64] = { { 0 } };
    for (int i = 0; i < 4; i++)
        get_text(path, names[i], text[i], sizeof text[i]);
    replace(path, a);
    for (int i = 0; i < 4; i++)
        set_text(path, names[i], text[i]);
    add_count(path, "lengths_differ", 1);
}
static void v_textures(void)
{
    replace_list("/attributes/000",
                 (new_array){ H5T_STD_U64LE, 1001, 0, 1001, false, false, shuffled_zstd, NULL });
}
static void v_texture_texts(void)
{
    replace("/attributes/000_items",
            (new_array){ H5T_STD_U8LE, (1 << 24) + 1, 0, 1 << 16, false, false, zstd, NULL });
}

/* --- what only verifiers refuse --- */

static void v_winding(void) { poke("/levels/01/leaf_winding", 0, 1); }
static void v_plane(void) { add_to("/levels/00/planes", 0, -(INT64_C(700) << 20)); }
static void v_vertex_beyond(void) { poke("/mesh/vertices", 11, (int64_t)0x40000000u << 1); }
/* The third vertex moves from x = 1 to x = 0.5. */
static void v_vertex_moved(void) { add_to("/mesh/vertices", 6, -(INT64_C(1) << 24)); }
/* The last corner names the unused vertex, which gets the position of the vertex before it. */
static void v_open_edges(void)
{
    poke("/mesh/faces", 11, 0);
    for (unsigned k = 0; k < 3; k++)
        poke("/mesh/vertices", 12 + k, 0);
}
static void v_mean(void) { add_to("/levels/01/gray_colours", 0, 1); }
static void v_border_solid(void) { set_text("/", "kind", "solid"); }
static void v_border_counts(void) { set_count("/", "border_loops", 7); }
static void v_border_longest(void) { set_count("/", "border_longest", 4); }
static void v_border_weight(void) { poke("/border/loops", 1, 0); }
static void v_border_weights(void) { poke("/border/loops", 1, INT64_C(1) << 31); }
static void v_border_nan(void) { poke("/border/points", 0, INT64_C(0xfffffffe)); }
static void v_border_changed(void) { poke("/border/loops", 1, 3); }
static void v_border_moved(void) { add_to("/border/points", 6, INT64_C(1) << 21); }
static void v_border_winding(void) { add_to("/levels/01/leaf_winding", 0, 1); }
static void v_inside_solid(void) { set_text("/", "required_parts", "levels mesh inside"); }
static void v_inside_missed(void) { set_text("/", "required_parts", "levels mesh inside"); }
static void v_border_area(void) { set_real("/", "border_area", 17); }
static void v_surface_counts(void) { set_count("/", "surface_patches", 1 << 20); }
static void v_surface_octcode(void) { poke("/surface/patches", 0, 3); }
static void v_surface_faces(void) { poke("/surface/patches", 2, 2305); }
static void v_surface_triangles(void) { add_to("/surface/patches", 3, 1); }
static void v_surface_code(void) { poke("/surface/triangles", 0, 1); }
static void v_surface_changed(void) { add_to("/surface/normals", 0, 1); }
static void v_surface_node(void) { add_to("/surface/patches", 2, -1); }
static void v_surface_error(void) { poke("/surface/patches", 6, 1); }
static void v_volume(void) { set_real("/levels/00", "gray_volume", NAN); }

typedef enum late_change {
    NONE,
    CUT,
    FLIP_CHUNK,
    FLIP_HEAD,
    SWAP_CHUNK,
    MOVE_CHUNKS,
    MOVE_PAGED_CHUNKS,
    SWAP_INDEX,
    SHORTEN,
    NOT_HDF5,
    USER_BLOCK
} late_change;

typedef struct failed_vector {
    const char *name, *base;
    void (*change)(void);
    late_change late; /* changes bytes after the file is closed */
    const char *rule; /* number of the specification's rule */
} failed_vector;

static const failed_vector failed[] = {
    { "not_hdf5", LEAVES, NULL, NOT_HDF5, "R4.1" },
    { "cut_off", LEAVES, NULL, CUT, "R4.1" },
    { "user_block", LEAVES, NULL, USER_BLOCK, "R4.2" },
    { "head_bit_flipped", LEAVES, NULL, FLIP_HEAD, "R4.3" },
    { "format_wrong", LEAVES, v_format, NONE, "R5.6" },
    { "format_missing", LEAVES, v_format_missing, NONE, "R5.1" },
    { "version_major_2", LEAVES, v_major, NONE, "R5.7" },
    { "version_draft", LEAVES, v_draft, NONE, "R5.8" },
    { "required_part_unknown", LEAVES, v_required, NONE, "R5.17" },
    { "required_part_unknown_told_first", LEAVES, v_required_first, NONE, "R5.17" },
    { "required_part_levels_missing", LEAVES, v_no_levels_part, NONE, "R5.16" },
    { "part_listed_twice", LEAVES, v_part_twice, NONE, "R5.10" },
    { "maps_without_mesh", NO_MESH, v_maps_alone, NONE, "R5.18" },
    { "gates_without_mesh", NO_MESH, v_gates_alone, NONE, "R5.18" },
    { "gates_without_their_word", GATES, v_gates_unsaid, NONE, "R4.24" },
    { "gates_by_another_word", GATES, v_gates_word, NONE, "R4.24" },
    { "gates_beyond_the_list", GATES, v_gate, NONE, "RB.1" },
    { "gates_third_beyond_the_list", GATES, v_third, NONE, "RB.1" },
    { "gates_number_above_seen", GATES, v_gate_number, NONE, "RB.3" },
    { "gates_byte_of_no_number", GATES, v_gate_low, NONE, "RB.2" },
    { "gates_streams_too_long", GATES, v_gates_long, NONE, "RB.4" },
    { "gates_bytes_behind", GATES, v_gates_behind, NONE, "RB.5" },
    { "subset_without_its_word", BOXED, v_subset_word, NONE, "R6.6" },
    { "subset_of_missing", BOXED, v_subset_of, NONE, "R5.1" },
    { "subset_levels_0", CUT_SHORT, v_subset_level, NONE, "R5.2" },
    { "pruned_more_than_gray", BOXED, v_pruned_more, NONE, "R6.5" },
    { "pruned_not_counted", BOXED, v_pruned_less, NONE, "R6.11" },
    { "subtree_level_0", SUBTREES, v_subtree_level, NONE, "R5.2" },
    { "subtree_table_missing", SUBTREES, v_subtree_table, NONE, "R4.10" },
    { "chunk_directory_of_another_array", CHUNKS, v_places_array, NONE, "RC.5" },
    { "chunk_directory_beyond_the_end", CHUNKS, v_places_end, NONE, "RC.6" },
    { "chunk_directory_of_impossible_bytes", CHUNKS, v_places_bytes, NONE, "RC.7" },
    { "chunk_directory_missing", SUBTREES, v_places, NONE, "R4.10" },
    { "shared_chunks_missing", CHUNKS, v_outer, NONE, "RC.3" },
    { "pruned_in_a_whole_file", DEEP, v_pruned_whole, NONE, "R6.6" },
    { "pruned_of_wrong_type", LEAVES, v_pruned_type, NONE, "R4.22" },
    { "attribute_missing", LEAVES, v_attribute_missing, NONE, "R5.1" },
    { "attribute_of_wrong_type", LEAVES, v_attribute_type, NONE, "R4.22" },
    { "text_of_variable_length", LEAVES, v_variable, NONE, "R4.23" },
    { "kind_unknown", LEAVES, v_kind, NONE, "R5.4" },
    { "unit_with_control_character", LEAVES, v_control, NONE, "R2.1" },
    { "digest_not_hexadecimal", LEAVES, v_digest_text, NONE, "R5.5" },
    { "box_nan", LEAVES, v_nan_box, NONE, "R7.1" },
    { "box_flat", LEAVES, v_flat_box, NONE, "R7.1" },
    { "box_inexact", LEAVES, v_inexact_box, NONE, "R7.1" },
    { "level_count_22", LEAVES, v_level_count, NONE, "R5.11" },
    { "level_count_beyond_levels", LEAVES, v_level_beyond, NONE, "R6.4" },
    { "max_level_below_levels", LEAVES, v_max_level, NONE, "R5.11" },
    { "face_count_huge", LEAVES, v_faces_huge, NONE, "R5.2" },
    { "face_count_beyond_source", NO_MAPS, v_faces_more, NONE, "R5.12" },
    { "dropped_faces_beyond_source", DROPPED, v_dropped, NONE, "R5.13" },
    { "dropped_faces_still_there", DROPPED, v_dropped_kept, NONE, "R5.12" },
    { "weld_distance_0", WELDED, v_weld_none, NONE, "R5.2" },
    { "weld_distance_infinite", WELDED, v_weld_infinite, NONE, "R5.2" },
    { "weld_distance_without_welding", WELDED, v_weld_not_requested, NONE, "R5.14" },
    { "weld_moved_negative", WELDED, v_weld_moved, NONE, "R5.2" },
    { "weld_moved_missing", WELDED, v_weld_moved_missing, NONE, "R5.1" },
    { "vertex_count_beyond_source", NO_MAPS, v_source_less, NONE, "R5.12" },
    { "gray_at_deepest_level", LEAVES, v_gray_deep, NONE, "R6.4" },
    { "nodes_do_not_add_up", LEAVES, v_nodes, NONE, "R6.3" },
    { "planes_more_than_nodes_can_have", LEAVES, v_planes_many, NONE, "R6.7" },
    { "count_of_absent_part", LEAVES, v_absent_part, NONE, "R6.2" },
    { "planes_count_wrong", DEEP, v_planes_count, NONE, "R4.9" },
    { "new_faces_do_not_add_up", LEAVES, v_new_sum, NONE, "R6.8" },
    { "level_missing", LEAVES, v_level_missing, NONE, "R6.1" },
    { "array_missing", LEAVES, v_array_missing, NONE, "R4.10" },
    { "group_in_place_of_array", LEAVES, v_group_for_array, NONE, "R4.5" },
    { "soft_link_in_place_of_array", LEAVES, v_soft_link, NONE, "R4.4" },
    { "external_link_in_place_of_group", LEAVES, v_external_link, NONE, "R4.4" },
    { "array_big_endian", ONE, v_big_endian, NONE, "R2.2" },
    { "array_signed", ONE, v_signed, NONE, "R4.8" },
    { "array_of_floats", ONE, v_float, NONE, "R4.8" },
    { "vertices_of_other_width", ONE, v_wide, NONE, "R4.8" },
    { "array_with_two_columns", ONE, v_shape, NONE, "R4.9" },
    { "array_too_long", ONE, v_length, NONE, "R4.9" },
    { "array_with_other_chunks", ONE, v_chunk, NONE, "R4.11" },
    { "array_contiguous", ONE, v_contiguous, NONE, "R4.6" },
    { "array_in_external_storage", ONE, v_external_storage, NONE, "R4.6" },
    { "array_virtual", ONE, v_virtual, NONE, "R4.6" },
    { "array_unlimited", ONE, v_unlimited, NONE, "R4.7" },
    { "array_with_unknown_filter", ONE, v_unknown_filter, NONE, "R4.13" },
    { "array_with_other_filter", ONE, v_filter, NONE, "R4.13" },
    { "chunk_bit_flipped", LEAVES, NULL, FLIP_CHUNK, "R4.17" },
    { "chunk_larger_than_it_can_be", LEAVES, v_long_chunk, NONE, "R4.16" },
    { "chunk_frame_without_checksum", LEAVES, v_no_checksum, NONE, "R4.19" },
    { "chunk_frame_with_unused_bit", LEAVES, v_unused_bit, NONE, "R4.20" },
    { "chunk_frame_repeats_once", LEAVES, v_repeated_once, NONE, "R4.21" },
    { "chunk_frame_of_other_size", LEAVES, NULL, SWAP_CHUNK, "R4.18" },
    { "root_with_siblings", LEAVES, v_root_siblings, NONE, "R6.10" },
    { "types_contradict_counts", LEAVES, v_types, NONE, "R6.10" },
    { "types_gray_at_deepest_level", LEAVES, v_types_gray, NONE, "R6.10" },
    { "plane_code_of_no_plane", DEEP, v_plane_code, NONE, "R8.1" },
    { "plane_counts_wrong", DEEP, v_plane_counts, NONE, "R6.13" },
    { "leaf_plane_code_of_no_plane", DEEP, v_leaf_plane, NONE, "R8.1" },
    { "leaf_skip_beyond_faces", LEAVES, v_skip, NONE, "R6.15" },
    { "leaf_skip_far_beyond_faces", LEAVES, v_skip_far, NONE, "R6.15" },
    { "leaf_new_too_large", LEAVES, v_leaf_new, NONE, "R6.15" },
    { "leaf_ref_count_too_large", LEAVES, v_ref_counts, NONE, "R6.13" },
    { "leaf_ref_not_before_first", LEAVES, v_refs, NONE, "R6.16" },
    { "leaves_out_of_depth_first_order", ODD, v_order, NONE, "R7.3" },
    { "black_node_outside", ODD, v_black, NONE, "R6.14" },
    { "white_node_inside", ODD, v_white, NONE, "R6.14" },
    { "vertex_nan", LEAVES, v_nan, NONE, "R9.1" },
    { "face_vertex_below_zero", LEAVES, v_corner, NONE, "R9.2" },
    { "face_vertex_before_first_use", LEAVES, v_corner_first, NONE, "R9.2" },
    { "faces_index_wrong", LONG, v_faces_index, NONE, "R6.17" },
    { "map_number_twice", LEAVES, v_map_twice, NONE, "R9.4" },
    { "map_number_out_of_range", LEAVES, v_map_far, NONE, "R9.4" },
    { "coding_unknown", LEAVES, v_coding, NONE, "R4.24" },
    { "coding_missing", LEAVES, v_coding_missing, NONE, "R4.24" },
    { "version_minor_negative", LEAVES, v_minor, NONE, "R5.2" },
    { "part_list_with_two_spaces", LEAVES, v_two_spaces, NONE, "R5.9" },
    { "unit_with_c1_character", LEAVES, v_c1, NONE, "R2.1" },
    { "group_of_zeros", NO_MESH, v_zero_group, NONE, "R6.11" },
    { "group_without_leaf_or_gray_node", NO_MESH, v_closed_group, NONE, "R6.11" },
    { "two_pipelines", LEAVES, v_two_pipelines, NONE, "R4.14" },
    { "filter_mask", LEAVES, v_filter_mask, NONE, "R4.15" },
    { "chunk_missing", ONE, v_missing_chunk, NONE, "R4.12" },
    { "chunk_behind_the_end", ONE, NULL, SHORTEN, "R4.12" },
    { "types_index_wrong", INDEXED, v_types_index, NONE, "R6.17" },
    { "gray_index_wrong", INDEXED, v_gray_index, NONE, "R6.17" },
    { "leaf_index_wrong", LISTS, v_leaf_index, NONE, "R6.17" },
    { "content_changed", LEAVES, v_content, NONE, "RF.1" },
    { "attributes_changed", COLOURED, v_attributes_changed, NONE, "RD.7" },
    { "attributes_array_missing", COLOURED, v_attributes_missing, NONE, "R4.10" },
    { "attributes_too_many", COLOURED, v_attributes_many, NONE, "RD.1" },
    { "attributes_of_unknown_type", COLOURED, v_attributes_type, NONE, "R5.4" },
    { "attributes_of_other_width", COLOURED, v_attributes_width, NONE, "RD.2" },
    { "attributes_with_too_few_columns", COLOURED, v_attributes_names, NONE, "RD.4" },
    { "attributes_of_other_rows", COLOURED, v_attributes_element, NONE, "RD.3" },
    { "attributes_of_unknown_coding", COLOURED, v_attributes_coding, NONE, "R4.24" },
    { "attributes_lists_end_before", COLOURED, v_attributes_ends, NONE, "RD.5" },
    { "attributes_lists_end_beyond", COLOURED, v_attributes_items, NONE, "RD.5" },
    { "colour_beyond_24_bits", PAINTED, v_colour, NONE, "RE.1" },
    { "colours_array_missing", PAINTED, v_colours_missing, NONE, "R4.10" },
    { "colours_without_checksum", PAINTED, v_colours_digest, NONE, "R5.1" },
    { "colours_changed", PAINTED, v_colours_changed, NONE, "RE.2" },
    { "border_of_a_solid", BORDER, v_border_solid, NONE, "RK.1" },
    { "border_counts", BORDER, v_border_counts, NONE, "RK.2" },
    { "border_longest", BORDER, v_border_longest, NONE, "RK.3" },
    { "border_weight_zero", BORDER, v_border_weight, NONE, "RK.3" },
    { "border_weights_large", BORDER, v_border_weights, NONE, "RK.3" },
    { "border_nan", BORDER, v_border_nan, NONE, "RK.4" },
    { "border_changed", BORDER, v_border_changed, NONE, "RK.5" },
    { "unverified_border_moved", BORDER, v_border_moved, NONE, "RK.6" },
    { "unverified_border_winding", BORDER, v_border_winding, NONE, "RK.7" },
    { "unverified_border_area", BORDER, v_border_area, NONE, "RK.8" },
    { "inside_of_a_solid", LEAVES, v_inside_solid, NONE, "RK.9" },
    { "unverified_inside_missed", BORDER, v_inside_missed, NONE, "RK.10" },
    { "surface_counts", PATCHES, v_surface_counts, NONE, "RL.1" },
    { "surface_octcode", PATCHES, v_surface_octcode, NONE, "RL.2" },
    { "surface_faces", PATCHES, v_surface_faces, NONE, "RL.3" },
    { "surface_triangles", PATCHES, v_surface_triangles, NONE, "RL.4" },
    { "surface_code", PATCHES, v_surface_code, NONE, "RL.5" },
    { "surface_changed", PATCHES, v_surface_changed, NONE, "RL.6" },
    { "unverified_surface_node", PATCHES, v_surface_node, NONE, "RL.7" },
    { "unverified_surface_error", PATCHES, v_surface_error, NONE, "RL.8" },
    { "attributes_without_mesh", COLOURED, v_attributes_no_mesh, NONE, "R5.18" },
    { "chunk_in_place_of_another", SUMMED, NULL, MOVE_CHUNKS, "RF.4" },
    { "paged_chunk_in_place_of_another", PAGED, NULL, MOVE_PAGED_CHUNKS, "RF.5" },
    { "chunk_checksums_of_fewer_chunks", SUMMED, v_checksums_fewer, NONE, "RF.3" },
    { "chunk_checksums_out_of_order", SUMMED, v_checksums_order, NONE, "RF.2" },
    { "attributes_image_of_another_digest", TEXTURED, v_attributes_image, NONE, "RD.9" },
    { "chunk_fletcher32_wrong", ONE, NULL, FLIP_CHUNK, "R4.17" },
    { "unit_too_long", LEAVES, v_unit_long, NONE, "R5.3" },
    { "attributes_columns_too_long", COLOURED, v_words_long, NONE, "R5.3" },
    { "attributes_lengths_differ_2", COLOURED, v_lengths, NONE, "R5.2" },
    { "subset_error_0", CLOSE, v_subset_error, NONE, "R5.2" },
    { "subset_box_reversed", BOXED, v_subset_box, NONE, "R5.15" },
    { "selection_percent_101", LEAVES, v_percent, NONE, "R5.2" },
    { "selection_k_root_negative", LEAVES, v_k_root, NONE, "R5.2" },
    { "selection_seed_missing", LEAVES, v_no_seed, NONE, "R5.1" },
    { "black_node_of_a_surface", SURFACE, v_black_surface, NONE, "R6.12" },
    { "face_vertex_beyond_last", LEAVES, v_corner_new, NONE, "R9.3" },
    { "gates_vertex_beyond_last", GATES, v_gate_new, NONE, "RB.6" },
    { "subtree_index_not_0", CHUNKS, v_subtree_index, NONE, "RC.1" },
    { "subtree_index_wrong", MANY, v_subtree_sum, NONE, "RC.2" },
    { "subtree_counts_wrong", CHUNKS, v_subtree_counts, NONE, "RC.2" },
    { "subtree_chunks_of_vertices", CHUNKS, v_rows_of_vertices, NONE, "R4.11" },
    { "subtree_chunks_of_a_level", CHUNKS, v_rows_of_level, NONE, "R4.11" },
    { "subtree_row_of_other_nodes", MANY, v_subtree_gray, NONE, "RC.4" },
    { "subtree_row_of_another_end", CHUNKS, v_subtree_end, NONE, "RC.4" },
    { "chunk_directory_contradicts_a_header", CHUNKS, v_places_header, NONE, "RC.8" },
    { "attributes_header_too_long", COLOURED, v_header_long, NONE, "RD.6" },
    { "attributes_textures_too_many", TEXTURED, v_textures, NONE, "RD.8" },
    { "attributes_texture_texts_too_long", TEXTURED, v_texture_texts, NONE, "RD.8" },
    { "unverified_volume", LEAVES, v_volume, NONE, "R6.9" },
    { "unverified_vertex_outside_the_root_cell", LEAVES, v_vertex_beyond, NONE, "R7.2" },
    { "unverified_face_in_a_white_cell", DEEP, v_vertex_moved, NONE, "R7.4" },
    { "unverified_face_far_from_its_leaf", LEAVES, v_vertex_moved, NONE, "R7.5" },
    { "unverified_plane_cuts_the_solid", LEAVES, v_plane, NONE, "R8.2" },
    { "unverified_winding_number", LEAVES, v_winding, NONE, "R10.1" },
    { "unverified_edges_do_not_balance", UNUSED, v_open_edges, NONE, "R10.2" },
    { "unverified_chunk_index", CHUNKS, NULL, SWAP_INDEX, "RC.9" },
    { "unverified_colour", PAINTED, v_mean, NONE, "RE.3" },
};

enum { USER_BLOCK_BYTES = 512 };

/* Exchanges two chunks of equal size, each with its own checksum. */
static void move_chunks(const char *path, uint8_t *data)
{
    hsize_t bytes = 0, other_bytes = 0;
    uint8_t kept[64];
    changed = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    haddr_t at = chunk_address("/levels/02/leaf_new", &bytes),
            other = chunk_address("/levels/02/leaf_ref_count", &other_bytes);
    H5Fclose(changed);
    need(bytes == other_bytes && bytes <= sizeof kept && memcmp(data + at, data + other, bytes),
         "chunks to exchange");
    memcpy(kept, data + at, bytes);
    memcpy(data + at, data + other, bytes);
    memcpy(data + other, kept, bytes);
}

/* Exchanges the first two chunks of the vertices, which are one after the other. */
static void move_paged_chunks(const char *path, uint8_t *data)
{
    hsize_t bytes = 0;
    changed = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    haddr_t at = chunk_address("/mesh/vertices", &bytes);
    H5Fclose(changed);
    for (hsize_t i = 0; i < bytes; i++) {
        uint8_t kept = data[at + i];
        data[at + i] = data[at + bytes + i];
        data[at + bytes + i] = kept;
    }
}

/* Writes HDF5's checksum behind `size` bytes. */
static void state_checksum(uint8_t *block, size_t size)
{
    uint32_t checksum_of_block = ebpo_lookup3(block, size);
    for (unsigned i = 0; i < 4; i++)
        block[size + i] = (uint8_t)(checksum_of_block >> 8 * i);
}

/* Exchanges the offsets of the two chunks of /mesh/vertices in HDF5's index, not in the chunk
 * directory. The chunks have equal size. */
static void swap_index(const char *path, uint8_t *data, size_t size)
{
    enum { PREFIX = 14 };
    hsize_t bytes = 0, at[2] = { 1024, 0 };
    unsigned mask;
    haddr_t second;
    uint8_t kept[8];
    changed = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    haddr_t first = chunk_address("/mesh/vertices", &bytes);
    hid_t id = H5Dopen2(changed, "/mesh/vertices", H5P_DEFAULT);
    need(H5Dget_chunk_info_by_coord(id, at, &mask, &second, &bytes) >= 0, "the second chunk");
    H5Dclose(id);
    H5Fclose(changed);
    for (size_t i = 0; i + PREFIX + sizeof first < size; i++) {
        uint8_t *entry = data + i + PREFIX;
        size_t step = 8;
        if (memcmp(data + i, "FADB", 4) != 0 || memcmp(entry, &first, sizeof first) != 0)
            continue;
        while (memcmp(entry + step, &second, sizeof second) != 0)
            step++;
        memcpy(kept, entry, 8);
        memcpy(entry, entry + step, 8);
        memcpy(entry + step, kept, 8);
        state_checksum(data + i, PREFIX + 2 * step);
        return;
    }
    die(path, "no chunk index of /mesh/vertices");
}

static void change_bytes(const char *path, late_change late)
{
    size_t size;
    hsize_t chunk_size = 0, other_size = 0;
    uint8_t *data = slurp(path, &size);
    changed = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    haddr_t faces = chunk_address("/mesh/faces", &chunk_size),
            types = chunk_address("/levels/00/types", &other_size);
    H5Fclose(changed);
    switch (late) {
    case CUT: size -= 40; break;
    case FLIP_CHUNK: data[faces + chunk_size / 2] ^= 16; break;
    case FLIP_HEAD: data[60] ^= 16; break;
    case SWAP_CHUNK: memcpy(data + faces, data + types, other_size); break;
    case MOVE_CHUNKS: move_chunks(path, data); break;
    case MOVE_PAGED_CHUNKS: move_paged_chunks(path, data); break;
    case SWAP_INDEX: swap_index(path, data, size); break;
    case SHORTEN: /* the last chunk is behind the end that the superblock states */
        data[28] -= 4;
        state_checksum(data, 44);
        break;
    case USER_BLOCK:
        data = realloc(data, size + USER_BLOCK_BYTES);
        need(data != NULL, "memory");
        memmove(data + USER_BLOCK_BYTES, data, size);
        memset(data, ' ', USER_BLOCK_BYTES);
        size += USER_BLOCK_BYTES;
        break;
    case NOT_HDF5: memset(data, ' ', size = 64); break;
    case NONE: break;
    }
    spill(path, data, size);
    free(data);
}

static void make_vector(const failed_vector *v)
{
    char from[512], path[512], text[2048];
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
    if (v->change && v->change != v_content && v->change != v_digest_text &&
        v->change != v_colours_changed && v->change != v_border_changed &&
        v->change != v_surface_changed)
        change_objects(path, state_content);
    if (v->late != NONE)
        change_bytes(path, v->late);
    bool verified = strncmp(v->name, "unverified_", 11) == 0;
    if ((vector_read(path, &tree, &error) == EBPO_OK) != verified)
        die(v->name, verified ? error.message : "is read without an error");
    if (verified) {
        ebpo_tree_free(&tree);
        if (!vector_violation(path, text, sizeof text))
            die(v->name, "verifies");
    } else {
        vector_outcome(path, &error, text, sizeof text);
    }
    size_t used = strlen(text);
    snprintf(text + used, sizeof text - used, "Breaks %s\n", v->rule);
    snprintf(path, sizeof path, "%s/failed/%s.txt", folder, v->name);
    spill(path, text, strlen(text));
}

void make_failed(const char *to)
{
    folder = to;
    for (size_t i = 0; i < sizeof failed / sizeof failed[0]; i++)
        make_vector(&failed[i]);
}
