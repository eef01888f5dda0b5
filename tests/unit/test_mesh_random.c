/* Compares the mesh check with a reference implementation, on small random meshes with many
 * defects of every kind. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/mesh.h>

#include "check_main.h"
#include "solids.h"

enum { MAX_VERTICES = 9, MAX_FACES = 24, ROUNDS = 20000 };

/* Returns the scaled number of rounds, at least a fifth. */
static uint64_t rounds(void) { return ROUNDS / 5 + ebpo_test_scaled(ROUNDS / 5 * 4); }

static ebpo_mesh random_mesh(uint64_t *state)
{
    ebpo_mesh mesh;
    memset(&mesh, 0, sizeof mesh);
    uint32_t vertices = 1 + (uint32_t)(ebpo_test_random(state) % MAX_VERTICES);
    uint32_t faces = 1 + (uint32_t)(ebpo_test_random(state) % MAX_FACES);
    for (uint32_t v = 0; v < vertices;
         v++) /* few positions, so that some repeat and many faces have no area */
        ebpo_test_append_vertex(&mesh, (double)(ebpo_test_random(state) % 3),
                                (double)(ebpo_test_random(state) % 3), 0);
    while (mesh.face_count < faces)
        ebpo_test_append_face(&mesh, (uint32_t)(ebpo_test_random(state) % vertices),
                              (uint32_t)(ebpo_test_random(state) % vertices),
                              (uint32_t)(ebpo_test_random(state) % vertices));
    return mesh;
}

/* ---- the reference implementation: tables over all pairs ---- */

typedef struct reference {
    uint64_t uses[MAX_VERTICES][MAX_VERTICES]; /* number of uses of each directed edge */
    uint64_t edges, boundary, nonmanifold, misoriented, unbalanced, bowties, repeated,
        index_repeated, zero_area;
    uint64_t unreferenced, positions, components;
    uint64_t first_boundary; /* lowest face with a boundary edge */
} reference;

static bool names(const uint32_t *f, uint32_t v) { return f[0] == v || f[1] == v || f[2] == v; }

static bool degenerate(const uint32_t *f) { return f[0] == f[1] || f[1] == f[2] || f[0] == f[2]; }

static void reference_edges(reference *t, const ebpo_mesh *m)
{
    for (uint64_t i = 0; i < 3 * m->face_count; i++) {
        uint32_t a = m->faces[i], b = m->faces[i % 3 == 2 ? i - 2 : i + 1];
        if (a != b)
            t->uses[a][b]++;
    }
    for (uint32_t a = 0; a < m->vertex_count; a++)
        for (uint32_t b = a + 1; b < m->vertex_count; b++) {
            uint64_t p = t->uses[a][b], q = t->uses[b][a];
            t->edges += p + q > 0;
            t->boundary += p + q == 1;
            t->nonmanifold += p + q > 2;
            t->misoriented += p + q == 2 && p != 1;
            t->unbalanced += p != q;
        }
    for (uint64_t i = 3 * m->face_count; i-- > 0;) {
        uint32_t a = m->faces[i], b = m->faces[i % 3 == 2 ? i - 2 : i + 1];
        if (a != b && t->uses[a][b] + t->uses[b][a] == 1)
            t->first_boundary = i / 3;
    }
}

static bool share_twofold_edge(const reference *t, const uint32_t *f, const uint32_t *g, uint32_t v)
{
    for (int k = 0; k < 3; k++)
        if (f[k] != v && names(g, f[k]) && t->uses[v][f[k]] + t->uses[f[k]][v] == 2)
            return true;
    return false;
}

/* Spreads labels until nothing changes. Returns the number of labels of faces with a label greater
 * than 0. */
static uint64_t spread(const reference *t, const ebpo_mesh *m, uint64_t *label, uint32_t v,
                       bool fans)
{
    for (bool changed = true; changed;) {
        changed = false;
        for (uint64_t f = 0; f < m->face_count; f++)
            for (uint64_t g = 0; g < m->face_count; g++) {
                const uint32_t *a = m->faces + 3 * f, *b = m->faces + 3 * g;
                bool joined = fans ? share_twofold_edge(t, a, b, v)
                                   : names(b, a[0]) || names(b, a[1]) || names(b, a[2]);
                if (label[f] && label[g] && label[g] < label[f] && joined) {
                    label[f] = label[g];
                    changed = true;
                }
            }
    }
    uint64_t count = 0;
    for (uint64_t f = 0; f < m->face_count; f++)
        count += label[f] == f + 1;
    return count;
}

static void reference_fans(reference *t, const ebpo_mesh *m)
{
    uint64_t label[MAX_FACES];
    for (uint32_t v = 0; v < m->vertex_count; v++) {
        for (uint64_t f = 0; f < m->face_count; f++)
            label[f] = names(m->faces + 3 * f, v) && !degenerate(m->faces + 3 * f) ? f + 1 : 0;
        t->bowties += spread(t, m, label, v, true) > 1;
    }
    for (uint64_t f = 0; f < m->face_count; f++)
        label[f] = f + 1;
    t->components = spread(t, m, label, 0, false);
}

static bool flat(const ebpo_mesh *m, const uint32_t *f)
{
    const double *a = m->xyz64 + 3 * f[0], *b = m->xyz64 + 3 * f[1], *c = m->xyz64 + 3 * f[2];
    /* coordinates are small integers in the plane z = 0 */
    return (b[0] - a[0]) * (c[1] - a[1]) == (b[1] - a[1]) * (c[0] - a[0]);
}

static void reference_faces(reference *t, const ebpo_mesh *m)
{
    for (uint64_t f = 0; f < m->face_count; f++) {
        const uint32_t *a = m->faces + 3 * f;
        bool earlier = false;
        for (uint64_t g = 0; g < f; g++) {
            const uint32_t *b = m->faces + 3 * g;
            earlier |= !degenerate(a) && names(b, a[0]) && names(b, a[1]) && names(b, a[2]);
        }
        t->repeated += earlier;
        t->index_repeated += degenerate(a);
        t->zero_area += flat(m, a);
    }
    for (uint32_t v = 0; v < m->vertex_count; v++) {
        bool used = false, earlier = false;
        for (uint64_t f = 0; f < m->face_count; f++)
            used |= names(m->faces + 3 * f, v);
        for (uint32_t w = 0; w < v; w++)
            earlier |= memcmp(m->xyz64 + 3 * v, m->xyz64 + 3 * w, 3 * sizeof(double)) == 0;
        t->unreferenced += !used;
        t->positions += earlier;
    }
}

static ebpo_mesh_report check(const ebpo_mesh *mesh)
{
    ebpo_mesh_report report;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_mesh_check(mesh, 1, (ebpo_progress){ NULL, NULL }, &report, &error) ==
                      EBPO_OK,
                  "%s", error.message);
    return report;
}

START_TEST(test_mesh_check_matches_reference)
{
    static reference t;
    uint64_t state = 2017;
    for (uint64_t round = 0; round < rounds(); round++) {
        ebpo_mesh mesh = random_mesh(&state);
        ebpo_mesh_report r = check(&mesh);
        memset(&t, 0, sizeof t);
        reference_edges(&t, &mesh);
        reference_fans(&t, &mesh);
        reference_faces(&t, &mesh);
        ck_assert_uint_eq(r.edges, t.edges);
        ck_assert_uint_eq(r.boundary_edges.count, t.boundary);
        ck_assert_uint_eq(r.nonmanifold_edges.count, t.nonmanifold);
        ck_assert_uint_eq(r.misoriented_edges.count, t.misoriented);
        ck_assert_uint_eq(r.unbalanced_edges.count, t.unbalanced);
        ck_assert_uint_eq(r.bowtie_vertices.count, t.bowties);
        ck_assert_uint_eq(r.repeated_faces.count, t.repeated);
        ck_assert_uint_eq(r.index_repeated_faces.count, t.index_repeated);
        ck_assert_uint_eq(r.zero_area_faces.count, t.zero_area);
        ck_assert_uint_eq(r.unreferenced_vertices.count, t.unreferenced);
        ck_assert_uint_eq(r.repeated_positions.count, t.positions);
        ck_assert_uint_eq(r.components, t.components);
        if (t.boundary)
            ck_assert_uint_eq(r.boundary_edges.locations[0], t.first_boundary);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

START_TEST(test_repair_random_meshes)
{
    uint64_t state = 90;
    for (uint64_t round = 0; round < rounds(); round++) {
        ebpo_mesh mesh = random_mesh(&state);
        ebpo_mesh_report before = check(&mesh);
        ebpo_repair_record record;
        ebpo_error error = EBPO_ERROR_INIT;
        memset(&record, 0, sizeof record);
        ck_assert_int_eq(ebpo_mesh_fill_holes(&mesh, &record, &error), EBPO_OK);
        ck_assert_uint_eq(record.filled_holes, before.boundary_loops);
        ebpo_mesh_report filled = check(&mesh);
        if (before.unbalanced_edges.count == before.boundary_edges.count &&
            record.unfilled_holes == 0)
            ck_assert(filled.balanced);
        ck_assert_int_eq(ebpo_mesh_orient(&mesh, &record, &error), EBPO_OK);
        if (record.unorientable_components == 0)
            ck_assert_uint_eq(check(&mesh).misoriented_edges.count, 0);
        uint64_t vertices = mesh.vertex_count;
        ck_assert_int_eq(ebpo_mesh_weld(&mesh, &record, &error), EBPO_OK);
        ck_assert_uint_eq(mesh.vertex_count, vertices - before.repeated_positions.count);
        ck_assert_uint_eq(check(&mesh).repeated_positions.count, 0);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

TEST_SUITE(mesh_random)
{
    Suite *suite = suite_create("mesh, random");
    TCase *all = tcase_create("all");
    tcase_set_timeout(all, 120);
    tcase_add_test(all, test_mesh_check_matches_reference);
    tcase_add_test(all, test_repair_random_meshes);
    suite_add_tcase(suite, all);
    return suite;
}
