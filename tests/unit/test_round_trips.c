/* Counts the sequential round trips of queries to a remote file. */
#include <hdf5.h>
#include <math.h>
#include <stdlib.h>

#include <ebpo/query.h>
#include <ebpo/subset.h>
#include <ebpo/view.h>

#include "check_main.h"
#include "counted_source.h"
#include "query/query_model.h"
#include "scratch.h"
#include "solids.h"
#include "two_layouts.h"

enum { ALL = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES };

/* --- queries --- */

typedef struct result {
    double distance;
    int32_t where;
    uint64_t waves;
} result;

/* Runs one cold query: the distance of a point, or its class. `cut_level`: as in
 * ebpo_model_options. */
static result run_query(const ebpo_file *file, const counted_source *far, const double p[3],
                        bool inside, int cut_level)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_distance_result distance = { .distance = 0 };
    ebpo_inside_result where = { .where = EBPO_OUT };
    uint64_t opened = far ? far->batches + far->alone : 0;
    options.threads = 1;
    options.cut_level = cut_level;
    options.memory = 64 << 20;
    ck_assert(ebpo_model_new(file, &options, &model, NULL) == EBPO_OK);
    ck_assert(ebpo_context_new(model, &context, NULL) == EBPO_OK);
    ck_assert((inside ? ebpo_inside(context, p, NULL, &where, NULL)
                      : ebpo_distance(context, p, NULL, &distance, NULL)) == EBPO_OK);
    ebpo_context_free(context);
    ebpo_model_free(model);
    return (result){ distance.distance, where.where, far ? far->batches + far->alone - opened : 0 };
}

/* Distance and inside queries of points near the surface need at most this number of round trips
 * after opening. */
START_TEST(test_remote_query_round_trips)
{
    enum { WAVES = 4 };
    two_layouts l;
    counted_source c;
    uint64_t state = 3;
    two_layouts_build(&l, ebpo_test_torus(2, 0.7, 200, 120), 8, ALL, EBPO_CODEC_ZSTD, 400);
    for (int n = 0; n < 10; n++) {
        double cosine, sine;
        ebpo_test_circle((uint32_t)(ebpo_test_random(&state) % 1000), 1000, &cosine, &sine);
        double p[3] = { 2.71 * cosine, 2.71 * sine, 0.01 };
        ebpo_file *far = counted_open(&c, l.packed, true);
        result a = run_query(far, &c, p, n % 2, -1), b = run_query(l.without, NULL, p, n % 2, -1);
        counted_close(&c, far);
        ck_assert_msg(a.waves <= WAVES, "%d waves", (int)a.waves);
        ck_assert(a.distance == b.distance && a.where == b.where);
    }
    two_layouts_close(&l);
}
END_TEST

/* The faces, source indices and vertices of a leaf that is in no subtree of the file are requested
 * together. */
START_TEST(test_remote_leaf_round_trips)
{
    enum { WAVES = 2 }; /* 4 when each array is requested alone */
    static const double half[3][3] = { { 0.5, 0, 0 }, { 0, 0.5, 0 }, { 0, 0, 0.5 } };
    two_layouts l;
    counted_source c;
    ebpo_mesh mesh = ebpo_test_torus(2, 0.7, 200, 120);
    double p[2][3];
    for (int n = 0; n < 2; n++) { /* one solid before all subtrees, one after them */
        double offset[3] = { n ? 6 : -6, n ? 6 : -6, n ? 6 : -6 };
        ebpo_mesh small = ebpo_test_tetrahedron(1);
        ebpo_test_transform(&small, half, offset);
        for (int k = 0; k < 3; k++)
            p[n][k] = offset[k] + 0.1;
        ebpo_test_append(&mesh, &small);
        ebpo_mesh_free(&small);
    }
    two_layouts_build(&l, mesh, 8, ALL, EBPO_CODEC_ZSTD, 400);
    for (int n = 0; n < 4; n++) {
        ebpo_file *far = counted_open(&c, l.packed, true);
        int cut = ebpo_file_info(far)->subtree_level;
        result a = run_query(far, &c, p[n / 2], n % 2, cut),
               b = run_query(l.without, NULL, p[n / 2], n % 2, -1);
        ck_assert_int_gt(cut, 1);
        counted_close(&c, far);
        ck_assert_msg(a.waves <= WAVES, "%d: %d waves", n, (int)a.waves);
        ck_assert(a.distance == b.distance && a.where == b.where);
        ck_assert(n % 2 == 0 || a.where == EBPO_IN);
    }
    two_layouts_close(&l);
}
END_TEST

/* The list of a leaf that is in no subtree is read before the leaf, so that the faces that earlier
 * leaves list are requested together with their source indices and vertices. */
START_TEST(test_remote_shared_leaf_round_trips)
{
    enum { WAVES = 2 }; /* 4 without the list */
    static const double scale[3][3] = { { 24, 0, 0 }, { 0, 24, 0 }, { 0, 0, 24 } },
                        offset[3] = { -6, -6, -6 }, p[3] = { 17, -5.9, -5.9 };
    two_layouts l;
    counted_source c;
    ebpo_mesh mesh = ebpo_test_torus(2, 0.7, 200, 120), large = ebpo_test_tetrahedron(1);
    ebpo_test_transform(&large, scale, offset);
    ebpo_test_append(&mesh, &large);
    ebpo_mesh_free(&large);
    two_layouts_build(&l, mesh, 8, ALL, EBPO_CODEC_ZSTD, 400);
    for (int n = 0; n < 2; n++) {
        ebpo_file *far = counted_open(&c, l.packed, true);
        result a = run_query(far, &c, p, n, ebpo_file_info(far)->subtree_level),
               b = run_query(l.without, NULL, p, n, -1);
        counted_close(&c, far);
        ck_assert_msg(a.waves <= WAVES, "%d: %d waves", n, (int)a.waves);
        ck_assert(a.distance == b.distance && a.where == b.where);
    }
    two_layouts_close(&l);
}
END_TEST

/* In a file with the default layout, a distance query near the surface requests few bytes, because
 * subtrees are small. If the cut level is deeper than the subtrees' roots, all data of the subtree
 * in the file are requested together. */
START_TEST(test_remote_default_layout)
{
    enum {
        BYTES = 310000, /* 440,000 with subtrees of 1,024 faces or more */
        WAVES = 3       /* 12 if each array is requested alone */
    };
    two_layouts l;
    counted_source c;
    two_layouts_build(&l, ebpo_test_torus(2, 0.7, 520, 250), 16, ALL & ~EBPO_PART_LEAF_PLANES,
                      EBPO_CODEC_ZSTD, 0);
    for (uint32_t n = 0; n < 3; n++) {
        double cosine, sine;
        ebpo_test_circle(n < 2 ? 14 * n + 1 : 5, 30, &cosine, &sine);
        double p[3] = { 2.701 * cosine, 2.701 * sine, 0.01 };
        ebpo_file *far = counted_open(&c, l.packed, true);
        result a =
            run_query(far, &c, p, n == 2, n == 2 ? ebpo_file_info(far)->subtree_level + 1 : -1);
        ck_assert_msg(c.requested <= BYTES, "%d bytes", (int)c.requested);
        ck_assert_msg(a.waves <= WAVES, "%d: %d waves", (int)n, (int)a.waves);
        counted_close(&c, far);
    }
    two_layouts_close(&l);
}
END_TEST

/* --- one large model, which the tests below share --- */

static two_layouts l;

static void make_large(void)
{
    scratch_enter();
    two_layouts_build(&l, ebpo_test_torus(2, 0.7, 400, 240), 9, ALL, EBPO_CODEC_ZSTD, 400);
}

static void free_large(void)
{
    two_layouts_close(&l);
    scratch_leave();
}

/* A query that needs many subtrees requests several of them together. */
START_TEST(test_remote_deep_query_round_trips)
{
    enum {
        WAVES = 3,     /* 23 when each subtree is requested alone, 9 without envelopes */
        BYTES = 910000 /* 923,000 with all source indices, 1,047,000 without envelopes */
    };
    static const double p[3] = { 2.1, 0.1, 0.05 };
    counted_source c;
    ebpo_file *far = counted_open(&c, l.packed, true);
    result a = run_query(far, &c, p, false, -1), b = run_query(l.without, NULL, p, false, -1);
    counted_close(&c, far);
    ck_assert_msg(a.waves <= WAVES, "%d waves", (int)a.waves);
    ck_assert_msg(c.requested < BYTES, "%d of %d bytes", (int)c.requested, (int)c.size);
    ck_assert(a.distance == b.distance);
}
END_TEST

/* A query at almost equal distances from many subtrees reads their envelopes, then few subtrees. */
START_TEST(test_remote_axis_query_bytes)
{
    enum {
        WAVES = 3,     /* 10 without envelopes */
        BYTES = 412000 /* 415,000 with all source indices, 790,000 without envelopes */
    };
    static const double p[3] = { 0.05, 0.02, 0.01 };
    counted_source c;
    ebpo_file *far = counted_open(&c, l.packed, true);
    result a = run_query(far, &c, p, false, -1), b = run_query(l.without, NULL, p, false, -1);
    counted_close(&c, far);
    ck_assert_msg(a.waves <= WAVES, "%d waves", (int)a.waves);
    ck_assert_msg(c.requested < BYTES, "%d of %d bytes", (int)c.requested, (int)c.size);
    ck_assert(a.distance == b.distance);
}
END_TEST

/* Returns true if a cold distance query of a remote file reads envelopes. */
static bool reads_envelopes(uint64_t deadline_ns)
{
    static const double p[3] = { 0.05, 0.02, 0.01 };
    counted_source c;
    ebpo_file *far = counted_open(&c, l.packed, true);
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_distance_options how = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result distance;
    ebpo_model *model;
    ebpo_context *context;
    options.threads = 1;
    options.memory = 64 << 20;
    how.deadline_ns = deadline_ns;
    ck_assert(ebpo_model_new(far, &options, &model, NULL) == EBPO_OK);
    ck_assert(ebpo_context_new(model, &context, NULL) == EBPO_OK);
    ck_assert(ebpo_distance(context, p, &how, &distance, NULL) == EBPO_OK);
    bool read = context->envelopes_of != NULL;
    ebpo_context_free(context);
    ebpo_model_free(model);
    counted_close(&c, far);
    return read;
}

/* A query with a deadline does not begin to read envelopes, because it could not stop the read. */
START_TEST(test_deadline_reads_no_envelopes)
{
    const uint64_t hour = UINT64_C(3600000000000);
    ck_assert(reads_envelopes(0));
    ck_assert(!reads_envelopes(hour));
}
END_TEST

/* --- rays --- */

enum { RAYS = 100 };

/* Finds the first hits of rays that fill a square in front of an eye. */
static void cast_rays(const ebpo_file *file, ebpo_ray_hit hit[RAYS])
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_ray rays[RAYS];
    options.threads = 1;
    options.memory = 64 << 20;
    for (int i = 0; i < RAYS; i++)
        rays[i] = (ebpo_ray){ { 0.3, -8, 3 },
                              { 0.1 * (i % 10 - 4.5), 3, -1.2 + 0.1 * (double)(i / 10) },
                              INFINITY };
    ck_assert(ebpo_model_new(file, &options, &model, NULL) == EBPO_OK);
    ck_assert(ebpo_context_new(model, &context, NULL) == EBPO_OK);
    ck_assert(ebpo_ray_first_many(context, rays, RAYS, NULL, hit, NULL) == EBPO_OK);
    ebpo_context_free(context);
    ebpo_model_free(model);
}

/* The subtrees that all rays need next are requested together; a subtree whose envelope the rays
 * miss is not requested. Source indices are requested for the hits only. */
START_TEST(test_remote_rays_round_trips)
{
    enum {
        WAVES = 5,      /* 55 when each ray requests its subtrees alone */
        BYTES = 1600000 /* 1,614,000 with all source indices */
    };
    counted_source c;
    ebpo_ray_hit a[RAYS], b[RAYS];
    ebpo_file *far = counted_open(&c, l.packed, true);
    uint64_t opened = c.batches + c.alone;
    cast_rays(far, a);
    cast_rays(l.without, b);
    opened = c.batches + c.alone - opened;
    counted_close(&c, far);
    ck_assert_msg(opened <= WAVES, "%d waves", (int)opened);
    ck_assert_msg(c.requested < BYTES, "%d of %d bytes", (int)c.requested, (int)c.size);
    for (int i = 0; i < RAYS; i++)
        ck_assert(a[i].t == b[i].t && a[i].face == b[i].face && a[i].side == b[i].side);
}
END_TEST

static void set_top_bytes(const char *path, uint64_t bytes)
{
    hid_t h5 = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT),
          attribute = H5Aopen(h5, "top_bytes", H5P_DEFAULT);
    ck_assert(H5Awrite(attribute, H5T_NATIVE_UINT64, &bytes) >= 0);
    H5Aclose(attribute);
    ck_assert(H5Fclose(h5) >= 0);
}

/* top_bytes is a hint: false values change no result, and impossible ones cost no bytes. */
START_TEST(test_false_top_bytes_changes_no_result)
{
    static const uint64_t false_bytes[] = { 0, 1, 1 << 16, INT64_MAX, UINT64_MAX };
    static const double p[3] = { 2.71, 0, 0.01 };
    counted_source c;
    result right = run_query(l.without, NULL, p, true, -1);
    for (size_t i = 0; i < sizeof false_bytes / sizeof *false_bytes; i++) {
        set_top_bytes(l.packed, false_bytes[i]);
        ebpo_file *far = counted_open(&c, l.packed, true);
        result found = run_query(far, &c, p, true, -1);
        counted_close(&c, far);
        ck_assert(found.distance == right.distance && found.where == right.where);
        ck_assert_msg(c.requested < c.size / 2, "%d of %d bytes", (int)c.requested, (int)c.size);
    }
}
END_TEST

static bool add_up(void *user, const ebpo_near_face *face)
{
    *(double *)user += face->distance;
    return true;
}

/* Returns the sum of the distances of faces within a radius, by a cold query. */
static double sum_within(const ebpo_file *file, const double p[3], double radius)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_within_options within = EBPO_WITHIN_OPTIONS_INIT;
    ebpo_model *model;
    ebpo_context *context;
    double sum = 0;
    options.threads = 1;
    options.memory = 64 << 20;
    within.radius = radius;
    ck_assert(ebpo_model_new(file, &options, &model, NULL) == EBPO_OK);
    ck_assert(ebpo_context_new(model, &context, NULL) == EBPO_OK);
    ck_assert(ebpo_distance_within(context, p, &within, add_up, &sum, NULL) == EBPO_OK);
    ebpo_context_free(context);
    ebpo_model_free(model);
    return sum;
}

/* All subtrees within a radius are requested together. */
START_TEST(test_remote_radius_query_round_trips)
{
    enum { WAVES = 4 };
    static const double p[3] = { 2.71, 0, 0.01 };
    counted_source c;
    ebpo_file *far = counted_open(&c, l.packed, true);
    uint64_t opened = c.batches + c.alone;
    ck_assert(sum_within(far, p, 1) == sum_within(l.without, p, 1));
    ck_assert_msg(c.batches + c.alone - opened <= WAVES, "%d waves",
                  (int)(c.batches + c.alone - opened));
    counted_close(&c, far);
}
END_TEST

/* --- parts of the file --- */

/* After the header, one round trip is needed for each of these: the top levels, rows of the table,
 * nodes with lists, and faces with their vertices. */
START_TEST(test_remote_box_query_round_trips)
{
    enum { WAVES = 4 };
    counted_source c;
    ebpo_subset_options box = EBPO_SUBSET_OPTIONS_INIT;
    box.boxed = true;
    for (int k = 0; k < 3; k++) {
        box.min[k] = k ? -0.3 : 2.2;
        box.max[k] = k ? 0.3 : 3;
    }
    ebpo_file *far = counted_open(&c, l.packed, true);
    uint64_t opened = c.batches + c.alone;
    ck_assert(ebpo_subset(far, scratch("box.ebpo.h5"), &box, NULL) == EBPO_OK);
    ck_assert_msg(c.batches + c.alone - opened <= WAVES, "%d waves",
                  (int)(c.batches + c.alone - opened));
    ck_assert_msg(c.requested < c.size / 2, "%d of %d bytes", (int)c.requested, (int)c.size);
    counted_close(&c, far);
}
END_TEST

static uint64_t count_nodes(const ebpo_file *file, const ebpo_view_options *options)
{
    ebpo_view_stream *stream;
    ebpo_view_node node;
    ebpo_view_end end;
    uint64_t count = 0;
    ck_assert(ebpo_view_stream_new(file, options, &stream, NULL) == EBPO_OK);
    do {
        ck_assert(ebpo_view_stream_next(stream, &node, &end, NULL) == EBPO_OK);
        count += end == EBPO_VIEW_NODE;
    } while (end == EBPO_VIEW_NODE);
    ebpo_view_stream_free(stream);
    return count;
}

/* Returns the options of a view of the torus from outside, with planes and without invisible parts.
 */
static ebpo_view_options look(ebpo_observer *observer, ebpo_priority order)
{
    ebpo_view_options view = EBPO_VIEW_OPTIONS_INIT;
    observer->eye[0] = 4;
    observer->direction[0] = -1;
    observer->up[2] = 1;
    view.observer = observer;
    view.unseen = EBPO_UNSEEN_NEVER;
    view.planes = true;
    view.priority = order;
    return view;
}

/* For each order, all subtrees that a view will visit are requested together. */
START_TEST(test_remote_view_round_trips)
{
    enum { WAVES = 4 };
    static const ebpo_priority order[] = { EBPO_PRIORITY_LEVEL, EBPO_PRIORITY_PIXELS,
                                           EBPO_PRIORITY_FRONT_TO_BACK };
    counted_source c;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_view_options view = look(&observer, order[_i]);
    view.pixels = 8;
    ebpo_file *far = counted_open(&c, l.packed, true);
    uint64_t opened = c.batches + c.alone, nodes = count_nodes(far, &view);
    ck_assert_msg(c.batches + c.alone - opened <= WAVES, "%d waves",
                  (int)(c.batches + c.alone - opened));
    ck_assert(nodes == count_nodes(l.without, &view) && nodes > 1000);
    counted_close(&c, far);
}
END_TEST

/* Writes the same file with faces by index, for the limit of a fifth of its bytes below. */
static const char *by_number(const ebpo_file *file)
{
    ebpo_subset_options all = EBPO_SUBSET_OPTIONS_INIT;
    const char *path = scratch("by_number.ebpo.h5");
    all.subtree_faces = 400;
    all.face_coding = EBPO_FACES_HIGH_WATER;
    ck_assert(ebpo_subset(file, path, &all, NULL) == EBPO_OK);
    return path;
}

/* The final depth is not known in advance. Prefetch hints cover nodes whose turn is near. They
 * cover neither the deepest levels, for which there is no memory, nor single nodes. */
START_TEST(test_remote_limited_view_round_trips)
{
    static const struct {
        ebpo_priority order;
        uint64_t bytes, nodes, waves;
    } ends[] = { { EBPO_PRIORITY_LEVEL, 0, 30000, 6 },
                 { EBPO_PRIORITY_PIXELS, 0, 30000, 6 },
                 { EBPO_PRIORITY_LEVEL, 400000, 0, 60 },
                 { EBPO_PRIORITY_PIXELS, 400000, 0, 30 } };
    counted_source c;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    const char *path = by_number(l.with);
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        ebpo_view_options view = look(&observer, ends[i].order);
        view.bytes = ends[i].bytes;
        view.nodes = ends[i].nodes;
        ebpo_file *far = counted_open(&c, path, true);
        uint64_t opened = c.batches + c.alone, nodes = count_nodes(far, &view),
                 waves = c.batches + c.alone - opened;
        ck_assert_msg(waves <= ends[i].waves, "%d waves of view %d", (int)waves, (int)i);
        ck_assert(c.requested <= (view.bytes ? view.bytes : c.size / 5));
        ck_assert(view.bytes || nodes == count_nodes(l.without, &view));
        counted_close(&c, far);
    }
}
END_TEST

TEST_SUITE(round_trips)
{
    Suite *suite = suite_create("far_waves");
    TCase *small = tcase_create("small"), *large = tcase_create("large");
    tcase_set_timeout(small, 900);
    tcase_add_checked_fixture(small, scratch_enter, scratch_leave);
    tcase_add_test(small, test_remote_query_round_trips);
    tcase_add_test(small, test_remote_leaf_round_trips);
    tcase_add_test(small, test_remote_default_layout);
    tcase_add_test(small, test_remote_shared_leaf_round_trips);
    suite_add_tcase(suite, small);
    tcase_set_timeout(large, 900);
    tcase_add_unchecked_fixture(large, make_large, free_large);
    tcase_add_test(large, test_remote_deep_query_round_trips);
    tcase_add_test(large, test_remote_axis_query_bytes);
    tcase_add_test(large, test_deadline_reads_no_envelopes);
    tcase_add_test(large, test_remote_rays_round_trips);
    tcase_add_test(large, test_remote_radius_query_round_trips);
    tcase_add_test(large, test_remote_box_query_round_trips);
    tcase_add_loop_test(large, test_remote_view_round_trips, 0, 3);
    tcase_add_test(large, test_remote_limited_view_round_trips);
    tcase_add_test(large,
                   test_false_top_bytes_changes_no_result); /* last, as it changes the file */
    suite_add_tcase(suite, large);
    return suite;
}
