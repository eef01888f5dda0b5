/* Models of ebpo-generate do not intersect themselves, and the program's proof of this is correct.
 */
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "samples/generate/embedded.h"
#include "samples/generate/shapes.h"
#include "crossing_faces.h"
#include "solids.h"

static face_model model_of(const ebpo_mesh *mesh)
{
    return (face_model){ (const float(*)[3])mesh->xyz32, (const uint32_t(*)[3])mesh->faces,
                         mesh->vertex_count, mesh->face_count };
}

static uint64_t clashes(const ebpo_mesh *mesh)
{
    face_model m = model_of(mesh);
    uint64_t first[2];
    ck_assert_int_eq(crossing_flat_faces(&m), 0);
    return crossing_faces(&m, first);
}

static ebpo_mesh make_sphere(int subdivisions)
{
    ebpo_mesh mesh;
    ck_assert(ebpo_make_icosahedron(&mesh));
    for (int i = 0; i < subdivisions; i++) {
        ck_assert(ebpo_subdivide(&mesh));
        ebpo_to_unit_sphere(&mesh);
    }
    return mesh;
}

static ebpo_mesh make_torus(uint32_t n, uint32_t m)
{
    ebpo_mesh mesh;
    ck_assert(ebpo_make_torus(&mesh, n, m));
    return mesh;
}

/* --- the reference --- */

static uint64_t pairs_that_intersect(const float (*xyz)[3], const uint32_t (*corners)[3],
                                     uint64_t faces)
{
    face_model m = { xyz, corners, 9, faces };
    uint64_t first[2];
    return crossing_faces(&m, first);
}

START_TEST(test_faces_without_shared_corner_intersect)
{
    static const uint32_t two[2][3] = { { 0, 1, 2 }, { 3, 4, 5 } };
    static const struct {
        float other[3][3];
        uint64_t meets;
    } cases[] = { { { { 1, 1, -1 }, { 1, 1, 1 }, { 5, 5, 0 } }, 1 }, /* passes through */
                  { { { 1, 1, 0 }, { 1, 1, 1 }, { 2, 1, 1 } }, 1 },  /* touches it with a corner */
                  /* is above it by the smallest float */
                  { { { 1, 1, 0x1p-149f }, { 1, 1, 1 }, { 2, 1, 1 } }, 0 },
                  { { { 1, 0, 0 }, { 2, 0, 0 }, { 1, 0, 1 } }, 1 }, /* touches its edge */
                  /* touches a corner, with another index */
                  { { { 0, 0, 0 }, { -1, 0, 0 }, { 0, -1, 0 } }, 1 },
                  { { { 1, 1, 0 }, { 2, 1, 0 }, { 1, 2, 0 } }, 1 },       /* is within it */
                  { { { -9, -9, 0 }, { 30, -9, 0 }, { -9, 30, 0 } }, 1 }, /* is around it */
                  { { { 5, 5, 0 }, { 9, 5, 0 }, { 5, 9, 0 } }, 0 },       /* is beside it */
                  { { { 1, 1, 1 }, { 2, 1, 1 }, { 1, 2, 1 } }, 0 },       /* is above it */
                  /* passes through its plane elsewhere */
                  { { { -1, -1, -1 }, { 9, -1, 1 }, { -1, -2, 1 } }, 0 } };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        float xyz[9][3] = { { 0, 0, 0 }, { 4, 0, 0 }, { 0, 4, 0 } };
        memcpy(xyz[3], cases[i].other, sizeof cases[i].other);
        ck_assert_msg(pairs_that_intersect((const float(*)[3])xyz, two, 2) == cases[i].meets,
                      "case %zu", i);
    }
}
END_TEST

START_TEST(test_folded_neighbours_intersect)
{
    static const float xyz[9][3] = { { 0, 0, 0 },  { 4, 0, 0 },  { 0, 4, 0 },
                                     { 4, 4, 0 },  { 1, 1, 0 },  { 1, 1, 1 },
                                     { 2, 2, -1 }, { -4, 0, 0 }, { 0, -4, 1 } };
    static const struct {
        uint32_t faces[2][3];
        uint64_t meets;
    } cases[] = { { { { 0, 1, 2 }, { 2, 1, 3 } }, 0 }, /* a flat square */
                  { { { 0, 1, 2 }, { 1, 0, 4 } }, 1 }, /* folded flat over an edge */
                  { { { 0, 1, 2 }, { 1, 0, 5 } }, 0 }, /* at an angle */
                  { { { 0, 1, 2 }, { 0, 5, 6 } }, 1 }, /* one common corner, and through it */
                  { { { 0, 1, 2 }, { 0, 7, 8 } }, 0 }, /* one common corner */
                  { { { 0, 1, 2 }, { 0, 3, 5 } },
                    1 }, /* one common corner, and an edge within it */
                  { { { 0, 1, 2 }, { 1, 2, 0 } }, 1 } }; /* the same face twice */
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        ck_assert_msg(pairs_that_intersect(xyz, (const uint32_t(*)[3])cases[i].faces, 2) ==
                          cases[i].meets,
                      "case %zu", i);
}
END_TEST

START_TEST(test_reference_detects_closed_manifolds)
{
    ebpo_mesh sphere = make_sphere(2);
    face_model m = model_of(&sphere);
    ck_assert(crossing_closed_manifold(&m));
    m.faces--;
    ck_assert(!crossing_closed_manifold(&m));
    m.faces++;
    ebpo_test_turn_face(&sphere, 7);
    ck_assert(!crossing_closed_manifold(&m));
    ebpo_test_turn_face(&sphere, 7);
    for (uint64_t i = 0; i < 3 * sphere.face_count;
         i++) /* the south pole becomes the north pole: one vertex with two rings */
        sphere.faces[i] = sphere.faces[i] == 11 ? 0 : sphere.faces[i];
    ck_assert(!crossing_closed_manifold(&m));
    ebpo_mesh_free(&sphere);
}
END_TEST

/* --- the models --- */

static void check_model(ebpo_mesh *mesh, bool (*embedded)(const ebpo_mesh *), double relief,
                        double roughness, uint64_t seed)
{
    ck_assert(ebpo_displace(mesh, relief, roughness, seed));
    face_model m = model_of(mesh);
    ck_assert(crossing_closed_manifold(&m));
    ck_assert_int_eq(clashes(mesh), 0);
    ck_assert(embedded(mesh));
    ebpo_mesh_free(mesh);
}

START_TEST(test_displaced_shapes_do_not_self_intersect)
{
    static const double reliefs[][2] = { { 0.08, 0.15 }, { 0.2, 0.5 }, { 0, 0 } };
    for (uint64_t seed = 1; seed <= 2; seed++)
        for (int i = 0; i < 3; i++)
            for (int n = 0; n <= 5; n++) {
                ebpo_mesh sphere = make_sphere(n), torus = make_torus(8u << n, 3u << n);
                check_model(&sphere, ebpo_embedded_sphere, reliefs[i][0], reliefs[i][1], seed);
                check_model(&torus, ebpo_embedded_torus, reliefs[i][0], reliefs[i][1], seed);
            }
}
END_TEST

/* --- the proof --- */

START_TEST(test_embedding_proof_is_correct)
{
    int proved = 0, intersected = 0;
    for (int i = 1; i <= 40; i++) {
        ebpo_mesh shapes[2] = { make_sphere(3), make_torus(40, 16) };
        bool (*const embedded[2])(const ebpo_mesh *) = { ebpo_embedded_sphere,
                                                         ebpo_embedded_torus };
        for (int k = 0; k < 2; k++) {
            ck_assert(ebpo_displace(&shapes[k], 0.1 * i, 0.05 * i, (uint64_t)i));
            bool proof = embedded[k](&shapes[k]);
            uint64_t pairs = clashes(&shapes[k]);
            ck_assert(!proof || pairs == 0);
            proved += proof;
            intersected += pairs > 0;
            ebpo_mesh_free(&shapes[k]);
        }
    }
    ck_assert_int_gt(proved, 10);
    ck_assert_int_gt(intersected, 10);
}
END_TEST

START_TEST(test_embedding_proof_refuses_bad_surfaces)
{
    ebpo_mesh sphere = make_sphere(2), torus = make_torus(40, 16);
    ck_assert(ebpo_embedded_sphere(&sphere));
    ck_assert(ebpo_embedded_torus(&torus));
    ck_assert(!ebpo_embedded_torus(&sphere));
    ck_assert(!ebpo_embedded_sphere(&torus));
    ebpo_test_reverse(&sphere);
    ebpo_test_reverse(&torus);
    ck_assert(!ebpo_embedded_sphere(&sphere));
    ck_assert(!ebpo_embedded_torus(&torus));
    ebpo_test_reverse(&sphere);
    ebpo_test_reverse(&torus);
    float *p = sphere.xyz32 + 3 * 20, *q = torus.xyz32 + 3 * 100;
    for (int k = 0; k < 3; k++) {
        p[k] *= -1;
        q[k] *= 0.5f;
    }
    ck_assert(!ebpo_embedded_sphere(&sphere));
    ck_assert(!ebpo_embedded_torus(&torus));
    ebpo_mesh_free(&sphere);
    ebpo_mesh_free(&torus);
}
END_TEST

/* Every face is oriented outwards, but each ray leaves twice. */
START_TEST(test_embedding_proof_refuses_double_winding)
{
    ebpo_mesh torus = make_torus(40, 16);
    uint64_t n = torus.face_count;
    torus.faces = realloc(torus.faces, 6 * n * sizeof *torus.faces);
    ck_assert_ptr_nonnull(torus.faces);
    memcpy(torus.faces + 3 * n, torus.faces, 3 * n * sizeof *torus.faces);
    torus.face_count = 2 * n;
    ck_assert(!ebpo_embedded_torus(&torus));
    torus.face_count = n;
    ck_assert(ebpo_embedded_torus(&torus));
    ebpo_mesh_free(&torus);
    ebpo_mesh sphere = make_sphere(2);
    n = sphere.face_count;
    sphere.faces = realloc(sphere.faces, 6 * n * sizeof *sphere.faces);
    ck_assert_ptr_nonnull(sphere.faces);
    memcpy(sphere.faces + 3 * n, sphere.faces, 3 * n * sizeof *sphere.faces);
    sphere.face_count = 2 * n;
    ck_assert(!ebpo_embedded_sphere(&sphere));
    ebpo_mesh_free(&sphere);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("generate");
    TCase *cases = tcase_create("generate");
    tcase_set_timeout(cases, 600);
    tcase_add_test(cases, test_faces_without_shared_corner_intersect);
    tcase_add_test(cases, test_folded_neighbours_intersect);
    tcase_add_test(cases, test_reference_detects_closed_manifolds);
    tcase_add_test(cases, test_displaced_shapes_do_not_self_intersect);
    tcase_add_test(cases, test_embedding_proof_is_correct);
    tcase_add_test(cases, test_embedding_proof_refuses_bad_surfaces);
    tcase_add_test(cases, test_embedding_proof_refuses_double_winding);
    suite_add_tcase(suite, cases);
    return suite;
}
