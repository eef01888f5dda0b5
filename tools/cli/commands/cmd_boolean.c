/* ebpo boolean: queries unions, intersections and differences of models at poses, and writes their
 * meshes. */
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/boolean_args.h"
#include "cli/boolean_operands.h"
#include "cli/boolean_output.h"
#include "cli/command.h"
#include "cli/json.h"
#include "cli/memory_args.h"
#include "cli/points.h"
#include "cli/progress.h"
#include "cli/query_args.h"
#include "cli/remote_args.h"
#include "cli/tables.h"
#include "cli/words.h"
#include "cli/commands/commands.h"

typedef struct values {
    query_values query; /* must be the first member: shared options have offsets within it */
    const char *inside, *distance; /* names of files of points; NULL: not given */
    const char *out, *temp_dir, *box;
    arg_list poses, sections;
    int64_t level;
    double tolerance;
    bool volume, inner, cells, doubles, crossings, changed_only, colours;
} values;

#include "cli/options/boolean.inc"

/* --- results --- */

static const char *where_of(const ebpo_boolean_result *r)
{
    static const char *const words[] = { "OUT", "IN", "ON" };
    return words[r->where];
}

static const char *doubt_of(const ebpo_boolean_result *r) { return r->certain ? "" : "?"; }

static void print_inside(const values *v, const ebpo_boolean_result *r)
{
    if (v->query.json)
        printf("{\"where\": \"%s\", \"certain\": %s}\n", where_of(r),
               r->certain ? "true" : "false");
    else
        printf("%s%s\n", where_of(r), doubt_of(r));
}

static void print_distance(const values *v, const ebpo_boundary_distance *d)
{
    char lo[32], hi[32];
    if (!v->query.json)
        printf("%s %s %s%s\n", words_real(d->lo, lo), words_real(d->hi, hi), where_of(&d->inside),
               doubt_of(&d->inside));
    else
        printf("{\"lo\": %s, \"hi\": %s, \"where\": \"%s\", \"certain\": %s, \"cells\": %" PRIu64
               "}\n",
               json_number(d->lo, lo), json_number(d->hi, hi), where_of(&d->inside),
               d->inside.certain ? "true" : "false", d->cells);
}

/* --- volumes --- */

/* Request and results for volumes and cells. */
typedef struct cell_result {
    const values *v;
    const boolean_operands *operands;
    boolean_output output;
    ebpo_exact_volume exact;
    ebpo_boolean_volume cells;
    /* no cells can be made, although the volume is exact; `why_no_cells` is the reason */
    bool no_cells;
    char why_no_cells[1024];
    bool volume;            /* the volume is requested */
    uint64_t faces_written; /* number of written faces of cells */
} cell_result;

/* Returns true if the exact result, not cells that approximate it, is written to --output. */
static bool writes_result(const values *v) { return v->out && !v->cells; }

/* Returns true if the exact volume of the result was computed. */
static bool is_exact(const cell_result *a) { return a->exact.volume.kind == EBPO_VALUE_EXACT; }

static int32_t volume_kind(const cell_result *a)
{
    return is_exact(a) ? (int32_t)EBPO_VALUE_EXACT : a->cells.kind;
}

enum { OPERAND_NAME = 512 };

/* Writes the letter and the file name of an operand. Operands after the models are regions: the box
 * and half-spaces. */
static const char *name_operand(const cell_result *a, uint32_t i, char out[OPERAND_NAME])
{
    if (i < a->operands->count)
        snprintf(out, OPERAND_NAME, "%c (%s)", 'A' + (int)i, remote_shown(a->operands->shown[i]));
    else
        snprintf(out, OPERAND_NAME, "%s",
                 a->v->box && i == a->operands->count ? "the box" : "a half-space");
    return out;
}

/* Writes why the volume is not exact. */
static void explain_bound(const cell_result *a, char *out, size_t capacity)
{
    const ebpo_exact_volume *e = &a->exact;
    char first[OPERAND_NAME], second[OPERAND_NAME];
    name_operand(a, e->operand[0], first);
    name_operand(a, e->operand[1], second);
    switch ((ebpo_volume_doubt)e->doubt) {
    case EBPO_VOLUME_OPERANDS_INTERSECT:
        snprintf(out, capacity, "face %" PRIu64 " of %s intersects face %" PRIu64 " of %s",
                 e->face[0], first, e->face[1], second);
        break;
    case EBPO_VOLUME_FACES_INTERSECT:
        snprintf(out, capacity,
                 "faces %" PRIu64 " and %" PRIu64 " of %s intersect, other than neighbours",
                 e->face[0], e->face[1], first);
        break;
    case EBPO_VOLUME_IN_PARTS: snprintf(out, capacity, "%s is only partly in memory", first); break;
    case EBPO_VOLUME_SUBSET: snprintf(out, capacity, "%s is a part of another file", first); break;
    case EBPO_VOLUME_CERTAIN: snprintf(out, capacity, "%s", ""); break;
    }
}

static const char *const volume_kinds[] = { "exact", "interval", "bound" };

/* Prints an exact volume: the nearest double, or scaled * 2^exponent if it is out of the range of
 * doubles. */
static void print_exact(double volume, double scaled, int64_t exponent)
{
    char exact[32], cell[TABLE_CELL];
    printf("volume    %s, exact but for one rounding\n",
           table_in_range(scaled, exponent) ? words_real(volume, exact)
                                            : table_scaled(cell, 9, scaled, exponent));
}

static void print_volume(const cell_result *a)
{
    const ebpo_boolean_volume *b = &a->cells;
    char why[2048], lo[32], hi[32];
    explain_bound(a, why, sizeof why);
    if (is_exact(a))
        print_exact(a->exact.volume.lo, a->exact.scaled, a->exact.exponent);
    if (a->no_cells) {
        printf("by cells  not known: %s\n", a->why_no_cells);
        return;
    }
    if (is_exact(a))
        printf("by cells  %s to %s\n", words_real(b->lo, lo), words_real(b->hi, hi));
    else
        printf("volume    %s to %s, %s: %s\n", words_real(b->lo, lo), words_real(b->hi, hi),
               b->kind == EBPO_VALUE_BOUND ? "a bound" : "an interval", why);
    printf("cells     %" PRIu64 " in, %" PRIu64 " mixed of level %" PRId64
           ", edge %g\ndecided   %" PRIu64 " by boxes, %" PRIu64 " by nodes, %" PRIu64
           " by faces\n",
           b->in_cells, b->mixed_cells, a->v->level, ldexp(b->edge, (int)-a->v->level), b->by_box,
           b->by_nodes, b->by_faces);
}

/* Prints the volume of the result that was written. */
static void print_result_volume(const ebpo_boolean_mesh_report *r)
{
    char lo[32], hi[32];
    if (r->volume.kind == EBPO_VALUE_EXACT)
        print_exact(r->volume.lo, r->scaled, r->exponent);
    else
        printf("volume    %s to %s, an interval\n", words_real(r->volume.lo, lo),
               words_real(r->volume.hi, hi));
}

static void result_volume_to_json(json *j, const ebpo_boolean_mesh_report *r)
{
    for (int i = 0; i < 2; i++)
        if (r->volume.kind == EBPO_VALUE_EXACT)
            table_json(j, i ? "volume_hi" : "volume_lo", r->scaled, r->exponent);
        else
            json_real(j, i ? "volume_hi" : "volume_lo", i ? r->volume.hi : r->volume.lo);
    json_text(j, "volume_kind", volume_kinds[r->volume.kind]);
}

static void volume_to_json(json *j, const cell_result *a)
{
    const ebpo_boolean_volume *b = &a->cells;
    char why[2048];
    explain_bound(a, why, sizeof why);
    for (int i = 0; i < 2; i++)
        if (is_exact(a))
            table_json(j, i ? "volume_hi" : "volume_lo", a->exact.scaled, a->exact.exponent);
        else
            json_real(j, i ? "volume_hi" : "volume_lo", i ? b->hi : b->lo);
    json_text(j, "volume_kind", volume_kinds[volume_kind(a)]);
    if (is_exact(a))
        json_null(j, "not_exact");
    else
        json_text(j, "not_exact", why);
    if (a->no_cells) {
        json_text(j, "no_cells", a->why_no_cells);
        return;
    }
    json_real(j, "cells_lo", b->lo);
    json_real(j, "cells_hi", b->hi);
    json_int(j, "level", a->v->level);
    json_reals(j, "root_origin", b->origin, 3);
    json_real(j, "root_edge", b->edge);
    json_uint(j, "in_cells", b->in_cells);
    json_uint(j, "mixed_cells", b->mixed_cells);
    json_uint(j, "by_box", b->by_box);
    json_uint(j, "by_nodes", b->by_nodes);
    json_uint(j, "by_faces", b->by_faces);
}

static void print_written(const cell_result *a)
{
    char faces[40], in[40], mixed[40];
    words_plural(faces, sizeof faces, a->faces_written, "face", "faces");
    words_plural(in, sizeof in, a->cells.in_cells, "cell", "cells");
    words_plural(mixed, sizeof mixed, a->cells.mixed_cells, "mixed cell", "mixed cells");
    if (a->v->inner)
        printf("%s: %s around %s within the result\n", a->v->out, faces, in);
    else
        printf("%s: %s around %s and %s that contain the result\n", a->v->out, faces, in, mixed);
}

static void print_cells(const cell_result *a)
{
    json j;
    if (!a->v->query.json) {
        if (writes_result(a->v))
            boolean_print_result(&a->output);
        else if (a->v->out)
            print_written(a);
        if (a->volume && writes_result(a->v))
            print_result_volume(&a->output.report);
        else if (a->volume)
            print_volume(a);
        return;
    }
    json_begin(&j, stdout);
    json_object(&j, NULL);
    if (writes_result(a->v)) {
        boolean_result_to_json(&a->output, &j);
    } else if (a->v->out) {
        json_text(&j, "output", a->v->out);
        json_text(&j, "side", a->v->inner ? "inner" : "outer");
        json_uint(&j, "faces", a->faces_written);
    }
    if (a->volume && writes_result(a->v))
        result_volume_to_json(&j, &a->output.report);
    else if (a->volume)
        volume_to_json(&j, a);
    json_finish(&j);
}

/* --- points --- */

static ebpo_status compute_points(const values *v, ebpo_boolean *b, const double *rows,
                                  uint64_t count, ebpo_boolean_result *results, ebpo_error *error)
{
    ebpo_boundary_options boundary_options = EBPO_BOUNDARY_OPTIONS_INIT;
    boundary_options.tolerance = v->tolerance;
    ebpo_status status =
        v->inside ? ebpo_boolean_inside_many(b, rows, count, results, error) : EBPO_OK;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        ebpo_boundary_distance d;
        if (v->distance)
            status = ebpo_boolean_distance(b, rows + 3 * i, &boundary_options, &d, error);
        if (status == EBPO_OK && v->distance)
            print_distance(v, &d);
        else if (status == EBPO_OK)
            print_inside(v, &results[i]);
    }
    return status;
}

static int query_points(const values *v, ebpo_boolean *b)
{
    points in;
    ebpo_error error = EBPO_ERROR_INIT;
    double *rows = malloc(sizeof *rows * POINTS_BATCH * POINTS_WIDEST);
    ebpo_boolean_result *results = malloc(sizeof *results * POINTS_BATCH);
    bool opened =
        points_open(&in, "boolean", v->inside ? v->inside : v->distance, POINTS, false, INFINITY);
    int code = !rows || !results ? command_no_memory("boolean") : opened ? EXIT_OK : EXIT_FAILED;
    uint64_t count = 0;
    in.header = v->query.header;
    while (code == EXIT_OK && (count = points_next(&in, rows)) > 0) {
        if (compute_points(v, b, rows, count, results, &error) != EBPO_OK)
            code = command_failed("boolean", &error);
        if (!command_flush("boolean"))
            code = EXIT_FAILED;
    }
    if (code == EXIT_OK && in.failed)
        code = EXIT_FAILED;
    points_close(&in);
    free(results);
    free(rows);
    return code;
}

/* --- cells --- */

static ebpo_status write_cells(const ebpo_boolean_cells *cells, cell_result *a,
                               ebpo_progress progress, ebpo_error *error)
{
    ebpo_mesh mesh;
    const values *v = a->v;
    ebpo_boolean_side side = v->inner ? EBPO_BOOLEAN_INNER : EBPO_BOOLEAN_OUTER;
    ebpo_status status = ebpo_boolean_cells_mesh(cells, side, &mesh, error);
    if (status != EBPO_OK)
        return status;
    a->faces_written = mesh.face_count;
    if (mesh.face_count == 0) {
        error->status = status = EBPO_E_ABSENT;
        snprintf(error->message, sizeof error->message,
                 "%s: there are no %s at level %" PRId64 "; give a higher level", v->out,
                 v->inner ? "inner cells" : "cells", v->level);
    } else {
        status = boolean_write_mesh(&a->output, &mesh, progress, error);
    }
    ebpo_mesh_free(&mesh);
    return status;
}

/* Writes the exact result, or computes the volume and the cells. If the exact volume is known, a
 * failure to make cells is no error. */
static ebpo_status compute_cells(cell_result *a, ebpo_boolean *b, ebpo_progress progress,
                                 ebpo_error *error)
{
    ebpo_boolean_cells *cells = NULL;
    ebpo_volume_options volume_options = EBPO_VOLUME_OPTIONS_INIT;
    ebpo_cells_options cells_options = EBPO_CELLS_OPTIONS_INIT;
    cells_options.level = (int)a->v->level;
    cells_options.progress = volume_options.progress = progress;
    ebpo_status status = EBPO_OK;
    if (writes_result(a->v))
        status = boolean_write_result(&a->output, b, progress, error);
    if (status != EBPO_OK || writes_result(a->v))
        return status;
    if (a->volume)
        status = ebpo_boolean_exact_volume(b, &volume_options, &a->exact, error);
    bool exact = status == EBPO_OK && is_exact(a);
    if (status == EBPO_OK)
        status = ebpo_boolean_cells_new(b, &cells_options, &cells, error);
    if (status == EBPO_E_LIMIT && exact && !a->v->cells) {
        a->no_cells = true;
        snprintf(a->why_no_cells, sizeof a->why_no_cells, "%s", error->message);
        return EBPO_OK;
    }
    if (status == EBPO_OK)
        status = ebpo_boolean_cells_volume(cells, &a->cells);
    if (status == EBPO_OK && a->v->cells)
        status = write_cells(cells, a, progress, error);
    ebpo_boolean_cells_free(cells);
    return status;
}

static int make_cells(const values *v, const boolean_nodes *nodes, const boolean_operands *operands,
                      ebpo_workspace *workspace, ebpo_boolean *b)
{
    progress_line line;
    ebpo_error error = EBPO_ERROR_INIT;
    cell_result a = { .v = v,
                      .operands = operands,
                      .output = { .path = v->out,
                                  .unit = boolean_operands_unit(operands, nodes),
                                  .threads = (unsigned)v->query.threads,
                                  .doubles = v->doubles,
                                  .volume = v->volume,
                                  .crossings = v->crossings,
                                  .changed_only = v->changed_only,
                                  .colours = v->colours,
                                  .workspace = workspace },
                      .exact = EBPO_EXACT_VOLUME_INIT,
                      .cells = EBPO_BOOLEAN_VOLUME_INIT,
                      .volume = v->volume || !v->out };
    ebpo_progress progress = progress_start(&line, "boolean", v->query.json);
    ebpo_status status = compute_cells(&a, b, progress, &error);
    progress_wipe(&line);
    bool empty = a.output.is_empty;
    if (status != EBPO_OK) {
        int code = command_failed("boolean", &error);
        return empty && status == EBPO_E_ABSENT ? EXIT_EMPTY : code;
    }
    print_cells(&a);
    if (empty)
        fprintf(stderr, "ebpo boolean: %s: warning: the result is empty\n", v->out);
    return !command_flush("boolean") ? EXIT_FAILED : empty ? EXIT_EMPTY : EXIT_OK;
}

/* --- all of it --- */

static int check_values(const values *v, const boolean_operands *operands)
{
    bool has_point_queries = v->inside || v->distance;
    if (v->inside && v->distance)
        return command_usage("boolean", "--inside and --distance cannot be used together");
    if (has_point_queries && (v->volume || v->out || v->inner))
        return command_usage("boolean",
                             "%s cannot be used with --volume, --output or --inner; run the "
                             "command for each",
                             v->inside ? "--inside" : "--distance");
    if (v->cells && !v->out)
        return command_usage("boolean", "--cells needs --output");
    if (v->inner && !v->cells)
        return command_usage("boolean", "--inner needs --output and --cells");
    const char *result_option = v->doubles        ? "double"
                                : v->crossings    ? "crossings"
                                : v->changed_only ? "changed-only"
                                : v->colours      ? "operand-colours"
                                : v->temp_dir && !v->box && v->sections.count == 0 ? "temp-dir"
                                                                                   : NULL;
    if (result_option && !writes_result(v))
        return command_usage("boolean", "--%s needs --output, and excludes --cells", result_option);
    if (v->changed_only && (v->volume || v->crossings || !words_end_with(v->out, ".ply")))
        return command_usage("boolean", "--changed-only writes a .ply file, and excludes --volume "
                                        "and --crossings");
    if (v->out && !words_end_with(v->out, ".ply") && !words_end_with(v->out, ".ebpo.h5"))
        return command_usage("boolean",
                             "--output '%s': expected a name that ends with .ply or "
                             ".ebpo.h5",
                             v->out);
    return v->out && boolean_operands_overwrite(operands, "boolean", v->out) ? EXIT_USAGE : EXIT_OK;
}

/* Reads the box and the planes to which the result is cut. */
static int read_regions(const values *v, double box[6], double (*plane)[4],
                        ebpo_boolean_options *out)
{
    if (v->box && !args_read_reals(v->box, 6, box))
        return command_usage("boolean", "--box '%s': expected six numbers X0,Y0,Z0,X1,Y1,Z1",
                             v->box);
    for (int i = 0; i < v->sections.count; i++)
        if (!boolean_read_plane("boolean", v->sections.item[i], plane[i]))
            return EXIT_USAGE;
    out->box = v->box ? box : NULL;
    out->planes = plane[0];
    out->plane_count = (uint32_t)v->sections.count;
    out->temp_dir = v->temp_dir;
    return EXIT_OK;
}

static int evaluate_expression(const values *v, const boolean_nodes *nodes,
                               const boolean_operands *operands,
                               ebpo_boolean_options *boolean_options, ebpo_workspace *workspace)
{
    ebpo_boolean *b;
    ebpo_error error = EBPO_ERROR_INIT;
    boolean_options->threads = (unsigned)v->query.threads;
    if (ebpo_boolean_new(operands->operand, operands->count, nodes->node, nodes->count,
                         boolean_options, &b, &error) != EBPO_OK)
        return command_failed("boolean", &error);
    int code = v->inside || v->distance ? query_points(v, b)
                                        : make_cells(v, nodes, operands, workspace, b);
    ebpo_boolean_free(b);
    return code;
}

/* Memory in bytes that each model may use in any case. Budgets below 3 MiB are refused. */
static const uint64_t least_memory = UINT64_C(4) << 20;

/* If the exact result is written with --memory or --temp-dir, makes the workspace. With --memory,
 * sets the limit of each model. All models together use an eighth of the memory, or up to a quarter
 * if they need more: with more than they need, the search for intersecting faces is hardly faster,
 * and the arrays of the meshes have less. */
static int limit_memory(const values *v, boolean_operands *operands,
                        ebpo_model_options *model_options, ebpo_workspace **out)
{
    const memory_values memory = { model_options->memory ? v->query.memory : NULL, v->temp_dir };
    ebpo_error error = EBPO_ERROR_INIT;
    if (!writes_result(v) || (model_options->memory == 0 && !v->temp_dir))
        return EXIT_OK;
    if (!memory_check("boolean", &memory))
        return EXIT_USAGE;
    if (model_options->memory) {
        model_options->memory /= 8 * operands->count;
        if (model_options->memory < least_memory)
            model_options->memory = least_memory;
        operands->memory_max = 2 * model_options->memory;
    }
    return memory_new(out, &memory, &error) == EBPO_OK ? EXIT_OK
                                                       : command_failed("boolean", &error);
}

static const values standard = { .query = QUERY_VALUES_INIT, .level = 6, .tolerance = 0.01 };

/* Default memory in bytes for each model with --changed-only, which reads only a part of operand A.
 * Models that fit in this memory are read completely, so it is small. */
static const uint64_t changes_memory = UINT64_C(16) << 20;

/* Opens the models, and evaluates the expression. */
static int run_expression(const values *v, const char *expression, boolean_operands *operands,
                          ebpo_boolean_options *boolean_options)
{
    boolean_nodes nodes;
    ebpo_model_options model_options;
    ebpo_inside_options inside;
    ebpo_distance_options distance;
    ebpo_workspace *workspace = NULL;
    ebpo_pose pose[BOOLEAN_OPERANDS];
    for (uint32_t i = 0; i < operands->count; i++)
        pose[i] = operands->operand[i].pose;
    if (!boolean_read("boolean", expression, operands->count, &nodes) ||
        !boolean_read_poses("boolean", &v->poses, operands->count, pose) ||
        !query_options_from("boolean", &v->query, &model_options, &inside, &distance))
        return EXIT_USAGE;
    for (uint32_t i = 0; i < operands->count; i++)
        operands->operand[i].pose = pose[i];
    int code = check_values(v, operands);
    if (code == EXIT_OK)
        code = limit_memory(v, operands, &model_options, &workspace);
    operands->raises_memory =
        v->changed_only && model_options.memory == 0 && model_options.cut_level < 0;
    if (operands->raises_memory)
        model_options.memory = changes_memory;
    if (code == EXIT_OK)
        code = boolean_operands_open(operands, "boolean", &model_options, &v->query.remote);
    if (code == EXIT_OK)
        code = evaluate_expression(v, &nodes, operands, boolean_options, workspace);
    ebpo_workspace_free(workspace);
    return code;
}

static int run_boolean(void *given, const char **operand)
{
    const values *v = given;
    boolean_operands operands;
    double box[6], plane[ARG_LIST_MAX][4];
    ebpo_boolean_options boolean_options = EBPO_BOOLEAN_OPTIONS_INIT;
    int code = boolean_operands_list(&operands, "boolean", operand + 1);
    if (code == EXIT_OK)
        code = read_regions(v, box, plane, &boolean_options);
    if (code == EXIT_OK)
        code = run_expression(v, operand[0], &operands, &boolean_options);
    boolean_operands_close(&operands);
    return code;
}

const command command_boolean = { &spec, sizeof standard, &standard, run_boolean };
