/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: what an .ebpo.h5 file holds, reading and writing it.
 * format-spec/ describes the same, byte by byte.
 *
 *   Contents   ebpo_level, ebpo_info, ebpo_tree: a whole model in memory
 *   Writing    ebpo_tree_write
 *   Sources    ebpo_source: where bytes come from
 *   Opening    ebpo_open, ebpo_open_with, ebpo_open_memory, ebpo_open_source,
 *              ebpo_close
 *   Facts      ebpo_file_info, ebpo_file_get_stats, ebpo_file_locate
 *   Reading    ebpo_file_read_level, ebpo_file_read_mesh, ebpo_file_read_tree ...
 *   Rewriting  ebpo_file_repack
 */
#ifndef EBPO_FILE_H
#define EBPO_FILE_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Of the format that this library writes. */
#define EBPO_FORMAT_MAJOR 1
#define EBPO_FORMAT_MINOR 1

/* Levels 0 to 20. */
#define EBPO_LEVELS_MAX 21

/* ---- what a file holds ---- */

/* A node's type, two bits in `types` of ebpo_level. */
typedef enum ebpo_node_type {
    /*
     * No face touches the closed cell, which lies outside. In a surface: no face
     * touches it.
     */
    EBPO_WHITE = 0,

    /* No face touches the closed cell, which lies inside. */
    EBPO_BLACK = 1,

    /* Lists its faces, and has no children. */
    EBPO_LEAF = 2,

    /*
     * Has eight children; or is pruned: has had them, but they are not in this
     * file.
     */
    EBPO_GRAY = 3
} ebpo_node_type;

/* Which points a solid is made of, by their winding number w. */
typedef enum ebpo_rule {
    EBPO_RULE_NONZERO = 0, /* w != 0 */
    EBPO_RULE_EVENODD = 1, /* w is odd */
    EBPO_RULE_POSITIVE = 2 /* w > 0 */
} ebpo_rule;

/* Parts of a file, as bits. */
typedef enum ebpo_part {
    EBPO_PART_PLANES = 1,      /* envelope planes of gray nodes */
    EBPO_PART_MESH = 2,        /* vertices, faces, and the leaves' lists of faces */
    EBPO_PART_MAPS = 4,        /* numbers in the source, of vertices and faces */
    EBPO_PART_LEAF_PLANES = 8, /* stored envelope planes of leaves */
    EBPO_PART_ATTRIBUTES = 16, /* what the source says of vertices and faces beyond these */
    EBPO_PART_COLOURS = 32     /* means of the faces' colours, of gray nodes */
} ebpo_part;

typedef enum ebpo_codec {
    EBPO_CODEC_ZSTD = 0,    /* HDF5 filter 32015, frames with checksum */
    EBPO_CODEC_DEFLATE = 1, /* HDF5's own, needs no plugin; fletcher32 checksum */
    EBPO_CODEC_NONE = 2
} ebpo_codec;

/* How the corners of faces are written (format-spec/README.md, section 7). */
typedef enum ebpo_face_coding {
    /* As the source of a copy has them, but for EBPO_CODEC_NONE; else `high-water`. */
    EBPO_FACES_USUAL = 0,

    /*
     * Across edges of faces before them: 7 to 11 % off whole files, and more work for
     * readers (docs/develop/codings.md). Since format 1.1.
     */
    EBPO_FACES_GATES = 1,

    /* By number, as in format 1.0. */
    EBPO_FACES_HIGH_WATER = 2
} ebpo_face_coding;

/*
 * One level: all nodes in the order of their octcodes.
 *
 * The i-th gray node of a level has the i-th group of eight children in the next
 * level. An array is NULL if its count is 0 or the file does not have its part.
 */
typedef struct ebpo_level {
    /*
     * Groups of eight siblings; level 0: one group, of which only octant 0
     * exists.
     */
    uint64_t group_count;

    uint64_t gray_count, leaf_count, white_count, black_count;

    /*
     * [group_count]; type of octant i in bits 2i, 2i + 1; octant: bit 0 x, bit 1
     * y, bit 2 z
     */
    uint16_t *types;

    /* [gray_count] planes that the node adds to its parent's envelope */
    uint8_t *plane_counts;

    /* [plane_count] codes, see ebpo_plane_decode; node after node */
    uint32_t *planes;

    uint64_t plane_count;

    /*
     * [leaf_count] winding number at the leaf's lowest corner, shifted (see
     * format-spec); solids only
     */
    int32_t *leaf_winding;

    /* [black_count], NULL: all 1 */
    int32_t *black_winding;

    /* [white_count], NULL: all 0 */
    int32_t *white_winding;

    /* [leaf_count] number of the leaf's first new face */
    uint64_t *leaf_first;

    /*
     * [leaf_count] faces leaf_first .. leaf_first + leaf_new - 1 touch this leaf
     * and no leaf before it
     */
    uint32_t *leaf_new;

    /* [leaf_count] further faces, all of a number below leaf_first */
    uint32_t *leaf_ref_count;

    /* [ref_count] their numbers, ascending within each leaf; leaf after leaf */
    uint32_t *leaf_refs;

    uint64_t ref_count;

    /* Sum of leaf_new */
    uint64_t new_count;

    /* [leaf_count], part EBPO_PART_LEAF_PLANES */
    uint8_t *leaf_plane_counts;

    /* [leaf_plane_count] */
    uint32_t *leaf_planes;

    uint64_t leaf_plane_count;

    /*
     * Volume of the envelopes of this level's gray nodes, in the model's unit
     * cubed.
     */
    double gray_volume;

    /*
     * The same for its leaves: cut by stored planes, else as inherited (planes
     * that readers derive cut off more)
     */
    double leaf_volume;

    /*
     * Of the gray nodes: those whose children are not in the file. Their groups
     * in the next level are 0 (and count as eight white nodes); on the last
     * level all gray nodes are pruned, and have no groups.
     */
    uint64_t pruned_count;

    /* Owns all its arrays; NULL: malloc's. */
    ebpo_workspace *workspace;

    /*
     * [gray_count], part EBPO_PART_COLOURS: red + 256 green + 65,536 blue, sRGB;
     * the mean of what is below the node
     */
    uint32_t *gray_colours;
} ebpo_level;

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one per level.
 */
EBPO_API void ebpo_level_free(ebpo_level *level);

/*
 * The half-space of a plane code, in the coordinates of its node's cell: xi =
 * (p - corner) / cell size on each axis, so that xi is 0 to 1. The envelope keeps
 * the points with 4096 * (n . xi) <= d.
 *
 * All numbers are integers, |n0| + |n1| + |n2| = 511, and a reader never rounds
 * anything. False for the codes that stand for no plane.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_plane_decode(uint32_t code, int32_t n[3], int32_t *d);

/* What the head of a file tells about a level, without reading the level. */
typedef struct ebpo_level_summary {
    uint64_t gray_count, leaf_count, white_count, black_count;
    uint64_t plane_count, leaf_plane_count;

    /* Faces first seen, faces referenced again. */
    uint64_t new_count, ref_count;

    double gray_volume, leaf_volume;

    /*
     * Gray nodes without children; white_count of the next level counts eight
     * for each.
     */
    uint64_t pruned_count;
} ebpo_level_summary;

/* Everything about a file but its arrays. */
typedef struct ebpo_info {
    int version_major, version_minor;
    char generator[64];
    char source_name[256], source_format[16];
    uint8_t source_sha256[32];
    uint64_t source_size;

    /* "" when not given */
    char unit[32], crs[256], date[32];

    /* Else it is a surface. */
    bool solid;

    ebpo_rule rule;
    bool double_coordinates;

    /* Of the mesh in the file */
    uint64_t vertex_count, face_count;

    /* Triangles before mending */
    uint64_t source_vertex_count, source_face_count;

    /* The root cell. */
    double box_origin[3], box_size[3];

    /* Deepest level for which the box is exact. */
    int grid_level;

    /* The limit used in building. */
    int max_level;

    /* Levels 0 .. level_count - 1 are present. */
    int level_count;

    uint32_t leaf_faces;
    double epsilon;

    /* The ebpo_selection (build.h) by which planes were chosen. */
    int selection;

    /* Of the theses' selections, one of the two; else 0. */
    double percent, k_root;

    /* An ebpo_normal_distance, of k-medoids. */
    int normals;

    /* Of k-medoids and random; else 0. */
    uint64_t seed;

    ebpo_mend_record mend;

    /* Counts and measures; places are not stored. */
    ebpo_mesh_report report;

    /* ebpo_part bits */
    uint32_t parts;

    ebpo_codec codec;
    uint8_t content_sha256[32];

    /*
     * Where the places of the chunks of large arrays stand, behind the first
     * levels: for fetching ahead, not relied on; 0: there are none, or the file
     * does not say.
     */
    uint64_t chunk_index_offset, chunk_index_bytes;

    /*
     * The level whose gray nodes are the roots of subtrees: each of these lies
     * together in the file, and a table tells where. 0: there is no such table.
     */
    int subtree_level;

    /*
     * With such a table: all that looking up a subtree takes lies within the first
     * so many bytes. 0: the file does not say.
     */
    uint64_t top_bytes;

    /*
     * A subset: some gray nodes' children were left out (ebpo_subset). The rest
     * below says what was asked for then.
     */
    bool pruned;

    /* Levels 0 .. cut_levels - 1 were kept; 0: all. */
    int cut_levels;

    /* What does not meet kept_box (min, max) was left out. */
    bool boxed;
    double kept_box[6];

    /*
     * Where nodes were pruned for it, their envelopes reach at most so far
     * beyond the model; 0: not asked for.
     */
    double kept_error;

    /*
     * content_sha256 of the file that it was taken from; the first one's, when
     * it was a subset itself.
     */
    uint8_t subset_of[32];

    ebpo_level_summary level[EBPO_LEVELS_MAX];

    /* Set when reading; head: up to the first level. */
    uint64_t file_bytes, head_bytes;

    /*
     * Set when reading: levels from this one on need the index of chunks as
     * well; level_count: none does.
     */
    int index_level;

    /* Checksum of the colours, with EBPO_PART_COLOURS. */
    uint8_t colours_sha256[32];

    /* Corners of faces are stored as `gates`, across edges of other faces. */
    bool gates;
} ebpo_info;

/*
 * A whole model in memory: what ebpo_build makes and ebpo_tree_write writes.
 *
 * The mesh is in the order of the file: faces by the first leaf that they touch,
 * depth first by octcode; vertices by their first use, those without faces last.
 */
typedef struct ebpo_tree {
    ebpo_info info;
    ebpo_level level[EBPO_LEVELS_MAX];
    ebpo_mesh mesh;

    /* [vertex_count] number in the source, or NULL */
    uint32_t *vertex_source;

    /* [face_count]; numbers >= source_face_count: faces added by filling holes */
    uint32_t *face_source;

    /* Owns the two; NULL: malloc's. */
    ebpo_workspace *workspace;
} ebpo_tree;

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one per tree.
 */
EBPO_API void ebpo_tree_free(ebpo_tree *tree);

/* ---- writing ---- */

/*
 * Whether the file tells how each of its chunks ends (format-spec/README.md, section
 * 20), so that readers notice one that is in another's place or of another version.
 */
typedef enum ebpo_chunk_sums {
    EBPO_SUMS_USUAL = 0, /* it does */
    EBPO_SUMS_NONE = 1   /* as in files of 1.0 */
} ebpo_chunk_sums;

typedef struct ebpo_write_options {
    size_t struct_size; /* EBPO_WRITE_OPTIONS_INIT sets it */

    ebpo_codec codec;

    /*
     * 0: the default, 6 of deflate; of zstd 3 for small chunks, and from 4 KiB on
     * 7 without matches of less than six bytes.
     */
    int codec_level;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    /* Bits of ebpo_part: which to write, of those the tree has. */
    uint32_t parts;

    ebpo_progress progress;

    /*
     * What is laid out so that it is read at once (format-spec/README.md, section 9):
     * the subtrees of the deepest level that has at least so many faces for each gray
     * node, or of level 1 where that has fewer. 0: 1,024, and no subtrees in files of
     * fewer than 131,072 faces. EBPO_NO_SUBTREES: none, as in format 1.0. Trees of fewer
     * than three levels have none.
     */
    uint64_t subtree_faces;

    /* Of the mesh, if it is written. */
    ebpo_face_coding face_coding;

    ebpo_chunk_sums chunk_sums;
} ebpo_write_options;

#define EBPO_NO_SUBTREES UINT64_MAX

#define EBPO_WRITE_OPTIONS_INIT                                                    \
    {                                                                              \
        sizeof(ebpo_write_options), EBPO_CODEC_ZSTD, 0, 0, ~0u, { NULL, NULL }, 0, \
            EBPO_FACES_USUAL, EBPO_SUMS_USUAL                                      \
    }

/*
 * Writes a tree as a file, which appears whole or not at all: under a temporary
 * name, synced and renamed, and its folder synced. Equal trees give identical
 * bytes.
 *
 * EBPO_E_ARGUMENT: the tree is not valid, or no such codec. EBPO_E_IO,
 * EBPO_E_CANCELLED, EBPO_E_MEMORY.
 *
 * Threads: any, while nobody changes the tree.
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
 * Where bytes come from. Begin it with EBPO_SOURCE_INIT. Its functions are called
 * by several threads at once, but for `close`.
 */
typedef struct ebpo_source {
    size_t struct_size; /* EBPO_SOURCE_INIT sets it */

    /* Handed to the functions. */
    void *user;

    /* Bytes. */
    uint64_t size;

    /*
     * Fills `data` with `size` bytes from `offset` on, all of which lie within the
     * source, or fails.
     *
     * It may be called from any thread that uses the file.
     */
    ebpo_status (*read)(void *user, uint64_t offset, uint64_t size, void *data, ebpo_error *error);

    /* Called once, when the file is closed or when opening fails. May be NULL. */
    void (*close)(void *user);

    /*
     * Announces ranges within the source that will be read soon, each about once:
     * a source far away fetches them together and ahead of the reader. It does not
     * wait, and nothing depends on it. May be NULL.
     */
    void (*prefetch)(void *user, const ebpo_range *ranges, size_t count);

    /*
     * With `prefetch`: so many bytes at the beginning need no fetching. If they are
     * not the whole file, opening looks at no others. Where the chunks lie of
     * arrays of more than one chunk is read when it is needed, or by
     * ebpo_file_locate.
     */
    uint64_t prefetched;
} ebpo_source;

#define EBPO_SOURCE_INIT EBPO_SIZED(ebpo_source)

/* ---- opening ---- */

/*
 * An open file. It does not change: any number of threads may use it at once.
 */
typedef struct ebpo_file ebpo_file;

/*
 * Opens a file by its path or URL (http.h), and reads its head only: the facts,
 * and where each chunk of each array lies. libhdf5 has no part in it, nor in anything
 * that is read later, and nothing that it could load has.
 *
 * Safe on untrusted files: whatever the bytes, nothing is read or written beyond what
 * was allocated, and nothing is loaded or run because of them. What is answered about a
 * file that was made to deceive is true of that file; ebpo_verify proves that its parts
 * belong together. A file that another program shortens or damages while it is open
 * gives EBPO_E_IO or EBPO_E_FORMAT: chunks have checksums, and the file says which chunk
 * ends with which (ebpo_chunk_sums), so that a whole chunk in another's place is noticed
 * too; of files without that list ebpo_file_check_content tells.
 * Where chunks have no checksums, as in copies by other programs, all of the file is
 * read, and content_sha256 compared, before it is open; later changes are not noticed.
 *
 * EBPO_E_IO. EBPO_E_FORMAT: not such a file, or damaged. EBPO_E_VERSION: another
 * major version, or a part that this library does not know. EBPO_E_UNSUPPORTED: a
 * file that another program, such as h5repack, has laid out in a way that this
 * library does not write. EBPO_E_LIMIT: its arrays take very much more room decoded
 * than in the file (ebpo_open_options). EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open(const char *path, ebpo_file **out, ebpo_error *error);

/*
 * How often the bytes of a file its decoded arrays may take, and how many bytes they
 * may take in any case: small files are never refused. A flat sheet of two million
 * equal squares has 26 times its file; a file that was made to exhaust memory can
 * have thousands of times.
 */
#define EBPO_EXPANSION_MOST 256
#define EBPO_EXPANSION_FREE (UINT64_C(64) << 20)

/* How a file is opened; 0 and NULL: as usual. */
typedef struct ebpo_open_options {
    size_t struct_size; /* EBPO_OPEN_OPTIONS_INIT sets it */

    /* Instead of EBPO_EXPANSION_MOST; UINT64_MAX: any. */
    uint64_t most_expansion;

    /* Open these bytes instead; the name is for messages. Closed as by ebpo_open_source. */
    const ebpo_source *source;

    /* Of a URL: http.h. */
    const struct ebpo_http_options *http;
} ebpo_open_options;

#define EBPO_OPEN_OPTIONS_INIT EBPO_SIZED(ebpo_open_options)

/*
 * ebpo_open with options.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_with(const char *path,
                                                  const ebpo_open_options *options, ebpo_file **out,
                                                  ebpo_error *error);

/* How ebpo_open_compat goes about it; 0 and NULL: as usual. */
typedef struct ebpo_compat_options {
    size_t struct_size; /* EBPO_COMPAT_OPTIONS_INIT sets it */

    /* Bytes that the other process may take, beyond those that this one has; 0: 1 GiB. */
    uint64_t memory_bytes;

    /* Seconds of processor time that it may take; 0: 60, and one for each 4 MiB of the file. */
    unsigned seconds;

    /* For checking the content; 0: all cores. */
    unsigned threads;

    /* Of a URL: http.h. NULL: as usual. */
    const struct ebpo_http_options *http;

    /* As in ebpo_open_options. */
    uint64_t most_expansion;
} ebpo_compat_options;

#define EBPO_COMPAT_OPTIONS_INIT EBPO_SIZED(ebpo_compat_options)

/*
 * ebpo_open, and what it refuses with EBPO_E_UNSUPPORTED is read through libhdf5: in
 * a separate process with limits on memory, time and what it writes, and without
 * plugins. That process writes the chunks, as they are or, where their filters, size or
 * byte order is none of this format, anew, into a file without a name in
 * TMPDIR, about as large as the original; a URL is fetched there as a whole before. The
 * copy is opened as every other file, and its content checksum compared. That does
 * not count attributes, such as the root's box, and such files have no checksums for
 * their heads: ebpo_verify finds what is wrong there. ebpo_info tells the copy's bytes.
 *
 * The errors of ebpo_open. EBPO_E_FORMAT: libhdf5 refused the file or died of it, or
 * its content is not what the head says. EBPO_E_IO: no process or no file could be
 * made. EBPO_E_UNSUPPORTED: this library was built without libhdf5.
 *
 * Threads: any. The process is copied (fork) while it runs; handlers for SIGCHLD
 * that take children which are not theirs make the result EBPO_E_FORMAT.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_compat(const char *path,
                                                    const ebpo_compat_options *options,
                                                    ebpo_file **out, ebpo_error *error);

/*
 * The same from bytes in memory, which stay the caller's and must stay as long as
 * the file. `name` is for messages and may be NULL.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_memory(const void *data, uint64_t size,
                                                    const char *name, ebpo_file **out,
                                                    ebpo_error *error);

/*
 * The same from any source, which is closed with the file. It is also closed if
 * opening fails, unless its struct_size was never set.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_source(const ebpo_source *source, const char *name,
                                                    ebpo_file **out, ebpo_error *error);

/*
 * After the models and streams that were made from the file.
 *
 * Threads: one per file.
 */
EBPO_API void ebpo_close(ebpo_file *file);

/* ---- facts ---- */

/*
 * Valid until the file is closed.
 *
 * Threads: any.
 */
EBPO_API const ebpo_info *ebpo_file_info(const ebpo_file *file);

/* Sums since opening, of which the head's reading is a part. */
typedef struct ebpo_file_stats {
    size_t struct_size; /* EBPO_FILE_STATS_INIT sets it */

    /* Bytes asked of the source. */
    uint64_t bytes_read;

    /* How many times. */
    uint64_t reads;
} ebpo_file_stats;

#define EBPO_FILE_STATS_INIT EBPO_SIZED(ebpo_file_stats)

/*
 * What was asked of the source so far. ebpo_file_get_http_stats tells what went
 * over the net.
 *
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_file_get_stats(const ebpo_file *file, ebpo_file_stats *out);

/* An array of a file. Texts live as long as the library. */
typedef struct ebpo_array_facts {
    size_t struct_size; /* EBPO_ARRAY_FACTS_INIT sets it */
    char path[48];
    uint64_t rows;
    unsigned columns;       /* 1: one number a row */
    unsigned element_bytes; /* in the file, before compression */
    bool is_signed;
    uint64_t stored_bytes;      /* compressed; after ebpo_file_locate */
    const char *coding, *about; /* how numbers are to be read, and what they mean */
} ebpo_array_facts;
#define EBPO_ARRAY_FACTS_INIT EBPO_SIZED(ebpo_array_facts)

/* The n-th array of the file (n from 0) in the order of their bytes.
 *
 * False when there are fewer; `out` is then as it was. Its texts are static.
 *
 * Threads: any. */
EBPO_API bool ebpo_file_array(const ebpo_file *file, unsigned n, ebpo_array_facts *out);

/* An array of attributes: numbers that vertices, faces or other elements have. */
typedef struct ebpo_attribute_facts {
    size_t struct_size; /* EBPO_ATTRIBUTE_FACTS_INIT sets it */

    /* "vertex", "face", or another element of the source. */
    char element[64];

    /* Of each column, with one space between them. */
    char names[256];

    /* Of the values: an ebpo_attribute_type. */
    uint64_t type;

    uint64_t rows;

    /* Of a list: its items, if all lists are as long; else 0. */
    uint64_t columns;

    /* 1: a list in each row. */
    uint64_t list;

    /* 1: the file states the range. */
    uint64_t has_range;

    /* Least and greatest of all values. */
    double range[2];

    /* Compressed; after ebpo_file_locate. */
    uint64_t stored_bytes;
} ebpo_attribute_facts;

#define EBPO_ATTRIBUTE_FACTS_INIT EBPO_SIZED(ebpo_attribute_facts)

/*
 * The n-th array of attributes of the file, n from 0.
 *
 * False when there are fewer; `out` is then as it was.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_file_attribute(const ebpo_file *file, unsigned n, ebpo_attribute_facts *out);

/* The name of an ebpo_attribute_type: "int8" to "float64"; NULL: no such type. Static. Threads:
 * any. */
EBPO_API const char *ebpo_attribute_type_text(uint64_t type);

/* Bytes that parts take in the file, compressed. */
typedef struct ebpo_stored_sizes {
    size_t struct_size; /* EBPO_STORED_SIZES_INIT sets it */

    uint64_t level_bytes[EBPO_LEVELS_MAX];
    uint64_t mesh_vertex_bytes, mesh_face_bytes, map_bytes;

    /* Of the table of subtrees. */
    uint64_t subtree_bytes;

    uint64_t attribute_bytes;

    /* Of the list of all chunks' checksums. */
    uint64_t sum_bytes;
} ebpo_stored_sizes;

#define EBPO_STORED_SIZES_INIT EBPO_SIZED(ebpo_stored_sizes)

/*
 * Finds out where all chunks lie, if that has not been read yet (files far away,
 * `prefetched` of ebpo_source), and adds up what they take. `out` may be NULL.
 *
 * EBPO_E_ARGUMENT: `out` was not begun with its macro. EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_locate(const ebpo_file *file, ebpo_stored_sizes *out,
                                                    ebpo_error *error);

/*
 * Announces that levels `first` to `last`, or to the last level, will be read. A
 * source far away then fetches them with as few requests as it can, where reading
 * one after the other would ask for each by itself.
 *
 * Waits for the index of chunks at most (ebpo_file_locate). Cannot fail: what could
 * not be fetched is told when it is read.
 *
 * Threads: any.
 */
EBPO_API void ebpo_file_prefetch_levels(const ebpo_file *file, int first, int last);

/* ---- reading ---- */

typedef struct ebpo_read_options {
    /* EBPO_READ_OPTIONS_INIT sets it. */
    size_t struct_size;

    /* 0: all cores */
    unsigned threads;

    /* Owns what is read, and is freed after it; NULL: malloc does. */
    ebpo_workspace *workspace;

    /*
     * ebpo_file_read_level: bits of ebpo_part that are not read though the file has
     * them: their arrays are NULL, the counts stay. Whole trees (ebpo_file_read_tree,
     * ebpo_file_repack) are not read without: EBPO_E_ARGUMENT unless it is 0.
     */
    uint64_t without;

    /*
     * 1: ebpo_file_read_mesh and ebpo_file_read_source_mesh read attributes as well, if
     * the file has them. Trees always have them.
     */
    uint64_t attributes;
} ebpo_read_options;

#define EBPO_READ_OPTIONS_INIT                   \
    {                                            \
        sizeof(ebpo_read_options), 0, NULL, 0, 0 \
    }

/*
 * What is read is the caller's, and is freed by the function for its type. On
 * failure it is cleared.
 */

/*
 * Reads one level, from 0 on, and checks it: counts, ranges, order, index arrays.
 * Freed by ebpo_level_free.
 *
 * EBPO_E_ARGUMENT: no such level. EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_level(const ebpo_file *file, int level,
                                                        const ebpo_read_options *options,
                                                        ebpo_level *out, ebpo_error *error);

/*
 * Reads the mesh, in the order of the file. Freed by ebpo_mesh_free.
 *
 * EBPO_E_ABSENT: the file has no mesh. EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_mesh(const ebpo_file *file,
                                                       const ebpo_read_options *options,
                                                       ebpo_mesh *out, ebpo_error *error);

/* Numbers in the source. */
typedef struct ebpo_maps {
    /* [vertex_count] */
    uint32_t *vertex_source;

    /* [face_count] */
    uint32_t *face_source;

    /* Owns both; NULL: malloc's */
    ebpo_workspace *workspace;
} ebpo_maps;

/*
 * Reads the maps. They are checked to be permutations of 0 .. count - 1; after
 * welding, different numbers below source_vertex_count.
 *
 * EBPO_E_ABSENT: the file has no maps. EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_maps(const ebpo_file *file,
                                                       const ebpo_read_options *options,
                                                       ebpo_maps *out, ebpo_error *error);

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one per struct.
 */
EBPO_API void ebpo_maps_free(ebpo_maps *maps);

/* The values of an array of attributes. */
typedef struct ebpo_attribute_values {
    /*
     * [rows][columns] of the array's type, in the machine's byte order; of lists of
     * different lengths the items of all, row after row
     */
    void *values;

    /* [rows] of such lists, how many items all rows up to this one have; else NULL */
    uint64_t *ends;

    /* In `values`. */
    uint64_t count;

    /* Owns both; NULL: malloc's */
    ebpo_workspace *workspace;
} ebpo_attribute_values;

/*
 * Reads the n-th array of attributes, in the order of the file's vertices or faces.
 * Freed by ebpo_attribute_values_free. On failure `out` is cleared.
 *
 * EBPO_E_ABSENT: the file has fewer. EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_attribute(const ebpo_file *file, unsigned n,
                                                            const ebpo_read_options *options,
                                                            ebpo_attribute_values *out,
                                                            ebpo_error *error);

/*
 * Of an array of lists only where they end: `values` is NULL, `ends` and `count` are
 * those of ebpo_file_read_attribute. `ends` is NULL where all lists are as long as the
 * array has columns, and of an array without lists. Freed by
 * ebpo_attribute_values_free. On failure `out` is cleared.
 *
 * EBPO_E_ABSENT: the file has fewer. EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY.
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
 * Threads: one per struct.
 */
EBPO_API void ebpo_attribute_values_free(ebpo_attribute_values *values);

/*
 * Reads everything. Freed by ebpo_tree_free.
 *
 * EBPO_E_ARGUMENT: `without` is not 0. EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_tree(const ebpo_file *file,
                                                       const ebpo_read_options *options,
                                                       ebpo_tree *out, ebpo_error *error);

/*
 * Reads the mesh and puts it into the order of the source if the file has maps;
 * else it stays in the order of the file. *source_order tells which. Freed by
 * ebpo_mesh_free.
 *
 * EBPO_E_ABSENT: the file has no mesh. EBPO_E_IO, EBPO_E_FORMAT, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_source_mesh(const ebpo_file *file,
                                                              const ebpo_read_options *options,
                                                              ebpo_mesh *out, bool *source_order,
                                                              ebpo_error *error);

/*
 * Computes the content checksum again from all arrays. Reads the whole file; of it a few
 * chunks for each thread are held, and images that it has embedded.
 *
 * EBPO_E_FORMAT: it is not the one in the head. EBPO_E_IO, EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_check_content(const ebpo_file *file,
                                                           const ebpo_read_options *options,
                                                           ebpo_error *error);

/*
 * Writes a file anew: all that it holds, laid out as `write` says (codec, subtrees;
 * its `parts` are not asked). The new file appears whole or not at all, and may take
 * the place of the one that is read. Before that it is read again: its
 * content_sha256 is that of `file`, which by that is checked as well.
 *
 * The whole model is held at once, as `read` says.
 *
 * EBPO_E_FORMAT: the content of `file` is not what its checksum says.
 * EBPO_E_UNSUPPORTED: it is, but this library would write other arrays (another program
 * has chosen wider types than needed, say); nothing is written. EBPO_E_IO: also where
 * `path` is that of `file`, and another program has replaced it since it was opened.
 * EBPO_E_ARGUMENT, EBPO_E_CANCELLED, EBPO_E_MEMORY, as reading and writing give them.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_repack(const ebpo_file *file, const char *path,
                                                    const ebpo_read_options *read,
                                                    const ebpo_write_options *write,
                                                    ebpo_error *error);

/*
 * Registers the zstd filter with libhdf5 in this process, so that the caller's own
 * HDF5 calls can read the files too.
 *
 * EBPO_E_UNSUPPORTED: libhdf5 did not take it.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_register_filters(ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
