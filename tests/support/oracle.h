/* Reference implementation of queries for small meshes: brute force over all faces in integers of
 * any size (GMP). Independent of the library. Floating point only excludes faces that certainly do
 * not matter, with margins a thousand times larger than any rounding error. All other computations
 * are exact. */
#ifndef EBPO_TESTS_ORACLE_H
#define EBPO_TESTS_ORACLE_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/mesh.h>

/* A mesh to query. An oracle has scratch memory, so only one thread at a time may use it. Functions
 * abort if there is not enough memory. */
typedef struct oracle oracle;
oracle *oracle_make(const ebpo_mesh *mesh); /* copies; coordinates are finite */
void oracle_free(oracle *o);

/* The nearest faces of a point. */
typedef struct oracle_nearest {
    double distance; /* correctly rounded, ties to even; INFINITY when it overflows */
    bool on;         /* the exact distance is 0: the point is on a closed triangle */
    /* all faces at exactly this distance, ascending; valid until the next call */
    const uint32_t *faces;
    uint32_t count;
} oracle_nearest;
void oracle_find_nearest(oracle *o, const double p[3], oracle_nearest *out);

/* Returns the sign of (exact distance - d), d >= 0 or INFINITY, for the point of the last
 * oracle_find_nearest. */
int oracle_distance_compare(oracle *o, double d);
/* Returns the double nearest to the exact distance between a point and one face. */
double oracle_face_distance(oracle *o, const double p[3], uint32_t face);

typedef struct oracle_near {
    uint32_t face;
    double distance; /* correctly rounded */
} oracle_near;
/* Returns all faces at most `radius` away (at least 0, or INFINITY; compared exactly), by exact
 * distance, then by index. The caller frees them. */
oracle_near *oracle_order(oracle *o, const double p[3], double radius, uint32_t *count);

/* Returns the winding number of a point that is on no face; the mesh is balanced. It sums signed
 * crossings of a ray, in the first of several directions that intersects no edge or vertex and is
 * parallel to no face that it intersects. */
int32_t oracle_winding(oracle *o, const double p[3]);

/* Returns the integral of the winding number over space, correctly rounded; the mesh is balanced.
 */
double oracle_volume(oracle *o);

/* Computes the outward unit normal of a face, within some ulps; (0, 0, 0) for a face without area.
 */
void oracle_normal(oracle *o, uint32_t face, double out[3]);

typedef struct oracle_hit {
    uint32_t face;
    int side;   /* as ebpo_ray_hit */
    int facing; /* 1: against the normal, -1: along it, 0: no area, or within the plane */
    double t;   /* correctly rounded */
} oracle_hit;
/* Finds the closed triangles that intersect origin + t direction, 0 <= t <= t_max, by the exact t
 * of the first common point, then by index. The hits are valid until the next call. */
void oracle_ray(oracle *o, const double origin[3], const double direction[3], double t_max,
                const oracle_hit **hits, uint32_t *count);

/* Finds the closed triangles that intersect the closed box, ascending. They are valid until the
 * next call. */
void oracle_box(oracle *o, const double min[3], const double max[3], const uint32_t **faces,
                uint32_t *count);

#endif
