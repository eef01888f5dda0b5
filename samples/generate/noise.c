#include "noise.h"

#include <math.h>

static uint64_t mix(uint64_t z)
{
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

/* Returns the dot product of the gradient of the lattice point (x, y, z), which is one of 12
 * directions, with the offset (dx, dy, dz) of a point from this lattice point. */
static double gradient(int64_t x, int64_t y, int64_t z, uint64_t seed, double dx, double dy,
                       double dz)
{
    static const double directions[12][3] = { { 1, 1, 0 },   { -1, 1, 0 },  { 1, -1, 0 },
                                              { -1, -1, 0 }, { 1, 0, 1 },   { -1, 0, 1 },
                                              { 1, 0, -1 },  { -1, 0, -1 }, { 0, 1, 1 },
                                              { 0, -1, 1 },  { 0, 1, -1 },  { 0, -1, -1 } };
    uint64_t h = mix(seed + (uint64_t)x * 0x9e3779b97f4a7c15u + (uint64_t)y * 0xc2b2ae3d27d4eb4fu +
                     (uint64_t)z * 0x165667b19e3779f9u);
    const double *g = directions[h % 12];
    return g[0] * dx + g[1] * dy + g[2] * dz;
}

static double fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }

static double blend(double a, double b, double t) { return a + t * (b - a); }

double ebpo_noise(const double p[3], uint64_t seed)
{
    double base[3], d[3], row[2], layer[2];
    int64_t i[3];
    for (int k = 0; k < 3; k++) {
        base[k] = floor(p[k]);
        d[k] = p[k] - base[k];
        i[k] = (int64_t)base[k];
    }
    for (int z = 0; z < 2; z++) {
        for (int y = 0; y < 2; y++) {
            double a = gradient(i[0], i[1] + y, i[2] + z, seed, d[0], d[1] - y, d[2] - z);
            double b = gradient(i[0] + 1, i[1] + y, i[2] + z, seed, d[0] - 1, d[1] - y, d[2] - z);
            row[y] = blend(a, b, fade(d[0]));
        }
        layer[z] = blend(row[0], row[1], fade(d[1]));
    }
    return blend(layer[0], layer[1], fade(d[2]));
}

double ebpo_noise_octaves(const double p[3], double longest, double shortest, uint64_t seed)
{
    double sum = 0, weight = 0, strength = 1;
    for (double wave = longest; wave >= shortest && strength > 0.02; wave /= 2, strength /= 2) {
        double q[3] = { p[0] / wave + 0.37, p[1] / wave + 0.71, p[2] / wave + 0.13 };
        sum += strength * ebpo_noise(q, mix(++seed));
        weight += strength;
    }
    return weight > 0 ? sum / weight : 0;
}

/* Computes cosine and sine of an angle of at most an eighth of a turn by Taylor series. With 11
 * terms, the error is only the rounding error. */
static void small_angle(double a, double *cosine, double *sine)
{
    double term = 1, c = 0, s = 0;
    for (int k = 0; k < 22; k++) {
        if (k % 2 == 0)
            c += k % 4 == 0 ? term : -term;
        else
            s += k % 4 == 1 ? term : -term;
        term *= a / (k + 1);
    }
    *cosine = c;
    *sine = s;
}

void ebpo_circle(double turns, double *cosine, double *sine)
{
    const double pi = 3.14159265358979323846;
    int quarter = (int)floor(turns * 4 + 0.5);
    double c, s;
    small_angle(2 * pi * (turns - quarter / 4.0), &c, &s);
    static const int turned[4][4] = {
        { 1, 0, 0, 1 }, { 0, -1, 1, 0 }, { -1, 0, 0, -1 }, { 0, 1, -1, 0 }
    };
    const int *t = turned[quarter % 4];
    *cosine = t[0] * c + t[1] * s;
    *sine = t[2] * c + t[3] * s;
}
