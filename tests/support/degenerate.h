/* Degenerate and ill-conditioned cases: one line each in degenerate_cases.c. test_degenerate.c
 * checks every case against its limits; a table of the measured values is in
 * docs/measured/degenerate.md. */
#ifndef EBPO_TESTS_DEGENERATE_H
#define EBPO_TESTS_DEGENERATE_H

#include "query_support.h"

/* A case, and its requirements for being "stable". Members not set in a line are 0, the default. */
typedef struct degenerate_case degenerate_case;
struct degenerate_case {
    const char *name;
    /* degenerate_shapes.c; deterministic and without libm, so that the bits are the same on every
     * machine */
    ebpo_mesh (*make)(const degenerate_case *c);
    double a[4];       /* arguments of the generator */
    const char *solid; /* for the generator `named`: a solid of solids_table.c or query_solids.c */

    /* build options */
    /* the largest number of levels; 0: by the mean edge (EBP 2017, equation 3) */
    int levels;
    uint32_t leaf; /* a node of at most this many faces becomes a leaf; 0: 16 */
    ebpo_rule rule;

    /* required results: always 0 violations, 0 wrong results, and volumes within the limits below;
     * in addition: */
    ebpo_status status;  /* not EBPO_OK: converting fails with this status ... */
    const char *message; /* ... and the message contains this text */
    bool surface;        /* the mesh is not balanced, so a surface; else a solid */
    int reached;         /* required number of levels of the tree; 0: any number */
    double volume;       /* integral of the winding number by a formula; 0: none */
    /* allowed relative error of `volume` for the rounding of coordinates; 0: DEGENERATE_MEASURE */
    double within;
    double measure; /* allowed relative error of ebpo_measure; 0: DEGENERATE_MEASURE */
    double set;     /* volume of the solid as a set of points; 0: equal to `volume`; NAN: unknown */
};
extern const degenerate_case degenerate_cases[];
extern const int degenerate_case_count;

#define DEGENERATE_MEASURE \
    1e-15 /* relative error of ebpo_measure against the exact volume of the mesh */
#define DEGENERATE_ENVELOPE                                                                     \
    1e-9 /* relative rounding error of a level's volume: it may be this much below the solid's, \
            or above that of the level before */

typedef struct degenerate_result {
    uint64_t faces;
    int levels;
    ebpo_status status; /* status of converting */
    char message[480];
    uint64_t checks, violations; /* statistics of verify */
    uint64_t queries, wrong;     /* results */
    bool has_volume;             /* the exact volume is a normal double: the following values are
                                  * meaningful */
    double volume, volume_error; /* exact volume; relative error of ebpo_measure */
    double excess; /* of the last level: volume / volume of the set - 1; NAN: unknown */
    /* the greatest V(level + 1) / V(level) - 1; at most 0 except for rounding */
    double rise;
    double bytes_per_face;
    char fault[640]; /* reason why the case is not stable; "": it is stable */
} degenerate_result;

/* Builds, writes and verifies a case, and queries `queries` points and a quarter as many rays;
 * out->fault describes a failure. */
void degenerate_run(const degenerate_case *c, uint64_t queries, degenerate_result *out);
/* Checks the mesh and builds the tree, and consumes the mesh. */
ebpo_status degenerate_build(const degenerate_case *c, ebpo_mesh *mesh, ebpo_tree *tree,
                             ebpo_error *error);

/* Generators. The comments list the arguments a[0], a[1], ... of each generator. */
ebpo_mesh degenerate_named(const degenerate_case *c); /* .solid */
/* factor, floats, shift: boxes that touch at vertices, edges, faces; volume 3.375 factor^3 */
ebpo_mesh degenerate_shells(const degenerate_case *c);
/* radius, tube, shift, floats: rotated, 1,024 faces */
ebpo_mesh degenerate_torus(const degenerate_case *c);
ebpo_mesh degenerate_ring(const degenerate_case *c);       /* radius, tube, n, m */
ebpo_mesh degenerate_box(const degenerate_case *c);        /* sides x, y, z, squares along a side */
ebpo_mesh degenerate_turned_box(const degenerate_case *c); /* as degenerate_box */
ebpo_mesh degenerate_sphere(const degenerate_case *c);     /* radius, subdivisions, shift */
ebpo_mesh degenerate_cone(const degenerate_case *c);       /* n */
ebpo_mesh degenerate_cylinder(const degenerate_case *c);   /* n */
/* n around, m rows: Schwarz's lantern, whose area grows without bound */
ebpo_mesh degenerate_lantern(const degenerate_case *c);
ebpo_mesh degenerate_wedge(const degenerate_case *c); /* n slivers, their angle */
/* n planes, the angle that contains them; on a block */
ebpo_mesh degenerate_dome(const degenerate_case *c);
/* n: a box of side 2 n, each face connected to its neighbour by one without area; volume 8 n^3 */
ebpo_mesh degenerate_split_edges(const degenerate_case *c);
ebpo_mesh degenerate_t_junctions(const degenerate_case *c); /* n: a box with one side undivided */
/* n steps of 1, in a prism 1 wide; volume n (n + 1) / 2 */
ebpo_mesh degenerate_staircase(const degenerate_case *c);
ebpo_mesh degenerate_dust(const degenerate_case *c); /* n tiny tetrahedra under a face of 1,000 */
ebpo_mesh degenerate_tetrahedra(const degenerate_case *c); /* n apart; volume n / 6 */
/* n nested cubes; volume 2 (n (n + 1))^2, set 8 n^3 */
ebpo_mesh degenerate_nested(const degenerate_case *c);
ebpo_mesh degenerate_repeated(
    const degenerate_case *c); /* the same cube n times; volume n, set 1 */
ebpo_mesh degenerate_minus_zero(const degenerate_case *c); /* a tetrahedron whose zeros are -0.0 */
/* n, m: a bipyramid of n sides whose corners are repeated m times */
ebpo_mesh degenerate_repeated_fan(const degenerate_case *c);
/* depth: Menger's sponge of cells of 1; volume 20^depth */
ebpo_mesh degenerate_menger(const degenerate_case *c);
/* n^3 voxels, each second one filled; n even: volume n^3 / 2 */
ebpo_mesh degenerate_checkers(const degenerate_case *c);
ebpo_mesh degenerate_needles(const degenerate_case *c); /* n needles from one point, their width */
ebpo_mesh degenerate_book(const degenerate_case *c);    /* n tetrahedra sharing one edge */
/* n plates, their thickness, the distance from each plate to the next */
ebpo_mesh degenerate_plates(const degenerate_case *c);
/* n: a box whose vertices are moved by an ulp */
ebpo_mesh degenerate_jittered(const degenerate_case *c);
ebpo_mesh degenerate_soup(const degenerate_case *c); /* n triangles */
/* a tetrahedron with corner 1's x replaced by a[0], and its index by a[1] if not 0; no faces if
 * a[2] */
ebpo_mesh degenerate_broken(const degenerate_case *c);
ebpo_mesh degenerate_triangle(const degenerate_case *c); /* sides a[0], a[1] */
/* radius, distance: a ball of 1,280 faces over a face of 1 */
ebpo_mesh degenerate_ball_and_face(const degenerate_case *c);

#endif
