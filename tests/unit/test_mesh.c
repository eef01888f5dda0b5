/* Checking and repairing meshes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/mesh.h>
#include <ebpo/repair.h>

#include "check_main.h"
#include "solids.h"

static const ebpo_progress silent = { NULL, NULL };

static ebpo_mesh_report check_with(const ebpo_mesh *mesh, unsigned threads)
{
    ebpo_mesh_report report;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_mesh_check(mesh, threads, silent, &report, &error);
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    return report;
}

static ebpo_mesh_report check(const ebpo_mesh *mesh) { return check_with(mesh, 2); }

static ebpo_mesh_report check_named(const char *name)
{
    ebpo_mesh mesh = ebpo_test_make(name);
    ebpo_mesh_report report = check(&mesh);
    ebpo_mesh_free(&mesh);
    return report;
}

static ebpo_repair_record repair_record(ebpo_mesh *mesh,
                                        ebpo_status (*how)(ebpo_mesh *, ebpo_repair_record *,
                                                           ebpo_error *))
{
    ebpo_repair_record record;
    ebpo_error error = EBPO_ERROR_INIT;
    memset(&record, 0, sizeof record);
    ebpo_status status = how(mesh, &record, &error);
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    return record;
}

/* The check sets the padding of the struct to zero, so that bytes can be compared. */
static bool same_report(const ebpo_mesh_report *a, const ebpo_mesh_report *b)
{
    return memcmp(a, b, sizeof *a) == 0;
}

START_TEST(test_solids_have_expected_properties)
{
    const ebpo_test_solid *solid = &ebpo_test_solids[_i];
    ebpo_mesh mesh = solid->make();
    ebpo_mesh_report r = check(&mesh);
    ck_assert_msg(r.balanced == solid->balanced, "%s: balanced is %d", solid->name, r.balanced);
    ck_assert_msg(r.manifold == solid->manifold, "%s: manifold is %d", solid->name, r.manifold);
    if (!isnan(solid->volume))
        ck_assert_msg(fabs(r.volume - solid->volume) <= 1e-13 * fabs(solid->volume),
                      "%s: volume %.17g, expected %.17g", solid->name, r.volume, solid->volume);
    else
        ck_assert_msg(r.volume > 0, "%s: volume %g", solid->name, r.volume);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_mesh_report_same_for_any_threads)
{
    ebpo_mesh mesh = ebpo_test_torus(2, 0.7, 300, 200);
    ebpo_mesh sheet = ebpo_test_sheet(1, 150);
    ebpo_test_append(&mesh, &sheet);
    ebpo_test_shuffle(&mesh, 5);
    ebpo_mesh_report one = check_with(&mesh, 1), many = check_with(&mesh, 7);
    ck_assert(same_report(&one, &many));
    ck_assert_uint_eq(one.components, 2);
    ck_assert_uint_eq(one.boundary_edges.count, 600);
    ck_assert_uint_eq(one.boundary_loops, 1);
    ebpo_mesh_free(&mesh);
    ebpo_mesh_free(&sheet);
}
END_TEST

START_TEST(test_mesh_cube_is_measured_exactly)
{
    ebpo_mesh_report r = check_named("cube_in_cell_walls");
    ck_assert_uint_eq(r.edges, 3 * 768 / 2);
    ck_assert_uint_eq(r.components, 1);
    ck_assert(r.genus_known && r.genus == 0);
    ck_assert_double_eq(r.area, 384);
    ck_assert_double_eq(r.min[0], -4);
    ck_assert_double_eq(r.max[2], 4);
    /* each square contributes two sides and a diagonal */
    ck_assert_double_eq_tol(r.mean_edge, (2 + sqrt(2)) / 3, 1e-15);
}
END_TEST

START_TEST(test_genus_is_summed_over_components)
{
    ebpo_mesh mesh = ebpo_test_torus(2, 0.5, 12, 8), other = ebpo_test_torus(2, 0.5, 9, 7);
    ebpo_mesh ball = ebpo_test_sphere((double[3]){ 9, 0, 0 }, 1, 1);
    ebpo_test_append(&mesh, &other);
    ebpo_test_append(&mesh, &ball);
    ebpo_mesh_report r = check(&mesh);
    ck_assert_uint_eq(r.components, 3);
    ck_assert(r.genus_known);
    ck_assert_int_eq(r.genus, 2);
    ebpo_mesh_free(&mesh);
    ebpo_mesh_free(&other);
    ebpo_mesh_free(&ball);
}
END_TEST

START_TEST(test_edges_of_four_faces_are_reported)
{
    ebpo_mesh_report r = check_named("touching_at_edge");
    ck_assert_uint_eq(r.nonmanifold_edges.count, 1);
    ck_assert_uint_eq(r.unbalanced_edges.count, 0);
    ck_assert_uint_eq(r.bowtie_vertices.count, 2); /* a fan ends at an edge of four faces */
    ck_assert_uint_eq(r.components, 1);
    ck_assert(!r.genus_known);
}
END_TEST

START_TEST(test_bowtie_vertex_is_reported)
{
    ebpo_mesh_report r = check_named("touching_at_vertex");
    ck_assert_uint_eq(r.bowtie_vertices.count, 1);
    ck_assert_uint_eq(r.nonmanifold_edges.count, 0);
    ck_assert_uint_eq(r.components, 1);
}
END_TEST

START_TEST(test_repeated_faces_in_any_rotation)
{
    ebpo_mesh_report r = check_named("repeated_faces");
    ck_assert_uint_eq(r.repeated_faces.count, 2);
    ck_assert_uint_eq(r.repeated_faces.locations[0], 12);
    ck_assert_uint_eq(r.repeated_faces.locations[1], 13);
    ck_assert_uint_eq(r.nonmanifold_edges.count, 3);
    ck_assert_uint_eq(r.nonmanifold_edges.locations[0], 0);
}
END_TEST

START_TEST(test_coincident_opposite_faces_are_repeated)
{
    ebpo_mesh_report r = check_named("coincident_opposite_faces");
    ck_assert_uint_eq(r.repeated_faces.count + r.nonmanifold_edges.count > 0, 1);
    r = check_named("touching_at_face");
    ck_assert_uint_eq(r.repeated_positions.count, 4);
    ck_assert_uint_eq(r.components, 2);
}
END_TEST

START_TEST(test_zero_area_faces_are_found_exactly)
{
    ebpo_mesh_report r = check_named("zero_area_face");
    ck_assert_uint_eq(r.zero_area_faces.count, 1);
    ck_assert_uint_eq(r.zero_area_faces.locations[0], 5);
    r = check_named("index_repeated_face");
    ck_assert_uint_eq(r.zero_area_faces.count, 1);
    ck_assert_uint_eq(r.index_repeated_faces.count, 1);
    ck_assert_uint_eq(r.index_repeated_faces.locations[0], 4);
    r = check_named("thin_wall");
    ck_assert_uint_eq(r.zero_area_faces.count, 0);
    /* Collinear to 1 part in 2^52, but not exactly. */
    ebpo_mesh mesh = ebpo_test_tetrahedron(1);
    double points[4][3] = { { 0, 0, 0 }, { 1, 1, 1 }, { 2, 2, 0x1.0000000000001p+1 }, { 3, 3, 3 } };
    memcpy(mesh.xyz64, points, sizeof points);
    r = check(&mesh);
    ck_assert_uint_eq(r.zero_area_faces.count, 1); /* 0, 1, 3 */
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_open_box_has_one_hole)
{
    ebpo_mesh_report r = check_named("open_box");
    ck_assert_uint_eq(r.boundary_edges.count, 4);
    ck_assert_uint_eq(r.unbalanced_edges.count, 4);
    ck_assert_uint_eq(r.boundary_loops, 1);
    ck_assert_uint_eq(r.misoriented_edges.count, 0);
    ck_assert_double_eq(r.volume, 0);
}
END_TEST

START_TEST(test_flipped_face_gives_misoriented_edges)
{
    ebpo_mesh_report r = check_named("flipped_face_cube");
    ck_assert_uint_eq(r.misoriented_edges.count, 3);
    ck_assert_uint_eq(r.boundary_edges.count, 0);
    ck_assert_uint_eq(r.unbalanced_edges.count, 3);
}
END_TEST

START_TEST(test_finding_indices_are_first_ascending)
{
    ebpo_mesh mesh = ebpo_test_tetrahedra(9);
    /* from the last one on, so that the order is not correct by chance */
    for (int i = 0; i < 6; i++)
        ebpo_test_turn_face(&mesh, (uint64_t)(34 - 5 * i));
    ebpo_mesh_report r = check(&mesh);
    ck_assert_uint_eq(r.misoriented_edges.count, 18);
    for (int i = 1; i < EBPO_FINDING_LOCATIONS; i++)
        ck_assert(r.misoriented_edges.locations[i - 1] <= r.misoriented_edges.locations[i]);
    /* face 9 is reversed, and face 8 shares an edge with face 9 */
    ck_assert_uint_eq(r.misoriented_edges.locations[0], 8);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_unreferenced_vertices_do_not_extend_box)
{
    ebpo_mesh mesh = ebpo_test_tetrahedron(1);
    ebpo_test_append_vertex(&mesh, 100, 0, 0);
    ebpo_mesh_report r = check(&mesh);
    ck_assert_uint_eq(r.unreferenced_vertices.count, 1);
    ck_assert_uint_eq(r.unreferenced_vertices.locations[0], 4);
    ck_assert_double_eq(r.max[0], 1);
    ck_assert(r.manifold && r.genus == 0);
    ebpo_mesh_free(&mesh);
}
END_TEST

static void expect_error(const ebpo_mesh *mesh, ebpo_status expected, const char *part)
{
    ebpo_mesh_report r;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_mesh_check(mesh, 2, silent, &r, &error), expected);
    ck_assert_msg(strstr(error.message, part) != NULL, "%s", error.message);
}

START_TEST(test_check_refuses_non_finite_coordinates)
{
    ebpo_mesh mesh = ebpo_test_tetrahedron(1);
    mesh.xyz64[3 * 2 + 1] = NAN;
    expect_error(&mesh, EBPO_E_FORMAT, "vertex 2 has y = nan");
    mesh.xyz64[3 * 1 + 2] = -INFINITY;
    expect_error(&mesh, EBPO_E_FORMAT, "vertex 1 has z = -inf");
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_check_and_repair_refuse_bad_index)
{
    ebpo_mesh mesh = ebpo_test_tetrahedron(1);
    ebpo_error error = EBPO_ERROR_INIT;
    mesh.faces[3 * 3 + 1] = 4;
    expect_error(&mesh, EBPO_E_FORMAT, "face 3 names vertex 4, but there are 4 vertices");
    ck_assert_int_eq(ebpo_mesh_weld(&mesh, NULL, &error), EBPO_E_FORMAT);
    ck_assert_int_eq(ebpo_mesh_orient(&mesh, NULL, &error), EBPO_E_FORMAT);
    ck_assert_int_eq(ebpo_mesh_fill_holes(&mesh, NULL, &error), EBPO_E_FORMAT);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_check_refuses_mesh_without_faces)
{
    ebpo_mesh mesh = ebpo_test_tetrahedron(1);
    mesh.face_count = 0;
    expect_error(&mesh, EBPO_E_FORMAT, "no faces");
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_weld_joins_split_vertices)
{
    ebpo_mesh mesh = ebpo_test_make("torus");
    uint64_t vertices = mesh.vertex_count;
    ebpo_test_split_vertices(&mesh);
    ebpo_mesh_report r = check(&mesh);
    ck_assert_uint_eq(r.components, mesh.face_count);
    ck_assert_uint_eq(r.boundary_loops, mesh.face_count);
    uint64_t split = mesh.vertex_count;
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_weld);
    ck_assert(record.weld);
    ck_assert_uint_eq(record.welded_vertices, split - vertices);
    ck_assert_uint_eq(mesh.vertex_count, vertices);
    r = check(&mesh);
    ck_assert(r.manifold && r.genus == 1);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_weld_joins_zero_and_minus_zero)
{
    ebpo_mesh mesh = ebpo_test_tetrahedron(1);
    ebpo_test_append_vertex(&mesh, -0.0, 0, 0);
    ebpo_test_append_vertex(&mesh, 5, 5, 5);
    ebpo_test_append_vertex(&mesh, 1, -0.0, 0);
    mesh.faces[0] = 4; /* the corner was 0 */
    ebpo_test_append_face(&mesh, 1, 6, 2);
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_weld);
    ck_assert_uint_eq(record.welded_vertices, 2);
    ck_assert_uint_eq(mesh.vertex_count, 5);
    ck_assert_uint_eq(mesh.faces[0], 0);
    ck_assert_double_eq(mesh.xyz64[3 * 4], 5);
    ck_assert(!signbit(mesh.xyz64[0]));
    ck_assert_uint_eq(mesh.faces[3 * 4], 1);
    ck_assert_uint_eq(mesh.faces[3 * 4 + 1], 1); /* a repeated index stays and is reported */
    ck_assert_uint_eq(check(&mesh).index_repeated_faces.count, 1);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_orient_restores_flipped_faces)
{
    ebpo_mesh mesh = ebpo_test_make("torus");
    ebpo_mesh_report before = check(&mesh);
    uint64_t state = 3;
    for (uint64_t f = 0; f < mesh.face_count; f++)
        if (ebpo_test_random(&state) & 1)
            ebpo_test_turn_face(&mesh, f);
    ck_assert(!check(&mesh).balanced);
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_orient);
    ck_assert(record.orient && record.flipped_faces > 0 && record.unorientable_components == 0);
    ebpo_mesh_report r = check(&mesh);
    ck_assert(r.manifold);
    ck_assert_double_eq_tol(r.volume, before.volume, 1e-12);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_orient_closed_component_by_volume)
{
    ebpo_mesh mesh = ebpo_test_make("inside_out_cube");
    ebpo_test_turn_face(&mesh, 4);
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_orient);
    ck_assert_uint_eq(record.flipped_faces, 11);
    ck_assert_double_eq_tol(check(&mesh).volume, 1, 1e-15);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_orient_flips_inverted_component)
{
    ebpo_mesh mesh = ebpo_test_make("inside_out_cube");
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_orient);
    ck_assert_uint_eq(record.flipped_faces, mesh.face_count);
    ck_assert_double_eq_tol(check(&mesh).volume, 1, 1e-15);
    record = repair_record(&mesh, ebpo_mesh_flip);
    ck_assert(!record.orient && record.flipped_faces == mesh.face_count);
    ck_assert_double_eq_tol(check(&mesh).volume, -1, 1e-15);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* Tests nested boxes in any order, each reversed or not. The second box contains two boxes side by
 * side. A further box extends through the outermost box, so that no box contains it. */
START_TEST(test_orient_outer_shells_and_cavities)
{
    static const double low[6][3] = { { 0, 0, 0 }, { 1, 1, 1 }, { 2, 2, 2 },
                                      { 6, 2, 2 }, { 3, 3, 3 }, { 9, 4.5, 4.5 } };
    static const double high[6][3] = { { 10, 10, 10 }, { 9, 9, 9 }, { 5, 5, 5 },
                                       { 8, 8, 8 },    { 4, 4, 4 }, { 12, 5.5, 5.5 } };
    uint64_t state = 8;
    double right = 1000 - 512 + 27 + 72 - 1 + 3;
    for (int round = 0; round < 64; round++) {
        ebpo_mesh mesh = { 0 };
        for (int i = 0; i < 6; i++) {
            ebpo_mesh box = ebpo_test_box(low[i], high[i], 2);
            if (round >> i & 1)
                ebpo_test_reverse(&box);
            if (i)
                ebpo_test_append(&mesh, &box);
            else
                mesh = box;
            if (i)
                ebpo_mesh_free(&box);
        }
        if (round % 3)
            ebpo_test_shuffle(&mesh, ebpo_test_random(&state));
        repair_record(&mesh, ebpo_mesh_orient);
        ck_assert_double_eq_tol(check(&mesh).volume, right, 1e-9);
        ck_assert_uint_eq(repair_record(&mesh, ebpo_mesh_orient).flipped_faces, 0);
        ebpo_shells s = EBPO_SHELLS_INIT;
        ebpo_error error = EBPO_ERROR_INIT;
        ck_assert(ebpo_mesh_count_shells(&mesh, 2, (ebpo_progress){ NULL, NULL }, &s, &error) ==
                  EBPO_OK);
        ck_assert(s.closed == 6 && s.cavities == 2 && s.inside_out == 0 && s.nested == 0);
        repair_record(&mesh, ebpo_mesh_flip);
        ck_assert(ebpo_mesh_count_shells(&mesh, 0, (ebpo_progress){ NULL, NULL }, &s, &error) ==
                  EBPO_OK);
        ck_assert(s.closed == 6 && s.cavities == 0 && s.inside_out == 4 && s.nested == 2);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

START_TEST(test_orient_keeps_consistent_components)
{
    ebpo_mesh mesh = ebpo_test_make("cavity");
    ebpo_mesh_report before = check(&mesh);
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_orient);
    ck_assert_uint_eq(record.flipped_faces, 0);
    ebpo_mesh_report after = check(&mesh);
    ck_assert(same_report(&before, &after));
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_orient_open_surface_by_majority)
{
    ebpo_mesh mesh = ebpo_test_sheet(1, 4);
    ebpo_test_turn_face(&mesh, 0); /* the first face of the traversal is in the minority */
    ebpo_test_turn_face(&mesh, 9);
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_orient);
    ck_assert_uint_eq(record.flipped_faces, 2);
    ck_assert_uint_eq(check(&mesh).misoriented_edges.count, 0);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_orient_keeps_mobius_strip)
{
    ebpo_mesh mesh = ebpo_test_make("mobius");
    ck_assert_uint_gt(check(&mesh).misoriented_edges.count, 0);
    size_t size = mesh.face_count * 3 * sizeof *mesh.faces;
    uint32_t *faces = malloc(size);
    ck_assert_ptr_nonnull(faces);
    memcpy(faces, mesh.faces, size);
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_orient);
    ck_assert_uint_eq(record.unorientable_components, 1);
    ck_assert_uint_eq(record.flipped_faces, 0);
    ck_assert(memcmp(faces, mesh.faces, size) == 0);
    free(faces);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_fill_closes_open_box)
{
    ebpo_mesh mesh = ebpo_test_make("open_box");
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_fill_holes);
    ck_assert(record.fill_holes);
    ck_assert_uint_eq(record.filled_holes, 1);
    ck_assert_uint_eq(record.added_faces, 2);
    ck_assert_uint_eq(record.unfilled_holes, 0);
    ebpo_mesh_report r = check(&mesh);
    ck_assert(r.manifold);
    ck_assert_double_eq_tol(r.volume, 1, 1e-15);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* Fills a cylinder without lids whose rim has n edges. Lids have the least area up to 256 edges;
 * larger lids are made by cutting ears. */
START_TEST(test_fill_closes_both_tube_ends)
{
    static const uint32_t sizes[] = { 3, 4, 20, 256, 257, 3000 };
    uint32_t n = sizes[_i];
    ebpo_mesh mesh = ebpo_test_band(n, false);
    /* area of the polygon of radius 2; the tube is 1 high */
    double area = n / 2.0 * sin(2 * acos(-1) / n) * 4;
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_fill_holes);
    ck_assert_uint_eq(record.filled_holes, 2);
    ck_assert_uint_eq(record.added_faces, 2 * (n - 2));
    ebpo_mesh_report r = check(&mesh);
    ck_assert(r.balanced && r.manifold && r.genus == 0);
    ck_assert_double_eq_tol(fabs(r.volume), area, 1e-9 * area);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_fill_closes_holes_sharing_vertex)
{
    ebpo_mesh mesh = ebpo_test_box((double[3]){ 0, 0, 0 }, (double[3]){ 1, 1, 1 }, 4);
    ebpo_mesh_report whole = check(&mesh);
    uint64_t kept = 0;
    for (uint64_t f = 0; f < mesh.face_count;
         f++) { /* two squares on one side with a common corner */
        uint64_t pair = f / 2;
        if (pair != 10 && pair != 20)
            memcpy(mesh.faces + 3 * kept++, mesh.faces + 3 * f, 3 * sizeof *mesh.faces);
    }
    mesh.face_count = kept;
    ebpo_mesh_report open = check(&mesh);
    ck_assert_uint_eq(open.boundary_edges.count, 8);
    ck_assert_uint_eq(open.boundary_loops, 2);
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_fill_holes);
    ck_assert_uint_eq(record.filled_holes, 2);
    ebpo_mesh_report r = check(&mesh);
    ck_assert(r.manifold);
    ck_assert_double_eq_tol(r.volume, whole.volume, 1e-14);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_fill_balances_random_holes)
{
    uint64_t state = 11;
    for (int round = 0; round < 50; round++) {
        ebpo_mesh mesh = ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 2);
        ebpo_test_shuffle(&mesh, ebpo_test_random(&state));
        mesh.face_count -= 1 + ebpo_test_random(&state) % 250;
        ebpo_mesh_report open = check(&mesh);
        ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_fill_holes);
        ck_assert_uint_eq(record.filled_holes, open.boundary_loops);
        ck_assert_uint_eq(record.unfilled_holes, 0);
        ck_assert(check(&mesh).balanced);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

START_TEST(test_fill_counts_open_chains)
{
    ebpo_mesh mesh = ebpo_test_sheet(1, 2);
    ebpo_test_turn_face(&mesh, 0);
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_fill_holes);
    ck_assert_uint_gt(record.unfilled_holes, 0);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_high_valence_vertex_is_not_quadratic)
{
    ebpo_mesh mesh = ebpo_test_cone(1, 1, 300000);
    ebpo_test_turn_face(&mesh, 77);
    mesh.face_count -= 100;
    repair_record(&mesh, ebpo_mesh_orient);
    repair_record(&mesh, ebpo_mesh_fill_holes);
    ck_assert(check(&mesh).balanced);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* The faces of an edge are not visited again for each of them: 2^39 visits would exceed the time
 * limit of the test. */
START_TEST(test_edge_of_many_faces_is_not_quadratic)
{
    enum { FACES = 1 << 19 };
    ebpo_mesh mesh = { .vertex_count = FACES + 2, .face_count = FACES };
    mesh.xyz64 = calloc(3 * mesh.vertex_count, sizeof *mesh.xyz64);
    mesh.faces = malloc(3 * mesh.face_count * sizeof *mesh.faces);
    mesh.xyz64[3] = 1;
    for (uint32_t i = 0; i < FACES; i++) {
        memcpy(mesh.faces + 3 * (uint64_t)i, (uint32_t[3]){ 0, 1, i + 2 }, 3 * sizeof *mesh.faces);
        mesh.xyz64[3 * (uint64_t)(i + 2)] = i;
        mesh.xyz64[3 * (uint64_t)(i + 2) + 1] = 1;
    }
    ebpo_mesh_report r = check(&mesh);
    ck_assert_uint_eq(r.boundary_edges.count, 2 * (uint64_t)FACES);
    ck_assert_uint_eq(r.nonmanifold_edges.count, 1);
    ebpo_mesh_free(&mesh);
}
END_TEST

/* ---- real models ---- */

typedef struct model {
    const char *name;
    uint64_t boundary, nonmanifold, misoriented, bowties, shells, zero_area, repeated, unused,
        positions;
    int64_t genus; /* -1: the mesh is not a closed 2-manifold */
    double volume; /* NAN: the mesh is not balanced */
} model;

static const model models[] = {
    { "bunny", 223, 0, 0, 0, 1, 0, 0, 1113, 0, -1, NAN },
    { "bunny_closed", 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1.59981 },
    { "armadillo", 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.0686187 },
    { "dragon_vrip", 4270, 0, 0, 0, 151, 108, 0, 0, 2100, -1, NAN },
    { "dragon100k", 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1.10236 },
    { "lucy100k", 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8.16725e+07 },
    { "igea", 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.000278524 },
    { "xyzrgb_dragon28k", 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 154207 },
    { "skull", 0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 563.42 },
    { "fertility", 0, 0, 0, 0, 1, 0, 0, 0, 0, 4, 432186 },
    { "blade", 240, 0, 0, 0, 1, 0, 0, 0, 0, -1, NAN },
    { "cheese_g133", 0, 0, 0, 0, 1, 0, 0, 0, 0, 133, 0.000441185 },
    { "thingi73416", 0, 0, 0, 0, 1, 0, 0, 0, 0, 13, 12850.8 },
    { "thingi99865", 0, 0, 0, 0, 4, 0, 0, 0, 0, 4, 6409.78 },
    { "twin7081_left", 0, 0, 0, 0, 12, 0, 0, 0, 0, 1, 101591 },
    { "twin7081_right", 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 43004.4 },
    { "motorbike", 49, 100089, 0, 35296, 4, 0, 67326, 0, 0, -1, NAN },
    { "buildings", 0, 0, 3, 0, 26, 284, 0, 0, 27, -1, NAN },
    { "conrod", 0, 3, 5149, 6, 1, 0, 3, 0, 0, -1, NAN },
    { "office_chair", 157, 146, 0, 140, 20, 40, 8, 0, 2, -1, NAN },
    { "selfint_A", 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.147953 },
    { "cad_adis16480", 0, 0, 0, 0, 1, 0, 0, 0, 0, 24, 2.81925e-05 },
};

enum { MODEL_COUNT = sizeof models / sizeof *models };

static ebpo_mesh read_model(const char *name)
{
    char path[1024];
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(path, sizeof path, "%s/%s.ply", getenv("EBPO_MODELS"), name);
    ebpo_status status = ebpo_mesh_read(path, NULL, &mesh, &error);
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    return mesh;
}

#define EXPECT(field, value)                                                    \
    do {                                                                        \
        if ((uint64_t)(field) != (value)) {                                     \
            fprintf(stderr, "%s: " #field " is %llu, expected %llu\n", m->name, \
                    (unsigned long long)(field), (unsigned long long)(value));  \
            bad++;                                                              \
        }                                                                       \
    } while (0)

START_TEST(test_real_models_have_known_counts)
{
    const model *m = &models[_i];
    int bad = 0;
    ebpo_mesh mesh = read_model(m->name);
    ebpo_mesh_report r = check(&mesh);
    EXPECT(r.boundary_edges.count, m->boundary);
    EXPECT(r.nonmanifold_edges.count, m->nonmanifold);
    EXPECT(r.misoriented_edges.count, m->misoriented);
    EXPECT(r.bowtie_vertices.count, m->bowties);
    EXPECT(r.components, m->shells);
    EXPECT(r.zero_area_faces.count, m->zero_area);
    EXPECT(r.repeated_faces.count, m->repeated);
    EXPECT(r.unreferenced_vertices.count, m->unused);
    EXPECT(r.repeated_positions.count, m->positions);
    EXPECT(r.manifold, m->genus >= 0);
    if (m->genus >= 0)
        EXPECT(r.genus, (uint64_t)m->genus);
    ck_assert_int_eq(bad, 0);
    if (!isnan(m->volume))
        ck_assert_double_eq_tol(r.volume, m->volume, 1e-5 * fabs(m->volume));
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_filled_scans_are_balanced)
{
    static const struct {
        const char *name;
        uint64_t holes;
    } scans[] = { { "dragon_vrip", 407 }, { "blade", 0 }, { "bunny", 5 } };
    ebpo_mesh mesh = read_model(scans[_i].name);
    ebpo_mesh_report open = check(&mesh);
    if (scans[_i].holes)
        ck_assert_uint_eq(open.boundary_loops, scans[_i].holes);
    ebpo_repair_record record = repair_record(&mesh, ebpo_mesh_fill_holes);
    ck_assert_uint_eq(record.filled_holes, open.boundary_loops);
    ck_assert_uint_eq(record.unfilled_holes, 0);
    ebpo_mesh_report r = check(&mesh);
    ck_assert(r.balanced);
    ck_assert(r.volume > 0);
    ebpo_mesh_free(&mesh);
}
END_TEST

TEST_SUITE(mesh)
{
    Suite *suite = suite_create("mesh");
    TCase *checking = tcase_create("checking"), *repairing = tcase_create("repairing");
    tcase_set_timeout(checking, 60);
    tcase_set_timeout(repairing, 120);
    tcase_add_loop_test(checking, test_solids_have_expected_properties, 0, ebpo_test_solid_count);
    tcase_add_test(checking, test_mesh_report_same_for_any_threads);
    tcase_add_test(checking, test_mesh_cube_is_measured_exactly);
    tcase_add_test(checking, test_genus_is_summed_over_components);
    tcase_add_test(checking, test_edges_of_four_faces_are_reported);
    tcase_add_test(checking, test_bowtie_vertex_is_reported);
    tcase_add_test(checking, test_repeated_faces_in_any_rotation);
    tcase_add_test(checking, test_coincident_opposite_faces_are_repeated);
    tcase_add_test(checking, test_zero_area_faces_are_found_exactly);
    tcase_add_test(checking, test_open_box_has_one_hole);
    tcase_add_test(checking, test_flipped_face_gives_misoriented_edges);
    tcase_add_test(checking, test_finding_indices_are_first_ascending);
    tcase_add_test(checking, test_unreferenced_vertices_do_not_extend_box);
    tcase_add_test(checking, test_check_refuses_non_finite_coordinates);
    tcase_add_test(checking, test_check_and_repair_refuse_bad_index);
    tcase_add_test(checking, test_check_refuses_mesh_without_faces);
    tcase_add_test(repairing, test_weld_joins_split_vertices);
    tcase_add_test(repairing, test_weld_joins_zero_and_minus_zero);
    tcase_add_test(repairing, test_orient_restores_flipped_faces);
    tcase_add_test(repairing, test_orient_closed_component_by_volume);
    tcase_add_test(repairing, test_orient_flips_inverted_component);
    tcase_add_test(repairing, test_orient_outer_shells_and_cavities);
    tcase_add_test(repairing, test_orient_keeps_consistent_components);
    tcase_add_test(repairing, test_orient_open_surface_by_majority);
    tcase_add_test(repairing, test_orient_keeps_mobius_strip);
    tcase_add_test(repairing, test_fill_closes_open_box);
    tcase_add_loop_test(repairing, test_fill_closes_both_tube_ends, 0, 6);
    tcase_add_test(repairing, test_fill_closes_holes_sharing_vertex);
    tcase_add_test(repairing, test_fill_balances_random_holes);
    tcase_add_test(repairing, test_fill_counts_open_chains);
    tcase_add_test(repairing, test_high_valence_vertex_is_not_quadratic);
    tcase_add_test(checking, test_edge_of_many_faces_is_not_quadratic);
    suite_add_tcase(suite, checking);
    suite_add_tcase(suite, repairing);
    if (getenv("EBPO_MODELS")) {
        TCase *real = tcase_create("real models");
        tcase_set_timeout(real, 300);
        tcase_add_loop_test(real, test_real_models_have_known_counts, 0, MODEL_COUNT);
        tcase_add_loop_test(real, test_filled_scans_are_balanced, 0, 3);
        suite_add_tcase(suite, real);
    }
    return suite;
}
