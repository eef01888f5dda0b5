/* The stiff and extreme cases: one line each in stiff_cases.c. test_stiff holds every case to its
 * limits, stiff_table prints what was measured (docs/measured/stiff.md). */
#ifndef EBPO_TESTS_STIFF_H
#define EBPO_TESTS_STIFF_H

#include "query_kit.h"

/* A case, and what "stable" means for it. What is not named in a line is 0, which stands for the
 * usual. */
typedef struct stiff_case stiff_case;
struct stiff_case {
    const char *name;
    /* stiff_shapes.c; deterministic and without libm, so that the bits are the same everywhere */
    ebpo_mesh (*make)(const stiff_case *c);
    double a[4];       /* of the generator */
    const char *solid; /* of the generator `named`: one of solids_table.c or query_solids.c */

    /* how it is built */
    /* the largest number of levels; 0: by the mean edge (EBP 2017, equation 3) */
    int levels;
    uint32_t leaf; /* a node of at most so many faces becomes a leaf; 0: 16 */
    ebpo_rule rule;

    /* what must come out: always 0 violations and 0 wrong answers, and volumes within the limits
     * below; besides */
    ebpo_status status;  /* not EBPO_OK: converting fails so ... */
    const char *message; /* ... and the message holds this */
    bool surface;        /* does not balance; else a solid */
    int reached;         /* number of levels of the tree; 0: any */
    double volume;       /* integral of the winding number by a formula; 0: none */
    /* relative error that rounding the coordinates may make in that; 0: STIFF_MEASURE */
    double within;
    double measure; /* relative error that ebpo_measure may make; 0: STIFF_MEASURE */
    double set;     /* volume of the set of points; 0: as the integral; NAN: not known */
};
extern const stiff_case stiff_cases[];
extern const int stiff_case_count;

#define STIFF_MEASURE \
    1e-15 /* relative error of ebpo_measure against the exact volume of the mesh */
#define STIFF_ENVELOPE                                                                             \
    1e-9 /* by so much, relatively, a level's volume may be below the solid's or above the level's \
            before: its sum is rounded */

typedef struct stiff_result {
    uint64_t faces;
    int levels;
    ebpo_status status; /* of converting */
    char message[480];
    uint64_t checks, violations; /* of verify */
    uint64_t asked, wrong;       /* answers */
    bool has_volume;             /* the exact volume is a normal double: what follows makes sense */
    double volume, volume_error; /* exact volume; relative error of ebpo_measure */
    double excess; /* of the last level: volume / volume of the set - 1; NAN: not known */
    /* the greatest of V(level + 1) / V(level) - 1; at most 0 but for rounding */
    double rise;
    double bytes_per_face;
    char fault[640]; /* why it is not stable; "": it is */
} stiff_result;

/* Builds, writes, verifies, asks `questions` points and a quarter as many rays; for all that fails
 * `fault` tells. */
void stiff_run(const stiff_case *c, uint64_t questions, stiff_result *out);
/* Check and build alone, the mesh is consumed. */
ebpo_status stiff_build(const stiff_case *c, ebpo_mesh *mesh, ebpo_tree *tree, ebpo_error *error);

/* Generators, each with its arguments a[0], a[1], ... */
ebpo_mesh stiff_named(const stiff_case *c); /* .solid */
/* factor, floats, shift: boxes that touch at vertices, edges, faces; volume 3.375 factor^3 */
ebpo_mesh stiff_shells(const stiff_case *c);
/* radius, tube, shift, floats: turned, 1,024 faces */
ebpo_mesh stiff_torus(const stiff_case *c);
ebpo_mesh stiff_ring(const stiff_case *c);       /* radius, tube, n, m */
ebpo_mesh stiff_box(const stiff_case *c);        /* sides x, y, z, squares along a side */
ebpo_mesh stiff_turned_box(const stiff_case *c); /* the same */
ebpo_mesh stiff_sphere(const stiff_case *c);     /* radius, subdivisions, shift */
ebpo_mesh stiff_cone(const stiff_case *c);       /* n */
ebpo_mesh stiff_cylinder(const stiff_case *c);   /* n */
/* n around, m rows: Schwarz's, whose area grows beyond all limits */
ebpo_mesh stiff_lantern(const stiff_case *c);
ebpo_mesh stiff_wedge(const stiff_case *c); /* n slivers of an angle */
ebpo_mesh stiff_dome(const stiff_case *c);  /* n planes within an angle, on a block */
/* n: a box of side 2 n, each face closed towards its neighbour by one without area; volume 8 n^3 */
ebpo_mesh stiff_split_edges(const stiff_case *c);
ebpo_mesh stiff_t_junctions(const stiff_case *c); /* n: a box with one side undivided */
/* n steps of 1, in a prism 1 wide; volume n (n + 1) / 2 */
ebpo_mesh stiff_staircase(const stiff_case *c);
ebpo_mesh stiff_dust(const stiff_case *c);       /* n tiny tetrahedra below a face of 1,000 */
ebpo_mesh stiff_tetrahedra(const stiff_case *c); /* n apart; volume n / 6 */
/* n cubes in one another; volume 2 (n (n + 1))^2, set 8 n^3 */
ebpo_mesh stiff_nested(const stiff_case *c);
ebpo_mesh stiff_repeated(const stiff_case *c);   /* the same cube n times; volume n, set 1 */
ebpo_mesh stiff_minus_zero(const stiff_case *c); /* a tetrahedron whose zeros are -0.0 */
/* a bipyramid of n sides whose corners are there m times; */
ebpo_mesh stiff_repeated_fan(const stiff_case *c);
/* depth: Menger's sponge of cells of 1; volume 20^depth */
ebpo_mesh stiff_menger(const stiff_case *c);
/* n^3 voxels, each second one filled; n even: volume n^3 / 2 */
ebpo_mesh stiff_checkers(const stiff_case *c);
ebpo_mesh stiff_needles(const stiff_case *c); /* n needles of a width, out of one point */
ebpo_mesh stiff_book(const stiff_case *c);    /* n tetrahedra at one edge */
/* n plates of a thickness, twice a distance apart */
ebpo_mesh stiff_plates(const stiff_case *c);
/* n: a box whose vertices were moved by an ulp */
ebpo_mesh stiff_jittered(const stiff_case *c);
ebpo_mesh stiff_soup(const stiff_case *c); /* n triangles */
/* a tetrahedron with corner 1's x replaced by a[0], and its index by a[1] if not 0; no faces if
 * a[2] */
ebpo_mesh stiff_broken(const stiff_case *c);
ebpo_mesh stiff_triangle(const stiff_case *c); /* sides a[0], a[1] */
/* radius, distance: a ball of 1,280 faces over a face of 1 */
ebpo_mesh stiff_ball_and_face(const stiff_case *c);

#endif
