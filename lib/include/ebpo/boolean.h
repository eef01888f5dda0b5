/* SPDX-License-Identifier: MIT
 * Evaluates queries of unions, intersections and differences of solids. Each solid is a model at a
 * pose.
 *
 *   Expressions     ebpo_boolean_new, ebpo_boolean_get_operands (instances of a scene)
 *   Point in solid  ebpo_boolean_inside, ebpo_boolean_inside_many
 *   Distance        ebpo_boolean_distance
 *   Exact volume    ebpo_boolean_exact_volume
 *   Mesh            ebpo_boolean_mesh
 *   Cells           ebpo_boolean_cells_new, ebpo_boolean_cells_volume, ebpo_boolean_cells_mesh
 *
 * The *result* is the solid that an expression of solids describes. Queries of the result are
 * evaluated by queries of the models, without a mesh of the result. Decisions are exact for posed
 * coordinates (pose.h), as if they were computed without rounding.
 *
 * The result is *regularised*. An operand is the closure of the points that the rule of its model
 * classifies as inside. The result is the closure of the interior of the set that the expression
 * describes. So the union of two boxes with a common side is one box, and a box minus an equal box
 * is empty.
 */
#ifndef EBPO_BOOLEAN_H
#define EBPO_BOOLEAN_H

#include <ebpo/collide.h>
#include <ebpo/pose.h>
#include <ebpo/scene.h>

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

/* An operand: a solid at a pose. Several operands may use the same model. */
typedef struct ebpo_boolean_operand {
    ebpo_model *model;
    ebpo_pose pose;
} ebpo_boolean_operand;

/* Maximum number of operands (including a box and half-spaces), and maximum number of nodes. */
#define EBPO_BOOLEAN_OPERANDS_MAX 64
#define EBPO_BOOLEAN_NODES_MAX    256

/* Options of ebpo_boolean_new. */
typedef struct ebpo_boolean_options {
    size_t struct_size;

    /* Number of threads for ebpo_boolean_inside_many and for cells. 0: all cores. */
    unsigned threads;

    /* Number of half-spaces in `planes`. */
    uint32_t plane_count;

    /*
     * Box to which the result is cut: low[3], then high[3]. NULL: no box. The box is an additional
     * operand after the caller's operands. The result is the intersection of the box and the
     * expression.
     */
    const double *box;

    /*
     * [plane_count][4] half-spaces to which the result is cut. The half-space of a row contains the
     * points p with row[0] * p[0] + row[1] * p[1] + row[2] * p[2] <= row[3]. The half-spaces are
     * additional operands after the box. Each of these operands is a tetrahedron that contains the
     * part of the result in the half-space. One face of the tetrahedron is in the plane; its three
     * corners are rounded to doubles, which moves the plane slightly. For a plane perpendicular to
     * axis k, only row[3] / row[k] is rounded.
     */
    const double *planes;

    /*
     * Folder for the small temporary files of the box and the half-spaces. NULL: $TMPDIR, or
     * /var/tmp if TMPDIR is not set.
     */
    const char *temp_dir;
} ebpo_boolean_options;

#define EBPO_BOOLEAN_OPTIONS_INIT EBPO_SIZED(ebpo_boolean_options)

/* An expression. For each thread, it contains a context (query.h) of each operand. */
typedef struct ebpo_boolean ebpo_boolean;

/*
 * Makes an expression of operands[operand_count] and nodes[node_count]. The last node is the root.
 * Several nodes may refer to the same node or operand. Both arrays are copied; the models must
 * outlive the expression.
 *
 * EBPO_E_ARGUMENT: an index is out of range; a node refers to itself or to a later node; an
 * operation, box, plane or pose (ebpo_pose_check) is not valid; there is a complement, but no box;
 * or operands that the expression uses have different units (an operand without a unit, or with
 * another scale than 1 in its pose, may be combined with every unit). EBPO_E_LIMIT: there are no
 * operands or nodes, or too many. EBPO_E_NOT_SOLID: an operand is a surface. EBPO_E_ABSENT: an
 * operand's file has no mesh. EBPO_E_IO: `temp_dir` cannot hold files. Messages give the index of
 * the node, or the number of the operand (from 1 on) and its file.
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
 * Gets the instances of a scene as operands for ebpo_boolean_new: operand i is the model of
 * instance i (ebpo_scene_model) at the instance's pose at a time (ebpo_scene_pose). The scene owns
 * the models, so it must outlive the expressions of these operands.
 *
 * scene      loaded (ebpo_scene_load)
 * time       in seconds; any finite time
 * operands   receives an operand for each instance; may be NULL if `capacity` is 0
 * capacity   length of `operands`
 * count      receives the number of instances, also if EBPO_E_LIMIT is returned
 *
 * EBPO_E_LIMIT: there are more than `capacity` instances. EBPO_E_ARGUMENT: a model is not loaded,
 * or the time is not finite. Also the errors of ebpo_model_new. On failure `operands` are
 * unspecified.
 *
 * Threads: one at a time per scene.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_boolean_get_operands(ebpo_scene *scene, double time,
                                                             ebpo_boolean_operand *operands,
                                                             uint32_t capacity, uint32_t *count,
                                                             ebpo_error *error);

/*
 * Frees an expression. Free its models only after this call.
 *
 * Threads: one at a time per expression.
 */
EBPO_API void ebpo_boolean_free(ebpo_boolean *boolean);

/* ---- point in solid ---- */

/* Classification of a point (ebpo_boolean_inside). */
typedef struct ebpo_boolean_result {
    /*
     * ebpo_where. EBPO_IN: the point is certainly in the interior of the result. EBPO_OUT: the
     * point is certainly in the interior of the complement of the result. EBPO_ON: the point is on
     * a posed face of an operand, and the other operands do not decide if the point is in the
     * result.
     */
    int32_t where;

    /*
     * 1: `where` is certain. In this case EBPO_ON means that the point is a boundary point of the
     * result. 0: `where` is EBPO_ON, but the point may or may not be a boundary point. The value 0
     * is possible only at points where faces in different planes intersect, as on edges and at
     * vertices.
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
 * Classifies points[count][3] into out[count]. If queries of several points fail, the error of the
 * first of these points is returned. The message gives the index of the point.
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

    /* The search stops when hi - lo <= tolerance * hi. The tolerance is at least 0. */
    double tolerance;

    /*
     * The search stops, with the bounds known so far, after it has visited about this many cells of
     * an octree around the result (ebpo_boolean_cells). 0: 100,000.
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
     * Bounds of the unsigned distance to the result's boundary, in the unit of the world. lo and hi
     * are 0: the point is on the boundary. lo and hi are INFINITY: the result is empty. Only hi is
     * INFINITY: the result may be empty.
     */
    double lo, hi;

    /* Classification of the point. */
    ebpo_boolean_result inside;

    /* Number of visited cells. */
    uint64_t cells;
} ebpo_boundary_distance;

/*
 * Computes the distance from a point of the world (three finite doubles) to the boundary of the
 * result. If the nearest face of all operands is part of that boundary, no search is necessary, and
 * `lo` and `hi` differ only by rounding. Otherwise the cells of an octree around the result are
 * searched, nearest first.
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
    EBPO_VOLUME_OPERANDS_INTERSECT = 1, /* faces of two operands intersect */
    EBPO_VOLUME_FACES_INTERSECT = 2,    /* faces of one operand intersect each other */
    EBPO_VOLUME_IN_PARTS = 3,           /* the model of an operand is not entirely in memory */
    EBPO_VOLUME_SUBSET = 4              /* the file of an operand is a subset */
} ebpo_volume_doubt;

/* Result of ebpo_boolean_exact_volume. */
typedef struct ebpo_exact_volume {
    size_t struct_size;

    /*
     * Volume of the result, in the cube of the world's unit.
     *
     * Kind EBPO_VALUE_EXACT: lo and hi are the double nearest to the exact volume for posed
     * coordinates, ties to even. If the volume is out of the range of doubles, lo and hi are
     * INFINITY or 0. So a result with lo and hi 0 may have a tiny volume; it is empty only if the
     * member `scaled` below is 0.
     *
     * Kind EBPO_VALUE_BOUND: lo is 0, and hi is the volume of a box around the result;
     * ebpo_boolean_cells_volume gives better bounds.
     */
    ebpo_value_bounds volume;

    /*
     * doubt: ebpo_volume_doubt, the first reason found. operand: indices of the two operands of
     * this reason. If the reason concerns one operand, operand[0] is its index.
     */
    int32_t doubt;
    uint32_t operand[2];

    uint32_t reserved;

    /*
     * Two intersecting faces, as indices in the files. EBPO_VOLUME_OPERANDS_INTERSECT: a face of
     * operand[0] and a face of operand[1]. EBPO_VOLUME_FACES_INTERSECT: two faces of operand[0]. In
     * all other cases: EBPO_NO_FACE.
     */
    uint64_t file_face[2];

    /*
     * For an exact volume. patches: number of parts of the operands' surfaces that were tested.
     * bounding: number of these parts that bound the result.
     */
    uint64_t patches, bounding;

    /*
     * The two faces of `file_face`, as source indices. If a file has no source indices: as indices
     * in the file.
     */
    uint64_t face[2];

    /*
     * Exact volume as scaled * 2^exponent, for volumes out of the range of doubles. `scaled` is
     * rounded to the nearest double, ties to even.
     */
    double scaled;
    int64_t exponent;
} ebpo_exact_volume;

#define EBPO_EXACT_VOLUME_INIT EBPO_SIZED(ebpo_exact_volume)

/*
 * Computes the exact volume of the result if the operands' faces meet two conditions. First, no
 * face intersects a face of another operand, not even in a point. Second, faces of one operand
 * intersect only in common corners and edges (as ebpo_collide_self tests, but at the pose); faces
 * without area are not tested. Shells may be apart, nested or inverted, with any winding numbers.
 * Equal operands (models of equal content at bitwise equal poses) count as one, and unused operands
 * are not tested. If a condition is not met, the call succeeds, and `doubt` gives the reason.
 *
 * Memory: about 80 bytes for each face of one operand; operands are processed one after the other.
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
     * True: coordinates of the mesh are doubles. False: coordinates are floats if all operands have
     * floats, and if each operand that the expression uses is in the range of floats, and at most
     * 1,024 times farther from the origin than it is long. Otherwise they are doubles.
     */
    bool doubles;

    /*
     * True: each face of the mesh has the attributes `operand` (uint8) and `operand_face` (uint32).
     * `operand` is the index of the operand from which the face comes. `operand_face` is the source
     * index of the operand's face.
     */
    bool origins;

    /* True: `volume` of the report is computed. */
    bool volume;

    /*
     * True: the mesh omits the faces of operand 0 that are unchanged in the result. The attribute
     * `removed` (columns `first` and `count`) of the mesh has the ranges of the faces of operand 0
     * that are not faces of the result. Indices are indices in the file of operand 0
     * (ebpo_file_read_mesh, not ebpo_file_read_source_mesh). ebpo_mesh_write_ply writes `removed`
     * as an element. The mesh and the faces of operand 0 outside these ranges, at its pose,
     * together are the result by the rule of operand 0. Self-intersections of operand 0 are not
     * cut, so faces that stay may intersect each other. Only the part of operand 0 near or in the
     * other operands is read, and its faces near their surfaces must fit in memory, as must
     * reversed faces. `volume` and `attributes` must be false.
     */
    bool changed_only;

    /*
     * True: the mesh has the attributes of vertices and faces of the operands. Values at new
     * vertices are interpolated. Normals (nx ny nz) are rotated with their operand. They are
     * reversed if the face to which they belong is reversed. If an operand does not have an
     * attribute, its faces or vertices get the value 0, or white for colours.
     * ebpo_mesh_attributes_lost names the attributes that cannot be carried over.
     */
    bool attributes;

    /*
     * True: each operand has one colour, which its faces get as the attributes red, green and blue.
     * In this case the colours in the operands' files are ignored.
     */
    bool colours;

    uint8_t reserved[2];

    /*
     * Workspace for the arrays of the mesh, and for arrays whose size grows with the operands. Free
     * it after the mesh. NULL: the memory is not limited.
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

    /* Number of the operands' faces that were cut along intersections. */
    uint64_t faces_cut;

    /* Number of vertices of the result that are not vertices of an operand. */
    uint64_t new_vertices;

    /* Number of parts of the operands' surfaces. One point of each part was classified. */
    uint64_t patches;

    /*
     * Greatest distance between a vertex of the mesh and the exact vertex of the result, in the
     * world's unit, up to rounding.
     */
    double displacement;

    /*
     * If requested: volume of the result before its vertices are rounded, in the cube of the
     * world's unit. Kind EBPO_VALUE_EXACT: the double nearest to this volume, ties to even. Kind
     * EBPO_VALUE_INTERVAL: lo and hi contain the volume, and at most one double is between them.
     */
    ebpo_value_bounds volume;

    /* With `changed_only`: number of faces of operand 0 in the ranges of `removed`. */
    uint64_t removed_faces;

    /*
     * If `volume` has the kind EBPO_VALUE_EXACT: the volume as scaled * 2^exponent, for volumes out
     * of the range of doubles, for which `volume` is infinite or 0. `scaled` is rounded to the
     * nearest double, ties to even.
     */
    double scaled;
    int64_t exponent;
} ebpo_boolean_mesh_report;

#define EBPO_BOOLEAN_MESH_REPORT_INIT EBPO_SIZED(ebpo_boolean_mesh_report)

/*
 * Makes the mesh of the result. Faces of operands are cut exactly along their intersections with
 * all other faces, including coplanar faces and faces of the same operand. The parts that bound the
 * result are kept, and reversed if necessary. Faces that are not cut keep their posed corners,
 * which are rounded only if the mesh has floats. All other vertices are the exact vertices of the
 * result, rounded to the nearest coordinates. The mesh is closed: each edge is used equally often
 * in both directions. Rounding may create small intersections of faces
 * (ebpo_mesh_self_intersections). Vertices of cut faces that become equal by rounding are merged,
 * and faces that lose a corner in this way are omitted. Winding numbers of the mesh are 1 in the
 * result and 0 elsewhere, except near rounded vertices. The mesh is the same for any number of
 * threads.
 *
 * Memory, which a workspace may limit: about 40 bytes for each face of one operand (operands are
 * processed one after the other), and 25 bytes for each face of the mesh. Memory that no workspace
 * limits: 1,500 bytes for each face that is cut.
 *
 * out     freed by ebpo_mesh_free; without faces if the result is empty
 * report  may be NULL
 *
 * EBPO_E_ARGUMENT: `changed_only` is true, and one of these conditions is met: the expression does
 * not use operand 0; `volume` is true; `attributes` is true.
 * EBPO_E_ABSENT: an operand is a subset. EBPO_E_LIMIT: an operand has more than 2^31 - 1 faces, its
 * cut faces have more parts or points than that, or the result has more than 2^32 - 2 faces or
 * vertices.
 * EBPO_E_FORMAT: an operand is not closed, although its file says that it is a solid.
 * EBPO_E_UNSUPPORTED: `changed_only` is true, and operand 0 is cut or reversed where its faces
 * intersect each other, have no area, or have a side with a winding number other than 0 and 1. Also
 * the errors of reading. On failure `out` is cleared.
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

    /*
     * Level of the finest cells, 0 to EBPO_BOOLEAN_LEVEL_MAX. The edge of these cells is 2^-level
     * of the edge of the root cell.
     */
    int level;

    uint32_t reserved;

    /*
     * Maximum number of mixed cells of a level; if there are more, EBPO_E_LIMIT is returned. While
     * the next level is made, each mixed cell takes 32 bytes. 0: the maximum is 2^25.
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
 * Cells of an octree in the world coordinates of the poses. The root cell is a cube around the
 * result's box. A cell is *in* if the closed cell is certainly in the interior of the result. A
 * cell is *out* if certainly no point of the cell belongs to the result. All other cells are
 * *mixed*, and are subdivided down to the level of the options.
 */
typedef struct ebpo_boolean_cells ebpo_boolean_cells;

/*
 * Makes the cells. Each operand is tested in a ball around the cell. White and black nodes of the
 * operand's tree are tested first. For a cell that is larger than the operand's leaves, these nodes
 * usually give the result of the test. Otherwise the operand's faces are tested. An operand that
 * cannot change the result in a cell is not tested in the cell's children. If the expression uses
 * an operand twice, the two uses are evaluated as two operands. Therefore cells at the boundary of
 * this operand are mixed, even if the boundary of the result is not there.
 *
 * The cells stay valid after the expression is freed.
 *
 * EBPO_E_ARGUMENT: the level is not valid. EBPO_E_LIMIT: there are too many cells (`most`). Also if
 * doubles cannot represent the corners of the cells, because the result is too small or too far
 * from the origin. Also if the result is larger than 2^300 or smaller than 2^-300, so that volumes
 * are out of range. Other errors are those of ebpo_boolean_inside.
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
     * in-cells, and hi is the volume of all in-cells and mixed cells. Both bounds hold exactly for
     * posed coordinates. lo and hi are 0: the result is empty.
     */
    double lo, hi;

    /*
     * Lowest corner of the root cell, and length of its edge, which is a power of two. If the
     * result is empty, both are 0.
     */
    double origin[3], edge;

    /* Number of in-cells of all levels, and number of mixed cells of the finest level. */
    uint64_t in_cells, mixed_cells;

    /*
     * Number of tests of an operand in a cell. by_box: tests that the operand's box decided.
     * by_nodes: tests that white and black nodes of the operand's tree decided. by_faces: tests
     * that the operand's faces decided.
     */
    uint64_t by_box, by_nodes, by_faces;

    /*
     * ebpo_value_kind of lo and hi: EBPO_VALUE_EXACT if the result is empty, EBPO_VALUE_BOUND if
     * there are no in-cells, EBPO_VALUE_INTERVAL in other cases.
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
 * Makes the surface of the cells that `side` selects. It consists of squares of the finest level,
 * each as two triangles, with coordinates in doubles. The mesh is closed
 * (ebpo_mesh_report.balanced), with winding numbers 0 and 1. If cells touch only along an edge or
 * at a corner, the mesh is not a 2-manifold there. The mesh may be written or converted. If a mesh
 * of EBPO_BOOLEAN_OUTER is converted, the model and the envelopes in the .ebpo.h5 file contain the
 * result.
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
