/* SPDX-License-Identifier: MIT
 * Detects collisions of two models, and self-intersections of one model.
 *
 *   Two models            ebpo_collider_new (one collider for each thread)
 *   Any contact           ebpo_collide_first
 *   Relation              ebpo_collide_relation
 *   All pairs of faces    ebpo_collide_all, ebpo_collide_self
 *   Intersection lines    ebpo_collide_contacts, ebpo_collide_polylines
 *   As a file             ebpo_collide_write
 *   Distance              ebpo_collide_distance
 *   Depth                 ebpo_collide_depth
 *   Separation distance   ebpo_collide_separation
 *   By levels             ebpo_collide_levels
 *   One mesh              ebpo_mesh_self_intersections
 *
 * Decisions are exact on posed coordinates (pose.h). The *world* is the space of posed coordinates.
 * Results do not depend on the order of the models or on the machine. Results do not depend on
 * budgets either, with two exceptions: the pair of intersecting faces that ebpo_collide_first and
 * ebpo_collide_distance return, and distances within a tolerance. Every query supports partly
 * loaded models. A model is partly loaded if only some of its subtrees are in memory, because of a
 * budget or a cut level (query.h). The envelope of a node is a convex polyhedron that contains the
 * part of the solid in the node's cell. docs/develop/collision.md explains the kinds of pairs.
 */
#ifndef EBPO_COLLIDE_H
#define EBPO_COLLIDE_H

#include <ebpo/mesh.h>
#include <ebpo/pair.h>
#include <ebpo/pose.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- two models ---- */

/* Options of ebpo_collider_new. */
typedef struct ebpo_collider_options {
    size_t struct_size;

    /*
     * Number of threads for ebpo_collide_all and the functions that use its pairs. 0: all cores.
     * Other queries use the calling thread.
     */
    unsigned threads;

    /*
     * Memory in bytes for pairs that are not sorted yet, besides the models' budgets. 0: 64 MiB. If
     * the pairs need more memory, the models are traversed several times.
     */
    uint64_t memory;
} ebpo_collider_options;

#define EBPO_COLLIDER_OPTIONS_INIT          \
    {                                       \
        sizeof(ebpo_collider_options), 0, 0 \
    }

/* Two models (or one model, used twice) and scratch memory. One thread at a time may query it. */
typedef struct ebpo_collider ebpo_collider;

/*
 * Makes a collider. Both models must outlive it.
 *
 * EBPO_E_ABSENT: a file has no mesh, or is a subset.
 *
 * Threads: any; many colliders may share models.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collider_new(ebpo_model *a, ebpo_model *b,
                                                     const ebpo_collider_options *options,
                                                     ebpo_collider **out, ebpo_error *error);

/*
 * Frees a collider.
 *
 * Threads: one at a time per collider.
 */
EBPO_API void ebpo_collider_free(ebpo_collider *collider);

/*
 * Checks that a model can be queried at a pose.
 *
 * EBPO_E_ARGUMENT: the matrix is not a rotation, a value is not finite, or the scale or the posed
 * model is out of range. If the matrix is not a rotation, the message reports a mirror image or a
 * difference: of the length of a column from 1, or of the angle of two columns from a right angle.
 * A difference of 2^-20 is allowed.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_pose_check(const ebpo_model *model, const ebpo_pose *pose,
                                                   ebpo_error *error);

/*
 * Options of all queries of a collider. NULL: identity poses (both models as in their files), and
 * no deadline.
 */
typedef struct ebpo_collide_options {
    size_t struct_size;

    /* Poses of both models; they must pass ebpo_pose_check. */
    ebpo_pose pose_a, pose_b;

    /* The query stops after about this many nanoseconds. 0: no deadline. */
    uint64_t deadline_ns;

    ebpo_progress progress;

    /* For ebpo_collide_levels: deepest level that is used. -1: all levels in memory are used. */
    int32_t level;

    int32_t reserved;
} ebpo_collide_options;

#define EBPO_COLLIDE_OPTIONS_INIT                                                              \
    {                                                                                          \
        sizeof(ebpo_collide_options), EBPO_POSE_INIT, EBPO_POSE_INIT, 0, { NULL, NULL }, -1, 0 \
    }

/* ---- any contact ---- */

/*
 * Two faces, one of model A and one of model B. face_a, face_b: source indices (if a file has no
 * source indices: indices in the file). file_face_a, file_face_b: indices in the files.
 */
typedef struct ebpo_face_pair {
    uint64_t face_a, face_b, file_face_a, file_face_b;

    /*
     * ebpo_pair_kind of the faces. EBPO_PAIR_APART: no pair was found, or this is the nearest pair
     * and its faces do not intersect.
     */
    int32_t kind;

    int32_t reserved;
} ebpo_face_pair;

/*
 * Finds a pair of intersecting faces. Sets *found to 1 if a pair was found, to 0 if no faces
 * intersect, and to -1 if this is undecided at the deadline. Only faces count: if one solid is
 * inside another solid and their faces do not intersect, *found is 0.
 *
 * For the same files and poses, the pair is the same on every machine. The pair need not be the
 * first pair of ebpo_collide_all. For partly loaded models, the pair also depends on the subtrees
 * in memory.
 *
 * EBPO_E_ARGUMENT: a pose is not valid (ebpo_pose_check). EBPO_E_LIMIT: the budget is too small
 * (ebpo_model_new). Also the errors of reading (base.h).
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_first(ebpo_collider *collider,
                                                      const ebpo_collide_options *options,
                                                      ebpo_face_pair *out, int32_t *found,
                                                      ebpo_error *error);

/* ---- relation ---- */

/*
 * Relation of two point sets at their poses. The set of a solid is the closure of the points that
 * are inside by its rule. The set of a surface consists of its faces. The part EBPO_PART_BORDER
 * gives a surface an inside for ebpo_inside, but not for relations. Faces without area are ignored.
 * Exactly one relation applies: EBPO_A_INSIDE_B, EBPO_B_INSIDE_A and EBPO_EQUAL take precedence
 * over EBPO_TOUCHING and EBPO_INTERSECTING.
 */
typedef enum ebpo_relation {
    EBPO_DISJOINT = 0,     /* no common point */
    EBPO_TOUCHING = 1,     /* common points, but no common interior point */
    EBPO_INTERSECTING = 2, /* common interior points */
    EBPO_A_INSIDE_B = 3,   /* B is a solid and contains all points of A; the sets are not equal */
    EBPO_B_INSIDE_A = 4,   /* A is a solid and contains all points of B; the sets are not equal */
    EBPO_EQUAL = 5,        /* the same points; the sets are not empty */
    EBPO_RELATION_UNDECIDED = 6 /* undecided at the deadline */
} ebpo_relation;

/* Result of ebpo_collide_relation. */
typedef struct ebpo_relation_result {
    /* ebpo_relation */
    int32_t relation;

    /*
     * 1: some faces of A and B intersect (for example, if a solid inside another solid touches it
     * from inside). 0: no faces intersect. -1: unknown.
     */
    int32_t contact;
} ebpo_relation_result;

/*
 * Computes the exact relation of the models. Usually one pair of crossing faces is sufficient. If
 * no faces intersect, one face of each shell (closed set of faces) is sufficient. If models only
 * touch, every face that intersects the other model is tested.
 *
 * Memory: for a model entirely in memory, the collider takes 4 bytes per face, and about 60 bytes
 * more per face during the call. For a partly loaded model, it takes half a byte per face, and
 * about 60 bytes per face of a subtree.
 *
 * A subtree of a partly loaded model is loaded if some of its faces intersect the other model. A
 * subtree is also loaded if it may show that its model is only partly inside the other model. This
 * is the case if a face of its model is known to be inside and the subtree may have a face outside.
 * It is also the case if a face is known to be outside and the subtree may have a face inside.
 *
 * Errors are those of ebpo_collide_first. If the deadline passes, the call succeeds with the
 * relation EBPO_RELATION_UNDECIDED. EBPO_E_ABSENT: as for ebpo_inside.
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_relation(ebpo_collider *collider,
                                                         const ebpo_collide_options *options,
                                                         ebpo_relation_result *out,
                                                         ebpo_error *error);

/* ---- all pairs of faces ---- */

/*
 * Callback that gets pairs, which are valid until the callback returns. The callback returns false
 * to stop the call. It is never called by two threads at the same time.
 */
typedef bool (*ebpo_pairs_fn)(void *user, const ebpo_face_pair *pairs, uint64_t count);

/*
 * Finds every pair of intersecting faces once. Pairs are sorted by the index of the face in the
 * file of the first model, then by the index in the file of the other model. The first model is the
 * model with the lower content_sha256. If both models have the same content_sha256, the first model
 * is the model with the lower pose; the bits of the poses are compared.
 *
 * Partly loaded models give the same pairs in the same order. Subtrees whose envelopes may
 * intersect are loaded. Each subtree is loaded about once if all pairs fit in `memory` of the
 * options, and about a hundred subtrees fit in the budgets.
 *
 * EBPO_E_CANCELLED: also if the deadline has passed. In this case `take` has received the first
 * pairs of the complete list. Other errors are those of ebpo_collide_first.
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_all(ebpo_collider *collider,
                                                    const ebpo_collide_options *options,
                                                    ebpo_pairs_fn take, void *user,
                                                    ebpo_error *error);

/*
 * Finds the self-intersections of one model without a pose: pairs of faces that have common points
 * besides a common corner or edge. face_a is before face_b in the file. If two faces have equal
 * corners, their common points at these corners, or on the edge between two equal corners, do not
 * count. Pairs of kind EBPO_PAIR_COPLANAR always count, for example a fold or a repeated face. Both
 * models of the collider must be the same model.
 *
 * EBPO_E_ARGUMENT: two different models. Other errors are those of ebpo_collide_all.
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_self(ebpo_collider *collider,
                                                     const ebpo_collide_options *options,
                                                     ebpo_pairs_fn take, void *user,
                                                     ebpo_error *error);

/* ---- intersection lines ---- */

/*
 * Intersection of two crossing faces: a segment from point[0] to point[1], in the direction of the
 * cross product of A's normal and B's normal. The error of a coordinate is at most 0.51 units in
 * the last place, plus 2^-60 times the greatest coordinate of the edge on which the point is.
 * face_a, face_b: as in ebpo_face_pair.
 */
typedef struct ebpo_contact_segment {
    double point[2][3];
    uint64_t face_a, face_b;

    /*
     * Location of both ends on the faces. Value k from 0 to 2: corner k. Value k from 3 to 5: edge
     * from corner k - 3 to the next corner. Value 6: interior of the face.
     */
    uint8_t on_a[2], on_b[2];

    uint8_t reserved[4];
} ebpo_contact_segment;

/*
 * Callback that gets segments, which are valid until it returns. The callback returns false to stop
 * the call.
 */
typedef bool (*ebpo_segments_fn)(void *user, const ebpo_contact_segment *segments, uint64_t count);

/*
 * Computes the segments of the pairs of kind EBPO_PAIR_CROSSING, in the order of ebpo_collide_all.
 * If A and B are swapped, the segments are the same, with exchanged ends. For a model entirely in
 * memory, the collider takes 4 bytes per face. The faces of a partly loaded model are read once
 * more, by chunks.
 *
 * Errors are those of ebpo_collide_all.
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_contacts(ebpo_collider *collider,
                                                         const ebpo_collide_options *options,
                                                         ebpo_segments_fn take, void *user,
                                                         ebpo_error *error);

/* A line along which two models cross; arrays are valid until the callback returns. */
typedef struct ebpo_polyline {
    uint64_t count;        /* number of points, at least 2 */
    const double *points;  /* [count][3]; if `closed`, the last point equals the first point */
    const uint64_t *faces; /* [count - 1][2] faces of A and B on which each segment is */
    const double *normals; /* [count - 1][2][3] unit normals of `faces`, approximated in doubles */
    bool closed;           /* true: the line ends where it begins */
    uint8_t reserved[7];
} ebpo_polyline;

/* Callback that gets a line. The callback returns false to stop the call. */
typedef bool (*ebpo_polylines_fn)(void *user, const ebpo_polyline *line);

/*
 * Joins the segments of ebpo_collide_contacts to lines. Each segment is in one line. The end of one
 * segment is joined to the beginning of another segment under two conditions. In both models, the
 * two ends are on the same corner, edge or face, and no third segment begins or ends at this point.
 * Corners of a model with equal coordinates count as the same corner. Ends that meet by chance at
 * equal coordinates are not joined. Lines are sorted by their first segments, in the order of
 * ebpo_collide_contacts; a closed line begins with its first segment in this order. If A and B are
 * swapped, lines have the reverse direction.
 *
 * EBPO_E_LIMIT: `memory` of the collider's options is less than 256 bytes per segment. Other errors
 * are those of ebpo_collide_all.
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_polylines(ebpo_collider *collider,
                                                          const ebpo_collide_options *options,
                                                          ebpo_polylines_fn take, void *user,
                                                          ebpo_error *error);

/* ---- as a file ---- */

/* Format of a file of pairs (ebpo_collide_write). */
typedef enum ebpo_pairs_format {
    /*
     * All pairs and segments in the order of ebpo_collide_all, as an HDF5 file that HDF5 1.8 and
     * later can read:
     *   /pairs/faces       int64 [n][2]  face_a and face_b of ebpo_face_pair
     *   /pairs/file_faces  int64 [n][2]  indices in the files
     *   /pairs/kind        uint8 [n]     ebpo_pair_kind
     *   /contacts/points   double [m][6] both ends of the segment of each crossing pair
     *   /contacts/faces    int64 [m][2]  as in /pairs/faces
     *   /contacts/on       uint8 [m][4]  on_a and on_b of the first end, then of the second
     */
    EBPO_PAIRS_HDF5 = 0,

    /*
     * PLY: both meshes at their poses, A first, in the order of the files. Faces that intersect the
     * other model are red (255, 0, 0); other faces are grey. The mesh of a model entirely in memory
     * is read once more, and this memory is in no budget.
     */
    EBPO_PAIRS_PLY = 1
} ebpo_pairs_format;

/*
 * Writes all pairs to a file, which is replaced atomically.
 *
 * EBPO_E_IO: the file cannot be written. EBPO_E_LIMIT: also if a PLY file would have too many
 * vertices. Other errors are those of ebpo_collide_all.
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_write(ebpo_collider *collider,
                                                      const ebpo_collide_options *options,
                                                      ebpo_pairs_format format, const char *path,
                                                      ebpo_error *error);

/* ---- distance and depth ---- */

/* Accuracy of a value. */
typedef enum ebpo_value_kind {
    EBPO_VALUE_EXACT = 0,    /* lo = hi: the double nearest to the true value */
    EBPO_VALUE_INTERVAL = 1, /* lo and hi are guaranteed bounds, but not the closest doubles */
    EBPO_VALUE_BOUND = 2     /* as EBPO_VALUE_INTERVAL, and lo is 0 or hi is INFINITY */
} ebpo_value_kind;

/* A value with guaranteed bounds. */
typedef struct ebpo_value_bounds {
    double lo, hi;

    /* ebpo_value_kind */
    int32_t kind;

    int32_t reserved;
} ebpo_value_bounds;

/* Options of ebpo_collide_distance, in addition to ebpo_collide_options. */
typedef struct ebpo_collide_distance_options {
    size_t struct_size;

    /* Greatest allowed hi - lo of the result, in the world's unit. 0: exact result. */
    double tolerance;

    /*
     * Below 0: the query computes the distance. 0 or more: the query does not compute the distance,
     * but decides whether the distance is at least this value, in the world's unit.
     */
    double at_least;

    /*
     * True: starts with the pair that the previous distance query of this collider found, which is
     * faster if poses change little. Exact distances and decisions do not depend on this option.
     * The bounds of intervals, and the reported pair of intersecting faces, may depend on it.
     */
    bool warm;

    uint8_t reserved[7];
} ebpo_collide_distance_options;

#define EBPO_COLLIDE_DISTANCE_OPTIONS_INIT                         \
    {                                                              \
        sizeof(ebpo_collide_distance_options), 0, -1, false, { 0 } \
    }

/* Result of ebpo_collide_distance. */
typedef struct ebpo_collide_distance_result {
    /*
     * Distance between the faces of A and B, in the world's unit; 0 if any faces intersect. It is
     * never negative, even if one model is inside the other.
     */
    ebpo_value_bounds distance;

    /*
     * Exact decision. 1: the distance is at least `at_least` of the options. 0: the distance is
     * less. -1: not requested, or undecided at the deadline.
     */
    int32_t at_least;

    int32_t reserved;

    /*
     * Pair of faces at this distance. With a tolerance, the distance of this pair is at most
     * distance.hi. If several pairs qualify, this is the first in the order of ebpo_collide_all. If
     * faces intersect: a pair of intersecting faces. Indices are EBPO_NO_FACE if no pair was found.
     */
    ebpo_face_pair pair;

    /*
     * Nearest points of the two faces, approximated in doubles; a common point if the faces
     * intersect.
     */
    double point_a[3], point_b[3];
} ebpo_collide_distance_result;

/*
 * Computes the minimum distance between the faces of A and B; INFINITY if a model has no faces. If
 * one solid is inside the other solid, the result is the distance between their surfaces. With
 * `at_least` of the options, the search ends when the comparison with this value is decided. If
 * out->at_least is 1, `distance` is at_least .. INFINITY, without a pair. If out->at_least is 0,
 * the returned pair is nearer than at_least. After the deadline, `distance` has the bounds known so
 * far.
 *
 * For partly loaded models, pairs of subtrees are loaded in the order of the distances of their
 * envelopes. A pair is not loaded if this distance exceeds the best distance found so far. Exact
 * distances and their pairs do not depend on the subtrees in memory. Bounds of intervals, and the
 * reported pair of intersecting faces, do depend on them.
 *
 * EBPO_E_ARGUMENT: also if the tolerance is below 0 or infinite, or at_least is NAN. Other errors
 * are those of ebpo_collide_first.
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status
ebpo_collide_distance(ebpo_collider *collider, const ebpo_collide_options *options,
                      const ebpo_collide_distance_options *distance_options,
                      ebpo_collide_distance_result *out, ebpo_error *error);

/*
 * Computes the depth of A's surface in the solid B: the maximum, over all points of A's faces that
 * are in B, of the distance to the nearest face of B. The depth is 0 if no point of A's faces is in
 * B. Also computes the depth of B's surface in A. The result is an interval, because the deepest
 * point need not be a corner. If the deadline does not end the search, hi - lo is at most
 * `tolerance` plus the rounding of posed points. This rounding is 2^-40 of the coordinates, and
 * more for matrices that are not exact rotations. The depth is not the minimum motion that
 * separates the models.
 *
 * tolerance        greater than 0, in the world's unit; a smaller tolerance takes longer
 * a_in_b, b_in_a   depth of A in B, and of B in A; NULL: not requested
 *
 * EBPO_E_NOT_SOLID: a_in_b is requested and B is a surface, or b_in_a is requested and A is a
 * surface. EBPO_E_ARGUMENT: also if the tolerance is not valid. Other errors are those of
 * ebpo_collide_first. After an error, neither result is valid. The search uses memory that is in no
 * budget.
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_depth(ebpo_collider *collider,
                                                      const ebpo_collide_options *options,
                                                      double tolerance, ebpo_value_bounds *a_in_b,
                                                      ebpo_value_bounds *b_in_a, ebpo_error *error);

/* ---- separation distance along a direction ---- */

/* Result of ebpo_collide_separation. */
typedef struct ebpo_separation {
    /*
     * The separation distance, as a multiple of the direction's length. Its kind is
     * EBPO_VALUE_EXACT; after the deadline, the kind is EBPO_VALUE_INTERVAL or EBPO_VALUE_BOUND.
     */
    ebpo_value_bounds t;

    /*
     * The pair of faces that touches at t, the last contact; of several such pairs, the first in
     * the order of ebpo_collide_all. Indices are EBPO_NO_FACE if no pair was found.
     */
    ebpo_face_pair pair;
} ebpo_separation;

/*
 * Computes the separation distance of A from B along a direction. This is the least t >= 0 with
 * this property: if A is moved by t' * direction for any t' > t, A and B have no common point. The
 * points of a solid include its interior. If A is moved by t * direction, the models touch in the
 * returned pair. If there is no pair (t is 0), the models do not intersect, at their poses and
 * during the motion. Posed coordinates are moved without rounding. If the models separate and touch
 * again during the motion, t belongs to the last contact.
 *
 * For partly loaded models, a subtree is loaded if its envelope, moved by the greatest t found so
 * far, may still touch an envelope of the other model.
 *
 * direction   vector of any length, which is the unit of t; its 1-norm must be 2^-500 .. 2^500
 *
 * EBPO_E_ARGUMENT: also if the direction is not valid. Other errors are those of
 * ebpo_collide_first; after the deadline the call succeeds.
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_separation(ebpo_collider *collider,
                                                           const ebpo_collide_options *options,
                                                           const double direction[3],
                                                           ebpo_separation *out, ebpo_error *error);

/* ---- by levels ---- */

/* Result of ebpo_collide_levels. */
typedef struct ebpo_level_result {
    /*
     * 1: the models (solids, or faces of surfaces) certainly have a common point. 0: they certainly
     * have no common point. -1: undecided.
     */
    int32_t common;

    /* 0: certainly no faces intersect. -1: undecided. */
    int32_t contact;

    /* Distance between the faces, as in ebpo_collide_distance; INFINITY if a model has no faces. */
    ebpo_value_bounds distance;

    /* Number of pairs of nodes that may have intersecting faces. */
    uint64_t undecided_pairs;

    /*
     * Deepest level of A that was used, and of B. For a partly loaded model, this is at most the
     * cut level.
     */
    int32_t level_a, level_b;
} ebpo_level_result;

/*
 * Computes guaranteed results from levels alone, without faces. Envelopes give a lower bound of the
 * distance, and nodes with faces give an upper bound. Solids intersect if a cell that is inside one
 * solid contains a point of the other solid. Reads no data, so it also works for models with only a
 * few levels in memory (a cut level). The search stops with the results known so far at the
 * deadline, or when the pairs of nodes need more memory than the collider's options allow.
 *
 * EBPO_E_ARGUMENT: a pose is not valid (ebpo_pose_check).
 *
 * Threads: one at a time per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_levels(ebpo_collider *collider,
                                                       const ebpo_collide_options *options,
                                                       ebpo_level_result *out, ebpo_error *error);

/* ---- one mesh ---- */

/* Two faces of one mesh with common points besides a common corner or edge. */
typedef struct ebpo_self_intersection {
    /*
     * Source indices of the two faces, the lower index first. Faces that were added to fill holes
     * have greater indices than the faces of the source.
     */
    uint64_t face[2];

    /*
     * A common point, approximated in doubles. For crossing faces it is the middle of the segment
     * in which they intersect.
     */
    double point[3];

    /* ebpo_pair_kind other than EBPO_PAIR_APART */
    int32_t kind;

    int32_t reserved;
} ebpo_self_intersection;

/*
 * Callback that gets intersections, which are valid until it returns. The callback returns false to
 * stop the call.
 */
typedef bool (*ebpo_self_intersections_fn)(void *user, const ebpo_self_intersection *crossings,
                                           uint64_t count);

/* Options of ebpo_mesh_self_intersections. */
typedef struct ebpo_self_intersections_options {
    size_t struct_size;

    unsigned threads;

    ebpo_progress progress;

    /*
     * PLY file to write, which is replaced atomically; NULL: no file. It contains the mesh in the
     * source's order. Intersecting faces are red (255, 0, 0); other faces are grey.
     */
    const char *ply;
} ebpo_self_intersections_options;

#define EBPO_SELF_INTERSECTIONS_OPTIONS_INIT                             \
    {                                                                    \
        sizeof(ebpo_self_intersections_options), 0, { NULL, NULL }, NULL \
    }

/* Summary of the intersections that were found. */
typedef struct ebpo_self_intersections_summary {
    size_t struct_size;

    /* Number of pairs, indexed by ebpo_pair_kind. */
    uint64_t pairs[4];

    /* Number of faces in at least one pair. */
    uint64_t faces;
} ebpo_self_intersections_summary;

#define EBPO_SELF_INTERSECTIONS_SUMMARY_INIT EBPO_SIZED(ebpo_self_intersections_summary)

/*
 * Finds the self-intersections of a mesh as ebpo_collide_self does for a model, without an .ebpo.h5
 * file. Each pair is reported once, in an order that depends only on the mesh. Coordinates are
 * compared exactly, so an unwelded mesh gives the same result as the welded mesh. The mesh's
 * workspace (if NULL, a workspace with default options) limits the memory, and contains a temporary
 * file of about 20 bytes per face. The mesh is empty afterwards, also on failure.
 *
 * report   result of ebpo_mesh_check or ebpo_mesh_prepare
 * take     NULL: only the summary is computed
 * out      summary; may be NULL
 *
 * EBPO_E_LIMIT: a coordinate is beyond 2^1000 (ebpo_mesh_arrange), or there is too little memory.
 * EBPO_E_IO: no space in the workspace, or `ply` cannot be written. EBPO_E_FORMAT: as for
 * ebpo_build.
 *
 * Threads: one at a time per mesh.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_self_intersections(
    ebpo_mesh *mesh, const ebpo_mesh_report *report, const ebpo_self_intersections_options *options,
    ebpo_self_intersections_fn take, void *user, ebpo_self_intersections_summary *out,
    ebpo_error *error);

/* Statistics of a collider: sums since the collider was made. */
typedef struct ebpo_collider_stats {
    size_t struct_size;

    /*
     * node_pairs: number of tested pairs of nodes. block_pairs: number of tested pairs of blocks
     * (of up to eight faces). exact: number of pairs of faces that needed the exact test.
     */
    uint64_t node_pairs, block_pairs, exact;

    /*
     * Counts for partly loaded models. subtree_pairs: number of visited pairs of subtrees. The
     * envelopes of such a pair are near each other; if both subtrees were loaded before, also the
     * bounds of their faces. subtrees: number of subtrees in these pairs. loads: number of times
     * that a subtree was loaded. bytes_read: number of bytes read from the files during the
     * queries, including reads by other users of the files.
     */
    uint64_t subtree_pairs, subtrees, loads, bytes_read;
} ebpo_collider_stats;

#define EBPO_COLLIDER_STATS_INIT EBPO_SIZED(ebpo_collider_stats)

/*
 * Gets the statistics of a collider.
 *
 * Threads: one at a time per collider.
 */
EBPO_API ebpo_status ebpo_collider_get_stats(const ebpo_collider *collider,
                                             ebpo_collider_stats *out);

#ifdef __cplusplus
}
#endif
#endif
