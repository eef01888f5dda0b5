#include "cli/render/thumbnail.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/remote_args.h"
#include "cli/render/level_normals.h"
#include "cli/render/level_surface.h"
#include "cli/render/picture.h"
#include "cli/render/raster.h"

/* Greatest number of faces and of nodes that are drawn; more would not change a small picture. */
enum { FACES_MAX = 100000, NODES_MAX = 20000 };

typedef struct drawing {
    ebpo_mesh mesh;
    ebpo_colours colours;
    float *normals, *vertex_normals; /* as in raster_style */
    bool closed;
} drawing;

/* Starts at level 0, and goes one level deeper as long as the deeper level has patches and these
 * have at most FACES_MAX triangles together. Returns the last level, or -1 if level 0 has no
 * patches. */
static int patch_level(const ebpo_surface *table)
{
    uint64_t triangles[EBPO_LEVELS_MAX] = { 0 };
    int level = -1;
    for (uint64_t i = 0; i < table->patch_count; i++) {
        uint64_t code = table->patch[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_OCTCODE];
        int of_node = 0;
        for (; code >= 8; code >>= 3)
            of_node++;
        if (of_node < EBPO_LEVELS_MAX)
            triangles[of_node] += table->patch[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_TRIANGLES];
    }
    while (level + 1 < EBPO_LEVELS_MAX && triangles[level + 1] &&
           (level < 0 || triangles[level + 1] <= FACES_MAX))
        level++;
    return level;
}

static ebpo_status load_surface(drawing *d, const ebpo_file *file, ebpo_error *error)
{
    ebpo_surface table = { 0 };
    ebpo_surface_mesh made = { 0 };
    ebpo_status status = ebpo_file_read_patches(file, &table, error);
    if (status == EBPO_OK)
        status = level_surface(file, patch_level(&table), &made, error);
    d->mesh = made.mesh;
    d->colours = made.colours;
    d->vertex_normals = made.normals;
    ebpo_surface_free(&table);
    return status;
}

static ebpo_status load_mesh(drawing *d, const ebpo_file *file, ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.attributes = true;
    d->closed = ebpo_file_info(file)->solid && ebpo_file_info(file)->report.manifold;
    ebpo_status status = ebpo_file_read_mesh(file, &read, &d->mesh, error);
    return status == EBPO_OK ? ebpo_mesh_colours(&d->mesh, &d->colours, error) : status;
}

/* Loads the envelopes of the deepest level with at most NODES_MAX nodes, or the envelopes of level
 * 0 if all levels have more. */
static ebpo_status load_level(drawing *d, const ebpo_file *file, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_lod_options lod = EBPO_LOD_OPTIONS_INIT;
    ebpo_lod_nodes nodes;
    uint64_t ended = 0; /* leaves and black nodes at levels up to i */
    int level = 0;
    for (int i = 0; i < info->level_count; i++) {
        const ebpo_level_summary *l = &info->level[i];
        ended += l->leaf_count + l->black_count;
        if (ended + l->gray_count > NODES_MAX)
            break;
        level = i;
    }
    d->closed = true;
    ebpo_status status = ebpo_lod_level_nodes(file, level, &lod, &d->mesh, &nodes, NULL, error);
    if (status == EBPO_OK)
        status = ebpo_lod_colours(&nodes, d->mesh.vertex_count, &d->colours, error);
    if (status == EBPO_OK)
        status = level_normals(info, &d->mesh, &nodes, &d->normals, error);
    ebpo_lod_nodes_free(&nodes);
    return status;
}

static ebpo_status load_drawing(drawing *d, const char *path, int64_t max_expansion,
                                ebpo_error *error)
{
    ebpo_file *file = NULL;
    remote_values how = REMOTE_VALUES_INIT;
    how.max_expansion = max_expansion;
    ebpo_status status = remote_open(&file, path, &how, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_info *info = ebpo_file_info(file);
    if (info->parts & EBPO_PART_MESH && info->face_count <= FACES_MAX)
        status = load_mesh(d, file, error);
    else if (info->parts & EBPO_PART_SURFACE)
        status = load_surface(d, file, error);
    else
        status = load_level(d, file, error);
    ebpo_close(file);
    return status;
}

static ebpo_status draw_picture(const drawing *d, picture *p, ebpo_error *error)
{
    raster_style style = { .colour = { 0.66, 0.54, 0.40 },
                           .closed = d->closed,
                           .face_colours = d->colours.by_face ? d->colours.face : NULL,
                           .vertex_colours = d->colours.by_face ? NULL : d->colours.vertex,
                           .normals = d->normals,
                           .vertex_normals = d->vertex_normals };
    camera view;
    if (!d->mesh.face_count)
        return EBPO_OK;
    camera_fit(&view, &d->mesh, 30, 20, 1, p->width, p->height);
    return raster_draw(p, 0, 0, p->width, p->height, &view, &d->mesh, &style, 1, error);
}

ebpo_status thumbnail_draw(const char *path, int64_t max_expansion, int width, int height,
                           void **png, size_t *size, ebpo_error *error)
{
    static const uint8_t paper[3] = { 240, 242, 245 };
    drawing d = { .closed = false };
    picture p = { 0 };
    ebpo_status status = load_drawing(&d, path, max_expansion, error);
    if (status == EBPO_OK && !picture_make(&p, width, height, paper))
        status = error->status = EBPO_E_MEMORY;
    if (status == EBPO_OK)
        status = draw_picture(&d, &p, error);
    if (status == EBPO_OK)
        status = picture_encode_png(p.rgb, width, height, 3, path, png, size, error);
    picture_free(&p);
    ebpo_mesh_free(&d.mesh);
    ebpo_colours_free(&d.colours);
    free(d.normals);
    free(d.vertex_normals);
    return status;
}
