/* SPDX-License-Identifier: MIT
 * Evaluates queries of a file, within a memory budget.
 *
 *   Models           ebpo_model_new, ebpo_context_new (one per thread), ebpo_model_memory
 *   Shared budget    ebpo_budget_new
 *   Point in solid   ebpo_inside, ebpo_inside_many, ebpo_winding
 *   Distance         ebpo_distance, ebpo_distance_many, ebpo_distance_within
 *   Rays             ebpo_ray_first, ebpo_ray_any, ebpo_ray_all; ebpo_ray_first_many and so on
 *   Attributes       ebpo_sampler_new, ebpo_sample (at points on faces)
 *   Boxes            ebpo_faces_in_box, ebpo_triangles_in_box
 *   Mass             ebpo_measure, ebpo_solid_volume_of
 *
 *     ebpo_file *file = NULL;
 *     ebpo_model *model = NULL;
 *     ebpo_context *context = NULL;
 *     ebpo_open("model.ebpo.h5", &file, &error);
 *     ebpo_model_new(file, NULL, &model, &error);
 *     ebpo_context_new(model, &context, &error);
 *     ebpo_inside(context, point, NULL, &result, &error);
 *
 * Results are exact: for all finite doubles, decisions are the same as if they were computed from
 * the file's coordinates without rounding. Results do not depend on the compiler, the
 * floating-point environment, the number of threads, the memory budget or the loading mode.
 *
 * A model is an octree of cells. Gray nodes have children, leaves list faces, white nodes are
 * outside the solid, and black nodes are inside. The envelope of a node is a convex polyhedron that
 * contains the part of the solid in the node's cell. Methods: the theses BP 2008, chapter 5, and
 * EBP 2017, chapter 4 (README.md); format-spec/README.md, section 10.
 */
#ifndef EBPO_QUERY_H
#define EBPO_QUERY_H

#include <ebpo/file.h>
#include <ebpo/repair.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- models and contexts ---- */

/*
 * How data that is not in memory is loaded (EBP 2017, section 4.2). Results do not depend on this
 * mode.
 */
typedef enum ebpo_loading {
    /*
     * Whole subtrees are loaded, and kept while the budget allows. The least recently used subtrees
     * are removed first (4.2.3).
     */
    EBPO_LOAD_CACHE = 0,

    /* One whole subtree is loaded at a time; no other subtree is kept (4.2.5). */
    EBPO_LOAD_SUBTREE = 1,

    /* Only the nodes on the path from the root to the leaf are loaded; no node is kept (4.2.4). */
    EBPO_LOAD_NODES = 2
} ebpo_loading;

/* Memory budget that models share (ebpo_budget_new). */
typedef struct ebpo_budget ebpo_budget;

/* Options of ebpo_model_new and ebpo_model_memory. */
typedef struct ebpo_model_options {
    size_t struct_size;

    /*
     * Maximum memory of the model in bytes, including its caches and buffers for loading. 0: no
     * limit, except for a remote file (http.h) with a `cut_level` of -1, whose limit is then 256
     * MiB. A remote file larger than 2 MiB is loaded subtree by subtree if `memory` is 0, or if it
     * has a table of subtrees (ebpo_info.subtree_level).
     *
     * Not included are the chunk directory of the file and its checksums (28 bytes per chunk),
     * decoders (about 250 kB per loading thread) and contexts. A context contains results; for
     * distances, it also contains 4 bytes (for a remote file, 12) per subtree below the cut level,
     * and a queue of nodes.
     */
    uint64_t memory;

    /*
     * Levels 0 to cut_level stay in memory. The subtrees below this level are loaded on demand. A
     * subtree is a node with all nodes and faces below this node. -1: the level is chosen so that
     * the budget is met. If everything fits, everything is loaded at once. `memory` describes
     * exceptions for remote files.
     */
    int cut_level;

    /*
     * How subtrees are loaded. This member is used if cut_level is given, or if the budget is too
     * small for everything.
     */
    ebpo_loading loading;

    /*
     * True: a background thread loads the subtrees around the last query point, nearest first (EBP
     * 2017, 4.2.3).
     */
    bool prefetch;

    /* Number of threads for making the model. 0: all cores. */
    unsigned threads;

    ebpo_progress progress;

    /*
     * Shared budget, which replaces `memory`. NULL: no shared budget. Requires EBPO_LOAD_CACHE.
     * Models that are entirely in memory take at most half of the shared budget. If the new model
     * fits in the free part of this half, it is loaded entirely. Otherwise it is loaded subtree by
     * subtree.
     */
    ebpo_budget *budget;

    /*
     * Threshold of the winding number for surfaces with EBPO_PART_BORDER, from 1/1024 to 1023/1024.
     * Such surfaces have an inside, and signed distances, by the generalized winding number w: the
     * sum of the solid angles of all faces, divided by 4 pi. The file's winding rule defines the
     * inside. Nonzero: |w| > threshold. Positive: w > threshold. Evenodd: |w - e| > threshold,
     * where e is the nearest even integer. Decisions are exact, with one exception. If both sides
     * of the comparison are equal, or arithmetic with 512 bits cannot decide the comparison, the
     * point counts as outside. ebpo_model_stats.ties counts such points.
     */
    double threshold;
} ebpo_model_options;

#define EBPO_MODEL_OPTIONS_INIT                                                                 \
    {                                                                                           \
        sizeof(ebpo_model_options), 0, -1, EBPO_LOAD_CACHE, false, 0, { NULL, NULL }, NULL, 0.5 \
    }

/* A file prepared for fast queries, completely or partly in memory. Threads may share a model. */
typedef struct ebpo_model ebpo_model;

/*
 * Makes a model: loads everything, or levels 0 to the cut level. If the file has no mesh, the model
 * supports only queries with a level (`level` in the options of queries). The file must stay open
 * as long as the model exists.
 *
 * EBPO_E_LIMIT: the budget is too small; the message names a sufficient budget. An accepted budget
 * is large enough for some subtrees of average size, but perhaps not for the largest subtree. A
 * query that needs a subtree larger than the budget allows returns EBPO_E_LIMIT. Other errors are
 * those of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_model_new(const ebpo_file *file,
                                                  const ebpo_model_options *options,
                                                  ebpo_model **out, ebpo_error *error);

/*
 * Estimated memory use for a budget. Numbers of bytes are upper bounds for ordinary models. The
 * numbers for subtrees are 1.05 to 1.4 times the actual use. The budget is met even if the actual
 * use would be higher: other data is removed, or loading fails. If everything will be in memory,
 * all members except `resident`, `budget`, `whole` and `least` are 0.
 */
typedef struct ebpo_model_plan {
    size_t struct_size;

    /* True if everything will be in memory. */
    bool resident;

    /* Deepest level that will stay in memory. */
    int cut_level;

    /* Budget that ebpo_model_new will use, in bytes. 0: no limit. */
    uint64_t budget;

    /*
     * Budgets in bytes.
     * - whole: the smallest budget with which everything is in memory (for remote files, see
     *   ebpo_model_options.memory).
     * - least: a budget slightly above the smallest budget that ebpo_model_new accepts. With this
     *   budget, some subtrees of average size are in memory at a time.
     */
    uint64_t whole, least;

    /*
     * Parts of the budget in bytes. Subtrees use the remaining part.
     * - top: for levels 0 to cut_level.
     * - chunks: for decoded chunks.
     * - skeletons: for skeletons. A skeleton is a small part of a subtree's data. It stays in
     *   memory after the subtree has been removed.
     */
    uint64_t top, chunks, skeletons;

    /*
     * - subtrees: number of subtrees below the cut level.
     * - subtree_bytes: size of the average subtree in memory, in bytes.
     * - subtrees_held: number of subtrees of average size that fit in memory. Fewer subtrees fit
     *   while a subtree is being loaded, because loading needs buffers.
     */
    uint64_t subtrees, subtree_bytes, subtrees_held;
} ebpo_model_plan;

#define EBPO_MODEL_PLAN_INIT EBPO_SIZED(ebpo_model_plan)

/*
 * Estimates memory use for a budget from the counts in the file header; reads no chunks. If a cut
 * level and a budget are given, the estimate can succeed even if ebpo_model_new fails. The reason
 * is that only ebpo_model_new tests if the levels fit into the budget.
 *
 * EBPO_E_LIMIT: the budget is too small; the message names a sufficient budget.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_model_memory(const ebpo_file *file,
                                                     const ebpo_model_options *options,
                                                     ebpo_model_plan *out, ebpo_error *error);

/*
 * Frees a model. Free its contexts first.
 *
 * Threads: one at a time per model.
 */
EBPO_API void ebpo_model_free(ebpo_model *model);

/* Statistics of a model. Counts and times are sums over all contexts since the model was made. */
typedef struct ebpo_model_stats {
    size_t struct_size;

    /* True if everything is in memory. */
    bool resident;

    /* Deepest level that stays in memory; 0 if everything is in memory. */
    int cut_level;

    /* Current and peak memory of the tree, the caches and the buffers for loading, in bytes. */
    uint64_t memory, memory_peak;

    /* Budget in bytes. 0: no limit. */
    uint64_t budget;

    /* Number of times that a query found a subtree in memory (hits) or loaded a subtree (loads). */
    uint64_t hits, loads;

    /* Number of subtrees that the background thread loaded. */
    uint64_t prefetched;

    /* Number of subtrees removed from memory. */
    uint64_t evicted;

    /*
     * Number of bytes read from the source, and number of reads, including the opening of the file.
     */
    uint64_t bytes_read, reads;

    /* Duration of ebpo_model_new, in seconds. */
    double open_seconds;

    /* Time that queries waited for subtrees, in seconds. */
    double load_seconds;

    /*
     * leaves: number of leaves in memory.
     *
     * leaves_of_kind: number of leaves of each kind. The kind of a leaf is determined only after
     * many queries in its cell. In the leaf's cell, the solid is bounded by:
     * - [0] faces in any arrangement
     * - [1] one plane
     * - [2] two planes
     * - [3] more planes; the solid is the intersection of their half-spaces (convex)
     * - [4] more planes; the solid is the union of their half-spaces (concave)
     */
    uint64_t leaves, leaves_of_kind[5];

    /*
     * Number of leaves of kind [0] with a cell face that no face of the mesh intersects. In these
     * leaves, one segment from that cell face to the point is sufficient to compute the winding
     * number.
     */
    uint64_t leaves_one_cell_face;

    /*
     * Counts for distance queries of models that are partly in memory. To get the mean cost of a
     * query, divide distance_subtrees and distance_loads by distances.
     * - distances: number of queried points.
     * - distance_subtrees: number of searched subtrees.
     * - distance_loads: number of loaded subtrees, including those for the sign.
     */
    uint64_t distances, distance_subtrees, distance_loads;

    /*
     * Bytes of `memory` that skeletons use. A skeleton is data that is kept of a subtree after the
     * subtree has left memory; it avoids unnecessary loads.
     */
    uint64_t skeleton_bytes;

    /*
     * Number of points that counted as outside because their winding number is exactly at the
     * threshold, or the comparison was not decided (ebpo_model_options.threshold).
     */
    uint64_t ties;
} ebpo_model_stats;

#define EBPO_MODEL_STATS_INIT EBPO_SIZED(ebpo_model_stats)

/*
 * Gets the statistics of a model.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_model_get_stats(const ebpo_model *model, ebpo_model_stats *out);

/* ---- one budget for several models ---- */

/*
 * Makes a budget for ebpo_model_options.budget. The budget limits the memory of all its models
 * together, as ebpo_model_options.memory limits the memory of one model. The least recently used
 * subtrees and chunks of any model are removed first. Levels down to the cut level, and models
 * entirely in memory, are not removed. Two models of the same file share no data, so use one model
 * for several instances of a file.
 *
 * bytes   greater than 0
 *
 * EBPO_E_LIMIT: the budget is too small for any model.
 *
 * Threads: any; different threads may query the models of one budget at the same time.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_budget_new(uint64_t bytes, ebpo_budget **out,
                                                   ebpo_error *error);

/*
 * Frees a budget. Free its models first.
 *
 * Threads: one at a time per budget.
 */
EBPO_API void ebpo_budget_free(ebpo_budget *budget);

/* Statistics of a budget (ebpo_budget_get_stats). */
typedef struct ebpo_budget_stats {
    size_t struct_size;

    /* Budget, current memory use and peak memory use, in bytes. */
    uint64_t budget, memory, memory_peak;
} ebpo_budget_stats;

#define EBPO_BUDGET_STATS_INIT EBPO_SIZED(ebpo_budget_stats)

/*
 * Gets the statistics of a budget.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_budget_get_stats(const ebpo_budget *budget, ebpo_budget_stats *out);

/* ---- contexts ---- */

/*
 * State of one thread that queries a model: position in the tree, scratch memory, and data that
 * stays in memory for the thread.
 */
typedef struct ebpo_context ebpo_context;

/*
 * Makes a context.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_context_new(ebpo_model *model, ebpo_context **out,
                                                    ebpo_error *error);

/*
 * Frees a context.
 *
 * Threads: one at a time per context.
 */
EBPO_API void ebpo_context_free(ebpo_context *context);

/* ---- rules for all queries ---- */

/*
 * Points are three finite doubles in the model's unit. For other values, queries return
 * EBPO_E_ARGUMENT; the message gives the index of the point. A query of many points gives the same
 * results as single queries. On failure results are unspecified. All queries can return the errors
 * of reading, and EBPO_E_LIMIT (ebpo_model_new).
 *
 * Member `done` of options: [count] flags of the items of a batch, for files whose bytes arrive
 * asynchronously (async.h); NULL: no flags. Set all flags to false before the first call. The call
 * computes the items whose flag is false, and sets the flag of each completed item to true, even if
 * the call returns EBPO_E_PENDING. Keep flags and results for the repeated call.
 */

/* Value of `level` for exact results. */
enum { EBPO_LEVEL_ALL = -1 };

/* ---- point in solid ---- */

/*
 * Gray nodes in which a query tests if the point is outside the node's envelope. A point outside
 * the envelope is outside the solid, so the query can end early. Results do not depend on this
 * choice.
 */
typedef enum ebpo_envelopes {
    EBPO_ENVELOPES_AUTO = 0, /* nodes for which the test can avoid loading */
    EBPO_ENVELOPES_USE = 1,  /* every gray node on the path (EBP 2017, 4.2.1) */
    EBPO_ENVELOPES_SKIP = 2  /* none */
} ebpo_envelopes;

/* Options of ebpo_inside and ebpo_inside_many. */
typedef struct ebpo_inside_options {
    size_t struct_size;

    /*
     * The query uses only levels 0 to `level`, and returns a certain result or EBPO_MAYBE. If
     * the model is a surface and ebpo_info.border_inside is false, the envelopes do not contain the
     * inside. Then the result in every cell of a gray node or leaf is EBPO_MAYBE. EBPO_LEVEL_ALL:
     * exact results.
     */
    int level;

    ebpo_envelopes envelopes;

    /*
     * The query stops after about this many nanoseconds per point, and returns a certain result or
     * EBPO_MAYBE. 0: no deadline. A subtree that is being loaded, and a leaf that is being tested,
     * are completed after the deadline.
     */
    uint64_t deadline_ns;

    /* Flags of completed points; see the section "rules for all queries". */
    bool *done;
} ebpo_inside_options;

#define EBPO_INSIDE_OPTIONS_INIT                                                  \
    {                                                                             \
        sizeof(ebpo_inside_options), EBPO_LEVEL_ALL, EBPO_ENVELOPES_AUTO, 0, NULL \
    }

/* Location of a point relative to a model. */
typedef enum ebpo_where {
    EBPO_OUT = 0,
    EBPO_IN = 1,
    EBPO_ON = 2,   /* on a face, an edge or a vertex */
    EBPO_MAYBE = 3 /* not decided by the level or deadline */
} ebpo_where;

/* Result of ebpo_inside. */
typedef struct ebpo_inside_result {
    /* ebpo_where */
    int32_t where;

    /*
     * Winding number; for a surface, 1 inside and 0 outside. For EBPO_ON and EBPO_MAYBE, it is 0.
     * In a query with a level or deadline, it is also 0 if the point is outside an envelope. In
     * this case the true winding number may differ from 0 if the rule is not EBPO_RULE_NONZERO.
     */
    int32_t winding;

    /*
     * For EBPO_MAYBE: length of the diagonal of the deepest visited cell, which is an upper bound
     * of the distance to the surface. In other cases 0.
     */
    double doubt;
} ebpo_inside_result;

/*
 * Classifies a point as inside, outside or on the surface (BP 2008, section 5.2.1; EBP 2017,
 * section 4.2).
 *
 * EBPO_E_NOT_SOLID: the model is a surface without EBPO_PART_BORDER. EBPO_E_ABSENT: the file has no
 * mesh and no level is given, or a subset lacks the required data.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_inside(ebpo_context *context, const double point[3],
                                               const ebpo_inside_options *options,
                                               ebpo_inside_result *out, ebpo_error *error);

/*
 * Classifies points[count][3] into out[count].
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_inside_many(ebpo_context *context, const double *points,
                                                    uint64_t count,
                                                    const ebpo_inside_options *options,
                                                    ebpo_inside_result *out, ebpo_error *error);

/* Bounds of a winding number; NAN on a face. */
typedef struct ebpo_winding_bounds {
    double lo, hi;
} ebpo_winding_bounds;

/*
 * Computes bounds of the winding numbers of points[count][3], into out[count]. For a solid, both
 * bounds are the integer winding number. For a surface with EBPO_PART_BORDER, hi - lo is at most
 * `width` if double precision suffices. The least possible hi - lo is about 1e-14 for small meshes,
 * and much greater near an edge of the border.
 *
 * width   at least 0
 *
 * EBPO_E_NOT_SOLID, EBPO_E_ABSENT: as for ebpo_inside.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_winding(ebpo_context *context, const double *points,
                                                uint64_t count, double width,
                                                ebpo_winding_bounds *out, ebpo_error *error);

/* ---- distance ---- */

/* Faces that a distance query uses. */
typedef enum ebpo_distance_mode {
    /* All faces. */
    EBPO_DISTANCE_EXACT = 0,

    /*
     * Only the faces below the deepest gray node around the point. The result is not always the
     * minimum (EBP 2017, 4.4).
     */
    EBPO_DISTANCE_RECURSIVE = 1,

    /* Only the faces of the leaf around the point. Points outside leaves have no result. */
    EBPO_DISTANCE_LEAVES = 2,

    /*
     * No faces: the distance from the envelope of the deepest gray node around the point, in levels
     * 0 to `level`. The result is unsigned and not always the minimum; max_distance is ignored.
     */
    EBPO_DISTANCE_ENVELOPE = 3
} ebpo_distance_mode;

/* Options of ebpo_distance and ebpo_distance_many. */
typedef struct ebpo_distance_options {
    size_t struct_size;

    /* As in ebpo_inside_options. */
    int level;

    ebpo_distance_mode mode;

    /* As in ebpo_inside_options. */
    uint64_t deadline_ns;

    /* Faces farther away than this are ignored. In the model's unit, at least 0, or INFINITY. */
    double max_distance;

    /*
     * True: the sign is not computed, which is faster. Surfaces have a sign only with
     * EBPO_PART_BORDER.
     */
    bool unsigned_distance;

    /*
     * True: the search starts from the previous result of this context, which is faster for nearby
     * points. Results do not depend on this option.
     */
    bool warm;

    uint8_t reserved[6];

    /* As in ebpo_inside_options. */
    bool *done;
} ebpo_distance_options;

#define EBPO_DISTANCE_OPTIONS_INIT                                                              \
    {                                                                                           \
        sizeof(ebpo_distance_options), EBPO_LEVEL_ALL, EBPO_DISTANCE_EXACT, 0, __builtin_inf(), \
            false, true, { 0 }, NULL                                                            \
    }

/* Value of a face index if there is no face. */
#define EBPO_NO_FACE UINT64_MAX

/* Result of ebpo_distance. Lengths are in the model's unit. */
typedef struct ebpo_distance_result {
    /*
     * Distance, correctly rounded. If unsigned_distance is false, it is negative inside a solid
     * (-0.0 if it underflows). INFINITY, and `face` is EBPO_NO_FACE: no face is within
     * max_distance. INFINITY, and `face` is an index: the distance is larger than every double.
     * NAN: the distance is not determined, but `lo` and `hi` bound it.
     */
    double distance;

    /* Bounds of the exact unsigned distance; equal for exact results. */
    double lo, hi;

    /*
     * Point of the model that is nearest to the queried point, rounded. NAN: no such point was
     * determined.
     */
    double point[3];

    /*
     * Unit normal of the nearest face, outward by its orientation; (0, 0, 0) if the face has no
     * area.
     */
    double normal[3];

    /*
     * Nearest face: its source index if the file has source indices, else its index in the file. Of
     * several faces at exactly the same distance, the first face in the file. EBPO_NO_FACE: no face
     * was determined, for example with a level, a deadline or EBPO_DISTANCE_ENVELOPE.
     */
    uint64_t face;
} ebpo_distance_result;

/*
 * Computes the distance from a point to the model, and the nearest face (EBP 2017, 4.4). With a
 * level or a deadline, the results are `lo` and `hi`, and `distance` is NAN, except if `lo` and
 * `hi` are equal.
 *
 * EBPO_E_ABSENT: a subset lacks the required data, or the file has no mesh although the query needs
 * one. A query needs no mesh if a level is given or the mode is EBPO_DISTANCE_ENVELOPE.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_distance(ebpo_context *context, const double point[3],
                                                 const ebpo_distance_options *options,
                                                 ebpo_distance_result *out, ebpo_error *error);

/*
 * Computes the distances of points[count][3] into out[count].
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_distance_many(ebpo_context *context, const double *points,
                                                      uint64_t count,
                                                      const ebpo_distance_options *options,
                                                      ebpo_distance_result *out, ebpo_error *error);

/* Options of ebpo_distance_within. */
typedef struct ebpo_within_options {
    size_t struct_size;

    /*
     * Only faces with at most this distance from the point are passed to the callback. Distances
     * are compared exactly. In the model's unit; at least 0. INFINITY: all faces.
     */
    double radius;

    /* Maximum number of faces that are passed to the callback, nearest first. 0: all faces. */
    uint64_t most;

    /* True: normals are computed. False: normals are NAN, which is faster. */
    bool normals;

    uint8_t reserved[7];
} ebpo_within_options;

#define EBPO_WITHIN_OPTIONS_INIT                                     \
    {                                                                \
        sizeof(ebpo_within_options), __builtin_inf(), 0, true, { 0 } \
    }

/* A face and its distance; valid until the callback returns. */
typedef struct ebpo_near_face {
    /* Unsigned distance of the face, correctly rounded. */
    double distance;

    /* As in ebpo_distance_result. */
    double point[3], normal[3];

    /* face: index as in ebpo_distance_result. file_face: index in the file. */
    uint64_t face, file_face;

    uint64_t reserved[3];
} ebpo_near_face;

/* Callback that gets a face. The callback returns false to stop the call. */
typedef bool (*ebpo_near_fn)(void *user, const ebpo_near_face *face);

/*
 * Passes the faces nearest to a point, or all faces within a radius, to `take`. Each face is passed
 * once, in ascending order of exact distance. Faces at the same distance are in the order of the
 * file, so the first face is the face that ebpo_distance returns.
 *
 * options   NULL: all faces of the model
 * take      must not use the context
 *
 * Uses at most 16 MiB besides the model's budget, for any number of faces. For this reason, the
 * call works in steps. Each step finds the next faces, at most 65,536, and passes them to `take`.
 * If `most` is 0, the first three steps find at most 256, 2,048 and 16,384 faces. Subtrees are
 * loaded in order of distance, and only if they may contain a result. A subtree is loaded once if
 * the budget is large enough to keep it.
 *
 * EBPO_E_ABSENT: as for ebpo_distance. In a subset, the call may pass some faces before it returns
 * this error; these faces are correct. EBPO_E_ARGUMENT: returned before the first face.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_distance_within(ebpo_context *context,
                                                        const double point[3],
                                                        const ebpo_within_options *options,
                                                        ebpo_near_fn take, void *user,
                                                        ebpo_error *error);

/* ---- rays ---- */

/* A face that a ray hits. */
typedef struct ebpo_ray_hit {
    /*
     * Parameter of the hit, which is at origin + t direction; correctly rounded. INFINITY although
     * `face` is an index: t is larger than every double, because the direction is very short. If
     * the direction is multiplied by a sufficiently large power of two, t is finite for the same
     * face. Hits are sorted by exact values of t.
     */
    double t;

    /* As in ebpo_distance_result. */
    uint64_t face;

    /*
     * 1: the ray enters: it passes through the interior of the face, against the face's normal. -1:
     * the ray exits: it passes through the interior of the face, along the normal. 0: the ray hits
     * an edge or a vertex, or is in the face's plane, or the face has no area.
     */
    int32_t side;
} ebpo_ray_hit;

/*
 * Finds the first triangle (including its boundary) that intersects the ray origin + t direction
 * with t from 0 to t_max. Of several triangles at the same t, the first triangle in the file is the
 * result. *hit is false if no triangle intersects the ray.
 *
 * direction   of any length except 0
 * t_max       at least 0; INFINITY: unbounded
 *
 * EBPO_E_ABSENT: the file has no mesh, or a subset lacks the required data.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_first(ebpo_context *context, const double origin[3],
                                                  const double direction[3], double t_max,
                                                  ebpo_ray_hit *out, bool *hit, ebpo_error *error);

/*
 * Finds all triangles that intersect the ray, sorted by t, then by the order of the file. `hits` is
 * valid until the next call with the context. Errors are those of ebpo_ray_first.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_all(ebpo_context *context, const double origin[3],
                                                const double direction[3], double t_max,
                                                const ebpo_ray_hit **hits, uint64_t *count,
                                                ebpo_error *error);

/*
 * Tests if the ray intersects any triangle, which is faster than ebpo_ray_first. Errors are those
 * of ebpo_ray_first.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_any(ebpo_context *context, const double origin[3],
                                                const double direction[3], double t_max, bool *any,
                                                ebpo_error *error);

/*
 * Triangles that count as hit, by the side from which the ray comes. The normal of the triangle
 * decides, even if the ray hits an edge or a vertex. An edge or a vertex belongs to all its
 * triangles, so there are no gaps between triangles. Triangles without area, and triangles whose
 * plane contains the ray, count only with EBPO_RAY_BOTH.
 */
typedef enum ebpo_ray_sides {
    EBPO_RAY_BOTH = 0,  /* all triangles */
    EBPO_RAY_FRONT = 1, /* triangles hit against their normal (for a solid: from outside) */
    EBPO_RAY_BACK = 2   /* triangles hit along their normal */
} ebpo_ray_sides;

/* Options of the queries of many rays. */
typedef struct ebpo_ray_options {
    size_t struct_size;

    ebpo_ray_sides sides;

    /*
     * Number of threads. 0: all cores. Fewer threads are used for few rays, and one thread for
     * loading modes other than EBPO_LOAD_CACHE.
     */
    unsigned threads;

    /* Flags of completed rays, as in ebpo_inside_options. NULL for ebpo_ray_all_many. */
    bool *done;
} ebpo_ray_options;

#define EBPO_RAY_OPTIONS_INIT                            \
    {                                                    \
        sizeof(ebpo_ray_options), EBPO_RAY_BOTH, 0, NULL \
    }

/* The ray origin + t direction with t from 0 to t_max, as in ebpo_ray_first. */
typedef struct ebpo_ray {
    double origin[3], direction[3];
    double t_max;
} ebpo_ray;

/*
 * Finds the first hit of each of rays[count] as ebpo_ray_first does, into out[count]. For a ray
 * without a hit, t is INFINITY and the face is EBPO_NO_FACE. Results do not depend on threads or
 * other rays. If not everything is in memory, rays are processed in another order: the points at
 * which rays enter the model are sorted along a space-filling curve. So each subtree is loaded only
 * a few times. If the model is completely in memory, neighbours in `rays` with similar origins and
 * directions, such as rays through the pixels of a row, take about 0.5 times as long as single
 * calls, and other rays of large models about 0.6 times.
 *
 * EBPO_E_ARGUMENT: a ray is not valid; the message has the first such index. Other rays may have
 * been computed. Other errors are those of ebpo_ray_first, for the first failed ray in processing
 * order. On failure `out` is unspecified.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_first_many(ebpo_context *context, const ebpo_ray *rays,
                                                       uint64_t count,
                                                       const ebpo_ray_options *options,
                                                       ebpo_ray_hit *out, ebpo_error *error);

/*
 * Tests each of rays[count] as ebpo_ray_any does, into any[count]. Order of processing and errors
 * are those of ebpo_ray_first_many.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_any_many(ebpo_context *context, const ebpo_ray *rays,
                                                     uint64_t count,
                                                     const ebpo_ray_options *options, bool *any,
                                                     ebpo_error *error);

/*
 * Finds all hits of each of rays[count] as ebpo_ray_all does. The hits of ray i are hits[begin[i]]
 * to hits[begin[i + 1] - 1]; `begin` has count + 1 items. `hits` and `begin` are valid until the
 * next call with the context. Order of processing and errors are those of ebpo_ray_first_many.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_all_many(ebpo_context *context, const ebpo_ray *rays,
                                                     uint64_t count,
                                                     const ebpo_ray_options *options,
                                                     const ebpo_ray_hit **hits,
                                                     const uint64_t **begin, ebpo_error *error);

/* ---- attributes at hits ---- */

/* Maximum number of attributes of a sampler. */
enum { EBPO_SAMPLER_MAX = 16 };

/*
 * Some attributes of a file (ebpo_file_attribute), whose values can be sampled at points on faces.
 * Threads may share a sampler.
 */
typedef struct ebpo_sampler ebpo_sampler;

/*
 * Reads the named attributes, and the data to find the values of a face. The memory of a sampler is
 * not part of the budgets of models. It contains the values, and the source indices of faces if the
 * file has them (4 bytes per face). For attributes of vertices, it also contains the mesh (12 bytes
 * per face, 12 or 24 bytes per vertex). The file must stay open as long as the sampler exists.
 *
 * names   names separated by commas, such as "quality" or "red,green,blue". A name may begin with
 *         the element, as in "face:red". If a name without an element exists for vertices and for
 *         faces, the attribute of vertices is used. Of several attributes with equal names, the
 *         first one in the file is used. Attributes whose values are lists are not supported.
 *
 * EBPO_E_ABSENT: no such attribute, or the file has no mesh. EBPO_E_ARGUMENT: more than
 * EBPO_SAMPLER_MAX names. Other errors are those of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_sampler_new(const ebpo_file *file, const char *names,
                                                    unsigned threads, ebpo_sampler **out,
                                                    ebpo_error *error);

/*
 * Frees a sampler.
 *
 * Threads: one at a time per sampler.
 */
EBPO_API void ebpo_sampler_free(ebpo_sampler *sampler);

/*
 * Returns the number of attributes, which is the number of values per point.
 *
 * Threads: any.
 */
EBPO_API unsigned ebpo_sampler_columns(const ebpo_sampler *sampler);

/*
 * Samples attributes at points on faces. Points and faces are results of distance queries (`point`
 * and `face`) or ray queries (origin + t direction, and `face`). The value of an attribute of faces
 * is the face's value. The value of an attribute of vertices is a weighted mean of the values A, B
 * and C at the face's corners a, b and c. The weights depend on the position of the point p. Labels
 * are averaged like all other values.
 *
 * The weights are computed in doubles, without fused operations. The
 * three vectors e = b - a, f = c - a and d = p - a are multiplied by one power of two, so that the
 * greatest absolute coordinate of e and f is at least 1 and less than 2. Scalar products add x, y,
 * z in this order.
 *
 *     D   = (e.e)(f.f) - (e.f)(e.f)
 *     w_b = ((f.f)(d.e) - (e.f)(d.f)) / D, or 0 if negative
 *     w_c = ((e.e)(d.f) - (e.f)(d.e)) / D, or 0 if negative
 *     w_a = 1 - w_b - w_c, or 0 if negative
 *
 * Each weight is divided by the sum of the three weights. If D is at most 2^-900, the face counts
 * as a face without area, and only its longest edge is used. (If several of the edges ab, ac and bc
 * are longest, the first in this order is used.) Let q be the point of this edge that is nearest to
 * p. The weights of the edge's two corners are those of linear interpolation at q. The weight of
 * the third corner is 0.
 *
 * The value is the sum (w_a A + w_b B) + w_c C. Corners with weight 0 are omitted from the sum. The
 * sum is clamped to the range from the least to the greatest value of the remaining corners. At a
 * corner, the result is the corner's value. If the three values are equal, the result is this
 * value.
 *
 * points   [count][3] finite
 * faces    [count] as in ebpo_distance_result; EBPO_NO_FACE: the values are NAN
 * values   [count][columns] in the order of `names`
 *
 * EBPO_E_ARGUMENT: a point is not finite, or a face index is out of range.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_sample(const ebpo_sampler *sampler, const double *points,
                                               const uint64_t *faces, uint64_t count,
                                               double *values, ebpo_error *error);

/* ---- boxes ---- */

/*
 * Finds the triangles that intersect the box min .. max (min <= max on each axis), in the order of
 * the file. Triangles and box include their boundaries. Indices are as in ebpo_distance_result.
 * `faces` is valid until the next call with the context. Errors are those of ebpo_ray_first.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_faces_in_box(ebpo_context *context, const double min[3],
                                                     const double max[3], const uint64_t **faces,
                                                     uint64_t *count, ebpo_error *error);

/* Maximum number of triangles in a batch. */
enum { EBPO_TRIANGLES_MAX = 1024 };

/* A batch of triangles; valid until the callback returns. */
typedef struct ebpo_triangles {
    /* Number of triangles, 1 to EBPO_TRIANGLES_MAX. */
    uint64_t count;

    /* [count] coordinates of the three corners, in the model's unit: exactly the stored values */
    const double (*corners)[3][3];

    /* [count] faces: indices as in ebpo_distance_result. file_faces: indices in the file */
    const uint64_t *faces, *file_faces;

    uint64_t reserved[4];
} ebpo_triangles;

/* Callback that gets a batch. The callback returns false to stop the call. */
typedef bool (*ebpo_triangles_fn)(void *user, const ebpo_triangles *triangles);

/*
 * Passes the triangles that ebpo_faces_in_box finds, with their corners, to `take` in batches. Each
 * triangle is passed once. Besides the model's budget, this call needs 4 bytes for each triangle of
 * one subtree (or of the result, if everything is in memory).
 *
 * Triangles are in the order of the file if everything is in memory. Else the subtrees below the
 * cut level are in depth-first order, and the triangles of a subtree are in the order of the file.
 *
 * take   must not use the context
 *
 * Errors are those of ebpo_ray_first. EBPO_E_ABSENT and EBPO_E_ARGUMENT are returned before the
 * first triangle.
 *
 * Threads: one at a time per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_triangles_in_box(ebpo_context *context, const double min[3],
                                                         const double max[3],
                                                         ebpo_triangles_fn take, void *user,
                                                         ebpo_error *error);

/* ---- mass ---- */

/* Volume of a solid (all points that are inside by the rule), in cubic units of the model. */
typedef struct ebpo_solid_volume {
    size_t struct_size;

    /*
     * Bounds of the volume; 0 and 0 for a surface.
     *
     * lo == hi: the volume is known except for rounding, provided that no component intersects
     * itself, which is not tested.
     *
     * lo < hi: components intersect or repeat each other, or the mesh is not a 2-manifold. In this
     * case the bounds are 0 and INFINITY if the argument `info` is NULL.
     */
    double lo, hi;

    /*
     * Integral of the winding number over space. If all winding numbers are 0 or 1, the integral is
     * the volume. A region with winding number 2 counts twice; a region with winding number -1 is
     * subtracted.
     */
    double integral;
} ebpo_solid_volume;

#define EBPO_SOLID_VOLUME_INIT EBPO_SIZED(ebpo_solid_volume)

/*
 * Computes bounds of the volume of the solid, in negligible time.
 *
 * report    report on the mesh (ebpo_mesh_check); for a file: &info->report
 * rule      rule for winding numbers; for a file: info->rule
 * shells    shells of the mesh (ebpo_mesh_count_shells); NULL: not counted, so the volume of
 *           several components is unknown
 * info      metadata of the mesh's file, whose black cells and envelopes bound the volume; NULL:
 *           no file
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_solid_volume_of(const ebpo_mesh_report *report,
                                                        ebpo_rule rule, const ebpo_shells *shells,
                                                        const ebpo_info *info,
                                                        ebpo_solid_volume *out, ebpo_error *error);

/* Area, volume, centroid and inertia, in powers of the model's unit. */
typedef struct ebpo_mass {
    size_t struct_size;

    /* Sum of the areas of all faces. */
    double area;

    /*
     * Volume of the solid (ebpo_solid_volume_of). NAN: unknown. 0 for a surface without
     * EBPO_PART_BORDER. If the volume is 0, `centroid` and `inertia` are 0.
     *
     * A surface with EBPO_PART_BORDER is measured with its caps, which are triangles that close its
     * border (format-spec/border.md). The volume of this surface is known under three conditions:
     * the surface has one component, every edge has at most two faces, and the two faces of an edge
     * have the same orientation. Intersections are not tested.
     */
    double volume;

    /*
     * Centroid of the solid. If the volume is unknown: centroid of a body whose density at each
     * point is the winding number.
     */
    double centroid[3];

    /*
     * Inertia tensor about `centroid`, for density 1. If the volume is unknown: for the density
     * described at `centroid`.
     */
    double inertia[3][3];

    /*
     * Area, volume and inertia in a scaled unit, which is 2^exponent times the model's unit. The
     * model is about 1 long in the scaled unit. These members are useful for very large or very
     * small models, for which `area`, `volume` and `inertia` are infinite or 0.
     */
    double scaled_area, scaled_volume, scaled_inertia[3][3];
    int64_t exponent;

    /*
     * Bounds of the volume.
     * - Solid whose volume is known, or surface without EBPO_PART_BORDER: both bounds are `volume`.
     * - Solid whose volume is unknown: the bounds of ebpo_solid_volume.
     * - Surface with EBPO_PART_BORDER whose volume is known: `volume` minus e (but at least 0) and
     *   `volume` plus e, where e is integral_error + caps_integral.
     * - Surface with EBPO_PART_BORDER whose volume is unknown: 0 and INFINITY.
     */
    double volume_lo, volume_hi;

    /*
     * Integral of the winding number (ebpo_solid_volume), in the model's unit and in the scaled
     * unit.
     */
    double integral, scaled_integral;

    /*
     * Upper bounds of the rounding errors of `integral` and of each coordinate of `centroid`, in
     * powers of the model's unit. 0 if the file has no EBPO_PART_BORDER.
     */
    double integral_error, centroid_error;

    /*
     * A surface with EBPO_PART_BORDER is measured with the caps that format-spec/border.md defines
     * for each loop of the border. Other caps would change `integral` and `centroid` by at most
     * these members (INFINITY: no bound), if they satisfy two conditions for each loop. First, the
     * other caps are in the convex hull of the loop. Second, the other caps and the reversed caps
     * of border.md form a closed mesh. Its winding numbers are only -w, 0 and w, where w is the
     * weight of the loop (border.md). 0 if the file has no EBPO_PART_BORDER.
     */
    double caps_integral, caps_centroid;
} ebpo_mass;

#define EBPO_MASS_INIT EBPO_SIZED(ebpo_mass)

/*
 * Computes area, volume, centroid and inertia of the file's mesh by compensated sums. For several
 * components it also calls ebpo_mesh_count_shells.
 *
 * EBPO_E_ABSENT: the file has no mesh, or is a subset. Other errors are those of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_measure(const ebpo_file *file, unsigned threads,
                                                ebpo_mass *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
