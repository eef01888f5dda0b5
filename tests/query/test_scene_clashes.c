/* Compares reports of a scene with separate queries of two models, for every pair of instances,
 * near or not. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>
#include <ebpo/scene.h>

#include "check_main.h"
#include "exact_reference.h"
#include "model_file.h"
#include "extras/collide/face_pairs.h"
#include "geometry/pose.h"
#include "query_support.h"

enum { PARTS = 8, MODELS = 3 };
static const double clearance = 0.25, within = 0.01;

/* --- scenes --- */

static void write_model(const char *name, ebpo_mesh mesh)
{
    ebpo_tree tree = model_build_parts(mesh, 4, ebpo_profile_parts(EBPO_PROFILE_FULL));
    model_write(&tree, scratch(name), NULL);
}

/* Makes a surface of two faces. */
static ebpo_mesh sheet(void)
{
    ebpo_mesh mesh = { 0 };
    for (int i = 0; i < 4; i++)
        ebpo_test_append_vertex(&mesh, i & 1, i >> 1, 0);
    ebpo_test_append_face(&mesh, 0, 1, 3);
    ebpo_test_append_face(&mesh, 0, 3, 2);
    return mesh;
}

static void begin(void)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 }, middle[3] = { 0.5, 0.5, 0.5 };
    scratch_enter();
    write_model("m0.ebpo.h5", ebpo_test_box(low, high, 3));
    write_model("m1.ebpo.h5", ebpo_test_sphere(middle, 0.5, 2));
    write_model("m2.ebpo.h5", sheet());
}

/* Makes a scene with instances on a grid of quarters, some of half the size, so that instances nest
 * and are in contact. */
static ebpo_scene *some_scene(uint64_t seed)
{
    uint64_t state = 31 * seed + 7;
    ebpo_scene *scene = NULL;
    FILE *f = fopen(scratch("s.json"), "w");
    fprintf(f, "{\"ebpo_scene\": \"1.0\", \"models\": {");
    for (int i = 0; i < MODELS; i++)
        fprintf(f, "%s\"m%d\": {\"file\": \"m%d.ebpo.h5\"}", i ? ", " : "", i, i);
    fprintf(f, "}, \"instances\": [");
    for (int i = 0; i < PARTS; i++) {
        double at[3], scale = reference_integer(&state, 0, 2) ? 1 : 0.5;
        for (int k = 0; k < 3; k++)
            at[k] = (double)reference_integer(&state, 0, 6) / 4;
        fprintf(f,
                "%s{\"name\": \"i%d\", \"model\": \"m%d\", \"pose\": {\"translation\": [%.9g, "
                "%.9g, %.9g], \"scale\": %.9g}}",
                i ? ", " : "", i, (int)reference_integer(&state, 0, 4) % MODELS, at[0], at[1],
                at[2], scale);
    }
    fprintf(f, "], \"clearance\": [{\"between\": [\"*\", \"*\"], \"distance\": %.9g}]}", clearance);
    fclose(f);
    ASSERT_OK(ebpo_scene_open(scratch("s.json"), NULL, &scene, error));
    ASSERT_OK(ebpo_scene_load(scene, NULL, error));
    return scene;
}

/* --- a pair, queried separately --- */

typedef struct alone {
    ebpo_collider *collider;
    ebpo_collide_options options;
    const ebpo_file *file[2];
    bool solid[2];
} alone;

static void make_alone(ebpo_scene *scene, uint64_t a, uint64_t b, alone *out)
{
    ebpo_model *model[2];
    out->options = (ebpo_collide_options)EBPO_COLLIDE_OPTIONS_INIT;
    for (int i = 0; i < 2; i++) {
        ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
        ck_assert_int_eq(ebpo_scene_get_instance(scene, i ? b : a, &at), EBPO_OK);
        ASSERT_OK(ebpo_scene_model(scene, at.model, &model[i], error));
        ASSERT_OK(ebpo_scene_pose(scene, i ? b : a, 0,
                                  i ? &out->options.pose_b : &out->options.pose_a, error));
        out->file[i] = ebpo_scene_file(scene, at.model);
        out->solid[i] = ebpo_file_info(out->file[i])->solid;
    }
    ASSERT_OK(ebpo_collider_new(model[0], model[1], NULL, &out->collider, error));
}

typedef struct seen {
    uint64_t pairs[4], lines;
    double low[3], high[3];
} seen;

static bool see_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    seen *s = user;
    for (uint64_t i = 0; i < count; i++)
        s->pairs[pairs[i].kind]++;
    return true;
}

static bool see_segments(void *user, const ebpo_contact_segment *segments, uint64_t count)
{
    seen *s = user;
    for (uint64_t i = 0; i < count; i++)
        for (int k = 0; k < 6; k++) {
            s->low[k % 3] = fmin(s->low[k % 3], segments[i].point[k / 3][k % 3]);
            s->high[k % 3] = fmax(s->high[k % 3], segments[i].point[k / 3][k % 3]);
        }
    return true;
}

static bool see_lines(void *user, const ebpo_polyline *line)
{
    (void)line;
    ((seen *)user)->lines++;
    return true;
}

static void look(alone *p, seen *s)
{
    *s = (seen){ { 0 }, 0, { INFINITY, INFINITY, INFINITY }, { -INFINITY, -INFINITY, -INFINITY } };
    ASSERT_OK(ebpo_collide_all(p->collider, &p->options, see_pairs, s, error));
    ASSERT_OK(ebpo_collide_contacts(p->collider, &p->options, see_segments, s, error));
    ASSERT_OK(ebpo_collide_polylines(p->collider, &p->options, see_lines, s, error));
}

static int32_t kind_of(const alone *p, const seen *s, int32_t relation, double distance)
{
    if (relation == EBPO_INTERSECTING && (p->solid[0] || p->solid[1]))
        return EBPO_CLASH_PROTRUDING;
    if (relation == EBPO_A_INSIDE_B || relation == EBPO_B_INSIDE_A)
        return EBPO_CLASH_ENCLOSED;
    if (relation == EBPO_EQUAL)
        return EBPO_CLASH_DUPLICATE;
    return s->pairs[EBPO_PAIR_CROSSING]   ? EBPO_CLASH_CROSSING
           : s->pairs[EBPO_PAIR_COPLANAR] ? EBPO_CLASH_COPLANAR
           : s->pairs[EBPO_PAIR_TOUCHING] ? EBPO_CLASH_TOUCHING
           : distance < clearance         ? EBPO_CLASH_NEAR
                                          : EBPO_CLASH_NONE;
}

/* --- results --- */

/* Returns the distance to the faces of a model by a search of all faces. */
static double distance_to(const alone *p, int m, const double at[3])
{
    static const double reach[3] = { 2, 2, 2 };
    ebpo_mesh mesh = { 0 };
    ebpo_posing posing;
    double least = INFINITY, point[3][3];
    ASSERT_OK(ebpo_file_read_mesh((ebpo_file *)(uintptr_t)p->file[m], NULL, &mesh, error));
    ASSERT_OK(ebpo_posing_make(&posing, m ? &p->options.pose_b : &p->options.pose_a, reach, error));
    for (int i = 0; i < 3; i++)
        memcpy(point[i], at, sizeof point[i]);
    for (uint64_t f = 0; f < mesh.face_count; f++) {
        ebpo_pair_distance_bounds bounds;
        double t[3][3];
        for (uint64_t i = 0; i < 3; i++) {
            double x[3];
            ebpo_test_point(&mesh, mesh.faces[3 * f + i], x);
            ebpo_posing_apply(&posing, x, t[i]);
        }
        ebpo_triangles_distance_bounds((const double(*)[3])t, (const double(*)[3])point, &bounds);
        least = fmin(least, bounds.hi);
    }
    ebpo_mesh_free(&mesh);
    return least;
}

static void check_place(const alone *p, const ebpo_scene_clash *m, const seen *s)
{
    for (int i = 0; i < 2; i++)
        ck_assert_double_le(fabs(distance_to(p, i, m->location) - m->distance / 2), 1e-9);
    for (int k = 0; k < 3; k++) {
        ck_assert_double_eq(m->location_min[k], fmin(m->location[k], s->low[k]));
        ck_assert_double_eq(m->location_max[k], fmax(m->location[k], s->high[k]));
    }
}

static void check_depths(alone *p, const ebpo_scene_clash *m)
{
    bool inner = m->relation >= EBPO_INTERSECTING && m->relation < EBPO_EQUAL;
    for (int i = 0; i < 2; i++) {
        ebpo_value_bounds reference = { 0, p->solid[!i] ? 0 : INFINITY, EBPO_VALUE_BOUND, 0 };
        if (inner && p->solid[!i])
            ASSERT_OK(ebpo_collide_depth(p->collider, &p->options, within, i ? NULL : &reference,
                                         i ? &reference : NULL, error));
        ck_assert_double_eq(m->depth[i].lo, reference.lo);
        ck_assert_double_eq(m->depth[i].hi, reference.hi);
    }
    if (m->kind == EBPO_CLASH_PROTRUDING && p->solid[0] && p->solid[1])
        ck_assert_double_gt(fmax(m->depth[0].hi, m->depth[1].hi), 0);
}

static void check_pair(ebpo_scene *scene, uint64_t a, uint64_t b, const ebpo_scene_clash *m,
                       uint64_t *kinds)
{
    alone p;
    seen s;
    ebpo_relation_result relation;
    ebpo_collide_distance_result far;
    make_alone(scene, a, b, &p);
    look(&p, &s);
    ASSERT_OK(ebpo_collide_relation(p.collider, &p.options, &relation, error));
    ASSERT_OK(ebpo_collide_distance(p.collider, &p.options, NULL, &far, error));
    int32_t kind = kind_of(&p, &s, relation.relation, far.distance.hi);
    ck_assert_msg((m ? m->kind : EBPO_CLASH_NONE) == kind, "instances %d and %d: %d, not %d",
                  (int)a, (int)b, m ? m->kind : -1, kind);
    if (m) {
        kinds[kind]++;
        ck_assert_int_eq(m->relation, relation.relation);
        ck_assert_uint_eq(m->touching, s.pairs[EBPO_PAIR_TOUCHING]);
        ck_assert_uint_eq(m->coplanar, s.pairs[EBPO_PAIR_COPLANAR]);
        ck_assert_uint_eq(m->crossing, s.pairs[EBPO_PAIR_CROSSING]);
        ck_assert_uint_eq(m->contacts, s.lines);
        ck_assert_double_eq(m->distance, far.distance.hi);
        check_place(&p, m, &s);
        check_depths(&p, m);
    }
    ebpo_collider_free(p.collider);
}

typedef struct intersected {
    ebpo_scene_clash list[PARTS * PARTS];
    uint64_t count;
} intersected;

static bool keep_clashes(void *user, const ebpo_scene_clash *clashes, uint64_t count)
{
    intersected *m = user;
    memcpy(m->list, clashes, count * sizeof *clashes);
    m->count = count;
    return true;
}

static void meet(ebpo_scene *scene, const ebpo_scene_clash_options *how, intersected *out)
{
    memset(out, 0, sizeof *out);
    ASSERT_OK(ebpo_scene_find_clashes(scene, 0, how, keep_clashes, out, NULL, error));
}

START_TEST(test_scene_reports_match_pair_queries)
{
    uint64_t rounds = query_scaled(20) + 4, kinds[8] = { 0 };
    ebpo_scene_clash_options how = EBPO_SCENE_CLASH_OPTIONS_INIT;
    how.count = how.locations = how.relate = true;
    how.depth = within;
    for (uint64_t n = 0; n < rounds; n++) {
        ebpo_scene *scene = some_scene(n);
        uint64_t at = 0;
        intersected m;
        meet(scene, &how, &m);
        for (uint64_t a = 0; a < PARTS; a++)
            for (uint64_t b = a + 1; b < PARTS; b++) {
                bool is = at < m.count && m.list[at].a == a && m.list[at].b == b;
                check_pair(scene, a, b, is ? &m.list[at] : NULL, kinds);
                at += is;
            }
        ck_assert_uint_eq(at, m.count);
        ebpo_scene_free(scene);
    }
    for (int i = EBPO_CLASH_NEAR; i <= EBPO_CLASH_ENCLOSED; i++)
        ck_assert_msg(kinds[i] > 0 || i == EBPO_CLASH_TOUCHING || i == EBPO_CLASH_CROSSING,
                      "no pair of kind %d", i);
}
END_TEST

/* Kinds and positions are also correct without counting, and values that were not requested are
 * not returned. */
START_TEST(test_scene_reports_only_requested_values)
{
    uint64_t rounds = query_scaled(20) + 4;
    ebpo_scene_clash_options all = EBPO_SCENE_CLASH_OPTIONS_INIT,
                             few = EBPO_SCENE_CLASH_OPTIONS_INIT;
    all.count = true;
    few.locations = true;
    for (uint64_t n = 0; n < rounds; n++) {
        ebpo_scene *scene = some_scene(n);
        intersected m, l;
        meet(scene, &all, &m);
        meet(scene, &few, &l);
        ck_assert_uint_eq(m.count, l.count);
        for (uint64_t i = 0; i < m.count; i++) {
            static const seen nothing = {
                { 0 }, 0, { INFINITY, INFINITY, INFINITY }, { -INFINITY, -INFINITY, -INFINITY }
            };
            alone p;
            ck_assert_int_eq(m.list[i].kind, l.list[i].kind);
            ck_assert(isnan(m.list[i].location[0]) &&
                      m.list[i].relation == EBPO_RELATION_UNDECIDED);
            ck_assert(m.list[i].depth[0].hi == INFINITY && l.list[i].contacts == 0);
            make_alone(scene, l.list[i].a, l.list[i].b, &p);
            check_place(&p, &l.list[i], &nothing);
            ebpo_collider_free(p.collider);
        }
        ebpo_scene_free(scene);
    }
}
END_TEST

/* The pairs of faces of two instances are those of their models. */
START_TEST(test_scene_instances_collide_like_models)
{
    ebpo_scene *scene = some_scene(1);
    uint64_t some = 0;
    for (uint64_t a = 0; a < PARTS; a++)
        for (uint64_t b = 0; b < PARTS; b++) {
            seen s, t = { { 0 }, 0, { 0 }, { 0 } };
            alone p;
            make_alone(scene, a, b, &p);
            look(&p, &s);
            ASSERT_OK(ebpo_scene_collide(scene, a, b, 0, 1, see_pairs, &t, error));
            ck_assert(memcmp(s.pairs, t.pairs, sizeof s.pairs) == 0);
            some += t.pairs[EBPO_PAIR_CROSSING];
            ebpo_collider_free(p.collider);
        }
    ck_assert_uint_gt(some, 0);
    ebpo_scene_free(scene);
}
END_TEST

TEST_SUITE(scene_clashes)
{
    Suite *suite = suite_create("scene_meetings");
    TCase *tests = tcase_create("scene_meetings");
    tcase_add_checked_fixture(tests, begin, scratch_leave);
    tcase_set_timeout(tests, 900);
    tcase_add_test(tests, test_scene_reports_match_pair_queries);
    tcase_add_test(tests, test_scene_reports_only_requested_values);
    tcase_add_test(tests, test_scene_instances_collide_like_models);
    suite_add_tcase(suite, tests);
    return suite;
}
