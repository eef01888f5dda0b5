/* Computes samples for the pictures of coarse_levels.py: the triangle of each sample, and the
 * position on the triangle.
 *
 *     level_samples FILE LEVEL|mesh SAMPLES OUT < CAMERAS
 *     level_samples FILE --planes-to LEVEL OUT.ebpo.h5
 *
 * Cameras are orthographic. The input is their number, then 13 numbers for each camera: right, up,
 * back, center, and half the side of the picture. OUT, in native byte order, contains eight counts,
 * the box, positions, triangles, colours, nodes, corners of polygons, normals of polygons
 * (ebpo_lod_normals), and samples. The second form copies a file without the planes below a level.
 */
#include <ebpo/ebpo.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NUMBERS = 13 };

typedef struct sample {
    float depth;
    uint32_t triangle; /* UINT32_MAX: no triangle */
    float share[2];    /* weights of the triangle's second and third corner */
} sample;

typedef struct shown {
    ebpo_mesh mesh;
    ebpo_lod_nodes nodes;
    ebpo_colours colours;
    float *normals;
    bool level;
} shown;

static void fail(const char *what)
{
    fprintf(stderr, "level_samples: %s\n", what);
    exit(1);
}

static void *space(size_t bytes)
{
    void *p = malloc(bytes + 1);
    if (!p)
        fail("not enough memory");
    return p;
}

static void project(const shown *s, const double camera[NUMBERS], int side, double *out)
{
    double scale = side / 2.0 / camera[12];
    for (uint64_t i = 0; i < s->mesh.vertex_count; i++) {
        double at[3] = { 0, 0, 0 };
        for (unsigned k = 0; k < 3; k++) {
            double x = s->mesh.xyz32 ? (double)s->mesh.xyz32[3 * i + k] : s->mesh.xyz64[3 * i + k];
            for (unsigned axis = 0; axis < 3; axis++)
                at[axis] += camera[3 * axis + k] * (x - camera[9 + k]);
        }
        out[3 * i] = side / 2.0 + scale * at[0];
        out[3 * i + 1] = side / 2.0 - scale * at[1];
        out[3 * i + 2] = at[2];
    }
}

/* Computes the range of pixels whose centers may be between a and b. */
static void range(double a, double b, double c, int side, int out[2])
{
    out[0] = (int)ceil(fmax(0, fmin(a, fmin(b, c)) - 0.5));
    out[1] = (int)floor(fmin(side - 1, fmax(a, fmax(b, c)) - 0.5));
}

static void fill(sample *to, int side, uint32_t triangle, const double *a, const double *b,
                 const double *c, double det)
{
    int xs[2], ys[2];
    range(a[0], b[0], c[0], side, xs);
    range(a[1], b[1], c[1], side, ys);
    for (int y = ys[0]; y <= ys[1]; y++)
        for (int x = xs[0]; x <= xs[1]; x++) {
            double u = x + 0.5 - a[0], v = y + 0.5 - a[1];
            double second = (u * (c[1] - a[1]) - v * (c[0] - a[0])) / det,
                   third = ((b[0] - a[0]) * v - (b[1] - a[1]) * u) / det;
            sample *at = &to[(size_t)y * (size_t)side + (size_t)x];
            float depth = (float)(a[2] + second * (b[2] - a[2]) + third * (c[2] - a[2]));
            if (second >= 0 && third >= 0 && second + third <= 1 && depth > at->depth)
                *at = (sample){ depth, triangle, { (float)second, (float)third } };
        }
}

/* The back sides of envelopes are never visible. Rows run downwards, so front faces are clockwise
 * in the picture. */
static void draw(const shown *s, const double *at, int side, sample *to)
{
    for (int i = 0; i < side * side; i++)
        to[i] = (sample){ -INFINITY, UINT32_MAX, { 0, 0 } };
    for (uint64_t i = 0; i < s->mesh.face_count; i++) {
        const uint32_t *f = s->mesh.faces + 3 * i;
        const double *a = at + 3 * (size_t)f[0], *b = at + 3 * (size_t)f[1],
                     *c = at + 3 * (size_t)f[2];
        double det = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if (det < -1e-14 || (det > 1e-14 && !s->level))
            fill(to, side, (uint32_t)i, a, b, c, det);
    }
}

static void write_shown(const shown *s, const ebpo_info *info, int side, int cameras, FILE *out)
{
    const ebpo_mesh *m = &s->mesh;
    uint64_t head[8] = { m->vertex_count,     m->face_count,
                         s->nodes.node_count, s->nodes.polygon_count,
                         (uint64_t)side,      (uint64_t)cameras,
                         m->xyz32 != NULL,    s->colours.vertex != NULL };
    fwrite(head, 8, 8, out);
    fwrite(info->box_origin, 8, 3, out);
    fwrite(info->box_size, 8, 3, out);
    fwrite(m->xyz32 ? (const void *)m->xyz32 : m->xyz64, m->xyz32 ? 12 : 24, m->vertex_count, out);
    fwrite(m->faces, 12, m->face_count, out);
    if (s->colours.vertex)
        fwrite(s->colours.vertex, 4, m->vertex_count, out);
    for (uint64_t i = 0; i < s->nodes.node_count; i++) {
        const ebpo_lod_node *node = &s->nodes.nodes[i];
        uint64_t row[3] = { node->octcode, node->type, node->polygon_count };
        fwrite(row, 8, 3, out);
    }
    if (s->level) {
        fwrite(s->nodes.corners, 1, s->nodes.polygon_count, out);
        fwrite(s->normals, 12, s->nodes.polygon_count, out);
    }
}

static ebpo_status load(const ebpo_file *file, const char *level, shown *out, ebpo_error *error)
{
    ebpo_status status;
    out->level = strcmp(level, "mesh") != 0;
    if (!out->level) {
        ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
        read.attributes = true;
        status = ebpo_file_read_mesh(file, &read, &out->mesh, error);
        return status == EBPO_OK ? ebpo_mesh_colours(&out->mesh, &out->colours, error) : status;
    }
    status = ebpo_lod_level_nodes(file, atoi(level), NULL, &out->mesh, &out->nodes, NULL, error);
    if (status == EBPO_OK)
        status = ebpo_lod_colours(&out->nodes, out->mesh.vertex_count, &out->colours, error);
    out->normals = space(out->nodes.polygon_count * 12);
    return status == EBPO_OK ? ebpo_lod_normals(ebpo_file_info(file), &out->mesh, &out->nodes,
                                                out->normals, error)
                             : status;
}

static ebpo_status draw_all(const ebpo_file *file, char **argv, ebpo_error *error)
{
    shown s = { .normals = NULL };
    int side = atoi(argv[3]), cameras = 0;
    ebpo_status status = load(file, argv[2], &s, error);
    FILE *out = fopen(argv[4], "wb");
    if (status != EBPO_OK)
        return status;
    if (!out || side < 1 || scanf("%d", &cameras) != 1)
        fail("no cameras, or the output cannot be written");
    write_shown(&s, ebpo_file_info(file), side, cameras, out);
    double *at = space(s.mesh.vertex_count * 24);
    sample *samples = space((size_t)side * (size_t)side * sizeof *samples);
    for (int i = 0; i < cameras; i++) {
        double camera[NUMBERS];
        for (int k = 0; k < NUMBERS; k++)
            if (scanf("%lf", &camera[k]) != 1)
                fail("each camera needs 13 numbers");
        project(&s, camera, side, at);
        draw(&s, at, side, samples);
        fwrite(samples, sizeof *samples, (size_t)side * (size_t)side, out);
    }
    if (fclose(out))
        fail("cannot write");
    free(at);
    free(samples);
    free(s.normals);
    ebpo_mesh_free(&s.mesh);
    ebpo_lod_nodes_free(&s.nodes);
    ebpo_colours_free(&s.colours);
    return EBPO_OK;
}

static ebpo_status drop_planes(const ebpo_file *file, char **argv, ebpo_error *error)
{
    ebpo_tree tree;
    ebpo_status status = ebpo_file_read_tree(file, NULL, &tree, error);
    if (status != EBPO_OK)
        return status;
    for (int i = atoi(argv[3]) + 1; i < tree.info.level_count; i++) {
        ebpo_level *level = &tree.level[i];
        if (level->plane_counts)
            memset(level->plane_counts, 0, level->gray_count);
        level->plane_count = 0;
    }
    status = ebpo_tree_write(&tree, argv[4], NULL, error);
    ebpo_tree_free(&tree);
    return status;
}

int main(int argc, char **argv)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    if (argc != 5)
        fail("usage: FILE LEVEL|mesh SAMPLES OUT < CAMERAS, or FILE --planes-to LEVEL OUT");
    if (ebpo_open(argv[1], &file, &error) == EBPO_OK)
        (void)(strcmp(argv[2], "--planes-to") == 0 ? drop_planes(file, argv, &error)
                                                   : draw_all(file, argv, &error));
    ebpo_close(file);
    if (error.status != EBPO_OK)
        fail(error.message);
    return 0;
}
