/* ebpo render: draws shaded pictures of levels or of the model, side by side if there are
 * several. */
#include "ebpo_config.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/colours.h>

#include "cli/command.h"
#include "cli/file_facts.h"
#include "cli/mesh_findings.h"
#include "cli/json.h"
#include "cli/process_memory.h"
#include "cli/progress.h"
#include "cli/reading.h"
#include "cli/remote_args.h"
#include "cli/standard_files.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/render/level_normals.h"
#include "cli/render/level_surface.h"
#include "cli/render/picture.h"
#include "cli/render/raster.h"

/* TILES_MAX: pictures side by side. MESH: stands for the mesh instead of a level. SIDE_MAX: maximum
 * width and height in pixels. */
enum { TILES_MAX = 24, MESH = -1, SIDE_MAX = 8192 };

typedef struct values {
    int64_t level, threads;
    const char *levels, *view, *size, *memory;
    int up;
    bool mesh, caps, surface, edges, no_colours, json, quiet;
    remote_values remote;
} values;

static const char *const up_words[] = { "x", "y", "z", NULL };

#include "cli/options/render.inc"

#if EBPO_HAVE_PNG

/* One of the pictures side by side. */
typedef struct tile {
    int level;           /* level of the file, or MESH */
    bool optional;       /* omit the tile if the file does not have the level */
    uint64_t face_count; /* number of drawn faces; also valid when the mesh has been freed */
    ebpo_mesh mesh;
    ebpo_colours colours;  /* colours of the model, if it has colours */
    float *normals;        /* normals of the triangles of a level, for lighting; or NULL */
    float *vertex_normals; /* normals of vertices, for lighting; or NULL */
    uint8_t *paint;        /* with --caps: RASTER_RED for caps, RASTER_PLAIN for faces; or NULL */
    bool closed;           /* only front sides of faces are visible */
    char caption[64];
} tile;

typedef struct job {
    values v;
    const char *in, *out;
    double azimuth, elevation; /* degrees */
    int width, height;         /* pixels */
    tile tiles[TILES_MAX];
    int tile_count;
    bool from_file; /* the input is an .ebpo.h5 file, not a mesh */
    traffic read;   /* if from_file: traffic of the file */
} job;

/* --- arguments --- */

static int usage_error(const char *what, const char *value, const char *expected)
{
    return command_usage("render", "%s: '%s' is not %s", what, value, expected);
}

/* Returns false if there are too many tiles. */
static bool add_tile(job *j, int level, bool optional)
{
    if (j->tile_count < TILES_MAX) {
        j->tiles[j->tile_count].level = level;
        j->tiles[j->tile_count].optional = optional;
    }
    return j->tile_count++ < TILES_MAX;
}

/* Adds the levels of a word such as "3", "0-5" or "3-". Levels of "3-" that the file does not have
 * are omitted later. */
static bool add_levels(job *j, const char *text)
{
    word_levels levels;
    if (!words_read_levels(text, &levels))
        return false;
    for (int i = levels.first; i <= levels.last; i++)
        if (!add_tile(j, i, levels.to_end && i > levels.first))
            return false;
    return true;
}

/* Adds the tiles of --levels, in the order of this list. Returns false for invalid text. */
static bool parse_levels(job *j)
{
    for (const char *at = j->v.levels;; at++) {
        char item[16];
        size_t length = strcspn(at, ",");
        if (length >= sizeof item)
            return false;
        memcpy(item, at, length);
        item[length] = 0;
        if (!(strcmp(item, "mesh") == 0 ? add_tile(j, MESH, false) : add_levels(j, item)))
            return false;
        at += length;
        if (!*at)
            return true;
    }
}

static int parse_values(job *j)
{
    char extra;
    const values *v = &j->v;
    if ((v->level >= 0) + v->mesh + (v->levels != NULL) > 1)
        return command_usage("render", "--level, --levels and --mesh cannot be used together");
    if (sscanf(v->view, "%lf,%lf%c", &j->azimuth, &j->elevation, &extra) != 2 ||
        !(j->azimuth >= -360 && j->azimuth <= 360) || !(j->elevation >= -90 && j->elevation <= 90))
        return usage_error("--view", v->view,
                           "an azimuth from -360 to 360, a comma, and an elevation from -90 to 90");
    if (sscanf(v->size, "%5dx%5d%c", &j->width, &j->height, &extra) != 2 || j->width < 16 ||
        j->width > SIDE_MAX || j->height < 16 || j->height > SIDE_MAX)
        return usage_error("--size", v->size,
                           "WIDTHxHEIGHT in pixels, each from 16 to 8192, such as 1920x1080");
    if (v->levels && !parse_levels(j))
        return usage_error(
            "--levels", v->levels,
            "at most 24 of 'mesh' and levels, such as 0-3,mesh; the deepest possible is 20");
    if (!v->levels)
        j->tiles[j->tile_count++].level = v->level >= 0 ? (int)v->level : MESH;
    bool draws_mesh = false, draws_level = false;
    for (int i = 0; i < j->tile_count; i++) {
        draws_mesh = draws_mesh || j->tiles[i].level == MESH;
        draws_level = draws_level || j->tiles[i].level != MESH;
    }
    if (v->surface && !draws_level)
        return command_usage("render", "--surface applies to pictures of levels only; give "
                                       "--level, or a level in --levels");
    if (v->caps && !draws_mesh)
        return command_usage("render", "--caps applies to pictures of the mesh only");
    return EXIT_OK;
}

/* --- loading --- */

static ebpo_status load_surface(tile *t, const ebpo_file *file, ebpo_error *error)
{
    ebpo_surface_mesh made = { 0 };
    ebpo_status status = level_surface(file, t->level, &made, error);
    if (status == EBPO_OK)
        snprintf(t->caption, sizeof t->caption, "level %d: %llu %s, error %.2g", t->level,
                 (unsigned long long)made.mesh.face_count,
                 made.mesh.face_count == 1 ? "triangle" : "triangles", made.error);
    t->mesh = made.mesh;
    t->colours = made.colours;
    t->vertex_normals = made.normals;
    return status;
}

/* Adds the caps to the mesh of a tile. */
static ebpo_status add_caps(tile *t, const ebpo_file *file, const char *path, ebpo_error *error)
{
    uint64_t faces = t->mesh.face_count;
    ebpo_status status = ebpo_mesh_add_caps(&t->mesh, file, error);
    if (status != EBPO_OK)
        return status;
    t->paint = malloc(t->mesh.face_count + 1);
    if (!t->paint) {
        snprintf(error->message, sizeof error->message, "%s: not enough memory for the caps", path);
        return error->status = EBPO_E_MEMORY;
    }
    memset(t->paint, RASTER_PLAIN, faces);
    memset(t->paint + faces, RASTER_RED, t->mesh.face_count - faces);
    return EBPO_OK;
}

static ebpo_status load_tile(job *j, tile *t, ebpo_file *file, ebpo_progress progress,
                             ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    unsigned threads = (unsigned)j->v.threads;
    ebpo_read_options read = reading_options(j->v.threads, NULL);
    if (t->level == MESH) {
        snprintf(t->caption, sizeof t->caption, "mesh, %llu %s",
                 (unsigned long long)info->face_count, info->face_count == 1 ? "face" : "faces");
        t->closed = info->solid && info->report.manifold;
        read.attributes = !j->v.no_colours && !j->v.caps;
        ebpo_status read_status = ebpo_file_read_mesh(file, &read, &t->mesh, error);
        if (read_status == EBPO_OK && j->tile_count > 1) /* lit like the levels beside it */
            read_status = mesh_normals(info, &t->mesh, &t->vertex_normals, error);
        if (read_status == EBPO_OK && j->v.caps)
            return add_caps(t, file, remote_shown(j->in), error);
        return read_status == EBPO_OK ? ebpo_mesh_colours(&t->mesh, &t->colours, error)
                                      : read_status;
    }
    if (j->v.surface)
        return load_surface(t, file, error);
    /* the defaults include cell faces, which close the envelopes */
    ebpo_lod_options lod = EBPO_LOD_OPTIONS_INIT;
    lod.threads = threads;
    lod.progress = progress;
    t->closed = true;
    ebpo_lod_nodes nodes;
    ebpo_status status = ebpo_lod_level_nodes(file, t->level, &lod, &t->mesh, &nodes, NULL, error);
    if (status == EBPO_OK && !j->v.no_colours)
        status = ebpo_lod_colours(&nodes, t->mesh.vertex_count, &t->colours, error);
    if (status == EBPO_OK)
        status = level_normals(info, &t->mesh, &nodes, &t->normals, error);
    ebpo_lod_nodes_free(&nodes);
    ebpo_solid_volume solid = facts_solid(info, NULL);
    if (status == EBPO_OK)
        snprintf(t->caption, sizeof t->caption, "level %d: %.1f %%%s", t->level,
                 facts_percent(info, &solid, t->level),
                 !info->solid                    ? " of box"
                 : findings_volume_known(&solid) ? ""
                                                 : " of winding integral");
    return status;
}

static void omit_missing_tiles(job *j, int level_count)
{
    int count = 0;
    for (int i = 0; i < j->tile_count; i++)
        if (!j->tiles[i].optional || j->tiles[i].level < level_count)
            j->tiles[count++] = j->tiles[i];
    j->tile_count = count;
}

static ebpo_status load_file(job *j, ebpo_progress progress, ebpo_error *error)
{
    ebpo_file *file = NULL;
    ebpo_status status = remote_open(&file, j->in, &j->v.remote, error);
    if (status == EBPO_OK)
        omit_missing_tiles(j, ebpo_file_info(file)->level_count);
    for (int i = 0; i < j->tile_count && status == EBPO_OK; i++)
        status = load_tile(j, &j->tiles[i], file, progress, error);
    if (status == EBPO_OK) {
        j->read = traffic_of(file);
        j->from_file = true;
        if (!j->v.json)
            remote_report(&j->read, &j->v.remote, false);
    }
    ebpo_close(file);
    return status;
}

static ebpo_status load_mesh(job *j, ebpo_progress progress, ebpo_error *error)
{
    ebpo_mesh_read_options read = EBPO_MESH_READ_OPTIONS_INIT;
    read.progress = progress;
    read.attributes = !j->v.no_colours;
    ebpo_mesh_report report;
    tile *t = &j->tiles[0];
    if (t->level != MESH || j->tile_count > 1) {
        snprintf(error->message, sizeof error->message,
                 "%s: is a mesh, which has no levels; convert it first", j->in);
        return error->status = EBPO_E_ARGUMENT;
    }
    if (j->v.caps) {
        snprintf(error->message, sizeof error->message,
                 "%s: is a mesh, which has no caps; convert it first", j->in);
        return error->status = EBPO_E_ARGUMENT;
    }
    ebpo_status status = ebpo_mesh_read(j->in, &read, &t->mesh, error);
    /* The check ensures that every index and coordinate can be drawn. */
    if (status == EBPO_OK)
        status = ebpo_mesh_check(&t->mesh, (unsigned)j->v.threads, progress, &report, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_colours(&t->mesh, &t->colours, error);
    return status;
}

/* --- the picture --- */

static void paint_background(picture *p)
{
    static const double top[3] = { 252, 253, 254 }, bottom[3] = { 222, 227, 233 };
    for (int y = 0; y < p->height; y++) {
        double share = (double)y / p->height;
        uint8_t *row = p->rgb + 3 * (size_t)y * (size_t)p->width;
        for (int x = 0; x < 3 * p->width; x++)
            row[x] = (uint8_t)(top[x % 3] + share * (bottom[x % 3] - top[x % 3]) + 0.5);
    }
}

/* Returns the tile with the coarsest level. All tiles have one viewpoint, from which this tile fits
 * into the picture. */
static const tile *coarsest_tile(const job *j)
{
    const tile *coarsest = &j->tiles[0];
    for (int i = 1; i < j->tile_count; i++)
        if ((unsigned)j->tiles[i].level < (unsigned)coarsest->level) /* MESH: the greatest */
            coarsest = &j->tiles[i];
    return coarsest;
}

static unsigned thread_count(const job *j)
{
    return j->v.threads ? (unsigned)j->v.threads : command_cores();
}

static int caption_height(const job *j, int width)
{
    return j->v.levels && picture_has_captions() ? 14 * (1 + width / 240) : 0;
}

/* Draws a tile into the rectangle at[] of the picture: left, top, width, height. */
static ebpo_status draw_tile(const job *j, const tile *t, picture *p, const camera *view,
                             const int at[4], ebpo_error *error)
{
    static const uint8_t ink[3] = { 60, 66, 76 };
    raster_style style = { .colour = { 0.30, 0.48, 0.66 },
                           .closed = t->closed,
                           .edges = j->v.edges,
                           .paint = t->paint,
                           .face_colours = t->colours.by_face ? t->colours.face : NULL,
                           .vertex_colours = t->colours.by_face ? NULL : t->colours.vertex,
                           .normals = t->normals,
                           .vertex_normals = t->vertex_normals };
    if (t->level == MESH || j->v.surface)
        memcpy(style.colour, (const double[3]){ 0.66, 0.54, 0.40 }, sizeof style.colour);
    int caption = caption_height(j, at[2]), drawn = at[3] - caption;
    ebpo_status status =
        raster_draw(p, at[0], at[1], at[2], drawn, view, &t->mesh, &style, thread_count(j), error);
    if (status == EBPO_OK && caption)
        status = picture_caption(p, at[0], at[1] + drawn, at[2], caption, ink, t->caption, error);
    return status;
}

static ebpo_status draw_tiles(const job *j, picture *p, ebpo_error *error)
{
    int columns = j->tile_count <= 5             ? j->tile_count
                  : (j->tile_count + 1) / 2 <= 6 ? (j->tile_count + 1) / 2
                                                 : 6;
    int rows = (j->tile_count + columns - 1) / columns;
    int width = j->width / columns, height = j->height / rows;
    int caption = caption_height(j, width);
    ebpo_status status = EBPO_OK;
    camera view;
    const tile *coarsest = coarsest_tile(j);
    if (height <= caption) {
        snprintf(error->message, sizeof error->message,
                 "--size %s is too small for %d tiles; choose a larger size", j->v.size,
                 j->tile_count);
        return error->status = EBPO_E_ARGUMENT;
    }
    paint_background(p);
    if (coarsest->mesh.face_count)
        camera_fit(&view, &coarsest->mesh, j->azimuth, j->elevation, j->v.up, width,
                   height - caption);
    for (int i = 0; i < j->tile_count && status == EBPO_OK; i++) {
        int at[4] = { i % columns * width, i / columns * height, width, height };
        if (j->tiles[i].mesh.face_count)
            status = draw_tile(j, &j->tiles[i], p, &view, at, error);
    }
    return status;
}

static ebpo_status render_picture(job *j, bool is_file, ebpo_progress progress, ebpo_error *error)
{
    static const uint8_t white[3] = { 255, 255, 255 };
    picture p = { 0 };
    ebpo_status status = is_file ? load_file(j, progress, error) : load_mesh(j, progress, error);
    if (status == EBPO_OK && !picture_make(&p, j->width, j->height, white)) {
        snprintf(error->message, sizeof error->message,
                 "not enough memory for a picture of %s; choose a smaller --size", j->v.size);
        status = error->status = EBPO_E_MEMORY;
    }
    if (status == EBPO_OK)
        status = draw_tiles(j, &p, error);
    if (status == EBPO_OK)
        status = picture_write_png(&p, j->out, error);
    picture_free(&p);
    for (int i = 0; i < j->tile_count; i++) {
        j->tiles[i].face_count = j->tiles[i].mesh.face_count;
        ebpo_mesh_free(&j->tiles[i].mesh);
        ebpo_colours_free(&j->tiles[i].colours);
        free(j->tiles[i].normals);
        free(j->tiles[i].vertex_normals);
        free(j->tiles[i].paint);
    }
    return status;
}

static void report_json(const job *j)
{
    json out;
    json_begin(&out, stdout);
    json_object(&out, NULL);
    json_text(&out, "file", standard_files_shown(j->out));
    json_uint(&out, "width", (uint64_t)j->width);
    json_uint(&out, "height", (uint64_t)j->height);
    json_real(&out, "azimuth", j->azimuth);
    json_real(&out, "elevation", j->elevation);
    json_array(&out, "drawn");
    for (int i = 0; i < j->tile_count; i++) {
        const tile *t = &j->tiles[i];
        json_object(&out, NULL);
        if (t->level == MESH)
            json_null(&out, "level");
        else
            json_int(&out, "level", t->level);
        json_uint(&out, "faces", t->face_count);
        json_end(&out);
    }
    json_end(&out);
    if (j->from_file)
        remote_json(&out, &j->read, &j->v.remote);
    json_finish(&out);
}

static int run_job(job *j)
{
    int code = parse_values(j);
    if (code != EXIT_OK)
        return code;
    if (command_overwrites("render", j->in, j->out))
        return EXIT_USAGE;
    int is_file = command_is_hdf5("render", j->in);
    if (is_file < 0)
        return EXIT_FAILED;
    progress_line line;
    ebpo_progress progress = progress_start(&line, "render", j->v.quiet);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = render_picture(j, is_file, progress, &error);
    progress_wipe(&line);
    if (status == EBPO_OK && j->v.json)
        report_json(j);
    return status == EBPO_OK ? EXIT_OK : command_failed("render", &error);
}

#endif

static const values standard = {
    .level = -1, .view = "30,20", .size = "1200x900", .up = 1, .remote = REMOTE_VALUES_INIT
};

static int run_render(void *given, const char **operand)
{
#if EBPO_HAVE_PNG
    values *v = given;
    if (!process_memory_take("render", v->memory, v->threads))
        return EXIT_USAGE;
    job *j = calloc(1, sizeof *j);
    if (!j)
        return command_no_memory("render");
    j->v = *v;
    j->in = operand[0];
    j->out = operand[1];
    int code = run_job(j);
    free(j);
    return code;
#else
    (void)given;
    (void)operand;
    fprintf(stderr, "ebpo render: this build has no libpng; install libpng and rebuild ebpo\n");
    return EXIT_USAGE;
#endif
}

const command command_render = { &spec, sizeof standard, &standard, run_render };
