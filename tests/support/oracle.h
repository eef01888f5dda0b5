/* A judge for questions to small meshes: brute force over all faces in integers of any size (GMP).
 * Written apart from the library: nothing of it decides here. Floating point is used only to leave
 * out faces that certainly do not matter, with margins a thousand times larger than any rounding
 * error; what is left is computed without rounding. */
#ifndef EBPO_TESTS_ORACLE_H
#define EBPO_TESTS_ORACLE_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/mesh.h>

/* A mesh to be asked about. Not for several threads at once: it holds scratch. Functions abort when
 * memory is short. */
typedef struct oracle oracle;
oracle *oracle_make(const ebpo_mesh *mesh); /* copies; coordinates are finite */
void oracle_free(oracle *o);

/* The nearest faces of a point. */
typedef struct oracle_nearest {
    double distance; /* correctly rounded, ties to even; INFINITY when it overflows */
    bool on;         /* the exact distance is 0: the point is on a closed triangle */
    /* all faces at exactly this distance, ascending; the oracle's, until its next call */
    const uint32_t *faces;
    uint32_t count;
} oracle_nearest;
void oracle_find_nearest(oracle *o, const double p[3], oracle_nearest *out);

/* Sign of (exact distance - d), d >= 0 or INFINITY, for the point of the last oracle_find_nearest.
 */
int oracle_distance_compare(oracle *o, double d);
/* The double nearest to the exact distance between a point and one face. */
double oracle_face_distance(oracle *o, const double p[3], uint32_t face);

typedef struct oracle_near {
    uint32_t face;
    double distance; /* correctly rounded */
} oracle_near;
/* All faces at most `radius` away (0 or more, or INFINITY; compared exactly), by exact distance,
 * then by number. The caller frees them. */
oracle_near *oracle_order(oracle *o, const double p[3], double radius, uint32_t *count);

/* Winding number of a point that is on no face; the mesh balances. Signed crossings of a ray in the
 * first of a row of directions that meets no edge, no vertex and is parallel to no face that it
 * meets. */
int32_t oracle_winding(oracle *o, const double p[3]);

/* The integral of the winding number over space, correctly rounded; the mesh balances. */
double oracle_volume(oracle *o);

/* Unit normal by orientation, within some ulps; (0, 0, 0) without area. */
void oracle_normal(oracle *o, uint32_t face, double out[3]);

typedef struct oracle_hit {
    uint32_t face;
    int side;   /* as ebpo_ray_hit */
    int facing; /* 1: against the normal, -1: along it, 0: no area, or within the plane */
    double t;   /* correctly rounded */
} oracle_hit;
/* The closed triangles that origin + t direction, 0 <= t <= t_max meets, by the exact t of the
 * first common point, then by number. The hits are the oracle's, until its next call. */
void oracle_ray(oracle *o, const double origin[3], const double direction[3], double t_max,
                const oracle_hit **hits, uint32_t *count);

/* The closed triangles that meet the closed box, ascending. The oracle's, until its next call. */
void oracle_box(oracle *o, const double min[3], const double max[3], const uint32_t **faces,
                uint32_t *count);

#endif
