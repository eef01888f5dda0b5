/* Internal parts of the oracle. */
#ifndef EBPO_TESTS_ORACLE_PARTS_H
#define EBPO_TESTS_ORACLE_PARTS_H

#include <stddef.h>

#include <gmp.h>

#include "oracle.h"

typedef mpz_t oracle_vector[3];

/* A number num / den * 2^exponent, den > 0. */
typedef struct oracle_fraction {
    mpz_t num, den;
} oracle_fraction;

/* A ray's hit, before sorting. */
typedef struct oracle_ray_item {
    oracle_fraction t;
    uint32_t face;
    int side, facing;
} oracle_ray_item;

struct oracle {
    uint32_t face_count, vertex_count;
    uint32_t *faces; /* [face_count][3] */
    double *xyz;     /* [vertex_count][3] */
    /* [face_count] coordinates times 2^-scale, so that the largest is about 1 */
    double (*corner)[9];
    double (*box)[6]; /* [face_count] min, max of the original coordinates */
    double min[3], max[3];
    int scale;
    int exponent;   /* coordinates are integers times 2^exponent */
    mpz_t *integer; /* [vertex_count][3] these integers */
    bool *flat;     /* [face_count] without area, exactly */
    /* scratch */
    int e; /* the unit of the following values is 2^e */
    oracle_vector p, a[3], edge[3], normal, direction, v[6];
    mpz_t s[12];
    oracle_fraction best, one, other;
    uint32_t *found;  /* [face_count] */
    double *low;      /* [face_count] */
    oracle_hit *hits; /* [face_count] */
    oracle_ray_item *items;
    uint32_t item_capacity; /* number of initialised items */
};

/* Returns the exponent of the lowest bit of x; INT_MAX for 0. */
int oracle_low_bit(double x);
/* Sets z = x / 2^e, which is an integer. */
void oracle_set(mpz_t z, double x, int e);
/* Chooses the unit for the mesh and for the points `p`, which have `count` coordinates in total. */
void oracle_choose_unit(oracle *o, const double *p, int count);
/* Loads a face in the unit: a[i] = corner i of the face - p, edge[i] = a[i + 1] - a[i], normal =
 * edge[0] x edge[1]. */
void oracle_load(oracle *o, uint32_t face);
/* Vectors are three numbers. */
void oracle_cross(mpz_t *out, mpz_t *a, mpz_t *b);
void oracle_dot(mpz_t out, mpz_t *a, mpz_t *b);
/* Returns the sign of a - b; uses s[10], s[11]. */
int oracle_fraction_compare(oracle *o, const oracle_fraction *a, const oracle_fraction *b);
void oracle_fraction_swap(oracle_fraction *a, oracle_fraction *b);
/* Returns the double nearest to num / den * 2^exponent, or with `root` to its square root (exponent
 * even); num >= 0, den > 0. */
double oracle_round(const mpz_t num, const mpz_t den, int exponent, bool root);

#endif
