/* ebpo map: computes distances on a plane, on a grid, or at the vertices of another model. */
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/colours.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/map_job.h"
#include "cli/json.h"
#include "cli/model_memory.h"
#include "cli/progress.h"
#include "cli/render/picture.h"
#include "cli/render/raster.h"
#include "cli/words.h"
#include "ebpo_config.h"

/* --- the points of a plane or grid --- */

/* LONGER_EDGE_POINTS: default number of points along the longer edge of a plane. GRID_MAX: maximum
 * number of points of a grid along an axis. */
enum { LONGER_EDGE_POINTS = 1000, GRID_MAX = 1 << 20 };

static int refuse_value(const char *option, const char *value, const char *expected)
{
    return command_usage("map", "%s '%s': expected %s", option, value, expected);
}

bool map_read_size(const char *text, int *width, int *height)
{
    char extra;
    if (sscanf(text, "%5dx%5d%c", width, height, &extra) == 2 && *width >= 2 && *width <= 8192 &&
        *height >= 2 && *height <= 8192)
        return true;
    refuse_value("--size", text, "a width, an x and a height, each from 2 to 8192");
    return false;
}

/* Sets the corners of the box: --box, or the box of the model with --margin. Returns an exit code.
 */
static int find_box(const map_job *j, double low[3], double high[3])
{
    const ebpo_info *info = ebpo_file_info(j->file);
    double all[6], longest = 0;
    if (j->v->box) {
        if (!args_read_reals(j->v->box, 6, all) || !(all[0] < all[3]) || !(all[1] < all[4]) ||
            !(all[2] < all[5]))
            return refuse_value("--box", j->v->box, "six numbers, the lower corner first");
        memcpy(low, all, 3 * sizeof *low);
        memcpy(high, all + 3, 3 * sizeof *high);
    }
    for (int c = 0; c < 3; c++)
        longest = fmax(longest, info->box_size[c]);
    for (int c = 0; c < 3; c++) {
        if (!j->v->box) {
            low[c] = info->box_origin[c] - j->v->margin * longest;
            high[c] = info->box_origin[c] + info->box_size[c] + j->v->margin * longest;
        }
        if (!isfinite(high[c] - low[c])) /* results would be NaN */
            return command_usage("map", "the edges of the box are beyond the range of a double");
    }
    return EXIT_OK;
}

/* --- planes --- */

static double length_of(const double v[3]) { return hypot(hypot(v[0], v[1]), v[2]); }

typedef struct rectangle {
    double corner[3], edge[2][3];
} rectangle;

/* Reads a plane across an axis: "z=0.5", a coordinate, or "z=50%", a share of the model's box.
 * Returns false for other text. */
static bool read_plane(const map_job *j, const char *text, int *axis, double *at)
{
    const ebpo_info *info = ebpo_file_info(j->file);
    char *end;
    if (text[0] < 'x' || text[0] > 'z' || text[1] != '=')
        return false;
    *axis = text[0] - 'x';
    *at = strtod(text + 2, &end);
    if (end == text + 2 || !isfinite(*at))
        return false;
    if (strcmp(end, "%") == 0)
        *at = info->box_origin[*axis] + *at / 100 * info->box_size[*axis];
    else if (*end)
        return false;
    return isfinite(*at);
}

/* Finds the rectangle of --plane. Edge 0 points to the right in the picture, edge 1 up. For a plane
 * across an axis, edges 0 and 1 are along the other two axes, in the order x, y, z. Returns an exit
 * code. */
static int find_rectangle(const map_job *j, rectangle *r)
{
    double all[9], low[3], high[3], at;
    int axis;
    *r = (rectangle){ 0 };
    if (read_plane(j, j->v->plane, &axis, &at)) {
        int code = find_box(j, low, high), right = axis == 0, up = axis == 2 ? 1 : 2;
        if (code != EXIT_OK)
            return code;
        memcpy(r->corner, low, sizeof r->corner);
        r->corner[axis] = at;
        r->edge[0][right] = high[right] - low[right];
        r->edge[1][up] = high[up] - low[up];
        return EXIT_OK;
    }
    if (!args_read_reals(j->v->plane, 9, all))
        return refuse_value(
            "--plane", j->v->plane,
            "x=V, y=V or z=V with a number or a share such as 50%, or nine numbers: a corner and "
            "two edges");
    if (j->v->box)
        return command_usage("map", "--box belongs to --grid and to planes across an axis");
    if (j->v->margin != MAP_MARGIN)
        return command_usage("map", "--margin belongs to --grid and to planes across an axis");
    memcpy(r, all, sizeof *r);
    double a = length_of(r->edge[0]), b = length_of(r->edge[1]), dot = 0;
    for (int c = 0; c < 3; c++)
        dot += r->edge[0][c] / a * (r->edge[1][c] / b);
    if (!(a > 0) || !(b > 0) || !isfinite(a) || !isfinite(b) || fabs(dot) > 1e-9)
        return refuse_value("--plane", j->v->plane, "two edges with a length, at right angles");
    return EXIT_OK;
}

/* Sets the numbers of points along the edges of a plane, whose lengths are a and b. */
static void find_points(const map_job *j, double a, double b, uint64_t count[3])
{
    double longer = fmax(a, b);
    double shares[2] = { a / longer, b / longer };
    count[2] = 1;
    for (int i = 0; i < 2; i++) {
        double n = round(LONGER_EDGE_POINTS * shares[i]);
        count[i] = n < 2 ? 2 : (uint64_t)n;
    }
    if (j->width) {
        count[0] = (uint64_t)j->width;
        count[1] = (uint64_t)j->height;
    }
}

static int lattice_of_plane(map_job *j)
{
    rectangle r;
    int code = find_rectangle(j, &r);
    if (code != EXIT_OK)
        return code;
    ebpo_lattice *l = &j->lattice;
    double a = length_of(r.edge[0]), b = length_of(r.edge[1]), step = 0;
    find_points(j, a, b, l->count);
    memcpy(l->origin, r.corner, sizeof l->origin);
    for (int i = 0; i < 2; i++)
        for (int c = 0; c < 3; c++)
            l->step[i][c] = r.edge[i][c] / (double)(l->count[i] - 1);
    step = length_of(l->step[0]);
    for (int c = 0; c < 3; c++) { /* the normal, for formats that need one */
        int d = (c + 1) % 3, e = (c + 2) % 3;
        l->step[2][c] =
            step * (r.edge[0][d] / a * (r.edge[1][e] / b) - r.edge[0][e] / a * (r.edge[1][d] / b));
    }
    return EXIT_OK;
}

static int lattice_of_grid(map_job *j)
{
    double numbers[3], low[3], high[3];
    uint64_t count[3];
    ebpo_error error = EBPO_ERROR_INIT;
    bool valid = args_read_reals(j->v->grid, 3, numbers);
    for (int c = 0; c < 3 && valid; c++) {
        valid = numbers[c] >= 1 && numbers[c] <= GRID_MAX && numbers[c] == floor(numbers[c]);
        count[c] = valid ? (uint64_t)numbers[c] : 0;
    }
    if (!valid)
        return refuse_value("--grid", j->v->grid, "three whole numbers, each from 1 to 1048576");
    int code = find_box(j, low, high);
    if (code != EXIT_OK)
        return code;
    if (ebpo_lattice_of_box(low, high, count, &j->lattice, &error) != EBPO_OK)
        return command_failed("map", &error);
    return EXIT_OK;
}

/* Reads --plane, --grid, --box, --margin and --size. Returns an exit code; errors were reported. */
static int map_find_lattice(map_job *j)
{
    j->plane = j->v->plane != NULL;
    return j->plane ? lattice_of_plane(j) : lattice_of_grid(j);
}

/* --- pictures of distances: the points of a plane as pixels, or a painted mesh, with a legend ---
 */

#if EBPO_HAVE_PNG

/* Sizes in pixels. */
enum { LEGEND_WIDTH = 120, BAR_WIDTH = 24, EDGE_WIDTH = 16, LINE_HEIGHT = 18 };
static const uint8_t white[3] = { 255, 255, 255 }, ink[3] = { 40, 44, 52 };

static ebpo_status no_picture_memory(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message,
             "no memory for the picture; choose a smaller "
             "--size");
    return error->status = EBPO_E_MEMORY;
}

static void put_pixel(picture *p, int x, int y, const uint8_t rgb[3])
{
    uint8_t *to = p->rgb + 3 * ((size_t)y * (size_t)p->width + (size_t)x);
    for (int c = 0; c < 3; c++)
        to[c] = rgb[c];
}

/* Draws a bar of all colours, with numbers at its ends and in the middle. has_signs: the bar begins
 * with negative distances, not with 0. */
static ebpo_status draw_legend(const map_job *j, picture *p, int x, bool has_signs,
                               ebpo_error *error)
{
    int top = EDGE_WIDTH, bottom = p->height - EDGE_WIDTH;
    ebpo_status status = EBPO_OK;
    for (int y = top; y < bottom; y++) {
        double share = (double)(bottom - 1 - y) / fmax(1, bottom - 1 - top);
        double distance = (has_signs ? 2 * share - 1 : share) * j->range;
        uint8_t rgb[3];
        ebpo_map_colour((ebpo_map_palette)j->v->palette, distance, j->range, rgb);
        for (int i = 0; i < BAR_WIDTH; i++)
            put_pixel(p, x + EDGE_WIDTH + i, y, rgb);
    }
    for (int i = 0; i < 3 && bottom - top >= 3 * LINE_HEIGHT && status == EBPO_OK; i++) {
        char text[32];
        double share = i / 2.0;
        snprintf(text, sizeof text, "%.4g", (has_signs ? 2 * share - 1 : share) * j->range);
        int y = bottom - LINE_HEIGHT - (int)(share * (bottom - top - LINE_HEIGHT));
        status =
            picture_caption(p, x + EDGE_WIDTH + BAR_WIDTH, y, LEGEND_WIDTH - EDGE_WIDTH - BAR_WIDTH,
                            LINE_HEIGHT, ink, text, error);
    }
    return status;
}

/* Returns true if one value is below 0 and the other above 0. The product of the values does not
 * show this, because it may underflow. */
static bool differ_in_sign(double a, double b) { return (a < 0 && b > 0) || (a > 0 && b < 0); }

/* Returns true if the surface is at the pixel (x, y). The value of this pixel is then 0, or differs
 * in sign from the value of the next pixel in x or y. */
static bool on_surface(const double *values, int width, int height, int x, int y)
{
    const double *value = values + (size_t)y * (size_t)width + (size_t)x;
    return *value == 0 || (x + 1 < width && differ_in_sign(*value, value[1])) ||
           (y + 1 < height && differ_in_sign(*value, value[width]));
}

/* Returns true if the colours show the signs of distances. */
static bool has_signs(const map_job *j)
{
    return j->v->palette == EBPO_MAP_DIVERGING && j->stats.min < 0;
}

/* Draws the values of a plane, [height][width], with row 0 at the bottom, and a legend. */
static ebpo_status map_draw_plane(const map_job *j, const double *values, const char *path,
                                  ebpo_error *error)
{
    int width = (int)j->lattice.count[0], height = (int)j->lattice.count[1];
    picture p = { 0 };
    if (!picture_make(&p, width + LEGEND_WIDTH, height, white))
        return no_picture_memory(error);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            uint8_t rgb[3];
            ebpo_map_colour((ebpo_map_palette)j->v->palette,
                            values[(size_t)y * (size_t)width + (size_t)x], j->range, rgb);
            put_pixel(&p, x, height - 1 - y, on_surface(values, width, height, x, y) ? ink : rgb);
        }
    ebpo_status status = draw_legend(j, &p, width, has_signs(j), error);
    if (status == EBPO_OK)
        status = picture_write_png(&p, path, error);
    picture_free(&p);
    return status;
}

/* Draws a painted mesh, with a legend. */
static ebpo_status map_draw_mesh(const map_job *j, const ebpo_mesh *mesh, const char *path,
                                 ebpo_error *error)
{
    picture p = { 0 };
    camera view;
    ebpo_colours colours = { 0 };
    unsigned threads = j->options.threads ? j->options.threads : command_cores();
    if (!picture_make(&p, j->width + LEGEND_WIDTH, j->height, white))
        return no_picture_memory(error);
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

static ebpo_status fail_without_png(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message,
             "this build draws no pictures: it has no libpng; install libpng and rebuild ebpo");
    return error->status = EBPO_E_UNSUPPORTED;
}

static ebpo_status map_draw_plane(const map_job *j, const double *values, const char *path,
                                  ebpo_error *error)
{
    (void)j;
    (void)values;
    (void)path;
    return fail_without_png(error);
}

static ebpo_status map_draw_mesh(const map_job *j, const ebpo_mesh *mesh, const char *path,
                                 ebpo_error *error)
{
    (void)j;
    (void)mesh;
    (void)path;
    return fail_without_png(error);
}

#endif

/* --- distances --- */

static ebpo_status no_memory(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message,
             "no memory for the distances; choose fewer points");
    return error->status = EBPO_E_MEMORY;
}

/* --- planes and grids --- */

/* Copies the values of a plane. user: an array of two pointers, to the variable that points to the
 * job, and to the copy. */
static ebpo_status keep_layer(void *user, const double *values, uint64_t first, uint64_t layers,
                              ebpo_error *error)
{
    map_job *const *job = ((void **)user)[0];
    (void)first;
    (void)layers;
    (void)error;
    const ebpo_lattice *l = &(*job)->lattice;
    memcpy(((void **)user)[1], values, l->count[0] * l->count[1] * sizeof *values);
    return EBPO_OK;
}

/* Computes the values of a plane, and draws its pictures. */
static ebpo_status map_plane(map_job *j, ebpo_error *error)
{
    uint64_t count = j->lattice.count[0] * j->lattice.count[1];
    double *values = malloc(count * sizeof *values);
    if (!values)
        return no_memory(error);
    void *user[2] = { &j, values };
    ebpo_status status =
        ebpo_map_lattice(j->model, &j->lattice, &j->options, keep_layer, user, error);
    if (status == EBPO_OK)
        status = ebpo_map_describe(values, count, &j->stats, error);
    if (j->range == 0 && j->stats.farthest > 0)
        j->range = j->stats.farthest;
    if (status == EBPO_OK && j->v->out && words_end_with(j->v->out, ".png"))
        status = map_draw_plane(j, values, j->v->out, error);
    if (status == EBPO_OK && j->v->picture)
        status = map_draw_plane(j, values, j->v->picture, error);
    free(values);
    return status;
}

static ebpo_status map_plane_or_grid(map_job *j, ebpo_error *error)
{
    const char *out = j->v->out;
    ebpo_status status = EBPO_OK;
    if (j->plane)
        status = map_plane(j, error);
    if (status != EBPO_OK || (j->plane && (!out || words_end_with(out, ".png"))))
        return status;
    return ebpo_map_write(j->model, &j->lattice, out,
                          words_end_with(out, ".nrrd") ? EBPO_MAP_NRRD : EBPO_MAP_VTKHDF,
                          &j->options, j->plane ? NULL : &j->stats, error);
}

/* --- vertices --- */

static ebpo_status read_source(const map_job *j, ebpo_progress progress, ebpo_mesh *out,
                               ebpo_error *error)
{
    if (command_is_hdf5("map", j->v->from) == 0) {
        ebpo_mesh_read_options o = EBPO_MESH_READ_OPTIONS_INIT;
        o.threads = (unsigned)j->v->threads;
        o.progress = progress;
        o.attributes = 1;
        return ebpo_mesh_read(j->v->from, &o, out, error);
    }
    ebpo_read_options o = EBPO_READ_OPTIONS_INIT;
    ebpo_file *file = NULL;
    bool ordered;
    o.threads = (unsigned)j->v->threads;
    o.attributes = 1;
    ebpo_status status = remote_open(&file, j->v->from, &j->v->remote, error);
    if (status == EBPO_OK)
        status = ebpo_file_read_source_mesh(file, &o, out, &ordered, error);
    ebpo_close(file);
    return status;
}

/* Returns the vertices of a mesh as doubles; NULL: there is not enough memory. */
static double *points_of(const ebpo_mesh *m)
{
    double *points = malloc((m->vertex_count + 1) * 3 * sizeof *points);
    for (uint64_t i = 0; points && i < 3 * m->vertex_count; i++)
        points[i] = m->xyz32 ? (double)m->xyz32[i] : m->xyz64[i];
    return points;
}

static ebpo_status paint_map(map_job *j, ebpo_mesh *m, const double *distances, ebpo_error *error)
{
    if (j->range == 0) /* without --range: a percentile that few distances exceed */
        j->range = j->stats.percentile_unsigned[5];
    if (!(j->range > 0))
        j->range = j->stats.farthest > 0 ? j->stats.farthest : 1;
    ebpo_status status =
        ebpo_map_paint(m, distances, (ebpo_map_palette)j->v->palette, j->range, error);
    if (status == EBPO_OK && j->v->out)
        status = ebpo_mesh_write_ply(m, j->v->out, error);
    if (status == EBPO_OK && j->v->picture)
        status = map_draw_mesh(j, m, j->v->picture, error);
    return status;
}

static ebpo_status bound_hausdorff(map_job *j, const ebpo_mesh *m, const double *distances,
                                   ebpo_error *error)
{
    ebpo_map_hausdorff_options o = EBPO_MAP_HAUSDORFF_OPTIONS_INIT;
    o.threads = j->options.threads;
    o.progress = j->options.progress;
    return ebpo_map_bound_hausdorff(j->model, m, distances, &o, &j->hausdorff, error);
}

static ebpo_status map_vertices(map_job *j, ebpo_progress progress, ebpo_error *error)
{
    ebpo_mesh m = { 0 };
    ebpo_mesh_report report;
    ebpo_status status = read_source(j, progress, &m, error);
    if (status != EBPO_OK)
        return status;
    double *points = points_of(&m), *distances = malloc((m.vertex_count + 1) * sizeof *distances);
    if (!points || !distances)
        status = no_memory(error);
    if (status == EBPO_OK) /* ensures that every face can be drawn */
        status = ebpo_mesh_check(&m, j->options.threads, progress, &report, error);
    if (status == EBPO_OK)
        status = ebpo_map_points(j->model, points, m.vertex_count, &j->options, distances, error);
    if (status == EBPO_OK)
        status = ebpo_map_describe(distances, m.vertex_count, &j->stats, error);
    if (status == EBPO_OK && j->v->bounds)
        status = bound_hausdorff(j, &m, distances, error);
    if (status == EBPO_OK && (j->v->out || j->v->picture))
        status = paint_map(j, &m, distances, error);
    free(points);
    free(distances);
    ebpo_mesh_free(&m);
    return status;
}

/* --- the command --- */

typedef map_values values;

static const char *const palette_words[] = { "diverging", "thesis", NULL };

#include "cli/options/map.inc"

static const map_values standard = { .margin = MAP_MARGIN,
                                     .max_distance = INFINITY,
                                     .remote = REMOTE_VALUES_INIT };

/* --- options --- */

static bool has_ending(const char *out, const char *const *endings)
{
    for (; *endings; endings++)
        if (words_end_with(out, *endings))
            return true;
    return false;
}

static int check_output(const map_values *v)
{
    static const char *const of_grid[] = { ".vtkhdf", ".h5", ".nrrd", NULL },
                             *const of_plane[] = { ".vtkhdf", ".h5", ".nrrd", ".png", NULL },
                             *const of_vertices[] = { ".ply", NULL },
                             *const png[] = { ".png", NULL };
    if (v->grid && !v->out)
        return command_usage("map", "--grid needs --output: a name that ends with .vtkhdf, .h5 or "
                                    ".nrrd");
    if (v->out && !has_ending(v->out, v->grid ? of_grid : v->plane ? of_plane : of_vertices))
        return command_usage("map", "--output '%s': expected a name that ends with %s", v->out,
                             v->grid    ? ".vtkhdf, .h5 or .nrrd"
                             : v->plane ? ".vtkhdf, .h5, .nrrd or .png"
                                        : ".ply");
    if (v->picture && v->grid)
        return command_usage("map", "--picture shows a plane or vertices; give --plane as well "
                                    "in a second run");
    if (v->picture && !has_ending(v->picture, png))
        return command_usage("map", "--picture '%s': expected a name that ends with .png",
                             v->picture);
    bool coloured = v->picture || (v->out && (v->from || has_ending(v->out, png)));
    if (!coloured && (v->range != standard.range || v->palette != standard.palette))
        return command_usage("map", "--range and --palette belong to pictures and to the PLY of "
                                    "--from");
    return EXIT_OK;
}

static int check_values(const map_values *v)
{
    int kinds = (v->plane != NULL) + (v->grid != NULL) + (v->from != NULL);
    if (kinds != 1)
        return command_usage("map",
                             "expected one of --plane, --grid and --from, which define the points");
    if (v->from && (v->box || v->margin != standard.margin))
        return command_usage("map", "--box and --margin belong to --plane and --grid");
    if ((v->grid || v->from) && v->size && !v->picture)
        return command_usage("map", "--size belongs to --plane and to the picture of --from");
    if (v->box && v->margin != standard.margin)
        return command_usage("map", "--margin is around the model's box; omit it with --box");
    if (v->bounds && !v->from)
        return command_usage("map", "--bounds belongs to --from");
    if (v->bounds && isfinite(v->max_distance))
        return command_usage("map", "--bounds needs all distances: omit --max-distance");
    return check_output(v);
}

/* Checks that outputs overwrite neither inputs nor each other. Returns an exit code. */
static int check_outputs(const char *path, const map_values *v)
{
    const char *outs[] = { v->out, v->picture }, *ins[] = { path, v->from };
    for (int i = 0; i < 4; i++)
        if (outs[i / 2] && ins[i % 2] && command_overwrites("map", ins[i % 2], outs[i / 2]))
            return EXIT_USAGE;
    if (v->out && v->picture && command_same_file(v->out, v->picture))
        return command_usage("map", "--output and --picture are the same file; choose two names");
    return EXIT_OK;
}

/* --- output --- */

static void print_percentiles(const ebpo_map_stats *s)
{
    printf("  %-10s", "percent");
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        printf(" %12g", ebpo_map_percent(i));
    printf("\n  %-10s", "signed");
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        printf(" %12.6g", s->percentile[i]);
    printf("\n  %-10s", "unsigned");
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        printf(" %12.6g", s->percentile_unsigned[i]);
    putchar('\n');
}

static void print_stats(const map_job *j)
{
    const ebpo_map_stats *s = &j->stats;
    const char *unit = ebpo_file_info(j->file)->unit;
    char points[40], queries[40];
    printf("%s: distances of %s%s%s%s\n", remote_shown(j->path),
           words_plural(points, sizeof points, s->count + s->beyond, "point", "points"),
           unit[0] ? ", unit " : "", unit, j->v->from ? ", vertices of the other model" : "");
    printf("  inside     %llu, on the model %llu", (unsigned long long)s->inside,
           (unsigned long long)s->on);
    if (s->beyond)
        printf(", beyond --max-distance %llu", (unsigned long long)s->beyond);
    printf("\n  from       %.9g to %.9g, farthest without signs %.9g\n", s->min, s->max,
           s->farthest);
    printf("  mean       %.9g, without signs %.9g\n  rms        %.9g, standard deviation %.9g\n",
           s->mean, s->mean_unsigned, s->rms, s->standard_deviation);
    if (isfinite(s->percentile[0]))
        print_percentiles(s);
    if (j->v->bounds)
        printf("  hausdorff  %.9g to %.9g, from all faces of the other model; %s\n",
               j->hausdorff.lo, j->hausdorff.hi,
               words_plural(queries, sizeof queries, j->hausdorff.queries, "distance",
                            "distances"));
}

static void json_stats(const map_job *j, json *out)
{
    const ebpo_map_stats *s = &j->stats;
    double percents[EBPO_MAP_PERCENTILES];
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        percents[i] = ebpo_map_percent(i);
    json_text(out, "file", remote_shown(j->path));
    json_text(out, "points", j->v->from ? "vertices" : j->plane ? "plane" : "grid");
    json_text(out, "unit", ebpo_file_info(j->file)->unit);
    json_uint(out, "count", s->count);
    json_uint(out, "beyond", s->beyond);
    json_uint(out, "inside", s->inside);
    json_uint(out, "on", s->on);
    json_real(out, "min", s->min);
    json_real(out, "max", s->max);
    json_real(out, "farthest", s->farthest);
    json_real(out, "mean", s->mean);
    json_real(out, "mean_unsigned", s->mean_unsigned);
    json_real(out, "rms", s->rms);
    json_real(out, "standard_deviation", s->standard_deviation);
    if (isfinite(s->percentile[0])) {
        json_reals(out, "percents", percents, EBPO_MAP_PERCENTILES);
        json_reals(out, "percentiles", s->percentile, EBPO_MAP_PERCENTILES);
        json_reals(out, "percentiles_unsigned", s->percentile_unsigned, EBPO_MAP_PERCENTILES);
    }
    if (j->v->bounds) {
        json_object(out, "hausdorff");
        json_real(out, "lo", j->hausdorff.lo);
        json_real(out, "hi", j->hausdorff.hi);
        json_reals(out, "location", j->hausdorff.location, 3);
        json_uint(out, "queries", j->hausdorff.queries);
        json_end(out);
    }
    if (j->range > 0)
        json_real(out, "colour_range", j->range);
    if (j->v->out)
        json_text(out, "output", j->v->out);
    if (j->v->picture)
        json_text(out, "picture", j->v->picture);
}

static void report_map(const map_job *j)
{
    traffic t = traffic_of(j->file);
    if (!j->v->json) {
        if (!j->v->quiet)
            print_stats(j);
        remote_report(&t, &j->v->remote, false);
        return;
    }
    json out;
    json_begin(&out, stdout);
    json_object(&out, NULL);
    json_stats(j, &out);
    remote_json(&out, &t, &j->v->remote);
    json_finish(&out);
}

/* --- running --- */

/* memory_given: `memory` is the value of --memory; otherwise a default is chosen. */
static ebpo_status open_model(map_job *j, uint64_t memory, bool memory_given,
                              ebpo_progress progress, ebpo_error *error)
{
    ebpo_model_options o = EBPO_MODEL_OPTIONS_INIT;
    o.memory = memory;
    o.threads = (unsigned)j->v->threads;
    o.progress = progress;
    if (!memory_given)
        model_memory_default("map", j->file, j->path, &o);
    return ebpo_model_new(j->file, &o, &j->model, error);
}

static int run_job(map_job *j, uint64_t memory)
{
    const map_values *v = j->v;
    ebpo_error error = EBPO_ERROR_INIT;
    progress_line line;
    ebpo_progress progress = progress_start(&line, "map", v->quiet || v->json);
    j->options.progress = progress;
    ebpo_status status = remote_open(&j->file, j->path, &v->remote, &error);
    if (status != EBPO_OK)
        return command_failed("map", &error);
    int code = v->from ? EXIT_OK : map_find_lattice(j);
    if (code != EXIT_OK)
        return code;
    status = open_model(j, memory, v->memory != NULL, progress, &error);
    if (status == EBPO_OK)
        status = v->from ? map_vertices(j, progress, &error) : map_plane_or_grid(j, &error);
    progress_wipe(&line);
    if (status == EBPO_OK)
        report_map(j);
    return status == EBPO_OK ? EXIT_OK : command_failed("map", &error);
}

static int run_map(void *given, const char **operand)
{
    map_values *v = given;
    map_job j = { .v = v,
                  .path = operand[0],
                  .options = EBPO_MAP_OPTIONS_INIT,
                  .stats = EBPO_MAP_STATS_INIT,
                  .hausdorff = EBPO_MAP_HAUSDORFF_INIT,
                  .range = v->range };
    uint64_t memory = 0;
    int code = check_values(v);
    if (code == EXIT_OK && v->memory && !words_read_size(v->memory, &memory))
        code = command_usage("map", "--memory '%s': expected " WORDS_SIZE_EXPECTED, v->memory);
    if (code == EXIT_OK && v->size && !map_read_size(v->size, &j.width, &j.height))
        code = EXIT_USAGE;
    if (code == EXIT_OK)
        code = check_outputs(operand[0], v);
    if (code == EXIT_OK && !command_requires_hdf5("map", operand[0]))
        code = EXIT_FAILED;
    if (code != EXIT_OK)
        return code;
    if (v->from && !v->size) {
        j.width = 1200;
        j.height = 900;
    }
    j.options.max_distance = v->max_distance;
    j.options.unsigned_distance = v->unsigned_distance;
    j.options.threads = (unsigned)v->threads;
    code = run_job(&j, memory);
    ebpo_model_free(j.model);
    ebpo_close(j.file);
    return code;
}

const command command_map = { &spec, sizeof standard, &standard, run_map };
