/* Computes distances by minimising over each pair of features (corners, edges, faces): the normal
 * equations in rational numbers, by elimination. */
#include <gmp.h>
#include <math.h>

#include "pair_reference.h"

enum { PARAMETERS_MAX = 4 };

typedef struct problem {
    mpq_t corner[2][3][3];
    mpq_t direction[PARAMETERS_MAX][3], between[3];
    mpq_t m[PARAMETERS_MAX][PARAMETERS_MAX + 1], x[PARAMETERS_MAX], part, sum, least;
    int parameters, of_first;
    bool any;
} problem;

static void for_all(problem *p, void (*act)(mpq_t))
{
    for (int i = 0; i < 18; i++)
        act(p->corner[i / 9][i / 3 % 3][i % 3]);
    for (int i = 0; i < PARAMETERS_MAX; i++) {
        for (int k = 0; k < 3; k++)
            act(p->direction[i][k]);
        for (int k = 0; k <= PARAMETERS_MAX; k++)
            act(p->m[i][k]);
        act(p->x[i]);
    }
    for (int k = 0; k < 3; k++)
        act(p->between[k]);
    act(p->part);
    act(p->sum);
    act(p->least);
}

static void dot(problem *p, mpq_t out, mpq_t a[3], mpq_t b[3])
{
    mpq_set_ui(p->sum, 0, 1);
    for (int k = 0; k < 3; k++) {
        mpq_mul(p->part, a[k], b[k]);
        mpq_add(p->sum, p->sum, p->part);
    }
    mpq_set(out, p->sum);
}

/* Returns the first corner of a feature. Features 0 to 2 are corners, 3 to 5 edges, 6 is the face.
 */
static int begin_of(int feature) { return feature < 6 ? feature % 3 : 0; }

static void add_directions(problem *p, int of, int feature)
{
    int first = begin_of(feature), count = feature < 3 ? 0 : feature < 6 ? 1 : 2;
    for (int i = 1; i <= count; i++, p->parameters++)
        for (int k = 0; k < 3; k++) {
            mpq_t *d = &p->direction[p->parameters][k];
            mpq_sub(*d, p->corner[of][(first + i) % 3][k], p->corner[of][first][k]);
            if (of == 1)
                mpq_neg(*d, *d);
        }
}

/* Solves the equations of the Gram matrix and the right side. Returns false if the directions are
 * not independent, so that a lower feature also has the minimum. */
static bool solve(problem *p)
{
    int n = p->parameters;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++)
            dot(p, p->m[i][j], p->direction[i], p->direction[j]);
        dot(p, p->m[i][n], p->direction[i], p->between);
        mpq_neg(p->m[i][n], p->m[i][n]);
    }
    for (int c = 0; c < n; c++) {
        /* positive semidefinite: a pivot of 0 means a row of 0 */
        if (mpq_sgn(p->m[c][c]) == 0)
            return false;
        for (int i = 0; i < n; i++) {
            if (i == c)
                continue;
            mpq_div(p->x[0], p->m[i][c], p->m[c][c]);
            for (int j = c; j <= n; j++) {
                mpq_mul(p->part, p->x[0], p->m[c][j]);
                mpq_sub(p->m[i][j], p->m[i][j], p->part);
            }
        }
    }
    for (int c = 0; c < n; c++)
        mpq_div(p->x[c], p->m[c][n], p->m[c][c]);
    return true;
}

/* Returns true if parameters from .. to - 1 belong to a point within its feature. */
static bool within(problem *p, int from, int to)
{
    mpq_set_ui(p->sum, 0, 1);
    for (int i = from; i < to; i++) {
        if (mpq_sgn(p->x[i]) < 0)
            return false;
        mpq_add(p->sum, p->sum, p->x[i]);
    }
    return mpq_cmp_ui(p->sum, 1, 1) <= 0;
}

static void minimise(problem *p, int feature_a, int feature_b)
{
    for (int k = 0; k < 3; k++)
        mpq_sub(p->between[k], p->corner[0][begin_of(feature_a)][k],
                p->corner[1][begin_of(feature_b)][k]);
    p->parameters = 0;
    add_directions(p, 0, feature_a);
    p->of_first = p->parameters;
    add_directions(p, 1, feature_b);
    if (!solve(p) || !within(p, 0, p->of_first) || !within(p, p->of_first, p->parameters))
        return;
    for (int i = 0; i < p->parameters; i++)
        for (int k = 0; k < 3; k++) {
            mpq_mul(p->part, p->x[i], p->direction[i][k]);
            mpq_add(p->between[k], p->between[k], p->part);
        }
    dot(p, p->x[0], p->between, p->between);
    if (!p->any || mpq_cmp(p->x[0], p->least) < 0)
        mpq_set(p->least, p->x[0]);
    p->any = true;
}

static void init(mpq_t x) { mpq_init(x); }
static void clear(mpq_t x) { mpq_clear(x); }

int reference_pair_distance_compare(const double a[3][3], const double b[3][3], double d)
{
    problem p = { .any = false };
    for_all(&p, init);
    for (int i = 0; i < 9; i++) {
        mpq_set_d(p.corner[0][i / 3][i % 3], a[i / 3][i % 3]);
        mpq_set_d(p.corner[1][i / 3][i % 3], b[i / 3][i % 3]);
    }
    for (int i = 0; i < 49; i++)
        minimise(&p, i / 7, i % 7);
    mpq_set_d(p.part, d);
    mpq_mul(p.part, p.part, p.part);
    int sign = mpq_cmp(p.least, p.part);
    for_all(&p, clear);
    return (sign > 0) - (sign < 0);
}
