/* Writes valid and invalid meshes for the command-line tests into a folder: cli_inputs FOLDER.
 * With --large FILE, writes a mesh whose conversion takes some time. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "solids.h"

static char folder_path[4096];

static const char *in_folder(const char *folder, const char *name)
{
    snprintf(folder_path, sizeof folder_path, "%s/%s", folder, name);
    return folder_path;
}

static void write_mesh(ebpo_mesh *mesh, const char *path)
{
    ebpo_error error = EBPO_ERROR_INIT;
    if (ebpo_mesh_write_ply(mesh, path, &error) != EBPO_OK) {
        fprintf(stderr, "%s\n", error.message);
        exit(1);
    }
    ebpo_mesh_free(mesh);
}

static void write_bytes(const char *path, const char *bytes, size_t size)
{
    FILE *f = fopen(path, "wb");
    if (!f || fwrite(bytes, 1, size, f) != size || fclose(f) != 0) {
        perror(path);
        exit(1);
    }
}

static const struct {
    const char *file, *text;
} texts[] = {
    { "empty.ply", "" },
    { "nonsense.ply", "this is not a mesh\n" },
    { "no_faces.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
                      "y\nproperty float z\nend_header\n0 0 0\n" },
    { "cut_short.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n" },
    { "bad_index.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float "
                       "y\nproperty float z\n"
                       "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 "
                       "0\n1 0 0\n0 1 0\n3 0 1 99\n" },
    { "nan.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float "
                 "y\nproperty float z\n"
                 "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 nan "
                 "0\n0 1 0\n3 0 1 2\n" },
    { "quads.ply", "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double "
                   "y\nproperty double z\n"
                   "element face 6\nproperty list uchar int vertex_indices\nend_header\n"
                   "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n"
                   "4 0 4 6 2\n4 1 3 7 5\n4 0 1 5 4\n4 2 6 7 3\n4 0 2 3 1\n4 4 5 7 6\n" },
    { "coloured.ply",
      "ply\nformat ascii 1.0\ncomment by hand\nobj_info none\nelement vertex 5\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float x\n"
      "property float y\nproperty float z\nproperty double quality\nelement face 5\n"
      "property short label\nproperty list uchar uint vertex_index\n"
      "property list uchar float texcoord\nproperty list uint int words\nelement edge 2\n"
      "property int vertex1\nproperty int vertex2\nend_header\n"
      "255 0 0 0 0 0 0.5\n0 255 0 1 0 0 1e300\n0 0 255 1 1 0 -0\n9 8 7 0 1 0 nan\n"
      "1 2 3 0.5 0.5 1 -inf\n"
      "-3 4 0 3 2 1 2 0 0.5 0\n1 3 0 1 4 2 1 2 1 -7\n2 3 1 2 4 2 3 4 2 8 9\n"
      "3 3 2 3 4 2 5 6 0\n4 3 3 0 4 2 7 8 3 1 2 3\n0 1\n3 4\n" },
    { "coloured_parts.ply",
      "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nelement face 8\n"
      "property list uchar uint vertex_index\nproperty short label\nelement edge 6\n"
      "property int vertex1\nproperty int vertex2\nend_header\n"
      "0 0 0 11\n1 0 0 12\n0 1 0 13\n0 0 1 14\n5 0 0 21\n6 0 0 22\n5 1 0 23\n5 0 1 24\n"
      "3 0 2 1 100\n3 0 1 3 101\n3 0 3 2 102\n3 1 2 3 103\n"
      "3 4 6 5 104\n3 4 5 7 105\n3 4 7 6 106\n3 5 6 7 107\n0 4\n1 5\n2 6\n3 7\n0 1\n4 5\n" },
    { "groups.obj", "# two tetrahedra; C:\\parts\n# and a triangle\nmtllib a/b.mtl\n"
                    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nv 5 0 1\n"
                    "f 1 3 2\nf 1 2 4\ng\nf 1 4 3\ng default\nf 2 3 4\n"
                    "g  a/../b \nusemtl red\nf 5 7 6\nusemtl blue\nf 5 6 8\n"
                    "o empty one\ng \"x\r\nf 5 8 7\ng a/../b\nusemtl green\nf 6 7 8\n"
                    "o caf\xe9\x01\nf 1 5 3 7\no *\nf 4 8 3\ng layer:\nf 4 8 2\n" },
    { "one_group.obj", "g all of it\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\n"
                       "f 1 4 3\nf 2 3 4\n" },
    { "no_group.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" },
    { "again.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\no a\nusemtl x\nf 1 2 3\no b\nf 1 3 2\no a\n"
                   "usemtl y\nf 2 1 3\n" },
    { "backslash.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\ng a\\b\nf 1 2 3\nf 1 3 2\n" },
    { "painted.obj", "mtllib p.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\n"
                     "v 0 0 1 0.5 0.25 0\nvn 0 0 -1\nvn 0 -1 0\nvn -1 0 0\nvn 1 1 1\n"
                     "vt 0 0\nvt 0.5 0\nvt 0 0.5\nusemtl red paint\ns 1\n"
                     "f 1/1/1 3/2/1 2/3/1\nf 1/1/2 2/2/2 4/3/2\nusemtl blue\n"
                     "f 1/1/3 4/3/3 3/2/3\nf 2/1/4 3/2/4 4/3/4\n" },
    /* the previous model as a PLY file */
    { "painted.ply",
      "ply\nformat ascii 1.0\ncomment material 0 DefaultMaterial\n"
      "comment material 1 red paint\ncomment material 2 blue\nelement vertex 4\n"
      "property float x\nproperty float y\nproperty float z\nproperty float red\n"
      "property float green\nproperty float blue\nelement face 4\n"
      "property list uchar int vertex_indices\nproperty float nx\nproperty float ny\n"
      "property float nz\nproperty list uchar float texcoord\nproperty uint material\n"
      "end_header\n0 0 0 1 0 0\n0 1 0 0 0 1\n1 0 0 0 1 0\n0 0 1 0.5 0.25 0\n"
      "3 0 1 2 0 0 -1 6 0 0 0.5 0 0 0.5 1\n3 0 2 3 0 -1 0 6 0 0 0.5 0 0 0.5 1\n"
      "3 0 3 1 -1 0 0 6 0 0 0 0.5 0.5 0 2\n3 2 1 3 1 1 1 6 0 0 0.5 0 0 0.5 2\n" },
    { "tetrahedron.stl", "solid t\n"
                         "facet normal 0 0 -1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 "
                         "0\nendloop\nendfacet\n"
                         "facet normal 0 -1 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 "
                         "1\nendloop\nendfacet\n"
                         "facet normal -1 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 "
                         "0\nendloop\nendfacet\n"
                         "facet normal 1 1 1\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 "
                         "1\nendloop\nendfacet\n"
                         "endsolid t\n" },
};

static const char *const solids[] = { "tetrahedron",    "cube",           "cube_float",
                                      "sphere",         "sphere_float",   "torus",
                                      "cavity",         "open_box",       "flipped_face_cube",
                                      "mobius",         "blob",           "overlapping_cubes",
                                      "zero_area_face", "repeated_faces", "inside_out_cube" };

static void add(ebpo_mesh *mesh, ebpo_mesh other)
{
    ebpo_test_append(mesh, &other);
    ebpo_mesh_free(&other);
}

static void move(ebpo_mesh *mesh, double x, double y, double z)
{
    static const double same[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    ebpo_test_transform(mesh, same, (double[3]){ x, y, z });
}

static ebpo_mesh box(double low, double high, uint32_t n)
{
    return ebpo_test_box((double[3]){ low, low, low }, (double[3]){ high, high, high }, n);
}

/* Makes seven components, of which six remain: a cavity before its box in the file; another box in
 * the cavity; a box that crosses the first box; a box that shares a side with the crossing box; a
 * sheet through the first three; and a box that is inside out. Faces are in any order. No two
 * components have a vertex at one position. */
static ebpo_mesh several_parts(void)
{
    ebpo_mesh mesh = box(1, 3, 2), neighbour = box(5, 6, 1), sheet = ebpo_test_sheet(6, 5),
              inside_out = box(7, 8, 1);
    ebpo_test_reverse(&mesh);
    move(&neighbour, 0, -1.25, -1.25);
    move(&sheet, -1, -1, 1.75);
    ebpo_test_reverse(&inside_out);
    add(&mesh, box(0, 4, 3));
    add(&mesh, box(1.5, 2.5, 1));
    add(&mesh, box(3.5, 5, 2));
    add(&mesh, neighbour);
    add(&mesh, sheet);
    add(&mesh, inside_out);
    ebpo_test_shuffle(&mesh, 2);
    return mesh;
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "--large") == 0) {
        ebpo_mesh large = ebpo_test_torus(2, 1, 600, 300);
        write_mesh(&large, argv[2]);
        return 0;
    }
    if (argc != 2) {
        fprintf(stderr, "usage: cli_inputs FOLDER | --large FILE\n");
        return 2;
    }
    for (size_t i = 0; i < sizeof solids / sizeof *solids; i++) {
        char name[64];
        snprintf(name, sizeof name, "%s.ply", solids[i]);
        ebpo_mesh mesh = ebpo_test_make(solids[i]);
        write_mesh(&mesh, in_folder(argv[1], name));
    }
    ebpo_mesh split = ebpo_test_make("cube");
    ebpo_test_split_vertices(&split);
    write_mesh(&split, in_folder(argv[1], "split_cube.ply"));
    ebpo_mesh shells = box(0, 4, 2), inner = box(1, 3, 2); /* both boxes are oriented outwards */
    add(&shells, inner);
    write_mesh(&shells, in_folder(argv[1], "box_in_box.ply"));
    ebpo_mesh one_turned = box(0, 4, 2);
    inner = box(5, 7, 2);
    ebpo_test_reverse(&inner);
    add(&one_turned, inner);
    write_mesh(&one_turned, in_folder(argv[1], "one_inside_out.ply"));
    ebpo_mesh split_box = ebpo_test_make("open_box");
    ebpo_test_split_vertices(&split_box);
    write_mesh(&split_box, in_folder(argv[1], "split_open_box.ply"));
    ebpo_mesh parts = several_parts();
    write_mesh(&parts, in_folder(argv[1], "parts.ply"));
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        write_bytes(in_folder(argv[1], texts[i].file), texts[i].text, strlen(texts[i].text));
    return 0;
}
