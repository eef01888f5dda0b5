/* Pictures of distances: a plane's points as pixels, a painted mesh; a legend beside them. */
#include "ebpo_config.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <ebpo/colours.h>

#include "cli/command.h"
#include "cli/words.h"
#include "cli/commands/map_job.h"
#include "cli/render/picture.h"
#include "cli/render/raster.h"

#if EBPO_HAVE_PNG

enum { LEGEND = 120, BAR = 24, EDGE = 16, LINE = 18 };
static const uint8_t white[3] = { 255, 255, 255 }, ink[3] = { 40, 44, 52 };

static ebpo_status no_memory(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message,
             "no memory for the picture; choose a smaller "
             "--size");
    return error->status = EBPO_E_MEMORY;
}

static void put(picture *p, int x, int y, const uint8_t rgb[3])
{
    uint8_t *to = p->rgb + 3 * ((size_t)y * (size_t)p->width + (size_t)x);
    for (int c = 0; c < 3; c++)
        to[c] = rgb[c];
}

/* A bar of all colours, with numbers where it ends and in the middle. */
static ebpo_status draw_legend(const map_job *j, picture *p, int x, bool has_signs,
                               ebpo_error *error)
{
    int top = EDGE, bottom = p->height - EDGE;
    ebpo_status status = EBPO_OK;
    for (int y = top; y < bottom; y++) {
        double share = (double)(bottom - 1 - y) / fmax(1, bottom - 1 - top);
        double distance = (has_signs ? 2 * share - 1 : share) * j->range;
        uint8_t rgb[3];
        ebpo_map_colour((ebpo_map_palette)j->v->palette, distance, j->range, rgb);
        for (int i = 0; i < BAR; i++)
            put(p, x + EDGE + i, y, rgb);
    }
    for (int i = 0; i < 3 && bottom - top >= 3 * LINE && status == EBPO_OK; i++) {
        char text[32];
        double share = i / 2.0;
        snprintf(text, sizeof text, "%.4g", (has_signs ? 2 * share - 1 : share) * j->range);
        int y = bottom - LINE - (int)(share * (bottom - top - LINE));
        status = picture_caption(p, x + EDGE + BAR, y, LEGEND - EDGE - BAR, LINE, ink, text, error);
    }
    return status;
}

/* Where the sign changes between neighbours, or it is 0: the surface. */
static bool on_surface(const double *values, int width, int height, int x, int y)
{
    double own = values[(size_t)y * (size_t)width + (size_t)x];
    if (own == 0)
        return true;
    if (x + 1 < width && own * values[(size_t)y * (size_t)width + (size_t)x + 1] < 0)
        return true;
    return y + 1 < height && own * values[(size_t)(y + 1) * (size_t)width + (size_t)x] < 0;
}

static bool has_signs(const map_job *j)
{
    return j->v->palette == EBPO_MAP_DIVERGING && j->stats.min < 0;
}

ebpo_status map_draw_plane(const map_job *j, const double *values, const char *path,
                           ebpo_error *error)
{
    int width = (int)j->lattice.count[0], height = (int)j->lattice.count[1];
    picture p = { 0 };
    if (!picture_make(&p, width + LEGEND, height, white))
        return no_memory(error);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            uint8_t rgb[3];
            ebpo_map_colour((ebpo_map_palette)j->v->palette,
                            values[(size_t)y * (size_t)width + (size_t)x], j->range, rgb);
            put(&p, x, height - 1 - y, on_surface(values, width, height, x, y) ? ink : rgb);
        }
    ebpo_status status = draw_legend(j, &p, width, has_signs(j), error);
    if (status == EBPO_OK)
        status = picture_write_png(&p, path, error);
    picture_free(&p);
    return status;
}

ebpo_status map_draw_mesh(const map_job *j, const ebpo_mesh *mesh, const char *path,
                          ebpo_error *error)
{
    picture p = { 0 };
    camera view;
    ebpo_colours colours = { 0 };
    unsigned threads = j->options.threads ? j->options.threads : command_cores();
    if (!picture_make(&p, j->width + LEGEND, j->height, white))
        return no_memory(error);
    ebpo_status status = ebpo_mesh_colours(mesh, &colours, error);
    raster_style style = { .colour = { 0.6, 0.6, 0.6 }, .vertex_colours = colours.vertex };
    if (status == EBPO_OK && mesh->face_count) {
        camera_fit(&view, mesh, 30, 20, 1, j->width, j->height);
        status = raster_draw(&p, 0, 0, j->width, j->height, &view, mesh, &style,
                             threads < 64 ? threads : 64, error);
    }
    if (status == EBPO_OK)
        status = draw_legend(j, &p, j->width, has_signs(j), error);
    if (status == EBPO_OK)
        status = picture_write_png(&p, path, error);
    ebpo_colours_free(&colours);
    picture_free(&p);
    return status;
}

#else

static ebpo_status without(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message,
             "this build draws no pictures: it has no libpng; install libpng and rebuild ebpo");
    return error->status = EBPO_E_UNSUPPORTED;
}

ebpo_status map_draw_plane(const map_job *j, const double *values, const char *path,
                           ebpo_error *error)
{
    (void)j;
    (void)values;
    (void)path;
    return without(error);
}

ebpo_status map_draw_mesh(const map_job *j, const ebpo_mesh *mesh, const char *path,
                          ebpo_error *error)
{
    (void)j;
    (void)mesh;
    (void)path;
    return without(error);
}

#endif
