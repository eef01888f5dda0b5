/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: questions to a file, with as much of it in memory as one
 * allows.
 *
 *   Models           ebpo_model_new, and ebpo_context_new for each thread; ebpo_model_memory
 *   One budget       ebpo_budget_new
 *   Point in solid   ebpo_inside, ebpo_inside_many
 *   Distance         ebpo_distance, ebpo_distance_many, ebpo_distance_within
 *   Rays             ebpo_ray_first, ebpo_ray_any, ebpo_ray_all, and each of these for many
 *   Attributes       ebpo_sampler_new, ebpo_sample: of points on faces
 *   Boxes            ebpo_faces_in_box, ebpo_triangles_in_box
 *   Mass             ebpo_measure, ebpo_solid_volume_of
 *
 *     ebpo_file *file = NULL;
 *     ebpo_model *model = NULL;
 *     ebpo_context *context = NULL;
 *     ebpo_open("model.ebpo.h5", &file, &error);
 *     ebpo_model_new(file, NULL, &model, &error);
 *     ebpo_context_new(model, &context, &error);
 *     ebpo_inside(context, point, NULL, &answer, &error);
 *
 * Answers are exact. The decision is that of arithmetic without rounding on the
 * file's coordinates, for every finite double that is asked about, whatever the
 * compiler, the floating-point environment, the number of threads, the memory
 * budget or the way of loading.
 *
 * Sources of the methods: BP 2008, chapter 5; EBP 2017, chapter 4;
 * format-spec/README.md, section 5.
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
 * How what is not in memory is loaded: EBP 2017, section 4.2. The answers are the
 * same.
 */
typedef enum ebpo_loading {
    /*
     * Whole subtrees, kept while the budget allows; the least recently used go
     * first (4.2.3).
     */
    EBPO_LOAD_CACHE = 0,

    /* One whole subtree at a time, nothing else is kept (4.2.5). */
    EBPO_LOAD_SUBTREE = 1,

    /* The nodes on the way and the leaf only, nothing is kept (4.2.4). */
    EBPO_LOAD_NODES = 2
} ebpo_loading;

/* Bytes of memory that models share: ebpo_budget_new. */
typedef struct ebpo_budget ebpo_budget;

typedef struct ebpo_model_options {
    size_t struct_size; /* EBPO_MODEL_OPTIONS_INIT sets it */

    /*
     * Bytes that the model may take, with its caches and what loading needs on
     * the way. 0: as much as it needs; of a file on a server (http.h) that has more
     * than 2 MiB and is not cut by `cut_level`, 256 MiB. Such a file, if it has subtrees
     * (ebpo_info.subtree_level), is read in parts however much is allowed. Beside it
     * there are the file's table of chunks (24 bytes a chunk), what decodes chunks (some
     * 250 kB for each thread that loads), and contexts: what they gather of answers and,
     * for distances, 4 bytes for each subtree below the cut level and a queue of nodes.
     */
    uint64_t memory;

    /*
     * Levels 0 to cut_level stay in memory, and subtrees below them are loaded on
     * demand. -1: by the budget, everything at once if that fits; of a file on a
     * server that has more than 2 MiB and subtrees, never everything, whatever
     * the budget (`ebpo fetch` brings whole files).
     */
    int cut_level;

    /* Matters only if not all fits, or a cut level is given. */
    ebpo_loading loading;

    /*
     * A thread in the background loads the subtrees that questions about points
     * around the last one may need, the nearest first (EBP 2017, 4.2.3).
     */
    bool prefetch;

    /* For making the model. 0: all cores. */
    unsigned threads;

    ebpo_progress progress;

    /*
     * Bytes that several models share, in place of `memory`; NULL: none. Such a model is all
     * in memory as long as those that are take up to half of the budget together, else in parts,
     * and `loading` is EBPO_LOAD_CACHE.
     */
    ebpo_budget *budget;
} ebpo_model_options;

#define EBPO_MODEL_OPTIONS_INIT                                                            \
    {                                                                                      \
        sizeof(ebpo_model_options), 0, -1, EBPO_LOAD_CACHE, false, 0, { NULL, NULL }, NULL \
    }

/* What is in memory of a file, made for speed. Threads share it. */
typedef struct ebpo_model ebpo_model;

/*
 * Reads what the budget allows: everything, or the levels up to the cut level. A
 * model of a file without mesh answers questions to a level only. The file must
 * stay open as long as the model.
 *
 * EBPO_E_LIMIT: the budget is too small; the message names one that would do. A
 * budget that is large enough here holds the average subtree many times, but
 * perhaps not the largest: the question that needs that one is EBPO_E_LIMIT too.
 * EBPO_E_ARGUMENT, EBPO_E_CANCELLED, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_model_new(const ebpo_file *file,
                                                  const ebpo_model_options *options,
                                                  ebpo_model **out, ebpo_error *error);

/*
 * What a budget buys: told by the counts in the file's head, with nothing read or loaded. Bytes are
 * bounds from above for ordinary models: of subtrees 1.05 to 1.4 times what is taken. What takes
 * more than that keeps to the budget all the same: others are dropped for it, or it is refused. All
 * but `budget`, `whole` and `least` are 0 if everything will be in memory.
 */
typedef struct ebpo_model_plan {
    size_t struct_size; /* EBPO_MODEL_PLAN_INIT sets it */

    /* Everything will be in memory. */
    bool resident;

    int cut_level;

    /* As ebpo_model_new will understand it. 0: none. */
    uint64_t budget;

    /*
     * From which budget on everything is in memory (files far away: see ebpo_model_options.memory;
     * a model that takes more stays in parts), and one that would do, little more than the least.
     * With the least, few subtrees are there at a time.
     */
    uint64_t whole, least;

    /*
     * Of the budget: levels down to the cut level; decoded chunks; what stays of subtrees that
     * are not in memory. The rest is for subtrees.
     */
    uint64_t top, chunks, skeletons;

    /*
     * Below the cut level; bytes of the average one; so many of these are in memory at a time,
     * while nothing is being loaded.
     */
    uint64_t subtrees, subtree_bytes, subtrees_held;
} ebpo_model_plan;

#define EBPO_MODEL_PLAN_INIT EBPO_SIZED(ebpo_model_plan)

/*
 * What ebpo_model_new with these options (NULL: the usual ones) will make of the file. Where a cut
 * level and a budget are given, that may still find the levels to take more than the budget.
 *
 * EBPO_E_LIMIT: the budget is too small; the message names one that would do.
 * EBPO_E_ARGUMENT.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_model_memory(const ebpo_file *file,
                                                     const ebpo_model_options *options,
                                                     ebpo_model_plan *out, ebpo_error *error);

/*
 * After its contexts.
 *
 * Threads: one per model.
 */
EBPO_API void ebpo_model_free(ebpo_model *model);

/* Sums since the model was made, over all contexts. */
typedef struct ebpo_model_stats {
    size_t struct_size; /* EBPO_MODEL_STATS_INIT sets it */

    /* Everything is in memory. */
    bool resident;

    /* 0 if resident. */
    int cut_level;

    /* Bytes, now and at most: tree, caches, what loading needs on the way. */
    uint64_t memory, memory_peak;

    /* Bytes. 0: none. */
    uint64_t budget;

    /* Subtrees found in memory, and loaded because a question needed them. */
    uint64_t hits, loads;

    /* Subtrees loaded in the background. */
    uint64_t prefetched;

    /* Subtrees dropped to make room. */
    uint64_t evicted;

    /* Bytes read from the source, and how many times; opening the file included. */
    uint64_t bytes_read, reads;

    /* That ebpo_model_new took. */
    double open_seconds;

    /* That questions spent waiting for subtrees. */
    double load_seconds;

    /*
     * Leaves in memory, and of those that many questions have come to, how many of each kind:
     * general, one plane, two planes, convex set, concave set.
     */
    uint64_t leaves, leaves_of_kind[5];

    /* Of the general ones, those with a wall that no face meets: one segment answers there. */
    uint64_t leaves_one_wall;

    /*
     * Points whose distance was asked for while not everything was in memory, the subtrees that
     * were searched for them, and the loads that this took, with those for the sign: the quotients
     * tell what a question costs.
     */
    uint64_t distances, distance_subtrees, distance_loads;

    /* Bytes of `memory`: what is kept of subtrees that are not, so that they are not loaded again
     * for nothing. */
    uint64_t skeleton_bytes;
} ebpo_model_stats;

#define EBPO_MODEL_STATS_INIT EBPO_SIZED(ebpo_model_stats)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_model_get_stats(const ebpo_model *model, ebpo_model_stats *out);

/* ---- one budget for several models ---- */

/*
 * What ebpo_model_options.budget takes: all that its models take is of these bytes, as for
 * ebpo_model_options.memory. Subtrees and chunks that were used least recently go first, whichever
 * model's they are; levels above the cuts, and models that are all in memory, stay. Each model
 * holds its own, also of one file: for two places of one file use one model.
 *
 * bytes    greater than 0
 *
 * EBPO_E_LIMIT: too few for any model. EBPO_E_ARGUMENT: 0. EBPO_E_MEMORY.
 *
 * Threads: any; its models may be asked by different threads.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_budget_new(uint64_t bytes, ebpo_budget **out,
                                                   ebpo_error *error);

/*
 * After its models; NULL is fine.
 *
 * Threads: one per budget.
 */
EBPO_API void ebpo_budget_free(ebpo_budget *budget);

typedef struct ebpo_budget_stats {
    size_t struct_size; /* EBPO_BUDGET_STATS_INIT sets it */

    /* Bytes: what was given, what is taken of it now, and the most that ever was. */
    uint64_t budget, memory, memory_peak;
} ebpo_budget_stats;

#define EBPO_BUDGET_STATS_INIT EBPO_SIZED(ebpo_budget_stats)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_budget_get_stats(const ebpo_budget *budget, ebpo_budget_stats *out);

/* ---- contexts ---- */

/* One thread's work with a model: position, scratch, what it holds in memory. */
typedef struct ebpo_context ebpo_context;

/*
 * EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_context_new(ebpo_model *model, ebpo_context **out,
                                                    ebpo_error *error);

/*
 * Threads: one per context.
 */
EBPO_API void ebpo_context_free(ebpo_context *context);

/* ---- what all questions have in common ---- */

/*
 * Points are three finite doubles in the model's unit. Others are
 * EBPO_E_ARGUMENT, with the point's number. Answers to many points are the same
 * as to one point after the other.
 *
 * On failure, the answers are unspecified.
 */

/* A level for exact answers. */
enum { EBPO_LEVEL_ALL = -1 };

/* ---- point in solid ---- */

/* Whether envelopes are used to decide early. The answers are the same. */
typedef enum ebpo_envelopes {
    EBPO_ENVELOPES_AUTO = 0, /* where they save loading */
    EBPO_ENVELOPES_USE = 1,  /* at every gray node on the way (EBP 2017, 4.2.1) */
    EBPO_ENVELOPES_SKIP = 2
} ebpo_envelopes;

typedef struct ebpo_inside_options {
    size_t struct_size; /* EBPO_INSIDE_OPTIONS_INIT sets it */

    /*
     * Look at levels 0 to `level` only, and say what is certain by these.
     * EBPO_LEVEL_ALL: exact answers.
     */
    int level;

    ebpo_envelopes envelopes;

    /*
     * Stop after about so many nanoseconds for each point, and say what is
     * certain by then. 0: no deadline. A subtree or a leaf that is under way is
     * finished.
     */
    uint64_t deadline_ns;
} ebpo_inside_options;

#define EBPO_INSIDE_OPTIONS_INIT                                            \
    {                                                                       \
        sizeof(ebpo_inside_options), EBPO_LEVEL_ALL, EBPO_ENVELOPES_AUTO, 0 \
    }

typedef enum ebpo_where {
    EBPO_OUT = 0,
    EBPO_IN = 1,
    EBPO_ON = 2,   /* on a face, an edge or a vertex */
    EBPO_MAYBE = 3 /* the level or the deadline did not suffice */
} ebpo_where;

typedef struct ebpo_inside_result {
    /* An ebpo_where. */
    int32_t where;

    /*
     * The winding number. 0 if EBPO_ON or EBPO_MAYBE, and if an envelope decided
     * because a level or deadline is given: with rules other than nonzero the
     * true one may then be another that is not inside.
     */
    int32_t winding;

    /*
     * EBPO_MAYBE: the surface is at most so far away, which is the diagonal of the
     * cell that was reached. Else 0.
     */
    double doubt;
} ebpo_inside_result;

/*
 * Whether a point is in the solid. BP 2008, section 5.1; EBP 2017, 4.2.
 *
 * EBPO_E_NOT_SOLID: the model is a surface. EBPO_E_ABSENT: the file has no mesh,
 * and no level is given; or a subset does not hold what decides. EBPO_E_ARGUMENT,
 * EBPO_E_LIMIT, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_inside(ebpo_context *context, const double point[3],
                                               const ebpo_inside_options *options,
                                               ebpo_inside_result *out, ebpo_error *error);

/*
 * The same for points[count][3], into out[count].
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_inside_many(ebpo_context *context, const double *points,
                                                    uint64_t count,
                                                    const ebpo_inside_options *options,
                                                    ebpo_inside_result *out, ebpo_error *error);

/* ---- distance ---- */

typedef enum ebpo_distance_mode {
    EBPO_DISTANCE_EXACT = 0,

    /*
     * The faces below the deepest gray node around the point; not always the
     * minimum (EBP 2017, 4.4).
     */
    EBPO_DISTANCE_RECURSIVE = 1,

    /* The faces of the leaf around the point; no answer elsewhere. */
    EBPO_DISTANCE_LEAVES = 2,

    /*
     * The envelope of the deepest gray node around the point, at most at `level`.
     * Unsigned, not always the minimum; max_distance does not matter.
     */
    EBPO_DISTANCE_ENVELOPE = 3
} ebpo_distance_mode;

typedef struct ebpo_distance_options {
    size_t struct_size; /* EBPO_DISTANCE_OPTIONS_INIT sets it */

    /* As in ebpo_inside_options. */
    int level;

    ebpo_distance_mode mode;

    /* As in ebpo_inside_options. */
    uint64_t deadline_ns;

    /*
     * What is farther away, in the model's unit, does not matter; at least 0.
     * INFINITY: everything does.
     */
    double max_distance;

    /* Leave the sign away: less work. Surfaces have none anyway. */
    bool unsigned_distance;

    /*
     * Begin with the last answer of this context: faster for points that are
     * close to each other. The answers are the same.
     */
    bool warm;

    uint8_t reserved[6];
} ebpo_distance_options;

#define EBPO_DISTANCE_OPTIONS_INIT                                                              \
    {                                                                                           \
        sizeof(ebpo_distance_options), EBPO_LEVEL_ALL, EBPO_DISTANCE_EXACT, 0, __builtin_inf(), \
            false, true,                                                                        \
        {                                                                                       \
            0                                                                                   \
        }                                                                                       \
    }

/* The number of no face. */
#define EBPO_NO_FACE UINT64_MAX

typedef struct ebpo_distance_result {
    /*
     * Correctly rounded. Of solids negative inside, unless unsigned (-0.0 if it
     * underflows). INFINITY: nothing within max_distance, and no face; or, with a face,
     * farther than every double. NAN: not determined, see
     * `lo` and `hi`.
     */
    double distance;

    /* The true distance, unsigned, is certainly within. Exact answers: both it. */
    double lo, hi;

    /* The nearest point, rounded. NAN: none. */
    double point[3];

    /*
     * The unit normal of the face, outward by its orientation. (0, 0, 0) for a
     * face without area.
     */
    double normal[3];

    /*
     * The number of the triangle in the source if the file has maps, else in the
     * file. Of several at exactly the same distance, the first one in the file.
     * EBPO_NO_FACE: none (limited answers, envelopes).
     */
    uint64_t face;
} ebpo_distance_result;

/*
 * How far a point is from the model, and from which of its faces. EBP 2017, 4.4.
 * With a level or a deadline the answer is `lo` and `hi`, and the distance if
 * they meet.
 *
 * EBPO_E_ABSENT: the file has no mesh, and neither a level is given nor the mode
 * EBPO_DISTANCE_ENVELOPE; or a subset does not hold what decides. EBPO_E_ARGUMENT,
 * EBPO_E_LIMIT, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_distance(ebpo_context *context, const double point[3],
                                                 const ebpo_distance_options *options,
                                                 ebpo_distance_result *out, ebpo_error *error);

/*
 * The same for points[count][3], into out[count].
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_distance_many(ebpo_context *context, const double *points,
                                                      uint64_t count,
                                                      const ebpo_distance_options *options,
                                                      ebpo_distance_result *out, ebpo_error *error);

typedef struct ebpo_within_options {
    size_t struct_size; /* EBPO_WITHIN_OPTIONS_INIT sets it */

    /*
     * Faces at most so far away, in the model's unit, decided without rounding; at least 0.
     * INFINITY: all.
     */
    double radius;

    /* The nearest so many of these; 0: all. */
    uint64_t most;

    /* Without, normals are NAN: less work. */
    bool normals;

    uint8_t reserved[7];
} ebpo_within_options;

#define EBPO_WITHIN_OPTIONS_INIT                                     \
    {                                                                \
        sizeof(ebpo_within_options), __builtin_inf(), 0, true, { 0 } \
    }

/* A face and its distance, lent until the function returns that is called with it. */
typedef struct ebpo_near_face {
    /* Correctly rounded, unsigned. */
    double distance;

    /* As in ebpo_distance_result. */
    double point[3], normal[3];

    /* As in ebpo_distance_result; and in the file. */
    uint64_t face, file_face;

    uint64_t reserved[3];
} ebpo_near_face;

/* False: enough. */
typedef bool (*ebpo_near_fn)(void *user, const ebpo_near_face *face);

/*
 * The nearest faces of a point, or all faces within a radius, each once, given to `take` in
 * ascending order of their exact distances; of several at the same distance the first one in the
 * file comes first, so the first of all is that of ebpo_distance.
 *
 * options   NULL for the usual ones: all faces of the model
 * take      must not use the context; when it returns false, nothing more is given, and the call
 *           succeeds
 *
 * What is under way takes at most 16 MiB, beside the model's budget, however many faces are given:
 * after every 65,536 (without `most` also after some of the first ones) the search begins anew
 * behind the last one. Subtrees are loaded the nearest first, and only those that may have a face
 * of the answer; each once, if the budget holds them until the search is behind them.
 *
 * EBPO_E_ABSENT: as for ebpo_distance; in a subset perhaps after some faces, which are right.
 * EBPO_E_ARGUMENT: before the first face. EBPO_E_LIMIT, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_distance_within(ebpo_context *context,
                                                        const double point[3],
                                                        const ebpo_within_options *options,
                                                        ebpo_near_fn take, void *user,
                                                        ebpo_error *error);

/* ---- rays ---- */

typedef struct ebpo_ray_hit {
    /*
     * The hit is at origin + t direction. Correctly rounded: INFINITY if it is greater
     * than every double, as along directions that are far too short. That is a hit: it has
     * a face. A direction that is longer by a power of two has a finite t for the same face.
     * Hits are in the order of the exact values.
     */
    double t;

    /* As in ebpo_distance_result. */
    uint64_t face;

    /*
     * 1: the ray goes in through the inner part of the face. -1: it goes out. 0:
     * it meets an edge or a vertex, runs within the face's plane, or the face has
     * no area.
     */
    int32_t side;
} ebpo_ray_hit;

/*
 * The first closed triangle that a ray meets: origin + t direction, with t from 0
 * to t_max. Of several at the same t, the first one in the file. *hit is false if
 * there is none.
 *
 * direction   of any length but 0
 * t_max       at least 0; INFINITY for a ray without end
 *
 * EBPO_E_ABSENT: the file has no mesh, or a subset does not hold what decides.
 * EBPO_E_ARGUMENT, EBPO_E_LIMIT, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_first(ebpo_context *context, const double origin[3],
                                                  const double direction[3], double t_max,
                                                  ebpo_ray_hit *out, bool *hit, ebpo_error *error);

/*
 * All triangles that the ray meets, by t, then in the order of the file. `hits`
 * is the context's, until its next call.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_all(ebpo_context *context, const double origin[3],
                                                const double direction[3], double t_max,
                                                const ebpo_ray_hit **hits, uint64_t *count,
                                                ebpo_error *error);

/*
 * Whether the ray meets any triangle: what ebpo_ray_first says in *hit, with less work.
 *
 * Errors are those of ebpo_ray_first.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_any(ebpo_context *context, const double origin[3],
                                                const double direction[3], double t_max, bool *any,
                                                ebpo_error *error);

/*
 * Which triangles count. Their normals decide, wherever they are met, so that nothing slips through
 * between two of them: an edge or a vertex belongs to all its triangles. Those without area, and
 * those in whose plane the ray runs, have no sides: they count with EBPO_RAY_BOTH only.
 */
typedef enum ebpo_ray_sides {
    EBPO_RAY_BOTH = 0,  /* all */
    EBPO_RAY_FRONT = 1, /* met against their normal: from outside, if the model is a solid */
    EBPO_RAY_BACK = 2   /* met along their normal */
} ebpo_ray_sides;

typedef struct ebpo_ray_options {
    size_t struct_size; /* EBPO_RAY_OPTIONS_INIT sets it */

    ebpo_ray_sides sides;

    /*
     * 0: all cores. Few rays take fewer threads; ways of loading other than
     * EBPO_LOAD_CACHE one.
     */
    unsigned threads;
} ebpo_ray_options;

#define EBPO_RAY_OPTIONS_INIT                      \
    {                                              \
        sizeof(ebpo_ray_options), EBPO_RAY_BOTH, 0 \
    }

/* origin + t direction, as in ebpo_ray_first. */
typedef struct ebpo_ray {
    double origin[3], direction[3];
    double t_max;
} ebpo_ray;

/*
 * ebpo_ray_first for rays[count], into out[count]; where nothing is met, t is INFINITY and the face
 * is EBPO_NO_FACE. options: NULL for the usual ones. Answers depend neither on the threads nor on
 * what else is asked. If not everything is in memory, rays are followed in the order in which they
 * enter the model, along a curve, so that subtrees are loaded few times.
 *
 * EBPO_E_ARGUMENT, with the ray's number: before any is answered. Else the errors of
 * ebpo_ray_first; of several the one of the first ray in the order of work. On failure, `out` is
 * unspecified.
 *
 * Threads: one per context; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_first_many(ebpo_context *context, const ebpo_ray *rays,
                                                       uint64_t count,
                                                       const ebpo_ray_options *options,
                                                       ebpo_ray_hit *out, ebpo_error *error);

/*
 * ebpo_ray_any for rays[count], into any[count]; the rest as in ebpo_ray_first_many.
 *
 * Threads: one per context; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_any_many(ebpo_context *context, const ebpo_ray *rays,
                                                     uint64_t count,
                                                     const ebpo_ray_options *options, bool *any,
                                                     ebpo_error *error);

/*
 * ebpo_ray_all for rays[count]: the hits of ray i are hits[begin[i]] to hits[begin[i + 1] - 1];
 * `begin` has count + 1 items. Both are the context's, until its next call. The rest as in
 * ebpo_ray_first_many.
 *
 * Threads: one per context; further ones live for the call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_all_many(ebpo_context *context, const ebpo_ray *rays,
                                                     uint64_t count,
                                                     const ebpo_ray_options *options,
                                                     const ebpo_ray_hit **hits,
                                                     const uint64_t **begin, ebpo_error *error);

/* ---- attributes at hits ---- */

/* So many attributes at a time, at most. */
enum { EBPO_SAMPLER_MOST = 16 };

/* Attributes of a file (ebpo_file_attribute), ready to be told at points on faces. Threads share
 * it. */
typedef struct ebpo_sampler ebpo_sampler;

/*
 * Reads the named attributes, and what finds them: at 4 bytes a face the maps, if the file has
 * them, and for attributes of vertices the mesh (12 bytes a face, 12 or 24 a vertex), whatever the
 * model's budget. The file must stay open as long as the sampler.
 *
 * names     separated by commas: "quality", "red,green,blue", or with the element, "face:red".
 *           Without that, vertices come before faces; of equal names the first in the file is
 *           taken. Lists are not found
 * threads   for reading. 0: all cores
 *
 * EBPO_E_ABSENT: no such attribute, or the file has no mesh. EBPO_E_ARGUMENT: more than
 * EBPO_SAMPLER_MOST names. EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_sampler_new(const ebpo_file *file, const char *names,
                                                    unsigned threads, ebpo_sampler **out,
                                                    ebpo_error *error);

/*
 * NULL is fine.
 *
 * Threads: one per sampler.
 */
EBPO_API void ebpo_sampler_free(ebpo_sampler *sampler);

/*
 * How many attributes it has: so many values for each point.
 *
 * Threads: any.
 */
EBPO_API unsigned ebpo_sampler_columns(const ebpo_sampler *sampler);

/*
 * Attributes at points on faces, as distances (`point` and `face`) and rays (origin + t direction)
 * give them: of faces the face's own; of vertices A, B and C, those of the corners a, b and c,
 * weighed by where the point p is. Labels are weighed as well.
 *
 * In doubles without fused operations: e = b - a, f = c - a, d = p - a, scaled by powers of two;
 * D = (e.e)(f.f) - (e.f)(e.f); w_b = ((f.f)(d.e) - (e.f)(d.f)) / D and
 * w_c = ((e.e)(d.f) - (e.f)(d.e)) / D, 0 if less; w_a = 1 - w_b - w_c, 0 if less; each is divided
 * by their sum. Scalar products add x, y, z in this order. The value is (w_a A + w_b B) + w_c C
 * without what weighs 0, and never outside of the values that take part: at a corner it is the
 * corner's, where all three are equal it is that. If D is at most 2^-900, where the greatest
 * coordinate of e and f is 1 to 2, the face has no area: the weights are those along the longest of
 * ab, ac, bc, the first of equal ones, where d is nearest to it.
 *
 * points   [count][3] finite
 * faces    [count] as in ebpo_distance_result; EBPO_NO_FACE: the values are NAN
 * values   [count][columns] in the order of `names`
 *
 * EBPO_E_ARGUMENT: a point is not finite, or the file has no such face.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_sample(const ebpo_sampler *sampler, const double *points,
                                               const uint64_t *faces, uint64_t count,
                                               double *values, ebpo_error *error);

/* ---- boxes ---- */

/*
 * The closed triangles that meet the closed box min .. max, with min <= max on
 * each axis, in the order of the file; numbers as in ebpo_distance_result. `faces`
 * is the context's, until its next call.
 *
 * Errors are those of ebpo_ray_first.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_faces_in_box(ebpo_context *context, const double min[3],
                                                     const double max[3], const uint64_t **faces,
                                                     uint64_t *count, ebpo_error *error);

/* At most so many triangles are given at a time. */
enum { EBPO_TRIANGLES_MOST = 1024 };

/* Triangles, lent until the function returns that is called with them. */
typedef struct ebpo_triangles {
    /* 1 to EBPO_TRIANGLES_MOST */
    uint64_t count;

    /* [count] corner after corner, in the model's unit: what the file stores, exactly */
    const double (*corners)[3][3];

    /* [count] as in ebpo_distance_result; and in the file */
    const uint64_t *faces, *file_faces;

    uint64_t reserved[4];
} ebpo_triangles;

/* False: enough. */
typedef bool (*ebpo_triangles_fn)(void *user, const ebpo_triangles *triangles);

/*
 * The triangles of ebpo_faces_in_box with their corners, each once, given to `take` block by block:
 * within the model's budget however many they are. What is under way takes 4 bytes more for each
 * triangle of one subtree; if all is resident, for each of the answer.
 *
 * In the order of the file if all is resident. Else subtree by subtree as the model holds them (cut
 * level), depth first, and within each in the order of the file.
 *
 * take   must not use the context; when it returns false, nothing more is given, and the call
 *        succeeds
 *
 * Errors are those of ebpo_ray_first. EBPO_E_ABSENT and EBPO_E_ARGUMENT come before the first
 * triangle.
 *
 * Threads: one per context.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_triangles_in_box(ebpo_context *context, const double min[3],
                                                         const double max[3],
                                                         ebpo_triangles_fn take, void *user,
                                                         ebpo_error *error);

/* ---- mass ---- */

/*
 * What is known of the volume of a solid: of the points that the rule puts inside.
 * In the model's unit, cubed.
 */
typedef struct ebpo_solid_volume {
    size_t struct_size; /* EBPO_SOLID_VOLUME_INIT sets it */

    /*
     * The volume is certainly within. lo == hi: it is known but for rounding,
     * provided that no component crosses itself, which is not looked for. Else
     * components meet or repeat each other, or the mesh is no 2-manifold; without
     * `info` these are 0 and INFINITY then. 0 for a surface.
     */
    double lo, hi;

    /*
     * The integral of the winding number: the volume if winding numbers are 0 and 1
     * only. A part with winding number 2 counts twice, one with -1 is subtracted.
     */
    double integral;
} ebpo_solid_volume;

#define EBPO_SOLID_VOLUME_INIT EBPO_SIZED(ebpo_solid_volume)

/*
 * Decides whether the volume of the solid is known. Takes no time worth mentioning.
 *
 * report    of the mesh (ebpo_mesh_check); &info->report, of a file
 * rule      info->rule, of a file
 * shells    of the mesh (ebpo_mesh_count_shells); NULL: not counted, and the volume
 *           of several components is not known
 * info      of the mesh's file, whose black cells and envelopes bound the volume;
 *           NULL: there is none
 *
 * EBPO_E_ARGUMENT: `out` or `shells` was not begun with its macro, or `rule` is unknown.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_solid_volume_of(const ebpo_mesh_report *report,
                                                        ebpo_rule rule, const ebpo_shells *shells,
                                                        const ebpo_info *info,
                                                        ebpo_solid_volume *out, ebpo_error *error);

/* In the model's unit, squared, cubed and so on. */
typedef struct ebpo_mass {
    size_t struct_size; /* EBPO_MASS_INIT sets it */

    double area;

    /*
     * The volume of the solid, as ebpo_solid_volume_of has it; NAN where that is not
     * known. 0 for a surface. If it is 0, so is what follows.
     */
    double volume;

    /* Of the solid; where its volume is not known, of the winding number as a density. */
    double centroid[3];

    /* About the centroid, for density 1. */
    double inertia[3][3];

    /*
     * The same in a unit of 2^exponent of the model's, in which the model is about
     * 1 long: for models so large or so small that what is above is infinite or 0.
     */
    double scaled_area, scaled_volume, scaled_inertia[3][3];
    int64_t exponent;

    /* The volume is certainly within; both are `volume` where it is known. */
    double volume_lo, volume_hi;

    /* Of the winding number, as ebpo_solid_volume has it; and in that other unit. */
    double integral, scaled_integral;
} ebpo_mass;

#define EBPO_MASS_INIT EBPO_SIZED(ebpo_mass)

/*
 * Area, volume, centroid and inertia of the file's mesh, by compensated sums. Of a
 * mesh of several components ebpo_mesh_count_shells is a part of the work.
 * threads: 0 for all cores; the result does not depend on it.
 *
 * EBPO_E_ABSENT: the file has no mesh, or is a subset. EBPO_E_MEMORY, and the
 * errors of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_measure(const ebpo_file *file, unsigned threads,
                                                ebpo_mass *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
