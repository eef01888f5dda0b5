/* The table of named solids. */
#include "solids.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void append_and_free(ebpo_mesh *m, ebpo_mesh other)
{
    ebpo_test_append(m, &other);
    ebpo_mesh_free(&other);
}

static ebpo_mesh cube_at(double x, double y, double z, double size, uint32_t n)
{
    double low[3] = { x, y, z }, high[3] = { x + size, y + size, z + size };
    return ebpo_test_box(low, high, n);
}

static ebpo_mesh sphere_at(double x, double radius)
{
    double centre[3] = { x, 0, 0 };
    return ebpo_test_sphere(centre, radius, 3);
}

static ebpo_mesh make_tetrahedron(void) { return ebpo_test_tetrahedron(1); }
static ebpo_mesh make_cube(void) { return cube_at(0.1, 0.2, 0.3, 1, 1); }
static ebpo_mesh make_cube_in_cell_faces(void) { return cube_at(-4, -4, -4, 8, 8); }
static ebpo_mesh make_sphere(void) { return sphere_at(0, 1); }
static ebpo_mesh make_torus(void) { return ebpo_test_torus(2, 0.7, 24, 12); }
static ebpo_mesh make_cone_slivers(void) { return ebpo_test_cone(1, 3, 1000); }
static ebpo_mesh make_tetrahedra(void) { return ebpo_test_tetrahedra(50); }
static ebpo_mesh make_blob(void) { return ebpo_test_blob(8, 40, 7); }
static ebpo_mesh make_staircase(void) { return ebpo_test_staircase(8); }
static ebpo_mesh make_mobius(void) { return ebpo_test_band(20, true); }
static ebpo_mesh make_band(void) { return ebpo_test_band(20, false); }
static ebpo_mesh make_sheet(void) { return ebpo_test_sheet(1, 4); }

static ebpo_mesh make_cube_float(void)
{
    ebpo_mesh m = cube_at(-1, -1, -1, 2, 3);
    ebpo_test_to_float(&m);
    return m;
}

static ebpo_mesh make_box_subdivided(void)
{
    double low[3] = { -1, 0, 0.25 }, high[3] = { 2, 1, 0.75 };
    return ebpo_test_box(low, high, 6);
}

static ebpo_mesh make_sphere_float(void)
{
    ebpo_mesh m = sphere_at(0.3, 1);
    ebpo_test_to_float(&m);
    return m;
}

static ebpo_mesh make_cavity(void)
{
    ebpo_mesh m = cube_at(0, 0, 0, 4, 2), inner = cube_at(1, 1, 1, 2, 1);
    ebpo_test_reverse(&inner);
    append_and_free(&m, inner);
    return m;
}

static ebpo_mesh make_nested_same_direction(void)
{
    ebpo_mesh m = cube_at(0, 0, 0, 4, 2);
    append_and_free(&m, cube_at(1, 1, 1, 2, 1));
    return m;
}

static ebpo_mesh make_overlapping_cubes(void)
{
    ebpo_mesh m = cube_at(0, 0, 0, 2, 2);
    append_and_free(&m, cube_at(1, 1, 1, 2, 2));
    return m;
}

static ebpo_mesh make_overlapping_spheres(void)
{
    ebpo_mesh m = sphere_at(0, 1);
    append_and_free(&m, sphere_at(1.1, 1));
    return m;
}

static ebpo_mesh two_voxels(uint32_t x, uint32_t y, uint32_t z)
{
    uint8_t filled[8] = { 1, 0, 0, 0, 0, 0, 0, 0 };
    filled[(z * 2 + y) * 2 + x] = 1;
    return ebpo_test_voxels(filled, 2, 1);
}

static ebpo_mesh make_touching_at_vertex(void) { return two_voxels(1, 1, 1); }
static ebpo_mesh make_touching_at_edge(void) { return two_voxels(1, 1, 0); }

static ebpo_mesh make_touching_at_face(void)
{
    ebpo_mesh m = cube_at(0, 0, 0, 1, 1);
    append_and_free(&m, cube_at(1, 0, 0, 1, 1));
    return m;
}

/* Makes two cubes with shared vertices. The side between the cubes occurs twice, in both
 * orientations. */
static ebpo_mesh make_coincident_opposite_faces(void)
{
    ebpo_mesh m = make_touching_at_face();
    ebpo_error error = EBPO_ERROR_INIT;
    if (ebpo_mesh_weld(&m, NULL, &error) != EBPO_OK)
        abort();
    return m;
}

static ebpo_mesh make_repeated_faces(void)
{
    ebpo_mesh m = cube_at(0, 0, 0, 1, 1);
    uint32_t a = m.faces[0], b = m.faces[1], c = m.faces[2];
    ebpo_test_append_face(&m, a, b, c);
    ebpo_test_append_face(&m, b, a, c);
    return m;
}

static ebpo_mesh make_thin_wall(void)
{
    double low[3] = { 0, 0, 0.3 }, high[3] = { 1, 1, 0.3 + 1e-6 };
    return ebpo_test_box(low, high, 5);
}

static ebpo_mesh make_needle(void)
{
    double low[3] = { 0, 0, 0 }, high[3] = { 1e6, 1, 1 };
    return ebpo_test_box(low, high, 1);
}

static ebpo_mesh make_l_shape(void)
{
    uint8_t filled[8] = { 1, 1, 0, 0, 1, 0, 0, 0 };
    return ebpo_test_voxels(filled, 2, 0.5);
}

static ebpo_mesh make_giant_and_dust(void)
{
    ebpo_mesh m = ebpo_test_tetrahedron(1000);
    append_and_free(&m, sphere_at(-1, 0.5));
    return m;
}

static ebpo_mesh make_open_box(void)
{
    ebpo_mesh m = cube_at(0, 0, 0, 1, 1);
    m.face_count -= 2; /* removes one side */
    return m;
}

static ebpo_mesh make_flipped_face_cube(void)
{
    ebpo_mesh m = cube_at(0, 0, 0, 1, 1);
    ebpo_test_turn_face(&m, 5);
    return m;
}

static ebpo_mesh make_inside_out_cube(void)
{
    ebpo_mesh m = cube_at(0, 0, 0, 1, 1);
    ebpo_test_reverse(&m);
    return m;
}

/* Makes a tetrahedron with one edge split on one side only, closed by a face without area. */
static ebpo_mesh make_zero_area_face(void)
{
    ebpo_mesh m = ebpo_test_tetrahedron(2);
    uint32_t middle = ebpo_test_append_vertex(&m, 1, 0, 0);
    m.faces[0] = 0, m.faces[1] = 2, m.faces[2] = middle;
    ebpo_test_append_face(&m, middle, 2, 1);
    ebpo_test_append_face(&m, 0, middle, 1);
    return m;
}

static ebpo_mesh make_index_repeated_face(void)
{
    ebpo_mesh m = ebpo_test_tetrahedron(1);
    ebpo_test_append_face(&m, 1, 1, 2);
    return m;
}

const ebpo_test_solid ebpo_test_solids[] = {
    { "tetrahedron", make_tetrahedron, true, true, 1.0 / 6 },
    { "cube", make_cube, true, true, 1 },
    { "cube_float", make_cube_float, true, true, 8 },
    { "cube_in_cell_walls", make_cube_in_cell_faces, true, true, 512 },
    { "box_subdivided", make_box_subdivided, true, true, 1.5 },
    { "sphere", make_sphere, true, true, NAN },
    { "sphere_float", make_sphere_float, true, true, NAN },
    { "torus", make_torus, true, true, NAN },
    { "cavity", make_cavity, true, true, 56 },
    { "nested_same_direction", make_nested_same_direction, true, true, 72 },
    { "overlapping_cubes", make_overlapping_cubes, true, true, 16 },
    { "overlapping_spheres", make_overlapping_spheres, true, true, NAN },
    { "touching_at_vertex", make_touching_at_vertex, true, false, 2 },
    { "touching_at_edge", make_touching_at_edge, true, false, 2 },
    { "touching_at_face", make_touching_at_face, true, true, 2 },
    { "coincident_opposite_faces", make_coincident_opposite_faces, true, false, 2 },
    { "repeated_faces", make_repeated_faces, true, false, 1 },
    { "thin_wall", make_thin_wall, true, true, (0.3 + 1e-6) - 0.3 },
    { "needle", make_needle, true, true, 1e6 },
    { "staircase", make_staircase, true, true, 36 },
    { "l_shape", make_l_shape, true, true, 0.375 },
    { "cone_slivers", make_cone_slivers, true, true, NAN },
    { "giant_and_dust", make_giant_and_dust, true, true, NAN },
    { "tetrahedra", make_tetrahedra, true, true, 50.0 / 6 },
    { "blob", make_blob, true, false, NAN },
    { "zero_area_face", make_zero_area_face, true, true, 8.0 / 6 },
    { "index_repeated_face", make_index_repeated_face, true, false, 1.0 / 6 },
    { "inside_out_cube", make_inside_out_cube, true, true, -1 },
    { "open_box", make_open_box, false, false, 0 },
    { "flipped_face_cube", make_flipped_face_cube, false, false, 0 },
    { "mobius", make_mobius, false, false, 0 },
    { "band", make_band, false, false, 0 },
    { "sheet", make_sheet, false, false, 0 },
};

const int ebpo_test_solid_count = sizeof ebpo_test_solids / sizeof *ebpo_test_solids;

ebpo_mesh ebpo_test_make(const char *name)
{
    for (int i = 0; i < ebpo_test_solid_count; i++)
        if (strcmp(ebpo_test_solids[i].name, name) == 0)
            return ebpo_test_solids[i].make();
    fprintf(stderr, "no test solid is named %s\n", name);
    abort();
}
