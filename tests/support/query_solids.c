/* Solids for queries: the balanced ones of solids.h, and others that are difficult. */
#include "query_support.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const query_variant query_variants[] = {
    { "N=16", 16, -1, EBPO_RULE_NONZERO, 0 },
    { "N=0, levels to 4", 0, 4, EBPO_RULE_NONZERO, 0 },
    { "N=4, even-odd", 4, -1, EBPO_RULE_EVENODD, 0 },
    { "N=8, positive, without maps", 8, 6, EBPO_RULE_POSITIVE, EBPO_PART_PLANES | EBPO_PART_MESH },
    { "one leaf", 1000000, 3, EBPO_RULE_NONZERO, 0 },
    { "N=2, levels to 7, without planes", 2, 7, EBPO_RULE_NONZERO,
      EBPO_PART_MESH | EBPO_PART_MAPS },
};
const int query_variant_count = sizeof query_variants / sizeof *query_variants;

static void add(ebpo_mesh *m, ebpo_mesh other, bool inward)
{
    if (inward)
        ebpo_test_reverse(&other);
    ebpo_test_append(m, &other);
    ebpo_mesh_free(&other);
}

static ebpo_mesh box(double x0, double y0, double z0, double x1, double y1, double z1)
{
    double low[3] = { x0, y0, z0 }, high[3] = { x1, y1, z1 };
    return ebpo_test_box(low, high, 1);
}

static ebpo_mesh cube(double low, double high, uint32_t n)
{
    double a[3] = { low, low, low }, b[3] = { high, high, high };
    return ebpo_test_box(a, b, n);
}

static void scale(ebpo_mesh *m, double factor)
{
    for (uint64_t i = 0; i < 3 * m->vertex_count; i++)
        m->xyz64[i] *= factor;
}

static void turn_and_shift(ebpo_mesh *m, double shift)
{
    const double c = cos(0.7), s = sin(0.7), offset[3] = { shift, -shift, shift / 3 };
    const double matrix[3][3] = { { c, -s, 0 }, { s * c, c * c, -s }, { s * s, c * s, c } };
    ebpo_test_transform(m, matrix, offset);
}

static ebpo_mesh make_touching_shells(void)
{
    ebpo_mesh m = cube(0, 1, 2);
    add(&m, box(1, 0.25, 0.25, 2, 0.75, 0.75), false); /* part of a side */
    add(&m, box(1, 1, 0, 2, 2, 1), false);             /* an edge */
    add(&m, cube(-1, 0, 1), false);                    /* a vertex */
    add(&m, box(0.25, 0.5, 1, 0.75, 1, 1.5), false);   /* a side, and aligned with another */
    return m;
}

static ebpo_mesh make_nested_windings(void)
{
    ebpo_mesh m = cube(0, 8, 2);
    add(&m, cube(1, 7, 1), false);
    add(&m, cube(2, 6, 1), false);
    add(&m, cube(2.5, 5.5, 1), true);
    add(&m, cube(3, 5, 1), true);
    add(&m, cube(3.25, 4.75, 1), true);
    add(&m, cube(3.5, 4.5, 1), true);
    return m;
}

static ebpo_mesh make_cancelling_overlap(void)
{
    ebpo_mesh m = cube(0, 2, 2);
    add(&m, cube(1, 3, 1), true);
    return m;
}

static ebpo_mesh make_cube_twice(void)
{
    ebpo_mesh m = cube(0, 1, 2);
    add(&m, cube(0, 1, 2), false);
    return m;
}

static ebpo_mesh make_cube_and_its_inverse(void)
{
    ebpo_mesh m = cube(0, 1, 1);
    add(&m, cube(0, 1, 2), true); /* other triangles, the same sides */
    add(&m, cube(3, 4, 1), false);
    return m;
}

static ebpo_mesh make_gap_of_one_ulp(void)
{
    ebpo_mesh m = cube(0, 1, 2);
    add(&m, box(nextafter(1, 2), 0, 0, 2, 1, 1), false);
    return m;
}

static ebpo_mesh make_overlap_of_one_ulp(void)
{
    ebpo_mesh m = box(0, 0, 0, nextafter(1, 2), 1, 1);
    add(&m, box(1, 0, 0, 2, 1, 1), false);
    return m;
}

static ebpo_mesh make_thin_hollow(void)
{
    ebpo_mesh m = cube(0, 1, 3);
    add(&m, cube(1e-9, 1 - 1e-9, 2), true);
    return m;
}

static ebpo_mesh make_sliver(void)
{
    ebpo_mesh m = ebpo_test_tetrahedron(1);
    const double p[4][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0.5, 1e-13, 0 }, { 0.5, 0, 1e-12 } };
    memcpy(m.xyz64, p, sizeof p);
    add(&m, ebpo_test_cone(1e-6, 1, 12), false);
    return m;
}

/* Makes a flat box (winding number 0 everywhere, completely coplanar) and a tetrahedron collapsed
 * to a line. */
static ebpo_mesh make_flat(void)
{
    ebpo_mesh m = box(0, 0, 0.5, 1, 1, 0.5), line = ebpo_test_tetrahedron(1);
    const double p[4][3] = { { 0, 0, 0 }, { 1, 1, 1 }, { 2, 2, 2 }, { 0.5, 0.5, 0.5 } };
    memcpy(line.xyz64, p, sizeof p);
    add(&m, line, false);
    return m;
}

/* Makes boxes whose sides are in cell faces. The root box is determined by two tetrahedra in
 * opposite corners, and does not depend on the boxes between. */
static ebpo_mesh make_boxes_in_cell_faces(void)
{
    ebpo_mesh m = ebpo_test_tetrahedron(0.5), frame, other = ebpo_test_tetrahedron(0.5);
    const double offset[3] = { 10, 7, 5 }, unit[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    ebpo_test_transform(&other, unit, offset);
    add(&m, other, false);
    memset(&frame, 0, sizeof frame);
    ebpo_test_append(&frame, &m);
    ebpo_mesh_report report;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_tree tree;
    if (ebpo_mesh_check(&frame, 1, (ebpo_progress){ NULL, NULL }, &report, NULL) != EBPO_OK ||
        ebpo_build(&frame, &report, NULL, &options, &tree, NULL) != EBPO_OK)
        abort();
    static const double eighths[][6] = { { 2, 2, 2, 4, 4, 4 },
                                         { 4, 4, 4, 6, 6, 6 },
                                         { 4, 2, 2, 5, 3, 3 },
                                         { 2, 4, 4, 2.5, 5.25, 4.5 } };
    for (size_t i = 0; i < sizeof eighths / sizeof *eighths; i++) {
        double at[6];
        for (int k = 0; k < 6; k++)
            at[k] = tree.info.box_origin[k % 3] + eighths[i][k] * (tree.info.box_size[k % 3] / 8);
        add(&m, ebpo_test_box(at, at + 3, 2), false);
    }
    ebpo_tree_free(&tree);
    return m;
}

static ebpo_mesh make_far_away(void)
{
    ebpo_mesh m = ebpo_test_torus(2, 0.7, 16, 8);
    turn_and_shift(&m, 1e7);
    return m;
}

/* Makes a solid rounded to floats with a spacing of a quarter: many faces coincide, intersect or
 * lose their area. */
static ebpo_mesh make_far_away_float(void)
{
    ebpo_mesh m = ebpo_test_torus(6, 2, 16, 8);
    turn_and_shift(&m, 4e6);
    ebpo_test_to_float(&m);
    return m;
}

static ebpo_mesh make_turned_boxes(void)
{
    ebpo_mesh m = make_touching_shells();
    turn_and_shift(&m, 0);
    return m;
}

static ebpo_mesh scaled_shells(double factor)
{
    ebpo_mesh m = make_touching_shells();
    scale(&m, factor);
    return m;
}

static ebpo_mesh make_tiny(void) { return scaled_shells(1e-300); }
static ebpo_mesh make_small(void) { return scaled_shells(1e-160); }
static ebpo_mesh make_huge(void) { return scaled_shells(1e300); }
static ebpo_mesh make_large(void) { return scaled_shells(1e160); }
static ebpo_mesh make_denormal(void) { return scaled_shells(0x1p-1060); }
static ebpo_mesh make_least(void)
{
    return scaled_shells(0x1p-1072);
} /* a quarter of the scale is the smallest double */

static ebpo_mesh make_all_scales(void)
{
    ebpo_mesh m = cube(-1e300, 1e300, 1);
    add(&m, cube(-1, 1, 2), true);
    add(&m, cube(-1e-300, 1e-300, 1), false);
    return m;
}

static ebpo_mesh make_tetrahedra_at_random(void)
{
    ebpo_mesh m = query_random_solid(77, false);
    for (uint64_t i = 1; i < 8; i++)
        add(&m, query_random_solid(77 + i, false), false);
    return m;
}

static ebpo_mesh make_mixed_grid(void)
{
    ebpo_mesh m = query_random_solid(5, true);
    for (uint64_t i = 1; i < 12; i++)
        add(&m, query_random_solid(5 + i, true), false);
    return m;
}

static ebpo_mesh make_coarse_sphere(void)
{
    const double centre[3] = { 0, 0, 0 };
    return ebpo_test_sphere(centre, 1, 1);
}

static ebpo_mesh make_shared_edges_blob(void)
{
    ebpo_mesh m = ebpo_test_blob(4, 50, 11);
    ebpo_test_to_float(&m);
    return m;
}

static const struct {
    const char *name;
    ebpo_mesh (*make)(void);
} more[] = {
    { "touching_shells", make_touching_shells },
    { "nested_windings", make_nested_windings },
    { "cancelling_overlap", make_cancelling_overlap },
    { "cube_twice", make_cube_twice },
    { "cube_and_its_inverse", make_cube_and_its_inverse },
    { "gap_of_one_ulp", make_gap_of_one_ulp },
    { "overlap_of_one_ulp", make_overlap_of_one_ulp },
    { "thin_hollow", make_thin_hollow },
    { "sliver", make_sliver },
    { "flat", make_flat },
    { "boxes_in_walls", make_boxes_in_cell_faces },
    { "far_away", make_far_away },
    { "far_away_float", make_far_away_float },
    { "turned_boxes", make_turned_boxes },
    { "tiny", make_tiny },
    { "small", make_small },
    { "huge", make_huge },
    { "large", make_large },
    { "denormal", make_denormal },
    { "least", make_least },
    { "all_scales", make_all_scales },
    { "tetrahedra_at_random", make_tetrahedra_at_random },
    { "mixed_grid", make_mixed_grid },
    { "coarse_sphere", make_coarse_sphere },
    { "shared_edges_blob", make_shared_edges_blob },
};
enum { MORE = sizeof more / sizeof *more };

static int balanced(int i)
{
    for (int at = 0; at < ebpo_test_solid_count; at++)
        if (ebpo_test_solids[at].balanced && i-- == 0)
            return at;
    return -1;
}

int query_solid_count(void)
{
    int count = MORE;
    for (int i = 0; i < ebpo_test_solid_count; i++)
        count += ebpo_test_solids[i].balanced;
    return count;
}

const char *query_solid_name(int i)
{
    return i < MORE ? more[i].name : ebpo_test_solids[balanced(i - MORE)].name;
}

ebpo_mesh query_solid_make(int i)
{
    return i < MORE ? more[i].make() : ebpo_test_solids[balanced(i - MORE)].make();
}

ebpo_mesh query_solid_by_name(const char *name)
{
    for (int i = 0; i < MORE; i++)
        if (strcmp(more[i].name, name) == 0)
            return more[i].make();
    return ebpo_test_make(name);
}

/* --- random solids --- */

static double coordinate(uint64_t *state, bool on_grid)
{
    if (on_grid)
        return (double)(ebpo_test_random(state) % 7);
    return 6 * ebpo_test_random_unit(state);
}

static ebpo_mesh random_box(uint64_t *state, bool on_grid)
{
    double low[3], high[3];
    for (int k = 0; k < 3; k++) {
        low[k] = coordinate(state, on_grid);
        high[k] = coordinate(state, on_grid);
        if (high[k] < low[k]) {
            double t = low[k];
            low[k] = high[k], high[k] = t;
        }
        switch (ebpo_test_random(state) % 8) {
        case 0: high[k] = low[k] + 1e-9; break; /* a thin plate */
        case 1: high[k] = nextafter(low[k], INFINITY); break;
        default: high[k] += high[k] == low[k]; break;
        }
    }
    return ebpo_test_box(low, high, 1 + (uint32_t)(ebpo_test_random(state) % 2));
}

static ebpo_mesh random_tetrahedron(uint64_t *state, bool on_grid)
{
    ebpo_mesh m = ebpo_test_tetrahedron(1);
    for (uint64_t i = 0; i < 12; i++)
        m.xyz64[i] = coordinate(state, on_grid);
    return m; /* of any orientation, sometimes flat */
}

ebpo_mesh query_random_solid(uint64_t seed, bool on_grid)
{
    uint64_t state = seed * 1000003 + on_grid;
    ebpo_mesh m;
    memset(&m, 0, sizeof m);
    for (uint64_t parts = 1 + ebpo_test_random(&state) % 5; parts > 0; parts--) {
        bool is_box = ebpo_test_random(&state) % 2, inward = ebpo_test_random(&state) % 5 == 0,
             again = ebpo_test_random(&state) % 8 == 0;
        ebpo_mesh part = is_box ? random_box(&state, on_grid) : random_tetrahedron(&state, on_grid);
        if (again)
            ebpo_test_append(&m, &part);
        add(&m, part, inward);
    }
    ebpo_test_shuffle(&m, seed);
    return m;
}
