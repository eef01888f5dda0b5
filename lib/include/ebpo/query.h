/* EBP-Octree in HDF5: questions to a file. Point in solid, distance, rays, boxes: exact, with as
 * much of the file in memory as one allows.
 *
 *     ebpo_file *file;   ebpo_open("model.ebpo.h5", &file, &error);
 *     ebpo_model *model; ebpo_model_new(file, NULL, &model, &error);
 *     ebpo_context *c;   ebpo_context_new(model, &c, &error);              one for each thread
 *     ebpo_inside(c, point, NULL, &answer, &error);
 *
 * "Exact" means: the decision is that of arithmetic without rounding on the file's coordinates, for
 * every finite double that is asked about, whatever the compiler, the floating-point environment,
 * the number of threads, the memory budget or the mode. Source of the methods: BP 2008, chapter 5;
 * EBP 2017, chapter 4; format-spec/README.md, section 5.
 */
#ifndef EBPO_QUERY_H
#define EBPO_QUERY_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- models and contexts ---- */

/* How what is not in memory is fetched: EBP 2017, section 4.2. The answers are the same. */
typedef enum ebpo_loading {
    /* whole subtrees, kept while the budget allows, least recently used out (4.2.3) */
    EBPO_LOAD_CACHE = 0,
    EBPO_LOAD_SUBTREE = 1, /* one whole subtree at a time, nothing else kept (4.2.5) */
    EBPO_LOAD_NODES = 2    /* the nodes on the way and the leaf only, nothing kept (4.2.4) */
} ebpo_loading;

typedef struct ebpo_model_options {
    size_t struct_size; /* EBPO_MODEL_OPTIONS_INIT sets it */
    /* bytes that the model may take, with its caches and what loading needs on the way; 0: as much
     * as it needs. Beside it: the file's table of chunks (24 bytes a chunk) and what contexts
     * gather of answers (hits, faces) */
    uint64_t memory;
    /* levels 0 .. cut_level stay in memory and subtrees below are loaded on demand; -1: by the
     * budget (all at once when that fits) */
    int cut_level;
    ebpo_loading loading; /* only matters where not all fits, or a cut level is given */
    /* a thread in the background loads the subtrees that queries about places around the last one
     * may need, the nearest first (EBP 2017, 4.2.3) */
    bool prefetch;
    unsigned threads; /* for opening; 0: all cores */
    ebpo_progress progress;
} ebpo_model_options;
#define EBPO_MODEL_OPTIONS_INIT                                                      \
    {                                                                                \
        sizeof(ebpo_model_options), 0, -1, EBPO_LOAD_CACHE, false, 0, { NULL, NULL } \
    }

/* What is in memory of a file, made for speed. Immutable for its users; shared by threads. */
typedef struct ebpo_model ebpo_model;

/* Reads what the budget allows: everything, or the levels up to the cut level. Levels whose mesh
 * part is absent serve level-limited questions only. EBPO_E_LIMIT when the budget is too small,
 * with one that would do (about the least). A budget that opens holds the average subtree many
 * times, but perhaps not the largest one: the question that needs it then is EBPO_E_LIMIT too, with
 * the budget that would do. The file must stay open as long as the model. `options` may be NULL. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_model_new(const ebpo_file *file,
                                                  const ebpo_model_options *options,
                                                  ebpo_model **out, ebpo_error *error);
/* After its contexts. NULL is fine. */
EBPO_API void ebpo_model_free(ebpo_model *model);

/* Sums since opening, over all contexts. */
typedef struct ebpo_model_stats {
    size_t struct_size; /* EBPO_MODEL_STATS_INIT sets it */
    bool resident;      /* everything is in memory */
    int cut_level;      /* 0 when resident */
    /* bytes now and at most: tree, caches, what loading needs on the way */
    uint64_t memory, memory_peak;
    uint64_t budget; /* 0: none */
    /* subtrees found in memory, loaded because a question needed them */
    uint64_t hits, loads;
    uint64_t prefetched; /* loaded in the background */
    uint64_t evicted;
    uint64_t bytes_read, reads; /* from the source, opening the file included */
    double open_seconds;        /* of ebpo_model_new */
    double load_seconds;        /* spent by questions waiting for subtrees */
    /* leaves in memory by kind: general, one plane, two planes, convex set, concave set */
    uint64_t leaves, leaves_of_kind[5];
    /* general leaves with a wall that no face meets: a single segment answers there */
    uint64_t leaves_one_wall;
} ebpo_model_stats;
#define EBPO_MODEL_STATS_INIT EBPO_SIZED(ebpo_model_stats)
EBPO_API ebpo_status ebpo_model_get_stats(const ebpo_model *model, ebpo_model_stats *out);

/* One thread's place in a model: position, scratch, what it holds in memory. */
typedef struct ebpo_context ebpo_context;
EBPO_API EBPO_MUST_USE ebpo_status ebpo_context_new(ebpo_model *model, ebpo_context **out,
                                                    ebpo_error *error);
EBPO_API void ebpo_context_free(ebpo_context *context);

/* ---- what is common to questions ---- */

enum { EBPO_LEVEL_ALL = -1 };

/* Points are three finite doubles in the model's unit; others are EBPO_E_ARGUMENT with the point's
 * number. `options` may be NULL. Batches give the same answers as single calls. On failure (reading
 * the file, memory) the results are unspecified. One context per thread. */

/* ---- point in solid ---- */

typedef enum ebpo_envelopes {
    EBPO_ENVELOPES_AUTO = 0, /* where they save loading */
    EBPO_ENVELOPES_USE = 1,  /* at every gray node on the way (EBP 2017, 4.2.1) */
    EBPO_ENVELOPES_SKIP = 2
} ebpo_envelopes;

typedef struct ebpo_inside_options {
    size_t struct_size; /* EBPO_INSIDE_OPTIONS_INIT sets it */
    /* look at levels 0 .. level only, with the certainty that these allow; EBPO_LEVEL_ALL: exact
     * answers */
    int level;
    ebpo_envelopes envelopes;
    /* stop after about so many nanoseconds for each point and tell what is certain by then; 0: no
     * deadline. It bounds the search: a subtree or a leaf that is under way is finished */
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
    EBPO_MAYBE = 3 /* level or deadline did not suffice */
} ebpo_where;

typedef struct ebpo_inside_result {
    int32_t where; /* ebpo_where */
    /* winding number; 0 when ON or MAYBE, and when level or deadline are given and an envelope
     * decided (with rules other than nonzero it may be another one that is not inside) */
    int32_t winding;
    /* MAYBE: the surface is at most so far away (the diagonal of the cell that was reached); else 0
     */
    double doubt;
} ebpo_inside_result;

/* BP 2008, section 5.1; EBP 2017, 4.2. A surface is EBPO_E_NOT_SOLID; a file without mesh
 * EBPO_E_ABSENT unless `level` is given. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_inside(ebpo_context *context, const double point[3],
                                               const ebpo_inside_options *options,
                                               ebpo_inside_result *out, ebpo_error *error);
/* `points`: [count][3]; `out`: [count]. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_inside_many(ebpo_context *context, const double *points,
                                                    uint64_t count,
                                                    const ebpo_inside_options *options,
                                                    ebpo_inside_result *out, ebpo_error *error);

/* ---- distance ---- */

typedef enum ebpo_distance_mode {
    EBPO_DISTANCE_EXACT = 0,
    /* EBP 2017, 4.4: the faces below the deepest gray node around the point; not the minimum */
    EBPO_DISTANCE_RECURSIVE = 1,
    EBPO_DISTANCE_LEAVES = 2, /* the faces of the leaf around the point; no answer elsewhere */
    /* the envelope of the deepest gray node around the point, at most at `level`, unsigned;
       max_distance does not matter; not the minimum */
    EBPO_DISTANCE_ENVELOPE = 3
} ebpo_distance_mode;

typedef struct ebpo_distance_options {
    size_t struct_size; /* EBPO_DISTANCE_OPTIONS_INIT sets it */
    /* as in ebpo_inside_options */
    int level;
    ebpo_distance_mode mode;
    uint64_t deadline_ns;
    /* what is farther, in the model's unit, does not matter; >= 0, INFINITY: everything */
    double max_distance;
    /* leave the sign away: less work; surfaces have none anyway */
    bool unsigned_distance;
    /* begin with the last answer of this context; the answers are the same, close points are
     * faster */
    bool warm;
    uint8_t reserved[6]; /* 0 */
} ebpo_distance_options;
#define EBPO_DISTANCE_OPTIONS_INIT                                                              \
    {                                                                                           \
        sizeof(ebpo_distance_options), EBPO_LEVEL_ALL, EBPO_DISTANCE_EXACT, 0, __builtin_inf(), \
            false, true,                                                                        \
        {                                                                                       \
            0                                                                                   \
        }                                                                                       \
    }

#define EBPO_NO_FACE UINT64_MAX

typedef struct ebpo_distance_result {
    /* correctly rounded. Solids, unless unsigned: negative inside (-0.0 where it underflows).
     * INFINITY: nothing within max_distance; NAN: not determined (lo, hi) */
    double distance;
    /* the true distance (unsigned) is certainly within; equal to |distance| for exact answers */
    double lo, hi;
    double point[3]; /* nearest point, rounded; NAN: none */
    /* unit normal of the face (outward by its orientation); of a face without area: (0, 0, 0) */
    double normal[3];
    /* number of the triangle in the source where the file has maps, else in the file. Of several at
     * exactly the same distance the one that comes first in the file. EBPO_NO_FACE: none (limited
     * answers, envelopes) */
    uint64_t face;
} ebpo_distance_result;

/* EBP 2017, 4.4. EBPO_E_ABSENT without mesh unless `level` is given or the mode is
 * EBPO_DISTANCE_ENVELOPE. With `level` or a deadline: lo and hi; the distance when they meet. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_distance(ebpo_context *context, const double point[3],
                                                 const ebpo_distance_options *options,
                                                 ebpo_distance_result *out, ebpo_error *error);
EBPO_API EBPO_MUST_USE ebpo_status ebpo_distance_many(ebpo_context *context, const double *points,
                                                      uint64_t count,
                                                      const ebpo_distance_options *options,
                                                      ebpo_distance_result *out, ebpo_error *error);

/* ---- rays and boxes ---- */

typedef struct ebpo_ray_hit {
    double t;      /* the ray is at origin + t direction; rounded (the order of hits is exact) */
    uint64_t face; /* as in ebpo_distance_result */
    /* 1: the ray goes in through the face's interior, -1: out; 0: it meets an edge or a vertex,
     * runs within the face's plane, or the face has no area */
    int32_t side;
} ebpo_ray_hit;

/* The first closed triangle that meets origin + t direction, 0 <= t <= t_max; several at the same
 * t: the one that comes first in the file. `direction` is not (0, 0, 0), of any length; t_max >= 0,
 * INFINITY: a ray. *hit is false when there is none. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_first(ebpo_context *context, const double origin[3],
                                                  const double direction[3], double t_max,
                                                  ebpo_ray_hit *out, bool *hit, ebpo_error *error);
/* All of them, by t, then by place in the file. `hits` is the context's, valid until its next call.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_ray_all(ebpo_context *context, const double origin[3],
                                                const double direction[3], double t_max,
                                                const ebpo_ray_hit **hits, uint64_t *count,
                                                ebpo_error *error);

/* The faces (closed triangles) that meet the closed box min .. max, min <= max on each axis,
 * ascending by place in the file. `faces` is the context's, valid until its next call. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_faces_in_box(ebpo_context *context, const double min[3],
                                                     const double max[3], const uint64_t **faces,
                                                     uint64_t *count, ebpo_error *error);

/* ---- mass ---- */

typedef struct ebpo_mass {
    size_t struct_size; /* EBPO_MASS_INIT sets it */
    double area;
    /* the integral of the winding number: the solid's volume where that is 0 and 1 only; 0 for a
     * surface. Where it is 0 so is all below */
    double volume;
    double centroid[3];
    double inertia[3][3]; /* about the centroid, of density 1 */
} ebpo_mass;
#define EBPO_MASS_INIT EBPO_SIZED(ebpo_mass)

/* From the file's mesh, with compensated sums; does not depend on threads. EBPO_E_ABSENT without
 * mesh. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_measure(const ebpo_file *file, unsigned threads,
                                                ebpo_mass *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
