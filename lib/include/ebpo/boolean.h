/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: unions, intersections and differences of solids at poses, by query.
 *
 *   Expressions     ebpo_boolean_new
 *   Point in solid  ebpo_boolean_inside, ebpo_boolean_inside_many
 *   Distance        ebpo_boolean_distance
 *   Exact volume    ebpo_boolean_exact_volume
 *   Cells           ebpo_boolean_cells_new, ebpo_boolean_cells_volume, ebpo_boolean_cells_mesh
 *
 * Nothing is cut: there is no mesh of the result. Questions about it are answered by questions to
 * the models. Decisions are those of arithmetic without rounding on posed coordinates (pose.h).
 *
 * The result is *regularised*: of an operand is meant the closure of what its winding numbers and
 * its rule put inside, and the result is the closure of its own interior. So two boxes with a side
 * in common make one box, and a box less an equal one is nothing.
 */
#ifndef EBPO_BOOLEAN_H
#define EBPO_BOOLEAN_H

#include <ebpo/collide.h>
#include <ebpo/pose.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- expressions ---- */

typedef enum ebpo_boolean_operation {
    EBPO_BOOLEAN_OPERAND = 0,             /* the operand with the number `left` */
    EBPO_BOOLEAN_UNION = 1,               /* in one of both, or in both */
    EBPO_BOOLEAN_INTERSECTION = 2,        /* in both */
    EBPO_BOOLEAN_DIFFERENCE = 3,          /* in `left`, not in `right` */
    EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE = 4 /* in one of both, not in both */
} ebpo_boolean_operation;

/* A node of the tree; `left` and `right` are numbers of nodes that stand before it. */
typedef struct ebpo_boolean_node {
    int32_t operation; /* an ebpo_boolean_operation */
    uint32_t left, right;
    uint32_t reserved;
} ebpo_boolean_node;

/* A solid at a pose. Of one model there may be many. */
typedef struct ebpo_boolean_operand {
    ebpo_model *model;
    ebpo_pose pose;
} ebpo_boolean_operand;

/* At most so many of each. */
#define EBPO_BOOLEAN_OPERANDS_MAX 64
#define EBPO_BOOLEAN_NODES_MAX    256

typedef struct ebpo_boolean_options {
    size_t struct_size; /* EBPO_BOOLEAN_OPTIONS_INIT sets it */

    /* For questions about many points, and for cells. 0: all cores. Answers are the same. */
    unsigned threads;

    uint32_t reserved;
} ebpo_boolean_options;

#define EBPO_BOOLEAN_OPTIONS_INIT EBPO_SIZED(ebpo_boolean_options)

/* An expression, and what its questions work with: a context of each operand for each thread. */
typedef struct ebpo_boolean ebpo_boolean;

/*
 * An expression over operands[operand_count]: nodes[node_count], the last of which is the root. A
 * node may be used by several others, and an operand by several nodes. Both arrays are copied; the
 * models must outlive the expression.
 *
 * EBPO_E_ARGUMENT: a node names one that does not stand before it, or an operand that is not there;
 * an unknown operation; a pose (ebpo_pose_check). EBPO_E_LIMIT: none, or too many, of operands or
 * of nodes. EBPO_E_NOT_SOLID: an operand is a surface. EBPO_E_ABSENT: an operand's file has no
 * mesh. EBPO_E_MEMORY. Each names the node, from 0, or the operand: its file, and its place
 * from 1 on.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_new(const ebpo_boolean_operand *operands,
                                                    uint32_t operand_count,
                                                    const ebpo_boolean_node *nodes,
                                                    uint32_t node_count,
                                                    const ebpo_boolean_options *options,
                                                    ebpo_boolean **out, ebpo_error *error);

/*
 * Before its models.
 *
 * Threads: one per expression.
 */
EBPO_API void ebpo_boolean_free(ebpo_boolean *boolean);

/* ---- point in solid ---- */

typedef struct ebpo_boolean_result {
    /*
     * EBPO_IN: an inner point of the result; EBPO_OUT: an inner point of what is not in it; both
     * are certain. EBPO_ON: on a posed face, and the other operands do not decide.
     */
    int32_t where;

    /*
     * 1: what `where` says is so; EBPO_ON: a boundary point of the result. 0, with EBPO_ON only:
     * faces that are not all in one plane meet at the point, as on edges and at vertices, and it
     * may be a boundary point or not.
     */
    int32_t certain;
} ebpo_boolean_result;

/*
 * Whether a point of the world, three finite doubles, is in the result.
 *
 * EBPO_E_ARGUMENT: the point is not finite. EBPO_E_ABSENT: a subset does not hold what decides.
 * EBPO_E_LIMIT, EBPO_E_MEMORY, and the errors of reading. On failure `out` is unspecified.
 *
 * Threads: one per expression.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_inside(ebpo_boolean *boolean, const double point[3],
                                                       ebpo_boolean_result *out, ebpo_error *error);

/*
 * The same for points[count][3], into out[count]; the message names the point. Of several failures
 * the one of the first point that failed.
 *
 * Threads: one per expression; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_inside_many(ebpo_boolean *boolean,
                                                            const double *points, uint64_t count,
                                                            ebpo_boolean_result *out,
                                                            ebpo_error *error);

/* ---- distance ---- */

typedef struct ebpo_boundary_options {
    size_t struct_size; /* EBPO_BOUNDARY_OPTIONS_INIT sets it */

    /* Enough when hi - lo <= tolerance hi; at least 0. */
    double tolerance;

    /* Stop after about so many cells of the world, and say what is certain. 0: 100,000. */
    uint64_t cells;
} ebpo_boundary_options;

#define EBPO_BOUNDARY_OPTIONS_INIT             \
    {                                          \
        sizeof(ebpo_boundary_options), 0.01, 0 \
    }

typedef struct ebpo_boundary_distance {
    /*
     * The distance to the result's boundary is certainly within; unsigned, in the unit of the
     * world. 0 .. 0: on the boundary. INFINITY .. INFINITY: the result is empty; hi alone is
     * INFINITY: perhaps.
     */
    double lo, hi;

    /* Of the point itself. */
    ebpo_boolean_result inside;

    /* That were looked at. */
    uint64_t cells;
} ebpo_boundary_distance;

/*
 * How far a point of the world, three finite doubles, is from the boundary of the result. Where the
 * nearest face of all operands is a part of that boundary, two distances answer, and `lo` and `hi`
 * differ by rounding; elsewhere cells of the world are searched, the nearest first.
 *
 * EBPO_E_ARGUMENT: the point or the tolerance. EBPO_E_LIMIT: as ebpo_boolean_cells_new, of level 0.
 * The errors of ebpo_boolean_inside.
 *
 * Threads: one per expression.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_distance(ebpo_boolean *boolean,
                                                         const double point[3],
                                                         const ebpo_boundary_options *options,
                                                         ebpo_boundary_distance *out,
                                                         ebpo_error *error);

/* ---- exact volume ---- */

typedef struct ebpo_volume_options {
    size_t struct_size; /* EBPO_VOLUME_OPTIONS_INIT sets it */
    ebpo_progress progress;
} ebpo_volume_options;

#define EBPO_VOLUME_OPTIONS_INIT EBPO_SIZED(ebpo_volume_options)

/* Why a volume is not exact. */
typedef enum ebpo_volume_doubt {
    EBPO_VOLUME_CERTAIN = 0,       /* it is */
    EBPO_VOLUME_OPERANDS_MEET = 1, /* a face of operand[0] meets one of operand[1] */
    EBPO_VOLUME_FACES_MEET = 2,    /* two of operand[0] meet otherwise than as neighbours */
    EBPO_VOLUME_IN_PARTS = 3,      /* the model of operand[0] is not all in memory */
    EBPO_VOLUME_SUBSET = 4         /* its file is a part of another */
} ebpo_volume_doubt;

typedef struct ebpo_exact_volume {
    size_t struct_size; /* EBPO_EXACT_VOLUME_INIT sets it */

    /*
     * The result's volume, in the unit of the world, cubed. EBPO_FIGURE_EXACT: lo and hi are the
     * double nearest to that of posed coordinates, ties to even (INFINITY beyond doubles, 0 below
     * them); `scaled` of 0: the result is empty. EBPO_FIGURE_BOUND: from 0 to a box around the
     * result; cells tell more.
     */
    ebpo_certain volume;

    /* An ebpo_volume_doubt: the first one that was found; of which operands, from 0. */
    int32_t doubt;
    uint32_t operand[2];

    uint32_t reserved;

    /* Of EBPO_VOLUME_OPERANDS_MEET a face of each, of EBPO_VOLUME_FACES_MEET two faces that meet,
     * by their numbers in the files; else EBPO_NO_FACE. */
    uint64_t file_face[2];

    /* Parts of the operands' surfaces that were looked at, and those of them that bound the result;
     * of an exact volume. */
    uint64_t patches, bounding;

    /* The same faces by their numbers in the sources, as ebpo_face_pair has them. */
    uint64_t face[2];

    /* An exact volume once more, rounded likewise but within any range: scaled * 2^exponent. */
    double scaled;
    int64_t exponent;
} ebpo_exact_volume;

#define EBPO_EXACT_VOLUME_INIT EBPO_SIZED(ebpo_exact_volume)

/*
 * The exact volume of the result, where the operands' faces allow it: none meets one of another
 * operand, not even in a point, and those with an area of one operand meet as neighbours only (as
 * ebpo_collide_self has it, at their poses). So shells may be apart, in each other, and turned
 * inside out, with any winding numbers. Equal operands, models of the same content at poses that
 * are bit by bit the same, are taken for one, and of operands that the expression does not use
 * nothing is asked. Where that does not hold the call succeeds, and `doubt` says why.
 *
 * Takes some 80 bytes for each face of one operand at a time.
 *
 * EBPO_E_ARGUMENT: `out` was not begun with its macro. EBPO_E_CANCELLED: by `progress`.
 * EBPO_E_LIMIT, EBPO_E_MEMORY, and the errors of reading. On failure `out` is unspecified.
 *
 * Threads: one per expression; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_exact_volume(ebpo_boolean *boolean,
                                                             const ebpo_volume_options *options,
                                                             ebpo_exact_volume *out,
                                                             ebpo_error *error);

/* ---- cells ---- */

typedef struct ebpo_cells_options {
    size_t struct_size; /* EBPO_CELLS_OPTIONS_INIT sets it */

    /* The finest cells: 2^-level of the root's edge; 0 to EBPO_BOOLEAN_LEVEL_MAX. */
    int level;

    uint32_t reserved;

    /* EBPO_E_LIMIT if more cells of a level are mixed. They take 32 bytes each while the next level
     * is made. 0: 2^25. */
    uint64_t most;

    ebpo_progress progress;
} ebpo_cells_options;

#define EBPO_BOOLEAN_LEVEL_MAX 20

#define EBPO_CELLS_OPTIONS_INIT                             \
    {                                                       \
        sizeof(ebpo_cells_options), 6, 0, 0, { NULL, NULL } \
    }

/*
 * The cells of an octree of the world, a cube around the result's box. A cell is *in* if all of the
 * closed cell is inner to the result for certain, *out* if none of it belongs to the result for
 * certain, else *mixed*. Uniform cells are not divided; mixed ones are, down to the level.
 */
typedef struct ebpo_boolean_cells ebpo_boolean_cells;

/*
 * Each operand is looked at in a ball around the cell: first by the white and black nodes of its
 * tree, which decide most while cells are larger than leaves, then by its faces. What depends on
 * one operand no more is not asked of it again. An operand that is used twice is taken for two:
 * where its own boundary is, cells are mixed.
 *
 * EBPO_E_ARGUMENT: the level. EBPO_E_LIMIT: too many cells (`most`), or the result is so small or
 * so far from the origin that corners of cells are no doubles, or larger than 2^300 or smaller than
 * 2^-300, so that volumes of cells are none. EBPO_E_CANCELLED, EBPO_E_MEMORY, and
 * the errors of ebpo_boolean_inside.
 *
 * The cells stay as they are when the expression is freed.
 *
 * Threads: one per expression; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_cells_new(ebpo_boolean *boolean,
                                                          const ebpo_cells_options *options,
                                                          ebpo_boolean_cells **out,
                                                          ebpo_error *error);

/*
 * Threads: one per cells.
 */
EBPO_API void ebpo_boolean_cells_free(ebpo_boolean_cells *cells);

typedef struct ebpo_boolean_volume {
    size_t struct_size; /* EBPO_BOOLEAN_VOLUME_INIT sets it */

    /*
     * The result's volume is certainly within, in the unit of the world, cubed: all in-cells, and
     * these with all mixed ones. Exact on posed coordinates; 0 .. 0: the result is empty.
     */
    double lo, hi;

    /* Of the root cell: its lowest corner and its edge, a power of two; 0: the result is empty. */
    double origin[3], edge;

    /* In-cells of any level; mixed cells of the finest level. */
    uint64_t in_cells, mixed_cells;

    /* Questions whether an operand is in or out of a cell: decided by the operand's box, by its
     * white and black nodes, and those that took its faces. */
    uint64_t by_box, by_nodes, by_faces;

    /* How lo and hi are meant, an ebpo_figure: EBPO_FIGURE_INTERVAL; EBPO_FIGURE_BOUND as long as
     * no cell is in; EBPO_FIGURE_EXACT of an empty result. */
    int32_t figure;

    int32_t reserved;
} ebpo_boolean_volume;

#define EBPO_BOOLEAN_VOLUME_INIT EBPO_SIZED(ebpo_boolean_volume)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_boolean_cells_volume(const ebpo_boolean_cells *cells,
                                               ebpo_boolean_volume *out);

typedef enum ebpo_boolean_side {
    EBPO_BOOLEAN_OUTER = 0, /* all in-cells and mixed cells: holds the result */
    EBPO_BOOLEAN_INNER = 1  /* all in-cells: the result holds it */
} ebpo_boolean_side;

/*
 * The surface of these cells: squares of the finest level, two triangles each, in doubles. It
 * balances, winding numbers are 0 and 1; where cells touch along edges or at corners, more than two
 * faces meet. The mesh may be written, or converted: an .ebpo.h5 file that is built of the outer
 * cells holds a solid that holds the result, and so do its envelopes.
 *
 * out   freed by ebpo_mesh_free; without faces if there are no such cells
 *
 * EBPO_E_ARGUMENT: no such side. EBPO_E_LIMIT: more than 2^32 - 2 faces. EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_cells_mesh(const ebpo_boolean_cells *cells,
                                                           ebpo_boolean_side side, ebpo_mesh *out,
                                                           ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
