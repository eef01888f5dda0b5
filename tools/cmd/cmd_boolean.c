/* ebpo boolean: questions about unions, intersections and differences of models at poses. */
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/boolean_args.h"
#include "cli/command.h"
#include "cli/json.h"
#include "cli/points.h"
#include "cli/pose_args.h"
#include "cli/progress.h"
#include "cli/query_args.h"
#include "cli/words.h"
#include "cmd/commands.h"

enum { MODELS = ARGS_OPERANDS_MAX - 1 };

typedef struct values {
    query_values query; /* first */
    const char *inside, *distance, *out;
    arg_list poses;
    int64_t level;
    double tolerance;
    bool volume, inner;
} values;

static const arg_option options[] = {
    OPTION_TEXT("inside", 0, values, inside, "POINTS",
                "print whether each point is IN, OUT, ON the boundary, or on an edge where it may "
                "be on the boundary or not: ON?"),
    OPTION_TEXT("distance", 0, values, distance, "POINTS",
                "print two bounds of each point's distance to the boundary, and where it is"),
    OPTION_FLAG("volume", 0, values, volume,
                "print two bounds of the volume; the default unless something else is asked for"),
    OPTION_TEXT("output", 'o', values, out, "OUT",
                "write the cells that hold the result, as OUT.ply or OUT.ebpo.h5"),
    OPTION_FLAG("inner", 0, values, inner,
                "with --output: only the cells that are certainly in the result"),
    OPTION_INT("level", 0, values, level, "L", 0, EBPO_BOOLEAN_LEVEL_MAX,
               "of the cells for --volume and --output: 2^-L of a cube around the result; default "
               "6"),
    OPTION_REAL("tolerance", 0, values, tolerance, "T", 0, 1000,
                "of --distance: bounds are close enough when they differ by T times the upper one; "
                "default 0.01"),
    OPTION_LIST("pose", 0, values, poses, "POSE",
                "'B " POSE_FORM
                "': where model B is: scaled, turned by a quaternion, moved; may be "
                "repeated"),
    QUERY_MODEL_OPTIONS_FOR("opening, and for answers"),
    OPTION_FLAG("json", 0, query_values, json, "print JSON: an object, or one for each point"),
    REMOTE_HTTP_OPTIONS(query_values, remote),
    { 0 },
};

static const arg_spec spec = {
    .command = "boolean",
    .operands = "EXPRESSION MODEL...",
    .least = 2,
    .most = ARGS_OPERANDS_MAX,
    .summary = "answers for unions and differences of models: points, volume, distance",
    .text = "EXPRESSION names the models A, B, ... in their order: A | B is the union, A & B the "
            "intersection, A - B the difference, A ^ B what is in one of both only; & comes first, "
            "parentheses are heeded. Models are .ebpo.h5 files of solids. Nothing is cut: for a "
            "mesh of the result use Manifold or CGAL.",
    .options = options,
};

/* --- answers --- */

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
    if (!v->query.json)
        printf("%.17g %.17g %s%s\n", d->lo, d->hi, where_of(&d->inside), doubt_of(&d->inside));
    else
        printf("{\"lo\": %s, \"hi\": %s, \"where\": \"%s\", \"certain\": %s, \"cells\": %" PRIu64
               "}\n",
               json_number(d->lo, (char[32]){ 0 }), json_number(d->hi, (char[32]){ 0 }),
               where_of(&d->inside), d->inside.certain ? "true" : "false", d->cells);
}

static void print_volume(const values *v, const ebpo_boolean_volume *b)
{
    json j;
    if (!v->query.json) {
        printf("volume    %.17g to %.17g\ncells     %" PRIu64 " in, %" PRIu64
               " mixed of level %" PRId64 ", edge %g\ndecided   %" PRIu64 " by boxes, %" PRIu64
               " by nodes, %" PRIu64 " by faces\n",
               b->lo, b->hi, b->in_cells, b->mixed_cells, v->level, ldexp(b->edge, (int)-v->level),
               b->by_box, b->by_nodes, b->by_faces);
        return;
    }
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_real(&j, "volume_lo", b->lo);
    json_real(&j, "volume_hi", b->hi);
    json_int(&j, "level", v->level);
    json_reals(&j, "root_origin", b->origin, 3);
    json_real(&j, "root_edge", b->edge);
    json_uint(&j, "in_cells", b->in_cells);
    json_uint(&j, "mixed_cells", b->mixed_cells);
    json_uint(&j, "by_box", b->by_box);
    json_uint(&j, "by_nodes", b->by_nodes);
    json_uint(&j, "by_faces", b->by_faces);
    json_finish(&j);
}

/* --- points --- */

static ebpo_status answer_points(const values *v, ebpo_boolean *b, const double *rows,
                                 uint64_t count, ebpo_boolean_result *results, ebpo_error *error)
{
    ebpo_boundary_options how = EBPO_BOUNDARY_OPTIONS_INIT;
    how.tolerance = v->tolerance;
    ebpo_status status =
        v->inside ? ebpo_boolean_inside_many(b, rows, count, results, error) : EBPO_OK;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        ebpo_boundary_distance d;
        if (v->distance)
            status = ebpo_boolean_distance(b, rows + 3 * i, &how, &d, error);
        if (status == EBPO_OK && v->distance)
            print_distance(v, &d);
        else if (status == EBPO_OK)
            print_inside(v, &results[i]);
    }
    return status;
}

static int ask_points(const values *v, ebpo_boolean *b)
{
    points in;
    ebpo_error error = EBPO_ERROR_INIT;
    double *rows = malloc(sizeof *rows * POINTS_BATCH * POINTS_WIDEST);
    ebpo_boolean_result *results = malloc(sizeof *results * POINTS_BATCH);
    bool opened =
        points_open(&in, "boolean", v->inside ? v->inside : v->distance, POINTS, false, INFINITY);
    int code = !rows || !results ? command_no_memory("boolean") : opened ? EXIT_FINE : EXIT_FAILED;
    uint64_t count = 0;
    while (code == EXIT_FINE && (count = points_next(&in, rows)) > 0) {
        if (answer_points(v, b, rows, count, results, &error) != EBPO_OK)
            code = command_failed("boolean", &error);
        if (!command_flush("boolean"))
            code = EXIT_FAILED;
    }
    if (code == EXIT_FINE && in.failed)
        code = EXIT_FAILED;
    points_close(&in);
    free(results);
    free(rows);
    return code;
}

/* --- cells --- */

static ebpo_status convert(ebpo_mesh *mesh, const values *v, ebpo_progress progress,
                           ebpo_error *error)
{
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_prepare_options preparing = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_build_options building = EBPO_BUILD_OPTIONS_INIT;
    ebpo_write_options writing = EBPO_WRITE_OPTIONS_INIT;
    ebpo_tree tree;
    preparing.threads = building.threads = writing.threads = (unsigned)v->query.threads;
    preparing.progress = building.progress = writing.progress = progress;
    building.require_solid = true;
    ebpo_status status = ebpo_mesh_prepare(mesh, &preparing, &prepared, error);
    if (status == EBPO_OK)
        status = ebpo_build(mesh, &prepared.report, NULL, &building, &tree, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_tree_write(&tree, v->out, &writing, error);
    ebpo_tree_free(&tree);
    return status;
}

static ebpo_status write_cells(const ebpo_boolean_cells *cells, const values *v,
                               ebpo_progress progress, ebpo_error *error)
{
    ebpo_mesh mesh;
    ebpo_boolean_side side = v->inner ? EBPO_BOOLEAN_INNER : EBPO_BOOLEAN_OUTER;
    ebpo_status status = ebpo_boolean_cells_mesh(cells, side, &mesh, error);
    if (status != EBPO_OK)
        return status;
    if (mesh.face_count == 0) {
        error->status = status = EBPO_E_ABSENT;
        snprintf(error->message, sizeof error->message,
                 "%s: there are no %s cells at level %" PRId64 "; give a higher level", v->out,
                 v->inner ? "inner" : "such", v->level);
    } else if (words_end_with(v->out, ".ply")) {
        status = ebpo_mesh_write_ply(&mesh, v->out, error);
    } else {
        status = convert(&mesh, v, progress, error);
    }
    ebpo_mesh_free(&mesh);
    return status;
}

static int make_cells(const values *v, ebpo_boolean *b)
{
    progress_line line;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_boolean_cells *cells = NULL;
    ebpo_boolean_volume volume = EBPO_BOOLEAN_VOLUME_INIT;
    ebpo_cells_options how = EBPO_CELLS_OPTIONS_INIT;
    how.level = (int)v->level;
    how.progress = progress_start(&line, "boolean", v->query.json);
    ebpo_status status = ebpo_boolean_cells_new(b, &how, &cells, &error);
    if (status == EBPO_OK)
        status = ebpo_boolean_cells_volume(cells, &volume);
    if (status == EBPO_OK && v->out)
        status = write_cells(cells, v, how.progress, &error);
    progress_wipe(&line);
    if (status == EBPO_OK && (v->volume || !v->out))
        print_volume(v, &volume);
    ebpo_boolean_cells_free(cells);
    if (status != EBPO_OK)
        return command_failed("boolean", &error);
    return command_flush("boolean") ? EXIT_FINE : EXIT_FAILED;
}

/* --- all of it --- */

static int check_values(const values *v, const char **models, uint32_t count)
{
    bool points_asked = v->inside || v->distance;
    if (v->inside && v->distance)
        return command_usage("boolean", "--inside and --distance cannot be used together");
    if (points_asked && (v->volume || v->out || v->inner))
        return command_usage("boolean",
                             "%s asks about points; --volume, --output and --inner are "
                             "about cells; give them in a call of their own",
                             v->inside ? "--inside" : "--distance");
    if (v->inner && !v->out)
        return command_usage("boolean", "--inner belongs to --output");
    if (v->out && !words_end_with(v->out, ".ply") && !words_end_with(v->out, ".ebpo.h5"))
        return command_usage("boolean",
                             "--output '%s': expected a name that ends with .ply or "
                             ".ebpo.h5",
                             v->out);
    for (uint32_t i = 0; v->out && i < count; i++)
        if (command_overwrites("boolean", models[i], v->out))
            return EXIT_USAGE;
    return EXIT_FINE;
}

static int answer(const values *v, const boolean_nodes *nodes, const query_session *sessions,
                  const ebpo_pose *poses, uint32_t count)
{
    ebpo_boolean_operand operands[MODELS];
    ebpo_boolean *b;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_boolean_options how = EBPO_BOOLEAN_OPTIONS_INIT;
    how.threads = (unsigned)v->query.threads;
    for (uint32_t i = 0; i < count; i++)
        operands[i] = (ebpo_boolean_operand){ sessions[i].model, poses[i] };
    if (ebpo_boolean_new(operands, count, nodes->node, nodes->count, &how, &b, &error) != EBPO_OK)
        return command_failed("boolean", &error);
    int code = v->inside || v->distance ? ask_points(v, b) : make_cells(v, b);
    ebpo_boolean_free(b);
    return code;
}

static const values usual = { .query = QUERY_VALUES_INIT, .level = 6, .tolerance = 0.01 };

static int run(void *given, const char **operand)
{
    const values *v = given;
    boolean_nodes nodes;
    ebpo_pose poses[MODELS];
    query_session sessions[MODELS];
    ebpo_model_options holding;
    ebpo_inside_options inside;
    ebpo_distance_options distance;
    const char **models = operand + 1;
    uint32_t count = 0;
    for (; count < MODELS && models[count]; count++) {
        poses[count] = (ebpo_pose)EBPO_POSE_INIT;
        sessions[count] = (query_session)QUERY_SESSION_INIT;
    }
    if (!boolean_read("boolean", operand[0], count, &nodes) ||
        !boolean_read_poses("boolean", &v->poses, count, poses) ||
        !query_options_from("boolean", &v->query, &holding, &inside, &distance))
        return EXIT_USAGE;
    int code = check_values(v, models, count);
    for (uint32_t i = 0; i < count && code == EXIT_FINE; i++)
        code = query_open(&sessions[i], "boolean", models[i], &holding, -1, &v->query.remote);
    if (code == EXIT_FINE)
        code = answer(v, &nodes, sessions, poses, count);
    for (uint32_t i = 0; i < count; i++)
        query_close(&sessions[i]);
    return code;
}

const command command_boolean = { &spec, sizeof usual, &usual, run };
