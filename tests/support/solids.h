/* Small solids for the tests, made by code: exact shapes with known properties, and awkward ones.
 * Everything is deterministic. */
#ifndef EBPO_TESTS_SOLIDS_H
#define EBPO_TESTS_SOLIDS_H

#include <ebpo/file.h>

/* All functions return a mesh that the caller frees with ebpo_mesh_free; they abort when memory is
 * short. Doubles, unless stated. */

ebpo_mesh ebpo_test_tetrahedron(double size);
/* An axis-parallel box of 12 n^2 faces, each side n by n squares. Counter-clockwise seen from
 * outside. */
ebpo_mesh ebpo_test_box(const double low[3], const double high[3], uint32_t n);
/* An icosahedron cut 1 to 4 `subdivisions` times, vertices moved out to the sphere: 20 *
 * 4^subdivisions faces. */
ebpo_mesh ebpo_test_sphere(const double centre[3], double radius, uint32_t subdivisions);
/* 2 n m faces around the z axis; n around the axis, m around the tube. */
ebpo_mesh ebpo_test_torus(double radius, double tube, uint32_t n, uint32_t m);
/* A cone of 2 n faces with its apex on the z axis: slivers when n is large. */
ebpo_mesh ebpo_test_cone(double radius, double height, uint32_t n);
/* count separate tetrahedra on a grid. */
ebpo_mesh ebpo_test_tetrahedra(uint32_t count);
/* Boundary of the filled voxels (filled[(z * n + y) * n + x] != 0) of an n^3 grid with cells of
 * size `cell`. Corners are shared: edges at which four faces meet and bow-tie vertices come about
 * where voxels touch. Volume: filled voxels * cell^3. */
ebpo_mesh ebpo_test_voxels(const uint8_t *filled, uint32_t n, double cell);
/* Voxels filled at random, about `percent` of n^3. */
ebpo_mesh ebpo_test_blob(uint32_t n, uint32_t percent, uint64_t seed);
/* n steps, each one cell high, deep and wide. */
ebpo_mesh ebpo_test_staircase(uint32_t n);
/* A band of 2 n faces; it cannot be oriented when `twisted`. */
ebpo_mesh ebpo_test_band(uint32_t n, bool twisted);
/* A square of size x size in z = 0, n by n cells, normal +z: an open surface. */
ebpo_mesh ebpo_test_sheet(double size, uint32_t n);

/* Tools. */
void ebpo_test_append(ebpo_mesh *mesh, const ebpo_mesh *other); /* vertices are not shared */
/* doubles only; its number */
uint32_t ebpo_test_append_vertex(ebpo_mesh *mesh, double x, double y, double z);
void ebpo_test_turn_face(ebpo_mesh *mesh, uint64_t face); /* the other orientation */
void ebpo_test_append_face(ebpo_mesh *mesh, uint32_t a, uint32_t b, uint32_t c);
void ebpo_test_reverse(ebpo_mesh *mesh);  /* turns every face */
void ebpo_test_to_float(ebpo_mesh *mesh); /* rounds the coordinates */
/* doubles only */
void ebpo_test_transform(ebpo_mesh *mesh, const double matrix[3][3], const double offset[3]);
/* renumbers vertices and faces, turns corners */
void ebpo_test_shuffle(ebpo_mesh *mesh, uint64_t seed);
/* three own vertices for every face */
void ebpo_test_split_vertices(ebpo_mesh *mesh);
void ebpo_test_point(const ebpo_mesh *mesh, uint64_t vertex, double out[3]);

/* splitmix64 (Steele, Lea, Flood 2014). */
uint64_t ebpo_test_random(uint64_t *state);
double ebpo_test_random_unit(uint64_t *state); /* [0, 1) */
/* Cosine and sine of the turn i / n, 0 <= i, within some ulps and without libm: the same bits
 * wherever arithmetic is IEEE's. */
void ebpo_test_circle(uint32_t i, uint32_t n, double *cosine, double *sine);

/* EBPO_TEST_SCALE, 1 where it is not set: with other compilers and sanitizers less is repeated. */
double ebpo_test_scale(void);
/* So many times `count`, at least 1. */
uint64_t ebpo_test_scaled(uint64_t count);
/* Of a loop's turns: every turn, or with EBPO_TEST_SCALE below 1 so many of them, evenly. */
bool ebpo_test_wanted(int turn);

/* One solid (or surface) of the table. */
typedef struct ebpo_test_solid {
    const char *name;
    ebpo_mesh (*make)(void);
    bool balanced;
    bool manifold;
    /* integral of the winding number; NAN when there is no simple formula, 0 for surfaces */
    double volume;
} ebpo_test_solid;

extern const ebpo_test_solid ebpo_test_solids[];
extern const int ebpo_test_solid_count;
/* By name; aborts when there is none. */
ebpo_mesh ebpo_test_make(const char *name);

/* What ebpo_file_get_stats tells. */
static inline ebpo_file_stats ebpo_test_file_stats(const ebpo_file *file)
{
    ebpo_file_stats stats = EBPO_FILE_STATS_INIT;
    ebpo_file_get_stats(file, &stats);
    return stats;
}

#endif
