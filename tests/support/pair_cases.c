/* Generates difficult pairs of faces. */
#include <math.h>
#include <string.h>

#include "exact_reference.h"
#include "pair_reference.h"

const char *reference_pair_name(int kind)
{
    static const char *const names[REFERENCE_PAIR_KINDS] = { "uniform",
                                                             "small integers",
                                                             "integers of a slanted plane",
                                                             "integers of two levels",
                                                             "corners shared",
                                                             "an edge shared, nearly one plane",
                                                             "needles",
                                                             "without area, integers",
                                                             "without area, one through the other",
                                                             "a corner nearly on the other face",
                                                             "an edge nearly in the other's plane",
                                                             "translated by 1e7",
                                                             "any exponent",
                                                             "integers times a power of two",
                                                             "an edge nearly through an edge" };
    return names[kind];
}

static double integer(uint64_t *state, int64_t most)
{
    return (double)reference_integer(state, -most, most);
}

static void fill(double t[3][3], uint64_t *state, int64_t most)
{
    for (int i = 0; i < 9; i++)
        t[i / 3][i % 3] = most ? integer(state, most) : reference_uniform(state);
}

static void shear(double t[3][3], double x, double y)
{
    for (int i = 0; i < 3; i++)
        t[i][2] = x * t[i][0] + y * t[i][1];
}

static double moved(double x, uint64_t *state)
{
    for (int64_t ulps = reference_integer(state, 0, 2); ulps > 0; ulps--)
        x = nextafter(x, reference_random(state) & 1 ? INFINITY : -INFINITY);
    return x;
}

/* Returns a point of the face in doubles, on an edge one time in three, moved by some ulps. */
static void nearly_on(double t[3][3], double out[3], uint64_t *state)
{
    double u = fabs(reference_uniform(state)), v = fabs(reference_uniform(state)) * (1 - u);
    if (reference_random(state) % 3 == 0)
        v = 0;
    for (int k = 0; k < 3; k++)
        out[k] = moved(t[0][k] + u * (t[1][k] - t[0][k]) + v * (t[2][k] - t[0][k]), state);
}

/* Lets the edge from corner `at` of b nearly intersect the edge from corner 0 of a. */
static void nearly_through(double a[3][3], double b[3][3], int at, uint64_t *state)
{
    double u = fabs(reference_uniform(state)), v = 0.25 + fabs(reference_uniform(state));
    for (int k = 0; k < 3; k++) {
        double middle = a[0][k] + u * (a[1][k] - a[0][k]);
        b[(at + 1) % 3][k] = moved(middle + v * (middle - b[at][k]), state);
    }
}

/* Puts the corners on one line, or at one point. */
static void flatten(double t[3][3], uint64_t *state)
{
    int64_t kind = reference_integer(state, 0, 3);
    for (int k = 0; k < 3; k++) {
        double d = t[1][k] - t[0][k];
        t[2][k] = kind == 0 ? t[0][k] : kind == 1 ? t[1][k] : t[0][k] + (kind == 2 ? 2 : -1) * d;
        if (kind == 0 && d == 1)
            t[1][k] = t[0][k];
    }
}

/* Makes a segment through the middle of a face, of integers. */
static void impale(double a[3][3], double b[3][3], uint64_t *state)
{
    fill(a, state, 3);
    int twice = (int)(reference_random(state) & 1);
    for (int k = 0; k < 3; k++) {
        double middle = a[0][k] + a[1][k] + a[2][k], d = integer(state, 2);
        for (int i = 0; i < 3; i++)
            a[i][k] *= 3;
        b[0][k] = middle + d;
        b[1][k] = middle - (double)reference_integer(state, 0, 2) * d;
        b[2][k] = b[twice][k];
    }
}

static void scale(double a[3][3], double b[3][3], int exponent)
{
    for (int i = 0; i < 9; i++) {
        a[i / 3][i % 3] = ldexp(a[i / 3][i % 3], exponent);
        b[i / 3][i % 3] = ldexp(b[i / 3][i % 3], exponent);
    }
}

static void needles(double a[3][3], double b[3][3], uint64_t *state)
{
    fill(a, state, 0);
    fill(b, state, 0);
    nearly_on(a, a[2], state);
    if (reference_random(state) & 1)
        nearly_on(b, b[2], state);
    if (reference_random(state) & 1)
        nearly_on(a, b[0], state);
}

void reference_pair_case(double a[3][3], double b[3][3], int kind, uint64_t *state)
{
    fill(a, state, kind == 1 || kind == 7 || kind == 13 ? 2 : kind == 2 || kind == 3 ? 4 : 0);
    fill(b, state, kind == 1 || kind == 7 || kind == 13 ? 2 : kind == 2 || kind == 3 ? 4 : 0);
    int shared = 1 + (int)reference_integer(state, 0, 1), at = (int)reference_integer(state, 0, 2);
    int exponent = (int)reference_integer(state, -1070, 990);
    switch (kind) {
    case 2: shear(a, 1, 2), shear(b, 1, 2); break;
    case 3:
        for (int i = 0; i < 3; i++)
            a[i][2] = a[i][2] > 0, b[i][2] = b[i][2] > 0;
        break;
    case 4:
        for (int i = 0; i < shared; i++)
            memcpy(b[(at + i) % 3], a[i], sizeof a[i]);
        break;
    case 5:
        memcpy(b[at], a[0], sizeof a[0]);
        memcpy(b[(at + 1) % 3], a[1], sizeof a[1]);
        nearly_on(a, b[(at + 2) % 3], state);
        break;
    case 6: needles(a, b, state); break;
    case 7:
        flatten(a, state);
        shared == 1 ? flatten(b, state) : (void)0;
        break;
    case 8: impale(a, b, state); break;
    case 9: nearly_on(a, b[at], state); break;
    case 10: nearly_on(a, b[at], state), nearly_on(a, b[(at + 1) % 3], state); break;
    case 11:
        for (int i = 0; i < 9; i++) {
            a[i / 3][i % 3] = 1e7 + 1e-3 * a[i / 3][i % 3];
            b[i / 3][i % 3] = 1e7 + 1e-3 * b[i / 3][i % 3];
        }
        break;
    case 12: /* drawn for each corner: some parts are tiny compared with others */
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) {
                a[i][k] = ldexp(a[i][k], (int)reference_integer(state, -3, 3));
                b[i][k] = ldexp(b[i][k], (int)reference_integer(state, -60, 3));
            }
        scale(a, b, exponent);
        break;
    case 13: scale(a, b, exponent); break;
    case 14: nearly_through(a, b, at, state); break;
    default: break;
    }
    if (reference_random(state) & 1) {
        double c[3][3];
        memcpy(c, a, sizeof c);
        memcpy(a, b, sizeof c);
        memcpy(b, c, sizeof c);
    }
}
