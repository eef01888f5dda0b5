/* SPDX-License-Identifier: MIT
 * Evaluates queries of unions, intersections and differences of solids at poses.
 *
 *   Expressions     ebpo_boolean_new
 *   Point in solid  ebpo_boolean_inside, ebpo_boolean_inside_many
 *   Distance        ebpo_boolean_distance
 *   Exact volume    ebpo_boolean_exact_volume
 *   Mesh            ebpo_boolean_mesh
 *   Cells           ebpo_boolean_cells_new, ebpo_boolean_cells_volume, ebpo_boolean_cells_mesh
 *
 * The *result* is the solid that an expression of solids describes. Queries of the result are
 * evaluated by queries of the models, without its mesh. Decisions equal those of arithmetic without
 * rounding on posed coordinates (pose.h).
 *
 * The result is *regularised*: an operand is the closure of the points that are inside by its rule,
 * and the result is the closure of its own interior. So the union of two boxes with a common side
 * is one box, and a box minus an equal box is empty.
 */
#ifndef EBPO_BOOLEAN_H
#define EBPO_BOOLEAN_H

#include <ebpo/collide.h>
#include <ebpo/pose.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- expressions ---- */

/* Operation of a node of an expression. */
typedef enum ebpo_boolean_operation {
    EBPO_BOOLEAN_OPERAND = 0,              /* the operand with index `left` */
    EBPO_BOOLEAN_UNION = 1,                /* in `left`, in `right`, or in both */
    EBPO_BOOLEAN_INTERSECTION = 2,         /* in `left` and in `right` */
    EBPO_BOOLEAN_DIFFERENCE = 3,           /* in `left` and not in `right` */
    EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE = 4, /* in `left` or in `right`, not in both */
    EBPO_BOOLEAN_COMPLEMENT = 5            /* not in `left`; needs a box (ebpo_boolean_options) */
} ebpo_boolean_operation;

/* Node of the expression tree; `left` and `right` are indices of earlier nodes. */
typedef struct ebpo_boolean_node {
    int32_t operation; /* ebpo_boolean_operation */
    uint32_t left, right;
    uint32_t reserved;
} ebpo_boolean_node;

/* An operand: a solid at a pose. Several operands may use one model. */
typedef struct ebpo_boolean_operand {
    ebpo_model *model;
    ebpo_pose pose;
} ebpo_boolean_operand;

/* Maximum numbers of operands, a box and half-spaces included, and of nodes. */
#define EBPO_BOOLEAN_OPERANDS_MAX 64
#define EBPO_BOOLEAN_NODES_MAX    256

/* Options of ebpo_boolean_new. */
typedef struct ebpo_boolean_options {
    size_t struct_size;

    /* Number of threads for ebpo_boolean_inside_many and for cells. 0: all cores. */
    unsigned threads;

    /* Number of planes. */
    uint32_t plane_count;

    /*
     * Box to which the result is cut, low[3], then high[3]; NULL: none. The box is one more
     * operand, after those of the caller, and the result is its intersection with the expression.
     */
    const double *box;

    /*
     * [plane_count][4] half-spaces to which the result is cut: the points p with row[0] p[0] +
     * row[1] p[1] + row[2] p[2] <= row[3]. They are operands after the box. Each is a
     * tetrahedron that contains its part of the result. The three corners of its face in the plane
     * are rounded to doubles, and so is the plane through them; for an axis-parallel plane this is
     * one rounding of row[3] / row[k].
     */
    const double *planes;
} ebpo_boolean_options;

#define EBPO_BOOLEAN_OPTIONS_INIT EBPO_SIZED(ebpo_boolean_options)

/* An expression. It contains a context (query.h) of each operand for each thread. */
typedef struct ebpo_boolean ebpo_boolean;

/*
 * Makes an expression over operands[operand_count]: nodes[node_count], the last of which is the
 * root. Several nodes may share a node or an operand. Both arrays are copied; the models must
 * outlive the expression.
 *
 * EBPO_E_ARGUMENT: an index is out of range or not of an earlier node, an operation is not valid,
 * a complement has no box, a box or plane is not valid, or a pose is not valid (ebpo_pose_check).
 * EBPO_E_LIMIT: no operands or nodes, or too many. EBPO_E_NOT_SOLID: an operand is a surface.
 * EBPO_E_ABSENT: an operand's file has no mesh. Messages give the index of the node, or the number
 * of the operand (from 1 on) and its file.
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
 * Frees an expression. Free its models after this call.
 *
 * Threads: one at a time per expression.
 */
EBPO_API void ebpo_boolean_free(ebpo_boolean *boolean);

/* ---- point in solid ---- */

/* Classification of a point (ebpo_boolean_inside). */
typedef struct ebpo_boolean_result {
    /*
     * ebpo_where. EBPO_IN: certainly an interior point of the result. EBPO_OUT: certainly an
     * interior point of the complement of the result. EBPO_ON: the point is on a posed face of an
     * operand, and the other operands do not decide.
     */
    int32_t where;

    /*
     * 1: `where` is certain; with EBPO_ON, the point is a boundary point of the result. 0 (only
     * with EBPO_ON): faces in different planes intersect at the point, as on edges and at vertices;
     * the point may or may not be a boundary point.
     */
    int32_t certain;
} ebpo_boolean_result;

/*
 * Classifies a point of the world (three finite doubles).
 *
 * EBPO_E_ARGUMENT: the point is not finite. EBPO_E_ABSENT: a subset lacks the required data.
 * EBPO_E_LIMIT: the budget is too small (ebpo_model_new). Also the errors of reading (base.h). On
 * failure `out` is unspecified.
 *
 * Threads: one at a time per expression.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_inside(ebpo_boolean *boolean, const double point[3],
                                                       ebpo_boolean_result *out, ebpo_error *error);

/*
 * Classifies points[count][3] into out[count]. If queries of several points fail, the error is that
 * of the first of these points, and the message has the index of the point.
 *
 * Threads: one at a time per expression.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_inside_many(ebpo_boolean *boolean,
                                                            const double *points, uint64_t count,
                                                            ebpo_boolean_result *out,
                                                            ebpo_error *error);

/* ---- distance ---- */

/* Options of ebpo_boolean_distance. */
typedef struct ebpo_boundary_options {
    size_t struct_size;

    /* The search stops when hi - lo <= tolerance * hi. At least 0. */
    double tolerance;

    /*
     * The search stops after about this many cells of an octree around the result
     * (ebpo_boolean_cells), with the bounds known so far. 0: 100,000.
     */
    uint64_t cells;
} ebpo_boundary_options;

#define EBPO_BOUNDARY_OPTIONS_INIT             \
    {                                          \
        sizeof(ebpo_boundary_options), 0.01, 0 \
    }

/* Result of ebpo_boolean_distance. */
typedef struct ebpo_boundary_distance {
    /*
     * Bounds of the unsigned distance to the result's boundary, in the unit of the world. Both 0:
     * the point is on the boundary. Both INFINITY: the result is empty. Only hi is INFINITY: the
     * result may be empty.
     */
    double lo, hi;

    /* Classification of the point. */
    ebpo_boolean_result inside;

    /* Number of visited cells. */
    uint64_t cells;
} ebpo_boundary_distance;

/*
 * Computes the distance from a point of the world (three finite doubles) to the boundary of the
 * result. If the face that is nearest among all operands is part of that boundary, no search is
 * necessary, and `lo` and `hi` differ only by rounding. Otherwise cells of an octree around the
 * result are searched, nearest first.
 *
 * EBPO_E_ARGUMENT: the point or the tolerance is not valid. EBPO_E_LIMIT: as for
 * ebpo_boolean_cells_new with level 0. Other errors are those of ebpo_boolean_inside.
 *
 * Threads: one at a time per expression.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_distance(ebpo_boolean *boolean,
                                                         const double point[3],
                                                         const ebpo_boundary_options *options,
                                                         ebpo_boundary_distance *out,
                                                         ebpo_error *error);

/* ---- exact volume ---- */

/* Options of ebpo_boolean_exact_volume. */
typedef struct ebpo_volume_options {
    size_t struct_size;
    ebpo_progress progress;
} ebpo_volume_options;

#define EBPO_VOLUME_OPTIONS_INIT EBPO_SIZED(ebpo_volume_options)

/* Reason why a volume is not exact. */
typedef enum ebpo_volume_doubt {
    EBPO_VOLUME_CERTAIN = 0,            /* the volume is exact */
    EBPO_VOLUME_OPERANDS_INTERSECT = 1, /* a face of operand[0] intersects one of operand[1] */
    EBPO_VOLUME_FACES_INTERSECT = 2,    /* faces of operand[0] intersect each other */
    EBPO_VOLUME_IN_PARTS = 3,           /* the model of operand[0] is not entirely in memory */
    EBPO_VOLUME_SUBSET = 4              /* the file of operand[0] is a subset */
} ebpo_volume_doubt;

/* Result of ebpo_boolean_exact_volume. */
typedef struct ebpo_exact_volume {
    size_t struct_size;

    /*
     * Volume of the result, in the cube of the world's unit. EBPO_VALUE_EXACT: lo and hi are the
     * double nearest to the exact volume for posed coordinates, ties to even; INFINITY or 0 if the
     * volume is out of the range of doubles. The result is empty if `scaled` is 0.
     * EBPO_VALUE_BOUND: from 0 to the volume of a box around the result; ebpo_boolean_cells_volume
     * gives better bounds.
     */
    ebpo_value_bounds volume;

    /* ebpo_volume_doubt: the first reason found, and its operands. */
    int32_t doubt;
    uint32_t operand[2];

    uint32_t reserved;

    /*
     * Two intersecting faces, as indices in the files. EBPO_VOLUME_OPERANDS_INTERSECT: one of each
     * operand. EBPO_VOLUME_FACES_INTERSECT: both of operand[0]. Else EBPO_NO_FACE.
     */
    uint64_t file_face[2];

    /*
     * For an exact volume: number of parts of the operands' surfaces that were tested, and of parts
     * that bound the result.
     */
    uint64_t patches, bounding;

    /* The two faces of `file_face`, with indices as in ebpo_face_pair. */
    uint64_t face[2];

    /*
     * The exact volume is scaled * 2^exponent, rounded in the same way, without the limited range
     * of doubles.
     */
    double scaled;
    int64_t exponent;
} ebpo_exact_volume;

#define EBPO_EXACT_VOLUME_INIT EBPO_SIZED(ebpo_exact_volume)

/*
 * Computes the exact volume of the result if the operands' faces meet the following condition. No
 * face may intersect a face of another operand, not even in a point. Faces of one operand, except
 * those without area, may intersect only as neighbours (ebpo_collide_self, at their poses). Shells
 * may be apart, nested or inverted, with any winding numbers. Equal operands (models of equal
 * content at bitwise equal poses) count as one, and unused operands are not tested. If the
 * condition is not met, the call succeeds and `doubt` gives the reason.
 *
 * Takes about 80 bytes for each face of one operand at a time.
 *
 * EBPO_E_LIMIT: the budget is too small (ebpo_model_new). Also the errors of reading (base.h). On
 * failure `out` is unspecified.
 *
 * Threads: one at a time per expression.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_exact_volume(ebpo_boolean *boolean,
                                                             const ebpo_volume_options *options,
                                                             ebpo_exact_volume *out,
                                                             ebpo_error *error);

/* ---- mesh ---- */

/* Options of ebpo_boolean_mesh. */
typedef struct ebpo_boolean_mesh_options {
    size_t struct_size;

    ebpo_progress progress;

    /*
     * True: coordinates of the mesh are doubles. False: floats if the coordinates of all operands
     * are floats and the result is in the range of floats; else doubles.
     */
    bool doubles;

    /*
     * True: faces of the mesh have the attributes `operand` (uint8, from 0) and `operand_face`
     * (uint32): the operand from which the face comes, and the source index of the face of this
     * operand.
     */
    bool origins;

    /* True: `volume` of the report is computed. */
    bool volume;

    /*
     * True: the mesh has only the faces of the result that are not unchanged faces of operand 0.
     * Its attribute `removed` (first count) has the ranges of the other faces of operand 0, in the
     * order of its file, which ebpo_mesh_write_ply writes as an element. All other faces of operand
     * 0, with the mesh, are the result. Other faces of operand 0 stay as
     * they are, also if they intersect each other. Only the part of operand 0 in the box of the
     * other operands is read, and its faces there must fit in memory. Excludes `volume` and
     * `attributes`.
     */
    bool changed_only;

    /*
     * True: the mesh has the attributes of vertices and faces of the operands. Values at new
     * vertices are interpolated. Normals (nx ny nz) are turned with their operand, and reversed
     * with their face. Faces and vertices of operands without an attribute get 0, or white.
     * ebpo_mesh_attributes_lost names the attributes that cannot be carried over.
     */
    bool attributes;

    /*
     * True: faces have a colour (attributes red, green and blue) for each operand; colours of
     * operands are then not carried over.
     */
    bool colours;

    uint8_t reserved[2];

    /*
     * Holds the arrays of the mesh, and the arrays that grow with the operands; free it after the
     * mesh. NULL: no limit of memory.
     */
    ebpo_workspace *workspace;
} ebpo_boolean_mesh_options;

#define EBPO_BOOLEAN_MESH_OPTIONS_INIT                                                        \
    {                                                                                         \
        sizeof(ebpo_boolean_mesh_options), { NULL, NULL }, false, false, false, false, false, \
            false, { 0 }, NULL                                                                \
    }

/* Statistics of ebpo_boolean_mesh. */
typedef struct ebpo_boolean_mesh_report {
    size_t struct_size;

    /* Number of faces of the operands that were cut. */
    uint64_t faces_cut;

    /* Number of vertices of the result that no operand has. */
    uint64_t new_vertices;

    /* Number of parts of the operands' surfaces that were classified, each by one point. */
    uint64_t patches;

    /*
     * Greatest distance between a vertex of the mesh and the exact vertex of the result, in the
     * world's unit, up to rounding.
     */
    double displacement;

    /*
     * If requested: volume of the exact result, before vertices are rounded, in the cube of the
     * world's unit. EBPO_VALUE_EXACT: the nearest double, ties to even. EBPO_VALUE_INTERVAL: two or
     * three neighbouring doubles, between which the volume is.
     */
    ebpo_value_bounds volume;

    /* If only changes were requested: number of removed faces of operand 0. */
    uint64_t removed_faces;
} ebpo_boolean_mesh_report;

#define EBPO_BOOLEAN_MESH_REPORT_INIT EBPO_SIZED(ebpo_boolean_mesh_report)

/*
 * Makes the mesh of the result. Faces of operands are cut exactly along their intersections with
 * all other faces, including coplanar faces and faces of the same operand. The parts that bound the
 * result are kept, where needed with the reverse orientation. Faces that are not cut keep their
 * corners, at their poses. Other vertices are the exact vertices of the result, rounded to the
 * nearest coordinates. The mesh is closed: each edge is used equally often in both directions.
 * Rounding may create small intersections of faces (ebpo_mesh_self_intersections). Vertices of cut
 * faces that become equal by rounding are merged, and faces that lose a corner in this way are
 * omitted. Winding numbers of the mesh are 1 in the result and 0 elsewhere, except near rounded
 * vertices. The mesh is the same for any number of threads.
 *
 * Takes about 40 bytes for each face of one operand at a time and 25 bytes for each face of the
 * mesh, both of which a workspace may hold. In addition, takes 1,500 bytes for each face that is
 * cut.
 *
 * out     freed by ebpo_mesh_free; without faces if the result is empty
 * report  may be NULL
 *
 * EBPO_E_ARGUMENT: operands have different units; or changes are requested of an unused operand 0,
 * or with the volume. EBPO_E_ABSENT: an operand is a subset.
 * EBPO_E_LIMIT: more than 2^31 - 1 faces, or 2^31 vertices. EBPO_E_FORMAT: an operand is not
 * closed, although its file states so. EBPO_E_UNSUPPORTED: only changes are requested, but near the
 * other operands, operand 0 has faces that intersect each other or have no area, or winding numbers
 * other than 0 and 1. Also the errors of reading. On failure `out` is cleared.
 *
 * Threads: one at a time per expression.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_mesh(ebpo_boolean *boolean,
                                                     const ebpo_boolean_mesh_options *options,
                                                     ebpo_mesh *out,
                                                     ebpo_boolean_mesh_report *report,
                                                     ebpo_error *error);

/* ---- cells ---- */

/* Options of ebpo_boolean_cells_new. */
typedef struct ebpo_cells_options {
    size_t struct_size;

    /* Finest cells: 2^-level of the root's edge; 0 to EBPO_BOOLEAN_LEVEL_MAX. */
    int level;

    uint32_t reserved;

    /*
     * Maximum number of mixed cells of a level; with more, EBPO_E_LIMIT. A mixed cell takes 32
     * bytes while the next level is made. 0: 2^25.
     */
    uint64_t most;

    ebpo_progress progress;
} ebpo_cells_options;

/* Deepest level of cells. */
#define EBPO_BOOLEAN_LEVEL_MAX 20

#define EBPO_CELLS_OPTIONS_INIT                             \
    {                                                       \
        sizeof(ebpo_cells_options), 6, 0, 0, { NULL, NULL } \
    }

/*
 * Cells of an octree of the world, whose root is a cube around the result's box. A cell is *in* if
 * the closed cell is certainly in the interior of the result, *out* if certainly no point belongs
 * to the result, else *mixed*. Mixed cells are subdivided down to the level.
 */
typedef struct ebpo_boolean_cells ebpo_boolean_cells;

/*
 * Makes the cells. Each operand is tested in a ball around the cell: first by the white and black
 * nodes of its tree, which usually decide while cells are larger than leaves, then by its faces. An
 * operand that cannot change the result in a cell is not tested in the cell's children. An operand
 * that is used twice counts as two operands, so cells at its boundary are mixed.
 *
 * The cells stay valid after the expression is freed.
 *
 * EBPO_E_ARGUMENT: the level is not valid. EBPO_E_LIMIT: too many cells (`most`); the result is too
 * small or too far from the origin for corners of cells in doubles; or it is larger than 2^300 or
 * smaller than 2^-300, so that volumes are out of range. Other errors are those of
 * ebpo_boolean_inside.
 *
 * Threads: one at a time per expression.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_cells_new(ebpo_boolean *boolean,
                                                          const ebpo_cells_options *options,
                                                          ebpo_boolean_cells **out,
                                                          ebpo_error *error);

/*
 * Frees the cells.
 *
 * Threads: one at a time per object of cells.
 */
EBPO_API void ebpo_boolean_cells_free(ebpo_boolean_cells *cells);

/* Result of ebpo_boolean_cells_volume. */
typedef struct ebpo_boolean_volume {
    size_t struct_size;

    /*
     * Bounds of the result's volume, in the cube of the world's unit: lo is the volume of all
     * in-cells, hi the volume of all in-cells and mixed cells. Exact on posed coordinates. Both 0:
     * the result is empty.
     */
    double lo, hi;

    /*
     * Lowest corner of the root cell, and length of its edge, which is a power of two. 0: the
     * result is empty.
     */
    double origin[3], edge;

    /* Number of in-cells of all levels, and of mixed cells of the finest level. */
    uint64_t in_cells, mixed_cells;

    /*
     * Number of tests of an operand against a cell. by_box: tests that the operand's box decided.
     * by_nodes: that its white and black nodes decided. by_faces: that its faces decided.
     */
    uint64_t by_box, by_nodes, by_faces;

    /*
     * Accuracy of lo and hi, an ebpo_value_kind: EBPO_VALUE_INTERVAL; EBPO_VALUE_BOUND if no cell
     * is in; EBPO_VALUE_EXACT for an empty result.
     */
    int32_t kind;

    int32_t reserved;
} ebpo_boolean_volume;

#define EBPO_BOOLEAN_VOLUME_INIT EBPO_SIZED(ebpo_boolean_volume)

/*
 * Gets the volume of the cells.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_boolean_cells_volume(const ebpo_boolean_cells *cells,
                                               ebpo_boolean_volume *out);

/* Cells whose surface ebpo_boolean_cells_mesh makes. */
typedef enum ebpo_boolean_side {
    EBPO_BOOLEAN_OUTER = 0, /* all in-cells and mixed cells: contains the result */
    EBPO_BOOLEAN_INNER = 1  /* all in-cells: contained in the result */
} ebpo_boolean_side;

/*
 * Makes the surface of these cells: squares of the finest level, two triangles each, in doubles.
 * The mesh is closed (ebpo_mesh_report.balanced), with winding numbers 0 and 1. Where cells touch
 * only along an edge or at a corner, the mesh is not a 2-manifold. The mesh may be written or
 * converted: an .ebpo.h5 file of the outer cells, and its envelopes, contain the result.
 *
 * out   freed by ebpo_mesh_free; without faces if there are no such cells
 *
 * EBPO_E_LIMIT: more than 2^32 - 2 faces.
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
