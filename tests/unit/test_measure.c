/* Tests area, volume, centroid and inertia against closed forms and against integrals of the mesh
 * in rational numbers. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <gmp.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "scratch.h"
#include "solids.h"

static const char *path;

static void make_folder(void)
{
    scratch_enter();
    path = scratch("x.ebpo.h5");
}

static ebpo_mesh copy_of(const ebpo_mesh *mesh)
{
    ebpo_mesh copy = { .xyz64 = calloc(1, 1), .faces = calloc(1, 1) };
    double at[3];
    for (uint64_t i = 0; i < mesh->vertex_count; i++) {
        ebpo_test_point(mesh, i, at);
        ebpo_test_append_vertex(&copy, at[0], at[1], at[2]);
    }
    for (uint64_t f = 0; f < mesh->face_count; f++)
        ebpo_test_append_face(&copy, mesh->faces[3 * f], mesh->faces[3 * f + 1],
                              mesh->faces[3 * f + 2]);
    return copy;
}

/* The winding rule of the files that the tests write. */
static ebpo_rule file_rule;

/* Makes a file of the mesh. The mesh remains owned by the caller. */
static ebpo_file *file_of(const ebpo_mesh *mesh, uint32_t parts)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh_report report;
    ebpo_repair_record repair_record = { 0 };
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_tree tree;
    ebpo_file *file = NULL;
    ebpo_mesh copy = copy_of(mesh);
    options.parts = parts;
    options.rule = file_rule;
    ck_assert_msg(ebpo_mesh_check(mesh, 0, options.progress, &report, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_msg(ebpo_build(&copy, &report, &repair_record, &options, &tree, &error) == EBPO_OK,
                  "%s", error.message);
    ck_assert_msg(ebpo_tree_write(&tree, path, &write, &error) == EBPO_OK, "%s", error.message);
    ebpo_tree_free(&tree);
    ck_assert_msg(ebpo_open(path, &file, &error) == EBPO_OK, "%s", error.message);
    return file;
}

static bool same(double a, double b) { return memcmp(&a, &b, sizeof a) == 0; }

static ebpo_mass mass_on(const ebpo_mesh *mesh, unsigned threads)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mass mass = EBPO_MASS_INIT;
    ebpo_file *file = file_of(mesh, EBPO_PART_PLANES | EBPO_PART_MESH);
    ck_assert_msg(ebpo_measure(file, threads, &mass, &error) == EBPO_OK, "%s", error.message);
    ck_assert(same(mass.area, ldexp(mass.scaled_area, 2 * (int)mass.exponent)));
    ck_assert(same(mass.volume, ldexp(mass.scaled_volume, 3 * (int)mass.exponent)));
    ck_assert(same(mass.integral, ldexp(mass.scaled_integral, 3 * (int)mass.exponent)));
    ck_assert(isnan(mass.volume)
                  ? mass.volume_lo < mass.volume_hi
                  : same(mass.volume_lo, mass.volume) && same(mass.volume_hi, mass.volume));
    for (int k = 0; k < 9; k++)
        ck_assert(same(mass.inertia[k / 3][k % 3],
                       ldexp(mass.scaled_inertia[k / 3][k % 3], 5 * (int)mass.exponent)));
    ck_assert(isfinite(mass.scaled_area) && (mass.volume == 0 || mass.scaled_volume != 0));
    ebpo_close(file);
    return mass;
}

static ebpo_mass mass_of(const ebpo_mesh *mesh) { return mass_on(mesh, 0); }

static void assert_near(double value, double expected, double size, const char *what)
{
    ck_assert_msg(fabs(value - expected) <= 1e-13 * size, "%s: %.17g, expected %.17g", what, value,
                  expected);
}

/* `reach`: size of the model, for centroids near 0. */
static void assert_masses_near(const ebpo_mass *m, const ebpo_mass *expected, double reach)
{
    double trace = fabs(expected->inertia[0][0]) + fabs(expected->inertia[1][1]) +
                   fabs(expected->inertia[2][2]);
    assert_near(m->area, expected->area, expected->area, "area");
    assert_near(m->volume, expected->volume, fabs(expected->volume), "volume");
    for (int k = 0; k < 3; k++) {
        assert_near(m->centroid[k], expected->centroid[k], fmax(reach, fabs(expected->centroid[k])),
                    "centroid");
        for (int l = 0; l < 3; l++)
            assert_near(m->inertia[k][l], expected->inertia[k][l], trace, "inertia");
    }
}

/* --- the reference implementation: exact moments about the origin, then moved to the centroid ---
 */

typedef struct exact_moments {
    mpq_t volume, first[3], second[3][3];
    mpf_t area;
} exact_moments;

static void exact_init(exact_moments *m)
{
    mpq_init(m->volume);
    mpf_init2(m->area, 512);
    for (int k = 0; k < 3; k++) {
        mpq_init(m->first[k]);
        for (int l = 0; l < 3; l++)
            mpq_init(m->second[k][l]);
    }
}

static void exact_clear(exact_moments *m)
{
    mpq_clear(m->volume);
    mpf_clear(m->area);
    for (int k = 0; k < 3; k++) {
        mpq_clear(m->first[k]);
        for (int l = 0; l < 3; l++)
            mpq_clear(m->second[k][l]);
    }
}

static void cross(mpq_t out[3], mpq_t a[3], mpq_t b[3])
{
    mpq_t product;
    mpq_init(product);
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        mpq_mul(out[k], a[u], b[v]);
        mpq_mul(product, a[v], b[u]);
        mpq_sub(out[k], out[k], product);
    }
    mpq_clear(product);
}

static void dot(mpq_t out, mpq_t a[3], mpq_t b[3])
{
    mpq_t product;
    mpq_init(product);
    mpq_set_ui(out, 0, 1);
    for (int k = 0; k < 3; k++) {
        mpq_mul(product, a[k], b[k]);
        mpq_add(out, out, product);
    }
    mpq_clear(product);
}

static void add_area(exact_moments *m, mpq_t p[3][3])
{
    mpq_t f[3], g[3], n[3], square;
    mpf_t root;
    mpq_init(square);
    mpf_init2(root, 512);
    for (int k = 0; k < 3; k++) {
        mpq_inits(f[k], g[k], n[k], NULL);
        mpq_sub(f[k], p[1][k], p[0][k]);
        mpq_sub(g[k], p[2][k], p[0][k]);
    }
    cross(n, f, g);
    dot(square, n, n);
    mpf_set_q(root, square);
    mpf_sqrt(root, root);
    mpf_div_2exp(root, root, 1);
    mpf_add(m->area, m->area, root);
    for (int k = 0; k < 3; k++)
        mpq_clears(f[k], g[k], n[k], NULL);
    mpq_clear(square);
    mpf_clear(root);
}

/* Adds the tetrahedron of the origin and a face. Over its affine parameters, the integral of x y
 * is det / 120 times the sum of a_x b_y over all pairs of corners, where equal pairs count twice.
 * The function computes this sum. */
static void add_tetrahedron(exact_moments *m, mpq_t p[3][3])
{
    mpq_t n[3], det, term, share;
    mpq_inits(n[0], n[1], n[2], det, term, share, NULL);
    cross(n, p[1], p[2]);
    dot(det, p[0], n);
    mpq_set_ui(share, 1, 6);
    mpq_mul(term, det, share);
    mpq_add(m->volume, m->volume, term);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++) {
            mpq_set_ui(share, 1, 24);
            mpq_mul(term, det, p[i][k]);
            mpq_mul(term, term, share);
            mpq_add(m->first[k], m->first[k], term);
            for (int l = 0; l < 3; l++)
                for (int j = 0; j < 3; j++) {
                    mpq_set_ui(share, i == j ? 2 : 1, 120);
                    mpq_canonicalize(share);
                    mpq_mul(term, p[i][k], p[j][l]);
                    mpq_mul(term, term, det);
                    mpq_mul(term, term, share);
                    mpq_add(m->second[k][l], m->second[k][l], term);
                }
        }
    mpq_clears(n[0], n[1], n[2], det, term, share, NULL);
}

static void move_to_centroid(exact_moments *m, ebpo_mass *out)
{
    mpq_t moved[3][3], trace;
    mpq_init(trace);
    for (int k = 0; k < 3; k++)
        for (int l = 0; l < 3; l++) {
            mpq_init(moved[k][l]);
            mpq_mul(moved[k][l], m->first[k], m->first[l]);
            mpq_div(moved[k][l], moved[k][l], m->volume);
            mpq_sub(moved[k][l], m->second[k][l], moved[k][l]);
        }
    for (int k = 0; k < 3; k++)
        mpq_add(trace, trace, moved[k][k]);
    for (int k = 0; k < 3; k++) {
        mpq_div(m->first[k], m->first[k], m->volume);
        out->centroid[k] = mpq_get_d(m->first[k]);
        for (int l = 0; l < 3; l++) {
            mpq_neg(moved[k][l], moved[k][l]);
            if (k == l)
                mpq_add(moved[k][l], moved[k][l], trace);
            out->inertia[k][l] = mpq_get_d(moved[k][l]);
            mpq_clear(moved[k][l]);
        }
    }
    mpq_clear(trace);
}

static ebpo_mass reference_of(const ebpo_mesh *mesh)
{
    exact_moments m;
    ebpo_mass out = EBPO_MASS_INIT;
    mpq_t p[3][3];
    exact_init(&m);
    for (int i = 0; i < 9; i++)
        mpq_init(p[i / 3][i % 3]);
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        for (int i = 0; i < 3; i++) {
            double at[3];
            ebpo_test_point(mesh, mesh->faces[3 * f + (uint64_t)i], at);
            for (int k = 0; k < 3; k++)
                mpq_set_d(p[i][k], at[k]);
        }
        add_area(&m, p);
        add_tetrahedron(&m, p);
    }
    out.area = mpf_get_d(m.area);
    out.volume = mpq_get_d(m.volume);
    move_to_centroid(&m, &out);
    for (int i = 0; i < 9; i++)
        mpq_clear(p[i / 3][i % 3]);
    exact_clear(&m);
    return out;
}

/* --- tools --- */

static ebpo_mass box_mass(const double low[3], const double high[3])
{
    double s[3];
    ebpo_mass m = EBPO_MASS_INIT;
    for (int k = 0; k < 3; k++)
        s[k] = high[k] - low[k];
    m.volume = s[0] * s[1] * s[2];
    m.area = 2 * (s[0] * s[1] + s[1] * s[2] + s[2] * s[0]);
    for (int k = 0; k < 3; k++) {
        double u = s[(k + 1) % 3], v = s[(k + 2) % 3];
        m.centroid[k] = low[k] + s[k] / 2;
        m.inertia[k][k] = m.volume / 12 * (u * u + v * v);
    }
    return m;
}

static void scale_mesh(ebpo_mesh *mesh, int exponent)
{
    for (uint64_t i = 0; i < 3 * mesh->vertex_count; i++)
        mesh->xyz64[i] = ldexp(mesh->xyz64[i], exponent);
}

static void move_mesh(ebpo_mesh *mesh, double by)
{
    for (uint64_t i = 0; i < 3 * mesh->vertex_count; i++)
        mesh->xyz64[i] += by;
}

/* --- tests --- */

START_TEST(test_mass_of_boxes)
{
    static const double corners[][2][3] = { { { 0, 0, 0 }, { 1, 1, 1 } },
                                            { { -1, 2, 3 }, { 4, 2.5, 11 } },
                                            { { 1e6, -1e6, 5 }, { 1e6 + 1, -1e6 + 2, 5.25 } } };
    for (size_t i = 0; i < sizeof corners / sizeof *corners; i++) {
        ebpo_mesh mesh = ebpo_test_box(corners[i][0], corners[i][1], 3);
        ebpo_mass m = mass_of(&mesh), expected = box_mass(corners[i][0], corners[i][1]);
        assert_masses_near(&m, &expected, 1);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

/* Corners 0, (3, 0, 0), (0, 3, 0), (0, 0, 3): volume 27 / 6, second moments s^5 / 60 and s^5 / 120
 * about the corner. */
START_TEST(test_mass_of_tetrahedron)
{
    ebpo_mesh mesh = { .xyz64 = calloc(1, 1), .faces = calloc(1, 1) };
    ebpo_test_append_vertex(&mesh, 0, 0, 0);
    ebpo_test_append_vertex(&mesh, 3, 0, 0);
    ebpo_test_append_vertex(&mesh, 0, 3, 0);
    ebpo_test_append_vertex(&mesh, 0, 0, 3);
    ebpo_test_append_face(&mesh, 0, 2, 1);
    ebpo_test_append_face(&mesh, 0, 1, 3);
    ebpo_test_append_face(&mesh, 0, 3, 2);
    ebpo_test_append_face(&mesh, 1, 2, 3);
    double v = 4.5, c = .75, xx = 243 / 60. - v * c * c, xy = 243 / 120. - v * c * c;
    ebpo_mass expected = { .struct_size = sizeof(ebpo_mass),
                           .area = 13.5 + 4.5 * sqrt(3),
                           .volume = v,
                           .centroid = { c, c, c },
                           .inertia = { { 2 * xx, -xy, -xy },
                                        { -xy, 2 * xx, -xy },
                                        { -xy, -xy, 2 * xx } } },
              m = mass_of(&mesh);
    assert_masses_near(&m, &expected, 3);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_mass_matches_exact_integrals)
{
    for (int i = 0; i < ebpo_test_solid_count; i++) {
        if (!ebpo_test_solids[i].balanced)
            continue;
        ebpo_mesh mesh = ebpo_test_solids[i].make();
        if (mesh.face_count && mesh.face_count <= 6000) {
            ebpo_mass m = mass_of(&mesh), expected = reference_of(&mesh);
            assert_near(m.integral, expected.volume, fabs(expected.volume), "integral");
            if (isnan(m.volume)) /* the following values use the winding number as a density */
                m.volume = m.integral;
            if (same(m.volume, m.integral) && m.volume != 0)
                assert_masses_near(&m, &expected, 1);
            else if (m.volume == 0)
                ck_assert_msg(expected.volume == 0 || isnan(expected.volume), "%s",
                              ebpo_test_solids[i].name);
        }
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

START_TEST(test_mass_of_distant_spheres)
{
    const double centre[3] = { .125, -.5, 3 };
    ebpo_mesh mesh = ebpo_test_sphere(centre, 1, 3);
    for (int far = 0; far < 2; far++) {
        move_mesh(&mesh, far ? 1e7 : 0);
        ebpo_mass m = mass_of(&mesh), expected = reference_of(&mesh);
        assert_masses_near(&m, &expected, 1);
    }
    ebpo_mesh_free(&mesh);
}
END_TEST

/* Uses a thin plate that is slanted to the axes. Volumes measured from far away cancel almost
 * completely. */
START_TEST(test_mass_of_thin_plates)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1000, 1000, 0x1p-30 };
    const double turn[3][3] = { { .8, -.36, .48 }, { .6, .48, -.64 }, { 0, .8, .6 } },
                 offset[3] = { 3, 4, 5 };
    ebpo_mesh mesh = ebpo_test_box(low, high, 4);
    ebpo_test_transform(&mesh, turn, offset);
    ebpo_mass m = mass_of(&mesh), expected = reference_of(&mesh);
    assert_masses_near(&m, &expected, 1);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_mass_scales_by_powers_of_two)
{
    ebpo_mesh mesh = ebpo_test_torus(2, .75, 31, 17);
    ebpo_mass m = mass_of(&mesh);
    static const int exponents[] = { 1, -1, 30, -30, 100, -100, 120, -150 };
    for (size_t i = 0; i < sizeof exponents / sizeof *exponents; i++) {
        int e = exponents[i];
        scale_mesh(&mesh, e);
        ebpo_mass scaled = mass_of(&mesh);
        scale_mesh(&mesh, -e);
        ck_assert(scaled.area == ldexp(m.area, 2 * e) && scaled.volume == ldexp(m.volume, 3 * e));
        for (int k = 0; k < 3; k++) {
            ck_assert(scaled.centroid[k] == ldexp(m.centroid[k], e));
            for (int l = 0; l < 3; l++)
                ck_assert(scaled.inertia[k][l] == ldexp(m.inertia[k][l], 5 * e));
        }
    }
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_mass_overflow_and_underflow)
{
    static const double sizes[] = { 1e100, 1e-100, 1e120, 1e-120, 1e160, 1e-160 };
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        const double s = sizes[i], low[3] = { -s, s, 0 }, high[3] = { 2 * s, 2 * s, s };
        ebpo_mesh mesh = ebpo_test_box(low, high, 1);
        ebpo_mass m = mass_of(&mesh);
        double area = 14 * s * s, volume = 3 * s * s * s;
        ck_assert_msg(area < 1e-300 || area > 1e300 ? m.area == area
                                                    : fabs(m.area / area - 1) < 1e-13,
                      "size %g: area %g", s, m.area);
        ck_assert_msg(volume < 1e-300 || volume > 1e308 ? m.volume == volume
                                                        : fabs(m.volume / volume - 1) < 1e-13,
                      "size %g: volume %g", s, m.volume);
        for (int k = 0; k < 3; k++) {
            ck_assert(fabs(m.centroid[k] / (k ? (k == 1 ? 1.5 : .5) * s : .5 * s) - 1) < 1e-13);
            for (int l = 0; l < 3; l++)
                ck_assert_msg(!isnan(m.inertia[k][l]), "size %g: inertia", s);
            ck_assert(s > 1 ? m.inertia[k][k] == INFINITY : m.inertia[k][k] == 0);
        }
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

START_TEST(test_mass_of_nested_shells)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 8, 8, 8 }, low_hole[3] = { 1, 2, 3 },
                 high_hole[3] = { 4, 6, 5 };
    ebpo_mesh mesh = ebpo_test_box(low, high, 2), hole = ebpo_test_box(low_hole, high_hole, 1);
    ebpo_test_reverse(&hole);
    ebpo_test_append(&mesh, &hole);
    ebpo_mass m = mass_of(&mesh), expected = reference_of(&mesh), outer = box_mass(low, high),
              inner = box_mass(low_hole, high_hole);
    assert_masses_near(&m, &expected, 8);
    assert_near(m.volume, outer.volume - inner.volume, outer.volume, "volume");
    assert_near(m.area, outer.area + inner.area, outer.area, "area");
    for (int k = 0; k < 3; k++)
        assert_near(m.centroid[k],
                    (outer.volume * outer.centroid[k] - inner.volume * inner.centroid[k]) /
                        m.volume,
                    8, "centroid");
    ebpo_mesh_free(&hole);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* Returns the mass of the cube from 0 to 4 that contains one from 1 to 2, each reversed or not. */
static ebpo_mass mass_of_two(bool turn_outer, bool turn_inner, ebpo_rule rule)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 4, 4, 4 }, low_in[3] = { 1, 1, 1 },
                        high_in[3] = { 2, 2, 2 };
    ebpo_mesh mesh = ebpo_test_box(low, high, 2), inner = ebpo_test_box(low_in, high_in, 1);
    if (turn_outer)
        ebpo_test_reverse(&mesh);
    if (turn_inner)
        ebpo_test_reverse(&inner);
    ebpo_test_append(&mesh, &inner);
    file_rule = rule;
    ebpo_mass m = mass_of(&mesh);
    file_rule = EBPO_RULE_NONZERO;
    ebpo_mesh_free(&inner);
    ebpo_mesh_free(&mesh);
    return m;
}

/* Tests outer and inner cubes, original or reversed, with each rule. The winding numbers are 1, 2;
 * 1, 0; -1, 0; -1, -2. */
START_TEST(test_mass_follows_inside_rule)
{
    static const double volumes[4][3] = {
        { 64, 63, 64 }, { 63, 63, 63 }, { 63, 63, 0 }, { 64, 63, 0 }
    };
    static const double integrals[4] = { 65, 63, -63, -65 };
    for (int i = 0; i < 4; i++)
        for (int rule = 0; rule < 3; rule++) {
            double volume = volumes[i][rule];
            ebpo_mass m = mass_of_two(i >= 2, i == 1 || i == 3, (ebpo_rule)rule);
            assert_near(m.volume, volume, 64, "volume");
            assert_near(m.integral, integrals[i], 64, "integral");
            for (int k = 0; k < 3; k++) /* the inner cube's middle is at 1.5 */
                assert_near(m.centroid[k],
                            volume == 0    ? 0
                            : volume == 63 ? (64 * 2 - 1.5) / 63
                                           : 2,
                            4, "centroid");
            ck_assert(volume == 0 ? m.inertia[0][0] == 0 : m.inertia[0][0] > 0);
        }
}
END_TEST

START_TEST(test_volume_of_inverted_solids)
{
    ebpo_mesh mesh = ebpo_test_make("inside_out_cube");
    ebpo_mass m = mass_of(&mesh);
    ck_assert(m.area > 0 && m.integral < 0 && m.inertia[0][0] > 0);
    assert_near(m.volume, -m.integral, 1, "volume");
    ebpo_mesh_free(&mesh);
}
END_TEST

/* A surface whose holes are single triangles has the mass of the closed mesh: its caps are these
 * triangles, and flat, so that no volume depends on them. */
START_TEST(test_mass_of_surface_with_caps)
{
    const double centre[3] = { .125, -.5, 3 };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mass m = EBPO_MASS_INIT;
    ebpo_mesh mesh = ebpo_test_sphere(centre, 1, 3);
    ebpo_mass expected = reference_of(&mesh);
    for (uint64_t i = 0; i < 5; i++) { /* 200 apart: they share no vertices */
        uint64_t last = --mesh.face_count, at = 200 * i;
        memmove(mesh.faces + 3 * at, mesh.faces + 3 * last, 3 * sizeof *mesh.faces);
    }
    ebpo_file *file = file_of(&mesh, EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_BORDER);
    ck_assert_uint_eq(ebpo_file_info(file)->border_points, 15);
    ck_assert_msg(ebpo_measure(file, 0, &m, &error) == EBPO_OK, "%s", error.message);
    expected.area = reference_of(&mesh).area;
    assert_masses_near(&m, &expected, 1);
    ck_assert(m.integral_error > 0 && m.integral_error < 1e-14);
    ck_assert(fabs(m.integral - expected.volume) <= m.integral_error + 1e-16);
    ck_assert(m.centroid_error > 0 && m.centroid_error < 1e-13);
    for (int k = 0; k < 3; k++)
        ck_assert(fabs(m.centroid[k] - expected.centroid[k]) <= m.centroid_error + 1e-15);
    ck_assert(m.caps_integral > 0 && m.caps_integral < 1e-12 && m.caps_centroid < 1e-12);
    ck_assert(m.volume_lo < m.volume && m.volume < m.volume_hi);
    ebpo_close(file);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* A cylinder whose open end is a wave: its volume with any fan at the end is within the bound of
 * what depends on caps, and this bound is at most that of the wave's box. */
START_TEST(test_mass_depends_on_caps)
{
    enum { SIDES = 24 };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mass m = EBPO_MASS_INIT;
    ebpo_mesh mesh = { .xyz64 = calloc(1, 1), .faces = calloc(1, 1) };
    for (uint32_t i = 0; i < 2 * SIDES; i++) {
        double x, y;
        ebpo_test_circle(i % SIDES, SIDES, &x, &y);
        ebpo_test_append_vertex(&mesh, x, y, i < SIDES ? 0 : 2 + .25 * (i % 3) + .1 * x * y);
    }
    for (uint32_t i = 0; i < SIDES; i++) {
        uint32_t j = (i + 1) % SIDES;
        ebpo_test_append_face(&mesh, i, j, SIDES + j);
        ebpo_test_append_face(&mesh, i, SIDES + j, SIDES + i);
        if (i > 0 && j > 0)
            ebpo_test_append_face(&mesh, 0, j, i);
    }
    ebpo_file *file = file_of(&mesh, EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_BORDER);
    ck_assert_msg(ebpo_measure(file, 0, &m, &error) == EBPO_OK, "%s", error.message);
    ck_assert(m.caps_integral > 0 && m.caps_integral < 4 * .75);
    double least = INFINITY, most = 0, moved = 0;
    for (uint32_t first = 0; first < SIDES; first++) {
        ebpo_mesh closed = copy_of(&mesh);
        for (uint32_t i = 1; i + 1 < SIDES; i++)
            ebpo_test_append_face(&closed, SIDES + first, SIDES + (first + i) % SIDES,
                                  SIDES + (first + i + 1) % SIDES);
        ebpo_mass other = reference_of(&closed);
        ck_assert(fabs(other.volume - m.integral) <= m.caps_integral);
        ck_assert(m.volume_lo <= other.volume && other.volume <= m.volume_hi);
        double d[3];
        for (int k = 0; k < 3; k++)
            d[k] = other.centroid[k] - m.centroid[k];
        moved = fmax(moved, sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
        least = fmin(least, other.volume);
        most = fmax(most, other.volume);
        ebpo_mesh_free(&closed);
    }
    ck_assert(most - least > .01 && moved > 0 && moved <= m.caps_centroid);
    ebpo_close(file);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_surface_mass_has_area_only)
{
    ebpo_mesh mesh = ebpo_test_sheet(3, 4);
    ebpo_mass m = mass_of(&mesh), none = EBPO_MASS_INIT;
    assert_near(m.area, 9, 9, "area");
    none.area = m.area;
    none.scaled_area = m.scaled_area;
    none.exponent = m.exponent;
    ck_assert_mem_eq(&m, &none, sizeof m);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* The two sides of a sheet are a solid of volume 0, also where rounding would give another volume.
 */
START_TEST(test_zero_volume_solid_has_no_centroid)
{
    ebpo_mesh mesh = ebpo_test_sheet(.7, 5), back = ebpo_test_sheet(.7, 5);
    const double turn[3][3] = { { .3, -.7, .2 }, { .1, .45, -.64 }, { .9, .8, .6 } },
                 offset[3] = { 3.3, 4.1, 5.7 };
    ebpo_test_reverse(&back);
    ebpo_test_append(&mesh, &back);
    ebpo_test_transform(&mesh, turn, offset);
    ebpo_mass m = mass_of(&mesh);
    ck_assert(m.area > 0 && m.volume == 0 && m.centroid[0] == 0 && m.inertia[0][0] == 0);
    ebpo_mesh_free(&mesh);
    ebpo_mesh_free(&back);
}
END_TEST

START_TEST(test_volume_with_unknown_rule_is_refused)
{
    static const int rules[] = { 3, 1 << 20, -1 };
    ebpo_mesh_report report = { .balanced = true, .manifold = true, .components = 2, .volume = 1 };
    ebpo_shells shells = EBPO_SHELLS_INIT;
    ebpo_solid_volume v = EBPO_SOLID_VOLUME_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    shells.apart = 1;
    shells.volume_difference[EBPO_RULE_POSITIVE] = 2;
    ck_assert(ebpo_solid_volume_of(&report, EBPO_RULE_POSITIVE, &shells, NULL, &v, NULL) == 0);
    ck_assert(v.lo == 3 && v.hi == 3);
    for (int i = 0; i < 3; i++) {
        ck_assert(ebpo_solid_volume_of(&report, (ebpo_rule)rules[i], &shells, NULL, &v, &error) ==
                  EBPO_E_ARGUMENT);
        ck_assert(strstr(error.message, "unknown winding rule") != NULL);
    }
}
END_TEST

START_TEST(test_mass_same_for_any_threads)
{
    ebpo_mesh mesh = ebpo_test_torus(2, 1, 300, 100);
    ebpo_mass one = mass_on(&mesh, 1), many = mass_on(&mesh, 7);
    ck_assert_mem_eq(&one, &many, sizeof one);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_mass_without_mesh_is_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mass m = EBPO_MASS_INIT;
    ebpo_mesh mesh = ebpo_test_make("cube");
    ebpo_file *file = file_of(&mesh, EBPO_PART_PLANES);
    ck_assert_int_eq(ebpo_measure(file, 0, &m, &error), EBPO_E_ABSENT);
    ck_assert(error.message[0] != 0);
    ebpo_close(file);
    ebpo_mesh_free(&mesh);
}
END_TEST

TEST_SUITE(measure)
{
    Suite *suite = suite_create("measure");
    TCase *tests = tcase_create("mass");
    tcase_set_timeout(tests, 300);
    tcase_add_checked_fixture(tests, make_folder, scratch_leave);
    tcase_add_test(tests, test_mass_of_boxes);
    tcase_add_test(tests, test_mass_of_tetrahedron);
    tcase_add_test(tests, test_mass_matches_exact_integrals);
    tcase_add_test(tests, test_mass_of_distant_spheres);
    tcase_add_test(tests, test_mass_of_thin_plates);
    tcase_add_test(tests, test_mass_scales_by_powers_of_two);
    tcase_add_test(tests, test_mass_overflow_and_underflow);
    tcase_add_test(tests, test_mass_of_nested_shells);
    tcase_add_test(tests, test_volume_of_inverted_solids);
    tcase_add_test(tests, test_mass_follows_inside_rule);
    tcase_add_test(tests, test_mass_of_surface_with_caps);
    tcase_add_test(tests, test_mass_depends_on_caps);
    tcase_add_test(tests, test_surface_mass_has_area_only);
    tcase_add_test(tests, test_zero_volume_solid_has_no_centroid);
    tcase_add_test(tests, test_mass_same_for_any_threads);
    tcase_add_test(tests, test_volume_with_unknown_rule_is_refused);
    tcase_add_test(tests, test_mass_without_mesh_is_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
