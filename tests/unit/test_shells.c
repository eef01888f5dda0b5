/* Compares the nesting of closed components, found by trees, with a reference implementation that
 * compares all pairs. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "geometry/predicates.h"
#include "mesh/mesh_parts.h"
#include "geometry/triangle_pair.h"
#include "solids.h"

enum { LIMIT = 60 };

/* The faces of each component, which are adjacent in the list; the sign of its volume. */
typedef struct parts {
    uint64_t begin[LIMIT + 1];
    bool inwards[LIMIT];
    int count;
} parts;

static void position(const ebpo_mesh *m, uint64_t corner, double out[3])
{
    ebpo_mesh_position(m, m->faces[corner], out);
}

/* Orders points by coordinate d, and points with equal coordinate d by the other coordinates. */
static bool before(const double a[3], const double b[3], int d)
{
    int axis = d / 2;
    if (a[axis] != b[axis])
        return d % 2 ? a[axis] > b[axis] : a[axis] < b[axis];
    for (int k = 0; k < 3; k++)
        if (a[k] != b[k])
            return a[k] < b[k];
    return false;
}

/* Returns the winding number of the component at a point, by all of its faces. */
static int winding(const ebpo_mesh *m, const parts *p, int part, const double at[3])
{
    int sum = 0;
    for (uint64_t f = p->begin[part]; f < p->begin[part + 1]; f++) {
        double t[3][3];
        for (uint64_t k = 0; k < 3; k++)
            position(m, 3 * f + k, t[k]);
        sum += ebpo_axis_crossing(at, at[0] > 1e6 ? at[0] : 1e6, 0, t[0], t[1], t[2]);
    }
    return sum;
}

static bool within(const ebpo_mesh *m, const parts *p, int inner, int outer)
{
    for (int d = 0; d < 6; d++) {
        double best[3], at[3];
        position(m, 3 * p->begin[inner], best);
        for (uint64_t c = 3 * p->begin[inner]; c < 3 * p->begin[inner + 1]; c++) {
            position(m, c, at);
            if (before(at, best, d))
                memcpy(best, at, sizeof best);
        }
        if (winding(m, p, outer, best) == 0)
            return false;
    }
    return true;
}

/* Checks that no faces of two components have a common point: compares all pairs. */
static bool apart(const ebpo_mesh *m, const parts *p)
{
    double a[3][3], b[3][3];
    for (int part = 1; part < p->count; part++)
        for (uint64_t f = p->begin[part]; f < p->begin[part + 1]; f++)
            for (uint64_t g = 0; g < p->begin[part]; g++) {
                for (uint64_t k = 0; k < 3; k++) {
                    position(m, 3 * f + k, a[k]);
                    position(m, 3 * g + k, b[k]);
                }
                if (ebpo_triangle_pair((const double(*)[3])a, (const double(*)[3])b) !=
                    EBPO_PAIR_APART)
                    return false;
            }
    return true;
}

static ebpo_shells reference(const ebpo_mesh *m, const parts *p)
{
    ebpo_shells s = EBPO_SHELLS_INIT;
    s.closed = (uint64_t)p->count;
    for (int i = 0; i < p->count; i++) {
        int depth = 0;
        for (int host = 0; host < p->count; host++)
            depth += host != i && within(m, p, i, host);
        bool cavity = depth % 2;
        s.inside_out += p->inwards[i] && !cavity;
        s.cavities += p->inwards[i] && cavity;
        s.nested += !p->inwards[i] && cavity;
    }
    return s;
}

/* Rotates about x by thirds, with rounding, so that long faces are slanted to the axes. */
static void slant(ebpo_mesh *m)
{
    for (uint64_t v = 0; v < m->vertex_count; v++) {
        double y = m->xyz64[3 * v + 1], z = m->xyz64[3 * v + 2];
        m->xyz64[3 * v + 1] = y - z * 2 / 3;
        m->xyz64[3 * v + 2] = z + y / 3;
    }
}

static void add(ebpo_mesh *m, parts *p, ebpo_mesh *part, bool turn)
{
    if (turn)
        ebpo_test_reverse(part);
    if (m->face_count)
        ebpo_test_append(m, part);
    p->inwards[p->count++] = turn;
    p->begin[p->count] = p->begin[p->count - 1] + part->face_count;
    if (m->face_count)
        ebpo_mesh_free(part);
    else
        *m = *part;
}

static double whole(uint64_t *state, uint64_t most)
{
    return (double)(ebpo_test_random(state) % most);
}

/* Makes boxes at integer coordinates, which share faces and are in contact; tetrahedra; and tori.
 */
static ebpo_mesh many(uint64_t *state, parts *p)
{
    ebpo_mesh m = { 0 };
    uint64_t most = ebpo_test_random(state) % 2 ? LIMIT : 6;
    int count = 2 + (int)(ebpo_test_random(state) % (most - 2));
    uint64_t range = 4 + ebpo_test_random(state) % 30;
    memset(p, 0, sizeof *p);
    for (int i = 0; i < count; i++) {
        double low[3], high[3];
        bool large = ebpo_test_random(state) % 4 == 0;
        for (int k = 0; k < 3; k++) {
            low[k] = large ? -1 - whole(state, 3) : whole(state, range);
            high[k] = large ? (double)range + whole(state, 5) : low[k] + 1 + whole(state, 4);
        }
        ebpo_mesh part = i % 7 == 5 ? ebpo_test_torus(8, 3, 24, 8)
                                    : ebpo_test_box(low, high, 1 + (uint32_t)(i % 2));
        add(&m, p, &part, ebpo_test_random(state) % 2);
    }
    if (ebpo_test_random(state) % 2)
        slant(&m);
    return m;
}

START_TEST(test_shell_nesting_matches_reference)
{
    uint64_t state = 4711, rounds = 24 + ebpo_test_scaled(96), known = 0;
    for (uint64_t i = 0; i < rounds; i++) {
        parts p;
        ebpo_mesh m = many(&state, &p);
        ebpo_shells plain = reference(&m, &p), s = EBPO_SHELLS_INIT;
        ebpo_error error = EBPO_ERROR_INIT;
        ck_assert_msg(ebpo_mesh_count_shells(&m, 1 + (unsigned)(i % 3),
                                             (ebpo_progress){ NULL, NULL }, &s, &error) == EBPO_OK,
                      "%s", error.message);
        ck_assert_uint_eq(s.closed, plain.closed);
        ck_assert_uint_eq(s.inside_out, plain.inside_out);
        ck_assert_uint_eq(s.cavities, plain.cavities);
        ck_assert_uint_eq(s.nested, plain.nested);
        ck_assert_int_eq(s.apart, apart(&m, &p));
        known += s.apart;
        ebpo_mesh_free(&m);
    }
    ck_assert_uint_gt(known, rounds / 20);
}
END_TEST

/* Makes a long chain of nested components. Each component also contains a separate small one. */
START_TEST(test_shell_chain_depth)
{
    enum { CHAIN = 150 };
    uint64_t state = 99;
    ebpo_mesh m = { 0 };
    ebpo_shells made = EBPO_SHELLS_INIT, s = EBPO_SHELLS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    for (int i = 0; i < 2 * CHAIN; i++) {
        double size = 1 + i / 2, low[3] = { -size, -size, -size }, high[3] = { size, size, size };
        int depth = CHAIN - 1 - i / 2;
        bool turn = ebpo_test_random(&state) % 2;
        if (i % 2) { /* between this box and the next smaller one */
            for (int k = 0; k < 3; k++)
                low[k] = size - 0.75, high[k] = size - 0.25;
            depth++;
        }
        ebpo_mesh part = ebpo_test_box(low, high, 1);
        if (turn)
            ebpo_test_reverse(&part);
        made.inside_out += turn && depth % 2 == 0;
        made.cavities += turn && depth % 2;
        made.nested += !turn && depth % 2;
        if (i)
            ebpo_test_append(&m, &part);
        else
            m = part;
        if (i)
            ebpo_mesh_free(&part);
    }
    ck_assert(ebpo_mesh_count_shells(&m, 2, (ebpo_progress){ NULL, NULL }, &s, &error) == EBPO_OK);
    ck_assert_uint_eq(s.closed, 2 * CHAIN);
    ck_assert_int_eq(s.apart, 1);
    ck_assert_uint_eq(s.inside_out, made.inside_out);
    ck_assert_uint_eq(s.cavities, made.cavities);
    ck_assert_uint_eq(s.nested, made.nested);
    ebpo_mesh_free(&m);
}
END_TEST

TEST_SUITE(shells)
{
    Suite *suite = suite_create("shells");
    TCase *tests = tcase_create("all");
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_shell_nesting_matches_reference);
    tcase_add_test(tests, test_shell_chain_depth);
    suite_add_tcase(suite, tests);
    return suite;
}
