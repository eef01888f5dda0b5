/* The order of a mesh along the Morton curve, and sorting by groups, against reference
 * implementations. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "construct/arrange.h"
#include "check_main.h"
#include "core/sort.h"
#include "mesh/mesh_parts.h"
#include "geometry/cells.h"
#include "solids.h"

static const ebpo_progress silent = { NULL, NULL };

/* --- sorting --- */

typedef struct item {
    uint64_t key;
    uint32_t number, more;
} item;

typedef struct items {
    item *in, *out;
    uint64_t taken;
} items;

static ebpo_status make(void *context, uint64_t begin, uint64_t end, void *records,
                        ebpo_error *error)
{
    const items *t = context;
    (void)error;
    memcpy(records, t->in + begin, (size_t)(end - begin) * sizeof *t->in);
    return EBPO_OK;
}

static int by_number(const void *a, const void *b)
{
    const item *x = a, *y = b;
    return (x->number > y->number) - (x->number < y->number);
}

static int by_all(const void *a, const void *b)
{
    const item *x = a, *y = b;
    return x->key != y->key ? (x->key < y->key ? -1 : 1) : by_number(a, b);
}

static void take(void *context, uint64_t place, const void *records, uint64_t count)
{
    items *t = context;
    memcpy(t->out + place, records, (size_t)count * sizeof *t->out);
    __atomic_fetch_add(&t->taken, count, __ATOMIC_RELAXED);
}

static uint64_t key_of_kind(int kind, uint64_t i, uint64_t *state)
{
    uint64_t r = ebpo_test_random(state);
    switch (kind) {
    case 0: return r & ((UINT64_C(1) << 63) - 1); /* uniformly distributed */
    case 1: return 12345;                         /* all equal */
    case 2: return r % 7 << 50;                   /* few different values, far from each other */
    case 3: return (UINT64_C(1) << 60) + r % 100; /* all in one bin */
    default: return i;                            /* ascending, all in the first bin */
    }
}

START_TEST(test_group_sort_matches_qsort)
{
    uint64_t state = 1 + (uint64_t)_i, count = _i % 5 == 1 ? 30000 : 400000;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace *w = NULL;
    if (_i >= 5)
        ck_assert(ebpo_workspace_make_any(&w, 4 << 20, NULL, &error) == EBPO_OK);
    items t = { malloc(count * sizeof(item)), malloc(count * sizeof(item)), 0 };
    for (uint64_t i = 0; i < count; i++)
        t.in[i] =
            (item){ key_of_kind(_i % 5, i, &state), (uint32_t)(i * 2654435761u), (uint32_t)i };
    ebpo_sort sort = { .workspace = w,
                       .threads = 1 + (unsigned)_i % 3,
                       .progress = &silent,
                       .stage = "",
                       .count = count,
                       .record = sizeof(item),
                       .shift = 46,
                       .context = &t,
                       .make = make,
                       .compare = by_number,
                       .take = take };
    ck_assert_msg(ebpo_sort_run(&sort, &error) == EBPO_OK, "%s", error.message);
    ck_assert_uint_eq(t.taken, count);
    if (_i == 5) { /* small groups: only one array of all records */
        ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
        ck_assert(ebpo_workspace_get_stats(w, &stats) == EBPO_OK);
        ck_assert_uint_lt(stats.held_peak + stats.filed_total, count * sizeof(item) + 8192);
    }
    qsort(t.in, count, sizeof *t.in, by_all);
    ck_assert(memcmp(t.in, t.out, count * sizeof *t.in) == 0);
    free(t.in);
    free(t.out);
    ebpo_workspace_free(w);
}
END_TEST

/* --- meshes --- */

static ebpo_mesh some_mesh(int i)
{
    ebpo_mesh m =
        i < ebpo_test_solid_count ? ebpo_test_solids[i].make() : ebpo_test_torus(2, 0.7, 300, 200);
    if (i % 3 == 1)
        ebpo_test_shuffle(&m, (uint64_t)i);
    if (i % 4 == 2 && m.xyz64)
        ebpo_test_to_float(&m);
    return m;
}

/* Returns true when the vertex is in the cell, compared bit by bit. The upper faces of a cell
 * belong to the next cells. */
static bool is_in_cell(const ebpo_box *box, const ebpo_mesh *m, uint64_t v, ebpo_cell cell)
{
    double p[3];
    uint32_t last = (uint32_t)((UINT64_C(1) << cell.level) - 1);
    ebpo_mesh_position(m, v, p);
    for (int k = 0; k < 3; k++)
        if ((cell.at[k] > 0 && p[k] < ebpo_cell_face(box, k, cell.level, cell.at[k])) ||
            (cell.at[k] < last && p[k] >= ebpo_cell_face(box, k, cell.level, cell.at[k] + 1)))
            return false;
    return true;
}

static void expect_arranged(const ebpo_mesh *m, const ebpo_mesh *source)
{
    const struct ebpo_arrangement *a = m->arrangement;
    uint8_t *seen = calloc(1, source->vertex_count + source->face_count + 1),
            *named = calloc(1, source->vertex_count + 1);
    ck_assert(m->vertex_count == source->vertex_count && m->face_count == source->face_count);
    for (uint64_t v = 0; v < m->vertex_count; v++) {
        uint32_t from = a->vertex_source[v];
        ck_assert(from < source->vertex_count && !seen[from]++);
        if (m->xyz32)
            ck_assert(memcmp(m->xyz32 + 3 * v, source->xyz32 + 3 * (uint64_t)from, 12) == 0);
        else
            ck_assert(memcmp(m->xyz64 + 3 * v, source->xyz64 + 3 * (uint64_t)from, 24) == 0);
    }
    uint32_t before = 0;
    for (uint64_t f = 0; f < m->face_count; f++) {
        uint32_t from = a->face_source[f], least = UINT32_MAX;
        ck_assert(from < source->face_count && !seen[source->vertex_count + from]++);
        for (int k = 0; k < 3; k++) {
            uint32_t v = m->faces[3 * f + (uint64_t)k];
            ck_assert_uint_eq(a->vertex_source[v], source->faces[3 * (uint64_t)from + (uint64_t)k]);
            named[v] = 1;
            least = v < least ? v : least;
        }
        ck_assert_uint_ge(least, before);
        before = least;
    }
    for (uint64_t v = 0; v < m->vertex_count; v++)
        ck_assert_int_eq(named[v], v < a->referenced);
    for (uint64_t v = 0; v < a->referenced; v++) {
        ck_assert(v == 0 || a->key[v] >= a->key[v - 1]);
        ck_assert(ebpo_octcode_level(a->key[v]) == a->box.grid_level &&
                  is_in_cell(&a->box, m, v, ebpo_cell_of_octcode(a->key[v])));
    }
    free(seen);
    free(named);
}

START_TEST(test_arranged_mesh_has_same_faces)
{
    ebpo_mesh source = some_mesh(_i), m = some_mesh(_i), again = some_mesh(_i);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh_report before, after;
    if (ebpo_mesh_check(&source, 1, silent, &before, &error) != EBPO_OK) {
        ck_assert(ebpo_mesh_arrange(&m, 1, silent, &error) != EBPO_OK || source.face_count);
    } else {
        ck_assert_msg(ebpo_mesh_arrange(&m, 1, silent, &error) == EBPO_OK, "%s", error.message);
        expect_arranged(&m, &source);
        ck_assert(ebpo_mesh_check(&m, 2, silent, &after, &error) == EBPO_OK);
        ck_assert_msg(memcmp(&before, &after, sizeof before) == 0, "mesh %d: the report differs",
                      _i);
        /* The result is the same from any order, with other numbers of threads, and when repeated.
         */
        ck_assert(ebpo_arrange(&again, 3, 4, &silent, &error) == EBPO_OK &&
                  again.arrangement->box.grid_level == 3);
        expect_arranged(&again, &source);
        ck_assert(ebpo_mesh_arrange(&again, 3, silent, &error) == EBPO_OK);
        expect_arranged(&again, &source);
        ck_assert(memcmp(&again.arrangement->box, &m.arrangement->box, sizeof m.arrangement->box) ==
                  0);
    }
    ebpo_mesh_free(&source);
    ebpo_mesh_free(&m);
    ebpo_mesh_free(&again);
}
END_TEST

START_TEST(test_arrange_order_ignores_memory_budget)
{
    ebpo_mesh m = ebpo_test_torus(2, 0.7, 600, 400), small = ebpo_test_torus(2, 0.7, 600, 400);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_test_shuffle(&m, 5);
    ebpo_test_shuffle(&small, 5);
    ck_assert(ebpo_workspace_make_any(&small.workspace, 2 << 20, NULL, &error) == EBPO_OK);
    ebpo_workspace *w = small.workspace;
    ck_assert(ebpo_mesh_arrange(&m, 2, silent, &error) == EBPO_OK);
    ck_assert_msg(ebpo_mesh_arrange(&small, 2, silent, &error) == EBPO_OK, "%s", error.message);
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    ebpo_workspace_get_stats(w, &f);
    ck_assert_uint_gt(f.filed_peak, 20 << 20);
    ck_assert(memcmp(m.faces, small.faces, m.face_count * 12) == 0);
    ck_assert(memcmp(m.xyz64, small.xyz64, m.vertex_count * 24) == 0);
    ck_assert(memcmp(m.arrangement->vertex_source, small.arrangement->vertex_source,
                     m.vertex_count * 4) == 0);
    ck_assert(
        memcmp(m.arrangement->face_source, small.arrangement->face_source, m.face_count * 4) == 0);
    ebpo_mesh_free(&m);
    ebpo_mesh_free(&small);
    ebpo_workspace_free(w);
}
END_TEST

START_TEST(test_arrange_refusal_keeps_mesh)
{
    ebpo_mesh m = ebpo_test_torus(2, 0.7, 20, 10);
    ebpo_error error = EBPO_ERROR_INIT;
    m.faces[7] = 200;
    ck_assert_int_eq(ebpo_mesh_arrange(&m, 1, silent, &error), EBPO_E_FORMAT);
    ck_assert_msg(strstr(error.message, "face 2 names vertex 200") != NULL, "%s", error.message);
    m.faces[7] = 0;
    m.xyz64[10] = NAN;
    ck_assert_int_eq(ebpo_mesh_arrange(&m, 1, silent, &error), EBPO_E_FORMAT);
    ck_assert_msg(strstr(error.message, "vertex 3 has y = nan") != NULL, "%s", error.message);
    m.xyz64[10] = 1e302;
    ck_assert_int_eq(ebpo_mesh_arrange(&m, 1, silent, &error), EBPO_E_LIMIT);
    ck_assert(m.arrangement == NULL && m.faces[7] == 0 && m.xyz64[10] == 1e302);
    ebpo_mesh_free(&m);
}
END_TEST

TEST_SUITE(arrange)
{
    Suite *suite = suite_create("arrange");
    TCase *tests = tcase_create("all");
    tcase_set_timeout(tests, 300);
    tcase_add_loop_test(tests, test_group_sort_matches_qsort, 0, 10);
    tcase_add_loop_test(tests, test_arranged_mesh_has_same_faces, 0, ebpo_test_solid_count + 4);
    tcase_add_test(tests, test_arrange_order_ignores_memory_budget);
    tcase_add_test(tests, test_arrange_refusal_keeps_mesh);
    suite_add_tcase(suite, tests);
    return suite;
}
