/* EBP-Octree in HDF5: from a mesh to a tree. */
#ifndef EBPO_BUILD_H
#define EBPO_BUILD_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* How the planes of an envelope are chosen: their directions among those of the hull of the solid
 * in the cell (inherit), or among the normals of the faces below the node (the theses'). Whatever
 * the choice, offsets are such that the envelope contains the solid. */
typedef enum ebpo_selection {
    /* from the root down: a node starts from its parent's envelope and adds, greedily by removed
       volume, what removes at least epsilon, then what cuts off needles */
    EBPO_SELECT_INHERIT = 0,
    /* the other three are the theses', from the leaves up, of the children's planes and around the
       polygons of these planes (EBP 2017, 3.3.4.3 and 3.4.1; BP 2008, 3.4): the medoids of clusters
       of normals */
    EBPO_SELECT_KMEDOIDS = 1,
    EBPO_SELECT_OFFSET = 2, /* those that had to move least from their faces */
    EBPO_SELECT_RANDOM = 3, /* consecutive ones from a random place on */
    EBPO_SELECTION_COUNT    /* no selection: how many this version knows */
} ebpo_selection;

/* What is known of a selection. */
typedef struct ebpo_selection_traits {
    const char *name;   /* as files and commands call it: "inherit" */
    bool from_leaves;   /* from the leaves up: takes percent or k_root, not epsilon */
    bool takes_normals; /* the distance of normals matters to it */
    bool takes_seed;
} ebpo_selection_traits;

/* Static, of this library; NULL for what is no selection. Any thread. */
EBPO_API const ebpo_selection_traits *ebpo_selection_describe(ebpo_selection selection);

/* What k-medoids takes for the distance of two normals. */
typedef enum ebpo_normal_distance {
    /* squared differences of the two spherical coordinates (EBP 2017, equation 4): has poles and a
       seam */
    EBPO_NORMALS_SPHERICAL = 0,
    EBPO_NORMALS_ANGLE = 1 /* squared length of the difference of the unit vectors */
} ebpo_normal_distance;

/* What the pieces of a tree took, on all threads together, in seconds: they are done in one go, so
 * no stage of their progress tells these apart. */
typedef struct ebpo_build_times {
    size_t struct_size; /* EBPO_BUILD_TIMES_INIT sets it */
    double cells;       /* faces to cells, the corners' winding numbers, the faces' numbers */
    double envelopes;   /* planes and envelopes */
} ebpo_build_times;
#define EBPO_BUILD_TIMES_INIT EBPO_SIZED(ebpo_build_times)

typedef struct ebpo_build_options {
    size_t struct_size; /* EBPO_BUILD_OPTIONS_INIT sets it */
    int max_level;      /* 0 .. 20, or -1: EBP 2017, equation 3 */
    /* a node with at most so many faces becomes a leaf (BP 2008, 3.3.1); 0: only the maximum level
     * stops */
    uint32_t leaf_faces;
    /* inherit, and leaf planes that are stored with it: a plane is kept while it removes at least
     * this share of the cell (in levels 0 to 4 a tenth of it, less where the solid is thin), or
     * cuts off what reaches a tenth of the cell beyond it; 0 .. 1 */
    double epsilon;
    uint32_t parts; /* ebpo_part bits to make; leaf planes only on request */
    ebpo_rule rule;
    bool require_solid; /* EBPO_E_NOT_SOLID for a mesh that does not balance */
    unsigned threads;   /* 0: all cores; the result does not depend on it */
    ebpo_selection select;
    /* the theses' selections: share of the candidates that is taken, rounded up (EBP 2017, equation
     * 5); (0, 100] */
    double percent;
    /* instead of percent: so many planes at the root, half as many at each next level, and halved
     * on in a node until below the number of its candidates (BP 2008, 3.5.1); 0: percent */
    double k_root;
    ebpo_normal_distance normals;
    uint64_t seed;                 /* of random and k-medoids: equal seeds give equal files */
    const char *unit, *crs, *date; /* UTF-8 without control characters, or NULL */
    ebpo_progress progress;
    ebpo_build_times *times; /* filled in, if not NULL */
} ebpo_build_options;
#define EBPO_BUILD_OPTIONS_INIT                                                              \
    {                                                                                        \
        sizeof(ebpo_build_options), -1, 16, 0.003,                                           \
            EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS, EBPO_RULE_NONZERO, false, 0, \
            EBPO_SELECT_INHERIT, 40, 0, EBPO_NORMALS_SPHERICAL, 1, NULL, NULL, NULL,         \
            { NULL, NULL }, NULL                                                             \
    }

/* Builds the tree of a checked and perhaps mended mesh; `report` and `mend` are copied into the
 * file's facts. The mesh is consumed: its arrays are reordered into `out` (on failure it is freed
 * all the same). */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_build(ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                              const ebpo_mend_record *mend,
                                              const ebpo_build_options *options, ebpo_tree *out,
                                              ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
