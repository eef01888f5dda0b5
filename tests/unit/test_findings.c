/* Positions of findings against a reference implementation, on small random meshes. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/findings.h>

#include "check_main.h"
#include "solids.h"

enum { MAX_VERTICES = 9, MAX_FACES = 24, MAX_PLACES = 512, ROUNDS = 4000 };

static ebpo_mesh random_mesh(uint64_t *state)
{
    ebpo_mesh mesh;
    memset(&mesh, 0, sizeof mesh);
    uint32_t vertices = 1 + (uint32_t)(ebpo_test_random(state) % MAX_VERTICES);
    uint32_t faces = 1 + (uint32_t)(ebpo_test_random(state) % MAX_FACES);
    for (uint32_t v = 0; v < vertices; v++)
        ebpo_test_append_vertex(&mesh, (double)(ebpo_test_random(state) % 3),
                                (double)(ebpo_test_random(state) % 3), 0);
    while (mesh.face_count < faces)
        ebpo_test_append_face(&mesh, (uint32_t)(ebpo_test_random(state) % vertices),
                              (uint32_t)(ebpo_test_random(state) % vertices),
                              (uint32_t)(ebpo_test_random(state) % vertices));
    return mesh;
}

typedef struct reported {
    ebpo_mesh_finding found_one;
    uint64_t faces[MAX_FACES];
} reported;

typedef struct all {
    reported item[MAX_PLACES];
    uint64_t count, enough;
} all;

static bool keep(void *user, const ebpo_mesh_finding *found_one)
{
    all *a = user;
    reported *t = &a->item[a->count++];
    memset(t, 0, sizeof *t);
    t->found_one = *found_one;
    for (uint64_t i = 0; i < found_one->face_count; i++)
        t->faces[i] = found_one->faces[i];
    t->found_one.faces = NULL;
    return a->count != a->enough;
}

static all run_query(const ebpo_mesh *mesh, unsigned threads, ebpo_mesh_report *report)
{
    static all a;
    memset(&a, 0, sizeof a);
    ebpo_findings_options options = EBPO_FINDINGS_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    options.threads = threads;
    ck_assert_msg(ebpo_mesh_findings(mesh, &options, keep, &a, report, &error) == EBPO_OK, "%s",
                  error.message);
    return a;
}

/* ---- the reference implementation ---- */

static bool names(const uint32_t *f, uint64_t v) { return f[0] == v || f[1] == v || f[2] == v; }

static bool around(const ebpo_mesh *m, const ebpo_mesh_finding *p, uint64_t face)
{
    const uint32_t *f = m->faces + 3 * face;
    if (p->kind == EBPO_FOUND_INDEX_REPEATED_FACE || p->kind == EBPO_FOUND_ZERO_AREA_FACE)
        return f[0] == p->vertex[0] && f[1] == p->vertex[1];
    return names(f, p->vertex[0]) && names(f, p->vertex[1]);
}

static uint64_t uses(const ebpo_mesh *m, uint64_t a, uint64_t b)
{
    uint64_t n = 0;
    for (uint64_t i = 0; i < 3 * m->face_count; i++)
        n += m->faces[i] == a && m->faces[i % 3 == 2 ? i - 2 : i + 1] == b;
    return n;
}

/* Returns the component of a face as the number of components with a lower first face. */
static uint32_t component_of(const ebpo_mesh *m, uint64_t face)
{
    uint64_t label[MAX_FACES];
    uint32_t before = 0;
    for (uint64_t f = 0; f < m->face_count; f++)
        label[f] = f;
    for (bool changed = true; changed;) {
        changed = false;
        for (uint64_t f = 0; f < m->face_count; f++)
            for (uint64_t g = 0; g < m->face_count; g++)
                for (int k = 0; k < 3; k++)
                    if (label[g] < label[f] &&
                        names(m->faces + 3 * g, m->faces[3 * f + (unsigned)k])) {
                        label[f] = label[g];
                        changed = true;
                    }
    }
    for (uint64_t f = 0; f < label[face]; f++)
        before += label[f] == f;
    return before;
}

static void judge_edge(const ebpo_mesh *m, const ebpo_mesh_finding *p)
{
    uint64_t out = uses(m, p->vertex[0], p->vertex[1]), in = uses(m, p->vertex[1], p->vertex[0]);
    ck_assert_uint_lt(p->vertex[0], p->vertex[1]);
    if (p->kind == EBPO_FOUND_BOUNDARY_EDGE)
        ck_assert_uint_eq(in + out, 1);
    else if (p->kind == EBPO_FOUND_NONMANIFOLD_EDGE)
        ck_assert_uint_gt(in + out, 2);
    else if (p->kind == EBPO_FOUND_MISORIENTED_EDGE)
        ck_assert(in + out == 2 && in != 1);
    else
        ck_assert_uint_ne(in, out);
}

/* Returns the first face with the same corners. */
static uint64_t first_like(const ebpo_mesh *m, uint64_t face)
{
    for (uint64_t f = 0; f < face; f++) {
        bool same = true;
        for (int k = 0; k < 3; k++)
            same = same && names(m->faces + 3 * f, m->faces[3 * face + (unsigned)k]) &&
                   names(m->faces + 3 * face, m->faces[3 * f + (unsigned)k]);
        if (same)
            return f;
    }
    return face;
}

/* Checks the reported faces: all faces around an edge or vertex; a repeated face and its first
 * occurrence; the face of an index. */
static void judge_faces(const ebpo_mesh *m, const reported *t)
{
    const ebpo_mesh_finding *p = &t->found_one;
    uint64_t wanted = 0;
    bool one = p->kind == EBPO_FOUND_INDEX_REPEATED_FACE || p->kind == EBPO_FOUND_ZERO_AREA_FACE;
    if (one)
        ck_assert_uint_eq(p->face_count, 1);
    if (p->kind == EBPO_FOUND_REPEATED_FACE) {
        ck_assert_uint_eq(p->face_count, 2);
        ck_assert_uint_eq(t->faces[0], first_like(m, t->faces[1]));
    }
    for (uint64_t i = 0; i < p->face_count; i++) {
        ck_assert(around(m, p, t->faces[i]));
        ck_assert(i == 0 || t->faces[i] > t->faces[i - 1]);
    }
    for (uint64_t f = 0; f < m->face_count; f++)
        wanted += around(m, p, f);
    if (!one && p->kind != EBPO_FOUND_REPEATED_FACE)
        ck_assert_uint_eq(p->face_count, wanted);
    if (p->kind == EBPO_FOUND_UNREFERENCED_VERTEX)
        ck_assert_uint_eq(p->component, EBPO_NO_COMPONENT);
    else if (p->face_count)
        ck_assert_uint_eq(p->component, component_of(m, t->faces[0]));
}

static void judge_point(const ebpo_mesh *m, const reported *t)
{
    const ebpo_mesh_finding *p = &t->found_one;
    uint64_t v[3] = { p->vertex[0], p->vertex[1], 0 };
    int count = p->kind <= EBPO_FOUND_UNBALANCED_EDGE ? 2 : p->vertex[0] == p->vertex[1] ? 1 : 3;
    if (p->kind >= EBPO_FOUND_REPEATED_FACE && p->kind <= EBPO_FOUND_ZERO_AREA_FACE) {
        count = 3;
        for (int k = 0; k < 3; k++)
            v[k] = m->faces[3 * t->faces[0] + (unsigned)k];
    }
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int i = 0; i < count; i++)
            sum += m->xyz64[3 * v[i] + (unsigned)k];
        ck_assert_double_eq_tol(p->point[k], sum / count, 1e-14);
    }
}

static const ebpo_finding *finding(const ebpo_mesh_report *r, int kind)
{
    const ebpo_finding *const all_kinds[EBPO_FINDING_KINDS] = {
        &r->boundary_edges,        &r->nonmanifold_edges, &r->misoriented_edges,
        &r->unbalanced_edges,      &r->repeated_faces,    &r->index_repeated_faces,
        &r->zero_area_faces,       &r->bowtie_vertices,   &r->repeated_positions,
        &r->unreferenced_vertices,
    };
    return all_kinds[kind];
}

static void judge(const ebpo_mesh *m, const all *a, const ebpo_mesh_report *r)
{
    uint64_t count[EBPO_FINDING_KINDS] = { 0 };
    for (uint64_t i = 0; i < a->count; i++) {
        const ebpo_mesh_finding *p = &a->item[i].found_one,
                                *q = i ? &a->item[i - 1].found_one : NULL;
        count[p->kind]++;
        ck_assert(!q || p->kind >= q->kind);
        /* each item is reported once */
        ck_assert(!q || memcmp(&a->item[i], &a->item[i - 1], sizeof a->item[i]) != 0 ||
                  p->kind == EBPO_FOUND_REPEATED_FACE || p->kind == EBPO_FOUND_ZERO_AREA_FACE ||
                  p->kind == EBPO_FOUND_INDEX_REPEATED_FACE);
        if (p->kind <= EBPO_FOUND_UNBALANCED_EDGE)
            judge_edge(m, p);
        judge_faces(m, &a->item[i]);
        judge_point(m, &a->item[i]);
    }
    for (int kind = 0; kind < EBPO_FINDING_KINDS; kind++)
        ck_assert_uint_eq(count[kind], finding(r, kind)->count);
}

START_TEST(test_finding_locations_are_reported_once)
{
    uint64_t state = 7;
    for (uint64_t round = ebpo_test_scaled(ROUNDS); round-- > 0;) {
        static all one, more;
        ebpo_mesh mesh = random_mesh(&state);
        ebpo_mesh_report report, checked;
        ebpo_error error = EBPO_ERROR_INIT;
        one = run_query(&mesh, 1, &report);
        ck_assert(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ NULL, NULL }, &checked, &error) ==
                  EBPO_OK);
        ck_assert_mem_eq(&report, &checked, sizeof report);
        judge(&mesh, &one, &report);
        ck_assert(ebpo_mesh_arrange(&mesh, 1, (ebpo_progress){ NULL, NULL }, &error) == EBPO_OK);
        more = run_query(&mesh, 3, &report);
        ck_assert_uint_eq(one.count, more.count);
        for (uint64_t i = 0; i < one.count; i++)
            ck_assert_mem_eq(&one.item[i], &more.item[i], sizeof one.item[i]);
        ebpo_mesh_free(&mesh);
    }
}
END_TEST

static bool count_findings(void *user, const ebpo_mesh_finding *found_one)
{
    (void)found_one;
    ++*(uint64_t *)user;
    return true;
}

/* For one face with very many repetitions, the time for each repetition is as small as for few
 * repetitions. */
START_TEST(test_locations_of_many_repeated_faces)
{
    enum { MANY = 40000 };
    ebpo_mesh mesh;
    uint64_t count = 0;
    ebpo_error error = EBPO_ERROR_INIT;
    memset(&mesh, 0, sizeof mesh);
    for (int v = 0; v < 3; v++)
        ebpo_test_append_vertex(&mesh, v == 1, v == 2, 0);
    mesh.face_count = MANY;
    mesh.faces =
        malloc(3 * MANY * sizeof *mesh.faces); /* at once: sanitizers are slow in growing */
    for (uint32_t i = 0; i < 3 * MANY; i++)
        mesh.faces[i] = i % 3;
    ck_assert(ebpo_mesh_findings(&mesh, NULL, count_findings, &count, NULL, &error) == EBPO_OK);
    ck_assert_uint_eq(count, MANY - 1 + 9); /* 6 findings of edges and 3 of vertices */
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_location_report_stops_on_request)
{
    uint64_t state = 7;
    ebpo_mesh mesh = random_mesh(&state);
    static all a;
    ebpo_error error = EBPO_ERROR_INIT;
    memset(&a, 0, sizeof a);
    a.enough = 2;
    ck_assert(ebpo_mesh_findings(&mesh, NULL, keep, &a, NULL, &error) == EBPO_OK);
    ck_assert_uint_eq(a.count, 2);
    ck_assert(ebpo_mesh_findings(&mesh, NULL, NULL, NULL, NULL, &error) == EBPO_OK);
    ebpo_findings_options bad = EBPO_FINDINGS_OPTIONS_INIT;
    bad.struct_size = 0;
    ck_assert(ebpo_mesh_findings(&mesh, &bad, NULL, NULL, NULL, &error) == EBPO_E_ARGUMENT);
    ebpo_mesh_free(&mesh);
}
END_TEST

START_TEST(test_location_kinds_have_names_and_colours)
{
    uint8_t rgb[3], other[3];
    for (int kind = 0; kind < EBPO_FINDING_KINDS; kind++) {
        ck_assert_ptr_nonnull(ebpo_finding_name(kind));
        ebpo_finding_colour(kind, rgb);
        for (int k = 0; k < kind; k++) {
            ebpo_finding_colour(k, other);
            ck_assert_mem_ne(rgb, other, 3);
        }
    }
    ck_assert_ptr_null(ebpo_finding_name(-1));
    ck_assert_ptr_null(ebpo_finding_name(EBPO_FINDING_KINDS));
}
END_TEST

TEST_SUITE(findings)
{
    Suite *suite = suite_create("findings");
    TCase *tests = tcase_create("all");
    tcase_set_timeout(tests, 30);
    tcase_add_test(tests, test_finding_locations_are_reported_once);
    tcase_add_test(tests, test_locations_of_many_repeated_faces);
    tcase_add_test(tests, test_location_report_stops_on_request);
    tcase_add_test(tests, test_location_kinds_have_names_and_colours);
    suite_add_tcase(suite, tests);
    return suite;
}
