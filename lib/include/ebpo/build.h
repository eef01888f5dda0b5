/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: from a mesh to a tree.
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
 * The methods are those of EBP 2017, section 3, and BP 2008, section 3.
 */
#ifndef EBPO_BUILD_H
#define EBPO_BUILD_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * How the planes of an envelope are chosen. Whatever the choice, offsets are
 * such that the envelope contains the solid.
 */
typedef enum ebpo_selection {
    /*
     * From the root down, among the directions of the hull of the solid in the
     * cell. A node starts from its parent's envelope and adds, greedily by the
     * volume removed, what removes at least epsilon, then what cuts off needles.
     */
    EBPO_SELECT_INHERIT = 0,

    /*
     * The other three are the theses', among the normals of the faces below the
     * node: from the leaves up, of the children's planes and around the polygons
     * of these planes (EBP 2017, 3.3.4.3 and 3.4.1; BP 2008, 3.4).
     */
    EBPO_SELECT_KMEDOIDS = 1, /* the medoids of clusters of normals */
    EBPO_SELECT_OFFSET = 2,   /* those that had to move least from their faces */
    EBPO_SELECT_RANDOM = 3,   /* consecutive ones, from a random one on */

    /* No selection: how many there are. */
    EBPO_SELECTION_COUNT
} ebpo_selection;

/* What is known of a selection. */
typedef struct ebpo_selection_traits {
    /* As files and commands call it, such as "inherit". */
    const char *name;

    /* From the leaves up: takes percent or k_root, not epsilon. */
    bool from_leaves;

    /* The distance of normals matters to it. */
    bool takes_normals;

    bool takes_seed;
} ebpo_selection_traits;

/*
 * Static; NULL for what is no selection.
 *
 * Threads: any.
 */
EBPO_API const ebpo_selection_traits *ebpo_selection_describe(ebpo_selection selection);

/* What k-medoids takes for the distance of two normals. */
typedef enum ebpo_normal_distance {
    /*
     * Squared differences of the two spherical coordinates (EBP 2017, equation
     * 4). Has poles and a seam.
     */
    EBPO_NORMALS_SPHERICAL = 0,

    /* Squared length of the difference of the unit vectors. */
    EBPO_NORMALS_ANGLE = 1
} ebpo_normal_distance;

/*
 * Seconds of two steps that progress cannot tell apart, because each piece of a
 * tree goes through both in one go. Summed over all threads.
 */
typedef struct ebpo_build_times {
    size_t struct_size; /* EBPO_BUILD_TIMES_INIT sets it */

    /* Faces to cells, winding numbers of corners, numbers of faces. */
    double cells;

    /* Planes and envelopes. */
    double envelopes;
} ebpo_build_times;

#define EBPO_BUILD_TIMES_INIT EBPO_SIZED(ebpo_build_times)

typedef struct ebpo_build_options {
    size_t struct_size; /* EBPO_BUILD_OPTIONS_INIT sets it */

    /* The deepest level, 0 to 20. -1: by EBP 2017, equation 3. */
    int max_level;

    /*
     * A node with at most so many faces becomes a leaf (BP 2008, 3.3.1). 0: only
     * the deepest level stops.
     */
    uint32_t leaf_faces;

    /*
     * EBPO_SELECT_INHERIT, and stored leaf planes made with it: a plane is kept
     * while it removes at least this share of the cell, 0 to 1 (in levels 0 to 4
     * a tenth of it, less where the solid is thin), or cuts off what reaches a
     * tenth of the cell beyond it.
     */
    double epsilon;

    /*
     * Bits of ebpo_part. Leaf planes are made on request only. Colours are made
     * where the mesh has colours, and with EBPO_PART_MESH only.
     */
    uint32_t parts;

    /* Which points the solid is made of. */
    ebpo_rule rule;

    /* Refuse a mesh that does not balance: EBPO_E_NOT_SOLID. */
    bool require_solid;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_selection select;

    /*
     * The theses' selections: which share of the candidates is taken, in
     * percent, above 0 and at most 100, rounded up (EBP 2017, equation 5). Never
     * more than 255, also with k_root: so many can be stored.
     */
    double percent;

    /*
     * Instead of percent, if not 0: so many planes at the root, half as many at
     * each next level, and halved on in a node until there are fewer than its
     * candidates (BP 2008, 3.5.1).
     */
    double k_root;

    /* Of EBPO_SELECT_KMEDOIDS. */
    ebpo_normal_distance normals;

    /* Of EBPO_SELECT_KMEDOIDS and EBPO_SELECT_RANDOM: equal seeds, equal files. */
    uint64_t seed;

    /* Notes for the file: UTF-8 without control characters, or NULL. `ebpo convert` takes a date by
     * ebpo_is_date only. */
    const char *unit, *crs, *date;

    ebpo_progress progress;

    /* Filled in, if not NULL. */
    ebpo_build_times *times;
} ebpo_build_options;

#define EBPO_BUILD_OPTIONS_INIT                                                                 \
    {                                                                                           \
        sizeof(ebpo_build_options), -1, 16, 0.003,                                              \
            EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES |         \
                EBPO_PART_COLOURS,                                                              \
            EBPO_RULE_NONZERO, false, 0, EBPO_SELECT_INHERIT, 40, 0, EBPO_NORMALS_SPHERICAL, 1, \
            NULL, NULL, NULL, { NULL, NULL }, NULL                                              \
    }

/*
 * Builds the tree of a checked and perhaps mended mesh. Its arrays are moved
 * into `out` and put into another order: the mesh is empty afterwards, also when
 * building fails. `out` is freed by ebpo_tree_free.
 *
 * report   what ebpo_mesh_check or ebpo_mesh_prepare has found; it is copied
 *          into the file's facts
 * mend     what was mended; copied as well; NULL: nothing
 *
 * EBPO_E_ARGUMENT: an option is out of range. EBPO_E_NOT_SOLID: see
 * require_solid. EBPO_E_FORMAT and EBPO_E_LIMIT: as ebpo_mesh_check and
 * ebpo_mesh_arrange. EBPO_E_IO: the workspace is full. EBPO_E_MEMORY,
 * EBPO_E_CANCELLED.
 *
 * Threads: one per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_build(ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                              const ebpo_mend_record *mend,
                                              const ebpo_build_options *options, ebpo_tree *out,
                                              ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
