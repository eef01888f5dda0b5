/* SPDX-License-Identifier: MIT
 * Reads and writes .ebpo.h5 files. A file contains a mesh and an octree. The envelope of a node of
 * the octree is a convex polyhedron that contains the part of the solid in the node's cell.
 * format-spec/ describes the format byte by byte.
 *
 *   Contents   ebpo_tree (a whole model in memory), ebpo_level, ebpo_info, ebpo_plane_decode
 *   Writing    ebpo_tree_write
 *   Sources    ebpo_source (bytes from any storage)
 *   Opening    ebpo_open, ebpo_open_with, ebpo_open_memory, ebpo_open_source, ebpo_close
 *   Metadata   ebpo_file_info, ebpo_file_get_stats, ebpo_file_locate
 *   Reading    ebpo_file_read_level, ebpo_file_read_mesh, ebpo_file_read_tree ...
 *   Rewriting  ebpo_file_repack
 */
#ifndef EBPO_FILE_H
#define EBPO_FILE_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version of the format that this library writes. */
#define EBPO_FORMAT_MAJOR 1
#define EBPO_FORMAT_MINOR 1

/* Maximum number of levels of a file: levels 0 to 20. */
#define EBPO_LEVELS_MAX 21

/* ---- contents of a file ---- */

/* Type of a node: two bits in `types` of ebpo_level. The cell of a node includes its boundary. */
typedef enum ebpo_node_type {
    /*
     * No face intersects the cell, and the cell is outside the solid. In a file of a surface, all
     * cells without faces have this type.
     */
    EBPO_WHITE = 0,

    /* No face intersects the cell, and the cell is inside the solid. */
    EBPO_BLACK = 1,

    /* The node lists its faces and has no children. */
    EBPO_LEAF = 2,

    /* The node has eight children, or is pruned: its children are not in this file. */
    EBPO_GRAY = 3
} ebpo_node_type;

/* Rule that decides by the winding number w which points belong to a solid. */
typedef enum ebpo_rule {
    EBPO_RULE_NONZERO = 0, /* w != 0 */
    EBPO_RULE_EVENODD = 1, /* w is odd */
    EBPO_RULE_POSITIVE = 2 /* w > 0 */
} ebpo_rule;

/* Parts of a file, as bits. */
typedef enum ebpo_part {
    EBPO_PART_PLANES = 1,      /* envelope planes of gray nodes */
    EBPO_PART_MESH = 2,        /* vertices, faces, and the leaves' lists of faces */
    EBPO_PART_MAPS = 4,        /* source indices of vertices and faces */
    EBPO_PART_LEAF_PLANES = 8, /* stored envelope planes of leaves */
    EBPO_PART_ATTRIBUTES = 16, /* attributes of vertices, faces and other elements of the source */
    EBPO_PART_COLOURS = 32,    /* mean colour of the faces below each gray node */
    EBPO_PART_BORDER = 64,     /* border of a surface, and winding numbers that decide its inside */
    EBPO_PART_SURFACE = 128    /* simplified faces of nodes, with certified errors, for pictures */
} ebpo_part;

/* Compression of the chunks of a file. */
typedef enum ebpo_codec {
    EBPO_CODEC_ZSTD = 0,    /* HDF5 filter 32015, frames with checksum */
    EBPO_CODEC_DEFLATE = 1, /* built-in filter of HDF5, needs no plugin; fletcher32 checksum */
    EBPO_CODEC_NONE = 2     /* no compression; fletcher32 checksum */
} ebpo_codec;

/* Coding of the vertex indices of faces (format-spec/README.md, section 9). */
typedef enum ebpo_face_coding {
    /*
     * Same as EBPO_FACES_GATES if the tree was read from a file with this coding and the new file's
     * codec is not EBPO_CODEC_NONE. In all other cases the same as EBPO_FACES_HIGH_WATER.
     */
    EBPO_FACES_DEFAULT = 0,

    /*
     * Coding `gates`: each face is coded relative to an edge (gate) of a preceding face. Whole
     * files are 7 to 11 % smaller than with EBPO_FACES_HIGH_WATER; decoding takes longer
     * (docs/develop/codings.md). Since format 1.1.
     */
    EBPO_FACES_GATES = 1,

    /*
     * Coding `high-water`: vertex indices are coded relative to the number of vertices that
     * preceding faces use. It is the only coding of format 1.0.
     */
    EBPO_FACES_HIGH_WATER = 2
} ebpo_face_coding;

/*
 * One level: all its nodes in the order of their octcodes. The octcode of a node is the path from
 * the root to the node: a leading 1, then the octant of each level in three bits. The eight
 * children of the i-th gray node of a level are the i-th group of the next level. An array is NULL
 * if its count is 0, or if the file does not have the part that contains the array.
 */
typedef struct ebpo_level {
    /*
     * Number of groups of eight siblings. Level 0 has one group, of which only octant 0 (the root)
     * exists.
     */
    uint64_t group_count;

    /* Number of nodes of each type. */
    uint64_t gray_count, leaf_count, white_count, black_count;

    /*
     * [group_count] types of the eight nodes of a group: bits 2i and 2i + 1 have the type of octant
     * i. In i, bit 0 is set for the upper half in x, bit 1 in y, bit 2 in z
     */
    uint16_t *types;

    /*
     * [gray_count] number of planes that a node adds to the planes of its ancestors; all these
     * planes bound the node's envelope
     */
    uint8_t *plane_counts;

    /* [plane_count] plane codes (ebpo_plane_decode) of gray nodes, in the order of the nodes */
    uint32_t *planes;

    /* Sum of plane_counts. */
    uint64_t plane_count;

    /*
     * [leaf_count] for solids, and for surfaces with EBPO_PART_BORDER: winding number at the leaf's
     * lowest corner, after the corner was shifted by infinitely small positive numbers
     * (format-spec/README.md, section 10)
     */
    int32_t *leaf_winding;

    /* [black_count] winding number of the cell. NULL: all 1 */
    int32_t *black_winding;

    /*
     * [white_count] winding number of the cell; for surfaces with EBPO_PART_BORDER, winding number
     * at the cell's lowest corner, shifted as for leaf_winding. NULL: all 0
     */
    int32_t *white_winding;

    /* [leaf_count] index of the leaf's first new face */
    uint64_t *leaf_first;

    /*
     * [leaf_count] number of new faces of the leaf. A new face intersects this leaf and no earlier
     * leaf. The new faces are leaf_first .. leaf_first + leaf_new - 1
     */
    uint32_t *leaf_new;

    /*
     * [leaf_count] number of faces that intersect this leaf and an earlier leaf; their indices are
     * below leaf_first
     */
    uint32_t *leaf_ref_count;

    /*
     * [ref_count] indices of the faces that leaf_ref_count counts, in the order of the leaves,
     * ascending within each leaf
     */
    uint32_t *leaf_refs;

    /* Sum of leaf_ref_count. */
    uint64_t ref_count;

    /* Sum of leaf_new. */
    uint64_t new_count;

    /* [leaf_count] number of stored planes of each leaf; part EBPO_PART_LEAF_PLANES */
    uint8_t *leaf_plane_counts;

    /* [leaf_plane_count] plane codes of leaves, in the order of the leaves */
    uint32_t *leaf_planes;

    /* Sum of leaf_plane_counts. */
    uint64_t leaf_plane_count;

    /* Volume of the envelopes of this level's gray nodes, in cubic units of the model. */
    double gray_volume;

    /*
     * Volume of the envelopes of this level's leaves, in cubic units of the model. These envelopes
     * are bounded by the planes of the leaves' ancestors, and by the stored planes of the leaves if
     * the file has them. Readers can derive further planes of a leaf from its faces; the envelopes
     * with derived planes are smaller.
     */
    double leaf_volume;

    /*
     * Number of pruned gray nodes. The next level still has a group for each pruned node. The word
     * of this group in `types` is 0, so the group counts as eight white nodes. On the last level,
     * all gray nodes are pruned and have no groups.
     */
    uint64_t pruned_count;

    /* Workspace that owns all arrays. NULL: the arrays were allocated with malloc. */
    ebpo_workspace *workspace;

    /*
     * [gray_count] mean colour of the faces below the node, sRGB: red + 256 green + 65,536 blue;
     * part EBPO_PART_COLOURS
     */
    uint32_t *gray_colours;
} ebpo_level;

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one at a time per level.
 */
EBPO_API void ebpo_level_free(ebpo_level *level);

/*
 * Decodes the half-space of a plane code. Coordinates are relative to the node's cell: xi = (p -
 * lowest corner) / cell size on each axis, 0 to 1. The half-space contains the points with 4096 *
 * (n . xi) <= d. n and d are integers, and |n0| + |n1| + |n2| = 511. The half-space is exact:
 * readers use these integers without rounding. Returns false for invalid codes.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_plane_decode(uint32_t code, int32_t n[3], int32_t *d);

/* Summary of a level, from the header of the file. */
typedef struct ebpo_level_summary {
    /* Number of nodes of each type. */
    uint64_t gray_count, leaf_count, white_count, black_count;

    /* Number of planes of gray nodes, and of stored planes of leaves. */
    uint64_t plane_count, leaf_plane_count;

    /* Number of new faces of this level's leaves, as in ebpo_level. */
    uint64_t new_count;

    /*
     * Number of references of this level's leaves, ref_count of ebpo_level. A reference is a face
     * of a leaf that also intersects an earlier leaf.
     */
    uint64_t ref_count;

    /* As in ebpo_level. */
    double gray_volume, leaf_volume;

    /*
     * Number of pruned gray nodes. `white_count` of the next level includes eight nodes for each
     * pruned node.
     */
    uint64_t pruned_count;
} ebpo_level_summary;

/* All data of a file except its arrays. */
typedef struct ebpo_info {
    /* Version of the format. */
    int version_major, version_minor;

    /*
     * Name and version of the program that built the model; repacked files and subsets keep this
     * text.
     */
    char generator[64];

    /* Name, format, SHA-256 and size of the mesh file that was converted. */
    char source_name[256], source_format[16];
    uint8_t source_sha256[32];
    uint64_t source_size;

    /*
     * Unit of the coordinates, coordinate reference system and date of the data; "" if not given.
     */
    char unit[32], crs[256], date[32];

    /* True for a solid, false for a surface. */
    bool solid;

    /* Rule that decides which points are inside. */
    ebpo_rule rule;

    /* True: coordinates of vertices are doubles. False: they are floats. */
    bool double_coordinates;

    /* Number of vertices and faces of the mesh in the file. */
    uint64_t vertex_count, face_count;

    /* Number of vertices and faces of the source, before repairs. */
    uint64_t source_vertex_count, source_face_count;

    /* Lowest corner and size of the root cell, in the model's unit. */
    double box_origin[3], box_size[3];

    /* Deepest level for which the coordinates of cells are exact doubles. */
    int grid_level;

    /* Deepest level that was allowed when the tree was built (ebpo_build_options, build.h). */
    int max_level;

    /* Number of levels in the file: levels 0 .. level_count - 1. */
    int level_count;

    /* As in ebpo_build_options (build.h). */
    uint32_t leaf_faces;
    double epsilon;

    /* ebpo_selection (build.h) that selected the planes. */
    int selection;

    /*
     * As in ebpo_build_options (build.h). One of the two is not 0 if `selection` is
     * EBPO_SELECT_KMEDOIDS, EBPO_SELECT_OFFSET or EBPO_SELECT_RANDOM; else both are 0.
     */
    double percent, k_root;

    /* ebpo_normal_distance (build.h), for EBPO_SELECT_KMEDOIDS. */
    int normals;

    /* Seed of EBPO_SELECT_KMEDOIDS and EBPO_SELECT_RANDOM; else 0. */
    uint64_t seed;

    /* Repairs that were made before the conversion. */
    ebpo_repair_record repair_record;

    /*
     * Result of the mesh check: counts of findings, area, volume and so on. The locations of
     * findings are not stored.
     */
    ebpo_mesh_report report;

    /* ebpo_part bits */
    uint32_t parts;

    /* Compression of the chunks. */
    ebpo_codec codec;

    /* Checksum of the decoded arrays (format-spec/README.md). */
    uint8_t content_sha256[32];

    /*
     * Byte offset and size of HDF5's chunk indexes, for prefetching. The chunk indexes are stored
     * after the data of the first levels. Arrays of one chunk have no chunk index. Both members are
     * 0 if the file has no chunk indexes, or does not record their location.
     */
    uint64_t chunk_index_offset, chunk_index_bytes;

    /*
     * Level whose gray nodes are the roots of subtrees. The data of each subtree is contiguous in
     * the file, and a table contains the locations of the subtrees. 0: the file has no table of
     * subtrees.
     */
    int subtree_level;

    /*
     * For a file with a table of subtrees: number of bytes at the beginning of the file that
     * contain all data that is needed to locate a subtree. 0: not recorded.
     */
    uint64_t top_bytes;

    /*
     * True for a subset: children of some gray nodes were omitted (ebpo_subset). `cut_levels`,
     * `boxed`, `kept_box` and `kept_error` are options with which the subset was made.
     */
    bool pruned;

    /* Levels 0 .. cut_levels - 1 were kept. 0: all levels were kept. */
    int cut_levels;

    /* boxed: true if nodes that do not intersect kept_box (min, then max) were omitted. */
    bool boxed;
    double kept_box[6];

    /*
     * Requested error bound: nodes whose envelopes have at most this error bound were pruned. In
     * the model's unit. 0: not requested.
     */
    double kept_error;

    /*
     * content_sha256 of the file from which the subset was made. For a subset of a subset:
     * content_sha256 of the original file, which is not a subset.
     */
    uint8_t subset_of[32];

    /* Summaries of levels 0 .. level_count - 1. */
    ebpo_level_summary level[EBPO_LEVELS_MAX];

    /*
     * Size of the file, and number of bytes before the data of level 0. Both are set when a file is
     * opened.
     */
    uint64_t file_bytes, head_bytes;

    /*
     * First level that can be read only with HDF5's chunk indexes; level_count if there is no such
     * level. It is set when a file is opened.
     */
    int index_level;

    /* Checksum of the colours; for files with EBPO_PART_COLOURS. */
    uint8_t colours_sha256[32];

    /* True if the corners of faces are stored with coding `gates`. */
    bool gates;

    /*
     * True for a surface whose envelopes contain its inside (the points with a winding number that
     * satisfies the rule with the threshold 1/2), so that its levels bound the inside as those of a
     * solid do. Then a leaf without faces is a cell that may hold a part of the inside, and white
     * nodes are outside. The builder sets it for surfaces with EBPO_PART_BORDER and planes.
     */
    bool border_inside;

    /*
     * For files with EBPO_PART_BORDER. border_loops: number of loops of the border. border_points:
     * number of points in all loops. border_longest: number of points in the longest loop.
     * border_area: area of the triangles that close the loops, in square units of the model.
     * border_sha256: checksum of the border.
     */
    uint64_t border_loops, border_points, border_longest;
    double border_area;
    uint8_t border_sha256[32];

    /*
     * For files with EBPO_PART_SURFACE. surface_patches, surface_triangles, surface_vertices:
     * number of patches, triangles and vertices of the simplified surface. surface_code_bytes:
     * number of bytes of the triangle codes. surface_colours: number of vertices with colours,
     * which is 0 or surface_vertices. surface_sha256: checksum of the simplified surface.
     */
    uint64_t surface_patches, surface_triangles, surface_vertices, surface_code_bytes,
        surface_colours;
    uint8_t surface_sha256[32];
} ebpo_info;

/* The border of a surface, as closed loops of points (format-spec/border.md). */
typedef struct ebpo_border_loops {
    uint64_t loop_count, point_count;

    /*
     * [loop_count][2] number of points of each loop, at least 3; weight of each loop, at least 1:
     * number of times that the loop counts in winding numbers
     */
    uint32_t *loop;

    /* [point_count][3] coordinates of the points, loop after loop, in the model's unit */
    double *point;
} ebpo_border_loops;

/* Columns of a patch in ebpo_surface (format-spec/surface.md). */
enum {
    EBPO_PATCH_OCTCODE,
    EBPO_PATCH_FIRST_FACE,
    EBPO_PATCH_FACES,
    EBPO_PATCH_TRIANGLES,
    EBPO_PATCH_VERTICES,
    EBPO_PATCH_CODE_BYTES,
    EBPO_PATCH_ERROR,
    EBPO_PATCH_COLUMNS
};

/*
 * Simplified surfaces of nodes (patches), as they are stored. Patches are sorted by level, and
 * within a level by octcode. ebpo_surface_decode decodes a patch.
 */
typedef struct ebpo_surface {
    uint64_t patch_count, triangle_count, vertex_count, code_bytes, colour_count;
    uint64_t *patch; /* [patch_count][EBPO_PATCH_COLUMNS] values of each patch */
    uint8_t *code;   /* [code_bytes] coded triangles, patch after patch */
    uint16_t *point; /* [vertex_count][3] coded coordinates */
    uint8_t *normal; /* [vertex_count][2] coded unit normals; 0, 0: computed by readers */
    uint8_t *colour; /* [colour_count][3] red, green and blue; NULL: no colours */
    /* [patch_count][2] first vertex and first byte of code of each patch; NULL: each call of
     * ebpo_surface_decode adds up the rows of all patches before */
    uint64_t *first;
} ebpo_surface;

/*
 * A whole model in memory: ebpo_build makes it and ebpo_tree_write writes it. Faces are in the
 * order of the first leaf that they intersect. The order of leaves is depth first, with siblings in
 * the order of their octants. Vertices are in the order of first use, unreferenced vertices last.
 */
typedef struct ebpo_tree {
    ebpo_info info;
    ebpo_level level[EBPO_LEVELS_MAX];
    ebpo_mesh mesh;

    /* [vertex_count] source index of each vertex; NULL: no source indices */
    uint32_t *vertex_source;

    /*
     * [face_count] source index of each face; NULL: no source indices. If the index is
     * source_face_count or more, the face was added when holes were filled
     */
    uint32_t *face_source;

    /*
     * Workspace that owns vertex_source and face_source. NULL: these arrays were allocated with
     * malloc.
     */
    ebpo_workspace *workspace;

    /* The border, if the tree has EBPO_PART_BORDER; its arrays are allocated with malloc. */
    ebpo_border_loops border;

    /*
     * The simplified surface, if the tree has EBPO_PART_SURFACE; its arrays are allocated with
     * malloc.
     */
    ebpo_surface surface;
} ebpo_tree;

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one at a time per tree.
 */
EBPO_API void ebpo_tree_free(ebpo_tree *tree);

/* ---- writing ---- */

/*
 * Selects if the list of chunk checksums is written. Each chunk ends with a checksum, and the list
 * has a copy of the checksums of all chunks (format-spec/checksums.md). With the list, readers
 * detect a chunk that was replaced by another chunk or by another version of the same chunk.
 */
typedef enum ebpo_chunk_checksums {
    EBPO_CHECKSUMS_DEFAULT = 0, /* the list is written */
    EBPO_CHECKSUMS_NONE = 1     /* the list is not written, as in format 1.0 */
} ebpo_chunk_checksums;

/* Options for writing a file (ebpo_tree_write, ebpo_file_repack). */
typedef struct ebpo_write_options {
    size_t struct_size;

    ebpo_codec codec;

    /*
     * Compression level. 0: the default. For deflate, the default is 6. For zstd, it is 16 for
     * simplified surfaces, and 3 for other chunks of less than 4 KiB; for larger chunks, it is 7
     * with a minimum match length of six bytes.
     */
    int codec_level;

    unsigned threads;

    /* ebpo_part bits: parts to write. Parts that the tree does not have are ignored. */
    uint32_t parts;

    ebpo_progress progress;

    /*
     * Minimum for the mean number of faces of the subtrees (format-spec/subtrees.md). All gray
     * nodes of one level are the roots of the subtrees. This is the deepest level whose gray nodes
     * have, on average, at least this number of faces. If there is no such level, it is level 1.
     * The data of a subtree is contiguous, so that one read loads it.
     *
     * 0 (default): the number is 512. With this default, the file has no table of subtrees if no
     * level reaches this number, or if the mesh has fewer than 131,072 faces.
     *
     * EBPO_NO_SUBTREES: no table of subtrees is written, as in format 1.0. Files of fewer than
     * three levels never have such a table.
     */
    uint64_t subtree_faces;

    /* Coding of the faces; used if the mesh is written. */
    ebpo_face_coding face_coding;

    ebpo_chunk_checksums chunk_checksums;
} ebpo_write_options;

/* Value of subtree_faces for a file without subtrees. */
#define EBPO_NO_SUBTREES UINT64_MAX

#define EBPO_WRITE_OPTIONS_INIT                                                    \
    {                                                                              \
        sizeof(ebpo_write_options), EBPO_CODEC_ZSTD, 0, 0, ~0u, { NULL, NULL }, 0, \
            EBPO_FACES_DEFAULT, EBPO_CHECKSUMS_DEFAULT                             \
    }

/*
 * Writes a tree to a file, which is replaced atomically: the new file is written under a temporary
 * name, synced and renamed; then its folder is synced. Equal trees give identical bytes.
 *
 * EBPO_E_ARGUMENT: the tree or the codec is not valid. EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_tree_write(const ebpo_tree *tree, const char *path,
                                                   const ebpo_write_options *options,
                                                   ebpo_error *error);

/* ---- sources ---- */

/* Bytes offset .. offset + size - 1 of a source. */
typedef struct ebpo_range {
    uint64_t offset, size;
} ebpo_range;

/*
 * Source of the bytes of a file. Initialize it with EBPO_SOURCE_INIT. The library may call `read`
 * and `prefetch` from several threads at the same time.
 */
typedef struct ebpo_source {
    size_t struct_size;

    /* Argument that is passed to read, close and prefetch. */
    void *user;

    /* Size of the file in bytes. */
    uint64_t size;

    /*
     * Fills `data` with `size` bytes from `offset` on, or fails. The range is within the source.
     * EBPO_E_PENDING: the bytes are not available yet (async.h). Called by any thread that uses the
     * file.
     */
    ebpo_status (*read)(void *user, uint64_t offset, uint64_t size, void *data, ebpo_error *error);

    /* Called once, when the file is closed or when opening fails. May be NULL. */
    void (*close)(void *user);

    /*
     * Hint that the library will soon read these ranges, most of them once. A remote source fetches
     * the ranges together and in advance. The function must return immediately. Results do not
     * depend on this function. May be NULL.
     */
    void (*prefetch)(void *user, const ebpo_range *ranges, size_t count);

    /*
     * Used only if `prefetch` is not NULL. Number of bytes at the beginning of the file that are
     * already available. If this number is more than 0 and less than `size`, opening reads only
     * these bytes. Later, the chunk offsets of arrays with several chunks are read when they are
     * needed, or by ebpo_file_locate. If this number is 0 or `size`, opening also reads all chunk
     * offsets.
     */
    uint64_t prefetched;
} ebpo_source;

#define EBPO_SOURCE_INIT EBPO_SIZED(ebpo_source)

/* ---- opening ---- */

/*
 * An open file. An ebpo_file does not change, so any number of threads may use one file at the same
 * time.
 */
typedef struct ebpo_file ebpo_file;

/*
 * Opens a file by its path or URL (http.h) and reads only its header: metadata and chunk offsets.
 * Neither opening nor later reading uses libhdf5 or its plugins.
 *
 * Safe for untrusted files: for any bytes, memory accesses stay within allocations, and no code is
 * loaded or executed. Results are computed from the data in the file, so a manipulated file can
 * give wrong results. ebpo_verify checks that the parts of a file are consistent.
 *
 * If another program truncates or damages an open file, reading returns EBPO_E_IO or EBPO_E_FORMAT.
 * The checksum of a chunk detects changed bytes. The list of chunk checksums (ebpo_chunk_checksums)
 * also detects that a chunk was replaced by another valid chunk. For files without this list,
 * ebpo_file_check_content detects such a replacement.
 *
 * If an HDF5 program, such as h5repack, has rewritten a file, the chunks may have no checksums.
 * Opening such a file reads the whole file and compares content_sha256. Later changes of such a
 * file are not detected.
 *
 * EBPO_E_IO. EBPO_E_FORMAT: the file is not an .ebpo.h5 file, or is damaged. EBPO_E_VERSION: the
 * file has another major version, or a part that this library does not know. EBPO_E_UNSUPPORTED:
 * another program, such as h5repack, wrote a layout that only ebpo_open_compat reads. EBPO_E_LIMIT:
 * the decoded arrays are too large for the file size (max_expansion of ebpo_open_options).
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open(const char *path, ebpo_file **out, ebpo_error *error);

/*
 * Maximum total size of the decoded arrays: EBPO_EXPANSION_MAX times the file size, or
 * EBPO_EXPANSION_FREE bytes if this is more.
 */
#define EBPO_EXPANSION_MAX  256
#define EBPO_EXPANSION_FREE (UINT64_C(64) << 20)

/* Options for opening a file; 0 and NULL select defaults. */
typedef struct ebpo_open_options {
    size_t struct_size;

    /* Replaces EBPO_EXPANSION_MAX for this file. 0: EBPO_EXPANSION_MAX. UINT64_MAX: no maximum. */
    uint64_t max_expansion;

    /*
     * Source to open instead of the file at the path. Messages use the path as the file's name. The
     * source is closed as by ebpo_open_source. NULL: the file at the path is opened.
     */
    const ebpo_source *source;

    /* Options for a URL (http.h). */
    const struct ebpo_http_options *http;
} ebpo_open_options;

#define EBPO_OPEN_OPTIONS_INIT EBPO_SIZED(ebpo_open_options)

/*
 * Opens a file as ebpo_open does, with options.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_with(const char *path,
                                                  const ebpo_open_options *options, ebpo_file **out,
                                                  ebpo_error *error);

/*
 * Options for ebpo_open_compat, which may run libhdf5 in a forked process; 0 and NULL select
 * defaults.
 */
typedef struct ebpo_compat_options {
    size_t struct_size;

    /*
     * Number of bytes that the forked process may allocate, in addition to the memory that it
     * inherits from the caller's process. 0: 1 GiB.
     */
    uint64_t memory_bytes;

    /*
     * Limit of the processor time of the forked process, in seconds. 0: 60 seconds, plus one
     * second for each 4 MiB of the file.
     */
    unsigned seconds;

    /* Number of threads for checking the content. 0: all cores. */
    unsigned threads;

    /* Options for a URL (http.h). NULL: defaults. */
    const struct ebpo_http_options *http;

    /* As in ebpo_open_options. */
    uint64_t max_expansion;
} ebpo_compat_options;

#define EBPO_COMPAT_OPTIONS_INIT EBPO_SIZED(ebpo_compat_options)

/*
 * Opens a file as ebpo_open does. A file that ebpo_open rejects with EBPO_E_UNSUPPORTED is
 * converted with libhdf5 in a forked process, without plugins and with limits on memory, time and
 * output. The forked process copies the chunks to an unnamed file in TMPDIR. The copy is about as
 * large as the original. Chunks are encoded again if their filters, size or byte order differ from
 * the format. A file at a URL is first fetched completely to TMPDIR.
 *
 * The complete copy is opened like any other file, and its content checksum is compared. This
 * checksum does not include HDF5 attributes, such as the root's box. The headers that other
 * programs write have no checksums, so use ebpo_verify to find errors in attributes. Sizes in
 * ebpo_info are those of the copy.
 *
 * Errors are those of ebpo_open. EBPO_E_FORMAT: libhdf5 rejected the file or crashed, or the
 * content does not match its checksum. EBPO_E_IO: the process or the temporary file could not be
 * made. EBPO_E_UNSUPPORTED: the library was built without libhdf5.
 *
 * Threads: any. If the caller has a SIGCHLD handler that waits for all children, the call can
 * return EBPO_E_FORMAT.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_compat(const char *path,
                                                    const ebpo_compat_options *options,
                                                    ebpo_file **out, ebpo_error *error);

/*
 * Opens a file in memory. The bytes are borrowed until the file is closed. `name` is the name of
 * the file in messages, and may be NULL.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_memory(const void *data, uint64_t size,
                                                    const char *name, ebpo_file **out,
                                                    ebpo_error *error);

/*
 * Opens a file from any source. `name` is the name of the file in messages. The source is closed
 * when the file is closed, and also if opening fails. Exception: if source->struct_size is not set,
 * the call fails and does not close the source.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_source(const ebpo_source *source, const char *name,
                                                    ebpo_file **out, ebpo_error *error);

/*
 * Closes a file. Free the models and streams of the file first.
 *
 * Threads: one at a time per file.
 */
EBPO_API void ebpo_close(ebpo_file *file);

/* ---- metadata ---- */

/*
 * Returns the metadata, valid until the file is closed.
 *
 * Threads: any.
 */
EBPO_API const ebpo_info *ebpo_file_info(const ebpo_file *file);

/* Statistics of requests to the source since opening, including the reading of the header. */
typedef struct ebpo_file_stats {
    size_t struct_size;

    /* Bytes requested from the source. */
    uint64_t bytes_read;

    /* Number of requests to the source. */
    uint64_t reads;
} ebpo_file_stats;

#define EBPO_FILE_STATS_INIT EBPO_SIZED(ebpo_file_stats)

/*
 * Gets statistics of the requests to the source. ebpo_file_get_http_stats reports network
 * transfers.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_file_get_stats(const ebpo_file *file, ebpo_file_stats *out);

/* Description of an array of a file. `coding` and `about` point to static texts. */
typedef struct ebpo_array_facts {
    size_t struct_size;
    char path[48];
    uint64_t rows;
    unsigned columns;       /* 1: one value per row */
    unsigned element_bytes; /* size of a value in the file before compression */
    bool is_signed;
    uint64_t stored_bytes;      /* compressed size; set after ebpo_file_locate */
    const char *coding, *about; /* coding of the values, and their meaning */
} ebpo_array_facts;
#define EBPO_ARRAY_FACTS_INIT EBPO_SIZED(ebpo_array_facts)

/*
 * Describes the n-th array of the file. First come the arrays of the levels, from level 0 on, then
 * the arrays of the root, then the arrays of attributes. If the file has fewer arrays, returns
 * false and does not change `out`.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_file_array(const ebpo_file *file, unsigned n, ebpo_array_facts *out);

/* Description of an array of attributes: values of vertices, faces or other elements. */
typedef struct ebpo_attribute_facts {
    size_t struct_size;

    /* "vertex", "face", or another element of the source. */
    char element[64];

    /* Names of the columns, separated by one space. */
    char names[256];

    /* ebpo_attribute_type of the values. */
    uint64_t type;

    uint64_t rows;

    /* Number of columns. For lists: number of items if all rows have the same number; else 0. */
    uint64_t columns;

    /* 1: each row is a list. 0: each row has one value for each column. */
    uint64_t list;

    /* 1: the file has the range of the values. 0: the file does not have the range. */
    uint64_t has_range;

    /* Minimum and maximum of all values, if has_range is 1. */
    double range[2];

    /* Compressed size in bytes; set after ebpo_file_locate. */
    uint64_t stored_bytes;
} ebpo_attribute_facts;

#define EBPO_ATTRIBUTE_FACTS_INIT EBPO_SIZED(ebpo_attribute_facts)

/*
 * Describes the n-th array of attributes. If the file has fewer arrays, returns false and does not
 * change `out`.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_file_attribute(const ebpo_file *file, unsigned n, ebpo_attribute_facts *out);

/*
 * Returns the static name of an ebpo_attribute_type, "int8" to "float64"; NULL for an invalid type.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_attribute_type_text(uint64_t type);

/* Compressed sizes of parts of the file, in bytes. */
typedef struct ebpo_stored_sizes {
    size_t struct_size;

    /* Size of each level. */
    uint64_t level_bytes[EBPO_LEVELS_MAX];

    /* Size of the vertices, of the faces, and of the source indices (ebpo_maps). */
    uint64_t mesh_vertex_bytes, mesh_face_bytes, map_bytes;

    /* Size of the table of subtrees. */
    uint64_t subtree_bytes;

    /* Size of all arrays of attributes. */
    uint64_t attribute_bytes;

    /* Size of the list of chunk checksums. */
    uint64_t checksum_bytes;

    /* Size of the border, and of the simplified surface. */
    uint64_t border_bytes, surface_bytes;
} ebpo_stored_sizes;

#define EBPO_STORED_SIZES_INIT EBPO_SIZED(ebpo_stored_sizes)

/*
 * Reads all chunk offsets that opening did not read (see `prefetched` of ebpo_source), and computes
 * the compressed sizes. `out` may be NULL.
 *
 * EBPO_E_IO, EBPO_E_FORMAT.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_locate(const ebpo_file *file, ebpo_stored_sizes *out,
                                                    ebpo_error *error);

/*
 * Hint that the levels `first` to `last` will soon be read. `last` may be beyond the last level. A
 * remote source fetches these levels with as few requests as possible. The function may wait for
 * the chunk directory (ebpo_file_locate), but not for levels. Errors are reported by later reads.
 *
 * Threads: any.
 */
EBPO_API void ebpo_file_prefetch_levels(const ebpo_file *file, int first, int last);

/* ---- reading ---- */

/* Options for reading parts of a file. */
typedef struct ebpo_read_options {
    size_t struct_size;

    /* Number of threads. 0: all cores. */
    unsigned threads;

    /*
     * Workspace that owns the results; free it after the results. NULL: the results are allocated
     * with malloc.
     */
    ebpo_workspace *workspace;

    /*
     * For ebpo_file_read_level: ebpo_part bits of the parts to omit. The arrays of these parts are
     * NULL, but their counts are set. For whole trees (ebpo_file_read_tree, ebpo_file_repack) this
     * member must be 0 (EBPO_E_ARGUMENT).
     */
    uint64_t omitted_parts;

    /*
     * 1: ebpo_file_read_mesh and ebpo_file_read_source_mesh also read attributes if the file has
     * attributes. 0: these functions do not read attributes. Functions that read whole trees always
     * read attributes.
     */
    uint64_t attributes;
} ebpo_read_options;

#define EBPO_READ_OPTIONS_INIT                   \
    {                                            \
        sizeof(ebpo_read_options), 0, NULL, 0, 0 \
    }

/*
 * Rules for the reading functions: the caller owns the results and frees them with the function for
 * their type. On failure the results are cleared. All these functions can return EBPO_E_IO and
 * EBPO_E_FORMAT.
 */

/*
 * Reads a level. Checks its counts, the ranges and the order of its values, and its index arrays
 * (running sums of counts, for random access). Freed by ebpo_level_free.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_level(const ebpo_file *file, int level,
                                                        const ebpo_read_options *options,
                                                        ebpo_level *out, ebpo_error *error);

/*
 * Reads the mesh in the order of the file. Freed by ebpo_mesh_free.
 *
 * EBPO_E_ABSENT: the file has no mesh.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_mesh(const ebpo_file *file,
                                                       const ebpo_read_options *options,
                                                       ebpo_mesh *out, ebpo_error *error);

/* Source indices: index of each vertex and face in the mesh that was converted. */
typedef struct ebpo_maps {
    /* [vertex_count] source index of each vertex */
    uint32_t *vertex_source;

    /* [face_count] source index of each face */
    uint32_t *face_source;

    /* Workspace that owns both arrays. NULL: the arrays are allocated with malloc. */
    ebpo_workspace *workspace;
} ebpo_maps;

/*
 * Reads the source indices (part EBPO_PART_MAPS). Checks that the indices of each array are
 * distinct and in range: source indices of vertices are below source_vertex_count; source indices
 * of faces are below source_face_count plus the number of faces that were added when holes were
 * filled.
 *
 * EBPO_E_ABSENT: the file has no source indices.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_maps(const ebpo_file *file,
                                                       const ebpo_read_options *options,
                                                       ebpo_maps *out, ebpo_error *error);

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one at a time per struct.
 */
EBPO_API void ebpo_maps_free(ebpo_maps *maps);

/* Values of an array of attributes. */
typedef struct ebpo_attribute_values {
    /*
     * [rows][columns] values of the array's type, in native byte order. For lists of different
     * lengths: [count] items of all rows, in the order of the rows
     */
    void *values;

    /*
     * [rows] for lists of different lengths: number of items in this row and all rows before it;
     * else NULL
     */
    uint64_t *ends;

    /* Number of items in `values`. */
    uint64_t count;

    /* Workspace that owns both arrays. NULL: the arrays are allocated with malloc. */
    ebpo_workspace *workspace;
} ebpo_attribute_values;

/*
 * Reads the n-th array of attributes, in the order of the file's vertices or faces. Freed by
 * ebpo_attribute_values_free.
 *
 * EBPO_E_ABSENT: the file has no n-th array.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_attribute(const ebpo_file *file, unsigned n,
                                                            const ebpo_read_options *options,
                                                            ebpo_attribute_values *out,
                                                            ebpo_error *error);

/*
 * Reads only the ends of the lists of an array: `values` is NULL, `ends` and `count` are those of
 * ebpo_file_read_attribute. `ends` is NULL for an array without lists or with lists of equal
 * length. Freed by ebpo_attribute_values_free.
 *
 * EBPO_E_ABSENT: the file has no n-th array.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_attribute_ends(const ebpo_file *file, unsigned n,
                                                            const ebpo_read_options *options,
                                                            ebpo_attribute_values *out,
                                                            ebpo_error *error);

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one at a time per struct.
 */
EBPO_API void ebpo_attribute_values_free(ebpo_attribute_values *values);

/*
 * Describes the n-th array of attributes of a mesh in memory, and gets its values: of a mesh that
 * was read with attributes, or of ebpo_boolean_mesh. If the mesh has fewer arrays, returns false
 * and does not change `facts` and `values`.
 *
 * facts   without range and stored_bytes
 * values  arrays of the mesh, valid until it is changed or freed; do not free them
 *
 * Threads: any.
 */
EBPO_API bool ebpo_mesh_attribute(const ebpo_mesh *mesh, unsigned n, ebpo_attribute_facts *facts,
                                  ebpo_attribute_values *values);

/*
 * Reads the whole file. Freed by ebpo_tree_free.
 *
 * EBPO_E_ARGUMENT: `omitted_parts` is not 0.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_tree(const ebpo_file *file,
                                                       const ebpo_read_options *options,
                                                       ebpo_tree *out, ebpo_error *error);

/*
 * Reads the mesh. If the file has source indices, the mesh is in the order of the source and
 * *source_order is true; otherwise it is in the order of the file. Freed by ebpo_mesh_free.
 *
 * EBPO_E_ABSENT: the file has no mesh.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_source_mesh(const ebpo_file *file,
                                                              const ebpo_read_options *options,
                                                              ebpo_mesh *out, bool *source_order,
                                                              ebpo_error *error);

/*
 * Computes the content checksum from all arrays, and compares it with content_sha256 of the file.
 * Reads the whole file. Memory: a few chunks per thread, and the texture images in the file.
 *
 * EBPO_E_FORMAT: the checksums differ. EBPO_E_IO.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_check_content(const ebpo_file *file,
                                                           const ebpo_read_options *options,
                                                           ebpo_error *error);

/*
 * Writes the whole content of a file to a new file with the layout of `write` (codec, subtrees;
 * `parts` is ignored). `path` is replaced atomically and may be the path of `file`. Before `path`
 * is replaced, the new file is read again. The new file must have the content_sha256 of `file`, so
 * the content of `file` is checked, too. The whole model is loaded into memory; the workspace of
 * `read` limits this memory.
 *
 * EBPO_E_FORMAT: the content of `file` differs from its checksum. EBPO_E_UNSUPPORTED: the content
 * is correct, but this library would write the arrays in another way (for example, another program
 * chose wider types than needed); no file is written. EBPO_E_IO: also if `path` is the path of
 * `file` and another program has replaced the file since opening. Other errors are those of
 * reading, and of ebpo_tree_write.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_repack(const ebpo_file *file, const char *path,
                                                    const ebpo_read_options *read,
                                                    const ebpo_write_options *write,
                                                    ebpo_error *error);

/*
 * Registers the zstd filter with libhdf5 in this process, so that the caller can read .ebpo.h5
 * files with HDF5 functions.
 *
 * EBPO_E_UNSUPPORTED: libhdf5 rejected the filter.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_register_filters(ebpo_error *error);

/* ---- patches of the simplified surface ---- */

/*
 * A patch: the simplified surface of a node. It replaces the new faces (leaf_new of ebpo_level) of
 * the leaves below the node.
 */
typedef struct ebpo_patch {
    int level;      /* level of the node */
    uint32_t at[3]; /* position of the node's cell, 0 .. 2^level - 1 on each axis */

    /* The patch replaces the faces first_face .. first_face + face_count - 1 of the file. */
    uint64_t first_face, face_count;

    /*
     * Upper bound of the distance of each point of the patch from the replaced faces, and of each
     * point of the replaced faces from the patch. In the model's unit.
     */
    double error;
    uint64_t vertex_count, triangle_count;

    double *xyz;      /* [vertex_count][3] coordinates */
    float *normals;   /* [vertex_count][3] unit normals */
    uint8_t *colours; /* [vertex_count][3] red, green and blue; NULL: the patch has no colours */

    /* [triangle_count][3] vertex indices, counter-clockwise seen from outside */
    uint32_t *triangles;
} ebpo_patch;
#define EBPO_PATCH_INIT                                       \
    {                                                         \
        0, { 0, 0, 0 }, 0, 0, 0, 0, 0, NULL, NULL, NULL, NULL \
    }

/* Frees the arrays and clears the struct. Threads: one at a time per struct. */
EBPO_API void ebpo_patch_free(ebpo_patch *patch);

/* Frees the arrays and clears the struct. Threads: one at a time per struct. */
EBPO_API void ebpo_surface_free(ebpo_surface *surface);

/*
 * Reads the patches of levels first_level to last_level of a file with EBPO_PART_SURFACE. No other
 * part of the file is read. `out` is freed by ebpo_surface_free.
 *
 * EBPO_E_ABSENT: the file does not have the part. EBPO_E_FORMAT: the part has invalid values.
 *
 * Threads: any. Source: format-spec/surface.md.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_surface(const ebpo_file *file, int first_level,
                                                          int last_level, ebpo_surface *out,
                                                          ebpo_error *error);

/*
 * Reads the table of all patches: only out->patch and the counts are set. `out` is freed by
 * ebpo_surface_free. Errors are those of ebpo_file_read_surface.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_patches(const ebpo_file *file, ebpo_surface *out,
                                                          ebpo_error *error);

/*
 * Decodes the patch with this index. `info` is the metadata of the file or tree that has the patch.
 * `out` is freed by ebpo_patch_free.
 *
 * EBPO_E_ARGUMENT: there is no such patch. EBPO_E_FORMAT: the code of the patch is not valid.
 * EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_surface_decode(const ebpo_surface *surface,
                                                       const ebpo_info *info, uint64_t index,
                                                       ebpo_patch *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
