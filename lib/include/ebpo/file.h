/* EBP-Octree in HDF5: what a `.ebpo.h5` file holds, reading and writing it. format-spec/ describes
 * the same, byte by byte. */
#ifndef EBPO_FILE_H
#define EBPO_FILE_H

#include <ebpo/mesh.h>

#ifdef __cplusplus
extern "C" {
#endif

#define EBPO_FORMAT_MAJOR 1
#define EBPO_FORMAT_MINOR 0
#define EBPO_LEVELS_MAX   21 /* levels 0 to 20 */

/* A node's type, two bits in `types`. */
typedef enum ebpo_node_type {
    /* no face touches the closed cell, which lies outside (in a surface model: no face touches it)
     */
    EBPO_WHITE = 0,
    EBPO_BLACK = 1, /* no face touches the closed cell, which lies inside */
    EBPO_LEAF = 2,  /* lists its faces, has no children */
    /* has eight children, or is pruned: has had them, but they are not in this file */
    EBPO_GRAY = 3
} ebpo_node_type;

/* Which points a solid is made of, by their winding number w. */
typedef enum ebpo_rule {
    EBPO_RULE_NONZERO = 0, /* w != 0 */
    EBPO_RULE_EVENODD = 1, /* w odd */
    EBPO_RULE_POSITIVE = 2 /* w > 0 */
} ebpo_rule;

/* Parts of a file, as bits. */
typedef enum ebpo_part {
    EBPO_PART_PLANES = 1,     /* envelope planes of gray nodes */
    EBPO_PART_MESH = 2,       /* vertices, faces and the leaves' face lists */
    EBPO_PART_MAPS = 4,       /* source numbers of vertices and faces */
    EBPO_PART_LEAF_PLANES = 8 /* stored envelope planes of leaves */
} ebpo_part;

typedef enum ebpo_codec {
    EBPO_CODEC_ZSTD = 0,    /* HDF5 filter 32015, frames with checksum */
    EBPO_CODEC_DEFLATE = 1, /* HDF5's own; needs no plugin; fletcher32 checksum */
    EBPO_CODEC_NONE = 2
} ebpo_codec;

/* One level, all nodes in octcode order. Rank: the i-th gray node of a level has the i-th group of
 * eight children in the next level. Arrays are NULL when their count is 0 or their part is absent.
 */
typedef struct ebpo_level {
    /* groups of eight siblings; level 0: one group, of which only octant 0 exists */
    uint64_t group_count;
    uint64_t gray_count, leaf_count, white_count, black_count;
    /* [group_count]; type of octant i in bits 2i, 2i + 1; octant: bit 0 x, bit 1 y, bit 2 z */
    uint16_t *types;
    uint8_t *plane_counts; /* [gray_count] planes that the node adds to its parent's envelope */
    uint32_t *planes;      /* [plane_count] codes, see ebpo_plane_decode; node after node */
    uint64_t plane_count;
    /* [leaf_count] winding number at the leaf's lowest corner, shifted (see format-spec); solids
     * only */
    int32_t *leaf_winding;
    int32_t *black_winding; /* [black_count], NULL: all 1 */
    int32_t *white_winding; /* [white_count], NULL: all 0 */
    uint64_t *leaf_first;   /* [leaf_count] number of the leaf's first new face */
    /* [leaf_count] faces leaf_first .. leaf_first + leaf_new - 1 touch this leaf and no leaf before
     * it */
    uint32_t *leaf_new;
    uint32_t *leaf_ref_count; /* [leaf_count] further faces, all of a number below leaf_first */
    /* [ref_count] their numbers, ascending within each leaf; leaf after leaf */
    uint32_t *leaf_refs;
    uint64_t ref_count;
    uint64_t new_count;         /* sum of leaf_new */
    uint8_t *leaf_plane_counts; /* [leaf_count], part EBPO_PART_LEAF_PLANES */
    uint32_t *leaf_planes;      /* [leaf_plane_count] */
    uint64_t leaf_plane_count;
    /* volume of the envelopes of this level's gray nodes, in the model's unit cubed */
    double gray_volume;
    /* the same for its leaves: cut by stored planes, else as inherited (planes that readers derive
     * cut off more) */
    double leaf_volume;
    /* of the gray nodes: those whose children are not in the file. Their groups in the next level
     * are 0 (and count as eight white nodes); on the last level all gray nodes are pruned, and have
     * no groups */
    uint64_t pruned_count;
    ebpo_workspace *workspace; /* owns all its arrays; NULL: malloc's */
} ebpo_level;

EBPO_API void ebpo_level_free(ebpo_level *level);

/* Half-space of a plane code in the coordinates of its node's cell: xi = (p - corner) / cell size,
 * per axis, so 0 <= xi <= 1. The envelope keeps the points with 4096 * (n . xi) <= d. All integers:
 * |n0| + |n1| + |n2| = 511, and nothing is ever rounded by a reader. False for the codes that stand
 * for no plane. */
EBPO_API bool ebpo_plane_decode(uint32_t code, int32_t n[3], int32_t *d);

/* Facts about a level that the head of the file tells without reading the level. */
typedef struct ebpo_level_summary {
    uint64_t gray_count, leaf_count, white_count, black_count;
    uint64_t plane_count, leaf_plane_count;
    uint64_t new_count, ref_count; /* faces first seen, faces referenced again */
    double gray_volume, leaf_volume;
    /* gray nodes without children; white_count of the next level counts eight for each */
    uint64_t pruned_count;
} ebpo_level_summary;

/* Everything about a file but its arrays. */
typedef struct ebpo_info {
    int version_major, version_minor;
    char generator[64];
    char source_name[256], source_format[16];
    uint8_t source_sha256[32];
    uint64_t source_size;
    char unit[32], crs[256], date[32]; /* "" when not given */
    bool solid;                        /* else a surface */
    ebpo_rule rule;
    bool double_coordinates;
    uint64_t vertex_count, face_count;               /* of the mesh in the file */
    uint64_t source_vertex_count, source_face_count; /* triangles before mending */
    double box_origin[3], box_size[3];               /* root cell */
    int grid_level;                                  /* deepest level for which the box is exact */
    int max_level;                                   /* the limit used in building */
    int level_count;                                 /* levels 0 .. level_count - 1 are present */
    uint32_t leaf_faces;
    double epsilon;
    /* ebpo_selection (build.h) by which planes were chosen, and what it was told: */
    int selection;
    double percent, k_root; /* percent or k_root: the theses' selections; else 0 */
    int normals;            /* ebpo_normal_distance; k-medoids */
    uint64_t seed;          /* k-medoids and random; else 0 */
    ebpo_mend_record mend;
    ebpo_mesh_report report; /* counts and measures; places are not stored */
    uint32_t parts;          /* ebpo_part bits */
    ebpo_codec codec;
    uint8_t content_sha256[32];
    /* where the places of the chunks of large arrays stand, behind the first levels: for fetching
     * ahead, not relied on; 0: there are none, or the file does not say */
    uint64_t chunk_index_offset, chunk_index_bytes;
    /* a subset: some gray nodes' children were left out (ebpo_subset). The rest below says what was
     * asked for then */
    bool pruned;
    int cut_levels;     /* levels 0 .. cut_levels - 1 were kept; 0: all */
    bool boxed;         /* what does not meet this box was left out: */
    double kept_box[6]; /* min, max */
    /* where nodes were pruned for it, their envelopes reach at most so far beyond the model; 0: not
     * asked for */
    double kept_error;
    /* content_sha256 of the file that it was taken from; the first one's, when it was a subset
     * itself */
    uint8_t subset_of[32];
    ebpo_level_summary level[EBPO_LEVELS_MAX];
    /* set when reading; head: up to the first level */
    uint64_t file_bytes, head_bytes;
    /* set when reading: levels from this one on need the index of chunks as well; level_count: none
     * does */
    int index_level;
} ebpo_info;

/* A whole model in memory: what the builder makes and the writer writes. The mesh is in file order:
 * faces by the first leaf (depth-first octcode order) that they touch, vertices by first use,
 * unreferenced vertices last. */
typedef struct ebpo_tree {
    ebpo_info info;
    ebpo_level level[EBPO_LEVELS_MAX];
    ebpo_mesh mesh;
    uint32_t *vertex_source; /* [vertex_count] number in the source, or NULL */
    /* [face_count]; numbers >= source_face_count: faces added by filling holes */
    uint32_t *face_source;
    ebpo_workspace *workspace; /* owns the two; NULL: malloc's */
} ebpo_tree;

EBPO_API void ebpo_tree_free(ebpo_tree *tree);

typedef struct ebpo_write_options {
    size_t struct_size; /* EBPO_WRITE_OPTIONS_INIT sets it */
    ebpo_codec codec;
    int codec_level;  /* 0: the default (zstd 3, deflate 6) */
    unsigned threads; /* 0: all cores */
    uint32_t parts;   /* which parts to write, of those the tree has */
    ebpo_progress progress;
} ebpo_write_options;
#define EBPO_WRITE_OPTIONS_INIT                                                \
    {                                                                          \
        sizeof(ebpo_write_options), EBPO_CODEC_ZSTD, 0, 0, ~0u, { NULL, NULL } \
    }

/* Writes the file: whole or not at all (temporary name, fsync, rename, fsync of the folder). Equal
 * trees give identical bytes. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_tree_write(const ebpo_tree *tree, const char *path,
                                                   const ebpo_write_options *options,
                                                   ebpo_error *error);

/* Bytes [offset, offset + size) of a source. */
typedef struct ebpo_range {
    uint64_t offset, size;
} ebpo_range;

/* Where bytes come from. `read` fills `data` with the bytes [offset, offset + size), all of which
 * lie within `size` of the source, or fails; it is called from several threads at once. `close` is
 * called once, when the file is closed or when opening fails. While a file is being opened, `read`
 * is called from inside libhdf5: it must then neither use libhdf5 nor open another file. */
typedef struct ebpo_source {
    size_t struct_size; /* EBPO_SOURCE_INIT sets it */
    void *user;
    uint64_t size; /* bytes */
    ebpo_status (*read)(void *user, uint64_t offset, uint64_t size, void *data, ebpo_error *error);
    void (*close)(void *user); /* may be NULL */
    /* May be NULL. Announces ranges, all within the source, that will be read soon, each about
     * once: a source far away fetches them together and ahead of the reader. Nothing depends on it;
     * it does not wait, and is called from several threads. */
    void (*expect)(void *user, const ebpo_range *ranges, size_t count);
    /* With `expect`: so many bytes at the beginning need no fetching. When that is not the whole
     * file, only what they tell is looked at in opening: where the chunks of arrays of more than
     * one chunk lie is read when the first of these arrays is (or ebpo_file_locate called). */
    uint64_t at_hand;
} ebpo_source;
#define EBPO_SOURCE_INIT EBPO_SIZED(ebpo_source)

/* An open file. Immutable: any number of threads may use it at once. */
typedef struct ebpo_file ebpo_file;

/* Opens a file and reads its head only: the facts, and where each chunk of each array is. HDF5 is
 * used for that and for nothing later; everything else is read straight from the source. Unknown
 * major version or unknown required part: EBPO_E_VERSION, by name. Safe on untrusted files. A file
 * that another program shortens or changes while it is open gives EBPO_E_IO or EBPO_E_FORMAT, never
 * wrong data (the pipelines with checksums). */
/* a path, or a URL: ebpo/http.h */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open(const char *path, ebpo_file **out, ebpo_error *error);
/* The same from bytes in memory, which stay the caller's and must outlive the file. `name` is for
 * messages. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_memory(const void *data, uint64_t size,
                                                    const char *name, ebpo_file **out,
                                                    ebpo_error *error);
/* The same from any source; it is closed with the file (also when opening fails). */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_open_source(const ebpo_source *source, const char *name,
                                                    ebpo_file **out, ebpo_error *error);
/* NULL is fine. Models, contexts and streams made from the file are freed before. */
EBPO_API void ebpo_close(ebpo_file *file);

/* Bytes asked of the source so far, and how many times; the head's reading included. Of a file
 * opened by URL, what went over the net is told by ebpo_file_get_http_stats. */
typedef struct ebpo_file_stats {
    size_t struct_size; /* EBPO_FILE_STATS_INIT sets it */
    uint64_t bytes_read;
    uint64_t reads; /* calls of the source */
} ebpo_file_stats;
#define EBPO_FILE_STATS_INIT EBPO_SIZED(ebpo_file_stats)
EBPO_API ebpo_status ebpo_file_get_stats(const ebpo_file *file, ebpo_file_stats *out);

/* Lent; valid until the file is closed. */
EBPO_API const ebpo_info *ebpo_file_info(const ebpo_file *file);

/* Bytes that parts take in the file, compressed. */
typedef struct ebpo_stored_sizes {
    uint64_t level_bytes[EBPO_LEVELS_MAX];
    uint64_t mesh_vertex_bytes, mesh_face_bytes, map_bytes;
} ebpo_stored_sizes;

/* Finds out where all chunks lie, if that has not been read yet (files far away,
 * ebpo_source.at_hand), and adds up what they take. `out` may be NULL. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_locate(const ebpo_file *file, ebpo_stored_sizes *out,
                                                    ebpo_error *error);

/* Announces that levels first .. last will be read; last beyond the last level: up to that one. A
 * source far away then fetches them with as few requests as it can, where reading one after the
 * other would ask for each by itself. Waits at most for the index of chunks (ebpo_file_locate);
 * cannot fail: what could not be fetched is told when it is read. */
EBPO_API void ebpo_file_prefetch_levels(const ebpo_file *file, int first, int last);

typedef struct ebpo_read_options {
    size_t struct_size; /* EBPO_READ_OPTIONS_INIT sets it */
    unsigned threads;   /* 0: all cores */
    /* owns what is read, and is freed after it; NULL: malloc does */
    ebpo_workspace *workspace;
} ebpo_read_options;
#define EBPO_READ_OPTIONS_INIT             \
    {                                      \
        sizeof(ebpo_read_options), 0, NULL \
    }

/* In all of these `options` may be NULL. What is read is the caller's, and is freed by the function
 * for its type; on failure it is cleared. */

/* Reads one level (0 .. level_count - 1) and checks it: counts, ranges, order, index arrays. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_level(const ebpo_file *file, int level,
                                                        const ebpo_read_options *options,
                                                        ebpo_level *out, ebpo_error *error);

/* Reads the mesh in file order; EBPO_E_ABSENT without the part. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_mesh(const ebpo_file *file,
                                                       const ebpo_read_options *options,
                                                       ebpo_mesh *out, ebpo_error *error);

/* Numbers in the source. */
typedef struct ebpo_maps {
    uint32_t *vertex_source;   /* [vertex_count] */
    uint32_t *face_source;     /* [face_count] */
    ebpo_workspace *workspace; /* owns both; NULL: malloc's */
} ebpo_maps;

/* Reads the maps, which are checked to be permutations of 0 .. count - 1 (after welding: strictly
 * different numbers below source_vertex_count). EBPO_E_ABSENT without the part. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_maps(const ebpo_file *file,
                                                       const ebpo_read_options *options,
                                                       ebpo_maps *out, ebpo_error *error);
/* Frees the arrays and clears the struct. NULL is fine. */
EBPO_API void ebpo_maps_free(ebpo_maps *maps);

/* Everything at once. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_tree(const ebpo_file *file,
                                                       const ebpo_read_options *options,
                                                       ebpo_tree *out, ebpo_error *error);

/* The mesh in the source's order where the maps are there (vertices by vertex_source, faces by
 * face_source), else in file order: *source_order, which may be NULL, tells. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_read_source_mesh(const ebpo_file *file,
                                                              const ebpo_read_options *options,
                                                              ebpo_mesh *out, bool *source_order,
                                                              ebpo_error *error);

/* Recomputes the content checksum from all arrays and compares: EBPO_E_FORMAT when it differs. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_check_content(const ebpo_file *file,
                                                           const ebpo_read_options *options,
                                                           ebpo_error *error);

/* Registers the zstd filter with libhdf5 in this process, so that the caller's own HDF5 calls can
 * read the files too. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_register_filters(ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
