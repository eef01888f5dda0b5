/* Draws pictures of the levels for the page, with a transparent background, as data URIs. */
#include "ebpo_config.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/reading.h"
#include "cli/report/report_data.h"

#if EBPO_HAVE_PNG

#include "cli/render/level_normals.h"
#include "cli/render/picture.h"
#include "cli/render/raster.h"

enum {
    /* size in pixels of the picture of a level */
    TILE_WIDTH = 320,
    TILE_HEIGHT = 250,
    /* size in pixels of the picture of the model itself */
    PORTRAIT_WIDTH = 720,
    PORTRAIT_HEIGHT = 540,
    LEVELS_DRAWN = 12 /* maximum number of levels with a picture */
};

static ebpo_status no_memory(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message,
             "not enough memory for the pictures; omit them with --no-pictures");
    return error->status = EBPO_E_MEMORY;
}

/* Computes the colours and the opacity of a picture that was drawn twice: on a black and on a white
 * background. */
static void make_transparent(const picture *black, const picture *white, uint8_t *rgba)
{
    for (size_t i = 0; i < (size_t)black->width * (size_t)black->height; i++) {
        int opacity = 255;
        for (size_t k = 0; k < 3; k++) {
            int covered = 255 - (white->rgb[3 * i + k] - black->rgb[3 * i + k]);
            opacity = covered < opacity ? covered : opacity;
        }
        for (size_t k = 0; k < 3; k++) {
            int v = opacity > 0 ? black->rgb[3 * i + k] * 255 / opacity : 0;
            rgba[4 * i + k] = (uint8_t)(v < 255 ? v : 255);
        }
        rgba[4 * i + 3] = (uint8_t)(opacity > 0 ? opacity : 0);
    }
}

/* Draws a mesh with a transparent background, and sets *uri, which the caller frees. */
static ebpo_status draw_picture(const comparison *c, const ebpo_mesh *mesh, const camera *view,
                                int width, int height, const raster_style *style, char **uri,
                                ebpo_error *error)
{
    static const uint8_t grounds[2][3] = { { 0, 0, 0 }, { 255, 255, 255 } };
    unsigned threads = c->v->threads ? (unsigned)c->v->threads : machine_cores();
    picture on[2] = { { 0 }, { 0 } };
    uint8_t *rgba = malloc(4 * (size_t)width * (size_t)height);
    void *png = NULL;
    size_t size = 0;
    ebpo_status status = rgba ? EBPO_OK : no_memory(error);
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        status = picture_make(&on[i], width, height, grounds[i])
                     ? raster_draw(&on[i], 0, 0, width, height, view, mesh, style, threads, error)
                     : no_memory(error);
    if (status == EBPO_OK) {
        make_transparent(&on[0], &on[1], rgba);
        status = picture_encode_png(rgba, width, height, 4, "picture", &png, &size, error);
    }
    if (status == EBPO_OK && !(*uri = picture_data_uri(png, size)))
        status = no_memory(error);
    picture_free(&on[0]);
    picture_free(&on[1]);
    free(rgba);
    free(png);
    return status;
}

/* --- drawing --- */

static ebpo_status level_mesh(const comparison *c, ebpo_file *file, int level, ebpo_mesh *out,
                              ebpo_error *error)
{
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    options.threads = (unsigned)c->v->threads;
    return ebpo_lod_level(file, level, &options, out, NULL, error);
}

/* Sets the camera of all levels of all methods, so that the coarsest level of each method fits into
 * the picture. */
static ebpo_status fit_camera(const comparison *c, ebpo_file *const *file, camera *view,
                              ebpo_error *error)
{
    ebpo_mesh all = { 0 };
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < c->count && status == EBPO_OK; i++) {
        ebpo_mesh level = { 0 };
        if (c->first > method_last(c, &c->methods[i]))
            continue;
        status = level_mesh(c, file[i], c->first, &level, error);
        double *vertices =
            status == EBPO_OK ? realloc(all.xyz64, 3 * (all.vertex_count + level.vertex_count + 1) *
                                                       sizeof *vertices)
                              : NULL;
        if (vertices) {
            memcpy(vertices + 3 * all.vertex_count, level.xyz64,
                   3 * level.vertex_count * sizeof *vertices);
            all.xyz64 = vertices;
            all.vertex_count += level.vertex_count;
        } else if (status == EBPO_OK) {
            status = no_memory(error);
        }
        ebpo_mesh_free(&level);
    }
    if (status == EBPO_OK)
        camera_fit(view, &all, c->azimuth, c->elevation, c->v->up, TILE_WIDTH, TILE_HEIGHT);
    ebpo_mesh_free(&all);
    return status;
}

static ebpo_status draw_level(const comparison *c, ebpo_file *file, int level, const camera *view,
                              char **uri, ebpo_error *error)
{
    raster_style style = { .colour = { 0.30, 0.48, 0.66 }, .closed = true };
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    ebpo_mesh mesh;
    ebpo_lod_nodes nodes;
    float *normals = NULL;
    options.threads = (unsigned)c->v->threads;
    ebpo_status status = ebpo_lod_level_nodes(file, level, &options, &mesh, &nodes, NULL, error);
    if (status == EBPO_OK)
        status = level_normals(ebpo_file_info(file), &mesh, &nodes, &normals, error);
    style.normals = normals;
    if (status == EBPO_OK && mesh.face_count)
        status = draw_picture(c, &mesh, view, TILE_WIDTH, TILE_HEIGHT, &style, uri, error);
    free(normals);
    ebpo_lod_nodes_free(&nodes);
    ebpo_mesh_free(&mesh);
    return status;
}

static ebpo_status draw_method(comparison *c, method *m, ebpo_file *file, const camera *view,
                               ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = c->first;
         i <= method_last(c, m) && i < c->first + LEVELS_DRAWN && status == EBPO_OK; i++)
        status = draw_level(c, file, i, view, &m->picture[i], error);
    return method_note_missing(m, "pictures", status, error);
}

/* Draws the model itself, from the mesh of the file. */
static ebpo_status draw_portrait(comparison *c, method *m, ebpo_file *file, ebpo_error *error)
{
    raster_style style = { .colour = { 0.66, 0.54, 0.40 },
                           .closed = m->info.solid && m->info.report.manifold };
    ebpo_mesh mesh = { 0 };
    camera view;
    ebpo_read_options read = reading_options(c->v->threads, NULL);
    ebpo_status status = ebpo_file_read_mesh(file, &read, &mesh, error);
    if (status == EBPO_OK && mesh.face_count) {
        camera_fit(&view, &mesh, c->azimuth, c->elevation, c->v->up, PORTRAIT_WIDTH,
                   PORTRAIT_HEIGHT);
        status = draw_picture(c, &mesh, &view, PORTRAIT_WIDTH, PORTRAIT_HEIGHT, &style,
                              &c->portrait, error);
    }
    ebpo_mesh_free(&mesh);
    return method_note_missing(m, "picture of the model", status, error);
}

ebpo_status report_pictures(comparison *c, ebpo_error *error)
{
    ebpo_file *file[METHODS_MAX] = { NULL };
    ebpo_status status = EBPO_OK;
    camera view;
    for (int i = 0; i < c->count && status == EBPO_OK; i++)
        status = remote_open(&file[i], c->methods[i].path, &c->v->remote, error);
    if (status == EBPO_OK)
        status = draw_portrait(c, &c->methods[0], file[0], error);
    if (status == EBPO_OK)
        status = fit_camera(c, file, &view, error);
    for (int i = 0; i < c->count && status == EBPO_OK; i++) {
        if (c->progress.report)
            c->progress.report(c->progress.user, "pictures", (uint64_t)i, (uint64_t)c->count);
        status = draw_method(c, &c->methods[i], file[i], &view, error);
    }
    for (int i = 0; i < c->count; i++)
        ebpo_close(file[i]);
    return status;
}

#else

ebpo_status report_pictures(comparison *c, ebpo_error *error)
{
    (void)error;
    c->without_pictures = "this build has no libpng";
    return EBPO_OK;
}

#endif
