/* The table of degenerate and ill-conditioned cases. A new case is a new line here; degenerate.h
 * describes its fields, the generators are in degenerate_shapes.c. */
#include <math.h>

#include "degenerate.h"

#define FLOATS 1

/* clang-format off */
const degenerate_case degenerate_cases[] = {
    /* regular ones, for comparison */
    { "torus of 5,000 faces, tame", degenerate_ring, .a = { 2, 0.7, 72, 36 } },
    { "sphere of 5,120 faces", degenerate_sphere, .a = { 1, 4 } },

    /* numbers of all sizes */
    { "coordinates of 1e-38, float", degenerate_shells, .a = { 1e-38, FLOATS } },
    { "coordinates of 1e+38, float", degenerate_shells, .a = { 1e38, FLOATS }, .volume = 3.375e114, .within = 1e-6 },
    { "denormal floats", degenerate_shells, .a = { 0x1p-145, FLOATS } },
    { "coordinates of 1e-300", degenerate_shells, .a = { 1e-300 } },
    { "coordinates of 1e-160, whose products are denormal", degenerate_shells, .a = { 1e-160 } },
    { "coordinates of 1e+160, whose products overflow", degenerate_shells, .a = { 1e160 } },
    { "coordinates of 1e+300", degenerate_shells, .a = { 1e300 } },
    { "denormal doubles", degenerate_shells, .a = { 0x1p-1060 } },
    { "the least doubles", degenerate_shells, .a = { 0x1p-1072 } },
    { "the largest doubles", degenerate_shells, .a = { 5e307 }, .status = EBPO_E_LIMIT, .message = "too large for an exact grid" },
    { "1e-300, 1 and 1e+300 at once", degenerate_named, .solid = "all_scales", .set = NAN },
    { "-0.0 and 0.0", degenerate_minus_zero, .a = { 1 }, .volume = 1.0 / 6 },

    /* far from the origin */
    { "moved by 1e7, double", degenerate_torus, .a = { 10, 3, 1e7 } },
    { "moved by 1e7, float: steps of 1 in a model of 200", degenerate_torus, .a = { 100, 30, 1e7, FLOATS }, .set = NAN },
    { "moved by 1e7, float: steps of 1 in a model of 10", degenerate_torus, .a = { 5, 2, 1e7, FLOATS }, .set = NAN },
    { "moved by 2^52: all coordinates are integers", degenerate_shells, .a = { 4, 0, 0x1p52 }, .volume = 3.375 * 64 },
    { "moved by 1e15: a sphere of steps of 1/8", degenerate_sphere, .a = { 10, 3, 1e15 }, .set = NAN },

    /* long and thin */
    { "aspect 1e6 : 1 : 1", degenerate_box, .a = { 1e6, 1, 1, 8 }, .volume = 1e6 },
    { "aspect 1e6 : 1 : 1, turned", degenerate_turned_box, .a = { 1e6, 1, 1, 8 } },
    { "aspect 1e6 : 1e6 : 1, turned", degenerate_turned_box, .a = { 1e6, 1e6, 1, 8 } },
    { "aspect 1e15 : 1 : 1", degenerate_box, .a = { 1e15, 1, 1, 8 }, .volume = 1e15 },
    { "aspect 1e100 : 1 : 1e-100", degenerate_box, .a = { 1e100, 1, 1e-100, 4 }, .volume = 1 },
    /* ebpo_measure has one unit for all axes, in which this volume underflows to 0 */
    { "aspect 1e300 : 1 : 1e-300", degenerate_box, .a = { 1e300, 1, 1e-300, 4 }, .volume = 1, .measure = 1 },
    { "2,000 slivers of 1e-9", degenerate_wedge, .a = { 1000, 1e-9 } },
    { "2,000 slivers of 1e-15", degenerate_wedge, .a = { 1000, 1e-15 } },
    { "sliver tetrahedra of 1e-13", degenerate_named, .solid = "sliver" },
    { "300 needles of 1e-6 out of one point", degenerate_needles, .a = { 300, 1e-6 }, .set = NAN },
    { "Schwarz's lantern of 16 by 512", degenerate_lantern, .a = { 16, 512 } },

    /* faces that repeat, cancel, are in contact or have no area */
    { "each third face without area", degenerate_split_edges, .a = { 16 }, .volume = 8 * 4096 },
    { "a tetrahedron with a face without area", degenerate_named, .solid = "zero_area_face", .volume = 8.0 / 6 },
    { "a face that names a vertex twice", degenerate_named, .solid = "index_repeated_face", .volume = 1.0 / 6 },
    { "repeated faces", degenerate_named, .solid = "repeated_faces", .volume = 1 },
    { "coincident opposite faces", degenerate_named, .solid = "coincident_opposite_faces", .volume = 2 },
    { "a cube and its inverse in other triangles", degenerate_named, .solid = "cube_and_its_inverse", .volume = 1 },
    { "T-junctions", degenerate_t_junctions, .a = { 8 }, .surface = true },
    { "a cube 1,000 times: winding number 1,000", degenerate_repeated, .a = { 1000 }, .volume = 1000, .set = 1 },
    { "1,000 nested cubes: winding numbers to 1,000", degenerate_nested, .a = { 1000 }, .volume = 2 * 1001000.0 * 1001000, .set = 8e9 },
    { "nested shells of both directions", degenerate_named, .solid = "nested_windings", .set = NAN },
    { "a cavity", degenerate_named, .solid = "cavity", .volume = 56 },
    { "shells that touch at a vertex", degenerate_named, .solid = "touching_at_vertex", .volume = 2 },
    { "shells that touch at an edge", degenerate_named, .solid = "touching_at_edge", .volume = 2 },
    { "shells that touch at a face", degenerate_named, .solid = "touching_at_face", .volume = 2 },
    { "a fan whose 10 corners are there 1,000 times each", degenerate_repeated_fan, .a = { 10, 1000 } },
    { "a cube jittered by an ulp", degenerate_jittered, .a = { 12 } },
    { "shells one ulp apart", degenerate_named, .solid = "gap_of_one_ulp" },
    { "shells that overlap by one ulp", degenerate_named, .solid = "overlap_of_one_ulp" },
    { "a spindle torus that crosses itself", degenerate_ring, .a = { 1, 1.5, 48, 36 }, .set = NAN },
    { "4,096 voxels, each second one filled: all edges have four faces", degenerate_checkers, .a = { 16 }, .volume = 2048 },
    { "Menger's sponge of depth 3", degenerate_menger, .a = { 3 }, .volume = 8000 },

    /* cells */
    { "a box of a power of two", degenerate_box, .a = { 64, 64, 64, 32 }, .volume = 262144 },
    { "faces exactly in cell walls", degenerate_named, .solid = "boxes_in_walls", .set = NAN },
    { "a staircase of 4,096 steps", degenerate_staircase, .a = { 4096 }, .volume = 4096.0 * 4097 / 2 },
    { "one tetrahedron", degenerate_named, .solid = "tetrahedron", .volume = 1.0 / 6, .reached = 1 },
    { "one triangle", degenerate_triangle, .a = { 1, 2 }, .surface = true, .reached = 1 },
    { "one triangle that is a point", degenerate_triangle, .a = { 0, 0 }, .surface = true },
    { "one leaf: level 0, 5,120 faces", degenerate_sphere, .a = { 1, 4 }, .levels = 1, .reached = 1 },
    { "the longest edge makes level 0 the leaf", degenerate_box, .a = { 1, 1, 1, 1 }, .volume = 1, .reached = 1 },
    { "level 20: a cone's apex of 40 faces", degenerate_cone, .a = { 40 }, .levels = 21, .leaf = 8, .reached = 21 },
    { "level 20: a ball of 2^-14 before a face of 1", degenerate_ball_and_face, .a = { 0x1p-14, 0x1.8p-14 }, .levels = 21, .leaf = 8 },
    { "a face of 1,000 beside 100,000 of 0.01", degenerate_dust, .a = { 25000 }, .volume = 1e9 / 6 + 25000 / 6.0 * 0x1p-21, .within = 1e-12 },
    { "10,000 components", degenerate_tetrahedra, .a = { 10000 }, .volume = 10000 / 6.0, .within = 1e-14 },
    { "a vertex of 100,000 faces", degenerate_cone, .a = { 100000 } },
    { "1,000 tetrahedra at one edge", degenerate_book, .a = { 1000 } },
    { "walls thinner than a cell: a hollow cube of 1e-9", degenerate_named, .solid = "thin_hollow" },
    { "walls thinner than a cell: 500 plates of 1e-9", degenerate_plates, .a = { 500, 1e-9, 2e-3 } },
    { "all vertices in a plane, a solid without points", degenerate_named, .solid = "flat", .set = NAN },
    { "all vertices in a plane, a surface", degenerate_named, .solid = "sheet", .surface = true },
    { "2,000 nearly parallel planes in one cell", degenerate_dome, .a = { 2000, 0x1p-10 }, .levels = 1, .reached = 1 },
    { "2,000 nearly parallel planes", degenerate_dome, .a = { 2000, 0x1p-10 } },

    /* the worst cases of the theses: many different tangent planes, or one family of them */
    { "a sphere of 20,480 faces", degenerate_sphere, .a = { 1, 5 } },
    { "a cylinder of 8,192 faces", degenerate_cylinder, .a = { 2048 } },
    { "a cone of 8,192 faces", degenerate_cone, .a = { 4096 } },

    /* surfaces, and invalid meshes */
    { "a soup of 3,000 triangles", degenerate_soup, .a = { 3000 }, .surface = true },
    { "a Moebius band", degenerate_named, .solid = "mobius", .surface = true },
    { "a coordinate is no number", degenerate_broken, .a = { NAN }, .status = EBPO_E_FORMAT, .message = "vertex 1" },
    { "a coordinate is infinite", degenerate_broken, .a = { INFINITY }, .status = EBPO_E_FORMAT, .message = "vertex 1" },
    { "a corner that does not exist", degenerate_broken, .a = { 1, 77 }, .status = EBPO_E_FORMAT, .message = "77" },
    { "no faces", degenerate_broken, .a = { 1, 0, 1 }, .status = EBPO_E_FORMAT, .message = "no faces" },
};
/* clang-format on */
const int degenerate_case_count = sizeof degenerate_cases / sizeof *degenerate_cases;
