/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: two models that meet.
 *
 *   Two models       ebpo_collider_new, one for each thread that asks
 *   Do they meet     ebpo_collide_first
 *   How they lie     ebpo_collide_relation
 *   All of it        ebpo_collide_all, ebpo_collide_self
 *   Where they meet  ebpo_collide_contacts, ebpo_collide_polylines
 *   As a file        ebpo_collide_write
 *   How far          ebpo_collide_distance
 *   How deep         ebpo_collide_depth
 *   The way out      ebpo_collide_way_out
 *   By levels        ebpo_collide_levels
 *   One mesh         ebpo_mesh_crossings
 *
 * Poses are those of pose.h: decisions are exact on posed coordinates. Swapping the models, threads
 * and processors change nothing; nor do budgets, but for the one pair of faces that meet which
 * ebpo_collide_first and ebpo_collide_distance tell, and for distances within a tolerance. Models
 * may be in parts (ebpo/query.h: a budget, a cut level) for every question. What the kinds of pairs
 * mean: docs/develop/collision.md.
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

typedef struct ebpo_collider_options {
    size_t struct_size; /* EBPO_COLLIDER_OPTIONS_INIT sets it */

    /* For all pairs. 0: all cores. The other questions use the calling thread. */
    unsigned threads;

    /*
     * Bytes for pairs that wait to be given in order, beside the models' budgets. 0: 64 MiB. With
     * less than all pairs need, the models are gone through several times.
     */
    uint64_t memory;
} ebpo_collider_options;

#define EBPO_COLLIDER_OPTIONS_INIT          \
    {                                       \
        sizeof(ebpo_collider_options), 0, 0 \
    }

/* Two models (or one, twice) for questions of one thread: stacks and what waits. */
typedef struct ebpo_collider ebpo_collider;

/*
 * options: NULL for the usual ones. Both models must outlive it.
 *
 * EBPO_E_ABSENT: a file has no mesh, or is a subset. EBPO_E_ARGUMENT, EBPO_E_MEMORY.
 *
 * Threads: any; many colliders may share models.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collider_new(ebpo_model *a, ebpo_model *b,
                                                     const ebpo_collider_options *options,
                                                     ebpo_collider **out, ebpo_error *error);

/*
 * NULL is fine.
 *
 * Threads: one per collider.
 */
EBPO_API void ebpo_collider_free(ebpo_collider *collider);

/*
 * Whether the model may be asked about at this pose.
 *
 * EBPO_E_ARGUMENT: the matrix is not a rotation; the message says by how much its columns are
 * longer than 1 or not at right angles (2^-20 is allowed), or that it is a mirror; a number is not
 * finite; the scale or the posed model is out of range.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_pose_check(const ebpo_model *model, const ebpo_pose *pose,
                                                   ebpo_error *error);

/* Of every question. NULL: both models as in their files, no deadline. */
typedef struct ebpo_collide_options {
    size_t struct_size; /* EBPO_COLLIDE_OPTIONS_INIT sets it */

    /* As ebpo_pose_check allows. */
    ebpo_pose pose_a, pose_b;

    /* Stop after about so many nanoseconds. 0: no deadline. */
    uint64_t deadline_ns;

    ebpo_progress progress;

    /* Of ebpo_collide_levels: look at levels 0 to `level` only. -1: at all that are in memory. */
    int32_t level;

    int32_t reserved;
} ebpo_collide_options;

#define EBPO_COLLIDE_OPTIONS_INIT                                                              \
    {                                                                                          \
        sizeof(ebpo_collide_options), EBPO_POSE_INIT, EBPO_POSE_INIT, 0, { NULL, NULL }, -1, 0 \
    }

/* ---- do they meet ---- */

/* Numbers of faces as in ebpo_distance_result, and those in the files. */
typedef struct ebpo_face_pair {
    uint64_t face_a, face_b, file_face_a, file_face_b;

    /* An ebpo_pair_kind; EBPO_PAIR_APART where none was found, or of a nearest pair. */
    int32_t kind;

    int32_t reserved;
} ebpo_face_pair;

/*
 * A pair of faces that meet: the same one for the same files and poses, however many threads and on
 * every processor, but not the least in any numbering. Of models in parts (a budget, a cut level)
 * it depends on the parts, too, as few of them are loaded; the first pair of ebpo_collide_all
 * depends on nothing but files and poses. *found: 1 yes, 0 none, -1 the deadline left it open. A
 * solid within another is no contact.
 *
 * EBPO_E_ARGUMENT: a pose (ebpo_pose_check). EBPO_E_CANCELLED: by `progress`. EBPO_E_LIMIT,
 * EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: one per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_first(ebpo_collider *collider,
                                                      const ebpo_collide_options *options,
                                                      ebpo_face_pair *out, int32_t *found,
                                                      ebpo_error *error);

/* ---- how they lie to each other ---- */

/*
 * Of a solid the closure of the points that its rule puts inside is meant, of a surface its faces;
 * both as sets of points, at their poses. Faces without area count for nothing here. The first one
 * that is true:
 */
typedef enum ebpo_relation {
    EBPO_DISJOINT = 0,     /* no common point */
    EBPO_TOUCHING = 1,     /* a common point, but none that is inner to both */
    EBPO_INTERSECTING = 2, /* inner points in common, and none of these: */
    EBPO_A_INSIDE_B = 3,   /* B is a solid and has all points of A, which is not equal to it */
    EBPO_B_INSIDE_A = 4,   /* the reverse */
    EBPO_EQUAL = 5,        /* the same points, some */
    EBPO_RELATION_OPEN = 6 /* the deadline left it open */
} ebpo_relation;

typedef struct ebpo_relation_result {
    /* An ebpo_relation. */
    int32_t relation;

    /* Some faces meet, as for ebpo_collide_first: 1 yes, 0 no, -1 not known. A solid within another
     * may touch it from within. */
    int32_t contact;
} ebpo_relation_result;

/*
 * How the models lie to each other, exact. A pair of faces that cross nearly always decides, and
 * of shells that meet nothing a face of each; of models that only touch, every face in contact is
 * looked at. Each model that is all in memory takes 4 bytes a face more in the collider, and some
 * 60 for the call; one in parts half a byte a face, and some 60 for each of a subtree's. Of that,
 * subtrees with faces in contact are loaded, and of faces without contact those that may lie on a
 * side of the other model where none has been seen.
 *
 * Errors are those of ebpo_collide_first; after the deadline it succeeds. EBPO_E_ABSENT: as for
 * ebpo_inside.
 *
 * Threads: one per collider; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_relation(ebpo_collider *collider,
                                                         const ebpo_collide_options *options,
                                                         ebpo_relation_result *out,
                                                         ebpo_error *error);

/* ---- all of it ---- */

/* Pairs, lent until it returns. False: enough. Calls come one after the other. */
typedef bool (*ebpo_pairs_fn)(void *user, const ebpo_face_pair *pairs, uint64_t count);

/*
 * Every pair of faces that meet, once, by their positions in the files: those of the model that
 * comes first (the one with the lesser content_sha256, then with the lesser pose bit by bit), then
 * those of the other. Models in parts give the same; subtrees whose envelopes may meet are loaded,
 * each about once if `memory` holds all pairs and the budgets some hundred subtrees. When `take`
 * returns false nothing more is given, and the call succeeds.
 *
 * After the deadline EBPO_E_CANCELLED; what was given is the beginning of all. Other errors are
 * those of ebpo_collide_first.
 *
 * Threads: one per collider; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_all(ebpo_collider *collider,
                                                    const ebpo_collide_options *options,
                                                    ebpo_pairs_fn take, void *user,
                                                    ebpo_error *error);

/*
 * The same of one model, as it is in its file: the pairs of its faces that meet otherwise than as
 * neighbours do, face_a before face_b in the file. What two faces with equal corners have in common
 * at such a corner, or along the edge between two of them, is no meeting; EBPO_PAIR_COPLANAR is one
 * (a fold, or a face that is there twice). The collider is of one model, twice.
 *
 * EBPO_E_ARGUMENT: of two. Other errors are those of ebpo_collide_all.
 *
 * Threads: one per collider; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_self(ebpo_collider *collider,
                                                     const ebpo_collide_options *options,
                                                     ebpo_pairs_fn take, void *user,
                                                     ebpo_error *error);

/* ---- where they meet ---- */

/*
 * Where two crossing faces meet: from point[0] to point[1] in the direction of A's normal x B's
 * normal. Coordinates are within 0.51 units in the last place, and 2^-60 of the greatest one of the
 * edge that ends there, of the exact ones. Numbers of faces as in ebpo_distance_result.
 */
typedef struct ebpo_contact_segment {
    double point[2][3];
    uint64_t face_a, face_b;

    /* Of the ends: 0 to 2 that corner, 3 to 5 the edge from corner k - 3 to the next, 6 inside. */
    uint8_t on_a[2], on_b[2];

    uint8_t reserved[4];
} ebpo_contact_segment;

/* Segments, lent until it returns. False: enough. */
typedef bool (*ebpo_segments_fn)(void *user, const ebpo_contact_segment *segments, uint64_t count);

/*
 * Of the pairs of ebpo_collide_all that are EBPO_PAIR_CROSSING, in that order. When the models are
 * swapped the segments are the same, with their ends exchanged. Each model that is all in memory
 * takes 4 bytes a face more in the collider; of one in parts faces are read once more, by chunks.
 *
 * Errors as for ebpo_collide_all.
 *
 * Threads: one per collider; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_contacts(ebpo_collider *collider,
                                                         const ebpo_collide_options *options,
                                                         ebpo_segments_fn take, void *user,
                                                         ebpo_error *error);

/* A line along which two models cross; arrays are lent until the function that gets it returns. */
typedef struct ebpo_polyline {
    uint64_t count;        /* of points, 2 or more */
    const double *points;  /* [count][3]; of a closed one the last is the first */
    const uint64_t *faces; /* [count - 1][2]: of A and of B, from each point to the next */
    const double *normals; /* [count - 1][2][3]: their unit normals, as far as doubles tell */
    bool closed;
    uint8_t reserved[7];
} ebpo_polyline;

/* False: enough. */
typedef bool (*ebpo_polylines_fn)(void *user, const ebpo_polyline *line);

/*
 * The segments of ebpo_collide_contacts, each in one line, joined where exactly one ends and one
 * begins at the same corners, edges or faces of both models (corners with equal coordinates in the
 * model are the same; points that happen to be equal are not joined). Lines come by their first
 * segment in the order of ebpo_collide_contacts, closed ones begin with it. Of swapped models the
 * lines run the other way.
 *
 * EBPO_E_LIMIT: `memory` does not hold 256 bytes for each segment. Other errors are
 * those of ebpo_collide_all.
 *
 * Threads: one per collider; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_polylines(ebpo_collider *collider,
                                                          const ebpo_collide_options *options,
                                                          ebpo_polylines_fn take, void *user,
                                                          ebpo_error *error);

/* ---- as a file ---- */

typedef enum ebpo_pairs_format {
    /*
     * All pairs and segments in the order of ebpo_collide_all, for any HDF5 from 1.8 on:
     *   /pairs/faces       int64 [n][2]  of A and of B, as in ebpo_distance_result
     *   /pairs/file_faces  int64 [n][2]  in the files
     *   /pairs/kind        uint8 [n]     an ebpo_pair_kind
     *   /contacts/points   double [m][6] of crossing pairs: both ends of the segment
     *   /contacts/faces    int64 [m][2]  as /pairs/faces
     *   /contacts/on       uint8 [m][4]  on_a and on_b of the first end, then of the second
     */
    EBPO_PAIRS_HDF5 = 0,

    /* Both meshes at their poses, first A's, in the order of the files; faces have a colour: red
     * (255, 0, 0) where they meet one of the other model, else a grey. The mesh of a model that
     * is all in memory is read once more, beside all budgets. */
    EBPO_PAIRS_PLY = 1
} ebpo_pairs_format;

/*
 * Writes a file, which appears whole or not at all.
 *
 * EBPO_E_IO: it cannot be written. EBPO_E_LIMIT: also too many vertices for a PLY file. Other
 * errors are those of ebpo_collide_all.
 *
 * Threads: one per collider; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_write(ebpo_collider *collider,
                                                      const ebpo_collide_options *options,
                                                      ebpo_pairs_format format, const char *path,
                                                      ebpo_error *error);

/* ---- how far, how deep ---- */

/* How a figure is meant. */
typedef enum ebpo_figure {
    EBPO_FIGURE_EXACT = 0,    /* lo = hi: the double nearest to the true value */
    EBPO_FIGURE_INTERVAL = 1, /* the true value is certainly in lo .. hi, both approached */
    EBPO_FIGURE_BOUND = 2     /* certainly in lo .. hi; one of them says little: 0 or INFINITY */
} ebpo_figure;

typedef struct ebpo_certain {
    double lo, hi;

    /* An ebpo_figure. */
    int32_t figure;

    int32_t reserved;
} ebpo_certain;

typedef struct ebpo_clearance_options {
    size_t struct_size; /* EBPO_CLEARANCE_OPTIONS_INIT sets it */

    /* The answer's hi - lo may be so much, in the world's unit; 0: exact. */
    double tolerance;

    /* Only whether the distance is at least so much matters. Less than 0: not asked. */
    double at_least;

    /*
     * Begin with the pair that this collider found last: faster where poses change little. Exact
     * distances and decisions are the same; of intervals lo and hi, and of pairs that meet which
     * one is told, may differ.
     */
    bool warm;

    uint8_t reserved[7];
} ebpo_clearance_options;

#define EBPO_CLEARANCE_OPTIONS_INIT                         \
    {                                                       \
        sizeof(ebpo_clearance_options), 0, -1, false, { 0 } \
    }

typedef struct ebpo_clearance {
    /* Of the faces, in the world's unit: 0 if any meet, not negative inside a solid. */
    ebpo_certain distance;

    /* 1 or 0, decided without rounding; -1: not asked, or open. */
    int32_t at_least;

    int32_t reserved;

    /*
     * Faces at `distance`, with a tolerance at hi or less, of equal distances those that are first
     * in the order of ebpo_collide_all; if faces meet, two that do; EBPO_NO_FACE: none was found.
     */
    ebpo_face_pair pair;

    /* Their nearest points, as far as doubles tell; a common one where they meet. */
    double point_a[3], point_b[3];
} ebpo_clearance;

/*
 * The least distance of points of A's faces and of B's; INFINITY if a model has no faces. A solid
 * within another is as far away as their surfaces are. When `at_least` is asked the search ends as
 * soon as that is decided: 1: the distance is in at_least .. INFINITY, and no pair is told; 0: the
 * pair that was told is nearer. After the deadline `distance` is what is certain by then.
 *
 * Of models in parts subtrees are loaded whose envelopes are not farther apart than what has been
 * found, the nearest first. Exact distances and their pairs are the same; of intervals lo and hi,
 * and of faces that meet which two are told, depend on the parts.
 *
 * options, clearance   NULL for the usual ones
 *
 * EBPO_E_ARGUMENT: also a tolerance below 0 or infinite, at_least is no number. Others as for
 * ebpo_collide_first.
 *
 * Threads: one per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_distance(ebpo_collider *collider,
                                                         const ebpo_collide_options *options,
                                                         const ebpo_clearance_options *clearance,
                                                         ebpo_clearance *out, ebpo_error *error);

/*
 * The depth of A's surface in B: the greatest distance to B's nearest face over points of A's faces
 * that are in B, a solid; and the reverse. 0: none is. An interval, as no corner need be the
 * deepest point: hi - lo is at most `tolerance`, and what rounding moves points by (2^-40 of the
 * coordinates, more with matrices that are no exact rotations), unless the deadline ends it. This
 * is not the least motion that parts the two: that is not computed.
 *
 * tolerance        greater than 0, in the world's unit; work grows with what it is asked to tell
 * a_in_b, b_in_a   NULL: not asked
 *
 * EBPO_E_NOT_SOLID: what the depth in it is asked of is a surface. EBPO_E_ARGUMENT: also the
 * tolerance. What may be deepest waits beside the budgets. Others as for ebpo_collide_first.
 *
 * Threads: one per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_depth(ebpo_collider *collider,
                                                      const ebpo_collide_options *options,
                                                      double tolerance, ebpo_certain *a_in_b,
                                                      ebpo_certain *b_in_a, ebpo_error *error);

/* ---- the way out ---- */

typedef struct ebpo_way_out {
    /* Exact: the double nearest to it; after the deadline an interval or a bound. */
    ebpo_certain t;

    /* The faces that part last, of several at the same time the first in the order of
     * ebpo_collide_all; EBPO_NO_FACE: none was found. */
    ebpo_face_pair pair;
} ebpo_way_out;

/*
 * How far A has to be moved along a direction to be clear of B: the least t >= 0 so that A, moved
 * by any t' * direction with t' > t, has no point in common with B; of solids, no inner point
 * either. Moved by t itself they touch in the pair that is told; if there is none (t is 0) they
 * meet neither where they are nor on the way. Posed coordinates are moved without rounding. t is
 * not the first moment at which they part: what comes later is in the way, too.
 *
 * Of models in parts subtrees are loaded whose envelopes part later than what has been found.
 *
 * direction   of any length, which is the unit of t; its 1-norm within 2^-500 .. 2^500
 *
 * EBPO_E_ARGUMENT: also the direction. Others as for ebpo_collide_first; after the deadline it
 * succeeds.
 *
 * Threads: one per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_way_out(ebpo_collider *collider,
                                                        const ebpo_collide_options *options,
                                                        const double direction[3],
                                                        ebpo_way_out *out, ebpo_error *error);

/* ---- by levels ---- */

typedef struct ebpo_level_result {
    /* A point that both models have, of solids or of faces: 1 certainly, 0 certainly none, -1 open.
     */
    int32_t common;

    /* Faces that meet: 0 certainly none, -1 open. */
    int32_t contact;

    /* Of the faces, as of ebpo_collide_distance; INFINITY if a model has none. */
    ebpo_certain distance;

    /* Pairs of nodes that may have faces that meet. */
    uint64_t open_pairs;

    /* The levels of A and of B that were looked at: of models in parts not below the cut. */
    int32_t level_a, level_b;
} ebpo_level_result;

/*
 * What is certain by levels alone, without faces: envelopes that are apart bound the distance from
 * below, nodes that have faces from above, and solids meet where a cell within one has a point of
 * the other. Reads nothing: models that keep a few levels in memory (a cut level) do. After the
 * deadline, or when pairs of nodes take more than the collider's memory: what is certain by then.
 *
 * EBPO_E_ARGUMENT: a pose (ebpo_pose_check). EBPO_E_CANCELLED, EBPO_E_MEMORY.
 *
 * Threads: one per collider.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_collide_levels(ebpo_collider *collider,
                                                       const ebpo_collide_options *options,
                                                       ebpo_level_result *out, ebpo_error *error);

/* ---- one mesh ---- */

/* Two faces of one mesh that meet otherwise than as neighbours. */
typedef struct ebpo_crossing {
    /* Numbers in the source, the lesser one first. Faces that filling holes has added have numbers
     * behind those of the source. */
    uint64_t face[2];

    /* A point that both have, as far as doubles tell; of crossing ones the middle of the segment.
     */
    double point[3];

    /* An ebpo_pair_kind, not EBPO_PAIR_APART. */
    int32_t kind;

    int32_t reserved;
} ebpo_crossing;

/* Crossings, lent until it returns. False: enough. */
typedef bool (*ebpo_crossings_fn)(void *user, const ebpo_crossing *crossings, uint64_t count);

typedef struct ebpo_crossings_options {
    size_t struct_size; /* EBPO_CROSSINGS_OPTIONS_INIT sets it */

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;

    /* A PLY file to write, which appears whole or not at all: the mesh in the source's order, faces
     * of crossings red (255, 0, 0), the others grey. NULL: none. */
    const char *ply;
} ebpo_crossings_options;

#define EBPO_CROSSINGS_OPTIONS_INIT                             \
    {                                                           \
        sizeof(ebpo_crossings_options), 0, { NULL, NULL }, NULL \
    }

/* What was given to the callback, summed up. */
typedef struct ebpo_crossings_summary {
    size_t struct_size; /* EBPO_CROSSINGS_SUMMARY_INIT sets it */

    /* Pairs, by their ebpo_pair_kind. */
    uint64_t pairs[4];

    /* That are in one pair or more. */
    uint64_t faces;
} ebpo_crossings_summary;

#define EBPO_CROSSINGS_SUMMARY_INIT EBPO_SIZED(ebpo_crossings_summary)

/*
 * All pairs of faces of a mesh that cross, touch or lie on each other otherwise than as neighbours
 * do, as of ebpo_collide_self, without a file of the caller's: each once, in an order that depends
 * on the mesh only. Coordinates are compared exactly, so unwelded meshes give the same. Needs no
 * more memory than the mesh's workspace allows (none: as much as ebpo_workspace_new takes), and
 * room there for a temporary file of some 20 bytes a face. The mesh is empty afterwards, also on
 * failure.
 *
 * report   what ebpo_mesh_check or ebpo_mesh_prepare has found
 * take     NULL: only the summary is wanted; when it returns false nothing more is looked for, and
 *          the call succeeds
 * out      NULL: not wanted
 *
 * EBPO_E_LIMIT: coordinates too large for an exact grid, as for ebpo_build, or too little memory.
 * EBPO_E_IO: the workspace is full, `ply` cannot be written. EBPO_E_FORMAT: as ebpo_build.
 * EBPO_E_CANCELLED, EBPO_E_MEMORY.
 *
 * Threads: one per mesh; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_mesh_crossings(
    ebpo_mesh *mesh, const ebpo_mesh_report *report, const ebpo_crossings_options *options,
    ebpo_crossings_fn take, void *user, ebpo_crossings_summary *out, ebpo_error *error);

/* Sums since the collider was made. */
typedef struct ebpo_collider_stats {
    size_t struct_size; /* EBPO_COLLIDER_STATS_INIT sets it */

    /* Pairs looked at, of nodes and of blocks of faces; of faces, those left to the exact test. */
    uint64_t node_pairs, block_pairs, exact;

    /*
     * Of models in parts: pairs of subtrees whose envelopes come near each other, how many subtrees
     * these are, how often one had to be loaded, and bytes read of the files meanwhile, also by
     * others.
     */
    uint64_t subtree_pairs, subtrees, loads, bytes_read;
} ebpo_collider_stats;

#define EBPO_COLLIDER_STATS_INIT EBPO_SIZED(ebpo_collider_stats)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: one per collider.
 */
EBPO_API ebpo_status ebpo_collider_get_stats(const ebpo_collider *collider,
                                             ebpo_collider_stats *out);

#ifdef __cplusplus
}
#endif
#endif
