/* Support for tests of queries: solids, files made of them, hard points, and checks of results. */
#ifndef EBPO_TESTS_QUERY_KIT_H
#define EBPO_TESTS_QUERY_KIT_H

#include <ebpo/build.h>
#include <ebpo/query.h>

#include "oracle.h"
#include "scratch.h"
#include "solids.h"

/* Fails a Check test if the call fails. The macro declares `ebpo_error *error`, which `call` can
 * pass on. */
#define ASSERT_OK(call)                                                     \
    do {                                                                    \
        ebpo_error error_ = EBPO_ERROR_INIT, *error = &error_;              \
        ebpo_status status_ = (call);                                       \
        ck_assert_msg(status_ == EBPO_OK, "%s: %s", #call, error_.message); \
    } while (0)

/* --- solids: query_solids.c --- */

/* All balanced solids of solids.h, and more. */
int query_solid_count(void);
const char *query_solid_name(int i);
ebpo_mesh query_solid_make(int i);
ebpo_mesh query_solid_by_name(const char *name); /* also surfaces; aborts if not found */

/* Options for building a tree. */
typedef struct query_variant {
    const char *name;
    uint32_t leaf_faces;
    int max_level;
    ebpo_rule rule;
    uint32_t parts; /* 0: the default */
} query_variant;
extern const query_variant query_variants[];
extern const int query_variant_count;

/* Makes a small solid of boxes and tetrahedra that touch, nest, overlap, face inward or repeat; on
 * a grid of small integers or anywhere. */
ebpo_mesh query_random_solid(uint64_t seed, bool on_grid);

/* Returns options of inside queries with the level and the deadline of `o`. */
static inline ebpo_inside_options query_inside_like(const ebpo_distance_options *o)
{
    ebpo_inside_options inside = EBPO_INSIDE_OPTIONS_INIT;
    inside.level = o->level;
    inside.deadline_ns = o->deadline_ns;
    return inside;
}

/* --- models: query_judge.c --- */

typedef struct query_model {
    const char *name, *variant;
    ebpo_info info;
    ebpo_mesh mesh;        /* in file order */
    uint32_t *face_source; /* [face_count] or NULL */
    double (*normal)[3];   /* [face_count] */
    double size, largest;  /* longest side of the mesh's box; largest coordinate */
    oracle *judge;         /* only for one thread at a time */
    char folder[SCRATCH_LENGTH], path[SCRATCH_LENGTH + 16];
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
} query_model;

/* Builds, writes and opens a file. The mesh is consumed. Failures are test failures. */
void query_model_make(query_model *m, const char *name, ebpo_mesh mesh,
                      const query_variant *variant);
void query_model_free(query_model *m);
/* Does the same as query_model_make, but returns the library's status instead of failing the test.
 * After a failure no files or memory remain. */
ebpo_status query_model_try(query_model *m, const char *name, ebpo_mesh mesh,
                            const query_variant *variant, ebpo_error *error);
/* Checks the mesh and builds the tree, with one thread; consumes the mesh. */
ebpo_status query_build(ebpo_tree *tree, ebpo_mesh *mesh, const query_variant *variant,
                        ebpo_error *error);

/* Correct results for a point. */
typedef struct query_truth {
    double distance; /* correctly rounded, not signed */
    int32_t winding; /* 0 on a face */
    int32_t where;   /* IN, OUT or ON; a surface: OUT or ON */
    uint64_t face;   /* source index of the nearest face; of several, the first in the file */
    uint32_t file_face, ties; /* its index in the file; number of nearest faces */
} query_truth;
void query_find_truths(query_model *m, const double *points, uint64_t count, query_truth *out);

/* Return the number of wrong results among `count` exact results, and print the first wrong ones.
 * is_unsigned: no signs were requested. */
uint64_t query_wrong_inside(const query_model *m, const double *points, const query_truth *truth,
                            uint64_t count, const ebpo_inside_result *got);
uint64_t query_wrong_distance(const query_model *m, const double *points, const query_truth *truth,
                              uint64_t count, bool is_unsigned, const ebpo_distance_result *got);
/* Do the same for results that are limited by a level or a deadline. */
uint64_t query_wrong_limited_inside(const query_model *m, const double *points,
                                    const query_truth *truth, uint64_t count,
                                    const ebpo_inside_result *got);
uint64_t query_wrong_limited_distance(const query_model *m, const double *points,
                                      const query_truth *truth, uint64_t count,
                                      const ebpo_distance_result *got);

/* Makes `count` hard points from `seed`, runs inside and distance queries of them in batches, and
 * fails the test on a wrong result. */
void query_check_points(query_model *m, uint64_t count, uint64_t seed);

/* Returns the index that queries return for a face of the file. */
uint64_t query_reported(const query_model *m, uint32_t face);

/* Compares the first hit of a ray and all its hits with the oracle. If one is wrong, prints it and
 * returns false. */
typedef struct query_ray {
    double origin[3], direction[3], t_max;
} query_ray;
bool query_one_ray(query_model *m, ebpo_context *context, const query_ray *r);

/* Returns EBPO_TEST_SCALE times `count`, at least 1; a tenth with sanitizers. */
uint64_t query_scaled(uint64_t count);

/* --- points: query_points.c --- */

/* Makes `count` points [3]: vertices, points of edges and faces, cell faces and corners of all
 * levels, points whose coordinates come from different vertices, midpoints between vertices, points
 * near the surface, random ones, outside and far away. Half of them are moved by an ulp on some
 * axes. */
void query_make_points(const query_model *m, uint64_t count, uint64_t seed, double *out);
/* Makes a hard ray: through vertices, along an edge, within a face, or between hard points. */
void query_make_ray(const query_model *m, uint64_t *state, double origin[3], double direction[3],
                    double *t_max);

/* Allocates zeroed memory for count + 1 items of `size` bytes, or aborts. */
void *query_alloc(uint64_t count, size_t size);

#endif
