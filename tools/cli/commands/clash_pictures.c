/* Draws pictures of clashes, the contacts of two instances in a scene. A strip is a picture with a
 * tile for each of several times. */
#include "ebpo_config.h"

#include "cli/commands/clash_pictures.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if EBPO_HAVE_PNG

#include "cli/commands/painted_mesh.h"
#include "cli/render/picture.h"
#include "cli/render/raster.h"

enum {
    WIDTH = 480, /* sizes in pixels */
    HEIGHT = 360,
    CAPTION = 28, /* height of a caption */
    UP = 2,       /* the z axis points up */
    THREADS_MAX = 64
};
static const double azimuth = 35, elevation = 28; /* direction of the camera, in degrees */

const char *clash_pictures_missing(void) { return NULL; }

static ebpo_status no_memory(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message, "no memory for pictures of the scene");
    return error->status = EBPO_E_MEMORY;
}

/* Sets the camera so that the box just fits into the picture. */
static void aim_camera(camera *view, const double min[3], const double max[3], int height)
{
    double corner[24];
    uint32_t face[3] = { 0, 1, 2 };
    ebpo_mesh box = { .vertex_count = 8, .face_count = 1, .xyz64 = corner, .faces = face };
    for (int i = 0; i < 24; i++)
        corner[i] = (i / 3 >> i % 3 & 1 ? max : min)[i % 3];
    camera_fit(view, &box, azimuth, elevation, UP, WIDTH, height);
}

static ebpo_status draw_model(picture *out, int x, int y, int height, const camera *view,
                              const painted_mesh *p, unsigned threads, ebpo_error *error)
{
    raster_style style = { .colour = { 0.66, 0.54, 0.40 }, .paint = p->paint };
    unsigned count = threads && threads < THREADS_MAX ? threads : 4;
    return p->mesh.face_count
               ? raster_draw(out, x, y, WIDTH, height, view, &p->mesh, &style, count, error)
               : EBPO_OK;
}

/* --- one clash --- */

static void widen_box(double min[3], double max[3], const double p[3])
{
    for (int k = 0; k < 3; k++) {
        min[k] = fmin(min[k], p[k]);
        max[k] = fmax(max[k], p[k]);
    }
}

static double longest_side(const double min[3], const double max[3])
{
    return fmax(max[0] - min[0], fmax(max[1] - min[1], max[2] - min[2]));
}

/* Chooses the region to draw, a cube around the smaller instance. If the contact is small compared
 * with this instance, the region is only the surroundings of the contact. */
static ebpo_status find_region(const ebpo_scene *scene, const clash *c, double middle[3],
                               double *half_side, ebpo_error *error)
{
    const ebpo_scene_clash *clash_facts = &c->worst;
    double min[2][3], max[2][3];
    bool has_location = isfinite(clash_facts->location[0]);
    for (int i = 0; i < 2; i++) {
        ebpo_status status = ebpo_scene_instance_box(scene, i ? clash_facts->b : clash_facts->a,
                                                     c->time, c->time, min[i], max[i], error);
        if (status != EBPO_OK)
            return status;
    }
    int small = longest_side(min[1], max[1]) < longest_side(min[0], max[0]);
    double size = longest_side(min[small], max[small]),
           contact = longest_side(clash_facts->location_min, clash_facts->location_max);
    bool zoom = has_location && clash_facts->crossing && contact > 0 && 8 * contact < size;
    const double *low = zoom ? clash_facts->location_min : min[small],
                 *high = zoom ? clash_facts->location_max : max[small];
    if (has_location) {
        widen_box(min[small], max[small], clash_facts->location_min);
        widen_box(min[small], max[small], clash_facts->location_max);
    }
    for (int k = 0; k < 3; k++)
        middle[k] = low[k] / 2 + high[k] / 2;
    *half_side = (zoom ? 4 : 0.6) * longest_side(low, high);
    return EBPO_OK;
}

static ebpo_status paint_pair(ebpo_scene *scene, const clash *c, unsigned threads,
                              painted_mesh *out, ebpo_error *error)
{
    const ebpo_scene_clash *clash_facts = &c->worst;
    bool intersects = clash_facts->touching + clash_facts->coplanar + clash_facts->crossing > 0;
    uint8_t *red[2] = { NULL, NULL };
    ebpo_status status = intersects ? painted_find_red(scene, clash_facts->a, clash_facts->b,
                                                       c->time, threads, red, error)
                                    : EBPO_OK;
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        bool outer = clash_facts->kind == EBPO_CLASH_ENCLOSED &&
                     clash_facts->relation == (i ? EBPO_A_INSIDE_B : EBPO_B_INSIDE_A);
        status =
            painted_add(out, scene, i ? clash_facts->b : clash_facts->a, c->time, red[i],
                        (uint8_t)((i ? RASTER_OTHER : RASTER_PLAIN) | (outer ? RASTER_HOLLOW : 0)),
                        error);
    }
    free(red[0]);
    free(red[1]);
    return status;
}

static ebpo_status draw_clash(const painted_mesh *p, const camera *view, clash *c, unsigned threads,
                              ebpo_error *error)
{
    static const uint8_t ground[3] = { 246, 248, 250 };
    picture on = { 0 };
    void *png = NULL;
    size_t size = 0;
    ebpo_status status = picture_make(&on, WIDTH, HEIGHT, ground) ? EBPO_OK : no_memory(error);
    if (status == EBPO_OK)
        status = draw_model(&on, 0, 0, HEIGHT, view, p, threads, error);
    if (status == EBPO_OK)
        status = picture_encode_png(on.rgb, WIDTH, HEIGHT, 3, "picture", &png, &size, error);
    if (status == EBPO_OK && !(c->picture = picture_data_uri(png, size)))
        status = no_memory(error);
    picture_free(&on);
    free(png);
    return status;
}

ebpo_status clash_draw(ebpo_scene *scene, clash *c, unsigned threads, ebpo_error *error)
{
    painted_mesh p = { 0 };
    camera view;
    double middle[3], min[3], max[3], half_side;
    ebpo_status status = find_region(scene, c, middle, &half_side, error);
    if (status == EBPO_OK)
        status = paint_pair(scene, c, threads, &p, error);
    if (status == EBPO_OK) {
        /* removes faces that would hide the region */
        painted_crop(&p, middle, 1.5 * half_side);
        for (int k = 0; k < 3; k++) {
            min[k] = middle[k] - half_side;
            max[k] = middle[k] + half_side;
        }
        aim_camera(&view, min, max, HEIGHT);
        status = draw_clash(&p, &view, c, threads, error);
    }
    painted_free(&p);
    return status;
}

/* --- several times side by side --- */

struct clash_strip {
    ebpo_scene *scene;
    unsigned threads;
    int tiles, done, columns; /* number of tiles in all, drawn so far, and in a row */
    uint64_t instances;       /* number of instances in the scene */
    /* the scene has too many faces: draw instances without intersecting faces as boxes */
    bool boxes;
    double min[3], max[3]; /* box of the scene at all times */
    picture picture;
};

enum { FACES_MAX = 2000000 }; /* scenes with more faces are drawn with boxes */

/* Returns the number of faces of all instances. */
static uint64_t faces_of(const ebpo_scene *scene, uint64_t models)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; i < models; i++) {
        ebpo_scene_model_facts model = EBPO_SCENE_MODEL_FACTS_INIT;
        (void)ebpo_scene_get_model_facts(scene, i, &model);
        sum += model.instances * ebpo_file_info(ebpo_scene_file(scene, i))->face_count;
    }
    return sum;
}

clash_strip *clash_strip_new(ebpo_scene *scene, double from, double to, int tiles, unsigned threads)
{
    static const uint8_t ground[3] = { 246, 248, 250 };
    ebpo_scene_counts counts = EBPO_SCENE_COUNTS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    clash_strip *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    (void)ebpo_scene_get_counts(scene, &counts);
    s->scene = scene;
    s->threads = threads;
    s->tiles = tiles;
    for (s->columns = 1; s->columns * s->columns < tiles;)
        s->columns++;
    s->instances = counts.instances;
    s->boxes = faces_of(scene, counts.models) > FACES_MAX;
    int rows = (tiles + s->columns - 1) / s->columns;
    if (ebpo_scene_box(scene, from, to, s->min, s->max, &error) != EBPO_OK ||
        !picture_make(&s->picture, WIDTH * s->columns, HEIGHT * rows, ground)) {
        clash_strip_free(s);
        return NULL;
    }
    return s;
}

void clash_strip_free(clash_strip *s)
{
    if (s)
        picture_free(&s->picture);
    free(s);
}

/* Sets red[i] to the bytes that mark the red faces of instance i. red[i] remains NULL if no face of
 * the instance intersects another instance. */
static ebpo_status find_red_faces(clash_strip *s, double time,
                                  const ebpo_scene_clash *found_clashes, uint64_t count,
                                  uint8_t **red, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        const ebpo_scene_clash *clash_facts = &found_clashes[i];
        uint8_t *two[2] = { red[clash_facts->a], red[clash_facts->b] };
        if (clash_facts->touching + clash_facts->coplanar + clash_facts->crossing == 0)
            continue;
        status = painted_find_red(s->scene, clash_facts->a, clash_facts->b, time, s->threads, two,
                                  error);
        red[clash_facts->a] = two[0];
        red[clash_facts->b] = two[1];
    }
    return status;
}

static ebpo_status paint_instances(const clash_strip *s, double time, uint8_t *const *red,
                                   painted_mesh *out, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < s->instances && status == EBPO_OK; i++) {
        ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
        (void)ebpo_scene_get_instance(s->scene, i, &at);
        uint8_t paint = at.fixed ? RASTER_PLAIN : RASTER_OTHER;
        /* ebpo scene pack omits the mesh of a model that no other instance comes near */
        bool has_mesh = ebpo_file_info(ebpo_scene_file(s->scene, at.model))->parts & EBPO_PART_MESH;
        status = !has_mesh || (s->boxes && !red[i])
                     ? painted_add_box(out, s->scene, i, time, paint, error)
                     : painted_add(out, s->scene, i, time, red[i], paint, error);
    }
    return status;
}

/* Draws the next tile. count: number of clashes at `time`, for the caption. */
static ebpo_status draw_tile(clash_strip *s, const painted_mesh *p, double time, uint64_t count,
                             ebpo_error *error)
{
    static const uint8_t ink[3] = { 60, 66, 76 };
    char text[80];
    camera view;
    int caption = picture_has_captions() ? CAPTION : 0;
    int x = s->done % s->columns * WIDTH, y = s->done / s->columns * HEIGHT;
    aim_camera(&view, s->min, s->max, HEIGHT - caption);
    s->done++;
    ebpo_status status =
        draw_model(&s->picture, x, y, HEIGHT - caption, &view, p, s->threads, error);
    snprintf(text, sizeof text, "time %.4g: %llu %s", time, (unsigned long long)count,
             count == 1 ? "clash" : "clashes");
    if (status == EBPO_OK && caption)
        status =
            picture_caption(&s->picture, x, y + HEIGHT - caption, WIDTH, caption, ink, text, error);
    return status;
}

ebpo_status clash_strip_add(clash_strip *s, double time, const ebpo_scene_clash *found_clashes,
                            uint64_t count, ebpo_error *error)
{
    painted_mesh p = { 0 };
    uint8_t **red = calloc(s->instances + 1, sizeof *red);
    ebpo_status status =
        red ? find_red_faces(s, time, found_clashes, count, red, error) : no_memory(error);
    if (status == EBPO_OK)
        status = paint_instances(s, time, red, &p, error);
    if (status == EBPO_OK && s->done < s->tiles)
        status = draw_tile(s, &p, time, count, error);
    for (uint64_t i = 0; red && i < s->instances; i++)
        free(red[i]);
    free(red);
    painted_free(&p);
    return status;
}

ebpo_status clash_strip_write(const clash_strip *s, const char *path, ebpo_error *error)
{
    return picture_write_png(&s->picture, path, error);
}

#else

const char *clash_pictures_missing(void) { return "this build has no libpng"; }

ebpo_status clash_draw(ebpo_scene *scene, clash *c, unsigned threads, ebpo_error *error)
{
    (void)scene, (void)c, (void)threads, (void)error;
    return EBPO_OK;
}

clash_strip *clash_strip_new(ebpo_scene *scene, double from, double to, int tiles, unsigned threads)
{
    (void)scene, (void)from, (void)to, (void)tiles, (void)threads;
    return NULL;
}

ebpo_status clash_strip_add(clash_strip *s, double time, const ebpo_scene_clash *found_clashes,
                            uint64_t count, ebpo_error *error)
{
    (void)s, (void)time, (void)found_clashes, (void)count, (void)error;
    return EBPO_OK;
}

ebpo_status clash_strip_write(const clash_strip *s, const char *path, ebpo_error *error)
{
    (void)s, (void)path, (void)error;
    return EBPO_OK;
}

void clash_strip_free(clash_strip *s) { (void)s; }

#endif
