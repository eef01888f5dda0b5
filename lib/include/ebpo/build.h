/* SPDX-License-Identifier: MIT
 * Builds a tree from a mesh.
 *
 *     ebpo_mesh mesh;
 *     ebpo_prepared prepared = EBPO_PREPARED_INIT;
 *     ebpo_tree tree;
 *     ebpo_mesh_read("bunny.ply", NULL, &mesh, &error);
 *     ebpo_mesh_prepare(&mesh, NULL, &prepared, &error);
 *     ebpo_build(&mesh, &prepared.report, &prepared.record, NULL, &tree, &error);
 *     ebpo_tree_write(&tree, "bunny.ebpo.h5", NULL, &error);
 *     ebpo_tree_free(&tree);
 *
 * The tree is an octree. The envelope of a node is a convex polyhedron, bounded by planes, that
 * contains the part of the solid in the node's cell. Gray nodes have children, and leaves list
 * faces. The methods come from the theses EBP 2017, section 3, and BP 2008, section 3 (README.md).
 */
#ifndef EBPO_BUILD_H
#define EBPO_BUILD_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Selection of the planes of an envelope. With every selection, the offsets of the planes are set
 * so that the envelope contains the part of the solid in the cell.
 */
typedef enum ebpo_selection {
    /*
     * From the root down. Candidates are the facet normals of the convex hull of the solid in the
     * cell. A node starts with its parent's envelope. Again and again, the candidate that removes
     * the greatest volume is added. The additions end when this volume is less than a share of the
     * cell (`epsilon` of ebpo_build_options). Finally, planes that cut off needles are added. A
     * needle is a long, thin portion of the envelope that has little volume.
     */
    EBPO_SELECT_INHERIT = 0,

    /*
     * EBPO_SELECT_KMEDOIDS, EBPO_SELECT_OFFSET and EBPO_SELECT_RANDOM are from the theses.
     * Candidates are the normals of the faces below the node. These selections go from the leaves
     * up. Each plane of a node is moved outwards until its half-space contains the envelopes of the
     * node's children (EBP 2017, 3.3.4.3 and 3.4.1; BP 2008, 3.4).
     */
    EBPO_SELECT_KMEDOIDS = 1, /* medoids of clusters of normals */
    EBPO_SELECT_OFFSET = 2,   /* the candidates whose planes need the least move outwards */
    EBPO_SELECT_RANDOM = 3,   /* consecutive candidates, beginning with a random candidate */

    /* Number of selections. */
    EBPO_SELECTION_COUNT
} ebpo_selection;

/* Properties of a selection. */
typedef struct ebpo_selection_traits {
    /* Name in files and commands, such as "inherit". */
    const char *name;

    /*
     * True: selects from the leaves up; uses `percent` or `k_root` of ebpo_build_options, not
     * `epsilon`.
     */
    bool from_leaves;

    /* True: uses a distance between normals (`normals` of ebpo_build_options). */
    bool uses_normal_distance;

    /* True: uses `seed` of ebpo_build_options. */
    bool uses_seed;
} ebpo_selection_traits;

/*
 * Returns the static properties of a selection; NULL for an invalid selection.
 *
 * Threads: any.
 */
EBPO_API const ebpo_selection_traits *ebpo_selection_describe(ebpo_selection selection);

/* Definition of the distance between two normals, for k-medoids. */
typedef enum ebpo_normal_distance {
    /*
     * Sum of squared differences of the two spherical coordinates (EBP 2017, equation 4). Near the
     * poles and the seam of these coordinates, similar normals have large distances.
     */
    EBPO_NORMALS_SPHERICAL = 0,

    /* Squared length of the difference of the unit vectors. */
    EBPO_NORMALS_ANGLE = 1
} ebpo_normal_distance;

/*
 * Durations of the two steps of building, in seconds, summed over all threads. `progress` does not
 * separate the steps, because each piece (subtree) of the tree passes through both steps in turn.
 */
typedef struct ebpo_build_times {
    size_t struct_size;

    /* Time to assign faces to cells, and to compute winding numbers and the order of faces. */
    double cells;

    /* Time to compute planes and envelopes. */
    double envelopes;
} ebpo_build_times;

#define EBPO_BUILD_TIMES_INIT EBPO_SIZED(ebpo_build_times)

/* Options of ebpo_build. */
typedef struct ebpo_build_options {
    size_t struct_size;

    /*
     * Deepest level, 0 to 20. -1: the least level, at least 1, whose cells are shorter than the
     * mean edge of the mesh (EBP 2017, equation 3).
     */
    int max_level;

    /*
     * A node with at most this many faces becomes a leaf (BP 2008, 3.3.1). 0: leaves only on the
     * deepest level.
     */
    uint32_t leaf_faces;

    /*
     * For EBPO_SELECT_INHERIT: least share of the cell's volume, from 0 to 1, that a plane must
     * remove. It applies to gray nodes and to leaves (EBPO_PART_LEAF_PLANES). A plane that removes
     * less is also kept if it cuts off a portion of the envelope that extends beyond the plane by a
     * tenth of the cell. For gray nodes of levels 0 to 4, the share is epsilon / 10 times the
     * square root of p. Here p is the fraction of the cell that the parent's envelope fills.
     */
    double epsilon;

    /*
     * ebpo_part bits: parts of the file to make. By default, planes of leaves are not made. Colours
     * are stored if EBPO_PART_MESH is set too and the mesh has colours.
     */
    uint32_t parts;

    /* Rule that decides which points belong to the solid. */
    ebpo_rule rule;

    /* True: return EBPO_E_NOT_SOLID for a mesh that is not closed (ebpo_mesh_report.balanced). */
    bool require_solid;

    unsigned threads;

    /* Selection of the planes of envelopes. */
    ebpo_selection select;

    /*
     * For the selections of the theses: share of the candidates that is selected, in percent, above
     * 0 and at most 100. The number of planes is rounded up (EBP 2017, equation 5). A node has at
     * most 255 planes, also if `k_root` is set.
     */
    double percent;

    /*
     * For the selections of the theses: number of planes at the root; 0: `percent` decides. The
     * number for a level is half the number for the level above. In a node, this number is halved
     * further until it is less than the number of candidates (BP 2008, 3.5.1).
     */
    double k_root;

    /* Definition of the distance between normals, for EBPO_SELECT_KMEDOIDS. */
    ebpo_normal_distance normals;

    /* Seed for EBPO_SELECT_KMEDOIDS and EBPO_SELECT_RANDOM; equal seeds give equal files. */
    uint64_t seed;

    /*
     * Unit, coordinate reference system and date, stored in the file: UTF-8 without control
     * characters, or NULL. `ebpo convert` accepts a date only if ebpo_is_date is true.
     */
    const char *unit, *crs, *date;

    ebpo_progress progress;

    /* Receives the times of the steps; NULL: times are not measured. */
    ebpo_build_times *times;
} ebpo_build_options;

#define EBPO_BUILD_OPTIONS_INIT                                                                 \
    {                                                                                           \
        sizeof(ebpo_build_options), -1, 16, 0.003,                                              \
            EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES |         \
                EBPO_PART_COLOURS | EBPO_PART_BORDER,                                           \
            EBPO_RULE_NONZERO, false, 0, EBPO_SELECT_INHERIT, 40, 0, EBPO_NORMALS_SPHERICAL, 1, \
            NULL, NULL, NULL, { NULL, NULL }, NULL                                              \
    }

/*
 * Builds the tree of a checked mesh. The arrays of the mesh are moved into `out` and reordered: the
 * mesh is empty afterwards, also on failure. `out` is freed by ebpo_tree_free.
 *
 * report          result of ebpo_mesh_check or ebpo_mesh_prepare; copied to out->info
 * repair_record   repairs that were made; copied to out->info. NULL: no repairs
 *
 * EBPO_E_ARGUMENT: an option is out of range. EBPO_E_NOT_SOLID: see require_solid. EBPO_E_FORMAT,
 * EBPO_E_LIMIT: see ebpo_mesh_check and ebpo_mesh_arrange. EBPO_E_IO: no disk space for the
 * workspace.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_build(ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                              const ebpo_repair_record *repair_record,
                                              const ebpo_build_options *options, ebpo_tree *out,
                                              ebpo_error *error);

/*
 * Repacks a file as ebpo_file_repack does. Adds the part EBPO_PART_BORDER (border loops) if the
 * model is a surface, and the file has a mesh without this part and is not a subset.
 *
 * EBPO_E_LIMIT: the border has 2^31 edges or more. Other errors are those of ebpo_file_repack.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_add_border(const ebpo_file *file, const char *path,
                                                        const ebpo_read_options *read,
                                                        const ebpo_write_options *write,
                                                        ebpo_error *error);

/*
 * Repacks a file as ebpo_file_repack does. Adds the part EBPO_PART_SURFACE if the file has a mesh
 * without this part, is not a subset, and has enough faces (format-spec/surface.md). Errors are
 * those of ebpo_file_repack.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_file_add_surface(const ebpo_file *file, const char *path,
                                                         const ebpo_read_options *read,
                                                         const ebpo_write_options *write,
                                                         ebpo_error *error);

/* Criterion by which nodes with few faces become one leaf (BP 2008, 3.3.1). */
typedef enum ebpo_coalescing {
    /* A node with at most leaf_faces different faces is a leaf. */
    EBPO_COALESCE_DISTINCT = 0,

    /*
     * Eight siblings become one leaf if their lists of faces together have fewer than leaf_faces
     * entries. A face in several lists counts several times (criterion 1, algorithm 4).
     */
    EBPO_COALESCE_SUM = 1,

    /*
     * Eight siblings become one leaf if their lists have, on average, fewer than leaf_faces entries
     * (criterion 2).
     */
    EBPO_COALESCE_MEAN = 2
} ebpo_coalescing;

/* Statistics of one level: numbers of nodes and planes, and volumes in cubic units of the model. */
typedef struct ebpo_thesis_level {
    uint64_t gray_count, leaf_count, black_count;
    uint64_t leaf_faces;                    /* number of entries in the leaves' lists of faces */
    uint64_t plane_count, leaf_plane_count; /* number of planes of gray nodes, and of leaves */

    /* Volume of the envelopes of gray nodes and of leaves, and of the cells of black nodes. */
    double gray_volume, leaf_volume, black_volume;
} ebpo_thesis_level;

/* Result of ebpo_build_as_theses: the levels from the root down. */
typedef struct ebpo_thesis_levels {
    size_t struct_size;
    int level_count;
    ebpo_thesis_level level[EBPO_LEVELS_MAX];
} ebpo_thesis_levels;

#define EBPO_THESIS_LEVELS_INIT EBPO_SIZED(ebpo_thesis_levels)

/*
 * Computes the levels of a mesh as the theses do, for comparison; the result cannot be stored. The
 * limits of files do not apply: a node may have more than 255 planes, and candidates with equal
 * normals all count. The mesh is empty afterwards, also on failure.
 *
 * report    as for ebpo_build
 * options   as for ebpo_build, with a selection of the theses; `parts` is ignored
 *
 * EBPO_E_ARGUMENT: an option is out of range, or the selection is not from the theses. Other errors
 * are those of ebpo_build.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_build_as_theses(ebpo_mesh *mesh,
                                                        const ebpo_mesh_report *report,
                                                        const ebpo_build_options *options,
                                                        ebpo_coalescing coalesce,
                                                        ebpo_thesis_levels *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
